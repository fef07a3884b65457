"""Compares an evaluation with the floors that it must not fall below. The floors may only rise.

    daymark evaluate --dataset DIR --json > evaluation.json && python3 .ci/floor.py evaluation.json
"""

import json
import sys

# (least recall at 1, least recall at zero false accepts, most negatives accepted at a stated 1 % and 0.1 %)
FLOORS = {"handheld": (0.85, 0.76, 1, 0), "board": (0.87, 0.74, 1, 0)}


def main() -> int:
    with open(sys.argv[1], encoding="utf-8") as file:
        evaluation = json.load(file)
    recall, at_zero, at_one_percent, at_one_in_thousand = FLOORS[evaluation["profile"]]
    accepted = {entry["stated"]: entry["false_accepts_on_negatives"] for entry in evaluation["at_stated_probability"]}
    checks = [
        ("recall at 1", evaluation["recall_at_1"], ">=", recall),
        ("recall at zero false accepts", evaluation["recall_at_zero_false_accepts"], ">=", at_zero),
        ("negatives accepted at 1 %", accepted[0.01], "<=", at_one_percent),
        ("negatives accepted at 0.1 %", accepted[0.001], "<=", at_one_in_thousand),
    ]
    failed = False
    for name, found, relation, bound in checks:
        holds = found >= bound if relation == ">=" else found <= bound
        failed |= not holds
        print(f"{evaluation['profile']}: {name} {found:.3f} {relation} {bound}: {'holds' if holds else 'BROKEN'}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())

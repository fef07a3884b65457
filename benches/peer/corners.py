#!/usr/bin/env python3
"""Times of OpenCV's corners, features and descriptor matching beside daymark's own, in one run.

    peer                                        daymark bench --json
    goodFeaturesToTrack, Harris, 600 corners    corners_first_level_ms (a pyramid: corners_all_levels_ms)
    ORB(600).detectAndCompute                   features_ms
    BFMatcher Hamming, 100 x 800, k = 2         view_match_us

All on one gray picture of 640 x 480 px: a made one, the same on every machine, or `--image`. Every program
gets the same pixels. OpenCV runs on one thread; pin the whole run to one core (`taskset -c 0`), children
stay there.

**Memory.** An allocator may give OpenCV's work buffers (1.2 MB a float picture) back to the system after
each call, to be paged in again by the next. That is a cost of the allocator, not of the algorithm, so this
script also runs itself with one told to keep its memory (glibc.malloc.mmap_threshold, trim_threshold and
top_pad, as GLIBC_TUNABLES and as MALLOC_*). Both times are printed, with page faults a call; glibc learns
from the first calls, so there the two may agree. Ratios are taken against the *tuned* times.

**Order.** Untuned, tuned and daymark take turns, five rounds, so a machine that slows down slows all three.
Printed are the smallest minimum and the median of the rounds' medians. Ratio = peer time / daymark time:
above 1, daymark is faster.

**What the pairs do not share.** The second and third pairs are the nearest counterparts, not the same work:
ORB describes 600 features with 256 bits in 8 levels of factor 1.2; BFMatcher only finds the two nearest of
800 256-bit descriptors for each of 100, while daymark's view match also finds and verifies the map.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT = 640, 480
CORNERS = 600
HARRIS_K = 0.05
MIN_DISTANCE_PX = 4
QUALITIES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
STORED, SEEN = 100, 800
ROUNDS = 5
WARM_UP_CALLS = 20
CALLS = {"corners_ms": 200, "orb_ms": 60, "match_us": 300}
# 32 MiB is the largest mmap threshold every glibc accepts; OpenCV's buffers here are 1.2 MB.
KEEP_BYTES = {"mmap_threshold": 32 << 20, "trim_threshold": 1 << 30, "top_pad": 64 << 20}


class UserError(Exception):
    """Something the caller can put right; the message says how."""


# ------------------------------------------------------------------------------------------ picture


def synthetic_picture() -> np.ndarray:
    """A deterministic facade-like picture: a slow gradient, 700 rectangles, noise of sigma 4 gray levels."""
    random = np.random.RandomState(1)  # this generator's stream is frozen, so the picture never changes
    coarse = random.randint(60, 200, (6, 8)).astype(np.float32)
    picture = cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
    for _ in range(700):
        x, y = random.randint(0, WIDTH), random.randint(0, HEIGHT)
        width, height = random.randint(4, 48), random.randint(4, 48)
        picture[y : y + height, x : x + width] = random.randint(20, 236)
    picture += random.normal(0.0, 4.0, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def given_picture(path: Path) -> np.ndarray:
    """The file in gray, resampled to 640 x 480 px whatever its shape."""
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if gray is None:
        raise UserError(f"cannot read {path}: give --image a JPEG or PNG file")
    return cv2.resize(gray, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)


# ------------------------------------------------------------------------------------------ one process


def find_corners(gray: np.ndarray, quality: float) -> np.ndarray | None:
    """OpenCV's Harris corners, strongest first, at least 4 px apart."""
    return cv2.goodFeaturesToTrack(
        gray, CORNERS, quality, MIN_DISTANCE_PX, useHarrisDetector=True, k=HARRIS_K
    )


def quality_that_fills(gray: np.ndarray) -> float:
    """The largest quality level (share of the strongest response) that returns all 600 corners."""
    for quality in QUALITIES:
        corners = find_corners(gray, quality)
        if corners is not None and len(corners) == CORNERS:
            return quality
    raise UserError(f"the picture has fewer than {CORNERS} corners: give --image one with more texture")


def random_descriptors(count: int, seed: int) -> np.ndarray:
    """Random 256-bit descriptors; the time of an exhaustive match does not depend on their bits."""
    return np.random.RandomState(seed).randint(0, 256, (count, 32)).astype(np.uint8)


def time_calls(function: Callable[[], object], calls: int, unit_seconds: float) -> dict:
    """Minimum and median of one call in the unit, and page faults a call, after a warm-up."""
    for _ in range(WARM_UP_CALLS):
        function()
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    times = []
    for _ in range(calls):
        start = time.perf_counter()
        function()
        times.append((time.perf_counter() - start) / unit_seconds)
    faults = resource.getrusage(resource.RUSAGE_SELF).ru_minflt - faults
    return {"min": min(times), "median": statistics.median(times), "faults": faults / calls}


def time_peer(gray: np.ndarray) -> dict:
    """All of OpenCV's times in this process."""
    cv2.setNumThreads(1)
    quality = quality_that_fills(gray)
    orb = cv2.ORB_create(nfeatures=CORNERS)
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING)
    stored, seen = random_descriptors(STORED, 1), random_descriptors(SEEN, 2)
    work = {
        "corners_ms": (lambda: find_corners(gray, quality), 1e-3),
        "orb_ms": (lambda: orb.detectAndCompute(gray, None), 1e-3),
        "match_us": (lambda: matcher.knnMatch(stored, seen, k=2), 1e-6),
    }
    times = {name: time_calls(call, CALLS[name], unit) for name, (call, unit) in work.items()}
    return {"quality": quality, **times}


# ------------------------------------------------------------------------------------------ taking turns


def tuned_environment() -> dict[str, str]:
    """This environment with an allocator that keeps freed memory instead of returning it."""
    tunables = ":".join(f"glibc.malloc.{name}={count}" for name, count in KEEP_BYTES.items())
    variables = {f"MALLOC_{name.upper()}_": str(count) for name, count in KEEP_BYTES.items()}
    return {**os.environ, "GLIBC_TUNABLES": tunables, **variables}


def run_json(command: list[str], environment: dict[str, str]) -> dict:
    """Run a program that prints one JSON object."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        reason = done.stderr.strip() or "no message"
        raise UserError(f"`{' '.join(command)}` failed ({reason}): run it by hand, or rebuild it")
    try:
        return json.loads(done.stdout)
    except json.JSONDecodeError as error:
        raise UserError(f"`{' '.join(command)}` did not print JSON ({error}): rebuild it") from None


def take_turns(picture: Path, daymark: Path | None) -> dict[str, list[dict]]:
    """Five rounds of untuned peer, tuned peer and, where there is one, daymark; progress goes to stderr."""
    peer = [sys.executable, str(Path(__file__).resolve()), "--worker", "--image", str(picture)]
    plain = dict(os.environ)
    programs = {"untuned": (peer, plain), "tuned": (peer, tuned_environment())}
    if daymark is not None:
        programs["daymark"] = ([str(daymark), "bench", "--json", "--image", str(picture)], plain)
    rounds: dict[str, list[dict]] = {name: [] for name in programs}
    for turn in range(ROUNDS):
        for name, (command, environment) in programs.items():
            print(f"round {turn + 1} of {ROUNDS}: {name}", file=sys.stderr)
            rounds[name].append(run_json(command, environment))
    return rounds


def over_rounds(rounds: list[dict], name: str) -> dict:
    """Smallest minimum and median of medians of one figure; page faults a call where they were counted."""
    try:
        figures = [turn[name] for turn in rounds]
        return {
            "min": min(figure["min"] for figure in figures),
            "median": statistics.median(figure["median"] for figure in figures),
            "faults": max(figure.get("faults", 0.0) for figure in figures),
        }
    except (KeyError, TypeError):
        raise UserError(f"daymark bench --json prints no {name} with min and median: rebuild it") from None


# ------------------------------------------------------------------------------------------ report


def print_peer(rounds: dict[str, list[dict]]) -> None:
    """OpenCV's times with both allocators."""
    quality = rounds["tuned"][0]["quality"]
    rows = {
        f"goodFeaturesToTrack, Harris, {CORNERS} corners, ms": "corners_ms",
        f"ORB({CORNERS}).detectAndCompute, ms": "orb_ms",
        f"BFMatcher Hamming {STORED} x {SEEN}, k = 2, us": "match_us",
    }
    print(f"OpenCV {cv2.__version__}, {WIDTH} x {HEIGHT}, quality level {quality:g}")
    print(f"{'':<46}{'untuned allocator':>28}{'tuned allocator':>28}")
    print(f"{'':<46}" + f"{'min':>9}{'median':>10}{'faults':>9}" * 2)
    for title, name in rows.items():
        line = "".join(
            f"{figure['min']:>9.3f}{figure['median']:>10.3f}{figure['faults']:>9.1f}"
            for figure in (over_rounds(rounds[kind], name) for kind in ("untuned", "tuned"))
        )
        print(f"{title:<46}{line}")


def print_daymark(rounds: dict[str, list[dict]]) -> None:
    """daymark's times and the ratios of the tuned peer's times to them."""
    pairs = {
        "corners_first_level_ms": "corners_ms",
        "corners_all_levels_ms": "corners_ms",
        "features_ms": "orb_ms",
        "view_match_us": "match_us",
    }
    print(f"\n{'daymark':<46}{'min':>9}{'median':>10}{'  peer (tuned) / daymark: min':>31}{'median':>9}")
    for own, other in pairs.items():
        ours, peer = over_rounds(rounds["daymark"], own), over_rounds(rounds["tuned"], other)
        ratios = f"{peer['min'] / ours['min']:>31.2f}{peer['median'] / ours['median']:>9.2f}"
        print(f"{own + ' beside ' + other:<46}{ours['min']:>9.3f}{ours['median']:>10.3f}{ratios}")


def compare(gray: np.ndarray, daymark: Path) -> None:
    """Take turns on the picture and print the report."""
    there = daymark.is_file()
    if not there:
        print(
            f"no {daymark}: only the peer is timed; `cargo build --release` or --daymark PATH adds ours",
            file=sys.stderr,
        )
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "picture.png"
        cv2.imwrite(str(picture), gray)
        rounds = take_turns(picture, daymark.resolve() if there else None)
    print_peer(rounds)
    if there:
        print_daymark(rounds)


def main() -> int:
    parser = argparse.ArgumentParser(description="Times of OpenCV's corners beside daymark's.")
    parser.add_argument(
        "--daymark", type=Path, default=Path("target/release/daymark"), help="default: %(default)s"
    )
    parser.add_argument("--image", type=Path, help="picture to use; default: a made one")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    try:
        gray = given_picture(arguments.image) if arguments.image else synthetic_picture()
        if arguments.worker:
            print(json.dumps(time_peer(gray)))
        else:
            compare(gray, arguments.daymark)
    except UserError as error:
        print(f"corners.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())

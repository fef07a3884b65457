#!/usr/bin/env python3
"""Recognition of buildings by OpenCV's features, counted by the rules daymark's own answers are counted by.

The data set is a folder with `manifest.json`:

    recognition           [{building, gallery: [file], queries: [file]}]
    negatives             [file], pictures of no enrolled building
    equivalent_buildings  [[label, label]], optional: labels of one and the same building

**From pictures to scores.** Every picture becomes gray with a longer side of 640 px (smaller ones are
enlarged). A query is matched to a stored view: for every descriptor of the query the two nearest of the
view, ratio test, robust map from the view to the query (inlier threshold 6 px, random generator seeded
anew for every match), and then

    score of a view     = distinct cells of 4 x 4 px that hold an inlier, in the view or in the query,
                          whichever is fewer; 0 where the map is degenerate (see `is_sane`)
    score of a building = the highest score of its views

Cells instead of plain inliers, because detectors stack several features on one spot and a false map draws
many features to one: counting such a spot once is what the peers do best with.

**Right.** The answer to a picture is the building of the highest score. Scores are whole numbers, so
buildings tie; the tie goes to the building named first in the manifest, whether that is the right one or
not. `tied` counts the queries where a right and a wrong building share the highest score. A picture where
no view scores above 0 has no answer: it is not right, and it accepts nothing.

    recall@1 = right queries / queries

**Zero false accepts.** The bar is the highest score that must not be accepted: the largest among the top
scores of all negatives and of all queries answered wrongly. A query counts if it is right and scores
strictly *above* that bar; a query at the bar does not count.

    recall at zero false accepts = right queries above the bar / queries

The bar is one for the whole data set; the split into street (buildings named `sf_*`: one dark view from a
street vehicle, one query by phone) and general uses the same bar.

**Size and time.** Bytes of a stored view = descriptors kept x (descriptor bytes + 4 for x and y), mean over
the gallery; SIFT is counted at one byte a component, as it can be stored. Times are means of the processor
time of the one thread, so other programs disturb them little: features of a picture (without decoding it),
and one match of a view with a query.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read by numpy when it is imported

import cv2
import numpy as np

LONGER_SIDE_PX = 640
INLIER_PX = 6.0
CELL_PX = 4.0
POSITION_BYTES = 4
RANDOM_SEED = 1
MAX_ITERATIONS = 2000
CONFIDENCE = 0.995
MAGSAC = getattr(cv2, "USAC_MAGSAC", cv2.RANSAC)


class UserError(Exception):
    """Something the caller can put right; the message says how."""


# ------------------------------------------------------------------------------------------ features


@dataclass(frozen=True)
class Features:
    """Positions in px, `(n, 2)` float32, and descriptors, `(n, d)`: uint8 bits or float32 of unit length."""

    positions: np.ndarray
    descriptors: np.ndarray


def strongest_features(detector: cv2.Feature2D, gray: np.ndarray, count: int) -> Features:
    """The `count` features of highest response; equal responses keep the detector's order."""
    keypoints, descriptors = detector.detectAndCompute(gray, None)
    if not keypoints:
        dtype = np.float32 if detector.descriptorType() == cv2.CV_32F else np.uint8
        return Features(np.zeros((0, 2), np.float32), np.zeros((0, detector.descriptorSize()), dtype))
    order = np.argsort([-keypoint.response for keypoint in keypoints], kind="stable")[:count]
    return Features(np.float32([keypoints[i].pt for i in order]), descriptors[order])


def orb(count: int) -> Callable[[np.ndarray], Features]:
    """ORB with OpenCV's defaults and at most `count` features, 32 bytes each."""
    detector = cv2.ORB_create(nfeatures=count)
    return lambda gray: strongest_features(detector, gray, count)


def akaze(count: int, threshold: float) -> Callable[[np.ndarray], Features]:
    """AKAZE, the `count` strongest features with a response above `threshold`, 61 bytes each."""
    detector = cv2.AKAZE_create(threshold=threshold)
    return lambda gray: strongest_features(detector, gray, count)


def root_sift(count: int, contrast_threshold: float) -> Callable[[np.ndarray], Features]:
    """SIFT's `count` strongest features with RootSIFT descriptors: sqrt(d / sum d), of unit length.

    Arandjelovic and Zisserman, "Three things everyone should know to improve object retrieval", 2012.
    """
    detector = cv2.SIFT_create(nfeatures=count, contrastThreshold=contrast_threshold)

    def extract(gray: np.ndarray) -> Features:
        found = strongest_features(detector, gray, count)
        total = np.maximum(found.descriptors.sum(axis=1, keepdims=True), 1e-9)
        return Features(found.positions, np.sqrt(found.descriptors / total))

    return extract


def with_local_contrast(extract: Callable[[np.ndarray], Features]) -> Callable[[np.ndarray], Features]:
    """Equalize contrast in 8 x 8 tiles (CLAHE, clip limit 3) before the features are taken."""
    equalizer = cv2.createCLAHE(clipLimit=3.0, tileGridSize=(8, 8))
    return lambda gray: extract(equalizer.apply(gray))


# ------------------------------------------------------------------------------------------ settings


@dataclass(frozen=True)
class Setting:
    """One peer: its features, the ratio test (nearest < ratio x second nearest) and the map it fits."""

    title: str
    extract: Callable[[np.ndarray], Features]
    descriptor_bytes: int
    ratio: float
    homography: bool
    method: int


def known_settings() -> dict[str, Setting]:
    """All settings by name: three of ordinary size, then four that spend far more bytes and time."""
    return {
        "orb500": Setting("ORB 500, affine, RANSAC", orb(500), 32, 0.85, False, cv2.RANSAC),
        "rootsift500": Setting(
            "RootSIFT 500, homography, RANSAC", root_sift(500, 0.01), 128, 0.8, True, cv2.RANSAC
        ),
        "akaze500": Setting("AKAZE 500, affine, RANSAC", akaze(500, 1e-4), 61, 0.85, False, cv2.RANSAC),
        "rootsift2000": Setting(
            "RootSIFT 2000, homography, MAGSAC", root_sift(2000, 0.01), 128, 0.8, True, MAGSAC
        ),
        "rootsift2000clahe": Setting(
            "RootSIFT 2000 on CLAHE, homography, MAGSAC",
            with_local_contrast(root_sift(2000, 0.01)),
            128,
            0.8,
            True,
            MAGSAC,
        ),
        "akaze2000": Setting(
            "AKAZE 2000, homography, MAGSAC", akaze(2000, 1e-4), 61, 0.85, True, MAGSAC
        ),
        "orb2000": Setting("ORB 2000, homography, MAGSAC", orb(2000), 32, 0.85, True, MAGSAC),
    }


# ------------------------------------------------------------------------------------------ one match


def nearest_two(queries: np.ndarray, stored: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For every query descriptor: index of the nearest stored one, its distance, and the second's.

    Bits: Hamming distance. Unit vectors: |q - s| = sqrt(2 - 2 q.s), by one matrix product.
    """
    if queries.dtype == np.uint8:
        distances, indices = cv2.batchDistance(
            queries, stored, cv2.CV_32S, None, None, cv2.NORM_HAMMING, 2
        )
        return indices[:, 0], distances[:, 0], distances[:, 1]
    cosines = queries @ stored.T
    rows = np.arange(len(queries))
    index = cosines.argmax(axis=1)
    first = cosines[rows, index]
    cosines[rows, index] = -1.0
    second = cosines.max(axis=1)
    return index, *(np.sqrt(np.maximum(2.0 - 2.0 * cosine, 0.0)) for cosine in (first, second))


def tentative_pairs(view: Features, query: Features, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions in the view and in the query of the pairs that pass the ratio test."""
    if len(query.positions) == 0 or len(view.positions) < 2:
        return np.zeros((0, 2), np.float32), np.zeros((0, 2), np.float32)
    index, first, second = nearest_two(query.descriptors, view.descriptors)
    kept = first < ratio * second
    return view.positions[index[kept]], query.positions[kept]


def fit_map(source: np.ndarray, target: np.ndarray, setting: Setting) -> tuple[np.ndarray | None, np.ndarray]:
    """Robust 3 x 3 map from source to target positions and its inliers; None where there is no map."""
    cv2.setRNGSeed(RANDOM_SEED)
    options = {
        "method": setting.method,
        "ransacReprojThreshold": INLIER_PX,
        "maxIters": MAX_ITERATIONS,
        "confidence": CONFIDENCE,
    }
    if setting.homography:
        matrix, mask = cv2.findHomography(source, target, **options)
    else:
        matrix, mask = cv2.estimateAffine2D(source, target, **options)
        matrix = None if matrix is None else np.vstack([matrix, [0.0, 0.0, 1.0]])
    inliers = np.zeros(len(source), bool) if mask is None else mask.ravel() > 0
    return matrix, inliers


def is_sane(matrix: np.ndarray, centre: np.ndarray) -> bool:
    """Whether a map could be that of an upright building, by its Jacobian J at `centre` (px).

    Refused: scale w < 0.2; det J outside (0.02, 40), which also refuses mirrors; singular values of J in a
    ratio above 3.5; axes turned over (a diagonal entry of J not positive); the vertical turned by more than
    0.45 rad, |J01| > tan(0.45) J11.
    """
    scale = matrix[2, :2] @ centre + matrix[2, 2]
    if scale < 0.2:
        return False
    mapped = (matrix[:2, :2] @ centre + matrix[:2, 2]) / scale
    jacobian = (matrix[:2, :2] - np.outer(mapped, matrix[2, :2])) / scale
    determinant = np.linalg.det(jacobian)
    if not 0.02 < determinant < 40.0:
        return False
    largest, smallest = np.linalg.svd(jacobian, compute_uv=False)
    upright = abs(jacobian[0, 1]) <= np.tan(0.45) * jacobian[1, 1]
    return bool(largest <= 3.5 * smallest and jacobian[0, 0] > 0 and jacobian[1, 1] > 0 and upright)


def distinct_cells(positions: np.ndarray) -> int:
    """How many cells of 4 x 4 px hold at least one of the positions (px)."""
    return len(np.unique(np.floor(positions / CELL_PX).astype(np.int64), axis=0))


def match_score(view: Features, query: Features, setting: Setting) -> int:
    """Score of one stored view against one query, in cells; see the top of this file."""
    source, target = tentative_pairs(view, query, setting.ratio)
    if len(source) < 4:
        return 0
    matrix, inliers = fit_map(source, target, setting)
    if matrix is None or not inliers.any() or not is_sane(matrix, source[inliers].mean(axis=0)):
        return 0
    return min(distinct_cells(source[inliers]), distinct_cells(target[inliers]))


# ------------------------------------------------------------------------------------------ data set


@dataclass(frozen=True)
class Dataset:
    """Views as (building, file), queries as (building, file), negatives as files, all in manifest order."""

    folder: Path
    views: list[tuple[str, str]]
    queries: list[tuple[str, str]]
    negatives: list[str]
    equivalents: list[set[str]]

    def same_building(self, one: str, other: str) -> bool:
        """Whether two labels name one building."""
        return one == other or any({one, other} <= labels for labels in self.equivalents)


def load_dataset(folder: Path) -> Dataset:
    """Read `manifest.json` and check that every picture it names is there."""
    path = folder / "manifest.json"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        buildings = manifest["recognition"]
        dataset = Dataset(
            folder,
            [(b["building"], file) for b in buildings for file in b["gallery"]],
            [(b["building"], file) for b in buildings for file in b["queries"]],
            list(manifest["negatives"]),
            [set(labels) for labels in manifest.get("equivalent_buildings", [])],
        )
    except FileNotFoundError:
        raise UserError(f"no {path}: give --dataset a folder that holds manifest.json") from None
    except json.JSONDecodeError as error:
        raise UserError(f"{path} is not JSON ({error}): repair that line") from None
    except (KeyError, TypeError) as error:
        raise UserError(
            f"{path} lacks {error}: it needs `recognition` (each with building, gallery, queries)"
            " and `negatives`"
        ) from None
    if not dataset.views or not dataset.queries:
        raise UserError(f"{path} names no gallery picture or no query: add at least one of each")
    files = [file for _, file in dataset.views + dataset.queries] + dataset.negatives
    missing = [file for file in dict.fromkeys(files) if not (folder / file).is_file()]
    if missing:
        raise UserError(
            f"{len(missing)} pictures of {path} are missing, first {missing[0]}:"
            " complete the folder or take them out of the manifest"
        )
    return dataset


def load_gray(path: Path) -> np.ndarray:
    """The picture in gray, longer side 640 px: area-averaged when shrunk, bilinear when enlarged."""
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if gray is None:
        raise UserError(f"cannot decode {path}: replace it with a JPEG or PNG, or drop it from the manifest")
    scale = LONGER_SIDE_PX / max(gray.shape)
    size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
    return cv2.resize(gray, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)


# ------------------------------------------------------------------------------------------ figures


@dataclass
class Stopwatch:
    """Seconds of processor time spent and times used."""

    seconds: float = 0.0
    uses: int = 0

    def run(self, function: Callable, *arguments):
        """Call and time the function."""
        start = time.process_time()
        result = function(*arguments)
        self.seconds += time.process_time() - start
        self.uses += 1
        return result

    def mean_ms(self) -> float:
        """Mean of one use in milliseconds, 0 if unused."""
        return 1e3 * self.seconds / max(self.uses, 1)


@dataclass(frozen=True)
class Answer:
    """Best building of a picture (None where nothing scored), its score, and whether others share it."""

    building: str | None
    score: int
    sharing: tuple[str, ...]


def answer_of(buildings: list[str], scores: list[int]) -> Answer:
    """The building of the highest score; of equal ones, the first in the gallery."""
    top = max(scores)
    if top == 0:
        return Answer(None, 0, ())
    sharing = tuple(dict.fromkeys(b for b, score in zip(buildings, scores) if score == top))
    return Answer(sharing[0], top, sharing)


def recall(counted: list[bool], chosen: list[bool]) -> float | None:
    """Share of the chosen queries that counted; None where none was chosen."""
    total = sum(chosen)
    return sum(c for c, take in zip(counted, chosen) if take) / total if total else None


def recall_figures(dataset: Dataset, queries: list[Answer], negatives: list[Answer]) -> dict:
    """Recall at rank one and at zero false accepts, over all queries and split; see the top of this file."""
    labels = [label for label, _ in dataset.queries]
    is_right = [
        answer.building is not None and dataset.same_building(label, answer.building)
        for label, answer in zip(labels, queries)
    ]
    is_tied = [
        len({dataset.same_building(label, other) for other in answer.sharing}) == 2
        for label, answer in zip(labels, queries)
    ]
    highest_negative = max((answer.score for answer in negatives), default=0)
    highest_wrong = max((a.score for a, right in zip(queries, is_right) if not right), default=0)
    bar = max(highest_negative, highest_wrong)
    is_above = [right and answer.score > bar for right, answer in zip(is_right, queries)]
    street = [label.startswith("sf_") for label in labels]
    groups = {"all": [True] * len(labels), "street": street, "general": [not s for s in street]}
    return {
        "queries": {name: sum(chosen) for name, chosen in groups.items()},
        "recall_at_1": {name: recall(is_right, chosen) for name, chosen in groups.items()},
        "recall_at_zero_false_accepts": {
            name: recall(is_above, chosen) for name, chosen in groups.items()
        },
        "highest_negative_score": highest_negative,
        "highest_wrong_score": highest_wrong,
        "tied": sum(is_tied),
    }


def measure(name: str, setting: Setting, dataset: Dataset) -> dict:
    """Run one setting over the data set; progress goes to stderr."""
    extracting, matching = Stopwatch(), Stopwatch()

    def features(file: str) -> Features:
        return extracting.run(setting.extract, load_gray(dataset.folder / file))

    views = [features(file) for _, file in dataset.views]
    buildings = [building for building, _ in dataset.views]
    files = [file for _, file in dataset.queries] + dataset.negatives
    answers = []
    for done, file in enumerate(files):
        query = features(file)
        scores = [matching.run(match_score, view, query, setting) for view in views]
        answers.append(answer_of(buildings, scores))
        print(f"\r{name}: {done + 1} of {len(files)} pictures", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    record = setting.descriptor_bytes + POSITION_BYTES
    return {
        "setting": name,
        "title": setting.title,
        **recall_figures(dataset, answers[: len(dataset.queries)], answers[len(dataset.queries) :]),
        "view_bytes": record * float(np.mean([len(view.positions) for view in views])),
        "features_ms": extracting.mean_ms(),
        "match_ms": matching.mean_ms(),
    }


# ------------------------------------------------------------------------------------------ command line


def share_cell(value: float | None) -> str:
    """A share with three decimals, a dash where there is none."""
    return "    -" if value is None else f"{value:.3f}"


def print_table(results: list[dict]) -> None:
    """One line a setting; R@1 / R0FA are recall at rank one and at zero false accepts."""
    counts = results[0]["queries"]
    print(
        f"{'setting':<44}{'all ' + str(counts['all']):>15}{'street ' + str(counts['street']):>15}"
        f"{'general ' + str(counts['general']):>15}{'negative':>10}{'wrong':>7}{'tied':>6}"
        f"{'bytes/view':>12}{'features':>11}{'match':>10}"
    )
    print(f"{'':<44}" + f"{'R@1 / R0FA':>15}" * 3 + f"{'score':>10}{'score':>7}{'':>18}{'ms':>11}{'ms':>10}")
    for result in results:
        first, zero = result["recall_at_1"], result["recall_at_zero_false_accepts"]
        shares = "".join(
            f"{share_cell(first[group])} / {share_cell(zero[group])}".rjust(15)
            for group in ("all", "street", "general")
        )
        print(
            f"{result['title']:<44}{shares}{result['highest_negative_score']:>10}"
            f"{result['highest_wrong_score']:>7}{result['tied']:>6}{result['view_bytes']:>12.0f}"
            f"{result['features_ms']:>11.2f}{result['match_ms']:>10.3f}"
        )


def choose(settings: dict[str, Setting], names: str) -> dict[str, Setting]:
    """The settings of a comma-separated list, in its order."""
    unknown = [name for name in names.split(",") if name not in settings]
    if unknown:
        raise UserError(f"no setting {unknown[0]!r}: choose from {', '.join(settings)}")
    return {name: settings[name] for name in names.split(",")}


def main() -> int:
    settings = known_settings()
    parser = argparse.ArgumentParser(description="Recognition of buildings by OpenCV's features.")
    parser.add_argument("--dataset", type=Path, required=True, help="folder that holds manifest.json")
    parser.add_argument("--settings", default=",".join(settings), help="default: %(default)s")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    try:
        chosen = choose(settings, arguments.settings)
        dataset = load_dataset(arguments.dataset)
        results = [measure(name, setting, dataset) for name, setting in chosen.items()]
    except UserError as error:
        print(f"recognition.py: {error}", file=sys.stderr)
        return 2
    if arguments.json:
        print(json.dumps({"schema_version": 1, "opencv": cv2.__version__, "settings": results}, indent=1))
    else:
        print_table(results)
    return 0


if __name__ == "__main__":
    sys.exit(main())

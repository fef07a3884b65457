#!/usr/bin/env python3
"""Camera centres and reprojection errors from pictures alone: OpenCV beside `daymark synthesize`, in one run.

    peer       SIFT (contrast threshold 0.01), ratio test 0.8 both ways, findEssentialMat (5 points, RANSAC, 1 px),
               recoverPose, triangulatePoints; views are chained, each step's length from the points it shares with the
               step before; no bundle adjustment, as OpenCV has none
    daymark    `daymark synthesize --focal-px F --json`: the same pictures and focal length

Both see the same pictures at the same size. The truth: a folder of `.camera` files (Strecha) or a COLMAP text model. Centres
are compared after the similarity that fits them best; errors are shares of the mean distance between successive true
centres. The reprojection error of the peer is that of its two-view points (median of the pairs' RMS over inliers).

Where the truth has points (COLMAP's points3D.txt) the distance of daymark's points from the surface there is told, too: from
the plane through the eight nearest of them, after the same similarity, as a share of the mean distance to the cameras.

    python3 benches/peer/reconstruction.py --images DIR --truth DIR --focal-px F [--daymark target/release/daymark]
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

SIDE = 1600


def truth_of(folder: Path) -> dict[str, np.ndarray]:
    """Camera centres by file name."""
    centres = {}
    for path in sorted(folder.glob("*.camera")):
        numbers = np.array(path.read_text().split(), float)
        centres[path.name.removesuffix(".camera")] = numbers[21:24]
    images = folder / "images.txt"
    if images.is_file():
        lines = [line for line in images.read_text().splitlines() if not line.startswith("#")]
        for line in lines[::2]:
            words = line.split()
            w, x, y, z = map(float, words[1:5])
            turn = np.array([
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ])
            centres[words[9]] = -turn.T @ np.array(words[5:8], float)
    if not centres:
        sys.exit(f"{folder} has neither .camera files nor images.txt")
    return centres


def similarity(found: dict[str, np.ndarray], truth: dict[str, np.ndarray]):
    """Both lists of centres, and the map from one to the other that fits best."""
    names = sorted(name for name in found if name in truth)
    a = np.array([found[name] for name in names])
    b = np.array([truth[name] for name in names])
    ca, cb = a.mean(0), b.mean(0)
    u, s, vt = np.linalg.svd((b - cb).T @ (a - ca))
    signs = np.array([1, 1, np.sign(np.linalg.det(u @ vt))])
    turn = u @ np.diag(signs) @ vt
    scale = (s * signs).sum() / ((a - ca) ** 2).sum()
    return a, b, lambda points: scale * (points - ca) @ turn.T + cb


def errors(found: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> dict[str, float]:
    """Distances of the centres after the best similarity, as shares of the mean step between true centres."""
    a, b, moved = similarity(found, truth)
    off = np.linalg.norm(moved(a) - b, axis=1)
    step = np.linalg.norm(np.diff(b, axis=0), axis=1).mean()
    return {"views": len(a), "largest_share": float(off.max() / step), "mean_share": float(off.mean() / step)}


def points_of(folder: Path) -> np.ndarray | None:
    """COLMAP's points that three views or more see within a pixel; None if there are none."""
    path = folder / "points3D.txt"
    if not path.is_file():
        return None
    rows = [line.split() for line in path.read_text().splitlines() if line and not line.startswith("#")]
    good = [row[1:4] for row in rows if float(row[7]) < 1.0 and len(row) >= 8 + 2 * 3]
    return np.array(good, float)


def vertices_of(path: Path, count: int) -> np.ndarray:
    """The first points of a binary PLY file as daymark writes it."""
    content = path.read_bytes()
    body = content[content.index(b"end_header\n") + len(b"end_header\n"):]
    kind = np.dtype([("at", "<f4", 3), ("rgb", "u1", 3), ("deviation", "<f4")])
    return np.frombuffer(body, kind, count)["at"].astype(float)


def surface_distances(points: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Distance of each point from the plane through the eight nearest of the reference."""
    off = []
    for part in np.array_split(points, max(1, len(points) // 256)):
        squared = (part**2).sum(1)[:, None] - 2 * part @ reference.T + (reference**2).sum(1)
        near = reference[np.argpartition(squared, 8, axis=1)[:, :8]]
        middle = near.mean(1, keepdims=True)
        normal = np.linalg.svd(near - middle)[2][:, 2]
        off.append(np.abs(((part - middle[:, 0]) * normal).sum(1)))
    return np.concatenate(off)


def opencv(paths: list[Path], focal: float) -> tuple[dict[str, np.ndarray], float]:
    """Centres by chaining pairs, and the median RMS reprojection error of the pairs."""
    sift = cv2.SIFT_create(contrastThreshold=0.01, nfeatures=4000)
    pictures, features = [], []
    for path in paths:
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        scale = min(1.0, SIDE / max(picture.shape))
        picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        pictures.append(picture)
        features.append(sift.detectAndCompute(picture, None))
    height, width = pictures[0].shape
    k = np.array([[focal * scale, 0, (width - 1) / 2], [0, focal * scale, (height - 1) / 2], [0, 0, 1]])
    matcher = cv2.BFMatcher()

    def matches(a: int, b: int) -> dict[int, int]:
        def one_way(p: int, q: int) -> dict[int, int]:
            pairs = matcher.knnMatch(features[p][1], features[q][1], k=2)
            return {m.queryIdx: m.trainIdx for m, n in pairs if m.distance < 0.8 * n.distance}
        forward, back = one_way(a, b), one_way(b, a)
        return {i: j for i, j in forward.items() if back.get(j) == i}

    turn, centre = np.eye(3), np.zeros(3)
    centres = {paths[0].name: centre}
    before: dict[int, np.ndarray] = {}
    residuals = []
    for number in range(len(paths) - 1):
        pairs = list(matches(number, number + 1).items())
        p = np.array([features[number][0][i].pt for i, _ in pairs])
        q = np.array([features[number + 1][0][j].pt for _, j in pairs])
        cv2.setRNGSeed(1)
        essential, mask = cv2.findEssentialMat(p, q, k, cv2.RANSAC, 0.999, 1.0)
        _, r, t, mask = cv2.recoverPose(essential, p, q, k, mask=mask)
        inside = mask.ravel() > 0
        first, second = k @ np.hstack([np.eye(3), np.zeros((3, 1))]), k @ np.hstack([r, t])
        points = cv2.triangulatePoints(first, second, p[inside].T, q[inside].T)
        points = (points[:3] / points[3]).T
        off = []
        for matrix, seen in ((first, p[inside]), (second, q[inside])):
            image = np.hstack([points, np.ones((len(points), 1))]) @ matrix.T
            off.append(image[:, :2] / image[:, 2:] - seen)
        residuals.append(np.sqrt((np.vstack(off) ** 2).sum(1).mean()))
        chosen = [pair for pair, ok in zip(pairs, inside) if ok]
        ratios = [np.linalg.norm(before[i]) / np.linalg.norm(point)
                  for (i, _), point in zip(chosen, points) if i in before and point[2] > 0]
        length = float(np.median(ratios)) if ratios else 1.0
        # The next view's frame: x' = r x + length t.
        before = {j: r @ (point * length) + t.ravel() * length for (_, j), point in zip(chosen, points)}
        centre = centre + turn.T @ (-r.T @ t.ravel() * length)
        turn = r @ turn
        centres[paths[number + 1].name] = centre
    return centres, float(np.median(residuals))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=Path, required=True)
    parser.add_argument("--truth", type=Path, required=True)
    parser.add_argument("--focal-px", type=float, required=True, help="in pixels of the files")
    parser.add_argument("--daymark", type=Path, default=Path("target/release/daymark"))
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    paths = sorted(path for path in args.images.iterdir() if path.suffix.lower() in (".jpg", ".jpeg", ".png"))
    truth = truth_of(args.truth)
    centres, rms = opencv(paths, args.focal_px)
    result = {"opencv": {**errors(centres, truth), "reprojection_rms_px": rms, "version": cv2.__version__}}
    with tempfile.TemporaryDirectory() as folder:
        command = [str(args.daymark), "synthesize", *map(str, paths), "--focal-px", str(args.focal_px), "--side", str(SIDE),
                   "--levels", "0", "--json", "-o", f"{folder}/model.ply"]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            sys.exit(f"daymark: exit {run.returncode}: {run.stderr}")
        facts = json.loads(run.stdout)
        vertices = vertices_of(Path(folder) / "model.ply", facts["points"])
    ours = {view["file"]: np.array(view["position"]) for view in facts["views"] if view["position"]}
    result["daymark"] = {**errors(ours, truth), "reprojection_rms_px": facts["reprojection_rms_px"]}
    reference = points_of(args.truth)
    if reference is not None:
        _, centres, moved = similarity(ours, truth)
        points = moved(vertices)
        distance = np.linalg.norm(points[:, None] - centres, axis=2).mean()
        off = surface_distances(points, reference) / distance
        result["daymark"]["surface_median_share"] = float(np.median(off))
        result["daymark"]["surface_p95_share"] = float(np.quantile(off, 0.95))
    if args.json:
        print(json.dumps(result, indent=1))
        return
    print(f"{'':10}{'views':>7}{'largest error':>15}{'mean error':>12}{'reprojection':>14}")
    for name in ("opencv", "daymark"):
        row = result[name]
        print(f"{name:10}{row['views']:>7}{row['largest_share']:>14.2%} {row['mean_share']:>11.2%}"
              f"{row['reprojection_rms_px']:>11.2f} px")
    if "surface_median_share" in result["daymark"]:
        row = result["daymark"]
        print(f"daymark's points from the reference's surface: median {row['surface_median_share']:.3%}, "
              f"95 % {row['surface_p95_share']:.3%} of their distance from the cameras ({len(reference)} reference points)")


if __name__ == "__main__":
    main()

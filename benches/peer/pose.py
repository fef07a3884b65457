#!/usr/bin/env python3
"""Poses of real photographs: daymark's pose step beside OpenCV's solvePnPRansac, on the same correspondences.

A folder of photographs with known cameras in `gt/`: Strecha's `.camera` files, or COLMAP's `cameras.txt` and `images.txt`
(`SIMPLE_RADIAL`; features are freed of the distortion). Each photograph is left out in turn: SIFT
features of the others are matched and triangulated with their known cameras, the left-out photograph's features are matched with
those points (ratio test 0.8), and both programs find its pose from these 2D-3D correspondences, wrong ones among them. Printed
are the error of the camera's centre, as a share of the distance to the points, and of its rotation.

    cargo build --release --manifest-path benches/pose/Cargo.toml
    python3 benches/peer/pose.py --photos DIR --daymark benches/pose/target/release/daymark-pose-bench

What is shared: features, matches, triangulated points, the camera's calibration. What is compared: the pose alone. OpenCV gets
its default solver (EPnP in RANSAC, 8 px, 1,000 rounds at most) and its Levenberg-Marquardt refinement of the inliers.
"""

import argparse
import itertools
import subprocess
import time
from pathlib import Path

import cv2
import numpy as np

RATIO = 0.8
FEATURES = 4000
MOST = 2000
DEVIATION_PX = 1.0


def colmap(folder):
    """Size, lens and place by name."""
    rows = lambda name: [line.split() for line in (folder / name).read_text().splitlines() if line and line[0] != "#"]
    lenses = {row[0]: row[1:] for row in rows("cameras.txt")}
    views = {}
    for row in rows("images.txt")[::2]:
        kind, width, height, focal, x, y, radial = lenses[row[8]]
        if kind != "SIMPLE_RADIAL":
            raise SystemExit(f"{folder}: {kind} is not read, only SIMPLE_RADIAL")
        w, *v = (float(word) for word in row[1:5])
        v = np.array(v)
        across = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        rotation = (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * across
        step = np.array([float(word) for word in row[5:8]])
        # COLMAP puts the centre of the first pixel at (0.5, 0.5).
        matrix = np.array([[float(focal), 0, float(x) - 0.5], [0, float(focal), float(y) - 0.5], [0, 0, 1]])
        views[row[9]] = (float(width), matrix, rotation, -rotation.T @ step, float(radial))
    return views


def scaled(matrix, scale):
    """The picture is scaled by areas of pixels: the centre of the first pixel moves."""
    matrix = matrix.copy()
    matrix[:2] *= scale
    matrix[:2, 2] += 0.5 * scale - 0.5
    return matrix


def strecha(path):
    numbers = [float(word) for word in path.read_text().split()]
    matrix = np.array(numbers[:9]).reshape(3, 3)
    rotation = np.array(numbers[12:21]).reshape(3, 3).T
    return numbers[24], matrix, rotation, np.array(numbers[21:24]), 0.0


def matched(one, two):
    """Pairs of numbers of features that are nearest to each other, and nearer than RATIO of the next."""
    squared = lambda a: np.sum(a * a, axis=1)
    distances = np.sqrt(np.maximum(squared(one)[:, None] + squared(two)[None] - 2 * one @ two.T, 0))
    order = np.argpartition(distances, 1, axis=1)[:, :2]
    rows = np.arange(len(one))
    first, second = distances[rows, order[:, 0]], distances[rows, order[:, 1]]
    best = np.where(first <= second, order[:, 0], order[:, 1])
    ratio = np.minimum(first, second) / np.maximum(np.maximum(first, second), 1e-9)
    back = np.argmin(distances, axis=0)
    good = (ratio < RATIO) & (back[best] == rows)
    return np.stack([rows[good], best[good]], axis=1), ratio[good]


def projection(view):
    matrix, rotation, centre = view
    return matrix @ np.hstack([rotation, (-rotation @ centre)[:, None]])


def triangulated(views, features, pairs, left_out):
    """Points of the model by (photograph, feature)."""
    points = {}
    for (i, j), found in pairs.items():
        if left_out in (i, j) or len(found[0]) < 8:
            continue
        a = features[i][0][found[0][:, 0]]
        b = features[j][0][found[0][:, 1]]
        P, Q = projection(views[i]), projection(views[j])
        X = cv2.triangulatePoints(P, Q, a.T.astype(float), b.T.astype(float))
        X = (X[:3] / X[3]).T
        good = np.ones(len(X), bool)
        for M, seen in ((P, a), (Q, b)):
            x = X @ M[:, :3].T + M[:, 3]
            good &= (x[:, 2] > 0) & (np.linalg.norm(x[:, :2] / x[:, 2:] - seen, axis=1) < 2.0)
        u, v = X - views[i][2], X - views[j][2]
        cosine = np.sum(u * v, axis=1) / np.linalg.norm(u, axis=1) / np.linalg.norm(v, axis=1)
        good &= cosine < np.cos(np.radians(2.0))
        for (k, l), x in zip(found[0][good], X[good]):
            points.setdefault((i, k), x)
            points.setdefault((j, l), x)
    return points


def correspondences(features, pairs, points, left_out):
    best = {}
    for (i, j), (found, ratios) in pairs.items():
        if left_out not in (i, j):
            continue
        for (k, l), ratio in zip(found, ratios):
            own, other = (k, (j, l)) if i == left_out else (l, (i, k))
            if other in points and ratio < best.get(own, (2.0,))[0]:
                best[own] = (ratio, points[other])
    chosen = sorted(best.items(), key=lambda item: item[1][0])[:MOST]
    seen = np.array([features[left_out][0][own] for own, _ in chosen], float)
    return np.array([x for _, (_, x) in chosen]), seen


def by_opencv(model, seen, matrix):
    start = time.perf_counter()
    found, turn, step, inliers = cv2.solvePnPRansac(model, seen, matrix, None, iterationsCount=1000)
    if not found:
        return None
    inside = inliers.ravel()
    turn, step = cv2.solvePnPRefineLM(model[inside], seen[inside], matrix, None, turn, step)
    micros = (time.perf_counter() - start) * 1e6
    rotation = cv2.Rodrigues(turn)[0]
    return rotation, (-rotation.T @ step).ravel(), len(inside), micros


def by_daymark(program, model, seen, matrix, size):
    lines = [f"{matrix[0, 0]} {matrix[1, 1]} {matrix[0, 2]} {matrix[1, 2]} {size[0]} {size[1]} {DEVIATION_PX} {len(model)}"]
    lines += [" ".join(repr(float(x)) for x in row) for row in np.hstack([model, seen])]
    done = subprocess.run([program, "solve"], input="\n".join(lines) + "\n", capture_output=True, text=True, check=True)
    words = done.stdout.split()
    if words[0] == "none":
        return None
    numbers = [float(word) for word in words]
    return np.array(numbers[:9]).reshape(3, 3), np.array(numbers[9:12]), int(numbers[12]), numbers[13]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=Path, required=True, help="folder of photographs with gt/NAME.camera")
    parser.add_argument("--daymark", required=True, help="the program of benches/pose")
    parser.add_argument("--width", type=int, default=1536, help="photographs are made this wide")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    sift = cv2.SIFT_create(FEATURES)
    views, features, size = [], [], None
    known = {}
    for list_file in options.photos.glob("gt/**/images.txt"):
        known.update(colmap(list_file.parent))
    for path in options.photos.glob("gt/*.camera"):
        known[path.stem] = strecha(path)
    for name in sorted(known):
        path = options.photos / name
        said_width, matrix, rotation, centre, radial = known[name]
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        scale = options.width / picture.shape[1]
        picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        size = picture.shape[::-1]
        views.append((scaled(matrix, options.width / said_width), rotation, centre))
        keypoints, descriptors = sift.detectAndCompute(picture, None)
        seen = np.array([point.pt for point in keypoints])
        lens = views[-1][0]
        seen = cv2.undistortPoints(seen[:, None], lens, np.array([radial, 0, 0, 0]), P=lens)[:, 0]
        features.append((seen, descriptors))
    pairs = {(i, j): matched(features[i][1], features[j][1]) for i, j in itertools.combinations(range(len(views)), 2)}

    print(f"{'photo':>5} {'pairs':>6} {'program':>8} {'inliers':>8} {'centre, %':>10} {'rotation, deg':>14} {'us':>9}")
    errors = {"daymark": [], "OpenCV": []}
    for left_out, (matrix, rotation, centre) in enumerate(views):
        points = triangulated(views, features, pairs, left_out)
        model, seen = correspondences(features, pairs, points, left_out)
        far = np.median(np.linalg.norm(model - centre, axis=1))
        answers = {
            "daymark": by_daymark(options.daymark, model, seen, matrix, size),
            "OpenCV": by_opencv(model, seen, matrix),
        }
        for program, answer in answers.items():
            if answer is None:
                print(f"{left_out:5} {len(model):6} {program:>8}     none")
                errors[program].append((np.inf, np.inf))
                continue
            found, at, inliers, micros = answer
            off = np.linalg.norm(at - centre) / far
            turn = np.degrees(2 * np.arcsin(np.linalg.norm(found - rotation) / np.sqrt(8)))
            errors[program].append((off, turn))
            print(f"{left_out:5} {len(model):6} {program:>8} {inliers:8} {100 * off:10.4f} {turn:14.4f} {micros:9.0f}")
    for program, all_errors in errors.items():
        off, turn = np.median(np.array(all_errors), axis=0)
        print(f"median {program:>12}: centre {100 * off:.4f} % of the distance, rotation {turn:.4f} degrees")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Two pictures of 640 x 480 to points: OpenCV beside daymark, in turns, one thread.

    peer       SIFT (contrast threshold 0.01, at most 4000), ratio test 0.8 both ways by brute force, findEssentialMat
               (5 points, RANSAC, 1 px), recoverPose, triangulatePoints: points, and nothing between them
    daymark    the same way and on: adjustment, surface, best views, subdivision to level 4 with colours

Neither reads or writes a file. Printed are the least and the median of each program's milliseconds, on the wall and of the
processor: on a busy machine the second says more.

    cargo build --release --manifest-path benches/synthesis/Cargo.toml
    python3 benches/peer/two_views.py --images A B --focal-px F [--width 640] [--daymark benches/synthesis/target/release/whole]
"""

import argparse
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np


def opencv(pictures: list[np.ndarray], focal: float) -> int:
    """The number of points."""
    sift = cv2.SIFT_create(contrastThreshold=0.01, nfeatures=4000)
    (p, a), (q, b) = (sift.detectAndCompute(picture, None) for picture in pictures)
    height, width = pictures[0].shape
    k = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    matcher = cv2.BFMatcher()

    def one_way(x: np.ndarray, y: np.ndarray) -> dict[int, int]:
        return {m.queryIdx: m.trainIdx for m, n in matcher.knnMatch(x, y, k=2) if m.distance < 0.8 * n.distance}

    forward, back = one_way(a, b), one_way(b, a)
    pairs = [(i, j) for i, j in forward.items() if back.get(j) == i]
    left = np.array([p[i].pt for i, _ in pairs])
    right = np.array([q[j].pt for _, j in pairs])
    cv2.setRNGSeed(1)
    essential, mask = cv2.findEssentialMat(left, right, k, cv2.RANSAC, 0.999, 1.0)
    _, r, t, mask = cv2.recoverPose(essential, left, right, k, mask=mask)
    inside = mask.ravel() > 0
    first, second = k @ np.hstack([np.eye(3), np.zeros((3, 1))]), k @ np.hstack([r, t])
    return cv2.triangulatePoints(first, second, left[inside].T, right[inside].T).shape[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=Path, nargs=2, required=True)
    parser.add_argument("--focal-px", type=float, required=True, help="in pixels of the files")
    parser.add_argument("--width", type=int, default=640, help="pictures are scaled to this height times 4/3 and cut to it")
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--daymark", type=Path, default=Path("benches/synthesis/target/release/whole"))
    args = parser.parse_args()
    cv2.setNumThreads(1)
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        height = args.width * 3 // 4
        for number, path in enumerate(args.images):
            picture = cv2.imread(str(path))
            scale = max(height / picture.shape[0], args.width / picture.shape[1])
            size = [round(length * scale) for length in picture.shape[1::-1]]
            picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
            x, y = (size[0] - args.width) // 2, (size[1] - height) // 2
            picture = picture[y:y + height, x:x + args.width]
            paths.append(f"{folder}/{number}.png")
            cv2.imwrite(paths[-1], picture)
            pictures.append(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
        focal = args.focal_px * scale
        process = subprocess.Popen([str(args.daymark), "--turns", *paths, str(focal), str(args.width)],
                                   stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        times = {"opencv": [], "daymark": []}
        for _ in range(args.rounds):
            wall, processor = time.perf_counter(), time.process_time()
            points = opencv(pictures, focal)
            times["opencv"].append((1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - processor)))
            process.stdin.write("\n")
            process.stdin.flush()
            wall, processor, said = process.stdout.readline().split(" ", 2)
            times["daymark"].append((float(wall), float(processor)))
        process.stdin.close()
        process.wait()
    print(f"{'':9}{'wall: least':>13}{'median':>9}{'processor: least':>19}{'median':>9}   milliseconds")
    for name, rows in times.items():
        wall, processor = zip(*rows)
        print(f"{name:9}{min(wall):13.1f}{statistics.median(wall):9.1f}{min(processor):19.1f}"
              f"{statistics.median(processor):9.1f}   {f'{points} points' if name == 'opencv' else said.strip()}")


if __name__ == "__main__":
    main()

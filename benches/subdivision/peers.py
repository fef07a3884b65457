#!/usr/bin/env python3
"""Midpoint subdivision by libigl and Open3D beside daymark's, on the same meshes, in the same run.

    taskset -c 0 python3 peers.py PROGRAM

PROGRAM is daymark-subdivision-bench, built with --release; it prints the meshes. Open3D may be missing.
The programs take turns, `--rounds` times; printed are the medians over the meshes of each mesh's best time.
Ratio = peer / daymark: above 1, daymark is faster. What the pairs do not share stands in README.md.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import igl
import numpy as np

try:
    import open3d
except ImportError:
    open3d = None

LEVELS = {1: "level_1_seconds", 7: "level_7_indexed_space_seconds"}
Subdivide = Callable[[int], tuple[int, int]]


def libigl_task(points: np.ndarray, triangles: np.ndarray) -> Subdivide:
    def subdivide(level: int) -> tuple[int, int]:
        fine_points, fine_triangles = igl.upsample(points, triangles, level)
        return len(fine_points), len(fine_triangles)

    return subdivide


def open3d_task(points: np.ndarray, triangles: np.ndarray) -> Subdivide:
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(points), open3d.utility.Vector3iVector(triangles)
    )

    def subdivide(level: int) -> tuple[int, int]:
        fine = mesh.subdivide_midpoint(level)
        # No copies into numpy: representation only.
        return len(fine.vertices), len(fine.triangles)

    return subdivide


def best(subdivide: Subdivide, level: int, times: int) -> float:
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        for _ in range(times):
            subdivide(level)
        seconds.append((time.perf_counter() - start) / times)
    return min(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", help="daymark-subdivision-bench, built with --release")
    parser.add_argument("--rounds", type=int, default=3, help="how often the programs take turns")
    parser.add_argument("--meshes", type=int, default=101, help="meshes for level 1 (level 7: a tenth)")
    options = parser.parse_args()

    lines = subprocess.run([options.program, "--meshes"], check=True, capture_output=True, text=True).stdout
    meshes = []
    for line in lines.splitlines()[: options.meshes]:
        mesh = json.loads(line)
        flat = np.asarray(mesh["points"], dtype=np.float64)
        points = np.ascontiguousarray(np.column_stack([flat, np.zeros(len(flat))]))
        meshes.append((points, np.ascontiguousarray(mesh["triangles"], dtype=np.int64)))

    peers = {f"libigl {version('libigl')}": libigl_task}
    if open3d is None:
        print("open3d is not installed: it is left out", file=sys.stderr)
    else:
        peers[f"Open3D {open3d.__version__}"] = open3d_task

    times = {(peer, level): {} for peer in peers for level in LEVELS}
    daymark = {level: [] for level in LEVELS}
    for number in range(options.rounds):
        print(f"round {number + 1} of {options.rounds}", file=sys.stderr)
        run = subprocess.run([options.program, "--json"], check=True, capture_output=True, text=True)
        figures = json.loads(run.stdout)
        for level, key in LEVELS.items():
            daymark[level].append(figures[key])
        for peer, task_of in peers.items():
            for index, (points, triangles) in enumerate(meshes):
                task = task_of(points, triangles if task_of is libigl_task else triangles.astype(np.int32))
                for level in LEVELS:
                    if level == 7 and index % 10:
                        continue
                    if number == 0 and index == 0:
                        expected = {1: (175, 328), 7: (672_385, 1_343_488)}[level]
                        assert task(level) == expected, f"{peer}: {task(level)} instead of {expected}"
                    found = best(task, level, 20 if level == 1 else 1)
                    known = times[peer, level].get(index, found)
                    times[peer, level][index] = min(known, found)

    print(f"{'level':>5}  {'program':<16} {'us':>12}  ratio")
    for level in LEVELS:
        own = min(daymark[level])
        print(f"{level:>5}  {'daymark':<16} {own * 1e6:>12.2f}  {1:5.1f}")
        for peer in peers:
            seconds = statistics.median(times[peer, level].values())
            print(f"{level:>5}  {peer:<16} {seconds * 1e6:>12.2f}  {seconds / own:5.1f}")


if __name__ == "__main__":
    main()

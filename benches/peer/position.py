#!/usr/bin/env python3
"""Positions from real photographs, from end to end: daymark's own corners and table beside SIFT and solvePnPRansac.

A folder of photographs with known cameras in `gt/`, as for `pose.py`. Each photograph is left out in turn. daymark: the others
are enrolled with their cameras (`daymark enroll`), the one left out is recognized with its lens (`daymark recognize`), and its
pose compared with the true one. OpenCV: SIFT features of the same photographs at the size that daymark compares (640 px),
matched, triangulated with the known cameras, and `solvePnPRansac` with refinement, as in `pose.py`; it keeps every descriptor
of every photograph (about 2 MB each), daymark's table 2 KB a photograph and its model.

    python3 benches/peer/position.py --photos DIR --daymark target/release/daymark
"""

import argparse
import itertools
import json
import subprocess
import tempfile
from pathlib import Path

import cv2
import numpy as np

import pose

SIDE = 640


def cameras(folder):
    known = {}
    for list_file in folder.glob("gt/**/images.txt"):
        known.update(pose.colmap(list_file.parent))
    for path in folder.glob("gt/*.camera"):
        known[path.stem] = pose.strecha(path)
    return known


def matrix_text(name, rows):
    data = ", ".join(repr(float(x)) for x in np.asarray(rows).ravel())
    return f"{name}: !!opencv-matrix\n   rows: {len(rows)}\n   cols: {len(rows[0])}\n   dt: d\n   data: [ {data} ]\n"


def lens_file(path, width, height, matrix, radial):
    path.write_text(
        f"%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n"
        + matrix_text("camera_matrix", matrix)
        + matrix_text("distortion_coefficients", [[radial, 0, 0, 0, 0]])
    )


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if done.returncode == 2:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout)


def by_daymark(program, profile, folder, known, left_out, scratch):
    """Rotation, centre, inliers, milliseconds; None without a pose."""
    others = [name for name in sorted(known) if name != left_out]
    colmap = next((path.parent for path in folder.glob("gt/**/images.txt")), None)
    files = [colmap] if colmap else [folder / "gt" / f"{name}.camera" for name in others]
    table = scratch / "table.daymark"
    table.unlink(missing_ok=True)
    images = [folder / name for name in others]
    made = run(program, "enroll", "--table", table, "--name", "building", "--profile", profile, "--no-lint", "--json", *images,
               "--cameras", *files)
    map_ = made["enrolled"][0]["model"]["model_from_cameras"]
    width, matrix, _, _, radial = known[left_out]
    height = cv2.imread(str(folder / left_out), cv2.IMREAD_GRAYSCALE).shape[0]
    lens = scratch / "lens.yaml"
    lens_file(lens, int(width), height, matrix, radial)
    frame = run(program, "recognize", "--table", table, "--json", "--lens", lens, folder / left_out)["frames"][0]
    found = frame["observer"] and frame["observer"]["pose"]
    if not found:
        return None
    # To the frame of the cameras' file: x_model = s R x + t.
    turn, step = np.array(map_["rotation"]), np.array(map_["translation_m"])
    centre = turn.T @ (np.array(found["position_in_model_m"]) - step) / map_["scale"]
    rotation = np.array(found["camera_from_model"]) @ turn
    return rotation, centre, found["inliers"], frame["times"]["position_ms"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=Path, required=True, help="folder of photographs with known cameras in gt/")
    parser.add_argument("--daymark", required=True, help="the program")
    parser.add_argument("--no-opencv", action="store_true", help="daymark alone")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    known = cameras(options.photos)
    sift = cv2.SIFT_create(pose.FEATURES)
    views, features = [], []
    for name in sorted(known):
        width, matrix, rotation, centre, radial = known[name]
        picture = cv2.imread(str(options.photos / name), cv2.IMREAD_GRAYSCALE)
        scale = SIDE / max(picture.shape)
        picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        lens = pose.scaled(matrix, picture.shape[1] / width)
        views.append((lens, rotation, centre))
        keypoints, descriptors = sift.detectAndCompute(picture, None)
        seen = np.array([point.pt for point in keypoints])
        seen = cv2.undistortPoints(seen[:, None], lens, np.array([radial, 0, 0, 0]), P=lens)[:, 0]
        features.append((seen, descriptors))
    pairs = {(i, j): pose.matched(features[i][1], features[j][1]) for i, j in itertools.combinations(range(len(views)), 2)}
    programs = ["handheld", "board"] + ([] if options.no_opencv else ["SIFT"])
    errors = {program: [] for program in programs}
    print(f"{'photo':>14} {'program':>9} {'inliers':>8} {'centre, %':>10} {'rotation, deg':>14} {'ms':>8}")
    with tempfile.TemporaryDirectory() as scratch:
        for number, name in enumerate(sorted(known)):
            lens, rotation, centre = views[number]
            points = pose.triangulated(views, features, pairs, number)
            model, seen = pose.correspondences(features, pairs, points, number)
            far = np.median(np.linalg.norm(model - centre, axis=1))
            for program in programs:
                if program == "SIFT":
                    answer = pose.by_opencv(model, seen, lens)
                    answer = answer and (*answer[:3], answer[3] / 1e3)
                else:
                    answer = by_daymark(options.daymark, program, options.photos, known, name, Path(scratch))
                if answer is None:
                    print(f"{name:>14} {program:>9}     none")
                    errors[program].append((np.inf, np.inf))
                    continue
                found, at, inliers, ms = answer
                off = np.linalg.norm(at - centre) / far
                turn = np.degrees(2 * np.arcsin(min(1.0, np.linalg.norm(found - rotation) / np.sqrt(8))))
                errors[program].append((off, turn))
                print(f"{name:>14} {program:>9} {inliers:8} {100 * off:10.3f} {turn:14.3f} {ms:8.2f}", flush=True)
    for program, all_errors in errors.items():
        off, turn = np.median(np.array(all_errors), axis=0)
        worst = max(off for off, _ in all_errors)
        print(f"{program:>9}: centre {100 * off:.3f} % of the distance (worst {100 * worst:.2f}), rotation {turn:.3f} degrees")


if __name__ == "__main__":
    main()

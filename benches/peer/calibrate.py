#!/usr/bin/env python3
"""Calibration: daymark beside OpenCV on the same pictures of a chessboard, and what each reads of the other's files.

Pictures are made here, by another renderer than that of daymark's tests: a board through a lens with known distortion, a
point spread of 0.7 px, light that falls off, the curve of sRGB, noise, JPEG of quality 92. Each trial has its own lens,
places and seed. OpenCV finds corners with `findChessboardCorners` and `cornerSubPix` (11 x 11) or with
`findChessboardCornersSB`, and fits with `calibrateCamera`, k3 fixed to 0 as in daymark's default.

    cargo build --release
    python3 benches/peer/calibrate.py

or, for pictures of your own, of which nobody knows the truth:

    python3 benches/peer/calibrate.py --board 9x6 PICTURES

*Direction* is the root mean square over the frame of how far, in pixels, what a pixel sees is from what it should see. *Error /
deviation* is the root mean square of daymark's errors in units of the standard deviations that it states: 1 is honest, less is
modest.
"""

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

SIZE = (640, 480)
PARTS = 5
NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
FLAGS = cv2.CALIB_FIX_K3


def matrix(fx, fy, cx, cy):
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def rays(lens, points):
    """Directions (X / Z, Y / Z) of pixels."""
    k = np.array([*lens[4:8], 0.0])
    stop = (cv2.TERM_CRITERIA_MAX_ITER | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    return cv2.undistortPointsIter(points.reshape(-1, 1, 2), matrix(*lens[:4]), k, None, None, stop).reshape(points.shape)


def subpixels():
    """Pixels of a picture that is PARTS times as large."""
    x, y = (((np.arange(n * PARTS) + 0.5) / PARTS - 0.5) for n in SIZE)
    return np.stack(np.meshgrid(x, y), axis=-1)


def picture(random, seen, board, turn, middle, hard):
    """The board at a place of the view, in squares."""
    rotation = cv2.Rodrigues(np.array(turn))[0]
    columns, rows = board
    step = np.array(middle) - rotation @ np.array([(columns - 1) / 2, (rows - 1) / 2, 0])
    centre = -rotation.T @ step
    directions = np.concatenate([seen, np.ones((*seen.shape[:2], 1))], axis=-1) @ rotation
    far = -centre[2] / directions[..., 2]
    x = centre[0] + far * directions[..., 0]
    y = centre[1] + far * directions[..., 1]
    dark = (np.floor(x) + np.floor(y)) % 2 == 0
    inside = (x > -1) & (x < columns) & (y > -1) & (y < rows)
    sheet = (x > -2) & (x < columns + 1) & (y > -2) & (y < rows + 1) & (far > 0)
    light = np.where(inside & dark, 0.02, 0.75)
    wall = 0.1 + 0.25 * (np.sin(2.1 * x + 0.4) * np.sin(1.3 * y) > 0)
    light = np.where(sheet, light, wall)
    light = cv2.GaussianBlur(light, None, (1.6 if hard else 0.7) * PARTS)
    if hard:
        light = 0.06 + 0.3 * light
    light = light.reshape(SIZE[1], PARTS, SIZE[0], PARTS).mean(axis=(1, 3))
    fall = 1 - 0.4 * np.linspace(0, 1, SIZE[0])[None] * np.linspace(0.3, 1, SIZE[1])[:, None]
    gray = 255 * np.where(light * fall < 0.0031308, 12.92 * light * fall, 1.055 * (light * fall) ** (1 / 2.4) - 0.055)
    gray = np.clip(gray + random.normal(0, 8.0 if hard else 2.0, gray.shape), 0, 255).astype(np.uint8)
    return cv2.imencode(".jpg", gray, [cv2.IMWRITE_JPEG_QUALITY, 60 if hard else 92])[1].tobytes()


def trial(seed, board, count, hard):
    """A lens and pictures through it."""
    random = np.random.default_rng(seed)
    focal = random.uniform(450, 800)
    lens = [focal, focal * random.uniform(0.995, 1.005), 319.5 + random.normal(0, 8), 239.5 + random.normal(0, 8)]
    strength = (focal / 600) ** 2
    lens += [strength * random.uniform(-0.28, 0.02), strength**2 * random.uniform(0.0, 0.08), *random.normal(0, 8e-4, 2)]
    seen = rays(lens, subpixels())
    pictures = []
    while len(pictures) < count:
        turn = np.array([*random.uniform(-0.6, 0.6, 2), random.uniform(-0.4, 0.4)])
        far = focal * random.uniform(10.5, 17.0) / 480
        aside = random.uniform(-0.18, 0.18, 2) * np.array(SIZE) * far / focal
        pictures.append(picture(random, seen, board, turn, [*aside, far], hard))
    return lens, pictures


def by_opencv(pictures, board, sector):
    start = time.perf_counter()
    place = np.zeros((board[0] * board[1], 3), np.float32)
    place[:, :2] = np.mgrid[: board[0], : board[1]].T.reshape(-1, 2)
    corners = []
    for path in pictures:
        gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if sector:
            found, at = cv2.findChessboardCornersSB(gray, board, cv2.CALIB_CB_ACCURACY)
        else:
            found, at = cv2.findChessboardCorners(gray, board)
            if found:
                stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-4)
                at = cv2.cornerSubPix(gray, at, (5, 5), (-1, -1), stop)
        if found:
            corners.append(at)
    if len(corners) < 3:
        return None
    size = gray.shape[::-1]
    rms, found, k, *_ = cv2.calibrateCamera([place] * len(corners), corners, size, None, None, flags=FLAGS)
    seconds = time.perf_counter() - start
    lens = [found[0, 0], found[1, 1], found[0, 2], found[1, 2], *k.ravel()[:4]]
    return {"lens": lens, "rms": rms, "pictures": len(corners), "seconds": seconds}


def by_daymark(program, pictures, board, folder):
    file = folder / "camera.yaml"
    start = time.perf_counter()
    line = [program, "calibrate", *map(str, pictures), "--board", f"{board[0]}x{board[1]}", "-o", str(file), "--json"]
    done = subprocess.run(line, capture_output=True, text=True)
    seconds = time.perf_counter() - start
    if done.returncode:
        return None
    said = json.loads(done.stdout)
    parameters = said["lens"]["parameters"][:8]
    lens = [parameter["value"] for parameter in parameters]
    # OpenCV reads what daymark wrote.
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ)
    K, k = storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat().ravel()
    read = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], *k[:4]]
    width, height = (int(storage.getNode(f"image_{side}").real()) for side in ("width", "height"))
    assert read == lens and (width, height) == (said["width_px"], said["height_px"]), "OpenCV reads another lens"
    return {
        "lens": lens,
        "deviations": [parameter["standard_deviation"] for parameter in parameters],
        "rms": said["lens"]["rms_px"],
        "pictures": sum(row["used"] for row in said["pictures"]),
        "seconds": seconds,
    }


def direction(lens, truth):
    x, y = np.meshgrid(np.linspace(0, SIZE[0] - 1, 33), np.linspace(0, SIZE[1] - 1, 25))
    points = np.stack([x, y], axis=-1)
    off = (rays(lens, points) - rays(truth, points)) * np.array(truth[:2])
    return float(np.sqrt(np.mean(np.sum(off**2, axis=-1))))


def programs(options, board, folder):
    return {
        "daymark": lambda pictures: by_daymark(options.daymark, pictures, board, folder),
        "OpenCV, SubPix": lambda pictures: by_opencv(pictures, board, False),
        "OpenCV, SB": lambda pictures: by_opencv(pictures, board, True),
    }


def own_pictures(options, board):
    with tempfile.TemporaryDirectory() as folder:
        for name, run in programs(options, board, Path(folder)).items():
            answer = run(options.pictures)
            if answer is None:
                print(f"{name:15} none")
                continue
            numbers = "  ".join(f"{key} {value:.5g}" for key, value in zip(NAMES, answer["lens"]))
            print(f"{name:15} {answer['pictures']:3} pictures  rms {answer['rms']:.3f} px  {numbers}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", nargs="*", type=Path, help="pictures of your own")
    parser.add_argument("--daymark", default="target/release/daymark")
    parser.add_argument("--board", default="9x6", help="inner corners")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--count", type=int, default=12, help="pictures in a trial")
    parser.add_argument("--hard", action="store_true", help="a point spread of 1.6 px, a third of the contrast, four times the noise, JPEG 60")
    options = parser.parse_args()
    board = tuple(int(n) for n in options.board.split("x"))
    if options.pictures:
        return own_pictures(options, board)
    answers = {}
    for seed in range(options.trials):
        lens, pictures = trial(seed, board, options.count, options.hard)
        with tempfile.TemporaryDirectory() as folder:
            paths = []
            for number, jpeg in enumerate(pictures):
                paths.append(Path(folder) / f"{number:02}.jpg")
                paths[-1].write_bytes(jpeg)
            for name, run in programs(options, board, Path(folder)).items():
                answer = run(paths)
                if answer:
                    answers.setdefault(name, []).append((answer, lens))
    print(f"{options.trials} trials of {options.count} pictures, {SIZE[0]} x {SIZE[1]} px; medians over trials")
    print(f"{'':15} {'lenses':>6} {'pictures':>8} {'rms, px':>8} {'focal, %':>9} {'worst':>6} {'centre, px':>10} {'direction, px':>13} {'worst':>6} {'s':>6}")
    for name, rows in answers.items():
        focal = [100 * abs(answer["lens"][0] / lens[0] - 1) for answer, lens in rows]
        centre = [np.hypot(answer["lens"][2] - lens[2], answer["lens"][3] - lens[3]) for answer, lens in rows]
        off = [direction(answer["lens"], lens) for answer, lens in rows]
        said = lambda key: np.median([answer[key] for answer, _ in rows])
        print(
            f"{name:15} {len(rows):6} {sum(a['pictures'] for a, _ in rows):8} {said('rms'):8.3f} {np.median(focal):9.3f} "
            f"{max(focal):6.3f} {np.median(centre):10.2f} {np.median(off):13.3f} {max(off):6.3f} {said('seconds'):6.2f}"
        )
    rows = answers.get("daymark", [])
    ratios = np.array([(np.array(a["lens"]) - lens) / a["deviations"] for a, lens in rows])
    print("daymark's error / deviation:", "  ".join(f"{n} {np.sqrt(np.mean(r**2)):.2f}" for n, r in zip(NAMES, ratios.T)))


if __name__ == "__main__":
    main()

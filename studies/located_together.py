#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Locates images of a sequence together with the images before them (docs/evidence.md).

usage: studies/located_together.py BIN MAP SEQUENCE CAMERA POSES IMAGES [options]

POSES are the camera's poses relative to each other, in TUM format. Every `--every`-th image is the last of a group of
IMAGES, `--step` images apart. Prints how many groups are located and, with `--truth` (TUM format, in the map's frame),
how many poses of the last image are right: within 5 cm and 5 degrees.
"""

import argparse
import json
import pathlib
import subprocess
from concurrent.futures import ThreadPoolExecutor

import numpy as np


def trajectory(path):
    lines = [line for line in pathlib.Path(path).read_text().splitlines() if line.strip() and line[0] != "#"]
    return np.array([[float(word) for word in line.split()[:8]] for line in lines])


def rotation(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def nearest(poses, time):
    return poses[np.argmin(abs(poses[:, 0] - time))]


def error(estimate, truth):
    """Metres and degrees."""
    pose = np.array(estimate).reshape(4, 4)
    cosine = (np.trace(pose[:3, :3].T @ rotation(truth[4:8])) - 1) / 2
    return np.linalg.norm(pose[:3, 3] - truth[1:4]), np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def groups(images, options):
    for last in range(0, len(images), options.every):
        chosen = [images[i] for i in range(last, -1, -options.step)][:options.images]
        if chosen:
            yield chosen[::-1]


def locate(group, options):
    poses = ["--poses", options.poses] if len(group) > 1 else []
    command = [options.bin, "locate", options.map, *map(str, group), *poses, "--camera", options.camera]
    command += ["--json", "-", "--quiet", "--threads", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not done.stdout:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout)["results"][-1]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("bin", "map", "sequence", "camera", "poses"):
        parser.add_argument(name)
    parser.add_argument("images", type=int)
    parser.add_argument("--step", type=int, default=6)
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--truth")
    options = parser.parse_args()
    known = trajectory(options.poses)
    images = [
        image for image in sorted(pathlib.Path(options.sequence, "rgb").iterdir())
        if abs(nearest(known, float(image.stem))[0] - float(image.stem)) <= 0.02
    ]
    chosen = list(groups(images, options))
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(lambda group: locate(group, options), chosen))
    located = [result["verdict"] == "located" for result in results]
    others = [result["probability"] for result, is_located in zip(results, located) if not is_located]
    print(f"{len(results)} groups, {sum(located)} located; largest other probability {max(others, default=0):.4f}")
    if not options.truth:
        return
    truth = trajectory(options.truth)
    errors = [
        error(result["estimate"], nearest(truth, float(group[-1].stem))) if result["estimate"] else (np.inf, np.inf)
        for group, result in zip(chosen, results)
    ]
    right = [metres < 0.05 and angle < 5 for metres, angle in errors]
    of_located = np.array([e for e, is_located in zip(errors, located) if is_located])
    print(f"best pose right {sum(right)}; located and wrong {sum(l and not r for l, r in zip(located, right))}; "
          f"error of the located, median {np.median(of_located, 0)}, largest {of_located.max(0)} (m, degrees)")


if __name__ == "__main__":
    main()

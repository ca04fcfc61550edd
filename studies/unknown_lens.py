#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Locates images with a known, an unknown and a shared lens (docs/evidence.md).

usage: studies/unknown_lens.py BIN MAP TRUTH CAMERA FOCAL_LENGTH IMAGE...
       studies/unknown_lens.py BIN --simulate FOLDER SEED...

The first locates the images, whose names are their times, in MAP; TRUTH has their poses in the map's frame (TUM
format), and FOCAL_LENGTH is that which the lens has without distortion. The second simulates two sessions of six kinds
of places, the second through a barrel lens, and locates its images in the map of the first. Prints how many images are
located, how many of these are right (within 5 cm and 5 degrees), and how many have a focal length within 3 %.
"""

import json
import pathlib
import subprocess
import sys

from located_together import error, nearest, trajectory

BARREL = "RADIAL 640 480 470 328 232 -0.12 0.03"


def run(tool, *words):
    done = subprocess.run([tool, *map(str, words), "--quiet"], stdout=subprocess.PIPE)
    if done.returncode not in (0, 4):
        sys.exit(f"cairn {words[0]}: exit code {done.returncode}")
    return done.stdout


def located(tool, where, truth, camera, focal_length, images):
    """For each kind of lens: (located, right, focal length within 3 %)."""
    poses = trajectory(truth)
    counts = []
    for how in (camera, "unknown", "shared"):
        results = json.loads(run(tool, "locate", where, *images, "--camera", how, "--json", "-"))["results"]
        found = [one for one in results if one["verdict"] == "located"]
        right = near = 0
        for one in found:
            off_m, off_deg = error(one["world_from_camera"], nearest(poses, float(pathlib.Path(one["image"]).stem)))
            right += off_m <= 0.05 and off_deg <= 5.0
            near += abs(one["camera"]["parameters"][0] / focal_length - 1.0) <= 0.03
        counts.append((len(found), right, near))
    return counts


def show(name, images, counts):
    for how, (found, right, near) in zip(("known", "unknown", "shared"), counts):
        print(f"{name}: {how:8} {images} images, {found} located, {right} right, {near} focal lengths within 3 %", flush=True)


def simulated(tool, folder, seeds):
    total = [(0, 0, 0)] * 3
    images = 0
    for seed in seeds:
        for kind in ("desk", "office", "corridor", "warehouse", "room", "kitchen"):
            first, second = folder / f"{kind}-{seed}-0", folder / f"{kind}-{seed}-1"
            place = ("--environment", kind, "--seed", seed)
            run(tool, "simulate", first, *place, "--rate", 20, "--frames", 80)
            run(tool, "map", first, "-o", f"{first}.map", "--start-from", first / "groundtruth.txt")
            run(tool, "simulate", second, *place, "--session", 1, "--changed", 0.25, "--rate", 4, "--frames", 24, "--camera", BARREL)
            seen = sorted((second / "rgb").iterdir())
            counts = located(tool, f"{first}.map", second / "groundtruth.txt", BARREL, 470.0, seen)
            show(f"{kind} {seed}", len(seen), counts)
            total = [tuple(map(sum, zip(a, b))) for a, b in zip(total, counts)]
            images += len(seen)
    show("all", images, total)


def main():
    if len(sys.argv) > 4 and sys.argv[2] == "--simulate":
        simulated(sys.argv[1], pathlib.Path(sys.argv[3]), sys.argv[4:])
    elif len(sys.argv) > 6:
        tool, where, truth, camera, focal_length, *images = sys.argv[1:]
        show("all", len(images), located(tool, where, truth, camera, float(focal_length), images))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()

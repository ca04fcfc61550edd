#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Maps simulated places by an RGB-D and by a stereo camera on the same path, and aligns maps of a second session, by either
camera, with the RGB-D map from nowhere: studies/stereo_rooms.py BIN [FRAMES]. A line of CSV for each place to stdout."""

import json
import math
import pathlib
import subprocess
import sys
import tempfile

PLACES = (("desk", "sweep", 1), ("office", "walk", 1), ("warehouse", "walk", 1), ("room", "walk", 1), ("kitchen", "sweep", 1),
          ("room", "walk", 2), ("corridor", "walk", 1))


class Study:
    def __init__(self, tool, frames, place, folder):
        self.tool, self.folder = tool, pathlib.Path(folder)
        self.world = ["--environment", place[0], "--path", place[1], "--seed", str(place[2]), "--frames", frames,
                      "--color-format", "png"]

    def run(self, *words, codes=(0,)):
        done = subprocess.run([self.tool, *words, "--json", "out.json"], cwd=self.folder, stdout=subprocess.DEVNULL,
                              check=False)
        if done.returncode not in codes:
            sys.exit(f"cairn {' '.join(words)}: exit code {done.returncode}")
        return json.loads((self.folder / "out.json").read_text())

    def simulate(self, name, *options):
        self.run("simulate", name, *self.world, *options)

    def map(self, name):
        """In the world's frame, so that the true pose of one map in another is the identity."""
        self.run("map", name, "-o", f"{name}.map", "--trajectory", f"{name}.tum", "--start-from", f"{name}/groundtruth.txt")

    def accuracy(self, name):
        errors = self.run("evaluate", "trajectory", f"{name}.tum", f"{name}/groundtruth.txt")
        found = self.run("evaluate", "map", f"{name}.map", "--truth-depth", "exact")
        return 1000 * errors["absolute"]["translation_m"]["rmse"], found["calibration"]["all"]["inside_95"]

    def alignment(self, target, source):
        """Status and displacement of the source's centre, in metres."""
        result = self.run("align", f"{target}.map", f"{source}.map", codes=(0, 4))["results"][0]
        pose, centre = result["target_from_source"], result["centre"]
        if pose is None or centre is None:
            return result["status"], math.nan
        moved = [sum(row[i] * centre[i] for i in range(3)) + row[3] for row in pose[:3]]
        return result["status"], math.dist(moved, centre)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    tool, frames = pathlib.Path(sys.argv[1]).resolve() / "cairn", sys.argv[2] if len(sys.argv) > 2 else "150"
    print("place,path,seed,ate_rgbd_mm,ate_stereo_mm,ratio,inside_rgbd,inside_stereo,rgbd_again,error_m,stereo_again,error_m")
    for place in PLACES:
        with tempfile.TemporaryDirectory() as folder:
            study = Study(tool, frames, place, folder)
            study.simulate("exact", "--no-depth-noise")
            for name, options in (("rgbd", ()), ("stereo", ("--sensor", "stereo")), ("rgbd_again", ("--session", "1")),
                                  ("stereo_again", ("--session", "1", "--sensor", "stereo"))):
                study.simulate(name, *options)
                study.map(name)
            rgbd, stereo = study.accuracy("rgbd"), study.accuracy("stereo")
            row = [*place, f"{rgbd[0]:.2f}", f"{stereo[0]:.2f}", f"{stereo[0] / rgbd[0]:.2f}", f"{rgbd[1]:.3f}",
                   f"{stereo[1]:.3f}"]
            for name in ("rgbd_again", "stereo_again"):
                status, error = study.alignment("rgbd", name)
                row += [status, f"{error:.4f}"]
            print(*row, sep=",", flush=True)


if __name__ == "__main__":
    main()

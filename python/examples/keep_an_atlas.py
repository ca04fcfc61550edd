# SPDX-License-Identifier: BSD-3-Clause
"""The loop of a SLAM system of your own that keeps an atlas: each map goes in when it is complete, while driving.

    python3 keep_an_atlas.py [NEW_ATLAS]

The maps are simulated here; drive() stands for your system.
"""

import pathlib
import sys
import tempfile
from typing import Iterator, Tuple

import numpy as np
from numpy.typing import NDArray

import cairn

PAIR = cairn.synthetic_pair(landmarks=3000)
STEP_COVARIANCE = np.diag([0.02**2] * 3 + [0.005**2] * 3)  # of odometry: 2 cm, 0.3 degrees


def drive() -> Iterator[Tuple[cairn.LandmarkMap, NDArray[np.float64]]]:
    """Maps, each in a frame of its own, and where each lies in the frame of the map before it."""
    session = PAIR.source
    x = session.positions[:, 0]
    before = np.eye(4)
    for number in range(3):
        low, high = np.quantile(x, [0.25 * number, 0.25 * number + 0.5])
        start = np.eye(4)
        start[0, 3] = low
        part = session.select(np.flatnonzero((x >= low) & (x <= high)))
        yield part.transformed(np.linalg.inv(start)), np.linalg.inv(before) @ start
        before = start


def keep(location: pathlib.Path) -> None:
    with cairn.Atlas.create(location) as atlas:
        atlas.add(PAIR.target, name="yesterday")
        for number, (landmark_map, step) in enumerate(drive()):
            added = atlas.add(landmark_map, name=f"today/{number}", session="today")
            if number > 0:
                atlas.link_by_odometry(f"today/{number - 1}", added.name, step, STEP_COVARIANCE)
            atlas.link(only=[added.name])
            atlas.update_poses()
            placed = atlas.maps[added.name]
            if placed.frame_from_map is None:
                print(f"{placed.name}: no link places it yet")
            else:
                print(f"{placed.name}: at {placed.frame_from_map[:3, 3].round(3)} in the frame of {placed.frame}")
        print(atlas.merge())
        print("last commit:", atlas.log[-1])


if __name__ == "__main__":
    if len(sys.argv) > 2:
        sys.exit(__doc__)
    if len(sys.argv) == 2:
        keep(pathlib.Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as name:
            keep(pathlib.Path(name, "town.atlas"))

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Places all pairs of mini-maps of real sequences on each other without descriptors, by ground truth.

  studies/mini_map_pairs.py CAIRN MINI_MAPS GROUNDTRUTH [MINI_MAPS GROUNDTRUTH ...] > pairs.csv

MINI_MAPS is a folder of native maps (cairn map --mini-map-length 1 -o MINI_MAPS/), GROUNDTRUTH the poses of its
sequence in TUM format; all sequences share one world. One row a candidate, with the columns of
cairn_placement_sessions_benchmark that studies/fit_placement_model.py needs, and its variants undescribed and bare. The
overlap is the smaller map's share of landmarks with a counterpart within 5 cm. Needs NumPy and SciPy.
"""
import csv
import itertools
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

COUNTERPART_M = 0.05
MOST_GAP_S = 0.1  # between poses of the ground truth
COLUMNS = ["variant", "pair", "source", "target", "same", "overlap", "verdict", "wall_s", "rank",
           *(f"within_{i}" for i in range(6)), "spread_evidence", "spread_proximity", "spread_likeness",
           "spread_agreeing", "expected_agreeing", "contradicted", "probability", "rotation_deg",
           "translation_m", "mahalanobis"]


def pose_at(truth, time):
    i = np.searchsorted(truth[:, 0], time)
    if i == 0 or i >= len(truth) or truth[i, 0] - truth[i - 1, 0] > MOST_GAP_S:
        return None
    share = (time - truth[i - 1, 0]) / (truth[i, 0] - truth[i - 1, 0])
    a, b = Rotation.from_quat(truth[i - 1, 4:]), Rotation.from_quat(truth[i, 4:])
    return (a * Rotation.from_rotvec(share * (a.inv() * b).as_rotvec()),
            (1 - share) * truth[i - 1, 1:4] + share * truth[i, 1:4])


def bare_map(path, truth, folder):
    """The map without descriptors and colours, as files of each variant; its points and world_from_map."""
    points, frames, times, lines = [], {}, {}, []
    for line in path.read_text().splitlines():
        words = line.split()
        kind = words[0] if words else ""
        if kind not in ("COLOR", "DESCRIPTOR", "DESCRIPTORS"):
            lines.append(line)
        if kind == "FRAME":
            frames[words[1]] = [float(x) for x in words[2:9]]
        elif kind == "TIME":
            times[words[1]] = float(words[2])
        elif kind == "LANDMARK" and int(words[6] if words[5] == "-" else words[14]) >= 2:
            points.append([float(x) for x in words[2:5]])
    turns, here, there = [], [], []
    for name, pose in frames.items():
        known = pose_at(truth, times[name]) if name in times else None
        if known:
            turns.append(known[0] * Rotation.from_quat([*pose[4:7], pose[3]]).inv())
            here.append(pose[:3])
            there.append(known[1])
    if len(turns) < 3 or len(points) < 100:
        return None
    turn = Rotation.concatenate(turns).mean()
    shift = np.median(np.array(there) - turn.apply(here), axis=0)
    name = f"{path.parent.name}-{path.stem}"
    files = {"undescribed": folder / f"{name}.map", "bare": folder / f"{name}.xyz"}
    files["undescribed"].write_text("\n".join(lines) + "\n")
    np.savetxt(files["bare"], points, fmt="%.9g")
    return name, files, np.array(points), turn, shift


def rows_of(cairn, number, source, target):
    turn = target[3].inv() * source[3]
    shift = target[3].inv().apply(source[4] - target[4])
    moved = turn.apply(source[2]) + shift
    near = cKDTree(target[2]).query(moved)[0] < COUNTERPART_M
    back = cKDTree(moved).query(target[2])[0] < COUNTERPART_M
    centre = source[2][near].mean(0) if near.sum() > 5 else source[2].mean(0)
    for variant in source[1]:
        run = subprocess.run([cairn, "align", source[1][variant], target[1][variant], "--no-scale",
                              "--threads", "1", "--quiet", "--json", "-"], capture_output=True, text=True)
        result = json.loads(run.stdout)["results"][0]
        for rank, candidate in enumerate(result["candidates"]):
            pose = np.array(candidate["target_from_source"])
            error = turn.inv() * Rotation.from_matrix(pose[:3, :3])
            off = pose[:3, :3] @ centre + pose[:3, 3] - turn.apply(centre) - shift
            within = candidate["matches_by_radius"]
            sight = candidate["contradicted"]
            yield [variant, number, source[0], target[0], 1, min(near.mean(), back.mean()), result["status"],
                   result["duration_s"], rank, *within, candidate["spread_evidence"],
                   candidate["proximity"]["spread_evidence"], -1, 0, 0, -1 if sight is None else sight,
                   candidate["probability"], np.degrees(error.magnitude()), np.linalg.norm(off), -1]


def main():
    if len(sys.argv) < 4 or len(sys.argv) % 2:
        sys.exit(__doc__)
    table = csv.writer(sys.stdout)
    table.writerow(COLUMNS)
    with tempfile.TemporaryDirectory() as folder:
        maps = []
        for mini_maps, groundtruth in zip(sys.argv[2::2], sys.argv[3::2]):
            truth = np.loadtxt(groundtruth)
            truth = truth[np.argsort(truth[:, 0])]
            for path in sorted(pathlib.Path(mini_maps).glob("*.map")):
                one = bare_map(path, truth, pathlib.Path(folder))
                if one:
                    maps.append(one)
        for number, (source, target) in enumerate(itertools.combinations(maps, 2)):
            table.writerows(rows_of(sys.argv[1], number, source, target))
            sys.stdout.flush()


if __name__ == "__main__":
    main()

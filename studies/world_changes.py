#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Holds `cairn atlas diff --world` against the simulator, which knows what it moved.

A thing counts if it moved between the sessions, its longest side is 20 cm or more, the session that it stood
there in has at least --seen landmarks in its box, and the other has as many within 20 cm of the box: both looked
there. It is found if the centre of a reported change lies in that box, made
larger by 5 cm. A report is right if its centre lies in the box, thus enlarged, of any thing that moved.
"""
import argparse
import json
import pathlib
import subprocess
import sys


def run(*command):
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)


def document(path):
    return json.loads(path.read_text())


def contains(thing, point, margin=0.05):
    return all(thing["low"][i] - margin <= point[i] <= thing["high"][i] + margin for i in range(3))


def landmarks_of(cairn, map_path):
    text = map_path.with_suffix(".xyz")
    run(cairn, "convert", map_path, text, "--quiet")
    return [tuple(map(float, line.split()[:3])) for line in text.read_text().splitlines()]


def session(cairn, folder, kind, seed, number, changed, frames):
    base = folder / f"{kind}-{seed}-{number}"
    map_path = base.with_suffix(".cairn")
    if not map_path.exists():
        frames_folder = folder / f"{base.name}.frames"
        run("rm", "-rf", frames_folder)
        options = ["--session", number, "--changed", changed if number else 0, "--path", "sweep"]
        run(cairn, "simulate", frames_folder, "--environment", kind, "--seed", seed, "--layout", seed,
            *options, "--rate", 20, "--frames", frames, "--quiet", "--json", base.with_suffix(".json"))
        run(cairn, "map", frames_folder, "-o", map_path, "--start-from",
            frames_folder / "groundtruth.txt", "--quiet")
        run("rm", "-rf", frames_folder)
    return map_path, document(base.with_suffix(".json"))["objects"]["things"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cairn")
    parser.add_argument("folder", type=pathlib.Path, help="keeps sessions; what is there is used again")
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--kinds", nargs="+", default=["desk", "office", "room", "kitchen"])
    parser.add_argument("--frames", type=int, default=260)
    parser.add_argument("--changed", type=float, default=0.25, help="share of the movable things that moved")
    parser.add_argument("--seen", type=int, default=15)
    arguments = parser.parse_args()
    cairn, folder = arguments.cairn, arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    totals = [0, 0, 0, 0]
    print("place        things found  reports right")
    for seed in arguments.seeds:
        for kind in arguments.kinds:
            sessions = [session(cairn, folder, kind, seed, n, arguments.changed, arguments.frames) for n in (0, 1)]
            atlas = folder / f"{kind}-{seed}.atlas"
            run("rm", "-f", atlas)
            run(cairn, "atlas", "init", "--atlas", atlas)
            run(cairn, "atlas", "add", "--atlas", atlas, *(path for path, _ in sessions))
            run(cairn, "atlas", "link", "--atlas", atlas)
            run(cairn, "atlas", "optimize", "--atlas", atlas)
            out = folder / f"{kind}-{seed}.diff.json"
            names = [path.stem for path, _ in sessions]
            status = subprocess.run([cairn, "atlas", "diff", "--world", *names, "--atlas", atlas,
                                     "--json", out], stdout=subprocess.DEVNULL)
            if status.returncode != 0:
                print(f"{kind}-{seed}: not compared: exit code {status.returncode}")
                continue
            # A thing stands where it was and where it is; both count, each where its session saw it.
            places = []
            landmarks = [landmarks_of(cairn, path) for path, _ in sessions]
            for number, (_, things) in enumerate(sessions):
                other = {(thing["name"], tuple(thing["low"])) for thing in sessions[1 - number][1]}
                for thing in things:
                    if not thing["movable"] or (thing["name"], tuple(thing["low"])) in other:
                        continue
                    seen = min(sum(contains(thing, x, 0.01) for x in landmarks[number]),
                               sum(contains(thing, x, 0.2) for x in landmarks[1 - number]))
                    places.append((number, thing, seen))
            centres = []
            for change in document(out)["changes"]:
                for number, key in enumerate(("before", "after")):
                    if change.get(key):
                        centres.append((number, change[key]["position"]))
            large = [(n, t) for n, t, seen in places
                     if seen >= arguments.seen and
                     max(h - l for h, l in zip(t["high"], t["low"])) >= 0.2]
            found = sum(any(m == n and contains(t, c) for m, c in centres) for n, t in large)
            right = sum(any(m == n and contains(t, c) for n, t, _ in places) for m, c in centres)
            print(f"{kind + '-' + str(seed):12} {len(large):6} {found:5}  {len(centres):7} {right:5}")
            for i, value in enumerate((len(large), found, len(centres), right)):
                totals[i] += value
    print(f"{'all':12} {totals[0]:6} {totals[1]:5}  {totals[2]:7} {totals[3]:5}")
    print(f"recall {totals[1] / max(totals[0], 1):.3f}, precision {totals[3] / max(totals[2], 1):.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Aligns COLMAP models of one place that were made with different cameras, as maps of different systems are.

  studies/deformed_pairs.py --cairn build/release/bin/cairn --work FOLDER [--places NAME...]

Images, COLMAP and truth are those of colmap_pairs.py, with which the work folder can be shared. Each set of images (even,
odd, later) is reconstructed four times:

  true         the camera of the renderings
  short, long  focal lengths 5 % too small and too large, which COLMAP must keep
  own          COLMAP estimates focal length and radial distortion, and begins 15 % off

Every two models of one place with different cameras are aligned: of the same images, and of different ones. COLMAP's
cameras may be wrong, so a model does not fit the true poses everywhere; "bent" states the RMS of that fit. Models that
miss the true poses by more than 2 degrees or 5 % of the viewing distance have no truth. A pose is wrong if it is 10
degrees or a third of the viewing distance off. Models of different places are aligned too.

Exit code 1 if a wrong pose is accepted.
"""
import argparse
import itertools
import pathlib
import sys

import numpy as np

from colmap_pairs import PLACES, align, matrix, pose_errors, reconstruct, similarity, simulate, write_table

WRONG = {"rotation_deg": 10.0, "displacement_percent": 33.0}
SYSTEMS = ["true", "short", "long", "own"]
COLUMNS = ["images", "source", "target", "status", "probability", "rotation_deg", "scale_percent", "displacement_percent",
           "bent_deg", "bent_percent", "stated_deg", "stated_ratio", "wrong", "seconds"]


def camera_of(system, camera):
    model, values = camera
    if system == "own":
        return ("SIMPLE_RADIAL", [1.15 * values[0], values[2], values[3], 0.0]), True
    factor = {"true": 1.0, "short": 0.95, "long": 1.05}[system]
    return (model, [factor * values[0], factor * values[1], *values[2:]]), False


def models_of(options, environment, seed, layout):
    """Models by (set, system), and the true poses."""
    first, second = (simulate(options, environment, seed, layout, session, (2 - session) * options.images)
                     for session in (0, 1))
    sets = {"even": first.images[::2], "odd": first.images[1::2], "later": second.images}
    models = {}
    for (part, images), system in itertools.product(sets.items(), SYSTEMS):
        camera, refine = camera_of(system, first.camera)
        name = f"{environment}-{seed}-{part}"
        if system == "true":
            model = reconstruct(options, name, images, camera)
        else:
            model = reconstruct(options, f"{name}-{system}", images, camera, refine, alike=name)
        if model:
            models[part, system] = model
    return models, first.true_poses() | second.true_poses()


def own_pairs(options, place, models, poses):
    for (one, source), (other, target) in itertools.combinations(models.items(), 2):
        if one[1] == other[1]:
            continue
        names = ["-".join((place, *key)) for key in (one, other)]
        fits = [similarity(model.poses, poses) for model in (source, target)]
        if None in fits:
            continue
        result = align(options, source, target, names, True)
        row = {"images": "same" if one[0] == other[0] else "later" if "later" in (one[0], other[0]) else "between",
               "source": names[0], "target": names[1], "status": result["status"], "probability": result["probability"],
               "bent_deg": max(fit["deg"] for fit in fits), "seconds": result["duration_s"],
               "bent_percent": max(100 * fit["distance"] / fit["scale"] / model.viewing_distance
                                   for fit, model in zip(fits, (source, target))), "wrong": False}
        if result["deformation"]:
            row |= {"stated_deg": result["deformation"]["rotation_deg"],
                    "stated_ratio": result["deformation"]["scale_ratio"]}
        judged = row["bent_deg"] <= 2 and all(
            0 <= 100 * fit["distance"] / fit["scale"] / model.viewing_distance <= 5
            for fit, model in zip(fits, (source, target)))
        if result["target_from_source"] is not None and judged:
            truth = np.linalg.inv(matrix(fits[1])) @ matrix(fits[0])
            row |= pose_errors(np.array(result["target_from_source"]), truth, source)
            row["wrong"] = any(row[name] > limit for name, limit in WRONG.items())
        yield row


def strange_pairs(options, places):
    chosen = [(place, key, model) for place, (models, _) in places.items() for key, model in models.items()
              if key[0] != "odd"]
    pairs = [pair for pair in itertools.combinations(chosen, 2) if pair[0][0] != pair[1][0]]
    for (one, first, source), (other, second, target) in pairs[:: max(1, len(pairs) // max(1, options.strangers))]:
        names = ["-".join((one, *first)), "-".join((other, *second))]
        result = align(options, source, target, names, True)
        yield {"images": "other place", "source": names[0], "target": names[1], "status": result["status"],
               "probability": result["probability"], "wrong": result["status"] == "aligned",
               "seconds": result["duration_s"]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = {f"{environment}-{seed}": (environment, seed, layout) for environment, seed, layout in PLACES}
    parser.add_argument("--cairn", required=True, help="the tool")
    parser.add_argument("--work", required=True, type=pathlib.Path, help="folder for images, models and results")
    parser.add_argument("--colmap", default="colmap", help="COLMAP (default: %(default)s)")
    parser.add_argument("--images", type=int, default=25, help="images of a set (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="threads of COLMAP and Cairn (default: %(default)s)")
    parser.add_argument("--places", nargs="*", choices=list(names), default=list(names), help="default: all")
    parser.add_argument("--strangers", type=int, default=100, help="pairs of different places (default: %(default)s)")
    parser.add_argument("--csv", type=pathlib.Path, help="table of all pairs (default: deformed.csv in the work folder)")
    parser.set_defaults(features=2000, first_octave=0)
    options = parser.parse_args()
    places, rows = {}, []
    for place in options.places:
        places[place] = models_of(options, *names[place])
        rows += own_pairs(options, place, *places[place])
    rows += strange_pairs(options, places)
    write_table(options.csv or options.work / "deformed.csv", COLUMNS, rows)
    for images in ("same", "between", "later", "other place"):
        chosen = [row for row in rows if row["images"] == images]
        accepted = [row for row in chosen if row["status"] == "aligned"]
        print(f"{images}: {len(chosen)} pairs, {len(accepted)} aligned, "
              f"{sum('stated_deg' in row for row in accepted)} of them with a deformation, "
              f"{sum('rotation_deg' not in row for row in accepted)} without a truth, "
              f"{sum(row['wrong'] for row in chosen)} wrong")
        for name in ("rotation_deg", "scale_percent", "displacement_percent", "bent_deg", "stated_deg", "stated_ratio"):
            values = [row[name] for row in accepted if name in row]
            if values:
                print(f"  {name}: median {np.median(values):.2f}, largest {max(values):.2f}")
    return 1 if any(row["wrong"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())

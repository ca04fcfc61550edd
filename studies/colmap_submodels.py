#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Cuts a sequence into overlapping parts, has COLMAP reconstruct each apart, merges all with `cairn merge --adjust`, and
compares the result with COLMAP's reconstruction of all images at once.

  studies/colmap_submodels.py --cairn build/release/bin/cairn --work FOLDER [--sequence FOLDER] [--cuts 2:15 2:0 8:4]

Needs COLMAP (3.8; no GPU) and NumPy. Images are those of a sequence in TUM's layout, or rendered by `cairn simulate`. A cut
K:C makes K parts, of which neighbours have C images in common. COLMAP may make several models of a part; all are merged.
All parts use one database, as submodels of one run do.

Printed for each cut: models, images of the result and of the joint reconstruction, names that occur twice, the largest
difference of poses from the joint ones after a similarity (degrees, and % of the mean distance from their centre), and
the mean reprojection error by COLMAP's model_analyzer, relative to the joint one.

Exit code 1 if an image is missing or occurs twice, or the error is more than 1 % above the joint one.
"""
import argparse
import contextlib
import pathlib
import shutil
import sqlite3
import sys

import numpy as np

import colmap_pairs
from colmap_pairs import Model, degrees, image_name, kept, model_figures, run, similarity


def features(options, images):
    """The database of all images."""
    database = options.work / "database.db"

    def make():
        folder = options.work / "images"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        database.unlink(missing_ok=True)
        for path in images:
            (folder / image_name(path)).symlink_to(path.resolve())
        run([options.colmap, "feature_extractor", "--database_path", database, "--image_path", folder,
             "--ImageReader.single_camera", 1, "--SiftExtraction.use_gpu", 0, "--SiftExtraction.num_threads",
             options.threads])
        run([options.colmap, "exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", 0,
             "--SiftMatching.num_threads", options.threads])
        return len(images)

    kept(options.work / "features.json", make)


def reconstruct(options, folder, names):
    """COLMAP's models of these images, the largest first."""

    def make():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        listed = folder.with_suffix(".txt")
        listed.write_text("\n".join(names) + "\n")
        run([options.colmap, "mapper", "--database_path", options.work / "database.db", "--image_path",
             options.work / "images", "--output_path", folder, "--image_list_path", listed,
             "--Mapper.num_threads", options.threads, "--Mapper.min_model_size", 3], allowed=(0, 1))
        models = {str(path): model_figures(options, path)["images"] for path in sorted(folder.iterdir())}
        return sorted(models, key=lambda path: -models[path])

    return [pathlib.Path(path) for path in kept(folder.with_suffix(".json"), make)]


def parts_of(names, count, common):
    bounds = [round(i * len(names) / count) for i in range(count + 1)]
    for i in range(count):
        begin = bounds[i] - (common // 2 if i > 0 else 0)
        end = bounds[i + 1] + ((common + 1) // 2 if i + 1 < count else 0)
        yield names[max(begin, 0):end]


def compare(options, cut, joint, joint_px):
    count, common = map(int, cut.split(":"))
    # The database lies within two folders above each model, where Cairn looks for it.
    base = options.work / f"cut-{count}-{common}"
    models = []
    for i, names in enumerate(parts_of(sorted(joint.poses), count, common)):
        models += reconstruct(options, base / f"part{i}", names)
        if not (base / "database.db").exists():
            (base / "database.db").symlink_to(options.work.resolve() / "database.db")
    merged = base / "merged"
    shutil.rmtree(merged, ignore_errors=True)
    run([options.cairn, "merge", *models, "-o", f"{merged}/", "--adjust", "--threads", options.threads],
        base / "merge.log", allowed=(0, 4))
    if not (merged / "images.bin").exists():
        print(f"{cut}: nothing merged", flush=True)
        return False
    result = Model(options, merged, base / "text")
    twice = model_figures(options, merged)["images"] - len(result.poses)
    fit = similarity(result.poses, joint.poses)
    centre = np.mean([pose[1] for pose in joint.poses.values()], axis=0)
    size = np.mean([np.linalg.norm(pose[1] - centre) for pose in joint.poses.values()])
    turned, apart = 0.0, 0.0
    for name in set(result.poses) & set(joint.poses):
        turned = max(turned, degrees(fit["rotation"] @ result.poses[name][0] @ joint.poses[name][0].T))
        moved = fit["scale"] * fit["rotation"] @ result.poses[name][1] + fit["translation"]
        apart = max(apart, 100 * np.linalg.norm(moved - joint.poses[name][1]) / size)
    ratio = model_figures(options, merged)["mean_px"] / joint_px
    good = len(result.poses) == len(joint.poses) and twice == 0 and ratio <= 1.01
    print(f"{cut}: {len(models)} models, {len(result.poses)} of {len(joint.poses)} images, {twice} twice, poses differ by up to "
          f"{turned:.2f} deg and {apart:.1f} %, reprojection error {ratio:.3f} of the joint one{'' if good else '  FAILED'}",
          flush=True)
    return good


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cairn", required=True, help="the tool")
    parser.add_argument("--work", required=True, type=pathlib.Path, help="folder for models and results")
    parser.add_argument("--sequence", type=pathlib.Path, help="folder in TUM's layout (default: a simulated desk)")
    parser.add_argument("--images", type=int, default=36, help="evenly taken from the sequence (default: %(default)s)")
    parser.add_argument("--cuts", nargs="*", default=["2:15", "2:6", "2:1", "2:0", "3:6", "4:6", "8:4"],
                        help="parts:images in common (default: %(default)s)")
    parser.add_argument("--colmap", default="colmap", help="COLMAP (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="threads of COLMAP and Cairn (default: %(default)s)")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    if options.sequence:
        images = sorted(options.sequence.glob("rgb/*"))
    else:
        images = colmap_pairs.simulate(options, "desk", 61, None, 0, 2 * options.images).images
    images = [images[i * len(images) // options.images] for i in range(options.images)]
    features(options, images)
    with contextlib.closing(sqlite3.connect(options.work / "database.db")) as database:
        names = [name for name, in database.execute("SELECT name FROM images ORDER BY name")]
    joint = reconstruct(options, options.work / "joint", names)
    if not joint:
        sys.exit("COLMAP made no model of the whole sequence")
    model = Model(options, joint[0], options.work / "joint-text")
    joint_px = model_figures(options, joint[0])["mean_px"]
    print(f"joint reconstruction: {len(model.poses)} of {len(names)} images, {joint_px:.3f} px", flush=True)
    return 0 if all([compare(options, cut, model, joint_px) for cut in options.cuts]) else 1


if __name__ == "__main__":
    sys.exit(main())

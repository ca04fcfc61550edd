#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Aligns and merges COLMAP models that share no image, and compares the poses with the truth.

  studies/colmap_pairs.py --cairn build/release/bin/cairn --work FOLDER [--data FOLDER]

Needs COLMAP (3.8; no GPU) and NumPy. Images are rendered by `cairn simulate`, and taken from TUM's fr1/desk, fr1/xyz
and fr1/rpy in --data (folders tum_fr1_*). The images of a place are split, and COLMAP reconstructs each set with a
database of its own:

  even, odd             every second image of one session
  later                 another session of the place, on another path, with a quarter of the movable objects moved
  NAME-even, NAME-odd   (TUM) every second image of sequence NAME; all three sequences show one desk

Truth: each model's cameras are fitted by a similarity to true poses: those of the simulator, or, for TUM, of the motion
capture. Its markers are offset from the camera by a constant, which is fitted to all TUM models together. The uncertainty
of the truth is stated as the RMS of both fits' residuals.

A pose is right within 2 degrees, 3 % of scale and a displacement of 5 % of the viewing distance (median over the source's
landmarks). Every pair is aligned with the descriptors of COLMAP's databases, and as bare points. Pairs of different
places must not be aligned. Accepted pairs are merged, with --adjust also by `cairn merge --adjust`; the reprojection
errors are computed here from what COLMAP reads. Finished steps are kept in the work folder, so an interrupted run resumes.

Exit code 1 if a wrong pose is accepted, or fewer right ones than --least-right.
"""
import argparse
import contextlib
import csv
import itertools
import json
import math
import os
import pathlib
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import time

import numpy as np

RIGHT = {"rotation_deg": 2.0, "scale_percent": 3.0, "displacement_percent": 5.0}
# TUM's calibration of fr1. COLMAP puts the centre of the first pixel at (0.5, 0.5).
FR1 = ("FULL_OPENCV", [517.306408, 516.469215, 318.643040 + 0.5, 255.313989 + 0.5,
                       0.262383, -0.953104, -0.005358, 0.002628, 1.163314, 0.0, 0.0, 0.0])
LARGEST_DISTORTION = 2.0  # COLMAP refuses images of a camera with a larger parameter; its default is 1
TUM = ["desk", "xyz", "rpy"]
LARGEST_TIME_DIFFERENCE = 0.01  # between an image and its true pose, seconds
RATE = 8             # images per second that are split into even and odd
TUM_IMAGES = 40      # in each of a sequence's two sets
# Environment, seed and layout: a layout of its own for each place, and two places of one layout, which look similar.
LEAST_POSES = 8  # of a model, for its similarity to the true poses
PLACES = [(environment, seed, None) for seed, environments in
          ((61, ["desk", "office", "room", "kitchen", "corridor", "warehouse"]), (62, ["desk", "office"]))
          for environment in environments] + [("room", 63, 1), ("room", 64, 1)]
COLUMNS = ["kind", "place", "source", "target", "descriptors", "status", "probability", "right", "rotation_deg",
           "scale_percent", "displacement_percent", "truth_rotation_deg", "truth_centre_percent", "seconds", "merge",
           "images", "points_before", "points", "analyzer_px_source", "analyzer_px_target", "analyzer_px", "mean_px_before",
           "mean_px", "rms_px_before", "rms_px", "median_px_before", "median_px"]


def run(arguments, log=None, allowed=(0,)):
    """The standard output of a program; it must end with an allowed exit code."""
    result = subprocess.run([str(argument) for argument in arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                            text=True, env=os.environ | {"QT_QPA_PLATFORM": "offscreen"})
    if log:
        log.write_text(result.stdout + result.stderr)
    if result.returncode not in allowed:
        sys.exit(f"{arguments}: exit code {result.returncode}\n{result.stdout[-2000:]}{result.stderr[-2000:]}")
    return result.stdout, result.returncode


def kept(path, make):
    """What make() returned, from the JSON file if an earlier run wrote it."""
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        result = make()
        draft = path.with_suffix(".draft")
        draft.write_text(json.dumps(result))
        draft.rename(path)
    return json.loads(path.read_text())


def rotation(quaternion):
    """Matrix of a quaternion w x y z."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def degrees(matrix):
    return math.degrees(math.atan2(np.linalg.norm([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0],
                                                   matrix[1, 0] - matrix[0, 1]]) / 2, (np.trace(matrix) - 1) / 2))


# ---- Sequences -------------------------------------------------------------------------------------------------------


class Sequence:
    """A folder in TUM's layout: image paths in the order of time, the camera in COLMAP's terms, and true poses."""

    def __init__(self, folder, camera=None):
        self.folder = folder
        rows = [line.split() for line in (folder / "rgb.txt").read_text().splitlines() if line[:1] not in ("", "#")]
        self.images = [folder / name for _, name in rows]
        self.times = {folder / name: float(stamp) for stamp, name in rows}
        self.camera = camera or self.read_camera()

    def every(self, interval):
        """Images at least this many seconds apart."""
        chosen = []
        for path in self.images:
            if not chosen or self.times[path] >= self.times[chosen[-1]] + interval:
                chosen.append(path)
        return chosen

    def read_camera(self):
        text = (self.folder / "camera.yaml").read_text()
        model = re.search(r"^model: (\S+)", text, re.M)[1]
        values = [float(value) for value in re.search(r"^parameters: \[(.*)\]", text, re.M)[1].split(",")]
        if model != "PINHOLE":
            sys.exit(f"{self.folder}: camera model {model}; expected PINHOLE")
        return model, values[:2] + [value + 0.5 for value in values[2:]]

    def true_poses(self):
        """Rotation world_from_camera and centre, by image."""
        table = np.loadtxt(self.folder / "groundtruth.txt")
        poses = {}
        for path, stamp in self.times.items():
            row = table[np.argmin(np.abs(table[:, 0] - stamp))]
            if abs(row[0] - stamp) <= LARGEST_TIME_DIFFERENCE:
                poses[image_name(path)] = (rotation(row[[7, 4, 5, 6]]), row[1:4])
        return poses


def simulate(options, environment, seed, layout, session, frames):
    folder = options.work / "frames" / f"{environment}-{seed}-{session}"
    if not (folder / "finished").exists():
        shutil.rmtree(folder, ignore_errors=True)
        more = ["--layout", layout] if layout else []
        if session:
            walk = environment in ("corridor", "warehouse", "kitchen")
            more += ["--session", session, "--changed", 0.25, "--path", "walk" if walk else "orbit", "--rate", RATE / 2]
        else:
            more += ["--rate", RATE]
        run([options.cairn, "simulate", folder, "--environment", environment, "--seed", seed, "--frames", frames,
             "--quiet", *more])
        (folder / "finished").touch()
    return Sequence(folder)


# ---- COLMAP ----------------------------------------------------------------------------------------------------------


class Model:
    """A sparse model, read from the text that COLMAP writes of it."""

    def __init__(self, options, sparse, text):
        self.sparse = sparse
        if not (text / "points3D.txt").exists():
            text.mkdir(parents=True, exist_ok=True)
            run([options.colmap, "model_converter", "--input_path", sparse, "--output_path", text, "--output_type", "TXT"])
        cameras = {}
        for line in self.lines(text / "cameras.txt"):
            fields = line.split()
            cameras[int(fields[0])] = (fields[1], np.array(fields[4:], dtype=float))
        points = {}
        for line in self.lines(text / "points3D.txt"):
            fields = line.split(maxsplit=4)
            points[int(fields[0])] = np.array(fields[1:4], dtype=float)
        self.points = np.array(list(points.values()))
        row = {point: i for i, point in enumerate(points)}
        self.poses, distances, errors = {}, [], []
        lines = [line for line in (text / "images.txt").read_text().splitlines() if not line.startswith("#")]
        for head, tail in zip(lines[::2], lines[1::2]):
            fields = head.split(maxsplit=9)
            camera_from_world = rotation(np.array(fields[1:5], dtype=float))
            translation = np.array(fields[5:8], dtype=float)
            centre = -camera_from_world.T @ translation
            self.poses[fields[9]] = (camera_from_world.T, centre)
            keypoints = np.array(tail.split(), dtype=float).reshape(-1, 3)
            keypoints = keypoints[keypoints[:, 2] >= 0]
            seen = self.points[[row[int(point)] for point in keypoints[:, 2]]].reshape(-1, 3)
            distances.append(np.linalg.norm(seen - centre, axis=1))
            inside = seen @ camera_from_world.T + translation
            errors.append(np.linalg.norm(project(cameras[int(fields[8])], inside) - keypoints[:, :2], axis=1))
        self.viewing_distance = float(np.median(np.concatenate(distances)))
        self.errors = np.concatenate(errors)

    @staticmethod
    def lines(path):
        return [line for line in path.read_text().splitlines() if line and not line.startswith("#")]


def project(camera, points):
    model, values = camera
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    if model == "FULL_OPENCV":
        k1, k2, p1, p2, k3, k4, k5, k6 = values[4:]
        r = x * x + y * y
        radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
        x, y = (x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x), y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y)
    elif model == "SIMPLE_RADIAL":
        radial = 1 + values[3] * (x * x + y * y)
        x, y, values = x * radial, y * radial, values[[0, 0, 1, 2]]
    elif model != "PINHOLE":
        sys.exit(f"camera model {model}; expected PINHOLE, SIMPLE_RADIAL or FULL_OPENCV")
    return np.stack([values[0] * x + values[2], values[1] * y + values[3]], axis=1)


def reconstruct(options, name, images, camera, refine=False, alike=None):
    """COLMAP's largest model of these images, with at least half of them; None if it makes none. Their names in the model
    state sequence and time, so they are alike in all models. `refine`: the camera is only where COLMAP begins. `alike`
    names a model of the same images, whose features and matches are used."""
    folder = options.work / "models" / name
    model, values = camera

    database = ["--database_path", folder / "database.db"]
    threads = options.threads

    def match_features():
        run([options.colmap, "feature_extractor", *database, "--image_path", folder / "images",
             "--ImageReader.single_camera", 1, "--ImageReader.camera_model", model, "--ImageReader.camera_params",
             ",".join(map(repr, values)), "--SiftExtraction.use_gpu", 0, "--SiftExtraction.num_threads", threads,
             "--SiftExtraction.first_octave", options.first_octave, "--SiftExtraction.max_num_features",
             options.features], folder / "extractor.log")
        run([options.colmap, "sequential_matcher", *database, "--SiftMatching.use_gpu", 0, "--SiftMatching.num_threads",
             threads, "--SequentialMatching.overlap", 8, "--SequentialMatching.quadratic_overlap", 0],
            folder / "matcher.log")

    def make():
        shutil.rmtree(folder / "images", ignore_errors=True)
        for part in ("images", "sparse"):
            (folder / part).mkdir(parents=True, exist_ok=True)
        (folder / "database.db").unlink(missing_ok=True)
        for path in images:
            (folder / "images" / image_name(path)).symlink_to(path.resolve())
        started = time.monotonic()
        if alike:
            shutil.copy(options.work / "models" / alike / "database.db", folder / "database.db")
            set_camera(folder / "database.db", model, values)
        else:
            match_features()
        run([options.colmap, "mapper", *database, "--image_path", folder / "images", "--output_path", folder / "sparse",
             "--Mapper.num_threads", threads, "--Mapper.ba_refine_focal_length", int(refine),
             "--Mapper.ba_refine_extra_params", int(refine), "--Mapper.max_extra_param", LARGEST_DISTORTION],
            folder / "mapper.log", allowed=(0, 1))
        models = {path.name: model_figures(options, path) for path in sorted((folder / "sparse").iterdir())}
        best = max(models, key=lambda part: models[part]["images"], default=None)
        if best is not None and models[best]["images"] * 2 < len(images):
            best = None
        return {"part": best, "models": models, "images": len(images), "seconds": time.monotonic() - started}

    done = kept(folder / "made.json", make)
    if done["part"] is None:
        print(f"{name}: COLMAP registers less than half of the images: {done['models']}", file=sys.stderr)
        return None
    return Model(options, folder / "sparse" / done["part"], folder / "text")


def set_camera(database, model, values):
    """Changes the camera of all images in COLMAP's database."""
    numbers = {"PINHOLE": 1, "SIMPLE_RADIAL": 2, "FULL_OPENCV": 6}
    with contextlib.closing(sqlite3.connect(database)) as connection, connection:
        connection.execute("UPDATE cameras SET model = ?, params = ?",
                           (numbers[model], struct.pack(f"<{len(values)}d", *values)))


def image_name(path):
    return f"{path.parent.parent.name}_{path.name}"


def model_figures(options, path):
    text, _ = run([options.colmap, "model_analyzer", "--path", path])
    figure = lambda name: float(re.search(rf"^{name}: ([-\d.naif]+)", text, re.M)[1])
    return {"images": int(figure("Registered images")), "points": int(figure("Points")),
            "observations": int(figure("Observations")), "mean_px": figure("Mean reprojection error")}


# ---- Truth -----------------------------------------------------------------------------------------------------------


def mean_rotation(rotations):
    u, _, vt = np.linalg.svd(sum(rotations))
    return u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt


def similarity(model_poses, true_poses, offset=(np.eye(3), np.zeros(3))):
    """World_from_model as (scale, rotation, translation), and the RMS of its residuals: degrees, and the world's unit.

    Rotation from the orientations, scale and translation from the centres. The true poses are of a body with this
    rotation camera_from_body and this centre in the camera's axes.
    """
    names = [name for name in model_poses if name in true_poses]
    if len(names) < LEAST_POSES:
        return None
    cameras = [true_poses[name][0] @ offset[0].T for name in names]
    relative = [camera @ model_poses[name][0].T for name, camera in zip(names, cameras)]
    turn = mean_rotation(relative)
    source = np.array([turn @ model_poses[name][1] for name in names])
    target = np.array([true_poses[name][1] - camera @ offset[1] for name, camera in zip(names, cameras)])
    centred = source - source.mean(axis=0)
    scale = float((centred * (target - target.mean(axis=0))).sum() / (centred ** 2).sum())
    shift = target.mean(axis=0) - scale * source.mean(axis=0)
    angles = [degrees(turn.T @ one) for one in relative]
    return {"scale": scale, "rotation": turn, "translation": shift, "deg": float(np.sqrt(np.mean(np.square(angles)))),
            "distance": float(np.sqrt(((scale * source + shift - target) ** 2).sum(axis=1).mean()))}


def fitted_offset(models, true_poses):
    """The constant offset of the true poses' body from the camera, by which the models fit the true poses best."""
    offset = (np.eye(3), np.zeros(3))
    for _ in range(100):
        turns, rows, values = [], [], []
        for model in models:
            fit = similarity(model.poses, true_poses, offset)
            for name in (name for name in model.poses if fit and name in true_poses):
                camera = fit["rotation"] @ model.poses[name][0]
                turns.append(camera.T @ true_poses[name][0])
                rows.append(camera)
                centre = fit["scale"] * fit["rotation"] @ model.poses[name][1] + fit["translation"]
                values.append(true_poses[name][1] - centre)
        offset = (mean_rotation(turns), np.linalg.lstsq(np.vstack(rows), np.concatenate(values), rcond=None)[0])
    return offset


def matrix(fit):
    result = np.eye(4)
    result[:3, :3] = fit["scale"] * fit["rotation"]
    result[:3, 3] = fit["translation"]
    return result


def pose_errors(estimate, truth, source):
    scale = [np.cbrt(np.linalg.det(pose[:3, :3])) for pose in (estimate, truth)]
    moved = [source.points @ pose[:3, :3].T + pose[:3, 3] for pose in (estimate, truth)]
    return {"rotation_deg": degrees(estimate[:3, :3] @ truth[:3, :3].T / scale[0] / scale[1]),
            "scale_percent": 100 * abs(scale[0] / scale[1] - 1),
            "displacement_percent": 100 * float(np.median(np.linalg.norm(moved[0] - moved[1], axis=1)))
                                    / (scale[1] * source.viewing_distance)}


# ---- Pairs -----------------------------------------------------------------------------------------------------------


class Place:
    """Models of one place by their names, and the similarities to the true poses of those that can be judged."""

    def __init__(self, name):
        self.name, self.models, self.fits, self.pairs = name, {}, {}, []

    def reconstruct(self, options, sets, camera):
        for part, images in sets.items():
            model = reconstruct(options, f"{self.name}-{part}", images, camera)
            if model:
                self.models[part] = model

    def fit(self, true_poses, offset=(np.eye(3), np.zeros(3))):
        """A model cannot be judged if it is itself farther from the truth than a right pose may be."""
        for part, model in self.models.items():
            fit = similarity(model.poses, true_poses, offset)
            distance = fit and 100 * fit["distance"] / fit["scale"] / model.viewing_distance
            if fit and fit["deg"] <= RIGHT["rotation_deg"] and 0 <= distance <= RIGHT["displacement_percent"]:
                self.fits[part] = fit
                continue
            what = f"RMS {fit['deg']:.2f} degrees, {distance:.1f} % from the true poses" if fit else "too few true poses"
            print(f"{self.name}-{part}: COLMAP's model cannot be judged: {what}", file=sys.stderr)


def simulated_place(options, environment, seed, layout):
    place, count = Place(f"{environment}-{seed}"), options.images
    first, second = (simulate(options, environment, seed, layout, session, (2 - session) * count) for session in (0, 1))
    sets = {"even": first.images[::2], "odd": first.images[1::2], "later": second.images}
    place.pairs = list(itertools.combinations(sets, 2))
    place.reconstruct(options, sets, first.camera)
    place.fit(first.true_poses() | second.true_poses())
    return place


def tum_place(options):
    place, sets, poses = Place("tum"), {}, {}
    for name in TUM:
        sequence = Sequence(options.data / f"tum_fr1_{name}", FR1)
        images = sequence.every(1 / RATE)[:2 * TUM_IMAGES]
        sets |= {f"{name}-even": images[::2], f"{name}-odd": images[1::2]}
        poses |= sequence.true_poses()
    place.pairs = list(itertools.combinations(sets, 2))
    place.reconstruct(options, sets, FR1)
    place.fit(poses, fitted_offset(place.models.values(), poses))
    return place


def align(options, source, target, names, descriptors):
    folders = [model.sparse for model in (source, target)]
    if not descriptors:
        # The same models in folders without a database.
        folders = [options.work / "bare" / name / "model" for name in names]
        for folder, model in zip(folders, (source, target)):
            shutil.copytree(model.sparse, folder, dirs_exist_ok=True)

    def make():
        text, _ = run([options.cairn, "align", *folders, "--scale", "--quiet", "--threads", options.threads, "--json",
                       "-"], allowed=(0, 4))
        return json.loads(text)["results"][0]

    return kept(options.work / "aligned" / f"{'__'.join(names)}__{'sift' if descriptors else 'bare'}.json", make)


def merge(options, source, target, names, adjust):
    folder = options.work / "merged" / ("__".join(names) + ("__adjusted" if adjust else ""))

    def make():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        _, code = run([options.cairn, "merge", source.sparse, target.sparse, "-o", f"{folder / 'model'}/", "--quiet",
                       "--threads", options.threads, *(["--adjust"] if adjust else [])], allowed=(0, 4))
        return {"code": code, **(model_figures(options, folder / "model") if code == 0 else {})}

    done = kept(folder.with_suffix(".json"), make)
    if done["code"]:
        return {"merge": "refused"}
    merged = Model(options, folder / "model", folder / "text")
    before = np.concatenate([source.errors, target.errors])
    mean = [model_figures(options, model.sparse)["mean_px"] for model in (source, target)]
    return {"merge": "adjusted" if adjust else "merged", "images": f"{done['images']}/{len(source.poses) + len(target.poses)}",
            "points_before": len(source.points) + len(target.points), "points": done["points"],
            "analyzer_px_source": mean[0], "analyzer_px_target": mean[1], "analyzer_px": done["mean_px"],
            "mean_px_before": float(np.mean(before)), "mean_px": float(np.mean(merged.errors)),
            "rms_px_before": float(np.sqrt(np.mean(before ** 2))), "rms_px": float(np.sqrt(np.mean(merged.errors ** 2))),
            "median_px_before": float(np.median(before)), "median_px": float(np.median(merged.errors))}


def own_pairs(options, place):
    """Rows of the pairs of one place."""
    for parts in place.pairs:
        names = [f"{place.name}-{part}" for part in parts]
        row = {"kind": "one place", "place": place.name, "source": parts[0], "target": parts[1]}
        if any(part not in place.fits for part in parts):
            yield row | {"status": "no truth"}
            continue
        source, target = (place.models[part] for part in parts)
        if set(source.poses) & set(target.poses):
            sys.exit(f"{names} share images")
        fits = [place.fits[part] for part in parts]
        truth = np.linalg.inv(matrix(fits[1])) @ matrix(fits[0])
        row |= {"truth_rotation_deg": math.hypot(fits[0]["deg"], fits[1]["deg"]),
                "truth_centre_percent": 100 * math.hypot(*(fit["distance"] / fit["scale"] / model.viewing_distance
                                                           for fit, model in zip(fits, (source, target))))}
        for descriptors in options.descriptors:
            result = align(options, source, target, names, descriptors)
            judged = row | {"descriptors": "SIFT" if descriptors else "none", "status": result["status"],
                            "probability": result["probability"], "seconds": result["duration_s"]}
            judged["right"] = False
            if result["target_from_source"] is not None:
                judged |= pose_errors(np.array(result["target_from_source"]), truth, source)
                judged["right"] = all(judged[name] <= limit for name, limit in RIGHT.items())
            accepted = descriptors and result["status"] == "aligned"
            if accepted:
                judged |= merge(options, source, target, names, adjust=False)
            yield judged
            if accepted and options.adjust:
                yield row | {"kind": "adjusted", "descriptors": "SIFT", "right": judged["right"]} | merge(
                    options, source, target, names, adjust=True)


def strange_pairs(options, places):
    """Rows of all pairs of different places, of a model each."""
    chosen = [(place.name, part, place.models[part]) for place in places
              for part in options.strangers if part in place.models]
    for (one, part, source), (other, other_part, target) in itertools.combinations(chosen, 2):
        if one == other:
            continue
        for descriptors in options.descriptors:
            result = align(options, source, target, [f"{one}-{part}", f"{other}-{other_part}"], descriptors)
            yield {"kind": "different places", "source": f"{one} {part}", "target": f"{other} {other_part}",
                   "descriptors": "SIFT" if descriptors else "none", "status": result["status"],
                   "probability": result["probability"], "right": False, "seconds": result["duration_s"]}


# ---- Report ----------------------------------------------------------------------------------------------------------


def write_table(path, columns, rows):
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows({name: f"{value:.4g}" if isinstance(value, float) else value for name, value in row.items()}
                         for row in rows)


def summary(rows):
    largest = lambda chosen, name: max((row[name] for row in chosen), default=math.nan)
    for descriptors in ("SIFT", "none"):
        own = [row for row in rows if row["kind"] == "one place" and row.get("descriptors") == descriptors]
        if not own:
            continue
        strange = [row for row in rows if row["kind"] == "different places" and row["descriptors"] == descriptors]
        accepted = [row for row in own if row["status"] == "aligned"]
        right = [row for row in accepted if row["right"]]
        print(f"descriptors {descriptors}: {len(own)} pairs of one place, {len(accepted)} aligned, {len(right)} right; "
              f"{sum(row['status'] == 'aligned' for row in strange)} of {len(strange)} pairs of different places aligned")
        print("  largest errors of right ones: " + ", ".join(f"{name} {largest(right, name):.2f}" for name in RIGHT))
        print("  uncertainty of the truth, largest: "
              + ", ".join(f"{name} {largest(own, name):.2f}" for name in ("truth_rotation_deg", "truth_centre_percent")))
    print(f"pairs without two models that can be judged: {sum(row.get('status') == 'no truth' for row in rows)}")
    for kind in ("merged", "adjusted"):
        merged = [row for row in rows if row.get("merge") == kind]
        if not merged:
            continue
        complete = sum(len(set(row["images"].split("/"))) == 1 for row in merged)
        print(f"{kind}: {len(merged)}, with all images {complete}")
        for name in ("mean_px", "median_px", "rms_px"):
            ratios = [row[name] / row[f"{name}_before"] for row in merged]
            print(f"  {name} after / before: median {np.median(ratios):.3f}, largest {max(ratios):.3f}; no larger than before "
                  f"{sum(ratio <= 1 for ratio in ratios)}")
        within = sum(row["analyzer_px"] <= max(row["analyzer_px_source"], row["analyzer_px_target"]) for row in merged)
        print(f"  model_analyzer's mean over points no larger than the larger of the two before: {within}")
    refused = sum(row.get("merge") == "refused" for row in rows)
    print(f"accepted pairs that merge refused: {refused}")
    wrong = sum(row.get("status") == "aligned" and not row["right"] for row in rows)
    right = sum(row.get("status") == "aligned" and row["right"] and row["descriptors"] == "SIFT" for row in rows)
    return wrong, right


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cairn", required=True, help="the tool")
    parser.add_argument("--work", required=True, type=pathlib.Path, help="folder for images, models and results")
    parser.add_argument("--data", type=pathlib.Path, help="folder with tum_fr1_desk, tum_fr1_xyz and tum_fr1_rpy")
    parser.add_argument("--colmap", default="colmap", help="COLMAP (default: %(default)s)")
    parser.add_argument("--images", type=int, default=25, help="images of a simulated set (default: %(default)s)")
    parser.add_argument("--features", type=int, default=2000, help="largest number of features in an image (default: %(default)s)")
    parser.add_argument("--first-octave", type=int, default=0, help="COLMAP's SiftExtraction.first_octave (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="threads of COLMAP and Cairn (default: %(default)s)")
    names = {f"{environment}-{seed}": (environment, seed, layout) for environment, seed, layout in PLACES}
    parser.add_argument("--places", nargs="*", choices=list(names), default=list(names),
                        help="simulated places (default: all)")
    parser.add_argument("--strangers", nargs="*", default=["even", "later", "desk-even", "xyz-even", "rpy-even"],
                        help="sets whose models are aligned with those of other places (default: %(default)s)")
    parser.add_argument("--adjust", action="store_true", help="also merge with --adjust")
    parser.add_argument("--no-bare", dest="descriptors", action="store_const", const=(True,), default=(True, False),
                        help="align with descriptors only")
    parser.add_argument("--least-right", type=int, default=0, help="least number of right poses, with descriptors")
    parser.add_argument("--csv", type=pathlib.Path, help="table of all pairs (default: pairs.csv in the work folder)")
    options = parser.parse_args()
    places, rows = [], []
    makers = [lambda name=name: simulated_place(options, *names[name]) for name in options.places]
    if options.data:
        makers.append(lambda: tum_place(options))
    for make in makers:
        places.append(make())
        for row in own_pairs(options, places[-1]):
            rows.append(row)
            print({name: round(value, 3) if isinstance(value, float) else value for name, value in row.items()},
                  file=sys.stderr, flush=True)
    rows += strange_pairs(options, places)
    write_table(options.csv or options.work / "pairs.csv", COLUMNS, rows)
    wrong, right = summary(rows)
    return 1 if wrong or right < options.least_right else 0


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: BSD-3-Clause
"""Whatever is handed in, an exception comes out or a result; never a crash.

CAIRN_MISUSES says how many random calls there are (default 1000), CAIRN_MISUSE_SEED which.
"""

import copy
import gc
import inspect
import os
import pickle
import random
import tempfile
import threading
import unittest
import warnings

import numpy as np

import cairn

ALLOWED = (cairn.Error, TypeError, ValueError, IndexError, OverflowError, AttributeError, OSError, KeyError,
           ImportError, MemoryError)
CALLS = int(os.environ.get("CAIRN_MISUSES", "1000"))
SEED = int(os.environ.get("CAIRN_MISUSE_SEED", "1"))
CAMERA = cairn.Camera("PINHOLE", 64, 48, [50, 50, 32, 24])
MAP = cairn.synthetic_map(landmarks=60, frames=8).with_camera(CAMERA)
POSE = np.eye(4)
# Not what it says, or what takes long.
LEFT_OUT = ("threads", "progress", "effort", "wait_s")


def freed(column):
    """A column of a map that nothing else refers to any more."""
    return getattr(cairn.synthetic_map(landmarks=60, frames=8, seed=2), column)


def values(chance):
    """Values that are right here and there, and wrong in most places."""
    shape = lambda *s: chance.choice([np.zeros(s), np.full(s, np.nan), np.ones(s, np.int64), np.zeros(s, np.uint8)])
    return chance.choice([
        lambda: None, lambda: True, lambda: -1, lambda: 0, lambda: 3, lambda: 2**70, lambda: -(2**70),
        lambda: 0.5, lambda: float("nan"), lambda: float("inf"), lambda: 1e308, lambda: "", lambda: "desk",
        lambda: "\udcff\x00", lambda: b"bytes", lambda: [], lambda: {}, lambda: [[1, 2], [3]], lambda: object(),
        lambda: np.array(["a", "b"]), lambda: np.zeros(3, complex), lambda: np.zeros(3, object),
        lambda: shape(), lambda: shape(3), lambda: shape(0, 3), lambda: shape(60, 3), lambda: shape(60),
        lambda: shape(60, 3, 3), lambda: shape(2, 2), lambda: shape(1, 2, 3, 4), lambda: shape(60, 3)[::-1, ::-1],
        lambda: shape(6, 6), lambda: shape(48, 64), lambda: shape(48, 64, 3), lambda: shape(48, 64).astype(np.float32),
        lambda: POSE, lambda: -POSE, lambda: POSE * np.nan, lambda: POSE * 1e200, lambda: np.diag([0, 0, 0, 1.0]),
        lambda: np.stack([POSE, POSE]), lambda: np.ma.MaskedArray(np.zeros(60), mask=True),
        lambda: np.datetime64("2020"), lambda: MAP, lambda: cairn.LandmarkMap, lambda: cairn.align,
        lambda: MAP.positions, lambda: MAP.pixels, lambda: freed("positions"), lambda: freed("covariances").T,
        lambda: freed("pixels")[::-3], lambda: freed("observing_frames"), lambda: [MAP, None], lambda: [MAP, MAP],
        lambda: CAMERA, lambda: {"a": np.zeros(60)}, lambda: {1: 2}, lambda: "a", lambda: "b", lambda: "x.ply",
        lambda: "x.json", lambda: os.fsencode("x.cairn"), lambda: "rgb", lambda: range(60),
    ])()


def keywords(function):
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return []
    return [p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in LEFT_OUT]


def quick_calls():
    """Functions with how many positional arguments they take, those that are quick; and the objects they are of."""
    m, result = MAP, cairn.icp(MAP, MAP)
    trajectory = cairn.Trajectory([0.0, 1.0], np.stack([POSE, POSE]))
    report = cairn.report(MAP, MAP)
    calls = [
        (cairn.LandmarkMap.from_arrays, 1), (cairn.icp, 2), (cairn.judge, 3), (cairn.align, 2), (cairn.pose_error, 3),
        (cairn.evaluate_trajectory, 2), (cairn.Trajectory, 2), (cairn.Camera, 4), (cairn.map_consistency, 1),
        (cairn.calibrate_covariances, 2), (cairn.report, 3), (m.transformed, 1), (m.select, 1), (m.with_column, 2),
        (m.with_camera, 1), (m.with_length_unit, 1), (m.cut_frames, 2), (m.__reduce__()[0], 1), (cairn.Camera.tum, 1),
        (cairn.Camera.read, 1), (cairn.read_map, 1), (cairn.read_alignments, 1), (cairn.read_trajectory, 1),
        (result.__init__, 1), (cairn.LandmarkMap, 0), (cairn.Alignment, 0), (m.write, 1), (trajectory.write, 1),
        (trajectory.transformed, 1), (report.write, 1), (cairn.synthetic_map, 0), (cairn.paper_experiment, 2),
    ]
    objects = [m, result, trajectory, report, CAMERA, cairn.align(MAP, MAP)]
    if hasattr(cairn, "merge"):
        calls.append((cairn.merge, 1))
        objects.append(cairn.merge([MAP, cairn.synthetic_map(landmarks=60, frames=8, seed=2)]))
    if hasattr(cairn, "Atlas"):
        atlas = cairn.Atlas.create("town.atlas")
        for name, seed in (("a", 1), ("b", 2)):
            atlas.add(cairn.synthetic_map(landmarks=60, frames=8, seed=seed), name)
        calls += [
            (cairn.Atlas.create, 1), (cairn.Atlas.open, 1), (cairn.Atlas.salvage, 2), (atlas.add, 2), (atlas.link, 0),
            (atlas.link_by_odometry, 4), (atlas.link_manually, 4), (atlas.unlink, 2), (atlas.optimize, 0),
            (atlas.merge, 0), (atlas.split, 2), (atlas.compact, 0), (atlas.undo, 1), (atlas.path, 2), (atlas.map, 1),
            (atlas.remove, 1), (atlas.export, 1), (atlas.world_difference, 2),
        ]
        objects += [atlas, atlas.log[0]]
    if hasattr(cairn, "Odometry"):
        odometry = cairn.Odometry(CAMERA)
        calls += [(cairn.Odometry, 1), (odometry.track, 3), (odometry.map, 0), (odometry.trajectory, 0),
                  (odometry.complete, 0), (cairn.ImageLocator, 2), (cairn.map_sequence, 2)]
        objects.append(odometry)
    if hasattr(cairn, "simulate"):
        calls.append((cairn.simulate, 1))
    return calls, objects


RIGHT = {cairn.align: [MAP, MAP], cairn.judge: [MAP, MAP, POSE], cairn.icp: [MAP, MAP],
         cairn.LandmarkMap.from_arrays: [np.ones((60, 3))]}


def misuse(chance, calls, objects):
    """One random call, or another thing that may be done to any object."""
    if chance.random() < 0.1:
        thing, name = chance.choice(objects), chance.choice(["status", "map", "positions", "__class__", "new"])
        return chance.choice([
            lambda: setattr(thing, name, values(chance)), lambda: delattr(thing, name), lambda: copy.copy(thing),
            lambda: copy.deepcopy(thing), lambda: pickle.loads(pickle.dumps(thing)), lambda: hash(thing),
            lambda: thing == values(chance), lambda: thing < values(chance), lambda: len(thing), lambda: list(thing),
            lambda: thing[values(chance)], lambda: thing(), lambda: repr(thing), lambda: float(thing),
            lambda: type(thing)(values(chance)), lambda: np.asarray(thing),
        ])()
    function, count = chance.choice(calls)
    positional = [values(chance) for _ in range(count)]
    if function in RIGHT and chance.random() < 0.6:
        positional = RIGHT[function]
    named = {name: values(chance) for name in keywords(function) if chance.random() < 0.15}
    return function(*positional, **named)


class Misuse(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(folder.name)
        ignored = warnings.catch_warnings()
        ignored.__enter__()
        self.addCleanup(ignored.__exit__, None, None, None)
        warnings.simplefilter("ignore", UserWarning)

    def test_a_thousand_random_calls(self):
        chance = random.Random(SEED)
        calls, objects = quick_calls()
        raised = 0
        for _ in range(CALLS):
            try:
                misuse(chance, calls, objects)
            except ALLOWED:
                raised += 1
        self.assertGreater(raised, CALLS // 2)
        self.assertLess(raised, CALLS)

    def test_random_calls_from_threads_that_share_objects(self):
        calls, objects = quick_calls()
        failures = []

        def work(seed):
            chance = random.Random(seed)
            try:
                for _ in range(CALLS // 10):
                    try:
                        misuse(chance, calls, objects)
                    except ALLOWED:
                        pass
            except BaseException as error:
                failures.append(error)

        threads = [threading.Thread(target=work, args=(4 * SEED + i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(failures, [])

    def test_objects_that_were_never_made(self):
        for name in cairn.__all__:
            cls = getattr(cairn, name)
            if not isinstance(cls, type) or issubclass(cls, Exception):
                continue
            with self.assertRaises(TypeError, msg=name):
                cls.__new__(cls)
            with self.assertRaises(TypeError, msg=name):
                object.__new__(cls)
            derived = type("Derived", (cls,), {"__init__": lambda self: None})
            with self.assertRaises(TypeError, msg=name):
                derived()

    def test_views_outlive_their_maps_in_many_threads(self):
        failures = []

        def work(seed):
            chance = np.random.default_rng(seed)
            for _ in range(30):
                positions = chance.normal(size=(500, 3))
                m = cairn.LandmarkMap.from_arrays(positions)
                view = m.positions
                part = view[10:20].T
                del m, view
                gc.collect(0)
                if not np.array_equal(part, positions[10:20].T):
                    failures.append(seed)

        threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(failures, [])

    def test_unknown_keywords_name_the_one_meant(self):
        with self.assertRaisesRegex(TypeError, "did you mean 'min_probability'"):
            cairn.align(MAP, MAP, min_probabilty=0.9)

    def test_values_out_of_range_name_the_option(self):
        for named, text in (
            ({"min_probability": 2.0}, "min_probability"), ({"k": -1}, "k"), ({"seed": 2**64}, "seed"),
            ({"effort": 0.0}, "effort"), ({"method": "best"}, "'robust' or 'icp'"),
            ({"initial": np.zeros((4, 4))}, ""), ({"initial_covariance": np.eye(6)}, "initial"),
            ({"initial": 2 * POSE}, ""), ({"confidence": "hope"}, "hope"), ({"threads": -1}, "threads"),
        ):
            with self.assertRaisesRegex(cairn.MisuseError, text, msg=str(named)):
                cairn.align(MAP, MAP, **named)
        for named in ({"k": 1.5}, {"k": "5"}, {"judge": 1}, {"seed": None}, {"confidence": 3}, {"progress": 3}):
            with self.assertRaises(TypeError, msg=str(named)):
                cairn.align(MAP, MAP, **named)

    def test_arrays_of_wrong_shape_or_type_name_the_argument(self):
        zeros = np.zeros((4, 3))
        for named, text in (
            ({"covariances": np.zeros((4, 3))}, "covariances: shape"), ({"ids": [1, 2, 3]}, "ids: shape"),
            ({"ids": [1, 1, 2, 3]}, "1"), ({"ids": [-1, 0, 1, 2]}, r"ids\[0\]: -1"),
            ({"colors": np.zeros((4, 4), np.uint8)}, "colors: shape"),
            ({"columns": {"a": [1, 2]}}, r"columns\['a'\]: shape"),
            ({"frame_poses": [np.zeros((4, 4))]}, r"frame_poses\[0\]"), ({"frame_ids": [1]}, "frame_poses"),
            ({"observed_landmarks": [0]}, "all three"), ({"depths": [1.0]}, "observ"),
            ({"frame_poses": [POSE], "observed_landmarks": [4], "observing_frames": [0], "pixels": [[0, 0]]},
             r"observed_landmarks\[0\]: 4"),
            ({"frame_poses": [POSE], "observed_landmarks": [0], "observing_frames": [-1], "pixels": [[0, 0]]},
             r"observing_frames\[0\]: -1"),
            ({"length_unit": "feet"}, "'metres' or 'free'"), ({"gravity": [0, 0]}, "gravity: shape"),
        ):
            with self.assertRaisesRegex(cairn.Error, text, msg=str(named)):
                cairn.LandmarkMap.from_arrays(zeros, **named)
        for named in ({"ids": [0.5, 1, 2, 3]}, {"colors": np.zeros((4, 3))}, {"positions": "abc"},
                      {"covariances": np.zeros((4, 3, 3), complex)}):
            with self.assertRaises(TypeError, msg=str(named)):
                cairn.LandmarkMap.from_arrays(**{"positions": zeros, **named})
        for bad in (np.nan, np.inf, 1e300):
            positions = zeros.copy()
            positions[2, 1] = bad
            with self.assertRaisesRegex(cairn.InputError, "2"):
                cairn.LandmarkMap.from_arrays(positions)


if __name__ == "__main__":
    unittest.main()

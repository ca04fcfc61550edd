# SPDX-License-Identifier: BSD-3-Clause
"""Whatever is handed in, an exception comes out or a result; never a crash."""

import gc
import inspect
import os
import random
import tempfile
import threading
import unittest

import numpy as np

import cairn

ALLOWED = (cairn.Error, TypeError, ValueError, IndexError, OverflowError, AttributeError, OSError, KeyError,
           ImportError, MemoryError)
MAP = cairn.synthetic_map(landmarks=60, frames=8)
POSE = np.eye(4)


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
        lambda: POSE, lambda: -POSE, lambda: POSE * np.nan, lambda: POSE * 1e200, lambda: np.diag([0, 0, 0, 1.0]),
        lambda: np.stack([POSE, POSE]), lambda: np.ma.MaskedArray(np.zeros(60), mask=True),
        lambda: np.datetime64("2020"), lambda: MAP, lambda: cairn.LandmarkMap, lambda: cairn.align,
        lambda: MAP.positions, lambda: MAP.pixels, lambda: [MAP, None], lambda: [MAP, MAP],
        lambda: cairn.Camera("PINHOLE", 64, 48, [50, 50, 32, 24]), lambda: {"a": np.zeros(60)}, lambda: {1: 2},
    ])()


def keywords(function):
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return []
    return [p.name for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in ("threads", "progress", "effort")]


def targets(folder):
    """Functions with how many positional arguments they take; those that are quick."""
    m, result = MAP, cairn.icp(MAP, MAP)
    functions = [
        (cairn.LandmarkMap.from_arrays, 1), (cairn.icp, 2), (cairn.judge, 3), (cairn.align, 2), (cairn.pose_error, 3),
        (cairn.evaluate_trajectory, 2), (cairn.Trajectory, 2), (cairn.Camera, 4), (cairn.map_consistency, 1),
        (cairn.calibrate_covariances, 2), (cairn.report, 3), (m.transformed, 1), (m.select, 1), (m.with_column, 2),
        (m.with_camera, 1), (m.with_length_unit, 1), (m.cut_frames, 2), (m.__reduce__()[0], 1), (cairn.Camera.tum, 1),
        (cairn.Camera.read, 1), (cairn.read_map, 1), (cairn.read_alignments, 1), (cairn.read_trajectory, 1),
        (result.__init__, 1), (cairn.LandmarkMap, 0), (cairn.Alignment, 0),
    ]
    if hasattr(cairn, "merge"):
        functions.append((cairn.merge, 1))
    return functions


class Misuse(unittest.TestCase):
    def test_a_thousand_random_calls(self):
        chance = random.Random(1)
        raised = 0
        with tempfile.TemporaryDirectory() as folder:
            home = os.getcwd()
            os.chdir(folder)
            try:
                functions = targets(folder)
                for _ in range(1000):
                    function, count = chance.choice(functions)
                    right = {cairn.align: [MAP, MAP], cairn.judge: [MAP, MAP, POSE], cairn.icp: [MAP, MAP]}
                    positional = [values(chance) for _ in range(count)]
                    if function in right and chance.random() < 0.6:
                        positional = right[function]
                    named = {name: values(chance) for name in keywords(function) if chance.random() < 0.15}
                    try:
                        function(*positional, **named)
                    except ALLOWED:
                        raised += 1
            finally:
                os.chdir(home)
        self.assertGreater(raised, 500)

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

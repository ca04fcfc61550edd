# SPDX-License-Identifier: BSD-3-Clause
"""Maps: columns in and out, files, copies."""

import copy
import gc
import os
import pathlib
import pickle
import tempfile
import time
import unittest
import warnings

import numpy as np

import cairn


def posed(x):
    pose = np.eye(4)
    pose[:3, 3] = [x, 0.0, -1.0]
    return pose


def full_map():
    """Three landmarks of which the last is seen most, with every column."""
    return cairn.LandmarkMap.from_arrays(
        positions=[[0.0, 0.0, 1.0], [0.1, 0.0, 2.0], [0.2, 0.3, 3.0]],
        covariances=np.array([np.diag([1.0, 2.0, 3.0]), [[2, 1, 0], [1, 2, 0], [0, 0, 1.0]], np.eye(3)]),
        ids=[30, 10, 20],
        colors=np.ma.MaskedArray(
            np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.uint8), mask=[[0] * 3, [1] * 3, [0] * 3]
        ),
        descriptors=np.arange(96, dtype=np.uint8).reshape(3, 32),
        descriptor_kind="ORB",
        columns={"weight": [0.5, np.nan, 2.0]},
        cameras=[cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240], id=7)],
        frame_poses=[posed(0.0), posed(0.5)],
        frame_ids=[100, 101],
        timestamps_s=[1.5, np.nan],
        frame_cameras=np.ma.MaskedArray([0, 0], mask=[False, True]),
        image_names=["a.png", ""],
        observed_landmarks=[2, 0, 2, 1],
        observing_frames=[0, 1, 1, 0],
        pixels=[[1, 2], [3, 4], [5, 6], [7, 8]],
        keypoints=[11, 12, 13, 14],
        depths=[4.0, 2.0, np.nan, 3.0],
        octaves=np.ma.MaskedArray([0, 1, 2, 3], mask=[0, 0, 1, 0]),
        world_frame="desk",
        gravity=[0, 0, -1],
        provenance=["by hand"],
    )


class Columns(unittest.TestCase):
    def test_texts_may_be_any_bytes(self):
        given = dict(image_names=["\udcff.png", "\u00e4"], world_frame="\udcff", provenance=["by \udcff"])
        m = cairn.LandmarkMap.from_arrays(np.zeros((1, 3)), frame_poses=[posed(0.0), posed(0.5)], **given)
        for one in (m, pickle.loads(pickle.dumps(m))):
            self.assertEqual({name: getattr(one, name) for name in given}, given)
        for wrong in ({"image_names": "ab"}, {"image_names": 3}, {"provenance": [b"a"]}, {"world_frame": 3}):
            (name,) = wrong
            with self.assertRaisesRegex(TypeError, f"^{name}.*expected"):
                cairn.LandmarkMap.from_arrays(np.zeros((1, 3)), frame_poses=[posed(0.0), posed(0.5)], **wrong)

    def test_masked_entries_are_unknown(self):
        one = full_map()
        known = [True, False, True]
        observed = [True, True, False, True]

        def masked(values, known):
            result = np.ma.MaskedArray(values)
            result[~np.array(known)] = np.ma.masked
            return result

        m = cairn.LandmarkMap.from_arrays(
            one.positions, covariances=masked(one.covariances, known), columns={"weight": masked([1.0, 2.0, 3.0], known)},
            descriptors=np.ma.MaskedArray(one.descriptors, mask=np.arange(96).reshape(3, 32) == 37),
            descriptor_kind="ORB",
            frame_poses=one.frame_poses, timestamps_s=masked([1, 2], [True, False]),
            observed_landmarks=[0, 1, 2, 2], observing_frames=[0, 1, 0, 1], pixels=np.ones((4, 2)),
            depths=masked([1.0, 2.0, 3.0, 4.0], observed), sigmas_px=masked([1.0, 2.0, 3.0, 4.0], observed))
        np.testing.assert_array_equal(np.isnan(m.covariances).all(axis=(1, 2)), [False, True, False])
        np.testing.assert_array_equal(m.columns["weight"], [1.0, np.nan, 3.0])
        np.testing.assert_array_equal(m.known_descriptors, known)
        np.testing.assert_array_equal(m.timestamps_s, [1.0, np.nan])
        np.testing.assert_array_equal(m.depths, [1.0, 2.0, np.nan, 4.0])
        np.testing.assert_array_equal(m.sigmas_px, [1.0, 2.0, np.nan, 4.0])
        np.testing.assert_array_equal(
            m.with_column("weight", masked([1, 2, 3], known)).columns["weight"], [1.0, np.nan, 3.0])

    def test_a_masked_entry_is_refused_where_none_may_be_unknown(self):
        m = full_map()
        make = cairn.LandmarkMap.from_arrays
        positions = np.ma.masked_greater(m.positions, 2.5)
        ids = np.ma.masked_equal([1, 2, 3], 2)
        for name, entries, call in (
            ("positions", "1 masked entry", lambda: make(positions)),
            ("ids", "1 masked entry", lambda: make(m.positions, ids=ids)),
            ("pixels", "2 masked entries", lambda: make(
                m.positions, frame_poses=m.frame_poses, observed_landmarks=[0], observing_frames=[0],
                pixels=np.ma.MaskedArray(np.zeros((1, 2)), mask=True))),
            ("landmarks", "1 masked entry", lambda: m.select(ids)),
            ("landmarks", "3 masked entries", lambda: m.select(np.ma.MaskedArray([True] * 3, mask=True))),
            ("source", "1 masked entry", lambda: cairn.icp(positions, m.positions)),
        ):
            expected = f"{name}: {entries}; expected .*none of them masked"
            with self.subTest(name), self.assertRaisesRegex(cairn.MisuseError, expected):
                call()
        np.testing.assert_array_equal(make(np.ma.MaskedArray(m.positions, mask=False)).positions, m.positions)

    def test_hold_several_descriptors_of_a_landmark(self):
        given = dict(positions=np.zeros((2, 3)), descriptors=np.array([[1, 2], [3, 4]], np.uint8), descriptor_kind="ORB")
        further = np.array([[5, 6], [7, 8], [9, 10]], np.uint8)
        m = cairn.LandmarkMap.from_arrays(**given, further_descriptors=further, further_descriptor_offsets=[0, 0, 3])
        np.testing.assert_array_equal(m.further_descriptors, further)
        np.testing.assert_array_equal(m.further_descriptor_offsets, [0, 0, 3])
        np.testing.assert_array_equal(m.descriptors, [[1, 2], [3, 4]])
        with self.assertRaises(ValueError):
            cairn.LandmarkMap.from_arrays(**given, further_descriptors=further)
        with self.assertRaises(cairn.InputError):
            cairn.LandmarkMap.from_arrays(**given, further_descriptors=further, further_descriptor_offsets=[0, 1, 2])

    def test_make_bytes_of_descriptors_of_floats(self):
        values = np.random.default_rng(1).normal(size=(20, 64))
        made = cairn.LandmarkMap.descriptor_bytes(values)
        self.assertEqual((made.dtype, made.shape), (np.uint8, (20, 64)))
        np.testing.assert_array_equal(cairn.LandmarkMap.descriptor_bytes(7 * values), made)
        unit = values / np.linalg.norm(values, axis=1, keepdims=True)
        steps = made.astype(float) - 127.5
        cosine = (steps / np.linalg.norm(steps, axis=1, keepdims=True)) @ unit.T
        np.testing.assert_allclose(cosine, unit @ unit.T, atol=0.01)
        m = cairn.LandmarkMap.from_arrays(np.zeros((20, 3)), descriptors=made, descriptor_kind="SuperPoint")
        self.assertEqual(m.descriptor_kind, "SuperPoint")
        with self.assertRaisesRegex(cairn.InputError, r"values\[1\]: is all zero"):
            cairn.LandmarkMap.descriptor_bytes([[1.0, 2.0], [0.0, 0.0]])

    def test_take_descriptors_from_the_features_of_their_images(self):
        m = full_map()
        features = np.arange(15 * 4, dtype=np.uint8).reshape(15, 4)
        asked = []

        def of_image(name):
            asked.append(name)
            return features if name == "a.png" else None

        described = m.with_descriptors("USER", of_image)
        self.assertEqual((described.descriptor_kind, asked), ("USER", ["a.png", ""]))
        # Frame 0, a.png, sees landmark 1 as keypoint 14 and landmark 2 as keypoint 11; frame 1 has no features.
        np.testing.assert_array_equal(described.known_descriptors, [False, True, True])
        np.testing.assert_array_equal(described.descriptors[1:], features[[14, 11]])
        np.testing.assert_array_equal(described.positions, m.positions)
        directions = np.random.default_rng(1).normal(size=(15, 64)).astype(np.float16)
        described = m.with_descriptors("SUPERPOINT", lambda name: directions)
        np.testing.assert_array_equal(described.descriptors[1], cairn.LandmarkMap.descriptor_bytes(directions)[14])
        with self.assertRaisesRegex(cairn.MisuseError, "'a.png'.*14 features.*keypoint 14"):
            m.with_descriptors("USER", lambda name: features[:14])
        with self.assertRaisesRegex(cairn.MisuseError, "descriptors of no numbers"):
            m.with_descriptors("USER", lambda name: features if name else np.zeros((15, 0), np.uint8))
        with self.assertRaisesRegex(cairn.MisuseError, "describes no keypoint"):
            m.with_descriptors("USER", lambda name: None)
        with self.assertRaisesRegex(cairn.MisuseError, "4 as of other images"):
            m.with_descriptors("USER", lambda name: features if name else features[:, :3])
        with self.assertRaisesRegex(ZeroDivisionError, "division"):
            m.with_descriptors("USER", lambda name: 1 // 0)
        with self.assertRaisesRegex(cairn.MisuseError, "does not know the keypoints|no names of images"):
            cairn.LandmarkMap.from_arrays(np.zeros((1, 3))).with_descriptors("USER", of_image)

    def test_need_the_kind_of_their_descriptors(self):
        expected = "descriptor_kind: not given beside descriptors; expected their kind, such as 'ORB' or 'SIFT'"
        with self.assertRaisesRegex(cairn.MisuseError, expected):
            cairn.LandmarkMap.from_arrays(np.zeros((2, 3)), descriptors=np.zeros((2, 32), np.uint8))

    def test_come_back_as_they_were_given(self):
        m = full_map()
        self.assertEqual(len(m), 3)
        np.testing.assert_array_equal(m.ids, [30, 10, 20])
        np.testing.assert_array_equal(m.positions[2], [0.2, 0.3, 3.0])
        np.testing.assert_array_equal(m.covariances[0], np.diag([1.0, 2.0, 3.0]))
        np.testing.assert_array_equal(m.covariances[1], [[2, 1, 0], [1, 2, 0], [0, 0, 1]])
        np.testing.assert_array_equal(m.colors[0], [1, 2, 3])
        self.assertTrue(m.colors.mask[1].all())
        np.testing.assert_array_equal(m.descriptors, np.arange(96, dtype=np.uint8).reshape(3, 32))
        self.assertEqual(m.descriptor_kind, "ORB")
        self.assertTrue(m.known_descriptors.all())
        self.assertIsNone(m.further_descriptors)
        self.assertIsNone(m.further_descriptor_offsets)
        np.testing.assert_array_equal(m.columns["weight"], [0.5, np.nan, 2.0])
        np.testing.assert_array_equal(m.frame_ids, [100, 101])
        np.testing.assert_allclose(m.frame_poses, [posed(0.0), posed(0.5)])
        np.testing.assert_array_equal(m.frame_positions[1], [0.5, 0, -1])
        np.testing.assert_array_equal(m.timestamps_s, [1.5, np.nan])
        self.assertEqual(m.frame_cameras.tolist(), [0, None])
        self.assertEqual(m.image_names, ["a.png", ""])
        self.assertEqual(m.cameras, [cairn.Camera("PINHOLE", 640, 480, [500, 500, 320, 240], id=7)])
        self.assertEqual((m.length_unit, m.world_frame, m.provenance), ("metres", "desk", ["by hand"]))
        np.testing.assert_array_equal(m.gravity, [0, 0, -1])

    def test_observations_are_grouped_by_landmark_in_the_order_given(self):
        m = full_map()
        np.testing.assert_array_equal(m.observation_offsets, [0, 1, 2, 4])
        np.testing.assert_array_equal(m.observation_counts, [1, 1, 2])
        np.testing.assert_array_equal(m.observed_landmarks, [0, 1, 2, 2])
        np.testing.assert_array_equal(m.observing_frames, [1, 0, 0, 1])
        np.testing.assert_array_equal(m.pixels, [[3, 4], [7, 8], [1, 2], [5, 6]])
        np.testing.assert_array_equal(m.depths, [2.0, 3.0, 4.0, np.nan])
        self.assertEqual(m.keypoints.tolist(), [12, 14, 11, 13])
        self.assertEqual(m.octaves.tolist(), [1, 3, 0, None])

    def test_what_is_absent_is_none(self):
        m = cairn.LandmarkMap.from_arrays(np.zeros((2, 3)))
        for name in ("covariances", "colors", "descriptors", "known_descriptors", "descriptor_kind", "timestamps_s",
                     "frame_cameras", "image_names", "observation_offsets", "observation_counts",
                     "observed_landmarks", "observing_frames", "pixels", "keypoints", "depths", "octaves",
                     "world_frame", "gravity", "uuid"):
            self.assertIsNone(getattr(m, name), name)
        self.assertEqual(m.columns, {})
        np.testing.assert_array_equal(m.ids, [0, 1])

    def test_an_empty_map_is_a_map(self):
        m = cairn.LandmarkMap.from_arrays([])
        self.assertEqual(m.positions.shape, (0, 3))
        self.assertEqual(len(m), 0)

    def test_views_cannot_be_written_to_and_share_memory(self):
        m = full_map()
        for name in ("positions", "covariances", "ids", "descriptors", "frame_ids", "frame_positions",
                     "frame_quaternions", "observation_offsets", "observing_frames", "pixels"):
            column = getattr(m, name)
            self.assertFalse(column.flags.writeable, name)
            self.assertTrue(np.shares_memory(column, getattr(m, name)), name)
            with self.assertRaises(ValueError):
                column[...] = 0
            with self.assertRaises(ValueError):
                column.setflags(write=True)

    def test_views_keep_the_map_alive(self):
        positions = cairn.synthetic_map(landmarks=2000).positions
        before = positions.copy()
        gc.collect()
        for _ in range(5):
            cairn.synthetic_map(landmarks=2000, seed=9)
        np.testing.assert_array_equal(positions, before)

    def test_a_large_map_comes_without_a_copy(self):
        m = cairn.LandmarkMap.from_arrays(np.random.default_rng(1).normal(size=(1_000_000, 3)))
        start = time.perf_counter()
        for _ in range(10):
            m.positions
        self.assertLess((time.perf_counter() - start) / 10, 0.001)

    def test_arrays_of_other_layouts_and_types_are_taken(self):
        numbers = np.arange(12.0).reshape(3, 4).T[:, ::-1]
        m = cairn.LandmarkMap.from_arrays(np.asfortranarray(numbers).astype(np.float32))
        np.testing.assert_array_equal(m.positions, numbers)


class Files(unittest.TestCase):
    def test_every_format_of_ours_is_read_back(self):
        m = cairn.synthetic_map(landmarks=300)
        with tempfile.TemporaryDirectory() as folder:
            for name in ("a.map", "a.cairn", "a.ply", "a.pcd"):
                path = pathlib.Path(folder, name)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # point clouds hold no frames
                    m.write(path)
                read = cairn.read_map(str(path))
                np.testing.assert_allclose(np.sort(read.positions, 0), np.sort(m.positions, 0), atol=1e-6)

    def test_warnings_name_files_of_any_bytes(self):
        text = ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 0\n")
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, os.fsdecode(b"\xff.ply"))
            with open(path, "w") as file:
                file.write(text)
            with self.assertWarnsRegex(UserWarning, r"/\\xff\.ply: .* left out"):
                self.assertEqual(len(cairn.read_map(path)), 1)

    def test_what_a_format_cannot_hold_is_warned_of(self):
        with tempfile.TemporaryDirectory() as folder:
            with self.assertWarns(UserWarning):
                cairn.synthetic_map(landmarks=100).with_camera(cairn.Camera.tum("fr1")).write(
                    os.path.join(folder, "model"), format="colmap")

    def test_a_colmap_folder_is_written_and_read(self):
        m = cairn.synthetic_map(landmarks=300).with_camera(cairn.Camera.tum("fr1"))
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "model")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                m.write(path, format="colmap")
            read = cairn.read_map(path)
            self.assertEqual(len(read), len(m))
            self.assertEqual(read.length_unit, "free")

    def test_errors_name_file_line_and_what_was_expected(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "broken.map")
            with open(path, "w") as file:
                file.write("FRAME 0 0 0 0 1 0 0 0\nLANDMARK 1 zero 0 0 1 0 0 0 1 0 0 0 1 0\n")
            with self.assertRaises(cairn.InputError) as caught:
                cairn.read_map(path)
            error = caught.exception
            self.assertEqual((error.file, error.line), (path, 2))
            self.assertIn("number", error.expected)
            self.assertIsInstance(error, cairn.Error)
            self.assertIsInstance(error, ValueError)
            again = pickle.loads(pickle.dumps(error))
            self.assertEqual((str(again), again.line), (str(error), 2))
            missing = os.path.join(folder, "none.map")
            with self.assertRaises(cairn.InputError) as caught:
                cairn.read_map(missing)
            self.assertEqual((caught.exception.file, caught.exception.line), (missing, None))
            with self.assertRaises(cairn.StorageError) as caught:
                full_map().write(os.path.join(folder, "no", "such", "folder.map"))
            self.assertIsInstance(caught.exception, OSError)
            with self.assertRaises(cairn.MisuseError):
                full_map().write(os.path.join(folder, "map.unknown"))
            self.assertEqual(os.listdir(folder), ["broken.map"])


class Copies(unittest.TestCase):
    def test_a_pickled_map_is_the_same(self):
        for m in (full_map(), cairn.LandmarkMap.from_arrays([])):
            again = pickle.loads(pickle.dumps(m))
            for name in ("ids", "positions", "covariances", "descriptors", "pixels", "depths", "timestamps_s"):
                np.testing.assert_array_equal(getattr(again, name), getattr(m, name), name)
            self.assertEqual(again.provenance, m.provenance)

    def test_an_immutable_map_is_its_own_copy(self):
        m = full_map()
        self.assertIs(copy.copy(m), m)
        self.assertIs(copy.deepcopy([m])[0], m)

    def test_damaged_pickles_are_refused(self):
        restore, (data,) = full_map().__reduce__()
        for at in range(0, len(data), 7):
            broken = data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1 :]
            try:
                restore(broken)
            except cairn.Error:
                pass
        with self.assertRaises(cairn.Error):
            restore(b"")


class Operations(unittest.TestCase):
    def test_select_takes_indices_and_masks(self):
        m = full_map()
        np.testing.assert_array_equal(m.select([2, 0]).ids, [20, 30])
        np.testing.assert_array_equal(m.select(m.positions[:, 2] > 1.5).ids, [10, 20])
        np.testing.assert_array_equal(m.select([]).ids, [])

    def test_transformed_moves_positions_and_covariances(self):
        m = full_map()
        turn = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
        moved = m.transformed(turn)
        np.testing.assert_allclose(moved.positions, m.positions @ turn[:3, :3].T + turn[:3, 3], atol=1e-12)
        np.testing.assert_allclose(moved.covariances[0], np.diag([2.0, 1.0, 3.0]), atol=1e-12)

    def test_what_is_no_array_is_named(self):
        for what, name in [(None, "NoneType"), ("a/path", "str")]:
            with self.assertRaisesRegex(TypeError, f"new_from_old: {name} is no array; expected real numbers of shape"):
                full_map().transformed(what)

    def test_with_column_and_unit(self):
        m = full_map().with_column("mine", [1, 2, 3]).with_length_unit("free")
        np.testing.assert_array_equal(m.columns["mine"], [1, 2, 3])
        self.assertEqual(m.length_unit, "free")

    def test_keyframes_state_how_uncertain_their_poses_are(self):
        upper = [1, 0, 0, 0, 0, 0, 4, 0, 0.5, 0, 0, 9, 0, 0, 0, 1, 0, 0, 1, 0, 1]
        text = ("CAIRN 3\nFRAME 1 0 0 0 1 0 0 0\nFRAME 2 1 0 0 1 0 0 0\n"
                f"POSE_COVARIANCE 2 {' '.join(map(str, upper))}\n")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "posed.map"
            path.write_text(text)
            m = cairn.read_map(path)
        self.assertTrue(np.isnan(m.pose_covariances[0]).all())
        expected = np.diag([1.0, 4.0, 9.0, 1.0, 1.0, 1.0])
        expected[1, 3] = expected[3, 1] = 0.5
        np.testing.assert_array_equal(m.pose_covariances[1], expected)
        self.assertIsNone(full_map().pose_covariances)

    def test_frames_of_a_rig_share_an_instant(self):
        text = ("CAIRN 3\nCAMERA 7 PINHOLE 640 480 500 500 320 240\n"
                "CAMERA 9 PINHOLE 640 480 500 500 320 240\n"
                "RIG 1 7 1 0 0 0 0 0 0\nRIG 1 9 1 0 0 0 -0.5 0 0\nFRAME 1 0 0 0 1 0 0 0\n"
                "VIEW 1 7\nINSTANT 1 4\nFRAME 2 0.5 0 0 1 0 0 0\nVIEW 2 9\nINSTANT 2 4\n"
                "FRAME 3 9 9 9 1 0 0 0\n")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "rig.map"
            path.write_text(text)
            m = cairn.read_map(path)
        np.testing.assert_array_equal(m.instants, np.ma.array([4, 4, 0], mask=[0, 0, 1]))
        self.assertEqual(list(m.rigs[0]), [0, 1])
        right_from_left = m.rigs[0][1] @ np.linalg.inv(m.rigs[0][0])
        np.testing.assert_allclose(
            np.linalg.inv(m.frame_poses[1]) @ m.frame_poses[0], right_from_left)
        self.assertEqual(m.transformed(np.diag([2.0, 2, 2, 1])).rigs[0][1][0, 3], -1.0)
        self.assertIsNone(full_map().instants)
        self.assertEqual(full_map().rigs, [])

    def test_a_moved_map_keeps_its_places_on_the_earth(self):
        text = ("CAIRN 2\nMETA georeference 47.37 8.54 408 2 1 0 0 0 5 6 7\n"
                "FRAME 1 0 0 0 1 0 0 0\nGNSS 1 47.37 8.54 410 3\nLANDMARK 3 1 2 3 - 0\n")
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "placed.map"
            path.write_text(text)
            m = cairn.read_map(path)
        self.assertEqual((m.georeference.latitude_deg, m.georeference.altitude_m), (47.37, 408.0))
        np.testing.assert_array_equal(m.gnss_positions, [[47.37, 8.54, 410.0, 3.0]])
        before = m.georeference.geodetic(m.positions)
        moved = m.transformed([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
        self.assertNotEqual(moved.georeference, m.georeference)
        np.testing.assert_allclose(moved.georeference.geodetic(moved.positions), before, atol=1e-7)
        enu = m.in_enu_frame()
        np.testing.assert_allclose(enu.positions, [[7, 10, 13]], atol=1e-12)
        np.testing.assert_array_equal(enu.georeference.enu_from_map, np.eye(4))
        self.assertIsNone(full_map().georeference)
        with self.assertRaisesRegex(cairn.InputError, "has no georeference"):
            full_map().in_enu_frame()

    def test_cut_frames(self):
        m = cairn.synthetic_map(landmarks=500)
        cut = m.cut_frames(int(m.frame_ids[0]), int(m.frame_ids[10]))
        self.assertEqual(len(cut.frame_ids), 10)
        self.assertLess(len(cut), len(m))

    def test_repr_says_what_there_is(self):
        self.assertIn("3 landmarks, 2 frames, 4 observations", repr(full_map()))

    def test_to_pandas(self):
        try:
            import pandas
        except ImportError:
            with self.assertRaises(ImportError):
                full_map().to_pandas()
            return
        table = full_map().to_pandas()
        self.assertEqual(list(table.index), [30, 10, 20])
        self.assertEqual(list(table["observations"]), [1, 1, 2])
        self.assertAlmostEqual(table.loc[30, "sigma_z"], 3.0**0.5)
        self.assertTrue(pandas.isna(table.loc[10, "red"]))
        self.assertEqual(table.loc[20, "red"], 7)


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: BSD-3-Clause
"""Simulated images in, poses and maps out."""

import unittest

import numpy as np

import cairn

PLACE = cairn.simulate("desk", frames=12, rate_hz=10, texture_scale=0.5)


class Simulation(unittest.TestCase):
    def test_is_a_sequence_of_frames(self):
        self.assertEqual(len(PLACE), 12)
        frame = PLACE[-1]
        self.assertEqual(frame.rgb.shape, (480, 640, 3))
        np.testing.assert_array_equal(frame.rgb[..., 0], frame.bgr[..., 2])
        self.assertEqual(frame.depth_m.dtype, np.float32)
        np.testing.assert_array_equal(frame.bgr, PLACE.frame(11).bgr)
        with self.assertRaises(IndexError):
            PLACE[12]
        with self.assertRaises(ValueError):
            frame.depth_m[0, 0] = 1.0
        pixels = PLACE[0].exact_depth_m
        del frame
        self.assertGreater(pixels.max(), 0.5)


class Localization(unittest.TestCase):
    def test_finds_where_an_image_was_taken(self):
        odometry = cairn.Odometry(PLACE.camera, start=PLACE[0].world_from_camera)
        for frame in PLACE:
            odometry.track(frame.timestamp_s, frame.rgb, frame.depth_m)
        odometry.complete()
        locator = cairn.ImageLocator(odometry.map(), PLACE.camera)
        frame = PLACE[7]
        for found in (locator.locate(frame.rgb), locator.locate(frame.bgr, frame.depth_m, channels="bgr")):
            self.assertTrue(found.located, found)
            self.assertIsNone(found.failure)
            self.assertGreaterEqual(found.probability, 0.99)
            off = np.linalg.norm(found.world_from_camera[:3, 3] - frame.world_from_camera[:3, 3])
            self.assertLess(off, 0.03)
            self.assertEqual(found.covariance.shape, (6, 6))
            self.assertGreater(len(found.matches), 20)
        guess = cairn.Camera("SIMPLE_PINHOLE", 640, 480, [800.0, 319.5, 239.5])
        solved = locator.with_camera(guess, focal_length_known=False).locate(frame.rgb)
        self.assertTrue(solved.located, solved)
        true_length = PLACE.camera.parameters[0]
        self.assertLess(abs(solved.camera.parameters[0] - true_length), 0.03 * true_length)
        self.assertGreater(solved.focal_length_sigma, 0.0)
        self.assertIsNone(found.focal_length_sigma)
        unknown = locator.with_camera(guess, focal_length_known=False)
        for one in unknown.locate_with_shared_lens([PLACE[3].rgb, PLACE[7].rgb, PLACE[9].rgb]):
            self.assertTrue(one.located, one)
            self.assertLess(abs(one.camera.parameters[0] - true_length), 0.03 * true_length)
        self.assertEqual(unknown.locate_with_shared_lens([]), [])
        with self.assertRaises(ValueError):
            locator.locate_with_shared_lens([frame.rgb])
        self.assertEqual(found.camera.parameters, PLACE.camera.parameters)
        frames = [PLACE[3], PLACE[7]]
        moved = np.eye(4)
        moved[:3, 3] = [3.0, -2.0, 1.0]
        together = locator.locate_together(
            [frame.rgb for frame in frames], [moved @ frame.world_from_camera for frame in frames]
        )
        self.assertEqual(len(together), 2)
        for frame, one in zip(frames, together):
            self.assertTrue(one.located, one)
            self.assertEqual(one.probability, together[0].probability)
            off = np.linalg.norm(one.world_from_camera[:3, 3] - frame.world_from_camera[:3, 3])
            self.assertLess(off, 0.03)
        with self.assertRaises(ValueError):
            locator.locate_together([frame.rgb], [])
        bigger = cairn.with_frames(odometry.map(), [("new.png", found)])
        self.assertEqual(len(bigger.frame_ids), len(odometry.map().frame_ids) + 1)
        two = cairn.with_frames(
            odometry.map(), [(f"{k}.png", locator.locate(PLACE[k].rgb)) for k in (2, 6, 9)]
        )
        count = len(odometry.map().frame_ids)
        grown = cairn.with_new_landmarks(two, [(count + i, PLACE[k].rgb) for i, k in enumerate((2, 6, 9))])
        self.assertGreaterEqual(len(grown), len(two))
        self.assertEqual(len(grown.frame_ids), count + 3)
        with self.assertRaises(ValueError):
            cairn.with_new_landmarks(two, [(count + 9, PLACE[2].rgb)])
        nothing = locator.locate(np.zeros((480, 640), np.uint8))
        self.assertFalse(nothing.located)
        self.assertEqual(nothing.failure, "few_matches")
        self.assertIsNone(nothing.rival)
        self.assertIsNone(nothing.world_from_camera)
        self.assertIn("rejected", repr(nothing))
        with self.assertRaises(ValueError):
            locator.locate(np.zeros((10, 10), np.uint8))
        with self.assertRaises(ValueError):
            cairn.ImageLocator(odometry.map(descriptors=False), PLACE.camera)


class Odometry(unittest.TestCase):
    def test_follows_the_camera_and_maps(self):
        odometry = cairn.Odometry(PLACE.camera, start=PLACE[0].world_from_camera)
        self.assertIsNone(odometry.last_pose)
        for frame in PLACE:
            report = odometry.track(frame.timestamp_s, frame.rgb, frame.depth_m)
            self.assertEqual(report.status, "tracked", report)
        error = np.linalg.norm(odometry.last_pose[:3, 3] - PLACE[-1].world_from_camera[:3, 3])
        self.assertLess(error, 0.03)
        odometry.complete()
        self.assertEqual(len(odometry.trajectory()), 12)
        result = cairn.evaluate_trajectory(odometry.trajectory(), PLACE.trajectory, alignment="none")
        self.assertLess(result.translation.rmse, 0.03)
        m = odometry.map(min_observations=2)
        self.assertGreater(len(m), 50)
        self.assertIsNotNone(m.covariances)

    def test_follows_a_stereo_camera(self):
        place = cairn.simulate(
            "desk", frames=12, rate_hz=10, texture_scale=0.5, stereo_baseline_m=0.11
        )
        odometry = cairn.Odometry(place.camera, start=place[0].world_from_camera, baseline_m=0.11)
        for frame in place:
            self.assertIsNone(frame.depth_m)
            report = odometry.track(frame.timestamp_s, frame.rgb, right=frame.right_rgb)
            self.assertEqual(report.status, "tracked", report)
        error = np.linalg.norm(odometry.last_pose[:3, 3] - place[-1].world_from_camera[:3, 3])
        self.assertLess(error, 0.03)
        with self.assertRaises(cairn.MisuseError):
            cairn.Odometry(place.camera).track(0.0, place[0].rgb, right=place[0].right_rgb)

    def test_has_an_empty_map_before_its_first_keyframe(self):
        odometry = cairn.Odometry(PLACE.camera)
        for covariance in ("marginal", "recursive"):
            self.assertEqual(len(odometry.map(covariance=covariance)), 0)
            self.assertEqual(len(odometry.map(covariance=covariance).frame_ids), 0)

    def test_channels_and_gray_differ_by_rounding_only(self):
        frame = PLACE[0]
        reports = []
        for image, channels in ((frame.rgb, "rgb"), (frame.bgr, "bgr")):
            odometry = cairn.Odometry(PLACE.camera)
            reports.append(odometry.track(0.0, image, frame.depth_m, channels=channels).landmarks)
        self.assertEqual(reports[0], reports[1])
        gray = np.ascontiguousarray(frame.rgb[..., 1])
        self.assertEqual(cairn.Odometry(PLACE.camera).track(0.0, gray, frame.depth_m).status, "tracked")

    def test_wrong_images_are_refused(self):
        odometry = cairn.Odometry(PLACE.camera)
        for image, depth in (
            (np.zeros((10, 10), np.uint8), None),
            (np.zeros((480, 640), np.uint16), None),
            (np.zeros((480, 640, 4), np.uint8), None),
            (np.zeros((480, 640), np.uint8), np.zeros((2, 2))),
            ("image", None),
            (None, None),
        ):
            with self.assertRaises((cairn.MisuseError, TypeError)):
                odometry.track(0.0, image, depth)
        self.assertEqual(odometry.track(0.0, np.zeros((480, 640), np.uint8)).status, "waiting")
        with self.assertRaises(cairn.MisuseError):
            cairn.Odometry(PLACE.camera, min_tracked=0)
        with self.assertRaises(TypeError):
            cairn.Odometry(PLACE.camera, min_trackd=10)


if __name__ == "__main__":
    unittest.main()

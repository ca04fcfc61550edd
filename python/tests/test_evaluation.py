# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories, errors against the truth, the paper's experiment."""

import os
import pickle
import tempfile
import unittest

import numpy as np

import cairn


def path(count=50):
    poses = np.tile(np.eye(4), (count, 1, 1))
    t = np.linspace(0.0, 5.0, count)
    poses[:, :3, 3] = np.c_[t, np.sin(t), np.cos(2 * t)]
    return t, poses


class Trajectories(unittest.TestCase):
    def test_come_back_as_they_were_given(self):
        t, poses = path()
        trajectory = cairn.Trajectory(t, poses)
        self.assertEqual(len(trajectory), 50)
        np.testing.assert_array_equal(trajectory.timestamps_s, t)
        np.testing.assert_allclose(trajectory.poses, poses)
        np.testing.assert_array_equal(trajectory.positions, poses[:, :3, 3])
        self.assertAlmostEqual(trajectory.duration_s, 5.0)
        again = pickle.loads(pickle.dumps(trajectory))
        np.testing.assert_array_equal(again.poses, trajectory.poses)

    def test_are_written_and_read(self):
        trajectory = cairn.Trajectory(*path())
        with tempfile.TemporaryDirectory() as folder:
            file = os.path.join(folder, "path.txt")
            trajectory.write(file)
            np.testing.assert_allclose(cairn.read_trajectory(file).poses, trajectory.poses, atol=1e-12)

    def test_errors_do_not_depend_on_the_frame(self):
        t, poses = path()
        truth = cairn.Trajectory(t, poses)
        move = np.array([[0, -1, 0, 3], [1, 0, 0, 2], [0, 0, 1, 1], [0, 0, 0, 1.0]])
        noise = np.random.default_rng(1).normal(scale=0.01, size=(50, 3))
        poses = poses.copy()
        poses[:, :3, 3] += noise
        estimate = cairn.Trajectory(t, poses).transformed(move)
        result = cairn.evaluate_trajectory(estimate, truth, intervals=["1m", "10f", "99s"])
        self.assertLess(abs(result.translation.rmse - 0.01 * 3**0.5), 0.004)
        self.assertEqual(result.pairs.shape, (50, 2))
        np.testing.assert_allclose(result.truth_from_estimate @ move, np.eye(4), atol=0.02)
        self.assertEqual(result.translations.shape, (50,))
        self.assertIsNotNone(result.relative["1m"])
        self.assertIsNone(result.relative["99s"])
        self.assertIn("rmse", repr(result.translation))

    def test_what_cannot_be_aligned_says_why(self):
        truth = cairn.Trajectory(*path())
        late = cairn.Trajectory(truth.timestamps_s + 100.0, truth.poses)
        result = cairn.evaluate_trajectory(late, truth)
        self.assertIsNone(result.translation)
        self.assertTrue(result.reason)


class Maps(unittest.TestCase):
    def test_pose_error_is_measured_at_the_landmarks(self):
        turn = np.eye(4)
        turn[:2, :2] = [[0, -1], [1, 0]]
        error = cairn.pose_error(turn, np.eye(4), [[0, 0, 5.0]])
        self.assertAlmostEqual(error.rotation_deg, 90.0)
        self.assertAlmostEqual(error.translation, 0.0)
        self.assertAlmostEqual(error.log_scale, 0.0)

    def test_consistency_and_calibration_of_a_synthetic_map(self):
        noisy = cairn.synthetic_map(landmarks=800)
        exact = cairn.synthetic_map(landmarks=800, pixel_noise_px=0.0, depth_noise_m=0.0)
        consistency = cairn.map_consistency(noisy)
        self.assertGreater(consistency.reprojection.median, 0.1)
        self.assertEqual(consistency.reprojection_px.shape, noisy.observed_landmarks.shape)
        calibration = cairn.calibrate_covariances(noisy, exact)
        self.assertGreater(calibration.count, 100)
        self.assertLess(abs(calibration.mean - 3.0), 1.0)
        self.assertEqual(calibration.nees.shape, (len(noisy),))

    def test_the_papers_experiment_has_180_runs(self):
        pair = cairn.synthetic_pair(landmarks=150)
        results = cairn.paper_experiment(pair.source, pair.target, pair.target_from_source, max_iterations=5)
        runs = results.runs
        self.assertEqual(len(runs["score"]), 180)
        self.assertEqual({len(column) for column in runs.values()}, {180})
        self.assertEqual(set(runs["strategy"]), {"base", "covariance", "observations", "distance"})
        self.assertFalse(np.isnan(runs["translation_error"]).all())
        self.assertTrue(any("|" in table for table in results.tables.values()))


if __name__ == "__main__":
    unittest.main()

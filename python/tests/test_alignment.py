# SPDX-License-Identifier: BSD-3-Clause
"""Aligning, judging, merging; long calls."""

import json
import math
import os
import pickle
import signal
import tempfile
import threading
import time
import unittest
import warnings

import numpy as np

import cairn

PAIR = cairn.synthetic_pair(landmarks=1500)


class Align(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.result = cairn.align(PAIR.source, PAIR.target)

    def test_finds_the_pose_and_is_sure_of_it(self):
        result = self.result
        self.assertEqual((result.verdict, result.status), ("aligned", "aligned"))
        self.assertGreater(result.probability, 0.99)
        error = cairn.pose_error(result.target_from_source, PAIR.target_from_source, PAIR.source)
        self.assertLess(error.translation, 0.01)
        self.assertLess(error.rotation_deg, 0.2)
        self.assertEqual(result.covariance.shape, (6, 6))
        self.assertGreater(np.linalg.eigvalsh(result.covariance).min(), 0.0)
        self.assertEqual(result.candidates[0].target_from_source.shape, (4, 4))
        self.assertEqual(result.scale, 1.0)
        self.assertEqual(len(result.unobservable), 0)

    def test_the_result_does_not_depend_on_the_threads(self):
        again = cairn.align(PAIR.source, PAIR.target, threads=1)
        np.testing.assert_array_equal(again.estimate, self.result.estimate)
        self.assertEqual(again.probability, self.result.probability)

    def test_different_places_are_rejected(self):
        other = cairn.synthetic_map(landmarks=1500, seed=5)
        result = cairn.align(PAIR.source, other)
        self.assertNotEqual(result.verdict, "aligned")
        self.assertIsNone(result.target_from_source)
        self.assertIn("not", result._repr_html_())

    def test_options_reach_the_library(self):
        unjudged = cairn.align(PAIR.source, PAIR.target, judge=False)
        self.assertIsNone(unjudged.verdict)
        self.assertIsNotNone(unjudged.estimate)
        guided = cairn.align(
            PAIR.source, PAIR.target, method="icp", initial=PAIR.target_from_source, confidence="covariance",
            k=3, max_iterations=7, stop_at_repetition=False, trace=True)
        self.assertLessEqual(guided.registration.iterations, 7)
        self.assertEqual(len(guided.registration.history["score"]), guided.registration.iterations)
        self.assertFalse(np.isnan(guided.registration.history["score"]).any())
        document = json.loads(guided.to_json())
        self.assertEqual(document["results"][0]["k"], 3)
        self.assertEqual(document["results"][0]["confidence"], "covariance")
        self.assertEqual(document["options"]["max_iterations"], 7)

    def test_scale_is_found_if_asked_for(self):
        small = PAIR.source.transformed(np.diag([0.5, 0.5, 0.5, 1.0])).with_length_unit("free")
        with self.assertRaises(cairn.MisuseError):
            cairn.align(small, PAIR.target)
        result = cairn.align(small, PAIR.target, scale=True)
        self.assertEqual(result.verdict, "aligned")
        self.assertAlmostEqual(result.scale, 2.0, places=1)
        self.assertEqual(result.covariance_with_scale.shape, (7, 7))

    def test_a_document_is_read_back(self):
        text = self.result.to_json()
        self.assertEqual(json.loads(text)["schema"], {"name": "cairn.align", "version": 2})
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "result.json")
            with open(path, "w") as file:
                file.write(text)
            (read,) = cairn.read_alignments(path)
        np.testing.assert_array_equal(read.estimate, self.result.estimate)
        self.assertEqual(read.reason, self.result.reason)

    def test_pickling_keeps_everything(self):
        again = pickle.loads(pickle.dumps(self.result))
        self.assertEqual(again.to_json(), self.result.to_json())
        np.testing.assert_array_equal(again.registration.matches, self.result.registration.matches)
        self.assertEqual(len(again.candidates), len(self.result.candidates))

    def test_an_unlimited_option_is_kept(self):
        for given in (math.inf, np.float32(math.inf)):
            result = cairn.align(
                PAIR.source, PAIR.target, method="icp", initial=PAIR.target_from_source, max_distance=given,
                judge=False)
            options = json.loads(result.to_json(), parse_constant=self.fail)["options"]
            self.assertIsNone(options["max_distance"])
            again = pickle.loads(pickle.dumps(result))
            self.assertEqual(again.to_json(), result.to_json())

    def test_reads_well(self):
        self.assertIn("aligned", repr(self.result))
        self.assertIn("<table>", self.result._repr_html_())

    def test_a_path_for_a_map_says_how_to_read_one(self):
        for call in (lambda: cairn.align("a.map", PAIR.target), lambda: cairn.align(PAIR.source, "b.map"),
                     lambda: cairn.judge("a.map", PAIR.target, np.eye(4))):
            with self.assertRaisesRegex(TypeError, r"str; expected a LandmarkMap, which cairn\.read_map\(path\)"):
                call()

    def test_judge_holds_a_pose_against_the_others(self):
        right = cairn.judge(PAIR.source, PAIR.target, self.result.estimate)
        self.assertEqual(right.verdict, "aligned")
        wrong = cairn.judge(PAIR.source, PAIR.target, np.eye(4))
        self.assertEqual(wrong.verdict, "rejected")
        np.testing.assert_array_equal(wrong.estimate, np.eye(4))


class Icp(unittest.TestCase):
    def test_of_arrays_finds_a_small_motion(self):
        points = np.random.default_rng(3).uniform(size=(400, 3))
        moved = points + [0.01, -0.005, 0.002]
        result = cairn.icp(points, moved)
        np.testing.assert_allclose(result.target_from_source[:3, 3], [0.01, -0.005, 0.002], atol=1e-12)
        self.assertEqual(result.status, "converged")
        np.testing.assert_array_equal(result.matches[:, 0], result.matches[:, 1])

    def test_confidences_weigh(self):
        source = np.random.default_rng(3).uniform(size=(50, 3))
        target = np.concatenate([source, source + 0.001])
        trust = np.r_[np.zeros(50), np.ones(50)]
        result = cairn.icp(source, target, target_confidences=trust, k=2)
        np.testing.assert_allclose(result.target_from_source[:3, 3], 0.001, atol=1e-9)

    def test_of_maps_takes_a_metric(self):
        result = cairn.icp(PAIR.source, PAIR.target, initial=PAIR.target_from_source, confidence="observations")
        self.assertLess(cairn.pose_error(result.target_from_source, PAIR.target_from_source, PAIR.source).translation, 0.05)

    def test_nothing_to_match_is_a_status(self):
        self.assertEqual(cairn.icp(np.zeros((0, 3)), np.zeros((5, 3))).status, "failed")


@unittest.skipUnless(hasattr(cairn, "merge"), "SKIPPED: built without Ceres: merging was not tested")
class Merge(unittest.TestCase):
    def test_makes_one_map_of_two_and_says_what_it_left_out(self):
        other = cairn.synthetic_map(landmarks=1500, seed=5)
        result = cairn.merge([PAIR.target, PAIR.source, other], names=["target", "source", "other"])
        self.assertEqual(result.placed, 2)
        self.assertEqual([part.placed for part in result.maps], [True, True, False])
        self.assertTrue(result.maps[2].reason)
        error = cairn.pose_error(result.maps[1].world_from_map, PAIR.target_from_source, PAIR.source)
        self.assertLess(error.translation, 0.01)
        self.assertLess(len(result.map), len(PAIR.source) + len(PAIR.target))
        self.assertGreater(result.maps[1].fused, 100)
        self.assertEqual(len(result.links), 3)
        (used,) = [link for link in result.links if link.used]
        self.assertEqual((used.source, used.target, used.verdict), ("source", "target", "aligned"))
        self.assertFalse(result.adjusted)

    def test_says_which_frames_of_a_folded_map_it_left_out(self):
        one = cairn.synthetic_map(landmarks=600, seed=4, frames=12)

        def photographs(poses, positions):
            return cairn.LandmarkMap.from_arrays(
                positions, frame_poses=poses, image_names=[f"{i}.jpg" for i in range(12)],
                observed_landmarks=one.observed_landmarks, observing_frames=one.observing_frames, pixels=one.pixels)

        folded = one.frame_poses.copy()
        folded[7] = np.array([[1, 0, 0, 2], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]) @ folded[7]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # says how many images are common
            # Of two models of the same photographs no landmark has the same coordinates.
            result = cairn.merge([photographs(one.frame_poses, one.positions),
                                  photographs(folded, one.positions + np.random.default_rng(1).normal(0, 1e-4, one.positions.shape))])
        left_out = [part.folded_frames for part in result.maps if part.folded_frames is not None]
        self.assertEqual(left_out, [[7]])

    def test_names_may_be_any_bytes(self):
        other = cairn.synthetic_map(landmarks=300, seed=5)
        result = cairn.merge([PAIR.target, other], names=["\udcff", "other"])
        self.assertEqual([part.name for part in result.maps], ["\udcff", "other"])
        self.assertTrue(result.maps[1].reason)
        self.assertTrue(result.links[0].reason)

    def test_adjusts_if_asked_or_says_why_not(self):
        maps = [part.with_camera(cairn.Camera.tum("fr1")) for part in (PAIR.target, PAIR.source)]
        plain = cairn.merge(maps).map
        adjusted = cairn.merge(maps, adjust=True, matching_rounds=0)
        self.assertTrue(adjusted.adjusted)
        self.assertFalse(np.array_equal(adjusted.map.frame_poses, plain.frame_poses))
        before, after = (cairn.map_consistency(m).reprojection.rmse for m in (plain, adjusted.map))
        self.assertLess(after, before)
        bare = [cairn.LandmarkMap.from_arrays(m.positions, covariances=m.covariances) for m in maps]
        with self.assertWarnsRegex(UserWarning, "not adjusted: no map knows its observations"):
            self.assertFalse(cairn.merge(bare, adjust=True).adjusted)
        for named, kind in (({"adjust": 1}, TypeError), ({"matching_rounds": 11}, cairn.MisuseError),
                            ({"matching_rounds": 0.5}, TypeError), ({"refine_intrinsics": "x"}, TypeError)):
            with self.assertRaises(kind, msg=str(named)):
                cairn.merge(maps, **named)


class LongCalls(unittest.TestCase):
    def test_an_interrupt_ends_them_at_once(self):
        big = cairn.synthetic_pair(landmarks=20000, overlap=0.1)
        sent = []

        def interrupt():
            sent.append(time.process_time())
            os.kill(os.getpid(), signal.SIGINT)

        timer = threading.Timer(0.3, interrupt)
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            cairn.align(big.source, big.target, effort=64.0)
        self.assertLess(time.process_time() - sent[0], 5.0)  # of work, however busy the machine is

    def test_progress_is_told_and_may_stop_the_work(self):
        shares = []
        cairn.align(PAIR.source, PAIR.target, progress=shares.append)
        self.assertEqual(shares[-1], 1.0)
        self.assertEqual(shares, sorted(shares))

        def stop(share):
            raise RuntimeError("enough")

        with self.assertRaisesRegex(RuntimeError, "enough"):
            cairn.align(PAIR.source, PAIR.target, effort=16.0, progress=stop)

    def test_a_bar_is_shown_if_tqdm_is_there(self):
        cairn.align(PAIR.source, PAIR.target, progress=True)

    def test_other_python_threads_go_on(self):
        count = [0]
        done = threading.Event()

        def work():
            while not done.is_set():
                count[0] += 1
                time.sleep(0.001)

        thread = threading.Thread(target=work)
        thread.start()
        try:
            cairn.align(PAIR.source, PAIR.target, effort=8.0, threads=1)
        finally:
            done.set()
            thread.join()
        self.assertGreater(count[0], 20)

    def test_maps_may_be_used_from_many_threads(self):
        results = []

        def work():
            results.append(cairn.align(PAIR.source, PAIR.target, threads=1).estimate)

        threads = [threading.Thread(target=work) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(results), 3)
        for estimate in results:
            np.testing.assert_array_equal(estimate, results[0])


@unittest.skipUnless(cairn.has_viewer(), "SKIPPED: built without the viewer: reports were not tested")
class Reports(unittest.TestCase):
    def test_are_one_page_that_is_written_and_shown(self):
        result = cairn.align(PAIR.source, PAIR.target, trace=True)
        report = cairn.report(PAIR.source, PAIR.target, [result], truth=PAIR.target_from_source, title="A <title>")
        self.assertIn("A &lt;title&gt;", report.html)
        self.assertTrue(report._repr_html_().startswith("<iframe srcdoc="))
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "report.html")
            report.write(path)
            with open(path, encoding="utf-8") as file:
                self.assertEqual(file.read(), report.html)

    def test_are_made_of_results_with_an_unlimited_option(self):
        result = cairn.align(
            PAIR.source, PAIR.target, method="icp", initial=PAIR.target_from_source, max_distance=math.inf,
            judge=False)
        self.assertIn("html", cairn.report(PAIR.source, PAIR.target, [result]).html)

    def test_of_one_map_need_nothing_else(self):
        self.assertIn("html", cairn.report(PAIR.source).html)

    def test_sequences_of_the_maps_are_read(self):
        with self.assertRaisesRegex(cairn.Error, "nowhere"):
            cairn.report(PAIR.source, source_sequence="nowhere")
        with self.assertRaisesRegex(cairn.Error, "target"):
            cairn.report(PAIR.source, target_sequence="nowhere")

    def test_results_of_other_maps_are_refused(self):
        result = cairn.align(PAIR.source, PAIR.target, trace=True)
        small = cairn.synthetic_map(landmarks=20)
        with self.assertRaises(cairn.Error):
            cairn.report(small, small, [result])


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: BSD-3-Clause
"""An atlas: adding, linking, optimising, merging, undoing, and opening again."""

import datetime
import json
import os
import pathlib
import signal
import sqlite3
import tempfile
import threading
import time
import unittest
import warnings

import numpy as np

import cairn

PAIR = cairn.synthetic_pair(landmarks=1500)
MOVED = np.array([[0.0, -1.0, 0.0, 2.0], [1.0, 0.0, 0.0, -1.0], [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.0, 1.0]])
# Two sessions of one desk, the second once more from another start, and another place.
MONDAY, FRIDAY, ELSEWHERE = PAIR.target, PAIR.source, cairn.synthetic_map(landmarks=1500, seed=5)
AGAIN = PAIR.source.transformed(MOVED).select(np.arange(0, len(PAIR.source), 2))
TIGHT = np.diag([1e-4] * 3 + [1e-5] * 3)


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name, "town.atlas")


class Story(Folder):
    def test_three_maps_become_one(self):
        with cairn.Atlas.create(self.path) as atlas:
            self.assertEqual((atlas.location, atlas.read_only, atlas.maps, atlas.links, atlas.log),
                             (str(self.path), False, {}, [], []))
            added = atlas.add(MONDAY, "monday", session="first run")
            self.assertEqual((added.name, added.session, added.landmarks, added.frames),
                             ("monday", "first run", len(MONDAY), len(MONDAY.frame_ids)))
            self.assertIsNone(added.frame_from_map)
            self.assertIsNone(atlas.add(FRIDAY, name="friday").session)
            self.assertEqual(atlas.add(AGAIN, name="again").name, "again")
            self.assertEqual(atlas.add(FRIDAY, name="other name").name, "friday")
            self.assertEqual(list(atlas.maps), ["monday", "friday", "again"])
            np.testing.assert_array_equal(atlas.map("friday").positions, FRIDAY.positions)

            shares = []
            linked = atlas.link(progress=shares.append)
            self.assertEqual((linked.pairs, linked.tried, linked.aligned), (3, 3, 3))
            self.assertEqual(shares[-1], 1.0)
            self.assertEqual([link.used for link in atlas.links], [False] * 3)
            optimised = atlas.optimize()
            self.assertEqual((optimised.placed, optimised.contradicted, optimised.changed), (3, 0, True))
            self.assertFalse(atlas.optimize().changed)
            self.assertFalse(atlas.update_poses().changed)

            pose = atlas.maps["friday"]
            self.assertEqual((pose.frame, pose.covariance.shape), ("monday", (7, 7)))
            error = cairn.pose_error(pose.frame_from_map, PAIR.target_from_source, FRIDAY)
            self.assertLess(error.translation, 0.01)
            np.testing.assert_array_equal(atlas.maps["monday"].frame_from_map, np.eye(4))
            link = atlas.links[0]
            self.assertEqual((link.target, link.source, link.kind, link.verdict, link.used),
                             ("monday", "friday", "placement", "aligned", True))
            self.assertEqual(link.covariance.shape, (6, 6))
            self.assertGreater(link.probability, 0.99)

            atlas.add(ELSEWHERE, "elsewhere")
            linked = atlas.link(only=["elsewhere"], seed=0)
            self.assertEqual((linked.pairs, linked.tried, linked.tried_before, linked.aligned), (3, 3, 0, 0))
            merged = atlas.merge()
            self.assertEqual([part.name for part in merged.maps if part.placed], ["monday", "friday", "again"])
            self.assertIn("no pose", merged.maps[3].reason)
            self.assertGreater(merged.maps[1].fused, 100)
            self.assertLess(len(merged.map), len(MONDAY) + len(FRIDAY) + len(AGAIN))
            self.assertEqual((merged.placed, merged.adjusted, len(merged.links)), (3, False, 6))
            self.assertIn("3 of 4 maps placed", repr(merged))
            at_two = atlas.log[1].id
            with self.assertRaisesRegex(cairn.MisuseError, "no two maps"):
                atlas.merge(at=at_two)

        with cairn.Atlas.open(self.path, read_only=True) as atlas:
            np.testing.assert_array_equal(atlas.merge(frame="again").map.positions, merged.map.positions)
            self.assertEqual(atlas.verify(), [])
            log = atlas.log
            self.assertEqual([commit.verb for commit in log][:3], ["add"] * 3)
            self.assertLess(abs(datetime.datetime.now(datetime.timezone.utc) - log[0].time).total_seconds(), 600)
            self.assertEqual(([log[0].id, log[0].run, log[0].undoes]), [1, 1, None])
            self.assertIn("monday", log[0].text)
            self.assertTrue(log[0].author)
            with self.assertRaises(cairn.StorageError):
                atlas.add(ELSEWHERE.select(np.arange(100)), "new")

    def test_paths_lead_over_links(self):
        with cairn.Atlas.create(self.path) as atlas:
            for name, part in (("a", MONDAY), ("b", FRIDAY), ("c", AGAIN), ("d", ELSEWHERE)):
                atlas.add(part, name)
            atlas.link_manually("a", "b", PAIR.target_from_source, TIGHT, reason="seen by eye")
            self.assertTrue(atlas.link_by_odometry("b", "c", np.linalg.inv(MOVED), TIGHT))
            self.assertFalse(atlas.link_by_odometry("c", "b", MOVED, TIGHT))
            self.assertEqual([link.kind for link in atlas.links], ["manual", "odometry"])
            self.assertEqual((atlas.links[0].reason, atlas.links[0].probability), ("seen by eye", None))
            path = atlas.path("a", "c")
            self.assertEqual(path.maps, ["a", "b", "c"])
            np.testing.assert_allclose(
                path.target_from_source, PAIR.target_from_source @ np.linalg.inv(MOVED), atol=1e-12)
            self.assertEqual((len(path.links), path.covariance.shape, path.optimised), (2, (7, 7), None))
            atlas.optimize()
            np.testing.assert_allclose(atlas.path("a", "c").optimised, path.target_from_source, atol=1e-6)
            self.assertIsNone(atlas.path("a", "d"))
            atlas.unlink("a", "b", reason="two desks that look alike")
            self.assertEqual(atlas.links[-1].verdict, "rejected")
            atlas.optimize()
            self.assertIsNone(atlas.path("a", "c"))
            self.assertEqual(atlas.maps["c"].frame, "b")

    def test_a_call_is_undone_as_a_whole(self):
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(MONDAY, "monday")
            parts = atlas.split("monday", 3)
            self.assertEqual(list(atlas.maps), parts)
            self.assertGreater(len(parts), 1)
            self.assertEqual({part.session for part in atlas.maps.values()}, {"monday"})
            self.assertEqual(atlas.undo(), 3)
            self.assertEqual((list(atlas.maps), atlas.links), (["monday"], []))
            self.assertEqual(atlas.log[-1].undoes, 3)
            atlas.undo(atlas.log[-1].id)  # does it again
            self.assertEqual(list(atlas.maps), parts)
            with self.assertRaisesRegex(cairn.MisuseError, "no commit 99"):
                atlas.undo(99)
            atlas.remove(parts[0])
            self.assertEqual(list(atlas.maps), parts[1:])
            self.assertEqual(atlas.log[-1].verb, "remove")
            self.assertEqual(len({commit.run for commit in atlas.log}), 5)

    def test_adjusting_says_so_or_why_not(self):
        with cairn.Atlas.create(self.path) as atlas:
            cameras = [part.with_camera(cairn.Camera.tum("fr1")) for part in (MONDAY, FRIDAY)]
            atlas.add(cameras[0], "monday")
            atlas.add(cameras[1], "friday")
            atlas.link_manually("monday", "friday", PAIR.target_from_source, TIGHT)
            atlas.optimize()
            self.assertTrue(atlas.merge(adjust=True, matching_rounds=0).adjusted)
            bare = cairn.LandmarkMap.from_arrays(AGAIN.positions, covariances=AGAIN.covariances)
        with cairn.Atlas.create(self.path.with_name("bare.atlas")) as atlas:
            atlas.add(bare, "bare")
            atlas.add(bare.transformed(MOVED), "moved")
            atlas.link_manually("moved", "bare", MOVED, TIGHT)
            atlas.optimize()
            with self.assertWarnsRegex(UserWarning, "not adjusted: no map knows its observations"):
                self.assertFalse(atlas.merge(adjust=True).adjusted)

    def test_shards_share_the_pairs(self):
        with cairn.Atlas.create(self.path) as atlas:
            for i in range(4):
                atlas.add(cairn.synthetic_map(landmarks=200, seed=i), f"map {i}")
            tried = [atlas.link(shard=i, shards=3).tried for i in range(3)]
            self.assertEqual(tried, [2, 2, 2])
            self.assertEqual(atlas.link().tried_before, 6)
            self.assertEqual(atlas.link(retry=True).tried, 6)
            self.assertEqual(atlas.link(only=[]).pairs, 0)


def wall_with_box(seed, box):
    """The map of a visit to a wall, with or without a box before it: eight cameras in a row that look along z."""
    points = np.random.default_rng(1)
    spots = points.uniform([-2.0, -1.0, 3.0], [2.0, 1.0, 3.02], (900, 3))
    box_spots = points.uniform([0.2, -0.1, 2.0], [0.5, 0.2, 2.1], (80, 3))
    looks = points.integers(0, 256, (980, 32), np.uint8)
    spots = np.concatenate([spots, box_spots]) if box else spots
    chance = np.random.default_rng(seed)
    found = np.flatnonzero(chance.random(len(spots)) < 0.7)
    positions = spots[found] + chance.normal(0.0, 0.004, (len(found), 3))
    poses = np.tile(np.eye(4), (8, 1, 1))
    poses[:, 0, 3] = np.linspace(-0.7, 0.7, 8)
    in_camera = positions[:, None] - poses[None, :, :3, 3]
    pixels = 300.0 * in_camera[..., :2] / in_camera[..., 2:] + [320.0, 240.0]
    landmark, frame = np.nonzero(np.all((pixels >= 0.0) & (pixels <= [640, 480]), axis=-1))
    return cairn.LandmarkMap.from_arrays(
        positions, covariances=np.tile(1.6e-5 * np.eye(3), (len(found), 1, 1)), descriptors=looks[found],
        descriptor_kind="test", cameras=[cairn.Camera("PINHOLE", 640, 480, [300.0, 300.0, 320.0, 240.0])],
        frame_poses=poses, frame_cameras=np.zeros(8, int), timestamps_s=seed + 0.1 * np.arange(8),
        observed_landmarks=landmark, observing_frames=frame, pixels=pixels[landmark, frame])


class World(Folder):
    def setUp(self):
        super().setUp()
        self.atlas = cairn.Atlas.create(self.path)
        self.addCleanup(self.atlas.close)
        self.atlas.add(wall_with_box(11, True), "a", session="monday")
        self.atlas.add(wall_with_box(12, False), "b", session="tuesday")
        self.atlas.link_manually("a", "b", np.eye(4), 1e-4 * TIGHT)
        self.atlas.optimize()

    def test_what_vanished_and_what_appeared(self):
        for first, second in (("monday", "tuesday"), ("a", "b")):
            found = self.atlas.world_difference(first, second)
            (change,) = found.changes
            self.assertEqual((change.kind, change.after, change.after_from_before, found.frame),
                             ("vanished", None, None, "a"))
            np.testing.assert_allclose(change.before.position, [0.35, 0.05, 2.05], atol=0.06)
            low, high = change.before.box
            np.testing.assert_allclose(high[:2] - low[:2], [0.28, 0.28], atol=0.06)
            self.assertGreater(change.before.landmarks, 30)
            self.assertGreater(change.confidence, 0.9)
            self.assertGreater(min(found.comparable), 300)
            self.assertAlmostEqual(found.found_again, 0.7, delta=0.1)
        self.assertEqual([change.kind for change in self.atlas.world_difference("b", "a").changes], ["appeared"])
        self.assertEqual(self.atlas.world_difference("a", "b", min_size=0.6).changes, [])
        self.assertEqual(repr(found), "<WorldDifference: 0 moved, 1 vanished, 0 appeared>")

    def test_sides_that_cannot_be_compared(self):
        self.atlas.add(ELSEWHERE, "elsewhere")
        for call, text in (
            (lambda: self.atlas.world_difference("a", "x"), "no map 'x'"),
            (lambda: self.atlas.world_difference("a", "a"), "both sides"),
            (lambda: self.atlas.world_difference("a", "elsewhere"), "elsewhere has no pose"),
            (lambda: self.atlas.world_difference("a", "b", at=2), "a has no pose"),
            (lambda: self.atlas.world_difference("a", "b", min_confidence=1.0), "min_confidence"),
        ):
            with self.assertRaisesRegex(cairn.MisuseError, text):
                call()
        with self.assertRaises(TypeError):
            self.atlas.world_difference("a", 3)

    def test_exports_what_the_ending_says(self):
        folder = self.path.parent
        self.atlas.export(folder / "town.g2o")
        self.assertIn("EDGE_SE3:QUAT 1 2 ", (folder / "town.g2o").read_text())
        self.atlas.export(str(folder / "town.json"), at=3)
        graph = json.loads((folder / "town.json").read_text())
        self.assertEqual((len(graph["nodes"]), len(graph["links"])), (2, 1))
        self.atlas.export(folder / "town.tum")
        self.assertEqual(len(cairn.read_trajectory(folder / "town.tum").timestamps_s), 16)
        self.atlas.export(folder / "town.mcap")
        self.assertTrue((folder / "town.mcap").read_bytes().startswith(b"\x89MCAP0\r\n"))
        self.atlas.add(ELSEWHERE, "else/where")
        self.atlas.add(AGAIN, "else_where")
        with self.assertWarnsRegex(UserWarning, "left out 2 of 4 maps, which are not in the frame of a"):
            self.atlas.export(folder / "town.ply", frame="b")
        cloud = cairn.read_map(folder / "town.ply")
        self.assertEqual(len(cloud), sum(self.atlas.maps[name].landmarks for name in "ab"))
        self.assertEqual(set(cloud.columns["map"]), {1.0, 2.0})
        self.atlas.export(folder / "all")
        self.assertEqual(sorted(path.name for path in (folder / "all").iterdir()),
                         ["a.cairn", "b.cairn", "else_where.cairn", "else_where~.cairn", "graph.json"])
        np.testing.assert_array_equal(cairn.read_map(folder / "all" / "a.cairn").positions,
                                      self.atlas.map("a").positions)

    def test_exports_that_fail_leave_nothing(self):
        folder = self.path.parent
        for call, kind, text in (
            (lambda: self.atlas.export(folder / "town.xyz"), cairn.MisuseError, r"ending \.xyz; expected \.g2o"),
            (lambda: self.atlas.export(folder / "none" / "town.g2o"), cairn.StorageError, "none"),
            (lambda: self.atlas.export(folder / "town.ply", frame="x"), cairn.MisuseError, "no map 'x'"),
            (lambda: self.atlas.export(folder / "town.ply", at=2), cairn.MisuseError, "no two maps"),
            (lambda: self.atlas.export(folder / "town.ply", at=99), cairn.MisuseError, "99"),
        ):
            with self.assertRaisesRegex(kind, text):
                call()
        for call in (lambda: self.atlas.export(), lambda: self.atlas.export(3),
                     lambda: self.atlas.export(folder / "a.ply", at="x")):
            with self.assertRaises(TypeError):
                call()
        self.assertEqual([path for path in folder.iterdir() if not path.name.startswith("town.atlas")], [])


class Upkeep(Folder):
    def test_compacting_drops_what_only_old_commits_need(self):
        with cairn.Atlas.create(self.path) as atlas:
            for i in range(4):
                atlas.add(cairn.synthetic_map(landmarks=200, seed=i), f"map {i}")
            atlas.remove("map 0")
            self.assertEqual(atlas.compact().commits, 0)
            told = atlas.compact(keep=1, dry=True)
            self.assertEqual((told.commits, told.maps, len(atlas.log)), (4, 1, 5))
            self.assertGreater(told.map_bytes, 1000)
            done = atlas.compact(keep=1)
            self.assertEqual((repr(done), done.map_bytes), (repr(told), told.map_bytes))
            self.assertEqual((len(atlas.log), list(atlas.maps)), (1, ["map 1", "map 2", "map 3"]))
            self.assertEqual(atlas.verify(), [])
            with self.assertRaises(cairn.MisuseError):
                atlas.undo()
            with self.assertRaisesRegex(cairn.MisuseError, "keep: 0; expected at least 1"):
                atlas.compact(keep=0)
            with self.assertRaises(TypeError):
                atlas.compact(keep=1.5)
        with cairn.Atlas.open(self.path, read_only=True) as atlas, self.assertRaises(cairn.StorageError):
            atlas.compact(keep=1)

    def test_salvaging_takes_what_is_sound(self):
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(MONDAY, "monday")
            atlas.add(FRIDAY, "friday")
            atlas.link_manually("monday", "friday", PAIR.target_from_source, TIGHT)
            atlas.optimize()
        saved = self.path.with_name("saved.atlas")
        result = cairn.Atlas.salvage(self.path, saved)
        self.assertEqual((result.maps, result.links, result.poses, result.lost), (2, 1, 2, []))
        with cairn.Atlas.open(saved) as atlas:
            self.assertEqual((list(atlas.maps), atlas.maps["friday"].frame), (["monday", "friday"], "monday"))
            np.testing.assert_array_equal(atlas.map("friday").positions, FRIDAY.positions)
        with self.assertRaisesRegex(cairn.MisuseError, "saved.atlas"):
            cairn.Atlas.salvage(self.path, saved)
        for damaged, new in (("postgresql://ada:secret@host/town", saved), (self.path, "postgresql://host/town")):
            with self.assertRaisesRegex(cairn.MisuseError, "the path of a file") as caught:
                cairn.Atlas.salvage(damaged, new)
            self.assertNotIn("secret", str(caught.exception))
        with self.assertRaises(TypeError):
            cairn.Atlas.salvage(self.path)

    def test_salvaging_names_what_is_lost(self):
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(MONDAY, "monday")
            atlas.add(FRIDAY, "friday")
        with sqlite3.connect(self.path) as file:
            file.execute("DELETE FROM map_chunks WHERE map = (SELECT max(id) FROM maps)")
        file.close()
        saved = self.path.with_name("saved.atlas")
        result = cairn.Atlas.salvage(self.path, saved)
        self.assertEqual((result.maps, len(result.lost)), (1, 1))
        with cairn.Atlas.open(saved) as atlas:
            self.assertEqual((list(atlas.maps), atlas.verify()), (["monday"], []))

    def test_sqlite_backs_it_up_while_it_is_written_to(self):
        copy = self.path.with_name("copy.atlas")
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(MONDAY, "monday")
            source, target = sqlite3.connect(self.path), sqlite3.connect(copy)
            source.backup(target)
            source.close()
            target.close()
            atlas.add(FRIDAY, "friday")
            with cairn.Atlas.open(copy) as backup:
                self.assertEqual((list(backup.maps), backup.verify()), (["monday"], []))
                backup.add(ELSEWHERE, "elsewhere")
            self.assertEqual(list(atlas.maps), ["monday", "friday"])


class Sharing(Folder):
    def test_threads_and_objects_share_one_file(self):
        parts = [cairn.synthetic_map(landmarks=60, frames=8, seed=i) for i in range(12)]
        with cairn.Atlas.create(self.path) as atlas, cairn.Atlas.open(self.path) as other:
            failures = []

            def work(which, begin):
                try:
                    for i in range(begin, len(parts), 3):
                        which.add(parts[i], f"map {i}")
                        self.assertIn(f"map {i}", which.maps)
                except BaseException as error:
                    failures.append(error)

            threads = [threading.Thread(target=work, args=(which, i)) for i, which in enumerate((atlas, atlas, other))]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual(failures, [])
            self.assertEqual(sorted(atlas.maps), sorted(other.maps))
            self.assertEqual(len(other.maps), 12)

    def test_a_progress_callable_that_asks_the_atlas_is_answered(self):
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(MONDAY, "monday")
            atlas.add(FRIDAY, "friday")
            seen = []
            atlas.link(progress=lambda share: seen.append(len(atlas.maps)))
            self.assertEqual(set(seen), {2})

    def test_an_interrupt_ends_linking_and_the_atlas_goes_on(self):
        big = cairn.synthetic_pair(landmarks=20000, overlap=0.1)
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(big.target, "target")
            atlas.add(big.source, "source")
            sent = []

            def interrupt():
                sent.append(time.process_time())
                os.kill(os.getpid(), signal.SIGINT)

            timer = threading.Timer(0.3, interrupt)
            timer.start()
            with self.assertRaises(KeyboardInterrupt):
                atlas.link(effort=64.0)
            self.assertLess(time.process_time() - sent[0], 5.0)  # of work, however busy the machine is
            self.assertEqual(atlas.links, [])
            atlas.remove("source")
            self.assertEqual(atlas.link().pairs, 0)

    def test_what_was_linked_before_an_interrupt_is_kept(self):
        with cairn.Atlas.create(self.path) as atlas:
            for i in range(5):
                atlas.add(cairn.synthetic_map(landmarks=500, seed=i), f"map {i}")

            def stop(share):
                if share > 0.0:
                    raise RuntimeError("enough")

            with self.assertRaisesRegex(RuntimeError, "enough"):
                atlas.link(threads=1, progress=stop)
            kept = len(atlas.links)
            self.assertGreater(kept, 0)
            linked = atlas.link()
            self.assertEqual((linked.tried_before, linked.tried), (kept, 10 - kept))


class Misuse(Folder):
    def test_locations(self):
        folder = self.path.parent
        (folder / "text").write_text("no atlas")
        for location, kind, text in (
            (folder / "none.atlas", cairn.InputError, "no such file"), (folder / "text", cairn.InputError, "text"),
            (folder, cairn.InputError, "folder"), ("", cairn.MisuseError, "empty"), ("a\0b", cairn.MisuseError, "path"),
        ):
            with self.assertRaisesRegex(kind, text, msg=str(location)):
                cairn.Atlas.open(location)
        for location in (None, 3, MONDAY):
            with self.assertRaises(TypeError):
                cairn.Atlas.create(location)
        cairn.Atlas.create(self.path).close()
        with self.assertRaisesRegex(cairn.MisuseError, "town.atlas"):
            cairn.Atlas.create(self.path)
        with self.assertRaisesRegex(cairn.MisuseError, "wait_s"):
            cairn.Atlas.open(self.path, wait_s=-1.0)
        with self.assertRaisesRegex(TypeError, "did you mean 'read_only'"):
            cairn.Atlas.open(self.path, readonly=True)
        with self.assertRaises(cairn.Error):
            cairn.Atlas.open("postgresql://ada:secret@127.0.0.1:1/town")
        with self.assertRaises(TypeError):
            cairn.Atlas()

    def test_closed(self):
        atlas = cairn.Atlas.create(self.path)
        atlas.close()
        atlas.close()
        self.assertIn("closed", repr(atlas))
        for call in (lambda: atlas.maps, lambda: atlas.add(MONDAY, "monday"), atlas.link, atlas.undo, atlas.merge,
                     atlas.compact, lambda: atlas.export("town.g2o"), lambda: atlas.world_difference("a", "b")):
            with self.assertRaisesRegex(cairn.MisuseError, "closed"):
                call()

    def test_arguments(self):
        with cairn.Atlas.create(self.path) as atlas:
            self.assertEqual(repr(atlas), f"<Atlas {self.path}>")
            with self.assertRaisesRegex(cairn.MisuseError, "nothing to undo"):
                atlas.undo()
            with self.assertRaisesRegex(cairn.MisuseError, "no two maps"):
                atlas.merge()
            atlas.add(MONDAY, "monday")
            atlas.add(FRIDAY, "friday")
            pose, flat = np.eye(4), np.zeros((6, 6))
            for call, text in (
                (lambda: atlas.add(AGAIN, "monday"), "another map is called"), (lambda: atlas.add(AGAIN, ""), "name"),
                (lambda: atlas.map("x"), "no map 'x'; expected one of its maps: monday, friday"),
                (lambda: atlas.link(only=["x"]), "no map 'x'"), (lambda: atlas.merge(frame="x"), "no map 'x'"),
                (lambda: atlas.merge(frame="monday"), "no pose"), (lambda: atlas.merge(at=99), "99"),
                (lambda: atlas.merge(fusion_probability=2.0), "fusion_probability"),
                (lambda: atlas.link(min_probability=2.0), "min_probability"),
                (lambda: atlas.link(shard=2, shards=2), "shard"), (lambda: atlas.link(threads=-1), "threads"),
                (lambda: atlas.optimize(agreement=0.0), "agreement"), (lambda: atlas.split("monday", 0), "frames"),
                (lambda: atlas.unlink("monday", "friday"), "no link"), (lambda: atlas.path("monday", "x"), "no map"),
                (lambda: atlas.link_manually("monday", "monday", pose, TIGHT), "itself"),
                (lambda: atlas.link_by_odometry("monday", "monday", pose, TIGHT), "itself"),
                (lambda: atlas.link_manually("monday", "friday", pose, np.eye(3)), "covariance: shape"),
                (lambda: atlas.link_manually("monday", "friday", pose, -TIGHT), "covariance"),
                (lambda: atlas.link_manually("monday", "friday", pose, TIGHT * np.nan), "covariance"),
                (lambda: atlas.link_manually("monday", "friday", np.zeros((4, 4)), TIGHT), ""),
                (lambda: atlas.link_manually("monday", "friday", pose * np.nan, TIGHT), ""),
            ):
                before = len(atlas.log)
                with self.assertRaisesRegex(cairn.Error, text):
                    call()
                self.assertEqual(len(atlas.log), before, text)
            for call in (
                lambda: atlas.add(None, "x"), lambda: atlas.add(MONDAY, None), lambda: atlas.add(MONDAY),
                lambda: atlas.add(MONDAY, "x", session=3), lambda: atlas.link(only="monday"),
                lambda: atlas.link(only=[3]), lambda: atlas.link(only=3), lambda: atlas.link(candidates=0.5),
                lambda: atlas.map(3), lambda: atlas.undo("x"), lambda: atlas.merge(frame=3),
                lambda: atlas.merge(adjust=1), lambda: atlas.link_manually("monday", "friday", "x", TIGHT),
                lambda: atlas.split("monday", 2.5), lambda: atlas.optimize(progress=3),
            ):
                with self.assertRaises(TypeError):
                    call()
            with self.assertRaisesRegex(TypeError, "did you mean 'candidates'"):
                atlas.link(candidate=3)
            # A link without any doubt is a number that optimisation divides by.
            atlas.link_manually("monday", "friday", PAIR.target_from_source, flat)
            try:
                atlas.optimize()
            except cairn.Error:
                pass
            self.assertEqual(atlas.verify(), [])

    def test_names_of_any_bytes(self):
        with cairn.Atlas.create(os.fsencode(self.path).replace(b"town", b"\xff town")) as atlas:
            name = os.fsdecode(b"\xff.map")
            atlas.add(MONDAY, name, session="Ausflug \N{EARTH GLOBE EUROPE-AFRICA}")
            self.assertEqual(list(atlas.maps), [name])
            self.assertEqual(len(atlas.map(name)), len(MONDAY))
            self.assertEqual(atlas.maps[name].session, "Ausflug \N{EARTH GLOBE EUROPE-AFRICA}")
            self.assertEqual(repr(atlas), f"<Atlas {atlas.location}>")
            self.assertIn(os.fsdecode(b"\xff town.atlas"), atlas.location)

    def test_a_damaged_file(self):
        with cairn.Atlas.create(self.path) as atlas:
            atlas.add(MONDAY, "monday")
        content = bytearray(self.path.read_bytes())
        for at in range(len(content) // 2, len(content) // 2 + 4096):
            content[at] ^= 0xFF
        self.path.write_bytes(bytes(content))
        with cairn.Atlas.open(self.path) as atlas:
            self.assertTrue(atlas.verify())
            with self.assertRaises(cairn.InputError):
                atlas.map("monday")

    def test_what_remains_of_the_garbage(self):
        atlas = cairn.Atlas.create(self.path)
        part = atlas.add(MONDAY, "monday")
        maps = atlas.maps
        del atlas
        self.assertEqual((part.name, list(maps), maps["monday"].frame), ("monday", ["monday"], None))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.assertEqual(list(cairn.Atlas.open(self.path).maps), ["monday"])


if __name__ == "__main__":
    unittest.main()

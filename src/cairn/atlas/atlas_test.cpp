// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/atlas.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "cairn/atlas/export.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/covariance.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/refusal.hpp"
#include "support/seen_places.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

// Whether this process has a lock on a file, as SQLite has on an open database. To look releases it.
bool is_locked(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  struct flock lock = {};  // of the whole file
  lock.l_type = F_WRLCK;
  const bool is_known = ::fcntl(file, F_OFD_GETLK, &lock) == 0;
  ::close(file);
  return is_known && lock.l_type != F_UNLCK;
}

class QueueOfOne final : public AtlasPairQueue {
 public:
  explicit QueueOfOne(const NodePair& pair) : pairs_{pair} {}
  std::vector<NodePair> take(std::size_t) override { return std::exchange(pairs_, {}); }
  void done() override {}

 private:
  std::vector<NodePair> pairs_;
};

// Lets another process change the atlas right before the next commit, or before pairs are taken from the queue.
class InterruptedStore final : public AtlasStore {
 public:
  // @param queued pair that another process shared; std::nullopt: no queue
  InterruptedStore(std::unique_ptr<AtlasStore> store, std::function<void()> meanwhile,
                   const std::optional<NodePair>& queued = std::nullopt)
      : store_(std::move(store)), meanwhile_(std::move(meanwhile)), queued_(queued) {}

  const std::string& name() const override { return store_->name(); }
  CommitId last_commit() override { return store_->last_commit(); }
  AtlasState state(std::optional<CommitId> at) override { return store_->state(at); }
  std::vector<AtlasCommit> log() override { return store_->log(); }
  AtlasTouched touched(std::span<const CommitId> commits) override {
    return store_->touched(commits);
  }
  std::string put_map(std::string_view bytes) override { return store_->put_map(bytes); }
  std::string map_bytes(const std::string& hash) override { return store_->map_bytes(hash); }
  AtlasCommitted commit(const AtlasCommitInfo& info, const Make& make) override {
    interrupt();
    return store_->commit(info, make);
  }
  std::unique_ptr<AtlasPairQueue> share(std::span<const NodePair>) override {
    if (!queued_) return nullptr;
    interrupt();
    return std::make_unique<QueueOfOne>(*queued_);
  }
  AtlasVerification verify() override { return store_->verify(); }
  AtlasCompaction compact(std::uint64_t keep, bool dry) override {
    return store_->compact(keep, dry);
  }

 private:
  void interrupt() {
    if (const auto meanwhile = std::exchange(meanwhile_, nullptr)) meanwhile();
  }

  std::unique_ptr<AtlasStore> store_;
  std::function<void()> meanwhile_;
  std::optional<NodePair> queued_;
};

class AtlasTest : public ::testing::Test {
 protected:
  AtlasTest() {
    Atlas::create(location_);
    atlas_.emplace(Atlas::open(location_));
  }

  Atlas& atlas() { return *atlas_; }
  // What another command does.
  Atlas& again() {
    atlas_.emplace(Atlas::open(location_));
    return *atlas_;
  }
  // A command that reads before `meanwhile` and commits after it.
  Atlas interrupted_by(const std::function<void()>& meanwhile) const {
    return Atlas(std::make_unique<InterruptedStore>(open_store(location_), meanwhile));
  }
  NodeId add(const std::string& name, std::uint64_t seed) {
    return again().add(synthetic_map({.seed = seed, .landmarks = 40, .frames = 6}), name).node;
  }
  // Of a chain: each is 1 m further on.
  static Similarity3 step() { return Rigid3::from_roll_pitch_yaw({1.0, 0.0, 0.0}, 0.0, 0.0, 0.1); }
  std::array<NodeId, 3> add_optimised_chain() {
    const NodeId a = add("a", 1);
    const NodeId b = add("b", 2);
    const NodeId c = add("c", 3);
    again().link_manually(a, b, step(), covariance());
    again().link_manually(b, c, step(), covariance());
    again().optimize();
    return {a, b, c};
  }
  static Matrix7d covariance() {
    Matrix7d covariance = Matrix7d::Zero();
    for (int i = 0; i < 6; ++i) covariance(i, i) = 1e-4;
    return covariance;
  }

  testing::TemporaryFolder folder_;
  std::string location_ = (folder_ / "town.atlas").string();
  std::optional<Atlas> atlas_;
};

TEST_F(AtlasTest, LinksOptimisesAndMergesTwoSessions) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 900, .frames = 20});
  const NodeId target = atlas().add(pair.target, "target").node;
  const NodeId source = atlas().add(pair.source, "source").node;
  EXPECT_TRUE(atlas().add(pair.source, "under another name").was_there);
  EXPECT_EQ(atlas().state().nodes.size(), 2U);
  EXPECT_THROW(atlas().add(synthetic_map({.seed = 9, .landmarks = 30, .frames = 4}), "source"),
               Error);

  const AtlasLinkResult first = again().link();
  EXPECT_EQ(first.tried, 1U);
  EXPECT_EQ(first.aligned, 1U);
  EXPECT_FALSE(atlas().state().links.begin()->second.reason.empty());
  const AtlasLinkResult second = again().link();
  EXPECT_EQ(second.tried, 0U);
  EXPECT_EQ(second.tried_before, 1U);

  const AtlasOptimised optimised = again().optimize();
  EXPECT_EQ(optimised.placed, 2U);
  EXPECT_TRUE(optimised.changed);
  EXPECT_FALSE(again().optimize().changed);
  const AtlasState state = atlas().state();
  EXPECT_EQ(state.poses.at(source).frame, target);
  const Rigid3 error =
      pair.target_from_source.inverse() * state.poses.at(source).frame_from_node.rigid();
  EXPECT_LT(error.angle(), 0.003);
  EXPECT_LT(error.translation().norm(), 0.02);

  const MergeResult merged = again().merge();
  EXPECT_EQ(merged.placed(), 2U);
  EXPECT_EQ(merged.used, std::vector<bool>{true});
  EXPECT_EQ(merged.map->frame_count(), 40U);
  EXPECT_LT(merged.map->landmark_count(), 1400U);
  const LandmarkMap cloud = cloud_of(atlas(), state, components_of(state).front());
  EXPECT_EQ(cloud.landmark_count(), 1800U);
  EXPECT_EQ(cloud.column(kNodeColumn)->values.back(), static_cast<double>(source.value));
  EXPECT_THAT(atlas().store().verify().problems, IsEmpty());
}

TEST_F(AtlasTest, KeepsTheMergedWorldUntilAnythingChanges) {
  add_optimised_chain();
  const auto world = [&](std::uint64_t seed = 0) {
    return merged_world(again(), atlas().state(), {.seed = seed});
  };
  const std::filesystem::path file = merged_world_file(location_);
  const LandmarkMap made = world();
  EXPECT_EQ(made.landmark_count(), 120U);
  ASSERT_TRUE(std::filesystem::exists(file));
  // A landmark less in the file tells where a map came from.
  const auto take_one = [&] {
    const LandmarkMap map = read_map(file);
    std::vector<LandmarkIndex> some;
    for (std::uint32_t i = 1; i < map.landmark_count(); ++i) some.push_back(LandmarkIndex{i});
    write_map(with_landmarks(map, some), file);
  };
  take_one();
  const LandmarkMap kept = world();
  EXPECT_EQ(kept.landmark_count(), 119U);
  EXPECT_EQ(kept.info().provenance, made.info().provenance);
  EXPECT_EQ(world(1).landmark_count(), 120U) << "another seed";
  EXPECT_EQ(world().landmark_count(), 120U) << "the file is of the other seed";

  take_one();
  again().unlink(NodeId{2}, NodeId{3});
  EXPECT_THROW(world(), Error) << "not the file's, which is of another commit";
  again().optimize();
  EXPECT_EQ(world().landmark_count(), 80U);
  again().undo();
  again().undo();
  EXPECT_EQ(world().landmark_count(), 120U);

  take_one();
  atlas_.reset();
  std::filesystem::remove(location_);
  Atlas::create(location_);
  for (const std::uint64_t seed : {4, 5}) add(std::string(1, static_cast<char>('a' + seed)), seed);
  again().link_manually(NodeId{1}, NodeId{2}, step(), covariance());
  again().optimize();
  EXPECT_EQ(world().landmark_count(), 80U) << "another atlas of this name";

  folder_.write("town.atlas.merged.cairn", "damaged");
  EXPECT_EQ(world().landmark_count(), 80U);
  again().store().compact(1, true);
  EXPECT_TRUE(std::filesystem::exists(file));
  again().store().compact(1, false);
  EXPECT_FALSE(std::filesystem::exists(file));
}

// Without them, another process could delete SQLite's log under the open atlas, and later commits would be lost.
TEST_F(AtlasTest, KeepsItsLocksWhenTheWorldIsMerged) {
  add_optimised_chain();
  merged_world(atlas(), atlas().state());
  EXPECT_TRUE(is_locked(location_));
}

TEST_F(AtlasTest, MergesTheWorldEachTimeWhereItCannotBeKept) {
  add_optimised_chain();
  const std::filesystem::path file = merged_world_file(location_);
  const std::filesystem::path other = folder_.write("other", "of somebody");
  std::filesystem::create_symlink(other, file);
  EXPECT_EQ(merged_world(again(), atlas().state()).landmark_count(), 120U);
  EXPECT_EQ(std::filesystem::file_size(other), 11U) << "no link is followed";
  std::filesystem::remove(file);
  std::filesystem::create_directory(file);
  EXPECT_EQ(merged_world(again(), atlas().state()).landmark_count(), 120U);
  EXPECT_TRUE(std::filesystem::is_empty(file));
}

TEST_F(AtlasTest, UpdatesPosesAsMapsAreAdded) {
  std::vector<NodeId> nodes;
  for (std::uint64_t i = 0; i < 12; ++i) {
    nodes.push_back(add("map " + std::to_string(i), i + 1));
    if (i == 0) continue;
    again().link_manually(nodes[i - 1], nodes[i], step(), covariance());
    if (i > 1) again().link_manually(nodes[i - 2], nodes[i], step() * step(), covariance());
    const AtlasOptimised updated = again().update_poses();
    EXPECT_EQ(updated.placed, i + 1);
    EXPECT_TRUE(updated.changed);
  }
  EXPECT_FALSE(again().update_poses().changed);
  const AtlasState grown = atlas().state();
  again().optimize();
  const AtlasState anew = atlas().state();
  EXPECT_EQ(grown.agrees, anew.agrees);
  for (const NodeId node : nodes) {
    const Vector6d difference = grown.poses.at(node).frame_from_node.rigid().difference_to(
        anew.poses.at(node).frame_from_node.rigid());
    EXPECT_LT(difference.norm(), 1e-6);
    EXPECT_EQ(grown.poses.at(node).frame, nodes[0]);
  }
}

TEST_F(AtlasTest, UpdatingComputesAllPosesIfALinkWasReplaced) {
  const auto [a, b, c] = add_optimised_chain();
  again().unlink(b, c);
  const AtlasOptimised updated = again().update_poses();
  EXPECT_EQ(updated.placed, 2U);
  EXPECT_FALSE(atlas().state().poses.contains(c));
  again().link_manually(a, b, step() * step(), covariance());
  again().update_poses();
  const Similarity3 pose = atlas().state().poses.at(b).frame_from_node;
  EXPECT_LT(pose.rigid().difference_to((step() * step()).rigid()).norm(), 1e-9);
}

TEST_F(AtlasTest, ExportsTheComponentOfAMapOrTheLargest) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  const NodeId c = add("c", 3);
  const NodeId d = add("d", 4);
  const NodeId e = add("e", 5);
  const NodeId alone = add("alone", 6);
  for (const auto& [target, source] : {std::pair{a, b}, std::pair{c, d}, std::pair{d, e}}) {
    again().link_manually(target, source, step(), covariance());
  }
  EXPECT_THROW(component_with(atlas().state(), std::nullopt, "town"), Error);
  again().optimize();
  const AtlasState state = atlas().state();
  EXPECT_EQ(component_with(state, std::nullopt, "town").nodes, (std::vector{c, d, e}));
  EXPECT_EQ(component_with(state, b, "town").nodes, (std::vector{a, b}));
  EXPECT_THROW(component_with(state, alone, "town"), Error);

  std::vector<std::string> remarks;
  const LogSink log = [&](std::string_view remark) { remarks.emplace_back(remark); };
  export_atlas(atlas(), state, folder_ / "town.ply", b, log);
  EXPECT_EQ(read_map(folder_ / "town.ply").landmark_count(), 80U);
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_THAT(remarks.front(), HasSubstr("left out 4 of 6 maps, which are not in the frame of a"));
  export_atlas(atlas(), state, folder_ / "town.tum", b, log);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "town.tum"));
}

TEST_F(AtlasTest, ExportsAFolderWithAFileForEachMap) {
  add("of/two", 1);
  add("of_two", 2);
  add("..", 3);
  export_atlas(again(), atlas().state(), folder_ / "all");
  std::vector<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(folder_ / "all")) {
    names.push_back(file.path().filename().string());
  }
  EXPECT_THAT(names,
              UnorderedElementsAre("of_two.cairn", "of_two~.cairn", "...cairn", "graph.json"));
  EXPECT_EQ(export_of(folder_ / "all"), AtlasExport::kFolder);
  EXPECT_EQ(export_of("new"), AtlasExport::kFolder);
  EXPECT_EQ(export_of("town.mcap"), AtlasExport::kRecording);
  EXPECT_THROW(export_of("town.xyz"), Error);
}

TEST_F(AtlasTest, DoesNotExportOverItself) {
  for (const std::string name : {"all/a.cairn", "all/graph.json"}) {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::create_directories(path.parent_path());
    Atlas::create(path.string());
    Atlas exported = Atlas::open(path.string());
    exported.add(synthetic_map({.seed = 1, .landmarks = 40, .frames = 6}), "a");
    EXPECT_THAT(
        testing::message_of(ErrorKind::kMisuse,
                            [&] { export_atlas(exported, exported.state(), path.parent_path()); }),
        HasSubstr(name));
    EXPECT_EQ(Atlas::open(path.string()).state().nodes.size(), 1U);
    std::filesystem::remove_all(path.parent_path());
  }
}

TEST_F(AtlasTest, UndoesTheLastCommandAndThenTheOneBefore) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  again().link_manually(a, b, step(), covariance());
  again().optimize();
  EXPECT_EQ(atlas().state().poses.size(), 2U);
  EXPECT_EQ(again().undo(), CommitId{4});
  EXPECT_TRUE(atlas().state().poses.empty());
  EXPECT_EQ(again().undo(), CommitId{3});
  EXPECT_TRUE(atlas().state().links.empty());
  EXPECT_EQ(again().undo(), CommitId{2});
  EXPECT_EQ(again().undo(), CommitId{1});
  EXPECT_TRUE(atlas().state().nodes.empty());
  EXPECT_THROW(again().undo(), Error);
  // Undoing the undoing.
  EXPECT_EQ(again().undo(CommitId{8}), CommitId{8});
  EXPECT_EQ(atlas().state().nodes.at(a).name, "a");
  EXPECT_TRUE(difference(atlas().state(CommitId{0}), atlas().state(CommitId{8})).empty());
  EXPECT_THAT(atlas().store().verify().problems, IsEmpty());
}

TEST_F(AtlasTest, DoesNotUndoWhatLaterCommandsBuildOn) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  again().link_manually(a, b, step(), covariance());
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().undo(CommitId{2}); }),
              HasSubstr("later commands build on commit 2; expected to undo the later commands "
                        "first, those of commits 3"));
  EXPECT_EQ(atlas().state().nodes.size(), 2U);
  EXPECT_EQ(atlas().store().last_commit(), CommitId{3});
  again().undo();
  EXPECT_EQ(again().undo(CommitId{1}), CommitId{1});
  EXPECT_EQ(atlas().state().nodes.begin()->first, b);
}

TEST_F(AtlasTest, DoesNotUndoHalfACommandThatCompactingCutInTwo) {
  for (std::uint64_t i = 1; i <= 3; ++i) {
    // One command.
    atlas().add(synthetic_map({.seed = i, .landmarks = 40, .frames = 6}), std::to_string(i));
  }
  again().store().compact(2, false);
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().undo(); }),
              HasSubstr("what was before commit 3 is compacted"));
  EXPECT_EQ(atlas().state().nodes.size(), 3U);
}

TEST_F(AtlasTest, TakesNoCommitOfAnotherProcessForTheFirstOfItsCommand) {
  Atlas command = interrupted_by([&] { add("of another process", 1); });
  EXPECT_EQ(command.link_by_odometry({}), 0U);  // no change
  command.add(synthetic_map({.seed = 2, .landmarks = 40, .frames = 6}), "own");
  EXPECT_EQ(command.store().log().back().run, CommitId{2});
}

TEST_F(AtlasTest, DoesNotUndoPosesThatALaterOptimisationKept) {
  add_optimised_chain();
  const CommitId optimised = atlas().store().last_commit();
  const NodeId c{3};
  const NodeId d = add("d", 4);
  again().link_manually(c, d, step(), covariance());
  again().update_poses();
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().undo(optimised); }),
              HasSubstr("undo the later commands first, those of commits 9, 8, 7"));
  EXPECT_EQ(atlas().state().poses.size(), 4U);
}

TEST_F(AtlasTest, DoesNotUndoPosesThatWereChangedSince) {
  const auto [a, b, c] = add_optimised_chain();
  const CommitId optimised = atlas().store().last_commit();
  again().link_manually(a, c, step(), covariance());
  again().optimize();
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().undo(optimised); }),
              HasSubstr("town.atlas: later commands build on commit 6"));
}

TEST_F(AtlasTest, RemovingTheFrameOfAComponentTakesItsAgreements) {
  const auto [a, b, c] = add_optimised_chain();
  again().remove(a);
  EXPECT_EQ(atlas().state().links.size(), 1U);
  EXPECT_TRUE(atlas().state().agrees.empty());
}

TEST_F(AtlasTest, DoesNotMergeAtThePoseOfALinkThatWasRemoved) {
  const auto [a, b, c] = add_optimised_chain();
  const LinkId bypass = again().link_manually(a, c, step() * step(), covariance());
  again().optimize();
  ASSERT_TRUE(is_used(atlas().state(), atlas().state().links.at(bypass)));
  again().unlink(a, c);
  EXPECT_EQ(again().merge().placed(), 3U) << "other links connect them";
  again().unlink(b, c);
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().merge(); }),
              AllOf(HasSubstr("the links that connected c with a were removed"),
                    HasSubstr("'cairn atlas optimize'")));
  EXPECT_THROW(world_difference(again(), again().state(), {a}, {c}, {}, {}), Error);
  EXPECT_THROW(export_atlas(again(), again().state(), folder_ / "out.ply", a, {}), Error);
  again().optimize();
  EXPECT_EQ(again().merge().placed(), 2U);
  again().link_manually(a, b, step() * step(), covariance());
  EXPECT_THROW(again().merge(), Error) << "it replaced the link";
}

TEST_F(AtlasTest, DoesNotMergeTheMapThatIsLeftOfTwo) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  again().link_manually(a, b, step(), covariance());
  again().optimize();
  again().remove(b);
  ASSERT_TRUE(atlas().state().poses.contains(a));
  EXPECT_THAT(components_of(atlas().state()), IsEmpty());
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().merge(); }),
              HasSubstr("no two maps are in one frame"));
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().merge({}, a); }),
              HasSubstr("a has no pose in a frame with other maps"));
}

TEST_F(AtlasTest, UsesOnlyLinksBetweenMapsOfOneFrame) {
  const auto [a, b, c] = add_optimised_chain();
  AtlasState state = atlas().state();
  const Link& link = state.links.rbegin()->second;
  EXPECT_TRUE(is_used(state, link));
  state.poses.erase(c);
  EXPECT_FALSE(is_used(state, link));
}

TEST_F(AtlasTest, RemovingAMapTakesItsLinksAndPosesAndUndoBringsThemBack) {
  const auto [a, b, c] = add_optimised_chain();
  const AtlasState before = atlas().state();
  again().remove(a);
  const AtlasState after = atlas().state();
  EXPECT_EQ(after.nodes.size(), 2U);
  EXPECT_EQ(after.links.size(), 1U);
  EXPECT_TRUE(after.poses.empty());  // they were in the frame of a
  again().undo();
  EXPECT_TRUE(difference(before, atlas().state()).empty());
  EXPECT_EQ(add("a2", 4), NodeId{4});  // no id is given out twice
}

TEST_F(AtlasTest, RemovingAMapTakesItsLinksAtEitherEnd) {
  const auto [a, b, c] = add_optimised_chain();
  for (const NodeId node : {a, c}) {
    again().remove(node);
    for (const auto& [id, link] : atlas().state().links) {
      EXPECT_TRUE(link.target != node && link.source != node);
    }
    again().undo();
  }
  EXPECT_EQ(atlas().state().links.size(), 2U);
}

TEST_F(AtlasTest, UndoesACommandOnce) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  again().link_manually(a, b, step(), covariance());
  again().undo(CommitId{3});
  EXPECT_EQ(atlas().store().log().back().text.rfind("commit 3: link ", 0), 0U);
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { again().undo(CommitId{3}); }),
              HasSubstr("commit 3 is undone already"));
}

TEST_F(AtlasTest, LinksByOdometryWithoutAProbability) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  Link stated;
  stated.target = a;
  stated.source = b;
  stated.target_from_source = step();
  stated.covariance_with_scale = covariance();
  stated.kind = LinkKind::kManual;
  stated.probability = 0.5;
  EXPECT_EQ(again().link_by_odometry(std::array{stated}), 1U);
  EXPECT_EQ(atlas().store().log().back().text, "1 link of odometry");
  const Link link = atlas().state().links.begin()->second;
  EXPECT_EQ(link.kind, LinkKind::kOdometry);
  EXPECT_EQ(link.probability, std::nullopt);
  EXPECT_EQ(again().link_by_odometry(std::array{stated}), 0U);  // these maps are linked
}

TEST_F(AtlasTest, DoesNotLinkByOdometryWhatAPersonUnlinked) {
  Link stated;
  stated.target = add("a", 1);
  stated.source = add("b", 2);
  stated.target_from_source = step();
  stated.covariance_with_scale = covariance();
  EXPECT_EQ(again().link_by_odometry(std::array{stated}), 1U);
  again().unlink(stated.source, stated.target);
  EXPECT_EQ(again().link_by_odometry(std::array{stated}), 0U);
  EXPECT_EQ(again().optimize().placed, 0U);
}

TEST_F(AtlasTest, ComponentsOfOneSizeComeInTheOrderOfTheirMaps) {
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) add(std::to_string(seed), seed);
  again().link_manually(NodeId{1}, NodeId{2}, step(), covariance());
  again().link_manually(NodeId{3}, NodeId{4}, step(), covariance());
  again().optimize();
  std::vector<NodeId> frames;
  for (const AtlasComponent& component : components_of(atlas().state())) {
    frames.push_back(component.frame);
  }
  EXPECT_EQ(frames, (std::vector{NodeId{1}, NodeId{3}}));
}

TEST_F(AtlasTest, GivesThePoseGraphTheNamesAndSessionsOfItsMaps) {
  const NodeId whole =
      again().add(synthetic_map({.seed = 5, .landmarks = 500, .frames = 30}), "long").node;
  again().split(whole, 15);
  const PoseGraph graph = pose_graph(atlas().state());
  ASSERT_EQ(graph.nodes.size(), 2U);
  EXPECT_EQ(graph.nodes[0].name, "long/1");
  EXPECT_EQ(graph.nodes[0].session, "long");
}

TEST_F(AtlasTest, DoesNotSplitAMapThatAnotherProcessRemoved) {
  const NodeId whole =
      again().add(synthetic_map({.seed = 5, .landmarks = 500, .frames = 30}), "long").node;
  Atlas splitting = interrupted_by([&] { again().remove(whole); });
  EXPECT_THROW(splitting.split(whole, 10), Error);
  EXPECT_TRUE(again().state().nodes.empty());
}

TEST_F(AtlasTest, DoesNotBringBackWhatIsCompactedMeanwhile) {
  add("a", 1);
  const NodeId b = add("b", 2);
  again().remove(b);
  Atlas undoing = interrupted_by([&] { again().store().compact(1, false); });
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { undoing.undo(); }),
              HasSubstr("compacted"));
  EXPECT_EQ(again().state().nodes.size(), 1U);
  EXPECT_THAT(atlas().store().verify().problems, IsEmpty());
}

TEST_F(AtlasTest, AddsAMapWhileAnotherProcessCompacts) {
  add("first", 1);
  Atlas adding = interrupted_by([&] { again().store().compact(1, false); });
  const NodeId node =
      adding.add(synthetic_map({.seed = 5, .landmarks = 500, .frames = 30}), "long").node;
  EXPECT_THAT(adding.store().verify().problems, IsEmpty());
  Atlas splitting = interrupted_by([&] { again().store().compact(1, false); });
  EXPECT_EQ(splitting.split(node, 10).size(), 3U);
  EXPECT_THAT(splitting.store().verify().problems, IsEmpty());
}

TEST_F(AtlasTest, DoesNotLinkAMapThatTookThePlaceOfTheOneThatWasAligned) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 10});
  atlas().add(pair.target, "target");
  const NodeId source = again().add(pair.source, "source").node;
  Atlas linking = interrupted_by([&] {
    again().remove(source);
    again().store().compact(1, false);
    add("another", 9);
  });
  EXPECT_EQ(linking.link().tried, 0U);
  EXPECT_TRUE(again().state().links.empty());
}

TEST_F(AtlasTest, TellsTheMapsOfAResultThatAnotherProcessAddedMeanwhile) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 300, .frames = 10});
  atlas().add(pair.target, "target");
  Atlas linking(std::make_unique<InterruptedStore>(
      open_store(location_), [&] { again().add(pair.source, "source"); },
      NodePair(NodeId{1}, NodeId{2})));
  std::vector<std::string> told;
  linking.link({.on_link = [&](const Link& link, const AtlasState& state) {
    told.push_back(state.nodes.at(link.target).name + " " + state.nodes.at(link.source).name);
  }});
  EXPECT_THAT(told, ::testing::ElementsAre("target source"));
}

TEST_F(AtlasTest, DoesNotTryAgainWhatAPersonUnlinked) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  again().link_manually(a, b, step(), covariance());
  again().unlink(b, a, "two floors");
  const AtlasState state = atlas().state();
  ASSERT_EQ(state.links.size(), 1U);
  EXPECT_EQ(state.links.begin()->second.verdict, Verdict::kRejected);
  EXPECT_EQ(state.links.begin()->second.reason, "two floors");
  EXPECT_EQ(again().link().tried, 0U);
  EXPECT_EQ(again().link({.retry = true}).tried, 0U);
  EXPECT_EQ(again().optimize().placed, 0U);
}

TEST_F(AtlasTest, LeavesOutALinkThatOthersContradict) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  const NodeId c = add("c", 3);
  const NodeId d = add("d", 4);
  const auto far = [](double x) {
    return Similarity3(Rigid3::from_roll_pitch_yaw({x, 0, 0}, 0, 0, 0));
  };
  for (const auto& [target, source, x] :
       {std::tuple(a, b, 1.0), std::tuple(b, c, 1.0), std::tuple(a, c, 2.0), std::tuple(c, d, 1.0),
        std::tuple(b, d, 2.0), std::tuple(a, d, 9.0)}) {
    again().link_manually(target, source, far(x), covariance());
  }
  EXPECT_EQ(again().optimize().contradicted, 1U);
  const AtlasState state = atlas().state();
  EXPECT_NEAR(state.poses.at(d).frame_from_node.translation().x(), 3.0, 1e-3);
  const auto route = find_route(state, a, d);
  ASSERT_TRUE(route.has_value());
  EXPECT_EQ(route->links.size(), 2U);
  EXPECT_NEAR(route->target_from_source.translation().x(), 3.0, 1e-9);
}

TEST_F(AtlasTest, RouteHasTheTransformAndTheCovarianceOfItsLinks) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  const NodeId c = add("c", 3);
  const NodeId apart = add("apart", 4);
  again().link_manually(b, a, step().inverse(), covariance());  // against the way
  again().link_manually(b, c, step(), covariance());
  const AtlasState state = again().state();
  const auto route = find_route(state, a, c);
  ASSERT_TRUE(route.has_value());
  EXPECT_EQ(route->nodes, (std::vector{a, b, c}));
  EXPECT_TRUE(route->target_from_source.matrix().isApprox((step() * step()).matrix(), 1e-12));
  EXPECT_FALSE(route->optimised.has_value());
  // Monte Carlo in small: perturb each link along each axis, and sum what that does to the whole.
  const Rigid3 inverse = step().rigid().inverse();
  Matrix6d expected = Matrix6d::Zero();
  const Rigid3 whole = step().rigid() * step().rigid();
  for (int axis = 0; axis < 6; ++axis) {
    Vector6d delta = Vector6d::Zero();
    delta[axis] = 1e-5;
    const Vector6d first =
        whole.difference_to(inverse.perturbed(delta).inverse() * step().rigid()) / 1e-5;
    const Vector6d second =
        whole.difference_to(step().rigid() * step().rigid().perturbed(delta)) / 1e-5;
    expected += 1e-4 * (first * first.transpose() + second * second.transpose());
  }
  const Matrix6d found = route->covariance->topLeftCorner<6, 6>();
  EXPECT_TRUE(found.isApprox(expected, 1e-3)) << found << "\n\n" << expected;
  EXPECT_FALSE(find_route(state, a, apart).has_value());
  EXPECT_EQ(find_route(state, a, a)->links.size(), 0U);
}

TEST_F(AtlasTest, KeepsComponentsApartEachInTheFrameOfItsFirst) {
  const NodeId a = add("a", 1);
  const NodeId b = add("b", 2);
  const NodeId c = add("c", 3);
  const NodeId d = add("d", 4);
  const NodeId e = add("e", 5);
  add("alone", 6);
  again().link_manually(a, b, step(), covariance());
  again().link_manually(c, d, step(), covariance());
  again().link_manually(d, e, step(), covariance());
  EXPECT_EQ(again().optimize().placed, 5U);
  const std::vector<AtlasComponent> components = components_of(atlas().state());
  ASSERT_EQ(components.size(), 2U);
  EXPECT_EQ(components[0].nodes, (std::vector{c, d, e}));
  EXPECT_EQ(components[0].frame, c);
  EXPECT_EQ(components[1].nodes, (std::vector{a, b}));
  const MergeResult merged = atlas().merge({}, b);
  ASSERT_EQ(merged.maps.size(), 6U);
  EXPECT_EQ(merged.placed(), 2U);
  EXPECT_TRUE(merged.maps[0].placed && merged.maps[1].placed);
  EXPECT_THAT(merged.maps[2].reason, HasSubstr("it is placed in another frame"));
}

TEST_F(AtlasTest, TriesAllPairsOfMapsThatCannotBeRecognised) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) add(std::to_string(seed), seed);
  AtlasLinkOptions options;
  options.links.candidates = 1;  // of those that recognition finds, which needs descriptors
  const AtlasLinkResult result = again().link(options);
  EXPECT_EQ(result.pairs, 3U);
  EXPECT_EQ(result.tried, 3U);
  EXPECT_EQ(result.not_likely, 0U);
}

TEST_F(AtlasTest, TriesThePairsThatEitherMapRecognises) {
  // The map in the middle looks most like the larger of the other two; each of these like it.
  for (const bool small_first : {true, false}) {
    testing::TemporaryFolder folder;
    const std::string location = (folder / "street.atlas").string();
    Atlas::create(location);
    Atlas street = Atlas::open(location);
    const std::vector<std::uint8_t> landmarks = testing::place(1, 300);
    const LandmarkMap small = testing::seen(landmarks, 0, 60, 0.0, 1);
    const LandmarkMap large = testing::seen(landmarks, 100, 300, 0.0, 2);
    street.add(small_first ? small : large, "first");
    street.add(testing::seen(landmarks, 20, 200, 0.0, 3), "middle");
    street.add(small_first ? large : small, "last");
    AtlasLinkOptions options;
    options.links.candidates = 1;
    const AtlasLinkResult result = street.link(options);
    EXPECT_EQ(result.pairs, 3U);
    EXPECT_EQ(result.tried, 2U);
    EXPECT_EQ(result.not_likely, 1U);
  }
}

TEST_F(AtlasTest, RecognitionStopsWhenAsked) {
  add("a", 1);
  add("b", 2);
  AtlasLinkOptions options;
  options.links.candidates = 1;
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(testing::message_of(ErrorKind::kCancelled,
                                  [&] { again().link(options, {.stop = stop.get_token()}); }),
              HasSubstr("recognition was cancelled"));
}

TEST_F(AtlasTest, SplitsAMapIntoLinkedParts) {
  const NodeId whole =
      again().add(synthetic_map({.seed = 5, .landmarks = 500, .frames = 30}), "long").node;
  const std::vector<NodeId> parts = again().split(whole, 10);
  const AtlasState state = atlas().state();
  EXPECT_EQ(parts.size(), 3U);
  EXPECT_EQ(state.nodes.size(), 3U);
  EXPECT_EQ(state.nodes.at(parts[1]).name, "long/2");
  EXPECT_EQ(state.nodes.at(parts[1]).frames, 10U);
  EXPECT_EQ(state.links.begin()->second.covariance->diagonal()[5], 1e-4);  // of 0.01 rad
  EXPECT_EQ(again().optimize().placed, 3U);
  again().undo();
  again().undo();  // both commits of the split
  EXPECT_EQ(atlas().state().nodes.begin()->second.name, "long");
  EXPECT_EQ(again().undo(), CommitId{1});  // the command before
  EXPECT_TRUE(atlas().state().nodes.empty());
}

TEST_F(AtlasTest, SplitsByTheIdsOfKeyframesWhateverTheirOrder) {
  MapTables tables = synthetic_map({.seed = 5, .landmarks = 500, .frames = 30}).tables();
  for (std::uint32_t i = 0; i < 30; ++i) tables.frames.ids[i] = FrameId{i % 2 == 0 ? i : 30 - i};
  const NodeId whole = again().add(LandmarkMap(std::move(tables)), "long").node;
  for (const NodeId part : again().split(whole, 10)) {
    const std::vector<FrameId> ids = atlas().map(atlas().state().nodes.at(part)).frames().ids;
    const auto [first, last] = std::minmax_element(ids.begin(), ids.end());
    EXPECT_EQ(last->value - first->value, 9U);
  }
}

TEST_F(AtlasTest, RefusesWhatIsNotThere) {
  EXPECT_THROW(atlas().remove(NodeId{1}), Error);
  EXPECT_THROW(atlas().merge(), Error);
  EXPECT_THROW(atlas().undo(), Error);
  EXPECT_THROW(atlas().add(LandmarkMap(), "empty"), Error);
  EXPECT_THROW(Atlas::open("postgresql://host/db"), Error);
}

}  // namespace
}  // namespace cairn

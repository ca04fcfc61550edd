// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/storage/sqlite/database.hpp"

#include "support/imported_maps.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::refusal;
using testing::reprojection;

template <class Number>
void append(std::vector<std::byte>& bytes, Number number) {
  const std::size_t size = bytes.size();
  bytes.resize(size + sizeof number);
  std::memcpy(bytes.data() + size, &number, sizeof number);
}

std::vector<std::byte> blob_of(const Rigid3& pose) {
  std::vector<std::byte> bytes;
  const Matrix4d matrix = pose.matrix();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      append(bytes, static_cast<float>(matrix(row, column)));
    }
  }
  return bytes;
}

// A camera 0.3 m above the robot that looks ahead: its z is the robot's x, its x the robot's -y.
Rigid3 base_from_camera() {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {rotation, {0.1, 0.0, 0.3}};
}

std::vector<std::byte> calibration() {
  std::vector<std::byte> bytes;
  for (const std::int32_t x : {0, 21, 10, 0, 640, 480, 9, 0, 0, 0, 12}) append(bytes, x);
  for (const double x : {500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0}) append(bytes, x);
  const auto local = blob_of(base_from_camera());
  bytes.insert(bytes.end(), local.begin(), local.end());
  return bytes;
}

// Four nodes along a line, each linked with the next, that see points by words.
class RtabmapTest : public testing::ImportTest {
 protected:
  struct Options {
    bool with_features = true;
    bool with_links = true;
    bool with_calibration = true;
    double displaced_m = 0.0;  ///< of the features of node 3, along the view
  };

  void make() { make(Options{}); }
  void make(const Options& options) {
    std::filesystem::remove(folder_ / "map.db");
    sqlite::Database database(folder_ / "map.db",
                              {.access = sqlite::Access::kCreate, .untrusted = false});
    database.execute(
        "CREATE TABLE Node(id INTEGER PRIMARY KEY, map_id INTEGER, weight INTEGER, stamp FLOAT, "
        "pose BLOB, "
        "label TEXT, gps BLOB);"
        "CREATE TABLE Data(id INTEGER PRIMARY KEY, calibration BLOB);"
        "CREATE TABLE Link(from_id INTEGER, to_id INTEGER, type INTEGER, information_matrix BLOB, "
        "transform "
        "BLOB);"
        "CREATE TABLE Info(parameters TEXT);"
        "CREATE TABLE Feature(node_id INTEGER, word_id INTEGER, pos_x FLOAT, pos_y FLOAT, size "
        "INTEGER, dir "
        "FLOAT, response FLOAT, octave INTEGER, depth_x FLOAT, depth_y FLOAT, depth_z FLOAT, "
        "descriptor_size INTEGER, descriptor BLOB);");
    sqlite::Transaction transaction(database);
    database.run("INSERT INTO Info VALUES(?1)", "Kp/BadSignRatio:0.5;Kp/DetectorStrategy:8;Kp/X:1");
    Random random(3);
    points_.clear();
    for (int i = 0; i < 40; ++i) {
      points_.emplace_back(4.0 + random.uniform(), random.uniform() * 2.0 - 1.0,
                           random.uniform() * 1.5 - 0.5);
    }
    for (int node = 1; node <= 4; ++node) {
      const Rigid3 pose = world_from_base(node);
      database.run("INSERT INTO Node VALUES(?1,0,0,?2,?3,NULL,NULL)", node, 100.0 + node,
                   std::span<const std::byte>(blob_of(pose)));
      if (options.with_calibration) {
        database.run("INSERT INTO Data VALUES(?1,?2)", node,
                     std::span<const std::byte>(calibration()));
      }
      for (std::size_t i = 0; i < points_.size() && options.with_features; ++i) {
        add_feature(database, node, i, options);
      }
    }
    if (!options.with_links) {
      transaction.commit();
      return;
    }
    std::vector<std::byte> information;
    for (int i = 0; i < 36; ++i) append(information, i % 7 == 0 ? 100.0 : 0.0);
    const auto link = [&](int from, int to, int type) {
      const Rigid3 between = world_from_base(from).inverse() * world_from_base(to);
      database.run("INSERT INTO Link VALUES(?1,?2,?3,?4,?5)", from, to, type,
                   std::span<const std::byte>(information),
                   std::span<const std::byte>(blob_of(between)));
    };
    for (int node = 1; node < 4; ++node) {
      link(node, node + 1, 0);
      link(node + 1, node, 0);
    }
    link(4, 1, 1);
    link(2, 2, 7);  // a prior
    transaction.commit();
  }

  static Rigid3 world_from_base(int node) {
    return Rigid3::from_roll_pitch_yaw({0.2 * node, 0.1 * node, 0.0}, 0.0, 0.0, 0.03 * node);
  }

  void add_feature(sqlite::Database& database, int node, std::size_t i,
                   const Options& options) const {
    Eigen::Vector3d in_base = world_from_base(node).inverse() * points_[i];
    const Eigen::Vector3d in_camera = base_from_camera().inverse() * in_base;
    const double u = 500.0 * in_camera.x() / in_camera.z() + 319.5;
    const double v = 500.0 * in_camera.y() / in_camera.z() + 239.5;
    if (node == 3) in_base.x() += options.displaced_m;
    const std::vector<std::byte> descriptor(32, static_cast<std::byte>(i));
    auto row = database.prepare("INSERT INTO Feature VALUES(?1,?2,?3,?4,5,0,0,1,?5,?6,?7,32,?8)");
    row.bind(1, node).bind(2, static_cast<std::int64_t>(i + 1)).bind(3, u).bind(4, v);
    // The last point is never within the range of depth.
    if (i + 1 < points_.size()) row.bind(5, in_base.x()).bind(6, in_base.y()).bind(7, in_base.z());
    row.bind(8, std::span<const std::byte>(descriptor));
    while (row.step()) {
    }
  }

  LandmarkMap read_map() { return read(folder_ / "map.db"); }

  std::vector<Eigen::Vector3d> points_;
};

TEST_F(RtabmapTest, GnssPositionsBelongToTheirNodes) {
  make();
  {
    sqlite::Database database(folder_ / "map.db",
                              {.access = sqlite::Access::kWrite, .untrusted = false});
    const auto set = [&](int node, std::initializer_list<double> numbers) {
      std::vector<std::byte> blob;
      for (const double number : numbers) append(blob, number);
      database.run("UPDATE Node SET gps = ?1 WHERE id = ?2", std::span<const std::byte>(blob),
                   node);
    };
    set(1, {101.0, 8.54, 47.37, 408.0, 3.5, 90.0});
    set(2, {102.0, 8.54, 97.37, 408.0, 3.5, 90.0});
    set(3, {103.0, 8.55, 47.37, 408.0, 0.0, 90.0});
  }
  const LandmarkMap map = read_map();
  ASSERT_EQ(map.frames().gnss.size(), 4U);
  EXPECT_EQ(map.frames().gnss[0], (GnssFix{{47.37, 8.54, 408.0}, 3.5}));
  EXPECT_FALSE(map.frames().gnss[1].has_value());
  EXPECT_EQ(map.frames().gnss[2], (GnssFix{{47.37, 8.55, 408.0}, std::nullopt}));
  EXPECT_EQ(map.info().georeference, std::nullopt) << "nobody fitted the map to them";
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 GNSS positions are none on the Earth")));
}

TEST_F(RtabmapTest, FeaturesOfAWordAlongLinksBecomeLandmarks) {
  make();
  const LandmarkMap map = read_map();
  EXPECT_EQ(map.info().length_unit, LengthUnit::kMetres);
  ASSERT_EQ(map.frame_count(), 4U);
  EXPECT_EQ(map.frames().ids[0], FrameId{1});
  EXPECT_EQ(map.frames().timestamps_s[0], 101.0);
  EXPECT_LT(
      (map.frames().translations[0] - world_from_base(1) * Eigen::Vector3d(0.1, 0, 0.3)).norm(),
      1e-6)
      << "the camera's centre, not the robot's";
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0].parameters, (std::vector<double>{500, 500, 319.5, 239.5}));
  ASSERT_EQ(map.landmark_count(), points_.size() - 1);
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    EXPECT_LT((map.landmarks().positions[i] - points_[i]).norm(), 1e-4);
    EXPECT_EQ(map.observation_count(LandmarkIndex{i}), 4U);
    EXPECT_EQ(map.landmarks().descriptors->bytes[i * 32], i);
  }
  EXPECT_EQ(map.landmarks().descriptors->kind, "ORB");
  EXPECT_LT(reprojection(map).worst, 0.05);
  EXPECT_NEAR(*map.observations().depths[0],
              (map.world_from_camera(FrameIndex{0}).inverse() * points_[0]).z(), 1e-4);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("4 features without a depth")));
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 loop closures but no optimised poses")));
}

TEST_F(RtabmapTest, WordsOfUnlinkedNodesStayApart) {
  make({.with_links = false});
  const LandmarkMap map = read_map();
  EXPECT_EQ(map.landmark_count(), 4 * (points_.size() - 1));
}

TEST_F(RtabmapTest, FeaturesThatAreElsewhereStayApart) {
  make({.displaced_m = 2.0});
  const LandmarkMap map = read_map();
  // Nodes 1 and 2, 4 are one through the link from 4 to 1; those of node 3 are landmarks of their own or left out.
  EXPECT_GT(map.landmark_count(), points_.size() - 1);
  std::size_t of_three = 0;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    of_three += map.observation_count(LandmarkIndex{i}) == 3 ? 1 : 0;
    EXPECT_LT(map.observation_count(LandmarkIndex{i}), 4U);
  }
  EXPECT_EQ(of_three, points_.size() - 1);
}

TEST_F(RtabmapTest, WithoutFeaturesFramesRemain) {
  make({.with_features = false, .with_calibration = false});
  const LandmarkMap map = read_map();
  EXPECT_EQ(map.frame_count(), 4U);
  EXPECT_EQ(map.landmark_count(), 0U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("holds no features")));
}

TEST_F(RtabmapTest, WithoutCalibrationDepthsStillGroup) {
  make({.with_calibration = false});
  // Without one the camera is where the robot is: its z points up, and half of the features are behind.
  const LandmarkMap map = read_map();
  EXPECT_TRUE(map.cameras().empty());
  EXPECT_GT(map.landmark_count(), 0U);
}

TEST_F(RtabmapTest, LinksBecomeAPoseGraph) {
  make();
  const PoseGraph graph = read_rtabmap_graph(folder_ / "map.db");
  ASSERT_EQ(graph.nodes.size(), 4U);
  ASSERT_EQ(graph.links.size(), 4U) << "both directions are one link";
  for (const Link& link : graph.links) {
    const auto pose = [&](NodeId id) { return graph.nodes[id.value - 1].world_from_node.rigid(); };
    const Rigid3 expected = pose(link.target).inverse() * pose(link.source);
    EXPECT_LT(expected.difference_to(link.target_from_source->rigid()).norm(), 1e-5);
    ASSERT_TRUE(link.covariance);
    EXPECT_NEAR((*link.covariance)(5, 5), 0.01, 1e-12);
  }
  EXPECT_EQ(graph.links[3].kind, LinkKind::kPlacement) << "4 and 1";
  EXPECT_EQ(graph.links[0].kind, LinkKind::kOdometry);
}

TEST_F(RtabmapTest, FeaturesWithoutADescriptorTakeNoRoomForOne) {
  make();
  // With 16 KiB for each, the rows would exceed what the reader may take.
  const auto add_rows = [&](const std::string& depths) {
    sqlite::Database(folder_ / "map.db", {.access = sqlite::Access::kWrite})
        .execute(
            "DELETE FROM Feature;"
            "INSERT INTO Feature VALUES(1,1,319.5,239.5,5,0,0,1,4,0,0.3,4096,zeroblob(16384));"
            "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 40000) "
            "INSERT INTO Feature SELECT 1,0,319.5,239.5,5,0,0,1," +
            depths + ",NULL,NULL FROM n;");
  };
  add_rows("NULL,NULL,NULL");
  const LandmarkMap map = read_map();
  ASSERT_EQ(map.landmark_count(), 1U);
  EXPECT_EQ(map.landmarks().descriptors->bytes_each, 4096U);
  // A column has room for every landmark.
  add_rows("4,0,0.3");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read_map(); }),
              AllOf(HasSubstr("map.db: descriptors take 16"),
                    HasSubstr("at most 32 times the bytes of the files and 64 MiB")));
}

TEST_F(RtabmapTest, DamageIsRefusedByName) {
  make();
  {
    sqlite::Database database(folder_ / "map.db", {.access = sqlite::Access::kWrite});
    database.execute("UPDATE Feature SET pos_x = 'left' WHERE node_id = 2 AND word_id = 7");
  }
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read_map(); }), HasSubstr("map.db"));
  const std::string bytes = testing::read_text(folder_ / "map.db");
  for (std::size_t size = 4096; size < bytes.size(); size += 4096) {
    EXPECT_THAT(refused(bytes.substr(0, size), "cut.db"), HasSubstr("cut.db")) << size;
  }
}

TEST_F(RtabmapTest, ADatabaseThatWasNotClosedIsRefused) {
  make();
  const auto database = folder_ / "map.db";
  const auto not_closed = [&](const std::string& file) {
    return AllOf(HasSubstr("map.db: was not closed: changes are in "), HasSubstr(file),
                 HasSubstr("a closed database"));
  };
  for (const char* ending : {"-wal", "-journal"}) {
    const auto journal = folder_.write(std::string("map.db") + ending, "\xd9\xd5\x05\xf9");
    EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read_map(); }), not_closed(journal.string()));
    EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read_rtabmap_graph(database); }),
                not_closed(journal.string()));
    std::filesystem::create_symlink(database, folder_ / "link.db");
    EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(folder_ / "link.db"); }),
                AllOf(HasSubstr("link.db: was not closed"), HasSubstr(journal.string())));
    std::filesystem::remove(folder_ / "link.db");
    folder_.write(journal.filename().string(), "");
    EXPECT_EQ(read_map().frame_count(), 4U) << "an empty " << ending << " holds no changes";
    std::filesystem::remove(journal);
  }
  folder_.write("map.db-journal", std::string(512, '\0'));
  EXPECT_EQ(read_map().frame_count(), 4U) << "journal_mode = PERSIST keeps a zeroed header";
}

TEST_F(RtabmapTest, RowsInAWriteAheadLogAreNotMissedSilently) {
  make();
  sqlite::Database writer(folder_ / "map.db", {.access = sqlite::Access::kWrite});
  ASSERT_EQ(writer.text("PRAGMA journal_mode = WAL"), "wal");
  writer.execute("DELETE FROM Feature");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read_map(); }), HasSubstr("map.db-wal"));
  { const sqlite::Database closed = std::move(writer); }
  EXPECT_EQ(read_map().landmark_count(), 0U);
}

TEST(RealRtabmap, NodesAndLinksAreRead) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/rtabmap/rtabmap.db");
  EXPECT_EQ(map.frame_count(), 411U);
  EXPECT_EQ(map.landmark_count(), 0U);
  const PoseGraph graph = read_rtabmap_graph(*data / "foreign/rtabmap/rtabmap.db");
  EXPECT_EQ(graph.nodes.size(), 411U);
  EXPECT_EQ(graph.links.size(), 49U);
  // Each link was measured by the odometry that the poses are of.
  for (const Link& link : graph.links) {
    const auto pose = [&](NodeId id) {
      return std::find_if(graph.nodes.begin(), graph.nodes.end(),
                          [&](const PoseNode& node) { return node.id == id; })
          ->world_from_node.rigid();
    };
    const Rigid3 between = pose(link.target).inverse() * pose(link.source);
    EXPECT_LT((between.inverse() * link.target_from_source->rigid()).angle(), 0.01);
    EXPECT_LT((between.translation() - link.target_from_source->translation()).norm(), 0.01);
  }
}

}  // namespace
}  // namespace cairn::detail

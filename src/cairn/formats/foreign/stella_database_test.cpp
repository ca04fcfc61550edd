// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/storage/sqlite/database.hpp"

#include "support/imported_maps.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::refusal;

template <class Number>
std::vector<std::byte> stella_blob(const std::vector<Number>& numbers) {
  std::vector<std::byte> bytes(numbers.size() * sizeof(Number));
  if (!bytes.empty()) std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

struct Keypoint {
  float x, y, size, angle, response;
  std::int32_t octave, class_id;
};

// Made by the rules of the format: no real file is known.
class StellaDatabaseTest : public testing::ImportTest {
 protected:
  void SetUp() override {
    sqlite::Database database(file(), {.access = sqlite::Access::kCreate, .untrusted = false});
    database.execute(
        "CREATE TABLE cameras(id INTEGER PRIMARY KEY, name BLOB, setup_type BLOB, model_type BLOB, "
        "color_type BLOB, cols INTEGER, rows INTEGER, fps REAL, fx REAL, fy REAL, cx REAL, cy "
        "REAL, k1 "
        "REAL, k2 REAL, p1 REAL, p2 REAL, k3 REAL, k4 REAL, focal_x_baseline REAL, distortion "
        "REAL);"
        "CREATE TABLE keyframes(id INTEGER PRIMARY KEY, src_frm_id INTEGER, ts REAL, cam BLOB, "
        "orb_params "
        "BLOB, pose_cw BLOB, n_keypts INTEGER, undist_keypts BLOB, x_rights BLOB, depths BLOB, "
        "descs "
        "BLOB);"
        "CREATE TABLE landmarks(id INTEGER PRIMARY KEY, first_keyfrm INTEGER, pos_w BLOB, "
        "ref_keyfrm "
        "INTEGER, n_vis INTEGER, n_fnd INTEGER);"
        "CREATE TABLE associations(id INTEGER PRIMARY KEY, lm_ids BLOB, span_parent INTEGER);"
        "INSERT INTO cameras(id, name, setup_type, model_type, cols, rows, fx, fy, cx, cy) "
        "VALUES(0, "
        "CAST('cam' AS BLOB), CAST('RGBD' AS BLOB), CAST('Perspective' AS BLOB), 200, 100, 100, "
        "100, "
        "99.5, 49.5);");
    // Turned by 90 degrees about z, and shifted: column by column.
    const std::vector<double> pose = {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1};
    const std::vector<Keypoint> keypoints = {{1, 2, 31, 0, 0, 0, -1},
                                             {91.80769F, 72.57692F, 31, 0, 0, 3, -1}};
    std::vector<std::uint8_t> descriptors(64, 0);
    descriptors[32] = 5;
    database.run(
        "INSERT INTO keyframes VALUES(7,NULL,2.5,CAST('cam' AS BLOB),NULL,?1,2,?2,NULL,?3,?4)",
        std::span<const std::byte>(stella_blob(pose)),
        std::span<const std::byte>(stella_blob(keypoints)),
        std::span<const std::byte>(stella_blob(std::vector<float>{-1.0F, 13.0F})),
        std::span<const std::byte>(stella_blob(descriptors)));
    database.run("INSERT INTO landmarks VALUES(11,7,?1,7,4,3)",
                 std::span<const std::byte>(stella_blob(std::vector<double>{1, 2, 10})));
    database.run("INSERT INTO associations VALUES(7,?1,-1)",
                 std::span<const std::byte>(stella_blob(std::vector<std::int32_t>{-1, 11})));
  }
  std::filesystem::path file() const { return folder_ / "map.db"; }
  void change(const std::string& sql) const {
    sqlite::Database(file(), {.access = sqlite::Access::kWrite}).execute(sql);
  }
};

TEST_F(StellaDatabaseTest, TablesSayTheSameAsMessagePack) {
  const LandmarkMap map = read(file());
  EXPECT_EQ(map.info().length_unit, LengthUnit::kMetres) << "a depth camera";
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{7}));
  EXPECT_LT((map.frames().translations[0] - Eigen::Vector3d(-2, 1, -3)).norm(), 1e-12);
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{11}));
  EXPECT_THAT(map.observations().keypoints, ElementsAre(1U));
  EXPECT_THAT(map.observations().depths, ElementsAre(13.0));
  EXPECT_THAT(map.observations().octaves, ElementsAre(3));
  EXPECT_EQ(map.landmarks().descriptors->bytes[0], 5);
  EXPECT_THAT(map.column("found")->values, ElementsAre(3.0));
  EXPECT_LT(testing::reprojection(map).worst, 1e-4);
}

TEST_F(StellaDatabaseTest, DamageIsRefusedByTableAndRow) {
  change("UPDATE keyframes SET pose_cw = zeroblob(128)");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("keyframes 7: pose_cw: is no rigid motion"));
  change("UPDATE keyframes SET pose_cw = zeroblob(127)");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("keyframes 7: pose_cw: 127 bytes; expected a multiple of 8"));
}

TEST_F(StellaDatabaseTest, SizesMustAgree) {
  change("UPDATE associations SET lm_ids = zeroblob(12)");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("keyframes 7: has 2 keypoints, but 3 landmark ids"));
}

TEST_F(StellaDatabaseTest, LeavesOutAndCountsPositionsThatAreNotFinite) {
  change("UPDATE landmarks SET pos_w = x'000000000000f07f00000000000000000000000000000000'");
  EXPECT_EQ(read(file()).landmark_count(), 0U);
  EXPECT_THAT(remarks_.losses, ::testing::Contains(HasSubstr("1 of 1 landmarks left out")));
}

}  // namespace
}  // namespace cairn::detail

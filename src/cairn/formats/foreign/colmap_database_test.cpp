// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/detail/files_read.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/storage/sqlite/database.hpp"

#include "support/imported_maps.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using testing::refusal;

// A model of one image with three keypoints in sparse/0, and the database that it was made from.
class ColmapDatabaseTest : public testing::ImportTest {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "sparse/0");
    folder_.write("sparse/0/cameras.txt", "1 PINHOLE 200 100 100 100 100 50\n");
    folder_.write("sparse/0/images.txt", "7 1 0 0 0 0 0 0 1 a.png\n110 70 4 5.5 6.5 -1 90 50 2\n");
    folder_.write("sparse/0/points3D.txt", "4 1 2 10 1 2 3 0.25 7 0\n2 -1 0 10 1 2 3 -1 7 2\n");
    sqlite::Database database(file(), {.access = sqlite::Access::kCreate, .untrusted = false});
    database.execute(
        "CREATE TABLE images(image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER);"
        "CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data "
        "BLOB);"
        "CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data "
        "BLOB);"
        "INSERT INTO images VALUES(3, 'a.png', 1);");
    const std::vector<float> keypoints = {110, 70, 1, 0, 5.5F, 6.5F, 1, 0, 90, 50, 1, 0};
    std::vector<std::byte> bytes(keypoints.size() * sizeof(float));
    std::memcpy(bytes.data(), keypoints.data(), bytes.size());
    database.run("INSERT INTO keypoints VALUES(3, 3, 4, ?1)", std::span<const std::byte>(bytes));
    std::vector<std::byte> descriptors(3 * 128);
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      descriptors[i] = static_cast<std::byte>(i / 128 + 1);
    }
    database.run("INSERT INTO descriptors VALUES(3, 3, 128, ?1)",
                 std::span<const std::byte>(descriptors));
  }
  fs::path file() const { return folder_ / "database.db"; }
  void change(const std::string& sql) const {
    sqlite::Database(file(), {.access = sqlite::Access::kWrite}).execute(sql);
  }
};

TEST_F(ColmapDatabaseTest, DescriptorsOfTheDatabaseBelongToLandmarks) {
  for (const fs::path& path : {folder_ / "sparse/0", folder_ / "sparse/0/points3D.txt", file(),
                               fs::path(file().string() + "#0")}) {
    const LandmarkMap map = read(path);
    ASSERT_TRUE(map.landmarks().descriptors) << path;
    EXPECT_EQ(map.landmarks().descriptors->kind, "SIFT");
    EXPECT_EQ(map.landmarks().descriptors->bytes[0], 3) << "point 2 is keypoint 2";
    EXPECT_EQ(map.landmarks().descriptors->bytes[128], 1);
    EXPECT_EQ(map.observations().keypoints[1], 0U);
  }
}

TEST_F(ColmapDatabaseTest, ADatabaseOfAnyNameIsFoundByItsTables) {
  fs::rename(file(), folder_ / "colmap.db");
  fs::rename(folder_ / "sparse", folder_ / "colmap_sparse");
  folder_.write("Thumbs.db", "no database");
  for (const fs::path& path :
       {folder_ / "colmap_sparse/0", folder_ / "colmap.db", folder_.path()}) {
    EXPECT_TRUE(read(path).landmarks().descriptors) << path;
  }
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("the map in " + (folder_ / "colmap_sparse/0").string())));
  fs::copy(folder_ / "colmap.db", folder_ / "other.db");
  EXPECT_FALSE(read(folder_ / "colmap_sparse/0").landmarks().descriptors);
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("several databases of COLMAP, colmap.db and other.db")));
  fs::copy(folder_ / "colmap_sparse/0", folder_ / "colmap_text");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(folder_.path()); }),
              AllOf(HasSubstr("holds 2 maps in folders"), HasSubstr("colmap_sparse/0 or "),
                    HasSubstr("colmap_text")));
}

// COLMAP 4 stores 32-bit floats as bytes.
TEST_F(ColmapDatabaseTest, DescriptorsOfFloatsAreOfTheKindThatTheDatabaseStates) {
  change("ALTER TABLE descriptors ADD COLUMN type INTEGER");
  std::vector<float> values(3 * 64);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = std::sin(static_cast<float>(i * i)) * (i < 64 ? 1.0F : 30.0F);  // of any length
  }
  values[64] = std::numeric_limits<float>::quiet_NaN();  // keypoint 1, which no point has
  std::vector<std::byte> bytes(values.size() * sizeof(float));
  std::memcpy(bytes.data(), values.data(), bytes.size());
  sqlite::Database(file(), {.access = sqlite::Access::kWrite})
      .run("UPDATE descriptors SET type = 2, cols = 256, data = ?1",
           std::span<const std::byte>(bytes));
  const LandmarkMap map = read(folder_ / "sparse/0");
  ASSERT_TRUE(map.landmarks().descriptors);
  EXPECT_EQ(map.landmarks().descriptors->kind, "ALIKED_N32");
  ASSERT_EQ(map.landmarks().descriptors->bytes_each, 64U);
  const std::span<const float> of_keypoint_2 = std::span(values).subspan(128);
  const auto first = map.landmarks().descriptors->descriptor(0, 0);
  EXPECT_THAT(first, ::testing::ElementsAreArray(descriptor_bytes(of_keypoint_2)));
  change("UPDATE descriptors SET type = 7");
  EXPECT_EQ(read(folder_ / "sparse/0").landmarks().descriptors->kind, "COLMAP_7");
  change("UPDATE descriptors SET type = 0");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("descriptors other than SIFT")));
}

TEST_F(ColmapDatabaseTest, AModelWithoutCamerasGetsDescriptorsToo) {
  fs::remove(folder_ / "sparse/0/cameras.txt");
  EXPECT_TRUE(read(folder_ / "sparse/0").frames().cameras.empty());
  EXPECT_TRUE(read(folder_ / "sparse/0").landmarks().descriptors);
  EXPECT_TRUE(read(file()).landmarks().descriptors);
}

TEST_F(ColmapDatabaseTest, AnotherDatabaseBesideIsLeftOut) {
  change("DELETE FROM images");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 images of the model are not in the database")));
  change("DROP TABLE descriptors");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("has no table descriptors")));
  folder_.write("database.db", "SQLite format 3");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors);
}

TEST_F(ColmapDatabaseTest, ADatabaseBesideThatIsToBeWrittenIsRefused) {
  detail::refuse_to_read({{"--json", file()}});
  EXPECT_THAT(refusal(ErrorKind::kMisuse, [&] { read(folder_ / "sparse/0"); }),
              HasSubstr("--json: " + file().string()));
  detail::refuse_to_read({});
  EXPECT_TRUE(read(folder_ / "sparse/0").landmarks().descriptors);
}

TEST_F(ColmapDatabaseTest, ADatabaseThatWasNotClosedIsLeftOutOrRefused) {
  folder_.write("database.db-wal", "changes");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors);
  EXPECT_THAT(remarks_.texts,
              Contains(AllOf(HasSubstr("was not closed"), HasSubstr("what it holds is left out"))));
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }), HasSubstr("was not closed"));
}

TEST_F(ColmapDatabaseTest, OtherKeypointsAreNotTaken) {
  change("UPDATE keypoints SET rows = 2, data = zeroblob(32)");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("1 images have other keypoints than the model")));
  change("UPDATE keypoints SET rows = 3, data = zeroblob(48)");
  EXPECT_FALSE(read(folder_ / "sparse/0").landmarks().descriptors) << "elsewhere in the image";
}

TEST_F(ColmapDatabaseTest, SizesAreHeldAgainstTheBytes) {
  change("UPDATE descriptors SET rows = 4611686018427387904");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("descriptors: 4611686018427387904 x 128 numbers in 384 bytes"));
  change("UPDATE descriptors SET rows = -1");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }), HasSubstr("database.db"));
}

std::vector<std::byte> blob_of(const std::vector<double>& numbers) {
  std::vector<std::byte> bytes(numbers.size() * sizeof(double));
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

// Images a.png, turned by a quarter turn about z, and b.png, which is not.
class ColmapPriorsTest : public ColmapDatabaseTest {
 protected:
  void SetUp() override {
    ColmapDatabaseTest::SetUp();
    folder_.write(
        "sparse/0/images.txt",
        "7 0.7071067811865476 0 0 0.7071067811865476 0 0 0 1 a.png\n110 70 4 5.5 6.5 -1 90 "
        "50 2\n8 1 0 0 0 0 0 0 1 b.png\n\n");
    change("INSERT INTO images VALUES(5, 'b.png', 1)");
  }
  void add_prior(int image, int sensor_type, const std::vector<double>& position, int system,
                 const std::vector<double>& covariance, const std::vector<double>& gravity) const {
    sqlite::Database(file(), {.access = sqlite::Access::kWrite})
        .run("INSERT INTO pose_priors VALUES(NULL, ?1, 1, ?2, ?3, ?4, ?5, ?6)", image, sensor_type,
             std::span<const std::byte>(blob_of(position)),
             std::span<const std::byte>(blob_of(covariance)),
             std::span<const std::byte>(blob_of(gravity)), system);
  }
  static constexpr const char* kTable =
      "CREATE TABLE pose_priors(pose_prior_id INTEGER PRIMARY KEY, corr_data_id INTEGER, "
      "corr_sensor_id INTEGER, corr_sensor_type INTEGER, position BLOB, position_covariance BLOB, "
      "gravity BLOB, coordinate_system INTEGER NOT NULL)";
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> unknown_ = std::vector<double>(3, kNan);
};

TEST_F(ColmapPriorsTest, PositionsAndGravityOfImagesComeAlong) {
  change(kTable);
  add_prior(3, 0, {47.37, 8.54, 408.0}, 0, {1, 0, 0, 0, 4, 0, 0, 0, 4}, {0, 2, 0});
  add_prior(3, 1, {1, 2, 3}, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 1});  // of another sensor
  add_prior(5, 0, unknown_, -1, std::vector<double>(9, kNan), {1, 0.01, 0});
  for (const char* name : {"database.db", "sparse/0"}) {
    const LandmarkMap map = read(folder_ / name);
    ASSERT_EQ(map.frames().gnss.size(), 2U);
    EXPECT_EQ(map.frames().gnss[0], (GnssFix{{47.37, 8.54, 408.0}, std::sqrt(3.0)}));
    EXPECT_FALSE(map.frames().gnss[1].has_value());
    // Down is y of the first image, which is x of the world, and x of the second.
    ASSERT_TRUE(map.info().gravity.has_value());
    EXPECT_LT((*map.info().gravity - Eigen::Vector3d::UnitX()).norm(), 0.01);
    EXPECT_NEAR(map.info().gravity->norm(), 1.0, 1e-12);
    write(map, std::string("of-") + fs::path(name).filename().string() + "/");
    EXPECT_THAT(remarks_.losses,
                Contains(AllOf(HasSubstr("direction of gravity"), HasSubstr("GNSS positions"))));
  }
}

TEST_F(ColmapPriorsTest, ThoseOfVersion3AreOfImages) {
  change(
      "CREATE TABLE pose_priors(image_id INTEGER PRIMARY KEY, position BLOB, coordinate_system "
      "INTEGER NOT NULL)");
  sqlite::Database(file(), {.access = sqlite::Access::kWrite})
      .run("INSERT INTO pose_priors VALUES(5, ?1, 0)",
           std::span<const std::byte>(blob_of({-1.0, 2.0, 3.0})));
  const LandmarkMap map = read(file());
  ASSERT_EQ(map.frames().gnss.size(), 2U);
  EXPECT_EQ(map.frames().gnss[1], (GnssFix{{-1.0, 2.0, 3.0}, std::nullopt}));
  EXPECT_FALSE(map.info().gravity.has_value());
}

TEST_F(ColmapPriorsTest, WhatAMapCannotHoldIsALoss) {
  change(kTable);
  add_prior(3, 0, {1, 2, 3}, 1, std::vector<double>(9, kNan), {0, 1, 0});
  add_prior(5, 0, {1, 2, 3}, 1, std::vector<double>(9, kNan), {1, 0.2, 0});
  const LandmarkMap map = read(file());
  EXPECT_TRUE(map.frames().gnss.empty());
  EXPECT_FALSE(map.info().gravity.has_value());
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("2 positions of images are not in WGS84")));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("gravity of 2 images differ by up to 6 deg")));
}

TEST_F(ColmapPriorsTest, WrongPriorsAreRefused) {
  change(kTable);
  add_prior(3, 0, {1, 2}, 0, std::vector<double>(9, kNan), unknown_);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("database.db: pose_priors: 16 bytes; expected 3 numbers of 8"));
  change("DELETE FROM pose_priors");
  add_prior(3, 0, {91, 2, 3}, 0, std::vector<double>(9, kNan), unknown_);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("database.db: pose_priors: latitude 91 is out of range"));
}

TEST_F(ColmapDatabaseTest, ADatabaseWithoutAModelIsNoMap) {
  fs::remove_all(folder_ / "sparse");
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(file()); }),
              HasSubstr("is COLMAP's database of features, and no model lies beside it"));
}

}  // namespace
}  // namespace cairn::detail

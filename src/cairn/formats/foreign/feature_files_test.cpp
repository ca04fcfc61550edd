// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/feature_files.hpp"

#include <cstring>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/imported_maps.hpp"
#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::refusal;

// Rows of so many bytes, each byte of row i being first + i.
std::string rows_of(std::size_t count, std::size_t size, int first = 1) {
  std::string rows;
  for (std::size_t i = 0; i < count; ++i)
    rows.append(size, static_cast<char>(first + static_cast<int>(i)));
  return rows;
}

std::string desc(std::uint64_t count, const std::string& rows) {
  std::string bytes(sizeof count, '\0');
  std::memcpy(bytes.data(), &count, sizeof count);
  return bytes + rows;
}

// Two landmarks: features 2 and 0 of the one image, at (99, 49) and (30, 20).
constexpr const char* kFeatures = "30 20 1.5 0\n70 70 2 0.5\n99 49 3 1\n";

class OpenMvgFeaturesTest : public testing::ImportTest {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "matches");
    fs::create_directories(folder_ / "reconstruction");
    folder_.write("reconstruction/sfm_data.json",
                  R"({"sfm_data_version": "0.3", "views": [
    {"key": 0, "value": {"ptr_wrapper": {"data": {"filename": "a.jpg", "id_view": 4, "id_intrinsic": 1, "id_pose": 7}}}}],
   "intrinsics": [{"key": 1, "value": {"ptr_wrapper": {"data": {"width": 200, "height": 100,
     "focal_length": 100, "principal_point": [99, 49]}}}}],
   "extrinsics": [{"key": 7, "value": {"rotation": [[1,0,0],[0,1,0],[0,0,1]], "center": [0,0,0]}}],
   "structure": [
    {"key": 9, "value": {"X": [0,0,10], "observations": [{"key": 4, "value": {"id_feat": 2, "x": [99, 49]}}]}},
    {"key": 5, "value": {"X": [1,0,10], "observations": [{"key": 4, "value": {"id_feat": 0, "x": [30, 20]}}]}}],
   "control_points": []})");
    describe("SIFT_Regions");
    folder_.write("matches/a.feat", kFeatures);
    folder_.write("matches/a.desc", desc(3, rows_of(3, 128)));
  }
  void describe(const std::string& regions) const {
    folder_.write("matches/image_describer.json",
                  R"({"regions_type": {"polymorphic_id": 2147483649, "polymorphic_name": ")" +
                      regions + "\"}}");
  }
  LandmarkMap read() { return ImportTest::read(folder_ / "reconstruction/sfm_data.json"); }
  // Reads a model without descriptors; returns what is said of it.
  std::vector<std::string> left_out() {
    remarks_.texts.clear();
    EXPECT_FALSE(read().landmarks().descriptors);
    return remarks_.texts;
  }
};

TEST_F(OpenMvgFeaturesTest, LandmarksGetTheDescriptorsOfTheirFeatures) {
  const LandmarkMap map = read();
  ASSERT_TRUE(map.landmarks().descriptors);
  const DescriptorColumn& column = *map.landmarks().descriptors;
  EXPECT_EQ(column.kind, "OPENMVG_SIFT");
  EXPECT_THAT(column.descriptor(0, 0), Each(3)) << "landmark 9 is feature 2";
  EXPECT_THAT(column.descriptor(1, 0), Each(1)) << "landmark 5 is feature 0";
  EXPECT_THAT(remarks_.texts, IsEmpty());
}

TEST_F(OpenMvgFeaturesTest, TheTypeOfTheRegionsStatesSizeAndDistance) {
  describe("AKAZE_Binary_Regions");
  folder_.write("matches/a.desc", desc(3, rows_of(3, 64)));
  EXPECT_EQ(read().landmarks().descriptors->kind, "AKAZE");
  EXPECT_EQ(read().landmarks().descriptors->bytes_each, 64U);
  describe("AKAZE_Float_Regions");
  std::vector<float> values(64, 0.5F);
  values[0] = -0.5F;
  std::string row(values.size() * sizeof(float), '\0');
  std::memcpy(row.data(), values.data(), row.size());
  folder_.write("matches/a.desc", desc(3, row + row + row));
  const LandmarkMap map = read();
  EXPECT_EQ(map.landmarks().descriptors->kind, "AKAZE_MSURF");
  const auto row_of_first = map.landmarks().descriptors->descriptor(0, 0);
  EXPECT_EQ(row_of_first.size(), 64U);
  EXPECT_EQ(row_of_first[0], 96) << "127.5 less a 32nd of the range for each root mean square";
  EXPECT_EQ(row_of_first[1], 159);
  describe("Unheard_Of");
  EXPECT_THAT(left_out(), Contains(HasSubstr("descriptors of 'Unheard_Of' are left out")));
}

TEST_F(OpenMvgFeaturesTest, FilesThatDoNotFitAreNamedAndLeftOut) {
  const auto defect = [&](const std::string& text) {
    return Contains(
        ::testing::AllOf(HasSubstr("features of 1 images are left out"), HasSubstr(text)));
  };
  folder_.write("matches/a.desc", desc(3, rows_of(2, 128)));
  EXPECT_THAT(left_out(), defect("a.desc: has 256 bytes for 3 descriptors; expected 128 for each"));
  folder_.write("matches/a.desc", desc(1ULL << 57U, ""));
  EXPECT_THAT(left_out(), defect("has 0 bytes for 144115188075855872 descriptors"));
  folder_.write("matches/a.desc", "abc");
  EXPECT_THAT(left_out(), defect("has 3 bytes"));
  folder_.write("matches/a.desc", desc(2, rows_of(2, 128)));
  EXPECT_THAT(left_out(), defect("other features than the model observes")) << "no feature 2";
  folder_.write("matches/a.desc", desc(3, rows_of(3, 128)));
  folder_.write("matches/a.feat", "130 20 1 0\n70 70 1 0\n10 49 1 0\n");
  EXPECT_THAT(left_out(), defect("other features than the model observes")) << "far from there";
  folder_.write("matches/a.feat", "30 20 1 0\n70\n");
  EXPECT_THAT(left_out(), defect("a.feat: line 2: '70'; expected x y scale orientation"));
  fs::remove(folder_ / "matches/a.feat");
  EXPECT_TRUE(read().landmarks().descriptors) << "positions are a check that is not needed";
}

TEST_F(OpenMvgFeaturesTest, AnImageWithoutFeaturesHasNoDescriptors) {
  fs::remove(folder_ / "matches/a.desc");
  EXPECT_THAT(left_out(), IsEmpty());
  folder_.write("matches/image_describer.json", "{");
  EXPECT_THAT(left_out(), Contains(HasSubstr("descriptors are left out")));
}

class AliceVisionFeaturesTest : public testing::ImportTest {
 protected:
  // @param types descType of the two landmarks
  void write(const std::string& first, const std::string& second) const {
    fs::create_directories(folder_ / "sfm");
    fs::create_directories(folder_ / "features");
    folder_.write("sfm/scene.sfm", fmt::format(R"({{"version": ["1", "2", "6"],
   "featuresFolders": ["..\\features"], "views": [
    {{"viewId": "4", "poseId": "7", "intrinsicId": "1", "path": "a.jpg", "width": "200", "height": "100"}}],
   "intrinsics": [{{"intrinsicId": "1", "width": "200", "height": "100", "pxFocalLength": "100",
     "type": "pinhole", "principalPoint": ["0", "0"]}}],
   "poses": [{{"poseId": "7", "pose": {{"transform": {{"rotation": ["1","0","0","0","1","0","0","0","1"],
     "center": ["0", "0", "0"]}}}}}}],
   "structure": [
    {{"landmarkId": "9", "descType": "{}", "X": ["0","0","10"], "observations": [
      {{"observationId": "4", "featureId": "2", "x": ["99", "49"]}}]}},
    {{"landmarkId": "5", "descType": "{}", "X": ["1","0","10"], "observations": [
      {{"observationId": "4", "featureId": "0", "x": ["30", "20"]}}]}},
    {{"landmarkId": "6", "descType": "dspsift", "X": ["1","0","10"], "observations": [
      {{"observationId": "4", "featureId": "1", "x": ["70", "70"]}}]}}]}})",
                                               first, second));
    for (const std::string& type : {first, second}) {
      folder_.write("features/4." + type + ".feat", kFeatures);
    }
  }
  LandmarkMap read() { return ImportTest::read(folder_ / "sfm/scene.sfm"); }
};

TEST_F(AliceVisionFeaturesTest, TheUsualTypeCountsInTheOrderOfLowe) {
  write("sift", "sift");
  std::string rows;
  for (int i = 0; i < 3 * 128; ++i) rows += static_cast<char>(i % 8 + 10 * (i / 128));
  folder_.write("features/4.sift.desc", desc(3, rows));
  folder_.write("features/4.dspsift.desc", desc(3, rows));
  const LandmarkMap map = read();
  ASSERT_TRUE(map.landmarks().descriptors);
  const DescriptorColumn& column = *map.landmarks().descriptors;
  EXPECT_EQ(column.kind, "SIFT");
  EXPECT_THAT(column.known, ElementsAre(1, 1, 0)) << "the third landmark has another type";
  const auto row = column.descriptor(0, 0);
  EXPECT_THAT(std::vector<int>(row.begin(), row.begin() + 9),
              ElementsAre(20, 27, 26, 25, 24, 23, 22, 21, 20));
  EXPECT_EQ(column.descriptor(1, 0)[0], 0) << "landmark 5 is feature 0";
}

TEST_F(AliceVisionFeaturesTest, FeaturesOfOtherKindsAreNoSift) {
  write("akaze_mldb", "akaze_mldb");
  folder_.write("features/4.akaze_mldb.desc", desc(3, rows_of(3, 64)));
  EXPECT_EQ(read().landmarks().descriptors->kind, "AKAZE");
  write("cctag3", "cctag3");
  folder_.write("features/4.cctag3.desc", desc(3, rows_of(3, 128)));
  EXPECT_FALSE(read().landmarks().descriptors);
}

}  // namespace
}  // namespace cairn::detail

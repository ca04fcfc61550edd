// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/plain_points.hpp"

#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/interchange/formats.hpp"

#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::refusal;
using testing::TemporaryFolder;

class PlainPointsTest : public ::testing::Test {
 protected:
  LandmarkMap read(std::string_view bytes) {
    remarks_.clear();
    return all_formats().read(folder_.write("points", bytes), {.log = [&](std::string_view remark) {
                                remarks_.emplace_back(remark);
                              }});
  }
  std::string refused(std::string_view bytes) {
    return refusal(ErrorKind::kInput, [&] { read(bytes); });
  }
  TemporaryFolder folder_;
  std::vector<std::string> remarks_;
};

std::string npy(std::string header, std::size_t doubles) {
  std::string bytes = "\x93NUMPY";
  bytes += '\x01';
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 255);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  for (std::size_t i = 0; i < doubles; ++i) {
    const double value = static_cast<double>(i) + 0.5;
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  return bytes;
}

TEST_F(PlainPointsTest, LinesBecomeLandmarks) {
  for (const char* text : {"# comment\n\n 1 2 3\n4 5 6\n", "1,2,3\r\n4, 5, 6\r\n", "1;2;3\n4;5;6\n",
                           "X,Y,Z\n1,2,3\n4,5,6\n"}) {
    SCOPED_TRACE(text);
    const LandmarkMap map = read(text);
    EXPECT_THAT(map.landmarks().positions,
                ElementsAre(Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6)));
    EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{0}, LandmarkId{1}));
    EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
    EXPECT_FALSE(map.has_observations());
    EXPECT_TRUE(remarks_.empty());
  }
}

TEST_F(PlainPointsTest, HeaderNamesTheColumns) {
  const LandmarkMap map = read("id,z,weight,x,y\n7,3,0.5,1,2\n");
  EXPECT_EQ(map.landmarks().positions.at(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(remarks_, Contains(HasSubstr("columns other than x, y and z are left out")));
}

TEST_F(PlainPointsTest, PointsThatAreNotFiniteAreLeftOut) {
  EXPECT_EQ(read("1 2 3\n1 nan 3\n1 2 -inf\n").landmark_count(), 1U);
  EXPECT_THAT(remarks_, Contains(HasSubstr("2 points without a finite position")));
}

TEST_F(PlainPointsTest, TextErrorsNameLineAndField) {
  EXPECT_THAT(refused("1 2 3\n1 x 3\n"), HasSubstr("points:2: field 2 (y): 'x' is not a number"));
  EXPECT_THAT(refused("1 2 3\n1 2\n"), HasSubstr("points:2: field 3 (z): the line has 2 fields"));
  EXPECT_THAT(refused("1 2 3\n4 5 6"), HasSubstr("points:2: the last line does not end"));
}

TEST_F(PlainPointsTest, CairnTextIsNotMistakenForPoints) {
  EXPECT_EQ(read("FRAME 1 0 0 0 1 0 0 0\n").frame_count(), 1U);
  EXPECT_THAT(refused("hello world again\n"), HasSubstr("expected FRAME or LANDMARK"));
}

TEST_F(PlainPointsTest, NumPyArraysBecomeLandmarks) {
  const LandmarkMap map =
      read(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }   \n", 6));
  EXPECT_THAT(map.landmarks().positions,
              ElementsAre(Eigen::Vector3d(0.5, 1.5, 2.5), Eigen::Vector3d(3.5, 4.5, 5.5)));
}

TEST_F(PlainPointsTest, NumPyArraysOfOtherKindsAreRefused) {
  EXPECT_THAT(refused(npy("{'descr': '<i8', 'fortran_order': False, 'shape': (2, 3), }\n", 6)),
              HasSubstr("descr: ''<i8'' is no type of positions"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': True, 'shape': (2, 3), }\n", 6)),
              HasSubstr("fortran_order"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (6,), }\n", 6)),
              HasSubstr("shape: '(6,)'; expected (N, 3)"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 3), }\n", 6)),
              HasSubstr("position: the file ends after"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 3), }\n", 6)),
              HasSubstr("there are bytes behind the last record"));
  const std::string whole = npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n", 6);
  for (std::size_t size = 6; size < whole.size(); ++size) {
    EXPECT_THAT(refused(whole.substr(0, size)), HasSubstr("points: byte ")) << size;
  }
}

TEST(RealPlainPoints, AreRead) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/points/MapPoints.txt");
  EXPECT_GT(map.landmark_count(), 5000U);
}

}  // namespace
}  // namespace cairn

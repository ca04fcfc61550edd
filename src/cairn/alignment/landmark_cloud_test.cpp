// SPDX-License-Identifier: BSD-3-Clause
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/error.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

LandmarkCloud with_descriptors_of(std::size_t bytes) {
  LandmarkCloud cloud;
  cloud.positions.assign(3, Eigen::Vector3d::Zero());
  cloud.descriptors = DescriptorColumn{"ORB", bytes, std::vector<std::uint8_t>(3, 1),
                                       std::vector<std::uint8_t>(3 * bytes)};
  return cloud;
}

TEST(LandmarkCloud, RefusesDescriptorsOfNoBytesAndOfTooMany) {
  EXPECT_NO_THROW(with_descriptors_of(1).validate("source"));
  EXPECT_NO_THROW(with_descriptors_of(kMostDescriptorBytes).validate("source"));
  for (const std::size_t bytes : {std::size_t{0}, kMostDescriptorBytes + 1}) {
    EXPECT_THAT(testing::refusal(ErrorKind::kMisuse,
                                 [&] { with_descriptors_of(bytes).validate("source"); }),
                AllOf(HasSubstr("source"), HasSubstr(std::to_string(bytes) + " bytes"),
                      HasSubstr("1 to 4096")));
  }
}

TEST(LandmarkCloud, RefusesBrokenFurtherDescriptors) {
  const auto message = [](std::vector<std::uint64_t> offsets, std::size_t bytes) {
    LandmarkCloud cloud = with_descriptors_of(2);
    cloud.descriptors->known[1] = 0;
    cloud.descriptors->further_offsets = std::move(offsets);
    cloud.descriptors->further.resize(bytes);
    return testing::refusal(ErrorKind::kMisuse, [&] { cloud.validate("source"); });
  };
  EXPECT_EQ(message({0, 1, 1, 2}, 4), "");
  EXPECT_THAT(message({}, 4), HasSubstr("further descriptors without offsets"));
  EXPECT_THAT(message({0, 1, 1}, 2), HasSubstr("3 offsets of further descriptors of 3 landmarks"));
  EXPECT_THAT(message({1, 1, 1, 2}, 4), HasSubstr("ascending from 0"));
  EXPECT_THAT(message({0, 2, 1, 2}, 4), HasSubstr("ascending from 0"));
  EXPECT_THAT(message({0, 1, 1, 3}, 4), HasSubstr("ascending from 0"));
  EXPECT_THAT(message({0, 1, 1, 1}, 3), HasSubstr("ascending from 0"));
  EXPECT_THAT(message({0, 0, 1, 1}, 2), HasSubstr("1 further descriptors of landmark 1"));
  EXPECT_THAT(message({0, 16, 16, 16}, 32), HasSubstr("16 further descriptors of landmark 0"));
}

TEST(LandmarkCloud, RefusesWhatIsNoPositionAndNoCovariance) {
  LandmarkCloud good;
  good.positions.assign(3, Eigen::Vector3d(1e9, 0.0, 0.0));
  good.covariances.assign(3, Eigen::Matrix3d::Identity());
  good.covariances[1].setZero();  // unknown
  EXPECT_NO_THROW(good.validate("source"));
  const auto message = [&](const auto& change) {
    LandmarkCloud cloud = good;
    change(cloud);
    return testing::refusal(ErrorKind::kMisuse, [&] { cloud.validate("target"); });
  };
  EXPECT_THAT(message([](auto& cloud) { cloud.positions[2].z() = 1.1e9; }),
              HasSubstr("target: position of landmark 2 is beyond the limit"));
  EXPECT_THAT(message([](auto& cloud) { cloud.covariances[0](0, 1) = 0.5; }),
              HasSubstr("covariance of landmark 0 is not symmetric"));
  EXPECT_THAT(message([](auto& cloud) { cloud.covariances[2](1, 1) = -0.5; }),
              HasSubstr("covariance of landmark 2 is indefinite"));
  EXPECT_THAT(message([](auto& cloud) { cloud.covariances[2] *= 1.1e18; }),
              HasSubstr("covariance of landmark 2 is beyond the limit"));
  EXPECT_THAT(message([](auto& cloud) {
                cloud.views.push_back({{0, 1e10, 0}, {}});
              }),
              HasSubstr("centre of a view is beyond the limit"));
}

}  // namespace
}  // namespace cairn

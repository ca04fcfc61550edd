// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/placement/landmark_cloud.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace cairn

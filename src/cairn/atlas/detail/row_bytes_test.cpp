// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/detail/row_bytes.hpp"

#include <bit>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "support/atlas_state.hpp"

namespace cairn {
namespace {

// A number's bytes, in the order of the file.
std::string little_endian(double value) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(value);
  std::string bytes;
  for (int i = 0; i < 8; ++i) bytes += static_cast<char>((bits >> (8 * i)) & 0xff);
  return bytes;
}

std::string little_endian(const std::vector<double>& values) {
  std::string bytes;
  for (const double value : values) bytes += little_endian(value);
  return bytes;
}

TEST(RowBytes, PosesAndExtentsComeBackAsTheyWere) {
  const Similarity3 pose(2.5, Rigid3::from_roll_pitch_yaw({1.0, -2.0, 3.5}, 0.1, -0.7, 2.0));
  const std::string bytes = pose_bytes(pose);
  EXPECT_EQ(bytes.size(), 64U);
  EXPECT_EQ(bytes.substr(0, 8), little_endian(2.5));
  EXPECT_EQ(bytes.substr(8, 8), little_endian(pose.rigid().quaternion().w()));
  EXPECT_EQ(bytes.substr(40), little_endian({1.0, -2.0, 3.5}));
  const auto again = pose_of_bytes(bytes);
  ASSERT_TRUE(again);
  EXPECT_EQ(pose_bytes(*again), bytes);
  const NodeExtent extent{{1.0, -2.0, 3.0}, 4.0};
  EXPECT_EQ(extent_bytes(extent), little_endian({1.0, -2.0, 3.0, 4.0}));
  const auto same = extent_of_bytes(extent_bytes(extent));
  ASSERT_TRUE(same);
  EXPECT_EQ(same->centre, extent.centre);
  EXPECT_EQ(same->radius, 4.0);
}

TEST(RowBytes, WhatIsNoPoseIsRefused) {
  EXPECT_TRUE(pose_of_bytes(little_endian({1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0})));
  EXPECT_TRUE(pose_of_bytes(little_endian({1.0, 1.0 + 5e-7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0})));
  for (const double scale : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(pose_of_bytes(little_endian({scale, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}))) << scale;
  }
  for (const double w : {0.0, 1.0 + 3e-6, 1.0 - 3e-6, 2.0}) {
    EXPECT_FALSE(pose_of_bytes(little_endian({1.0, w, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}))) << w;
  }
  EXPECT_FALSE(pose_of_bytes(little_endian({1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0})));
  EXPECT_FALSE(pose_of_bytes(little_endian({1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0})));
  EXPECT_FALSE(pose_of_bytes({}));
  EXPECT_FALSE(extent_of_bytes(little_endian({0.0, 0.0, 0.0, 0.0})));
  EXPECT_FALSE(extent_of_bytes(little_endian({0.0, 0.0, 0.0, -1.0})));
  EXPECT_FALSE(extent_of_bytes(little_endian({0.0, 0.0, 1.0})));
}

TEST(RowBytes, WhatIsNoCovarianceIsRefused) {
  Matrix6d covariance = Matrix6d::Identity();
  covariance(0, 1) = covariance(1, 0) = 0.5;
  covariance(2, 2) = 3.0;
  const auto again = covariance6_of_bytes(covariance_bytes(covariance));
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, covariance);
  EXPECT_FALSE(covariance7_of_bytes(covariance_bytes(covariance))) << "of another size";
  Matrix7d with_scale = Matrix7d::Identity();
  with_scale(6, 0) = with_scale(0, 6) = -0.25;
  ASSERT_TRUE(covariance7_of_bytes(covariance_bytes(with_scale)));
  EXPECT_EQ(*covariance7_of_bytes(covariance_bytes(with_scale)), with_scale);
  EXPECT_TRUE(covariance6_of_bytes(covariance_bytes(Matrix6d(Matrix6d::Zero()))));

  // Rounding is allowed for, as a share of the largest entry.
  const auto with = [](int row, int column, double value) {
    Matrix6d changed = 1000.0 * Matrix6d::Identity();
    changed(row, column) = value;
    return covariance6_of_bytes(covariance_bytes(changed)).has_value();
  };
  EXPECT_TRUE(with(0, 1, 9e-4));
  EXPECT_FALSE(with(0, 1, 1.1e-3));
  EXPECT_FALSE(with(0, 1, -1.1e-3));
  EXPECT_TRUE(with(3, 3, -9e-4));
  EXPECT_FALSE(with(3, 3, -1.1e-3));
}

TEST(RowBytes, HexadecimalDigitsComeBack) {
  const std::string bytes("\x00\x0f\xf0\xff\x9a", 5);
  EXPECT_EQ(hexadecimal(bytes), "000ff0ff9a");
  EXPECT_EQ(bytes_of_hexadecimal("000ff0ff9a"), bytes);
  for (const char* const bad : {"0", "0g", "g0", "0A"})
    EXPECT_FALSE(bytes_of_hexadecimal(bad)) << bad;
  EXPECT_EQ(bytes_of_hexadecimal(""), std::string());
}

// Stores keep digests: they must not change from version to version.
TEST(RowBytes, DigestIsXxh3OfTheBytes) {
  EXPECT_EQ(hexadecimal(RowBytes().digest()), "99aa06d3014798d86001c324468d497f");
}

TEST(RowBytes, DigestsChangeWithEveryField) {
  const Link link = testing::link_of(1, 2, 3);
  std::set<std::string> digests = {digest_of(link, blobs_of(link))};
  std::size_t count = 1;
  const auto with = [&](auto change) {
    Link other = link;
    change(other);
    digests.insert(digest_of(other, blobs_of(other)));
    ++count;
  };
  with([](Link& l) { l.id = LinkId{9}; });
  with([](Link& l) { l.target = NodeId{9}; });
  with([](Link& l) { l.source = NodeId{9}; });
  with([](Link& l) { l.kind = LinkKind::kManual; });
  with([](Link& l) { l.verdict = Verdict::kAmbiguous; });
  with([](Link& l) { l.probability = 0.0; });
  with([](Link& l) { l.probability = 1.0; });
  with([](Link& l) { l.reason = "why"; });
  with([](Link& l) { l.target_from_source = Similarity3(); });
  with([](Link& l) { l.covariance = Matrix6d(Matrix6d::Zero()); });
  with([](Link& l) { l.covariance_with_scale = Matrix7d(Matrix7d::Zero()); });
  AtlasNode node = testing::node_of(1, "a");
  node.session = "b";
  node.map = "c";
  digests.insert(digest_of(node));
  ++count;
  const auto with_node = [&](auto change) {
    AtlasNode other = node;
    change(other);
    digests.insert(digest_of(other));
    ++count;
  };
  with_node([](AtlasNode& n) { n.id = NodeId{2}; });
  with_node([](AtlasNode& n) { n.name = "x"; });
  with_node([](AtlasNode& n) { n.session = "x"; });
  with_node([](AtlasNode& n) { n.map = "x"; });
  with_node([](AtlasNode& n) { n.length_unit = LengthUnit::kFree; });
  with_node([](AtlasNode& n) { n.frames = 1; });
  with_node([](AtlasNode& n) { n.landmarks = 1; });
  with_node([](AtlasNode& n) { n.observations = 1; });
  with_node([](AtlasNode& n) { n.extent.radius = 7.0; });
  with_node([](AtlasNode& n) { n.extent.centre.y() = 7.0; });
  AtlasPose pose = testing::pose_of(1, 2);
  const auto add_pose = [&](const AtlasPose& of, std::uint64_t row) {
    digests.insert(digest_of(of, row, blobs_of(of)));
    ++count;
  };
  add_pose(pose, 5);
  add_pose(pose, 6);
  for (AtlasPose other : {pose, pose, pose, pose}) {
    switch (count % 4) {
      case 0:
        other.node = NodeId{8};
        break;
      case 1:
        other.frame = NodeId{8};
        break;
      case 2:
        other.frame_from_node = Similarity3(2.0, Rigid3());
        break;
      default:
        other.covariance(3, 3) = 1.0;
    }
    add_pose(other, 5);
  }
  EXPECT_EQ(digests.size(), count);
}

TEST(AtlasPose, AreEqualUpToRounding) {
  AtlasPose pose = testing::pose_of(1, 2);
  pose.frame_from_node = Rigid3::from_roll_pitch_yaw({3.0, 2.0, 1.0}, 0.1, 0.2, 0.3);
  EXPECT_TRUE(pose == pose);
  pose.covariance = 1e-4 * Matrix7d::Identity();
  EXPECT_TRUE(pose == pose);
  const auto differs = [&](auto change) {
    AtlasPose other = pose;
    change(other);
    return !(pose == other);
  };
  EXPECT_TRUE(differs([](AtlasPose& p) { p.node = NodeId{2}; }));
  EXPECT_TRUE(differs([](AtlasPose& p) { p.frame = NodeId{1}; }));
  EXPECT_TRUE(differs([](AtlasPose& p) { p.covariance(2, 2) *= 1.0 + 4e-12; }));
  EXPECT_FALSE(differs([](AtlasPose& p) { p.covariance(2, 2) *= 1.0 + 2e-12; }));
  const auto shifted = [&](double by) {
    return differs([&](AtlasPose& p) {
      p.frame_from_node = Rigid3(p.frame_from_node.rigid().quaternion(),
                                 p.frame_from_node.translation() + Eigen::Vector3d(by, 0, 0));
    });
  };
  EXPECT_TRUE(shifted(6e-12));
  EXPECT_FALSE(shifted(3e-12));
}

}  // namespace
}  // namespace cairn

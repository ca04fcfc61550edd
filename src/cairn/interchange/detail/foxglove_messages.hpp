// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/io/point_columns.hpp"

// The messages of Foxglove (https://docs.foxglove.dev/docs/sdk/schemas) that maps are shown by, as Protocol
// Buffers: the fields that Cairn fills, with the names and numbers of the public schemas. Private to
// cairn/interchange.
namespace cairn::detail {

inline constexpr std::string_view kPointCloudSchema = "foxglove.PointCloud";
inline constexpr std::string_view kFrameTransformSchema = "foxglove.FrameTransform";
inline constexpr std::string_view kSceneUpdateSchema = "foxglove.SceneUpdate";

/// A FileDescriptorSet that describes all of them.
std::string foxglove_descriptors();

struct SceneColor {
  double r = 1.0, g = 1.0, b = 1.0, a = 1.0;  ///< from 0 to 1
};

/// How the points of a line connect; the numbers are those of the schema.
enum class LineType : std::uint8_t { kStrip = 0, kList = 2 };

/// A line, all of one colour.
struct SceneLine {
  LineType type = LineType::kStrip;
  double thickness_px = 1.0;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::uint32_t> indices = {};  ///< of points; empty: all in their order
  SceneColor color = {};
};

/// A text that faces whoever looks, a fixed size in pixels.
struct SceneText {
  Eigen::Vector3d position;
  std::string text;
};

/// Something to see, in one frame.
struct SceneEntity {
  std::string id;  ///< of a topic's entities those with the same id replace each other
  std::vector<std::pair<std::string, std::string>> metadata = {};
  std::vector<SceneLine> lines = {};
  std::vector<SceneText> texts = {};
};

/// @param data points one behind the other, each with `fields` in their order, without gaps
std::string point_cloud_message(std::uint64_t time_ns, std::string_view frame,
                                std::span<const PointField> fields, std::string_view data);

std::string frame_transform_message(std::uint64_t time_ns, std::string_view parent,
                                    std::string_view child, const Rigid3& parent_from_child);

std::string scene_update_message(std::uint64_t time_ns, std::string_view frame,
                                 std::span<const SceneEntity> entities);

}  // namespace cairn::detail

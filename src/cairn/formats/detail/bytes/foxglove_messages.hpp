// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/geometry/rigid3.hpp"

// Foxglove messages (https://docs.foxglove.dev/docs/sdk/schemas) that show maps, as Protocol Buffers: the
// fields that Cairn fills, with the names and numbers of the public schemas.
namespace cairn::detail {

inline constexpr std::string_view kPointCloudSchema = "foxglove.PointCloud";
inline constexpr std::string_view kFrameTransformSchema = "foxglove.FrameTransform";
inline constexpr std::string_view kSceneUpdateSchema = "foxglove.SceneUpdate";

/// A FileDescriptorSet that describes all these messages.
std::string foxglove_descriptors();

struct SceneColor {
  double r = 1.0, g = 1.0, b = 1.0, a = 1.0;  ///< from 0 to 1
};

/// How a line connects its points; values as in the schema.
enum class LineType : std::uint8_t { kStrip = 0, kList = 2 };

/// A line of one colour.
struct SceneLine {
  LineType type = LineType::kStrip;
  double thickness_px = 1.0;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::uint32_t> indices = {};  ///< into points; empty: all, in order
  SceneColor color = {};
};

/// A text that always faces the viewer, with a fixed size in pixels.
struct SceneText {
  Eigen::Vector3d position;
  std::string text;
};

/// A group of lines and texts in one frame.
struct SceneEntity {
  std::string id;  ///< an entity replaces earlier ones with the same id on its topic
  std::vector<std::pair<std::string, std::string>> metadata = {};
  std::vector<SceneLine> lines = {};
  std::vector<SceneText> texts = {};
};

/// @param data the points, each with its `fields` in order, without gaps
std::string point_cloud_message(std::uint64_t time_ns, std::string_view frame,
                                std::span<const PointField> fields, std::string_view data);

std::string frame_transform_message(std::uint64_t time_ns, std::string_view parent,
                                    std::string_view child, const Rigid3& parent_from_child);

std::string scene_update_message(std::uint64_t time_ns, std::string_view frame,
                                 std::span<const SceneEntity> entities);

}  // namespace cairn::detail

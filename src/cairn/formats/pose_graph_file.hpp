// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// A graph as JSON: schema cairn.pose_graph, version 1 (docs/formats.md).
std::string pose_graph_text(const PoseGraph& graph);

/// Whether a text is a pose graph in JSON, by its first kilobyte.
bool is_pose_graph_text(std::string_view beginning);

/// Reads a pose graph in JSON. Normalises quaternions, which may change their last digit; keeps all
/// other values.
/// @throws Error (input) naming source, the place in the document, value and constraint
PoseGraph read_pose_graph(ByteSource& source);

/// Content of a g2o file; reading and writing keeps all numbers.
struct G2oGraph {
  /// world_from_vertex; the quaternion as stored, (x, y, z, w), of norm within 1e-2 of 1.
  struct Vertex {
    std::uint64_t id = 0;
    std::array<double, 3> translation = {};
    std::array<double, 4> quaternion = {0.0, 0.0, 0.0, 1.0};

    friend bool operator==(const Vertex&, const Vertex&) = default;
  };
  /// from_from_to: x_in_from = from_from_to * x_in_to.
  struct Edge {
    std::uint64_t from = 0;
    std::uint64_t to = 0;
    std::array<double, 3> translation = {};
    std::array<double, 4> quaternion = {0.0, 0.0, 0.0, 1.0};
    /// Upper triangle, row by row, of g2o's information matrix. The matrix weights the translation
    /// and the vector part of the unit quaternion (w ≥ 0, half the angle) of measured⁻¹·estimated,
    /// in the frame of `to`.
    std::array<double, 21> information = {};

    friend bool operator==(const Edge&, const Edge&) = default;
  };

  std::vector<Vertex> vertices;
  std::vector<Edge> edges;
  std::vector<std::uint64_t> fixed;  ///< vertices that an optimiser must not move

  friend bool operator==(const G2oGraph&, const G2oGraph&) = default;
};

/// Whether a text is g2o, by its first non-comment line. Readers support only part of g2o.
bool is_g2o(std::string_view beginning);

/// Reads VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX, one per line; lines that start with '#' are comments.
/// @param log receives a loss remark if the last line has no line end
/// @throws Error (input) naming source, line, field, value and constraint
G2oGraph read_g2o(ByteSource& source, const LogSink& log = {});

/// Writes vertices, fixed vertices, then edges; numbers as the shortest decimals that parse back.
void write_g2o(const G2oGraph& graph, const ByteSink& sink);

/// Converts each edge to a link with target `from` and source `to`, of kind odometry if the ids are
/// consecutive, else placement. The link's covariance is known if the information is positive
/// definite.
PoseGraph pose_graph(const G2oGraph& graph);

/// The part of a graph that g2o can hold: no names, sessions, kinds or probabilities.
/// @throws Error (misuse) for a pose with a scale other than 1, or a link whose covariance is missing or
///        not positive definite
G2oGraph g2o_graph(const PoseGraph& graph);

/// Reads the nodes and links of an RTAB-Map database; in the library cairn::foreign_formats.
/// @throws Error (input) naming file, table, row, value and constraint
PoseGraph read_rtabmap_graph(const std::filesystem::path& path, const Execution& execution = {});

}  // namespace cairn

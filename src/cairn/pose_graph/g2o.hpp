// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/pose_graph/pose_graph.hpp"

namespace cairn {

/// What a g2o file says, number by number: written again, its numbers are the same.
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
    /// Upper triangle, row by row, of g2o's information matrix. It weighs the translation and the vector
    /// part of the unit quaternion, w ≥ 0, of measured⁻¹·estimated: half an angle, in the frame of `to`.
    std::array<double, 21> information = {};

    friend bool operator==(const Edge&, const Edge&) = default;
  };

  std::vector<Vertex> vertices;
  std::vector<Edge> edges;
  std::vector<std::uint64_t> fixed;  ///< vertices that an optimiser leaves where they are

  friend bool operator==(const G2oGraph&, const G2oGraph&) = default;
};

/// Reads VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX, one a line; lines that start with '#' are comments.
/// @throws Error (input) naming source, line, field, what was found and what was expected
G2oGraph read_g2o(ByteSource& source);

/// Writes vertices, what is fixed, then edges; numbers as the shortest decimals that parse back.
void write_g2o(const G2oGraph& graph, const ByteSink& sink);

/// An edge becomes a link with target `from` and source `to`, of kind odometry where the ids are
/// neighbours and else placement. A covariance is known where the information is positive definite.
PoseGraph pose_graph(const G2oGraph& graph);

/// What g2o holds of a graph: not names, sessions, kinds and probabilities.
/// @throws Error (misuse) for a pose of a scale other than 1, a link without a covariance, or one that is
///         not positive definite
G2oGraph g2o_graph(const PoseGraph& graph);

}  // namespace cairn

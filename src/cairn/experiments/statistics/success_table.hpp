// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "cairn/experiments/statistics/proportion.hpp"

/// Basins of convergence: how often an alignment succeeds, by how far off it began.
namespace cairn {

/// An alignment from a displaced start.
struct DisplacedTrial {
  double rotation = 0.0;     ///< offset of the start; radians
  double translation = 0.0;  ///< the same; the maps' unit of length
  bool success = false;
};

/// Trials with offsets in [low, high), the last bin's in [low, high].
struct SuccessBin {
  double low = 0.0;
  double high = 0.0;
  Proportion rate;
};

/// Success rates by both offsets.
struct SuccessTable {
  std::vector<double> rotation_edges;     ///< ascending; one more than rows
  std::vector<double> translation_edges;  ///< ascending; one more than columns
  std::vector<Proportion> cells;          ///< row after row
  std::size_t outside = 0;                ///< trials beyond the edges, in no cell

  std::size_t rows() const { return rotation_edges.size() - 1; }
  std::size_t columns() const { return translation_edges.size() - 1; }
  const Proportion& at(std::size_t row, std::size_t column) const {
    return cells[row * columns() + column];
  }
};

/// Counts and Wilson's intervals per cell. Cells hold their lower edges, the last also their upper.
/// @param trials offsets finite
/// @param rotation_edges,translation_edges at least two each, ascending
/// @throws Error (misuse)
SuccessTable success_table(std::span<const DisplacedTrial> trials,
                           std::span<const double> rotation_edges,
                           std::span<const double> translation_edges, double confidence = 0.95);

/// The same by one offset. Trials beyond the edges count nowhere.
/// @param offsets finite; as many as successes
/// @throws Error (misuse)
std::vector<SuccessBin> success_bins(std::span<const double> offsets,
                                     const std::vector<bool>& success,
                                     std::span<const double> edges, double confidence = 0.95);

/// What of a bin has to reach the level.
enum class RadiusCriterion {
  kRate,        ///< its success rate
  kLowerBound,  ///< the lower end of its interval: success is that likely up to sampling error
};

/// How far off an alignment may begin so that it still succeeds often enough: the upper edge of the
/// last bin up to which all bins, from the first, reach the level. A bin without trials ends it.
/// @param bins as of success_bins()
/// @param level within [0, 1]
/// @return std::nullopt if the first bin falls short
/// @throws Error (misuse)
std::optional<double> convergence_radius(std::span<const SuccessBin> bins, double level,
                                         RadiusCriterion criterion = RadiusCriterion::kRate);

/// The trials within a radius.
struct SuccessRadius {
  double radius = 0.0;
  Proportion rate;  ///< of all trials with offsets up to the radius
};

/// The largest offset such that of all trials from no further off at least that share succeeded. Needs
/// no bins, but averages: trials near the border may fail more often than the level allows, which
/// convergence_radius() tells. The radius is an offset that occurs; trials with equal offsets are in or
/// out together.
/// @param offsets finite, at least 0; as many as successes
/// @param level within [0, 1]
/// @return std::nullopt if no radius has it
/// @throws Error (misuse)
std::optional<SuccessRadius> success_radius(std::span<const double> offsets,
                                            const std::vector<bool>& success, double level,
                                            double confidence = 0.95);

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "cairn/alignment/align.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn::cli {

/// How a pair was aligned: a hint names only options that would change something.
struct HintOptions {
  PointSetOptions points;
  double min_probability = 0.99;
  bool by_icp = false;
  bool has_initial = false;
  bool with_scale = false;
  bool by_parts = false;
};

/// Lines that say what to do about a pose that is not aligned, or was not found: at least one for each way in which
/// align() refuses.
std::string hints(const Alignment& alignment, const LandmarkMap& source, const LandmarkMap& target,
                  const HintOptions& options);

}  // namespace cairn::cli

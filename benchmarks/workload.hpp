// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "cairn/registration/icp.hpp"
#include "cairn/registration/point_set.hpp"

namespace cairn::benchmarks {

/// What all benchmarks align: a map, and the same landmarks measured again with noise drawn from
/// each one's covariance, displaced by y 1 m, z 0.4 m, roll 10 degrees, yaw 22.5 degrees. Positions
/// are rounded to single precision, so that peers that hold no more see the same numbers.
struct Workload {
  PointSet source;
  PointSet target;
  IcpOptions options;
};

/// The landmarks of the real map in the folder that CAIRN_DATA names, confidences by number of
/// observations; without CAIRN_DATA, a synthetic map of the same size.
const Workload& workload();

/// The same of a synthetic map of that many landmarks, on the surfaces of one desk.
const Workload& workload(std::size_t landmarks);

/// Uniform points, for sizes no map at hand has.
PointSet random_points(std::size_t count, std::uint64_t seed);

}  // namespace cairn::benchmarks

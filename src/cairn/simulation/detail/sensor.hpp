// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/simulation/detail/renderer.hpp"
#include "cairn/simulation/simulator.hpp"

namespace cairn::detail {

/// The colour image, 8-bit blue, green, red.
/// @param stream of the random numbers: the same stream gives the same noise
std::vector<std::uint8_t> expose(const RenderedFrame& frame, const SensorOptions& options,
                                 std::uint64_t stream, const Executor& executor = Executor());

/// The depth image, metres, 0 if there is no reading.
/// @param focal_length_px horizontal focal length of the camera; determines the width of the
///        projector's shadows
std::vector<float> measure_depth(const RenderedFrame& frame, double focal_length_px,
                                 const SensorOptions& options, std::uint64_t stream,
                                 const Executor& executor = Executor());

}  // namespace cairn::detail

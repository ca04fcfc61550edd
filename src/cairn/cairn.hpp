// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Includes the headers for reading maps, aligning them and comparing the pose with the ground truth.
/// Link the CMake target cairn::cairn. docs/which_call.md lists all other headers.

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/alignment.hpp"
#include "cairn/confidence/metric.hpp"
#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/icp.hpp"

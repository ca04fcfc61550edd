// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// What a program needs that reads maps, aligns them and compares the pose with a truth: the target cairn::cairn. Every
/// other header is named in docs/which_call.md.

#include "cairn/alignment/align.hpp"
#include "cairn/alignment/alignment.hpp"
#include "cairn/confidence/metric.hpp"
#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/registration/icp.hpp"

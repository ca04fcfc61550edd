// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/file.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Transforms a point cloud or mesh in PLY that belongs to a map: positions, normals and
/// covariances (cov_xx ... cov_zz) of the vertices. All other content is copied byte for byte.
/// @param source ascii, binary little- or big-endian; the result has the same form
/// @throws Error (input) naming source, line or byte: not PLY, truncated, without x, y and z, or with
///        Gaussian splats that are turned or scaled, for their spherical harmonics would not follow
void move_ply(ByteSource& source, const Similarity3& new_from_old, const ByteSink& sink);

}  // namespace cairn

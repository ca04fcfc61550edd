// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cairn/core/file.hpp"
#include "cairn/geometry/similarity3.hpp"

namespace cairn {

/// Moves a point cloud or mesh in PLY that belongs to a map: positions, normals (nx ny nz) and covariances
/// (cov_xx ... cov_zz) of the vertices. Faces, colours and everything else stay as they are, byte for byte.
/// @param source ascii, binary little- or big-endian; the result is in the same form
/// @throws Error (input) naming source, line or byte: no PLY, cut short, without x, y and z, or of Gaussian
///         splats, whose spherical harmonics would not follow
void move_ply(ByteSource& source, const Similarity3& new_from_old, const ByteSink& sink);

}  // namespace cairn

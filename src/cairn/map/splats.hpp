// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// Highest degree of the spherical harmonics of splats.
inline constexpr int kMostSplatDegree = 4;

/// Gaussian splats are landmarks with the named columns of 3D Gaussian Splatting (Kerbl et al. 2023). Members are
/// indices among the names of the columns. Each splat is a Gaussian: its covariance is R·diag(exp(scale))²·Rᵀ.
struct SplatColumns {
  std::array<std::size_t, 4>
      rotation{};  ///< rot_0 to rot_3: R as a quaternion (w, x, y, z) of any length
  std::vector<std::size_t> log_scales;  ///< scale_0 to scale_2; without the last of flat splats
  std::size_t opacity = 0;              ///< its logit
  std::optional<std::array<std::size_t, 3>>
      base_color;  ///< f_dc_0 to f_dc_2; absent if the colour is not a harmonic
  std::vector<std::size_t>
      harmonics;  ///< f_rest_0 ...: degrees 1 to `degree` of red, then of green, then of blue
  int degree = 0;

  /// The indices of all members.
  std::vector<std::size_t> all() const;
};

/// The columns of splats among the names, in upper or lower case, if there are any. std::nullopt if some are missing,
/// or if there are harmonics of no whole degree or of more than kMostSplatDegree.
std::optional<SplatColumns> splat_columns(std::span<const std::string_view> names);
std::optional<SplatColumns> splat_columns(std::span<const NamedColumn> columns);

/// Whether some of the names are those of splats, perhaps without the others.
bool has_splat_names(std::span<const std::string_view> names);

/// Name of a column without case and underscores: "Normal_X" is "normalx".
std::string plain_column_name(std::string_view name);

/// Values or coefficients of real spherical harmonics, degrees 1 to kMostSplatDegree, in the order and with the signs that splats
/// have: m from -l to l, with the phase of Condon and Shortley.
using Harmonics = Eigen::Matrix<double, (kMostSplatDegree + 1) * (kMostSplatDegree + 1) - 1, 1>;

/// @param direction of length 1
Harmonics harmonics_towards(const Eigen::Vector3d& direction);

/// Matrices that rotate coefficients of spherical harmonics by a rotation R, one for each degree from 1: the
/// coefficients c' = D·c give the colour in direction R·d that c gives in direction d. They are orthogonal.
using HarmonicsRotation = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0,
                                        2 * kMostSplatDegree + 1, 2 * kMostSplatDegree + 1>;
std::vector<HarmonicsRotation> harmonics_rotation(int degree, const Eigen::Matrix3d& rotation);

/// Sets the covariances of splats, and their colours if these are harmonics, from the columns. A covariance that is not
/// finite or too large is unknown.
void set_splat_looks(const SplatColumns& columns, LandmarkTable& landmarks);

/// Opacity of each splat, 0 to 1; 0 if unknown.
std::vector<double> splat_opacities(const SplatColumns& columns, const LandmarkTable& landmarks);

}  // namespace cairn

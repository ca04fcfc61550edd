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

/// Columns of Gaussian splats: landmarks with the named columns of 3D Gaussian Splatting (Kerbl et
/// al. 2023). Members are column indices. Each splat is a Gaussian with covariance
/// R·diag(exp(scale))²·Rᵀ.
struct SplatColumns {
  std::array<std::size_t, 4>
      rotation{};  ///< rot_0 to rot_3: R as a quaternion (w, x, y, z) of any length
  std::vector<std::size_t> log_scales;  ///< scale_0 to scale_2; flat splats lack scale_2
  std::size_t opacity = 0;              ///< logit of the opacity
  std::optional<std::array<std::size_t, 3>>
      base_color;  ///< f_dc_0 to f_dc_2; absent if the colour is not a harmonic
  std::vector<std::size_t>
      harmonics;  ///< f_rest_0 ...: degrees 1 to `degree` of red, then of green, then of blue
  int degree = 0;

  /// The indices of all members.
  std::vector<std::size_t> all() const;
};

/// The splat columns among the names, in upper or lower case. std::nullopt if a column is missing,
/// or if the harmonics fill no complete degree or exceed kMostSplatDegree.
std::optional<SplatColumns> splat_columns(std::span<const std::string_view> names);
std::optional<SplatColumns> splat_columns(std::span<const NamedColumn> columns);

/// Whether the names include splat columns, possibly an incomplete set.
bool has_splat_names(std::span<const std::string_view> names);

/// Column name in lower case without underscores: "Normal_X" becomes "normalx".
std::string plain_column_name(std::string_view name);

/// Values or coefficients of real spherical harmonics, degrees 1 to kMostSplatDegree, in the order
/// and with the signs of splats: m from -l to l, with the Condon-Shortley phase.
using Harmonics = Eigen::Matrix<double, (kMostSplatDegree + 1) * (kMostSplatDegree + 1) - 1, 1>;

/// @param direction unit vector
Harmonics harmonics_towards(const Eigen::Vector3d& direction);

/// Orthogonal matrices D that rotate spherical harmonic coefficients by a rotation R, one per
/// degree from 1: c' = D·c gives in direction R·d the colour that c gives in direction d.
using HarmonicsRotation = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0,
                                        2 * kMostSplatDegree + 1, 2 * kMostSplatDegree + 1>;
std::vector<HarmonicsRotation> harmonics_rotation(int degree, const Eigen::Matrix3d& rotation);

/// Sets the splats' covariances from the columns, and their colours if base_color is present. A
/// covariance that is not finite or too large becomes unknown.
void set_splat_looks(const SplatColumns& columns, LandmarkTable& landmarks);

/// Opacity of each splat, 0 to 1; 0 if unknown.
std::vector<double> splat_opacities(const SplatColumns& columns, const LandmarkTable& landmarks);

}  // namespace cairn

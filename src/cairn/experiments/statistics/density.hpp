// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

/// Distributions as pictures show them: densities (violin plots) and boxes.
namespace cairn {

/// Rules for the width of the kernel, with A = min(standard deviation, interquartile range / 1.34).
enum class BandwidthRule {
  kSilverman,  ///< 0.9·A·n^(-1/5): Silverman, "Density Estimation", 1986, equation 3.31; R's bw.nrd0
  kScott,      ///< 1.06·A·n^(-1/5): Scott, "Multivariate Density Estimation", 1992; R's bw.nrd
};

/// Standard deviation of the Gaussian kernel that the rule chooses. If half of the values are equal,
/// so that the quartiles are, the standard deviation alone stands for A.
/// @param values finite
/// @return std::nullopt for fewer than two values, or if all are equal
/// @throws Error (misuse)
std::optional<double> kernel_bandwidth(std::span<const double> values,
                                       BandwidthRule rule = BandwidthRule::kSilverman);

struct DensityOptions {
  BandwidthRule rule = BandwidthRule::kSilverman;
  std::optional<double> bandwidth =
      std::nullopt;          ///< instead of the rule; positive, the values' unit
  std::size_t points = 256;  ///< at least 2, evenly spaced
  double reach =
      3.0;  ///< how far beyond the values, in bandwidths; 0 cuts at their range, where the
            ///< density then ends abruptly and its integral falls short of 1; at least 0

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// A density on evenly spaced positions.
struct Density {
  double bandwidth = 0.0;
  std::vector<double> positions;  ///< ascending
  std::vector<double> densities;  ///< per unit of the values
};

/// Kernel density estimate with a Gaussian kernel, computed directly: points times values.
/// @param values finite
/// @return std::nullopt if there is no bandwidth: too few values, or all equal, and none given
/// @throws Error (misuse)
std::optional<Density> kernel_density(std::span<const double> values,
                                      const DensityOptions& options = {});

/// The five numbers of a box plot after Tukey, "Exploratory Data Analysis", 1977, and what lies
/// outside. Quartiles are those of quantile() (type 7 of Hyndman and Fan, The American Statistician 50,
/// 361-365, 1996; R's and numpy's default), not Tukey's hinges, which R's boxplot() takes.
struct BoxSummary {
  std::size_t count = 0;
  double lowest = 0.0;
  double lower_quartile = 0.0;
  double median = 0.0;
  double upper_quartile = 0.0;
  double highest = 0.0;
  double lower_whisker =
      0.0;  ///< lowest value within 1.5 interquartile ranges of the lower quartile
  double upper_whisker = 0.0;    ///< highest within as much of the upper
  std::vector<double> outliers;  ///< beyond the whiskers, ascending
};

/// @param values finite
/// @return std::nullopt for no values
/// @throws Error (misuse)
std::optional<BoxSummary> box_summary(std::span<const double> values);

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "cairn/geometry/covariance.hpp"
#include "cairn/vision/detail/image_pose.hpp"
#include "cairn/vision/image_locator.hpp"

namespace cairn::detail {

/// Share of the probability of the best pose that another pose must have to count.
inline constexpr double kWorthCounting = 0.05;

/// Log-odds and probability that a pose is right, by its matches (docs/evidence.md).
double log_odds(const PoseEvidence& pose);
double probability_of(const PoseEvidence& pose);

/// How well right matches determine the pose.
struct Certainty {
  double probability = 0.0;  ///< of a right pose
  std::string text;
};

/// @param covariance in the unit in which limits in metres are valid; std::nullopt if unknown
/// @param distance   of what the image shows
/// @param scale      factor of the map's lengths
Certainty certainty_of(const std::optional<Matrix6d>& covariance, double distance, double scale,
                       std::string_view unit);

/// A result by the matches alone, what to say of them, and how well they determine the pose.
struct Judged {
  ImageLocation result;
  std::string found;
  bool has_rival = false;
  Certainty certainty;
};

/// Judges the matches of the pose with most evidence.
/// @param next  another pose; null if there is none
/// @param image what the text calls the image that contradicts
/// @param blank the result without a pose
Judged judged_by_matches(const PoseEvidence& best, const PoseEvidence* next, double min_probability,
                         std::string_view image, ImageLocation blank);

/// The result, if nothing but an uncertain pose can take it back.
ImageLocation with_certainty(Judged judged, double min_probability);

}  // namespace cairn::detail

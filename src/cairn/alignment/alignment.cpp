// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/alignment/alignment.hpp"

#include <cmath>

#include <fmt/format.h>

#include "cairn/geometry/covariance.hpp"

namespace cairn {

Likeness& Likeness::operator+=(const Likeness& other) {
  compared += other.compared;
  alike += other.alike;
  return *this;
}

Likeness Likeness::operator-(const Likeness& other) const {
  return {compared - other.compared, alike - other.alike};
}

double Likeness::evidence() const {
  const auto all = static_cast<double>(compared);
  const auto like = static_cast<double>(alike);
  if (like <= kChance * all) return 0.0;
  const double unlike = all - like;
  // Where all are alike, 0·log 0 is 0.
  const double by_others = unlike > 0.0 ? unlike * std::log(unlike / (all * (1.0 - kChance))) : 0.0;
  return like * std::log(like / (all * kChance)) + by_others;
}

double DescriptorAgreement::evidence() const {
  // Lower bound, because chance agreements are counted on a finite number of pairs.
  constexpr double kLeastExpected = 0.25;
  const double mean = expected > kLeastExpected ? expected : kLeastExpected;
  const auto count = static_cast<double>(spread);
  if (count <= mean) return 0.0;
  return count * std::log(count / mean) - (count - mean);
}

SightCounts& SightCounts::operator+=(const SightCounts& other) {
  agree += other.agree;
  in_front += other.in_front;
  behind += other.behind;
  return *this;
}

std::string_view to_string(MapRole role) {
  return role == MapRole::kSource ? "source" : "target";
}

std::optional<PoseDeviations> deviations_of(const Alignment& alignment) {
  const RegistrationResult& result = alignment.registration;
  if (!result.covariance || !alignment.estimate) return std::nullopt;
  const Eigen::Vector3d arm =
      alignment.estimate->linear() * alignment.centre.value_or(Eigen::Vector3d::Zero());
  Matrix7d covariance = Matrix7d::Zero();
  covariance.topLeftCorner<6, 6>() = *result.covariance;
  if (result.covariance_with_scale) covariance = *result.covariance_with_scale;
  const Vector7d deviations = covariance_at_point(covariance, arm).diagonal().cwiseSqrt();
  PoseDeviations named{.translation = deviations.head<3>(),
                       .rotation_rad = deviations.segment<3>(3)};
  if (result.covariance_with_scale) named.log_scale = deviations[6];
  return named;
}

std::string_view status_of(const Alignment& alignment) {
  return alignment.verdict ? to_string(*alignment.verdict)
                           : to_string(alignment.registration.status);
}

std::string probability_text(double probability) {
  if (probability < 0.0001) return "<0.01 %";
  if (probability > 0.999999) return ">99.9999 %";
  const int digits = probability < 0.9999 ? 2 : 4;
  const double units = std::pow(10.0, digits);
  constexpr double kRounding = 1e-6;  // 0.9983 is stored as a little less
  return fmt::format("{:.{}f} %", std::floor(100.0 * units * probability + kRounding) / units,
                     digits);
}

std::string decision_text(double probability, double required) {
  return fmt::format("probability {}, {} the required {:g} %", probability_text(probability),
                     probability < required ? "below" : "at least", 100.0 * required);
}

}  // namespace cairn

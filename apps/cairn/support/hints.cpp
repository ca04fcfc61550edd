// SPDX-License-Identifier: BSD-3-Clause
#include "support/hints.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/statistics.hpp"
#include "cairn/map/splats.hpp"

namespace cairn::cli {
namespace {

constexpr std::size_t kFewLandmarks = 20;  // the search takes no fewer
constexpr double kLittleOverlap = 0.4;
constexpr double kOtherUnit = 8.0;      // no two maps of one place differ by so much in extent
constexpr double kLargestScale = 20.0;  // that --scale finds

double extent_of(const LandmarkMap& map) {
  const std::vector<Eigen::Vector3d>& positions = map.landmarks().positions;
  if (positions.empty()) return 0.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& position : positions) centre += position;
  centre /= static_cast<double>(positions.size());
  std::vector<double> distances;
  for (const Eigen::Vector3d& position : positions) distances.push_back((position - centre).norm());
  return upper_median(distances);
}

class Hints {
 public:
  Hints(const Alignment& alignment, const LandmarkMap& source, const LandmarkMap& target,
        const AlignOptions& options, bool with_scale)
      : alignment_(alignment),
        source_(source),
        target_(target),
        options_(options),
        with_scale_(with_scale) {
    about_units();
    if (about_landmarks()) return;
    if (!alignment_.candidates.empty() && is_other_likelier()) {
      add(fmt::format("Align without {}: the search found a likelier pose, the first one above.",
                      given_start()));
      return;
    }
    if (alignment_.candidates.empty()) {
      about_no_match();
    } else {
      about_verdict();
    }
    about_evidence();
  }

  std::string text() const { return text_; }

 private:
  void add(const std::string& hint) { text_ += hint_line(hint); }

  double probability() const { return alignment_.probability.value_or(0.0); }
  bool is_improbable() const { return probability() < options_.min_probability; }
  bool is_free() const {
    return source_.info().length_unit == LengthUnit::kFree ||
           target_.info().length_unit == LengthUnit::kFree;
  }
  bool is_open() const { return !alignment_.registration.unobservable.empty(); }
  bool is_other_likelier() const {
    return alignment_.candidates.front().probability > probability();
  }
  std::string given_start() const {
    if (!(options_.method == AlignMethod::kIcp)) return "--initial";
    return options_.prior ? "--initial and the options of icp" : "the options of icp";
  }

  void about_units() {
    if (alignment_.other_scale) {
      add(fmt::format(
          "Check the units, e.g. --depth-units of cairn map: the descriptors agree on a "
          "pose that scales the source by {:.3g}. Add --scale if the scales differ.",
          *alignment_.other_scale));
      return;
    }
    const double ratio = extent_of(source_) / extent_of(target_);
    const double factor = std::max(ratio, 1.0 / ratio);
    if (std::isfinite(factor) && factor > kOtherUnit) {
      std::string text = fmt::format(
          "Check the units: the source's landmarks extend {:.3g} times as far as the target's.",
          ratio);
      if (factor > kLargestScale) {
        text += fmt::format(
            " With --scale, scales from 1/{0:g} to {0:g} are searched. If the units differ by "
            "more, scale the "
            "source first: cairn convert SOURCE SCALED --apply FILE, where FILE has the 16 numbers "
            "of a 4x4 matrix.",
            kLargestScale);
      } else if (!with_scale_) {
        text += " Add --scale if the scales differ.";
      }
      add(text);
    }
    if (is_free() && !with_scale_) {
      add(fmt::format(
          "Align without {} to find the scale, which is unknown for a map of free "
          "scale.",
          (options_.method == AlignMethod::kIcp) ? "the options of icp" : "--no-scale"));
    }
  }

  // Whether too few landmarks take part.
  bool about_landmarks() {
    if (!alignment_.candidates.empty()) return false;
    bool few = false;
    for (const auto& [role, map] : {std::pair{"source", &source_}, {"target", &target_}}) {
      const std::size_t kept = landmarks_to_align(*map, options_.points).size();
      if (kept >= kFewLandmarks) continue;
      few = true;
      const std::size_t left_out = map->landmark_count() - kept;
      if (splat_columns(map->landmarks().columns)) {
        add(
            fmt::format("Use a {} with more opaque and small splats: {} of {} serve as landmarks; "
                        "'cairn info' says why.",
                        role, kept, map->landmark_count()));
      } else if (map->landmark_count() >= kFewLandmarks) {
        add(
            fmt::format("Lower --min-observations, now {}: it leaves out {} of the {}'s {} "
                        "landmarks.",
                        options_.points.min_observations, left_out, role, map->landmark_count()));
      } else {
        add(fmt::format("Use a {} map with at least {} landmarks: it has {}.", role, kFewLandmarks,
                        map->landmark_count()));
      }
    }
    return few;
  }

  void about_no_match() {
    if (alignment_.verdict) {
      add("Check that both maps show the same place.");
    } else {
      add(
          fmt::format("Align without {}, or give a closer initial pose: too few landmarks match "
                      "from this one.",
                      given_start()));
    }
  }

  void about_verdict() {
    const bool ambiguous = alignment_.verdict == Verdict::kAmbiguous;
    bool said = false;
    if (ambiguous && alignment_.deformation) {
      said = true;
      add("Map both with a calibration that includes the distortion: no single pose fits maps "
          "that are deformed like these.");
    }
    if (const auto& parts = alignment_.parts;
        ambiguous && parts && (parts->contradictory || (parts->consensus && !parts->confirmed))) {
      said = true;
      add(fmt::format("{}: a map may be bent, or a part of it misplaced.",
                      (options_.parts == PartsUse::kAlways)
                          ? "Compare the poses of the parts above"
                          : "Add --by-parts to see the pose of each part"));
    }
    if (is_open() && probability() >= kLeastRequired) {
      said = true;
      add("Use maps that overlap in more than a plane or a line; then the matches determine every "
          "direction.");
    }
    if (said) return;
    if (!is_improbable() && (options_.method == AlignMethod::kIcp) &&
        !alignment_.registration.covariance) {
      add("Align without the options of icp, or refine this pose with --initial: ICP stopped "
          "beside "
          "the best pose.");
      return;
    }
    if (!is_improbable()) {
      add(alignment_.registration.covariance
              ? "Map more of what only this place has: one object may stand in two places, and two "
                "places may be built alike."
              : "Use maps that overlap in more places: a covariance takes matches in several.");
      return;
    }
    const auto& overlap = alignment_.registration.overlap;
    const std::string shares =
        overlap && std::min(overlap->source, overlap->target) < kLittleOverlap
            ? fmt::format(
                  ": at the best pose, only {:.0f} % of the source and {:.0f} % of the "
                  "target overlap",
                  100.0 * overlap->source, 100.0 * overlap->target)
            : "";
    if (!ambiguous) {
      add("Check that both maps show the same place" + shares + ".");
      about_scale();
    } else {
      add("Map what tells the poses apart, as in a symmetric or repetitive place" + shares + ".");
    }
  }

  // Without descriptors, nothing shows that the scales differ.
  void about_scale() {
    if (is_free() || with_scale_ || options_.method == AlignMethod::kIcp) return;
    if (alignment_.candidates.front().support.agreement) return;
    add("Add --scale if one map may be in another unit, such as feet, or its scale a few percent "
        "off.");
  }

  // What would have made a pose more probable.
  void about_evidence() {
    if (!is_improbable()) return;
    const auto& candidates = alignment_.candidates;
    const bool are_splats =
        splat_columns(source_.landmarks().columns) && splat_columns(target_.landmarks().columns);
    if (are_splats) {
      add("Add --models with the COLMAP models that the splats were trained on, which have "
          "cameras, "
          "and descriptors if their database.db is beside them.");
    } else if (!candidates.empty() && !candidates.front().support.agreement) {
      add("Use maps that both have descriptors of one kind, which tell similar places apart; cairn "
          "map stores them.");
    }
    for (const auto& [role, map] : {std::pair{"source", &source_}, {"target", &target_}}) {
      if (are_splats || map->has_observations()) continue;
      add(fmt::format("Use a {} map with observations, which allow the free-space check.", role));
    }
    if (!is_open() && alignment_.registration.covariance && probability() >= kLeastRequired) {
      add(accepted_risk_hint(probability()));
    }
  }

  const Alignment& alignment_;
  const LandmarkMap& source_;
  const LandmarkMap& target_;
  const AlignOptions& options_;
  bool with_scale_;
  std::string text_;
};

}  // namespace

std::string hint_line(const std::string& hint) {
  return "  hint: " + hint + "\n";
}

std::string accepted_risk_hint(double probability) {
  return fmt::format(
      "Lower --min-probability to {:.2f} if a risk of {:.0f} % that the pose is wrong is "
      "acceptable.",
      std::floor(100.0 * probability) / 100.0, std::ceil(100.0 * (1.0 - probability)));
}

std::string hints(const Alignment& alignment, const LandmarkMap& source, const LandmarkMap& target,
                  const AlignOptions& options, bool with_scale) {
  return Hints(alignment, source, target, options, with_scale).text();
}

}  // namespace cairn::cli

// SPDX-License-Identifier: BSD-3-Clause
#include "support/alignments.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/core/error.hpp"

#include "support/console.hpp"

namespace cairn::cli {
namespace {

std::string number(std::optional<double> value, int digits) {
  return value ? fmt::format("{:.{}g}", *value, digits) : "-";
}

// "x 0.100 y ..., roll ... deg", with so many digits.
std::string pose_text(const Rigid3& pose, LengthUnit unit, int digits, int angle_digits) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Vector3d angles = pose.roll_pitch_yaw();
  return fmt::format(
      "x {} y {} z {} {}, roll {} pitch {} yaw {} deg", fixed(t.x(), digits), fixed(t.y(), digits),
      fixed(t.z(), digits), unit_symbol(unit), fixed(degrees(angles.x()), angle_digits),
      fixed(degrees(angles.y()), angle_digits), fixed(degrees(angles.z()), angle_digits));
}

// A vector's numbers with blanks between.
template <class Vector>
std::string numbers_text(const Vector& vector, int digits) {
  std::string text;
  for (Eigen::Index i = 0; i < vector.size(); ++i) {
    text += (i > 0 ? " " : "") + fixed(vector[i], digits);
  }
  return text;
}

// The trusted pose, or one that was not judged, in full.
std::string answer_text(const Alignment& alignment, LengthUnit unit, bool with_scale) {
  const Similarity3& pose = *alignment.estimate;
  std::string text = fmt::format("  target_from_source: {}\n", pose_text(pose.rigid(), unit, 5, 3));
  const Matrix4d matrix = pose.matrix();
  for (int row = 0; row < 4; ++row) {
    text += fmt::format("    {:>13.9f} {:>13.9f} {:>13.9f} {:>14.9f}\n", matrix(row, 0),
                        matrix(row, 1), matrix(row, 2), matrix(row, 3));
  }
  const Eigen::Quaterniond q = shown_quaternion(pose.rigid());
  text += fmt::format("  quaternion (qw qx qy qz): {}\n",
                      numbers_text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()), 9));
  if (with_scale) text += fmt::format("  scale of the source: {:.6g}\n", pose.scale());
  if (const auto deviations = deviations_of(alignment)) {
    text += fmt::format(
        "  standard deviation at the source's centre: x y z {} {},\n    rotation about x y z {} "
        "deg",
        numbers_text(deviations->translation, 5), unit_symbol(unit),
        numbers_text(Eigen::Vector3d(deviations->rotation_rad * degrees(1.0)), 4));
    if (deviations->log_scale) {
      text += fmt::format(", scale {} %", fixed(100.0 * *deviations->log_scale, 3));
    }
    text += "\n";
  }
  return text;
}

// "moving along (0.00 1.00 0.00)": a motion that the matches leave open, in the target's frame.
std::string direction_text(const OpenDirection& open) {
  std::string text;
  const auto add = [&](const char* what, const Eigen::Vector3d& axis) {
    if (axis.norm() < 1e-6) return;
    text += fmt::format("{}{} ({})", text.empty() ? "" : " with ", what,
                        numbers_text(Eigen::Vector3d(axis.normalized()), 2));
  };
  // The rotation is a length shorter than the translation: what it amounts to at the landmarks counts.
  add("moving along", open.translation);
  add("turning about", open.rotation);
  if (std::abs(open.log_scale) > 1e-6) text += text.empty() ? "scaling" : " with scaling";
  return text;
}

std::string open_directions_text(const Alignment& alignment, bool with_scale) {
  const auto& open = alignment.registration.unobservable;
  if (open.empty()) return {};
  std::string text =
      fmt::format("  {} of the pose's {} directions are not determined by the matches:\n",
                  open.size(), with_scale ? 7 : 6);
  for (const OpenDirection& direction : open) text += "    " + direction_text(direction) + "\n";
  return text;
}

std::string candidates_text(const Alignment& alignment, LengthUnit unit, bool trusted) {
  constexpr std::size_t kShown = 3;
  const auto& candidates = alignment.candidates;
  std::string text;
  for (std::size_t i = trusted ? 1 : 0; i < std::min(kShown, candidates.size()); ++i) {
    text += fmt::format("  {}, {}: {}\n", trusted ? "other candidate" : "not trusted",
                        probability_text(candidates[i].probability),
                        pose_text(candidates[i].target_from_source, unit, 3, 2));
  }
  return text;
}

// A line for each part.
std::string parts_text(const PartsAlignment& parts, LengthUnit unit) {
  std::string text = fmt::format("  parts: {} of {} aligned separately; they {}\n", parts.aligned,
                                 parts.parts.size(),
                                 parts.consensus       ? "agree up to a bend"
                                 : parts.contradictory ? "contradict each other"
                                                       : "are too few to agree");
  for (const PartPose& part : parts.parts) {
    text += fmt::format("    {} keyframes {}-{}, {} landmarks: {} ({})", to_string(part.map),
                        part.first.value, part.last.value, part.landmarks, to_string(part.verdict),
                        probability_text(part.probability));
    if (part.target_from_source) {
      text += fmt::format("{} {}", part.agrees ? ":" : ", placed between the others:",
                          pose_text(part.target_from_source->rigid(), unit, 3, 2));
    } else if (part.found && part.verdict == Verdict::kAligned) {
      text += ": " + pose_text(part.found->rigid(), unit, 3, 2);
    }
    text += "\n";
  }
  return text;
}

}  // namespace

Eigen::Quaterniond shown_quaternion(const Rigid3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  return q.w() < 0.0 ? Eigen::Quaterniond(-q.coeffs()) : q;
}

std::string swapped_truth_text(std::string_view what) {
  return fmt::format(
      "the inverse of the truth fits {}: the truth seems to be source_from_target, of swapped maps",
      what);
}

std::string verdict_text(std::string_view verdict, std::string_view reason) {
  constexpr std::size_t kLine = 100;
  std::string text = fmt::format("{}: {}\n", verdict, reason);
  if (text.size() <= kLine) return text;
  std::string_view ends = ":;";  // what precedes a colon says the reason in short
  for (std::size_t at = 0; (at = text.find(' ', at)) != std::string::npos; ++at) {
    if (at < verdict.size() + 2 || ends.find(text[at - 1]) == std::string_view::npos) continue;
    if (text[at - 1] == ':') ends = ",;:";
    text.replace(at - 1, 2, "\n    ");
    at += 3;
  }
  return text;
}

bool has_answer(const Alignment& alignment) {
  return alignment.verdict ? alignment.verdict == Verdict::kAligned
                           : alignment.registration.has_pose();
}

AlignOptions by_icp_alone(const IcpOptions& options, const PointSetOptions& points) {
  AlignOptions alone;
  alone.method = AlignMethod::kIcp;
  alone.judge = false;
  alone.icp = options;
  alone.prior = PosePrior{.target_from_source = options.initial};
  alone.overlap_radius = options.overlap_radius;
  alone.trace = options.trace;
  alone.points = points;
  return alone;
}

std::vector<StrategyResult> align_by_all(const LandmarkMap& source, const LandmarkMap& target,
                                         const std::vector<Strategy>& strategies,
                                         AlignOptions options,
                                         const std::optional<Similarity3>& truth,
                                         const CommonArguments& common) {
  std::vector<StrategyResult> results;
  for (const Strategy& strategy : strategies) {
    options.confidence = strategy.metric;
    StrategyResult result;
    result.alignment =
        align(source, target, options, common.execution("aligning, confidence " + strategy.name));
    const Alignment& alignment = result.alignment;
    if (alignment.registration.status == RegistrationStatus::kCancelled) {
      throw Error(ErrorKind::kCancelled, "align", "cancelled", "");
    }
    result.method = options.method;
    result.confidence = strategy.name;
    if (options.method == AlignMethod::kIcp && strategy.metric) result.k = options.icp.k;
    result.length_unit = target.info().length_unit;
    result.matches = alignment.registration.matches.size();
    // The search has a radius of its own, where none is asked for.
    result.overlap_radius = options.overlap_radius;
    if (!result.overlap_radius && alignment.radius > 0.0) result.overlap_radius = alignment.radius;
    if (truth && alignment.estimate) {
      const PointSet points = point_set(source, std::nullopt, options.points);
      result.error = pose_error(*alignment.estimate, *truth, points.positions);
      result.fits_inverse = fits_inverse(*alignment.estimate, *truth, points.positions);
      if (result.fits_inverse) common.console().remark(swapped_truth_text("the pose"));
    }
    results.push_back(std::move(result));
  }
  return results;
}

std::string alignment_table(const std::vector<StrategyResult>& results, LengthUnit unit) {
  const auto any = [&](const auto& holds) {
    return std::any_of(results.begin(), results.end(), holds);
  };
  const bool with_error = any([](const StrategyResult& one) { return one.error.has_value(); });
  const bool with_scale =
      any([](const StrategyResult& one) { return one.alignment.registration.scale != 1.0; });
  const bool with_overlap =
      any([](const StrategyResult& one) { return one.alignment.registration.overlap.has_value(); });
  const auto radius = std::find_if(results.begin(), results.end(),
                                   [](const auto& one) { return one.overlap_radius.has_value(); });
  const std::string symbol = unit_symbol(unit);
  std::vector<std::string> header = {"confidence", "k", "status", "iterations",
                                     "score before / after"};
  if (with_overlap) header.emplace_back("overlap");
  if (with_error) header.emplace_back("pose error");
  header.emplace_back("time");
  Table table(header);
  for (const StrategyResult& one : results) {
    const RegistrationResult& registration = one.alignment.registration;
    std::vector<std::string> row = {one.confidence, std::to_string(one.k),
                                    std::string(status_of(one.alignment))};
    row.push_back(std::to_string(registration.iterations));
    row.push_back(number(registration.initial_score, 4) + " / " + number(registration.score, 4));
    if (with_overlap) {
      const auto& overlap = registration.overlap;
      row.push_back(overlap ? fmt::format("{:.0f} / {:.0f} %", 100.0 * overlap->source,
                                          100.0 * overlap->target)
                            : "-");
    }
    if (with_error) {
      const auto& error = one.error;
      std::string text = "-";
      if (error) {
        text = fmt::format("{:.3f} deg {:.4f} {}", degrees(error->rotation_rad), error->translation,
                           symbol);
        if (with_scale) text += fmt::format(" {:.2f} %", 100.0 * std::expm1(error->log_scale));
      }
      row.push_back(std::move(text));
    }
    row.push_back(fmt::format("{:.0f} ms", 1e3 * one.alignment.duration_s));
    table.add_row(std::move(row));
  }
  std::string text = table.text();
  text += fmt::format("\nscore    mean squared distance to the nearest target landmark, {}^2\n",
                      symbol);
  if (with_overlap) {
    text += "overlap  share of source / target landmarks with a counterpart";
    if (radius != results.end()) {
      text += fmt::format(" within {:.3g} {}", *radius->overlap_radius, symbol);
    }
    text += "\n";
  }
  if (any([](const StrategyResult& one) { return one.fits_inverse; })) {
    text += fmt::format("truth    {}\n", swapped_truth_text("the pose"));
  }
  return text;
}

std::string alignment_text(const StrategyResult& result, LengthUnit unit, bool with_scale,
                           bool with_parts) {
  const Alignment& one = result.alignment;
  const std::string_view verdict = one.verdict                   ? to_string(*one.verdict)
                                   : one.registration.has_pose() ? "not judged"
                                                                 : "failed";
  std::string text = "\n" + verdict_text(verdict, one.reason);
  const bool trusted = has_answer(one);
  if (trusted) text += answer_text(one, unit, with_scale);
  if (one.verdict != Verdict::kRejected) text += open_directions_text(one, with_scale);
  if (with_parts && one.parts) text += parts_text(*one.parts, unit);
  return text + candidates_text(one, unit, trusted);
}

Json to_json(const StrategyResult& result, HistoryDetail history) {
  Json json = *Json::parse(cairn::to_json(result, history), "result");
  json["error"] = result.error ? to_json(*result.error) : Json(nullptr);
  if (result.fits_inverse) json["fits_inverse_of_truth"] = true;
  return json;
}

}  // namespace cairn::cli

// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/hand_eye.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/formats/trajectory_file.hpp"

#include "commands.hpp"
#include "support/arguments.hpp"
#include "support/console.hpp"
#include "support/documents.hpp"

namespace cairn::cli {
namespace {

constexpr std::array<std::pair<std::string_view, TrajectoryAlignment>, 5> kAlignments = {
    {{"none", TrajectoryAlignment::kNone},
     {"origin", TrajectoryAlignment::kOrigin},
     {"se3", TrajectoryAlignment::kSe3},
     {"sim3", TrajectoryAlignment::kSim3},
     {"poses", TrajectoryAlignment::kPoses}}};

TrajectoryAlignment parse_alignment(const std::string& text) {
  for (const auto& [name, alignment] : kAlignments) {
    if (name == text) return alignment;
  }
  throw Error(ErrorKind::kMisuse, "--alignment", printable(text),
              "none, origin, se3, sim3 or poses");
}

std::string_view unit_name(const RelativeInterval& interval) {
  switch (interval.unit) {
    case RelativeInterval::Unit::kMetres:
      return "metre";
    case RelativeInterval::Unit::kSeconds:
      return "second";
    case RelativeInterval::Unit::kFrames:
      break;
  }
  return "frame";
}

struct LoadedTrajectory {
  std::string path;
  Trajectory trajectory;
};

LoadedTrajectory load_trajectory(const std::string& path, const LogSink& log) {
  return {path, read_trajectory(path, log)};
}

Json json_of(const ErrorStatistics& translation, const ErrorStatistics& rotation_rad) {
  return {{"translation_m", to_json(translation)},
          {"rotation_deg", to_json(in_degrees(rotation_rad))}};
}

detail::Csv rows_of(const TrajectoryEvaluation& evaluation, const Trajectory& estimate,
                    const Trajectory& truth) {
  detail::Csv rows({"timestamp_s", "truth_timestamp_s", "translation_error_m", "rotation_error_deg",
                    "x_m", "y_m", "z_m", "truth_x_m", "truth_y_m", "truth_z_m"});
  const AbsoluteError& absolute = *evaluation.absolute;
  for (std::size_t i = 0; i < evaluation.pairs.size(); ++i) {
    const TimedPose& estimated = estimate.poses()[evaluation.pairs[i].first];
    const TimedPose& true_pose = truth.poses()[evaluation.pairs[i].second];
    const Eigen::Vector3d x =
        absolute.truth_from_estimate * estimated.world_from_camera.translation();
    const Eigen::Vector3d& true_x = true_pose.world_from_camera.translation();
    rows << estimated.timestamp_s << true_pose.timestamp_s << absolute.translations[i]
         << degrees(absolute.rotations_rad[i]) << x.x() << x.y() << x.z() << true_x.x()
         << true_x.y() << true_x.z();
    rows.end_row();
  }
  return rows;
}

// Root of the sum of three variances of the diagonal, from the first on.
double deviation_of(const Matrix6d& covariance, int first) {
  return std::sqrt(covariance(first, first) + covariance(first + 1, first + 1) +
                   covariance(first + 2, first + 2));
}

Json hand_eye_json(const HandEye& found) {
  const Rigid3& pose = found.body_from_camera;
  return {{"body_from_camera", to_json(pose.matrix())},
          {"covariance", to_json(found.covariance)},
          {"translation_m", pose.translation().norm()},
          {"translation_deviation_m", deviation_of(found.covariance, 0)},
          {"rotation_deg", degrees(pose.angle())},
          {"rotation_deviation_deg", degrees(deviation_of(found.covariance, 3))},
          {"clock_offset_s", found.clock_offset_s},
          {"clock_offset_deviation_s", found.clock_offset_deviation_s},
          {"poses", found.poses}};
}

Json errors_json(const TrajectoryEvaluation& evaluation,
                 const TrajectoryEvaluationOptions& options) {
  Json json;
  json["absolute"] = json_of(evaluation.absolute->translation, evaluation.absolute->rotation_rad);
  json["relative"] = Json::object();
  for (std::size_t i = 0; i < options.intervals.size(); ++i) {
    const auto& relative = evaluation.relative[i];
    json["relative"][fmt::format("per_{}", unit_name(options.intervals[i]))] =
        relative ? json_of(relative->translation, relative->rotation_rad) : Json(nullptr);
  }
  return json;
}

struct EvaluateTrajectoryArguments {
  CommonArguments common;
  std::string estimate;
  std::string truth;
  std::string alignment = "se3";
  TrajectoryEvaluationOptions options;
  bool strict = false;
  bool hand_eye = false;
  double max_clock_offset_s = kMaxClockOffset;

  void add_to(const Command& command) {
    command
        .add_text(
            "estimate", estimate,
            "Trajectory to evaluate: in TUM format (timestamp tx ty tz qx qy qz qw per line), "
            "EuRoC's "
            "or KITTI's, or with a line that names such columns")
        .required();
    command.add_text("truth", truth, "True trajectory, in any of these formats").required();
    command.add_text(
        "--alignment", alignment,
        "Alignment of the estimate with the truth: none, origin (first poses coincide), se3 "
        "(least squares over all positions), sim3 (the same with scale) or poses (rotation from "
        "the orientations, then translation)",
        "KIND");
    add_number(command, "--max-time-difference", options.max_time_difference_s,
               "Largest time difference between compared poses, seconds");
    const Option with_hand_eye = command.add_flag(
        "--hand-eye", hand_eye,
        "Also estimate the transform between the camera and the body that the truth "
        "tracks, and the clock offset; print the errors after both are corrected");
    add_number(command, "--max-clock-offset", max_clock_offset_s,
               "With --hand-eye: largest clock offset, seconds; 0: one clock")
        .needs(with_hand_eye);
    command.add_flag(
        "--strict", strict,
        "Fail with exit code 3 if poses are left out: unknown numbers, or equal times");
    common.add_csv_to(command, "compared pose");
    common.add_to(command);
    command.footer(
        "Example: print the absolute and relative errors defined by the TUM benchmark\n"
        "  cairn evaluate trajectory estimate.txt groundtruth.txt --csv errors.csv\n"
        "Example: the truth tracks markers mounted beside the camera\n"
        "  cairn evaluate trajectory estimate.txt groundtruth.txt --hand-eye --alignment poses");
  }

  int run() {
    options.alignment = parse_alignment(alignment);
    with_option_names(
        {{"TrajectoryEvaluationOptions.max_time_difference_s", "--max-time-difference"}},
        [&] { options.validate(); });
    require_outputs(common);
    const LogSink log = strict_log(common.console().log(), strict);
    const LoadedTrajectory estimated = load_trajectory(estimate, log);
    const LoadedTrajectory true_one = load_trajectory(truth, log);
    const TrajectoryEvaluation evaluation =
        evaluate_trajectory(estimated.trajectory, true_one.trajectory, options);
    reject_if(!evaluation.absolute, estimate, evaluation.reason, "");

    Json json =
        document("evaluate_trajectory", common,
                 {{"estimate", describe(estimated)}, {"truth", describe(true_one)}},
                 {{"alignment", alignment},
                  {"strict", strict},
                  {"max_time_difference_s", options.max_time_difference_s},
                  {"hand_eye", hand_eye},
                  {"max_clock_offset_s", hand_eye ? Json(max_clock_offset_s) : Json(nullptr)}});
    const std::size_t pairs = evaluation.pairs.size();
    const AbsoluteError& absolute = *evaluation.absolute;
    json["matched_poses"] = pairs;
    json["unmatched_poses"] = {{"estimate", estimated.trajectory.size() - pairs},
                               {"truth", true_one.trajectory.size() - pairs}};
    json["truth_from_estimate"] = to_json(absolute.truth_from_estimate.matrix());
    json["scale"] = absolute.truth_from_estimate.scale();
    json.update(errors_json(evaluation, options));
    json["hand_eye"] = nullptr;
    std::optional<HandEye> found;
    TrajectoryEvaluation after;
    if (hand_eye) {
      found = find_hand_eye(estimated.trajectory, true_one.trajectory);
      after = evaluate_trajectory(estimated.trajectory,
                                  corrected_truth(true_one.trajectory, *found), options);
      reject_if(!after.absolute, estimate, after.reason, "");
      json["hand_eye"] = hand_eye_json(*found);
      json["hand_eye"].update(errors_json(after, options));
    }
    write_document(json, common);
    write_rows(rows_of(evaluation, estimated.trajectory, true_one.trajectory), common);
    print(estimated, true_one, evaluation);
    remark_turned(evaluation);
    if (found) print_hand_eye(*found, after);
    return kDone;
  }

 private:
  // Short paths have one shape: positions of another recording may fit.
  void remark_turned(const TrajectoryEvaluation& evaluation) const {
    constexpr double kTurned = 90.0;  // degrees
    const double turned = degrees(evaluation.absolute->rotation_rad.median);
    if (turned <= kTurned || hand_eye) return;
    common.console().remark(
        "the orientations differ from the truth's by {:.0f} deg (median), however well the "
        "positions fit: the truth is of another recording, or of another body than the camera "
        "(--hand-eye)",
        turned);
  }

  Json describe(const LoadedTrajectory& loaded) const {
    Json json = describe_file(loaded.path, common);
    json["poses"] = loaded.trajectory.size();
    json["duration_s"] = loaded.trajectory.duration_s();
    json["length_m"] = loaded.trajectory.length();
    return json;
  }

  HandEye find_hand_eye(const Trajectory& estimated, const Trajectory& true_one) const {
    HandEyeResult result;
    with_option_names({{"max_clock_offset_s", "--max-clock-offset"}}, [&] {
      result = estimate_hand_eye(estimated, true_one, max_clock_offset_s,
                                 options.alignment == TrajectoryAlignment::kSim3);
    });
    reject_if(!result.hand_eye, estimate, result.reason, "");
    return *result.hand_eye;
  }

  void print(const LoadedTrajectory& estimated, const LoadedTrajectory& true_one,
             const TrajectoryEvaluation& evaluation) const {
    const Console console = common.console();
    for (const auto& [role, loaded] :
         {std::pair{"estimate", &estimated}, {"truth   ", &true_one}}) {
      const Trajectory& trajectory = loaded->trajectory;
      console.print("{}  {}: {} poses, {:.2f} s, {:.3f} m\n", role, loaded->path, trajectory.size(),
                    trajectory.duration_s(), trajectory.length());
    }
    const std::size_t pairs = evaluation.pairs.size();
    console.print(
        "matched   {} poses; without a partner within {:g} s: {} of the estimate, "
        "{} of the truth\n",
        pairs, options.max_time_difference_s, estimated.trajectory.size() - pairs,
        true_one.trajectory.size() - pairs);
    const AbsoluteError& absolute = *evaluation.absolute;
    const Rigid3& pose = absolute.truth_from_estimate.rigid();
    const Eigen::Vector3d angles = pose.roll_pitch_yaw();
    const Eigen::Vector3d& t = pose.translation();
    console.print("aligned   {}: x {} y {} z {} m, roll {} pitch {} yaw {} deg, scale {}\n\n",
                  alignment, fixed(t.x(), 4), fixed(t.y(), 4), fixed(t.z(), 4),
                  fixed(degrees(angles.x()), 3), fixed(degrees(angles.y()), 3),
                  fixed(degrees(angles.z()), 3), fixed(absolute.truth_from_estimate.scale(), 6));
    print_errors(evaluation);
  }

  void print_errors(const TrajectoryEvaluation& evaluation) const {
    const AbsoluteError& absolute = *evaluation.absolute;
    Table table({"error", "unit", "count", "rmse", "mean", "median", "std", "min", "max"});
    const auto add = [&](const std::string& name, const std::optional<ErrorStatistics>& translation,
                         const std::optional<ErrorStatistics>& rotation_rad) {
      const auto rotation = rotation_rad ? std::optional(in_degrees(*rotation_rad)) : std::nullopt;
      for (const auto& [unit, statistics] :
           {std::pair{"m", &translation}, std::pair{"deg", &rotation}}) {
        std::vector<std::string> row = {name, unit};
        if (const auto& s = *statistics) {
          row.push_back(std::to_string(s->count));
          for (const double value :
               {s->rmse, s->mean, s->median, s->standard_deviation, s->lowest, s->highest}) {
            row.push_back(fixed(value, 6));
          }
        } else {
          row.insert(row.end(), 7, "-");
        }
        table.add_row(std::move(row));
      }
    };
    add("absolute (ATE)", absolute.translation, absolute.rotation_rad);
    for (std::size_t i = 0; i < options.intervals.size(); ++i) {
      const auto& relative = evaluation.relative[i];
      add(fmt::format("relative (RPE), a {}", unit_name(options.intervals[i])),
          relative ? std::optional(relative->translation) : std::nullopt,
          relative ? std::optional(relative->rotation_rad) : std::nullopt);
    }
    common.console().print(table.text());
  }

  void print_hand_eye(const HandEye& found, const TrajectoryEvaluation& after) const {
    const Console console = common.console();
    const Rigid3& pose = found.body_from_camera;
    const Eigen::Vector3d& t = pose.translation();
    const Eigen::Vector3d turn = rotation_log(pose.quaternion());
    console.print(
        "\n"
        "hand-eye  body_from_camera, from {} poses; +- one standard deviation\n"
        "          rotation {} +- {} deg (about x {} y {} z {}), translation {} +- {} m (x {} y {} "
        "z "
        "{})\n"
        "          the truth's clock is {} +- {} s ahead\n"
        "\n"
        "Errors after this correction:\n",
        found.poses, fixed(degrees(pose.angle()), 3),
        fixed(degrees(deviation_of(found.covariance, 3)), 3), fixed(degrees(turn.x()), 3),
        fixed(degrees(turn.y()), 3), fixed(degrees(turn.z()), 3), fixed(t.norm(), 4),
        fixed(deviation_of(found.covariance, 0), 4), fixed(t.x(), 4), fixed(t.y(), 4),
        fixed(t.z(), 4), fixed(found.clock_offset_s, 4), fixed(found.clock_offset_deviation_s, 4));
    print_errors(after);
  }
};

}  // namespace

void add_evaluate_trajectory(const Command& evaluate) {
  add_verb<EvaluateTrajectoryArguments>(
      evaluate, "trajectory",
      "Compute the absolute and relative errors (ATE, RPE) of a trajectory");
}

void add_evaluate(const Command& program) {
  const Command evaluate = program.add_group(
      "evaluate", "Compare a trajectory, an alignment or a map with ground truth");
  add_evaluate_trajectory(evaluate);
  add_evaluate_alignment(evaluate);
  add_evaluate_map(evaluate);
  evaluate.footer(
      "Example: print the errors of a trajectory\n"
      "  cairn evaluate trajectory estimate.txt groundtruth.txt");
}

}  // namespace cairn::cli

// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/require.hpp"
#include "cairn/core/file.hpp"
#include "cairn/evaluation/covariance_calibration.hpp"
#include "cairn/evaluation/map_consistency.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/evaluation/trajectory_evaluation.hpp"
#include "cairn/formats/trajectory_file.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/geometry/trajectory.hpp"

#include "bindings/properties.hpp"
#include "bindings/support.hpp"
#include "bindings/text.hpp"

namespace cairn::python {
namespace {

Trajectory trajectory_of(const py::object& timestamps, const py::object& poses) {
  const auto times = real_array(timestamps, "timestamps_s", {-1});
  const std::vector<Rigid3> rigids = rigids_of(poses, "poses");
  detail::require(rigids.size() == static_cast<std::size_t>(times.shape(0)), "poses", rigids.size(),
                  fmt::format("{}, one a time", times.shape(0)));
  std::vector<TimedPose> timed;
  for (py::ssize_t i = 0; i < times.shape(0); ++i) {
    timed.push_back({times.at(i), rigids[static_cast<std::size_t>(i)]});
  }
  return Trajectory(std::move(timed));
}

std::vector<double> times_of(const Trajectory& trajectory) {
  std::vector<double> times;
  for (const TimedPose& pose : trajectory.poses()) times.push_back(pose.timestamp_s);
  return times;
}

std::vector<Rigid3> poses_of(const Trajectory& trajectory) {
  std::vector<Rigid3> poses;
  for (const TimedPose& pose : trajectory.poses()) poses.push_back(pose.world_from_camera);
  return poses;
}

py::array centres_of(const Trajectory& trajectory) {
  return row_array(trajectory.poses(), [](const TimedPose& pose) {
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    return std::array{t.x(), t.y(), t.z()};
  });
}

// Quaternions, because a rotation matrix loses the last bits.
py::array packed_trajectory(const py::object& object) {
  return row_array(object.cast<const Trajectory&>().poses(), [](const TimedPose& pose) {
    const Eigen::Quaterniond q = pose.world_from_camera.quaternion();
    const Eigen::Vector3d& t = pose.world_from_camera.translation();
    return std::array{pose.timestamp_s, t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()};
  });
}

Trajectory unpacked_trajectory(const py::object& state) {
  const auto rows = real_array(state, "pickled Trajectory", {-1, 8});
  std::vector<TimedPose> poses;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const double* const n = rows.data() + 8 * i;
    poses.push_back({n[0], Rigid3(Eigen::Quaterniond(n[4], n[5], n[6], n[7]),
                                  Eigen::Vector3d(n[1], n[2], n[3]))});
  }
  return Trajectory(std::move(poses));
}

void bind_trajectory(py::module_& module) {
  Exposed<Trajectory> trajectory(module, "Trajectory", "Timed poses of a camera. Immutable.");
  trajectory
      .def(py::init(&trajectory_of), py::arg("timestamps_s"), py::arg("poses"),
           "__init__($self, timestamps_s, poses)\n--\n\nFrom ascending times (n,) and poses "
           "world_from_camera (n, 4, 4).")
      .def("__len__", &Trajectory::size)
      .get("timestamps_s", "", &times_of)
      .get("poses", "(n, 4, 4), world_from_camera.", &poses_of, &pose_arrays)
      .get("positions", "(n, 3), camera centres.", &centres_of)
      .get("duration_s", "", &Trajectory::duration_s)
      .get("length", "Length of the path, in the unit of the poses.", &Trajectory::length)
      .def(
          "transformed",
          [](const Trajectory& self, const py::object& new_from_old) {
            return transformed(self, similarity_of(new_from_old, "new_from_old"));
          },
          py::arg("new_from_old"),
          "transformed($self, new_from_old)\n--\n\nThe trajectory in another world frame, by a 4x4 "
          "matrix.")
      .def(
          "write",
          [](const Trajectory& self, const std::filesystem::path& path) {
            write_file(path, [&](const ByteSink& sink) {
              write_trajectory(self, TrajectoryFormat::kTum, sink);
            });
          },
          py::arg("path"),
          "write($self, path)\n--\n\nWrites the format of the TUM RGB-D benchmark.")
      .def("__repr__",
           [](const Trajectory& self) {
             return fmt::format("<Trajectory: {} poses, {:.3f} s, length {:.3f}>", self.size(),
                                self.duration_s(), self.length());
           })
      .def("__copy__", [](const py::object& self) { return self; });
  make_picklable(module, trajectory, "restored_trajectory", &packed_trajectory,
                 &unpacked_trajectory);
  module.def(
      "read_trajectory",
      [](const std::filesystem::path& path) {
        std::vector<std::string> remarks;
        Trajectory poses =
            read_trajectory(path, [&](std::string_view remark) { remarks.emplace_back(remark); });
        warn(remarks);
        return poses;
      },
      py::arg("path"),
      "read_trajectory(path)\n--\n\nReads a trajectory in the format of the TUM RGB-D benchmark, "
      "EuRoC or KITTI.");
}

void bind_statistics(py::module_& module) {
  Exposed<ErrorStatistics>(module, "ErrorStatistics", "Statistics of errors, in their unit.")
      .def_readonly("count", &ErrorStatistics::count)
      .def_readonly("rmse", &ErrorStatistics::rmse)
      .def_readonly("mean", &ErrorStatistics::mean)
      .def_readonly("median", &ErrorStatistics::median)
      .def_readonly("standard_deviation", &ErrorStatistics::standard_deviation)
      .def_readonly("lowest", &ErrorStatistics::lowest)
      .def_readonly("percentile_95", &ErrorStatistics::percentile_95)
      .def_readonly("highest", &ErrorStatistics::highest)
      .def("__repr__", [](const ErrorStatistics& self) {
        return fmt::format(
            "<ErrorStatistics: rmse {:.6g}, mean {:.6g}, median {:.6g}, highest {:.6g} of {}>",
            self.rmse, self.mean, self.median, self.highest, self.count);
      });
}

// --- Trajectories -----------------------------------------------------------------------------------

// "1m", "0.5s" or "10f".
RelativeInterval interval_of(const std::string& text) {
  using Unit = RelativeInterval::Unit;
  std::size_t end = 0;
  double length = 0.0;
  try {
    length = std::stod(text, &end);
  } catch (const std::exception&) {
    end = 0;
  }
  if (end > 0) {
    const std::string unit = text.substr(end);
    if (unit == "m") return {Unit::kMetres, length};
    if (unit == "s") return {Unit::kSeconds, length};
    if (unit == "f") return {Unit::kFrames, length};
  }
  throw Error(ErrorKind::kMisuse, "intervals", printable(text),
              "a length such as '1m', '0.5s' or '10f'");
}

std::string interval_text(const RelativeInterval& interval) {
  const char* const unit = interval.unit == RelativeInterval::Unit::kMetres    ? "m"
                           : interval.unit == RelativeInterval::Unit::kSeconds ? "s"
                                                                               : "f";
  return fmt::format("{:g}{}", interval.length, unit);
}

struct Evaluated {
  TrajectoryEvaluation evaluation;
  std::vector<RelativeInterval> intervals;
};

Keywords<TrajectoryEvaluationOptions> evaluation_keywords() {
  Keywords<TrajectoryEvaluationOptions> keywords("evaluate_trajectory");
  const TrajectoryEvaluationOptions defaults;
  py::list intervals;
  for (const RelativeInterval& one : defaults.intervals) intervals.append(interval_text(one));
  keywords
      .add(
          "alignment", [](auto& o) -> auto& { return o.alignment; },
          Words<TrajectoryAlignment>{{"none", TrajectoryAlignment::kNone},
                                     {"origin", TrajectoryAlignment::kOrigin},
                                     {"se3", TrajectoryAlignment::kSe3},
                                     {"sim3", TrajectoryAlignment::kSim3},
                                     {"poses", TrajectoryAlignment::kPoses}})
      .add("max_time_difference_s", [](auto& o) -> auto& { return o.max_time_difference_s; })
      .add("intervals", py::tuple(intervals), [](auto& options, py::handle value) {
        options.intervals.clear();
        if (py::isinstance<py::str>(value))
          throw py::type_error("intervals: str; expected a list of texts");
        for (const py::handle one : py::iter(value)) {
          std::string text;
          from_python(one, "intervals", text);
          options.intervals.push_back(interval_of(text));
        }
      });
  return keywords;
}

// By interval.
py::dict relative_of(const Evaluated& self) {
  py::dict result;
  for (std::size_t i = 0; i < self.intervals.size(); ++i) {
    result[py::str(interval_text(self.intervals[i]))] = py::cast(self.evaluation.relative[i]);
  }
  return result;
}

py::array pairs_array(const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  return row_array(pairs, [](const auto& pair) { return std::array{pair.first, pair.second}; });
}

void bind_trajectory_evaluation(py::module_& module) {
  Exposed<RelativeError>(module, "RelativeError", "Drift over an interval.")
      .def_readonly("translation", &RelativeError::translation)
      .def_readonly("rotation_rad", &RelativeError::rotation_rad)
      .def("__repr__", [](const RelativeError& self) {
        return fmt::format("<RelativeError: rmse {:.6g}, {:.6g} deg>", self.translation.rmse,
                           degrees(self.rotation_rad.rmse));
      });
  Exposed<Evaluated>(
      module, "TrajectoryEvaluation",
      "Comparison of an estimated trajectory with the true one. Errors are None if the two cannot\n"
      "be aligned.")
      .get("translation", "Absolute trajectory error: ErrorStatistics of distances.",
           &Evaluated::evaluation, &TrajectoryEvaluation::absolute, &AbsoluteError::translation)
      .get("rotation_rad", "", &Evaluated::evaluation, &TrajectoryEvaluation::absolute,
           &AbsoluteError::rotation_rad)
      .get("translations", "(p,), one per pair of poses.", &Evaluated::evaluation,
           &TrajectoryEvaluation::absolute, &AbsoluteError::translations)
      .get("rotations_rad", "", &Evaluated::evaluation, &TrajectoryEvaluation::absolute,
           &AbsoluteError::rotations_rad)
      .get("truth_from_estimate", "The alignment, 4x4.", &Evaluated::evaluation,
           &TrajectoryEvaluation::absolute, &AbsoluteError::truth_from_estimate)
      .get("pairs", "(p, 2): indices into estimate and truth.", &Evaluated::evaluation,
           &TrajectoryEvaluation::pairs, &pairs_array)
      .get("relative",
           "Relative pose errors by interval; None if the trajectory is shorter than the interval.",
           &relative_of)
      .get("reason", "Why the trajectories cannot be aligned; empty if they can.",
           &Evaluated::evaluation, &TrajectoryEvaluation::reason)
      .def("__repr__", [](const Evaluated& self) {
        const auto& error = self.evaluation.absolute;
        if (!error) return "<TrajectoryEvaluation: " + self.evaluation.reason + ">";
        return fmt::format("<TrajectoryEvaluation: rmse {:.6g}, {:.6g} deg over {} pairs>",
                           error->translation.rmse, degrees(error->rotation_rad.rmse),
                           self.evaluation.pairs.size());
      });
  module.def(
      "evaluate_trajectory",
      [](const Trajectory& estimate, const Trajectory& truth, const py::kwargs& given) {
        const TrajectoryEvaluationOptions options = evaluation_keywords().read(given);
        options.validate();
        return unlocked([&] {
          return Evaluated{evaluate_trajectory(estimate, truth, options), options.intervals};
        });
      },
      py::arg("estimate"), py::arg("truth"),
      kept(
          evaluation_keywords().signature("estimate, truth", false) +
          "Computes absolute and relative errors as defined by the TUM RGB-D benchmark and evo.\n\n"
          "alignment   'none', 'origin', 'se3', 'sim3' or 'poses'\n"
          "intervals   of the relative errors, in metres ('1m'), seconds ('0.5s') or frames "
          "('10f')"));
}

// --- Poses and maps ---------------------------------------------------------------------------------

std::vector<Eigen::Vector3d> landmarks_of(const py::object& source) {
  if (py::isinstance<LandmarkMap>(source)) return source.cast<SharedMap>()->landmarks().positions;
  return positions_of(source, "source");
}

void bind_pose_error(py::module_& module) {
  Exposed<PoseError>(module, "PoseError", "Difference of an estimated pose from the true one.")
      .def_readonly("rotation_rad", &PoseError::rotation_rad)
      .get("rotation_deg", "", &PoseError::rotation_rad, &degrees)
      .def_readonly("translation", &PoseError::translation,
                    "Displacement of the source landmarks' centroid, in the target's unit.")
      .def_readonly("log_scale", &PoseError::log_scale)
      .def("__repr__", [](const PoseError& self) {
        return fmt::format("<PoseError: {:.6g}, {:.6g} deg>", self.translation,
                           degrees(self.rotation_rad));
      });
  module.def(
      "pose_error",
      [](const py::object& estimate, const py::object& truth, const py::object& source) {
        return pose_error(similarity_of(estimate, "estimate"), similarity_of(truth, "truth"),
                          landmarks_of(source));
      },
      py::arg("estimate"), py::arg("truth"), py::arg("source"),
      "pose_error(estimate, truth, source)\n--\n\n"
      "The error of a pose (4x4, target_from_source) against the true one. `source` is the source\n"
      "map or its landmarks (n, 3); the translation error is measured at their centroid.");
}

void bind_map_evaluation(py::module_& module) {
  Exposed<MapConsistency>(module, "MapConsistency",
                          "Reprojection and depth errors of a map's own observations.")
      .get("reprojection", "ErrorStatistics in pixels; None if unknown.",
           &MapConsistency::reprojection, &ReprojectionStatistics::px)
      .get("inlier_share", "", &MapConsistency::reprojection, &ReprojectionStatistics::inlier_share)
      .def_readonly("observations_behind", &MapConsistency::observations_behind)
      .def_readonly("depth", &MapConsistency::depth,
                    "ErrorStatistics in the map's unit; None if unknown.")
      .def_readonly("depth_bias", &MapConsistency::depth_bias)
      .def_readonly("missing_for_reprojection", &MapConsistency::missing_for_reprojection,
                    "Name of the missing input; empty if none is missing.")
      .def_readonly("missing_for_depth", &MapConsistency::missing_for_depth)
      .get("reprojection_px", "(o,), NaN where unknown; empty if the map lacks the input.",
           &MapConsistency::reprojection_px)
      .get("depth_errors", "", &MapConsistency::depth_errors)
      .def("__repr__", [](const MapConsistency& self) {
        if (!self.reprojection)
          return "<MapConsistency: without " + self.missing_for_reprojection + ">";
        return fmt::format("<MapConsistency: median {:.4g} px, {:.1f} % inliers>",
                           self.reprojection->px.median, 100.0 * self.reprojection->inlier_share);
      });
  module.def(
      "map_consistency",
      [](const SharedMap& map, double inlier_px) {
        return unlocked([&] { return map_consistency(*map, inlier_px); });
      },
      py::arg("map"), py::kw_only(), py::arg("inlier_px") = kInlierPx,
      kept(fmt::format(
          "map_consistency(map, *, inlier_px={:.1f})\n--\n\n"
          "Computes reprojection and depth errors of a map's own observations. Needs no truth.",
          kInlierPx)));
  module.def(
      "map_defects",
      [](const SharedMap& map) { return unlocked([&] { return map_defects(*map); }); },
      py::arg("map"),
      "map_defects(map)\n--\n\nWhat is wrong with a map or missing from it, one sentence each.");
}

void bind_calibration(py::module_& module) {
  Exposed<CovarianceCalibration>(module, "CovarianceCalibration",
                                 "Calibration of landmark covariances. If they match the actual "
                                 "errors, the normalised squared\n"
                                 "errors (NEES) have mean 3, and 95 % are below 7.81.")
      .def_property_readonly(
          "count", [](const CovarianceCalibration& self) { return self.all ? self.all->count : 0; })
      .get("mean", "", &CovarianceCalibration::all, &NeesStatistics::mean)
      .get("median", "", &CovarianceCalibration::all, &NeesStatistics::median)
      .get("inside_95", "Share of landmarks within the 95 % ellipsoid.",
           &CovarianceCalibration::all, &NeesStatistics::inside_95)
      .get("nees", "(n,), NaN for a landmark that could not be evaluated.",
           &CovarianceCalibration::nees)
      .def_readonly("without_truth", &CovarianceCalibration::without_truth)
      .def_readonly("without_covariance", &CovarianceCalibration::without_covariance)
      .def("__repr__", [](const CovarianceCalibration& self) {
        if (!self.all) return std::string("<CovarianceCalibration: no landmark could be judged>");
        return fmt::format(
            "<CovarianceCalibration: NEES mean {:.4g}, median {:.4g}, {:.1f} % inside 95 %>",
            self.all->mean, self.all->median, 100.0 * self.all->inside_95);
      });
  module.def(
      "calibrate_covariances",
      [](const SharedMap& map, const SharedMap& truth, const Trajectory* trajectory,
         double max_time_difference_s) {
        return unlocked([&] {
          const KeyframePoses poses =
              trajectory == nullptr ? keyframe_poses(*map, *truth)
                                    : keyframe_poses(*map, *trajectory, max_time_difference_s);
          return calibrate_covariances(estimates_in_first_keyframe(
              *map, true_positions_in_first_keyframe(*map, *truth, poses)));
        });
      },
      py::arg("map"), py::arg("truth"), py::kw_only(), py::arg("trajectory") = py::none(),
      py::arg("max_time_difference_s") = 0.02,
      "calibrate_covariances(map, truth, *, trajectory=None, max_time_difference_s=0.02)\n--\n\n"
      "Compares a map's covariances with the errors of its landmarks, each in the frame of the "
      "first\n"
      "keyframe that observed it. The true positions are those of the landmarks with the same ids "
      "in\n"
      "`truth`; the true keyframe poses are those in `truth`, or those of a trajectory at the "
      "same\n"
      "times.");
}

}  // namespace

void bind_evaluation(py::module_& module) {
  bind_statistics(module);
  bind_trajectory(module);
  bind_trajectory_evaluation(module);
  bind_pose_error(module);
  bind_map_evaluation(module);
  bind_calibration(module);
}

}  // namespace cairn::python

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/conventions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/statistics.hpp"

namespace cairn {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Pose {
  Eigen::Quaterniond world_from_camera;
  Eigen::Vector3d centre;
};

Eigen::Quaterniond reordered(const Eigen::Quaterniond& q, QuaternionOrder order) {
  switch (order) {
    case QuaternionOrder::kScalarLast:
      return {q.z(), q.w(), q.x(), q.y()};
    case QuaternionOrder::kScalarFirst:
      return {q.x(), q.y(), q.z(), q.w()};
    case QuaternionOrder::kAsRead:
      break;
  }
  return q;
}

// world_from_camera.
Eigen::Quaterniond reread_rotation(const Eigen::Quaterniond& read,
                                   const ConventionReading& reading) {
  const Eigen::Quaterniond q = reading.order_is_of_world
                                   ? reordered(read, reading.quaternion)
                                   : reordered(read.conjugate(), reading.quaternion).conjugate();
  return reading.rotation_is_transposed ? q.conjugate() : q;
}

Pose reread_pose(const Pose& read, const ConventionReading& reading) {
  Pose pose = read;
  pose.world_from_camera = reread_rotation(read.world_from_camera, reading).normalized();
  // The translation of camera_from_world, as the importer read it.
  const Eigen::Vector3d translation = -(read.world_from_camera.conjugate() * read.centre);
  switch (reading.position) {
    case PositionReading::kAsRead:
      break;
    case PositionReading::kTranslation:
      pose.centre = -(pose.world_from_camera * read.centre);
      break;
    case PositionReading::kTranslationIsCentre:
      pose.centre = translation;
      break;
    case PositionReading::kTranslationKept:
      pose.centre = -(pose.world_from_camera * translation);
      break;
  }
  if (reading.looks_backwards) {
    // Half a turn about the camera's x axis; the translation was read in the camera's axes.
    const Eigen::Quaterniond turn(0.0, 1.0, 0.0, 0.0);
    pose.world_from_camera = pose.world_from_camera * turn;
  }
  return pose;
}

Camera reread_camera(const Camera& read, const ConventionReading& reading) {
  Camera camera = read;
  const Intrinsics k = intrinsics(read);
  if (reading.is_undistorted) {
    camera.model = "PINHOLE";
    camera.parameters = {k.fx, k.fy, k.cx, k.cy};
  }
  const double side = std::max(read.width, read.height);
  const double by = reading.focal == FocalReading::kAsRead       ? 1.0
                    : reading.focal == FocalReading::kNormalised ? side
                                                                 : 1.0 / side;
  const auto focal_lengths = static_cast<std::size_t>(CameraProjection(camera).focal_lengths());
  for (std::size_t i = 0; i < focal_lengths; ++i) camera.parameters[i] *= by;
  return camera;
}

Pixel reread_pixel(const Pixel& read, const Intrinsics& k, const ConventionReading& reading) {
  Pixel pixel = read;
  if (reading.rows_go_up) pixel.v = 2.0 * k.cy - pixel.v;
  const double by = reading.pixel_centre == PixelCentreReading::kAsRead     ? 0.0
                    : reading.pixel_centre == PixelCentreReading::kHalfMore ? 0.5
                                                                            : -0.5;
  pixel.u += by;
  pixel.v += by;
  return pixel;
}

bool has_distortion(const Camera& camera) {
  const Intrinsics k = intrinsics(camera);
  const Eigen::Vector2d x(0.3, 0.2);
  const auto off =
      reprojection(camera, x.homogeneous(), {k.fx * x.x() + k.cx, k.fy * x.y() + k.cy});
  constexpr double kNone = 1e-6;  // pixels
  return !off || off->norm() > kNone;
}

struct Sample {
  std::uint32_t frame;
  std::uint32_t camera;
  Eigen::Vector3d landmark;
  Pixel pixel;
};

class Checker {
 public:
  explicit Checker(const LandmarkMap& map) : map_(map) {
    choose_samples();
    any_distortion_ = std::any_of(map.cameras().begin(), map.cameras().end(), &has_distortion);
  }

  ConventionCheck check() {
    ConventionCheck result;
    result.observations = samples_.size();
    constexpr std::size_t kFewest = 8;
    if (samples_.size() < kFewest) {
      result.sentence =
          "the conventions cannot be checked: the map lacks observations in frames with cameras";
      return result;
    }
    score_all(result);
    settle(result);
    return result;
  }

 private:
  void choose_samples() {
    constexpr std::size_t kMost = 2000;
    const std::size_t count = map_.observation_count();
    if (count == 0 || map_.frames().cameras.empty()) return;
    const std::size_t step = std::max<std::size_t>(1, count / kMost);
    std::uint32_t landmark = 0;
    const auto& offsets = map_.observations().offsets;
    for (std::size_t k = step / 2; k < count; k += step) {
      while (offsets[landmark + 1] <= k) ++landmark;
      const FrameIndex frame = map_.observations().frames[k];
      const auto camera = map_.frames().cameras[frame.value];
      if (!camera) continue;
      samples_.push_back({frame.value, camera->value, map_.landmarks().positions[landmark],
                          map_.observations().pixels[k]});
    }
  }

  // Median over every n-th sample; infinite errors for points behind the camera.
  double median_error(const ConventionReading& reading, std::size_t most_samples = 100000) {
    errors_.clear();
    du_.clear();
    dv_.clear();
    const std::size_t step = std::max<std::size_t>(1, samples_.size() / most_samples);
    for (std::size_t i = 0; i < samples_.size(); i += step) {
      const Sample& sample = samples_[i];
      const Pose pose = reread_pose(pose_of(sample.frame), reading);
      const Camera& camera = camera_of(sample.camera, reading);
      const Pixel seen =
          reread_pixel(sample.pixel, intrinsics(map_.cameras()[sample.camera]), reading);
      const auto off = reprojection(
          camera, pose.world_from_camera.conjugate() * (sample.landmark - pose.centre), seen);
      if (!off) {
        errors_.push_back(kInfinite);
        continue;
      }
      du_.push_back(-off->x());
      dv_.push_back(-off->y());
      errors_.push_back(off->norm());
    }
    return upper_median(errors_);
  }

  Pose pose_of(std::uint32_t frame) const {
    const auto& q = map_.frames().quaternions[frame];
    return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(),
            map_.frames().translations[frame]};
  }

  // Caches the last camera, because samples of one camera are mostly consecutive.
  const Camera& camera_of(std::uint32_t camera, const ConventionReading& reading) {
    if (camera != last_camera_ || !(reading == last_reading_)) {
      reread_ = reread_camera(map_.cameras()[camera], reading);
      last_camera_ = camera;
      last_reading_ = reading;
    }
    return reread_;
  }

  static int changes(const ConventionReading& r) {
    return (r.quaternion != QuaternionOrder::kAsRead ? 1 : 0) + (r.rotation_is_transposed ? 1 : 0) +
           (r.position != PositionReading::kAsRead ? 1 : 0) + (r.looks_backwards ? 1 : 0) +
           (r.rows_go_up ? 1 : 0) + (r.is_undistorted ? 1 : 0) +
           (r.focal != FocalReading::kAsRead ? 1 : 0);
  }

  // Least focal length in pixels, and most in sides of the image.
  std::pair<double, double> focal_range() const {
    std::pair<double, double> range(kInfinite, 0.0);
    for (const Camera& camera : map_.cameras()) {
      const double focal = intrinsics(camera).fx;
      range.first = std::min(range.first, focal);
      range.second = std::max(range.second, focal / std::max(camera.width, camera.height));
    }
    return range;
  }

  void score_all(ConventionCheck& result) {
    std::vector<ScoredReading> scored;
    const auto [least_focal, most_focal] = focal_range();
    for (int rotation = 0; rotation < 10; ++rotation) {
      for (int position = 0; position < 4; ++position) {
        for (int bits = 0; bits < 8; ++bits) {
          for (int focal = 0; focal < 3; ++focal) {
            ConventionReading reading;
            reading.rotation_is_transposed = rotation % 2 != 0;
            const int order = rotation / 2;  // none, then each order of either
            reading.quaternion = order == 0  ? QuaternionOrder::kAsRead
                                 : order < 3 ? QuaternionOrder::kScalarLast
                                             : QuaternionOrder::kScalarFirst;
            reading.order_is_of_world = order == 2 || order == 4;
            reading.position = static_cast<PositionReading>(position);
            reading.looks_backwards = (bits & 1) != 0;
            reading.rows_go_up = (bits & 2) != 0;
            reading.is_undistorted = (bits & 4) != 0;
            reading.focal = static_cast<FocalReading>(focal);
            const bool is_idle =
                (reading.position == PositionReading::kTranslationKept && rotation == 0) ||
                (reading.is_undistorted && !any_distortion_) ||
                (reading.focal == FocalReading::kNormalised && least_focal > 20.0) ||
                (reading.focal == FocalReading::kMultiplied && most_focal < 20.0);
            if (is_idle) continue;
            constexpr std::size_t kAtFirst = 200;
            scored.push_back({reading, median_error(reading, kAtFirst)});
          }
        }
      }
    }
    // The best few once more, with all samples.
    const auto is_better = [](const ScoredReading& a, const ScoredReading& b) {
      // Of equivalent readings, e.g. if all poses are the identity, the simplest.
      const bool is_same =
          a.median_px == b.median_px ||
          std::abs(a.median_px - b.median_px) < 1e-9 * std::min(a.median_px, b.median_px);
      return is_same ? changes(a.reading) < changes(b.reading) : a.median_px < b.median_px;
    };
    std::stable_sort(scored.begin(), scored.end(),
                     [](const ScoredReading& a, const ScoredReading& b) {
                       return std::pair(a.median_px, changes(a.reading)) <
                              std::pair(b.median_px, changes(b.reading));
                     });
    constexpr std::size_t kFinalists = 24;
    scored.resize(std::min(scored.size(), kFinalists));
    for (ScoredReading& one : scored) one.median_px = median_error(one.reading);
    result.as_format_px = median_error({});
    if (std::none_of(scored.begin(), scored.end(),
                     [](const ScoredReading& one) { return one.reading == ConventionReading{}; })) {
      scored.push_back({{}, result.as_format_px});
    }
    result.best = scored.front();
    for (const ScoredReading& one : scored) {
      if (is_better(one, result.best)) result.best = one;
    }
    for (const ScoredReading& one : scored) {
      const bool is_same =
          one.reading == result.best.reading || std::abs(one.median_px - result.best.median_px) <=
                                                    1e-6 * std::max(1.0, result.best.median_px);
      if (is_same) continue;
      if (!result.runner_up || is_better(one, *result.runner_up)) result.runner_up = one;
    }
  }

  void settle(ConventionCheck& result) {
    const double width = map_.cameras()[samples_.front().camera].width;
    const double most =
        std::max(8.0, 0.02 * width);  // largest error of a reading that explains the data
    constexpr double kMuch = 3.0;
    const auto px = [](double x) {
      return std::isfinite(x) ? fmt::format("{:.3g} px", x)
                              : std::string("landmarks behind the cameras");
    };
    const std::string next =
        result.runner_up
            ? fmt::format("; the next best reading gives {} ({})", px(result.runner_up->median_px),
                          result.runner_up->reading == ConventionReading{}
                              ? std::string("as the format says")
                              : describe(result.runner_up->reading))
            : std::string();
    // The format's reading stands unless another is much better.
    const bool format_stands = result.as_format_px <= most &&
                               result.as_format_px <= std::max(kMuch * result.best.median_px, 1.0);
    if (format_stands && !(result.best.reading == ConventionReading{})) {
      result.runner_up = result.best;
      result.best = {{}, result.as_format_px};
    }
    if (result.best.median_px > most) {
      result.verdict = ConventionVerdict::kNone;
      result.sentence = fmt::format(
          "no convention explains the observations: the best reading gives {}, as the format says "
          "{}; the "
          "cameras, the poses or the observations may belong to another map",
          px(result.best.median_px), px(result.as_format_px));
      return;
    }
    find_pixel_centre(result);
    if (result.best.reading == ConventionReading{}) {
      result.verdict = ConventionVerdict::kAsFormat;
      result.sentence = fmt::format(
          "the data obey the format's conventions: median {}{}", px(result.as_format_px),
          format_stands && result.runner_up
              ? fmt::format("; the next best reading gives {} ({})",
                            px(result.runner_up->median_px), describe(result.runner_up->reading))
              : next);
      return;
    }
    const bool is_pixel_only = describe_without_pixel(result.best.reading).empty();
    const bool is_clear = is_pixel_only || !result.runner_up ||
                          result.runner_up->median_px > 1.5 * result.best.median_px;
    if (!is_clear) {
      result.verdict = ConventionVerdict::kUndecidable;
      result.sentence = fmt::format(
          "the data do not obey the format ({}), and two readings explain them about as well: {} "
          "({}), and "
          "{} ({})",
          px(result.as_format_px), describe(result.best.reading), px(result.best.median_px),
          describe(result.runner_up->reading), px(result.runner_up->median_px));
      return;
    }
    result.verdict = ConventionVerdict::kOther;
    result.sentence = fmt::format(
        "the data obey another convention than the format: {}; median {}, as the "
        "format says {}{}",
        describe(result.best.reading), px(result.best.median_px), px(result.as_format_px), next);
  }

  static std::string describe_without_pixel(ConventionReading reading) {
    reading.pixel_centre = PixelCentreReading::kAsRead;
    return describe(reading);
  }

  // A shift of half a pixel shows as a bias of all observations, if the principal point and the poses were not
  // estimated with it.
  void find_pixel_centre(ConventionCheck& result) {
    median_error(result.best.reading);
    if (du_.size() < 50) return;
    const double du = upper_median(du_);
    const double dv = upper_median(dv_);
    const auto spread = [](std::vector<double> values, double middle) {
      for (double& value : values) value = std::abs(value - middle);
      return 1.4826 * upper_median(values);
    };
    const double error = 1.25 * std::max(spread(du_, du), spread(dv_, dv)) /
                         std::sqrt(static_cast<double>(du_.size()));
    constexpr double kNear = 0.15;
    for (const auto& [by, reading] : {std::pair(0.5, PixelCentreReading::kHalfLess),
                                      std::pair(-0.5, PixelCentreReading::kHalfMore)}) {
      if (error > 0.05 || std::abs(du - by) > kNear || std::abs(dv - by) > kNear) continue;
      ConventionReading shifted = result.best.reading;
      shifted.pixel_centre = reading;
      const double median = median_error(shifted);
      if (median >= result.best.median_px) continue;
      result.runner_up = result.best;
      result.best = {shifted, median};
    }
  }

  const LandmarkMap& map_;
  std::vector<Sample> samples_;
  std::uint32_t last_camera_ = std::numeric_limits<std::uint32_t>::max();
  ConventionReading last_reading_;
  Camera reread_;
  bool any_distortion_ = false;
  std::vector<double> errors_;
  std::vector<double> du_;
  std::vector<double> dv_;
};

}  // namespace

std::string describe(const ConventionReading& reading) {
  using Reading = PositionReading;
  const std::pair<bool, const char*> differences[] = {
      {reading.quaternion == QuaternionOrder::kScalarLast,
       "quaternions have the scalar last where the format has it first"},
      {reading.quaternion == QuaternionOrder::kScalarFirst,
       "quaternions have the scalar first where the format has it last"},
      {reading.rotation_is_transposed, "rotations are in the other direction, or column by column"},
      {reading.position == Reading::kTranslation,
       "positions are translations camera_from_world, not centres"},
      {reading.position == Reading::kTranslationIsCentre,
       "positions are centres of cameras, not translations camera_from_world"},
      {reading.position == Reading::kTranslationKept,
       "translations are camera_from_world, as the format says"},
      {reading.looks_backwards, "cameras look along -z with y up"},
      {reading.rows_go_up, "pixels are counted upwards"},
      {reading.is_undistorted, "observations are free of distortion"},
      {reading.focal == FocalReading::kNormalised,
       "focal lengths are divided by the longer side of the image"},
      {reading.focal == FocalReading::kMultiplied, "focal lengths are in pixels already"},
      {reading.pixel_centre == PixelCentreReading::kHalfMore,
       "half a pixel is to be added to the pixels"},
      {reading.pixel_centre == PixelCentreReading::kHalfLess,
       "half a pixel is to be taken from the pixels"}};
  std::vector<const char*> words;
  for (const auto& [differs, word] : differences) {
    if (differs) words.push_back(word);
  }
  return fmt::format("{}", fmt::join(words, "; "));
}

const char* to_string(ConventionVerdict verdict) {
  switch (verdict) {
    case ConventionVerdict::kAsFormat:
      return "as_format";
    case ConventionVerdict::kOther:
      return "other";
    case ConventionVerdict::kUndecidable:
      return "undecidable";
    case ConventionVerdict::kNone:
      return "none";
    case ConventionVerdict::kNotChecked:
      break;
  }
  return "not_checked";
}

ConventionCheck check_conventions(const LandmarkMap& map) {
  return Checker(map).check();
}

LandmarkMap reread(LandmarkMap map, const ConventionReading& reading) {
  MapTables tables = std::move(map).tables();
  FrameTable& frames = tables.frames;
  for (std::size_t k = 0; k < tables.observations.pixels.size(); ++k) {
    const FrameIndex frame = tables.observations.frames[k];
    if (frames.cameras.empty() || !frames.cameras[frame.value]) continue;
    Pixel& pixel = tables.observations.pixels[k];
    pixel = reread_pixel(pixel, intrinsics(tables.cameras[frames.cameras[frame.value]->value]),
                         reading);
  }
  for (std::size_t i = 0; i < frames.ids.size(); ++i) {
    const auto& q = frames.quaternions[i];
    const Pose pose = reread_pose(
        {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(), frames.translations[i]}, reading);
    const Eigen::Quaterniond& r = pose.world_from_camera;
    frames.quaternions[i] = {r.w(), r.x(), r.y(), r.z()};
    frames.translations[i] = pose.centre;
  }
  for (Camera& camera : tables.cameras) camera = reread_camera(camera, reading);
  tables.rigs.clear();  // nothing says by which convention their poses are
  frames.instants.clear();
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn

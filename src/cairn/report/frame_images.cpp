// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/frame_images.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/statistics.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/report/detail/map_builder.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn::report {
namespace {

// A frame of a map and the image of a sequence that is nearest in time.
struct SeenFrame {
  std::size_t frame;
  std::size_t image;
};

double median_interval_s(std::span<const SequenceFrame> images) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < images.size(); ++i) {
    intervals.push_back(images[i].timestamp_s - images[i - 1].timestamp_s);
  }
  return intervals.empty() ? 0.0 : upper_median(intervals);
}

std::vector<SeenFrame> seen_frames(const LandmarkMap& map, std::span<const SequenceFrame> images) {
  const double most = 0.5 * median_interval_s(images);
  std::vector<SeenFrame> seen;
  std::size_t frame = 0;
  for (const auto& time : map.frames().timestamps_s) {
    const std::size_t index = frame++;
    if (!time) continue;
    const auto distance = [&](const SequenceFrame& image) {
      return std::abs(image.timestamp_s - *time);
    };
    auto nearest = std::lower_bound(
        images.begin(), images.end(), *time,
        [](const SequenceFrame& image, double wanted) { return image.timestamp_s < wanted; });
    if (nearest == images.end() ||
        (nearest != images.begin() && distance(*std::prev(nearest)) <= distance(*nearest))) {
      --nearest;
    }
    if (distance(*nearest) <= most) {
      seen.push_back({index, static_cast<std::size_t>(nearest - images.begin())});
    }
  }
  return seen;
}

[[noreturn]] void refuse(const LandmarkMap& map, std::span<const SequenceFrame> images,
                         const std::filesystem::path& sequence) {
  double first = std::numeric_limits<double>::infinity();
  double last = -first;
  for (const auto& time : map.frames().timestamps_s) {
    if (!time) continue;
    first = std::min(first, *time);
    last = std::max(last, *time);
  }
  const std::string frames =
      first <= last ? fmt::format("are from {:.3f} to {:.3f} s", first, last) : "have no times";
  throw Error(
      ErrorKind::kInput, sequence.string(),
      fmt::format("its images, from {:.3f} to {:.3f} s, fit no keyframe of the map: these {}",
                  images.front().timestamp_s, images.back().timestamp_s, frames),
      "the sequence that the map was built from");
}

// At most `count` of them, from the first to the last.
std::vector<SeenFrame> spread(const std::vector<SeenFrame>& all, std::size_t count) {
  if (all.size() <= count) return all;
  std::vector<SeenFrame> some;
  for (std::size_t i = 0; i < count; ++i) {
    some.push_back(all[count == 1 ? all.size() / 2 : i * (all.size() - 1) / (count - 1)]);
  }
  return some;
}

// Makes small images without lens distortion of large ones.
class Shrinking {
 public:
  // The camera and its view, or neither: then the image is only made smaller.
  struct Lens {
    const Camera* camera;
    Frustum view;
  };

  Shrinking(const std::optional<Lens>& lens, std::uint32_t from_width, std::uint32_t from_height,
            std::uint32_t most_width)
      : width_(std::min(from_width, most_width)),
        samples_(std::min(kMostSamples, (from_width + width_ - 1) / width_)) {
    constexpr double kMostSlender = 8.0;
    const double shape = lens ? lens->view.half_height / lens->view.half_width
                              : static_cast<double>(from_height) / from_width;
    height_ = static_cast<std::uint32_t>(
        std::max(1.0, std::round(width_ * std::clamp(shape, 1.0 / kMostSlender, kMostSlender))));
    const auto projection = lens ? std::optional(CameraProjection(*lens->camera)) : std::nullopt;
    const auto place = [](std::uint32_t pixel, std::uint32_t sample, std::uint32_t samples) {
      return pixel + (sample + 0.5) / samples;
    };
    sources_.reserve(std::size_t{width_} * height_ * samples_ * samples_);
    for (std::uint32_t row = 0; row < height_; ++row) {
      for (std::uint32_t column = 0; column < width_; ++column) {
        for (std::uint32_t sample = 0; sample < samples_ * samples_; ++sample) {
          // From 0 to 1 over the small image, then over the large one.
          double u = place(column, sample % samples_, samples_) / width_;
          double v = place(row, sample / samples_, samples_) / height_;
          if (projection) {
            const auto pixel = (*projection)(lens->camera->parameters.data(),
                                             {(2.0 * u - 1.0) * lens->view.half_width,
                                              (2.0 * v - 1.0) * lens->view.half_height, 1.0});
            u = pixel ? (pixel->u + 0.5) / lens->camera->width : -1.0;
            v = pixel ? (pixel->v + 0.5) / lens->camera->height : -1.0;
          }
          const bool inside = u >= 0.0 && u < 1.0 && v >= 0.0 && v < 1.0;
          sources_.push_back(inside ? static_cast<std::uint32_t>(v * from_height) * from_width +
                                          static_cast<std::uint32_t>(u * from_width)
                                    : kOutside);
        }
      }
    }
  }

  ColorImage operator()(const ColorImage& image) const {
    constexpr std::uint8_t kUnseen = 128;
    ColorImage small(width_, height_, kUnseen);
    const std::size_t each = std::size_t{samples_} * samples_;
    for (std::size_t pixel = 0; pixel < small.values.size() / 3; ++pixel) {
      std::array<std::uint32_t, 3> sums = {};
      std::uint32_t count = 0;
      for (std::size_t sample = 0; sample < each; ++sample) {
        const std::uint32_t source = sources_[pixel * each + sample];
        if (source == kOutside) continue;
        ++count;
        for (std::size_t c = 0; c < 3; ++c) sums[c] += image.values[3 * std::size_t{source} + c];
      }
      for (std::size_t c = 0; c < 3 && count > 0; ++c) {
        small.values[3 * pixel + c] = static_cast<std::uint8_t>((sums[c] + count / 2) / count);
      }
    }
    return small;
  }

 private:
  static constexpr std::uint32_t kMostSamples = 4;
  static constexpr std::uint32_t kOutside = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t width_;
  std::uint32_t height_ = 0;
  std::uint32_t samples_;               // of a pixel, along each side
  std::vector<std::uint32_t> sources_;  // pixels of the large image, samples_ * samples_ for each
};

// What is common to all images of one camera and size is computed once.
class Shrinkings {
 public:
  Shrinkings(const LandmarkMap& map, std::uint32_t most_width)
      : map_(map), frustum_(detail::frustum_of(map)), most_width_(most_width) {}

  const Shrinking& of(std::size_t frame, const ColorImage& image) {
    const auto camera = frame < map_.frames().cameras.size() ? map_.frames().cameras[frame]
                                                             : std::optional<CameraIndex>();
    const auto key =
        std::tuple(camera ? camera->value + std::size_t{1} : 0, image.width, image.height);
    const auto found = known_.find(key);
    if (found != known_.end()) return found->second;
    std::optional<Shrinking::Lens> lens;
    if (camera && frustum_) lens = {&map_.cameras()[camera->value], *frustum_};
    return known_.emplace(key, Shrinking(lens, image.width, image.height, most_width_))
        .first->second;
  }

 private:
  const LandmarkMap& map_;
  std::optional<Frustum> frustum_;
  std::uint32_t most_width_;
  std::map<std::tuple<std::size_t, std::uint32_t, std::uint32_t>, Shrinking> known_;
};

}  // namespace

std::vector<FrameImage> frame_images(const LandmarkMap& map, const std::filesystem::path& sequence,
                                     const LogSink& log) {
  constexpr int kQuality = 80;  // of the JPEG, 0 to 100
  const ImageSequence recorded(sequence, {}, log);
  const auto seen = seen_frames(map, recorded.frames());
  if (seen.empty()) refuse(map, recorded.frames(), sequence);
  Shrinkings shrinkings(map, kWidestFrameImage);
  std::vector<FrameImage> images;
  for (const auto& [frame, image] : spread(seen, kMostFrameImages)) {
    const ColorImage color = recorded.read_color(image);
    const std::string jpeg = jpeg_bytes(shrinkings.of(frame, color)(color), kQuality);
    images.push_back({frame, ImageType::kJpeg, {jpeg.begin(), jpeg.end()}});
  }
  return images;
}

}  // namespace cairn::report

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/landmark_colors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/vision/image.hpp"

namespace cairn::detail {
namespace {

using Bgr = std::array<std::uint8_t, 3>;

std::optional<Bgr> sampled(const ColorImage& image, const Pixel& at) {
  const double column = std::floor(at.u + 0.5);
  const double row = std::floor(at.v + 0.5);
  if (!(column >= 0.0 && row >= 0.0 && column < image.width && row < image.height)) {
    return std::nullopt;
  }
  const std::uint8_t* const pixel =
      &image.at(static_cast<std::size_t>(column), static_cast<std::size_t>(row));
  return Bgr{pixel[0], pixel[1], pixel[2]};
}

// Median; of an even number of values, the lower middle one.
std::uint8_t median(std::vector<Bgr>& samples, std::size_t channel) {
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>((samples.size() - 1) / 2);
  std::nth_element(samples.begin(), middle, samples.end(),
                   [&](const Bgr& a, const Bgr& b) { return a[channel] < b[channel]; });
  return (*middle)[channel];
}

std::optional<std::size_t> frame_at(const ImageSequence& sequence, double timestamp_s) {
  const auto frames = sequence.frames();
  const auto found = std::lower_bound(
      frames.begin(), frames.end(), timestamp_s,
      [](const SequenceFrame& frame, double time) { return frame.timestamp_s < time; });
  if (found == frames.end() || found->timestamp_s != timestamp_s) return std::nullopt;
  return static_cast<std::size_t>(found - frames.begin());
}

}  // namespace

LandmarkMap with_colors(LandmarkMap map, const ImageSequence& sequence,
                        const Execution& execution) {
  const ObservationTable& observations = map.observations();
  if (observations.frames.empty() || map.frames().timestamps_s.empty()) return map;
  std::vector<std::vector<std::size_t>> seen_by(map.frame_count());
  for (std::size_t i = 0; i < observations.frames.size(); ++i) {
    seen_by[observations.frames[i].value].push_back(i);
  }
  std::vector<std::optional<Bgr>> samples(observations.frames.size());
  execution.executor.for_blocks(map.frame_count(), 1, [&](std::size_t frame, std::size_t) {
    if (execution.stop.stop_requested())
      throw Error(ErrorKind::kCancelled, "mapping", "was cancelled", "");
    const auto time = map.frames().timestamps_s[frame];
    const auto in_sequence = time ? frame_at(sequence, *time) : std::nullopt;
    if (!in_sequence) return;
    try {
      const ColorImage image = sequence.read_color(*in_sequence);
      for (const std::size_t i : seen_by[frame]) {
        samples[i] = sampled(image, observations.pixels[i]);
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kInput) throw;
    }
  });

  OptionalColumn<Color> colors(map.landmark_count());
  std::vector<Bgr> of_landmark;
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    of_landmark.clear();
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      if (samples[k]) of_landmark.push_back(*samples[k]);
    }
    if (of_landmark.empty()) continue;
    const std::uint8_t blue = median(of_landmark, 0);
    const std::uint8_t green = median(of_landmark, 1);
    colors[i] = Color{median(of_landmark, 2), green, blue};
  }
  MapTables tables = std::move(map).tables();
  tables.landmarks.colors = std::move(colors);
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

}  // namespace cairn::detail

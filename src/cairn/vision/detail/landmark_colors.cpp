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

// Median; of an even number of values, the lower middle one.
std::uint8_t median(std::vector<Color>& samples, std::uint8_t Color::*channel) {
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>((samples.size() - 1) / 2);
  std::ranges::nth_element(samples, middle, {}, channel);
  return (*middle).*channel;
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

std::optional<Color> color_at(const ColorImage& image, const Pixel& at) {
  const double column = std::floor(at.u + 0.5);
  const double row = std::floor(at.v + 0.5);
  if (!(column >= 0.0 && row >= 0.0 && column < image.width && row < image.height)) {
    return std::nullopt;
  }
  const std::uint8_t* const bgr =
      &image.at(static_cast<std::size_t>(column), static_cast<std::size_t>(row));
  return Color{bgr[2], bgr[1], bgr[0]};
}

LandmarkMap with_colors(LandmarkMap map, const ImageSequence& sequence,
                        const Execution& execution) {
  const ObservationTable& observations = map.observations();
  if (observations.frames.empty() || map.frames().timestamps_s.empty()) return map;
  std::vector<std::vector<std::size_t>> seen_by(map.frame_count());
  for (std::size_t i = 0; i < observations.frames.size(); ++i) {
    seen_by[observations.frames[i].value].push_back(i);
  }
  std::vector<std::optional<Color>> samples(observations.frames.size());
  execution.executor.for_blocks(map.frame_count(), 1, [&](std::size_t frame, std::size_t) {
    if (execution.stop.stop_requested())
      throw Error(ErrorKind::kCancelled, "mapping", "was cancelled", "");
    const auto time = map.frames().timestamps_s[frame];
    const auto in_sequence = time ? frame_at(sequence, *time) : std::nullopt;
    if (!in_sequence) return;
    try {
      const ColorImage image = sequence.read_color(*in_sequence);
      for (const std::size_t i : seen_by[frame]) {
        samples[i] = color_at(image, observations.pixels[i]);
      }
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kInput) throw;
    }
  });

  OptionalColumn<Color> colors(map.landmark_count());
  std::vector<Color> of_landmark;
  for (std::size_t i = 0; i < map.landmark_count(); ++i) {
    of_landmark.clear();
    for (std::uint64_t k = observations.offsets[i]; k < observations.offsets[i + 1]; ++k) {
      if (samples[k]) of_landmark.push_back(*samples[k]);
    }
    if (of_landmark.empty()) continue;
    const std::uint8_t red = median(of_landmark, &Color::red);
    const std::uint8_t green = median(of_landmark, &Color::green);
    colors[i] = Color{red, green, median(of_landmark, &Color::blue)};
  }
  MapTables tables = std::move(map).tables();
  tables.landmarks.colors = std::move(colors);
  return with_content_uuid(LandmarkMap(std::move(tables)));
}

}  // namespace cairn::detail

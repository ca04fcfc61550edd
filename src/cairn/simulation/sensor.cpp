// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

constexpr std::size_t kRows = 16;  // of a block

std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// SplitMix64: enough for noise, and far cheaper to begin anew in each row than core's Random.
class NoiseStream {
 public:
  NoiseStream(std::uint64_t stream, std::uint64_t part) : state_(mixed(stream) ^ mixed(~part)) {}

  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15ULL;
    return mixed(state_);
  }

 private:
  std::uint64_t state_;
};

constexpr int kTableBits = 12;
constexpr std::size_t kTableSize = std::size_t{1} << kTableBits;

// Quantiles of the normal distribution at the middles of equal shares, scaled to variance 1: an entry
// drawn evenly is normal, cut off at 3.7 standard deviations.
const std::array<float, kTableSize>& normal_table() {
  static const std::array<float, kTableSize> table = [] {
    std::array<float, kTableSize> result{};
    double sum = 0.0;
    std::array<double, kTableSize> quantiles{};
    for (std::size_t i = 0; i < kTableSize; ++i) {
      const double share = (static_cast<double>(i) + 0.5) / kTableSize;
      double low = -8.0;
      double high = 8.0;
      for (int step = 0; step < 60; ++step) {
        const double middle = 0.5 * (low + high);
        (0.5 * std::erfc(-middle / std::numbers::sqrt2) < share ? low : high) = middle;
      }
      quantiles[i] = low;
      sum += low * low;
    }
    const double scale = 1.0 / std::sqrt(sum / kTableSize);
    for (std::size_t i = 0; i < kTableSize; ++i) {
      result[i] = static_cast<float>(quantiles[i] * scale);
    }
    return result;
  }();
  return table;
}

}  // namespace

constexpr OptionField kSensorFields[] = {
    {"exposure", option_at<&SensorOptions::exposure>, within(0.01, 100), "--exposure",
     "Brightness factor"},
    {"color_noise", option_at<&SensorOptions::color_noise>, within(0, 100), "--noise",
     "Standard deviation of the colour noise, grey levels"},
    {"ideal_depth",
     option_at<&SensorOptions::ideal_depth>,
     {},
     "--no-depth-noise",
     "Write exact depth: no noise, quantisation, holes or limits"},
    {"depth_noise_m", option_at<&SensorOptions::depth_noise_m>, within(0, 0.1), "--depth-noise",
     "Standard deviation of the depth at 1 m, metres; it grows with the square of the depth"},
    {"depth_step_m", option_at<&SensorOptions::depth_step_m>, within(0, 0.1)},
    {"min_depth_m", option_at<&SensorOptions::min_depth_m>, within(0, 1000)},
    {"max_depth_m", option_at<&SensorOptions::max_depth_m>, within(0, 1000), "--max-depth",
     "Largest measured depth, metres"},
    {"baseline_m", option_at<&SensorOptions::baseline_m>, within(0, 10)},
    {"max_incidence_rad",
     option_at<&SensorOptions::max_incidence_rad>,
     {.least = 0, .most = 0.5 * std::numbers::pi, .expected = "0 to 1.5708"}},
    {"edge_holes", option_at<&SensorOptions::edge_holes>, within(0, 1)},
    {"dropout", option_at<&SensorOptions::dropout>, within(0, 1)},
};
constinit const OptionTable SensorOptions::table = {"SensorOptions", kSensorFields};

void SensorOptions::validate() const {
  check_options(*this);
  refuse_if(max_depth_m <= min_depth_m, "SensorOptions.max_depth_m", fmt::format("{}", max_depth_m),
            fmt::format("more than min_depth_m, {}", min_depth_m));
}

std::vector<std::uint8_t> expose(const RenderedFrame& frame, const SensorOptions& options,
                                 std::uint64_t stream, const Executor& executor) {
  options.validate();
  std::vector<std::uint8_t> image(frame.bgr.size());
  // Fixed point: 16 fractional bits of a grey level.
  constexpr double kOne = 65536.0;
  std::array<std::int32_t, kTableSize> noise{};
  for (std::size_t i = 0; i < kTableSize; ++i) {
    noise[i] = static_cast<std::int32_t>(
        std::lround((options.color_noise * normal_table()[i] + 0.5) * kOne));
  }
  // Light is cut off well above white, so that the product fits.
  const auto gain = static_cast<std::int64_t>(
      std::lround(options.exposure * kOne / RenderedFrame::kLightPerLevel));
  const std::size_t row_size = std::size_t{frame.width} * 3;
  executor.for_blocks(frame.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      NoiseStream random(stream, row);
      const std::uint16_t* const light = frame.bgr.data() + row * row_size;
      std::uint8_t* const out = image.data() + row * row_size;
      for (std::size_t i = 0; i < row_size;) {
        std::uint64_t draw = random.next();
        const std::size_t stop = std::min(row_size, i + 5);
        for (; i < stop; ++i, draw >>= kTableBits) {
          const std::int64_t level = (light[i] * gain + noise[draw & (kTableSize - 1)]) >> 16;
          out[i] = static_cast<std::uint8_t>(std::clamp<std::int64_t>(level, 0, 255));
        }
      }
    }
  });
  return image;
}

std::vector<float> measure_depth(const RenderedFrame& frame, double focal_length_px,
                                 const SensorOptions& options, std::uint64_t stream,
                                 const Executor& executor) {
  options.validate();
  if (options.ideal_depth) return frame.depth_m;
  const std::size_t width = frame.width;
  std::vector<float> image(frame.depth_m.size(), 0.0F);
  // Rounding to steps has a deviation of step / sqrt(12) of its own.
  const double rounding = options.depth_step_m * options.depth_step_m / 12.0;
  const auto deviation = static_cast<float>(
      std::sqrt(std::max(0.0, options.depth_noise_m * options.depth_noise_m - rounding)));
  const auto step = static_cast<float>(options.depth_step_m);
  const auto flattest = static_cast<float>(std::cos(options.max_incidence_rad));
  const auto shift = static_cast<float>(options.baseline_m * focal_length_px);
  constexpr double kDraws = 65536.0;
  const auto edge_limit = static_cast<std::uint64_t>(options.edge_holes * kDraws);
  const auto drop_limit = static_cast<std::uint64_t>(options.dropout * kDraws * kDraws);
  const auto near = static_cast<float>(options.min_depth_m);
  const auto far = static_cast<float>(options.max_depth_m);
  const auto& normal = normal_table();
  executor.for_blocks(frame.height, kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      NoiseStream random(stream ^ 0x6465707468ULL, row);
      const float* const z = frame.depth_m.data() + row * width;
      const float* const above = row > 0 ? z - width : z;
      const float* const below = row + 1 < frame.height ? z + width : z;
      const float* const facing = frame.facing.data() + row * width;
      float* const out = image.data() + row * width;
      // The leftmost column of the projector that what lies to the right has taken up.
      float taken = std::numeric_limits<float>::infinity();
      for (std::size_t i = width; i-- > 0;) {
        const std::uint64_t draw = random.next();
        const float depth = z[i];
        if (!(depth > 0.0F)) continue;
        const float inverse = 1.0F / depth;
        const float column = static_cast<float>(i) - shift * inverse;
        // Half a pixel of tolerance: a slanted surface does not shade itself.
        const bool in_shadow = column > taken + 0.5F;
        taken = std::min(taken, column);
        constexpr float kJump = 0.03F;
        const auto jumps = [&](float other) { return std::abs(other - depth) > kJump * depth; };
        const bool edge = jumps(above[i]) || jumps(below[i]) || (i > 0 && jumps(z[i - 1])) ||
                          (i + 1 < width && jumps(z[i + 1]));
        if (depth < near || depth > far || facing[i] < flattest) continue;
        if (in_shadow && shift > 0.0F) continue;
        if (edge && (draw & 0xffffU) < edge_limit) continue;
        if (((draw >> 16) & 0xffffffffU) < drop_limit) continue;
        float measured = inverse + deviation * normal[draw >> (64 - kTableBits)];
        if (step > 0.0F) measured = std::floor(measured / step + 0.5F) * step;
        const float result = measured > 0.0F ? 1.0F / measured : 0.0F;
        out[i] = result >= near && result <= far ? result : 0.0F;
      }
    }
  });
  return image;
}

}  // namespace cairn

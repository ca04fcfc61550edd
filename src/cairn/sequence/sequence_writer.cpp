// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sequence/sequence_writer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/sequence/image_file.hpp"

namespace cairn {
namespace {

void write_text(const std::filesystem::path& path, std::string_view text) {
  write_file(path, [&](const ByteSink& sink) { sink(text); });
}

cv::Mat stored_depth(const cv::Mat& depth_m, double units_per_metre) {
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  cv::Mat stored(depth_m.size(), CV_16UC1);
  for (int row = 0; row < depth_m.rows; ++row) {
    const auto* const from = depth_m.ptr<float>(row);
    auto* const to = stored.ptr<std::uint16_t>(row);
    for (int column = 0; column < depth_m.cols; ++column) {
      const double units = std::round(from[column] * units_per_metre);
      // What the format cannot hold is no reading, as with the camera itself.
      to[column] = units > 0.0 && units <= kMost ? static_cast<std::uint16_t>(units) : 0;
    }
  }
  return stored;
}

}  // namespace

SequenceWriter::SequenceWriter(const std::filesystem::path& folder, double depth_units_per_metre)
    : folder_(folder), depth_units_per_metre_(depth_units_per_metre) {
  if (std::filesystem::exists(folder / "rgb.txt")) {
    throw Error(ErrorKind::kMisuse, folder.string(), "holds a sequence already", "a new folder");
  }
  for (const char* const part : {"rgb", "depth"}) {
    std::error_code error;
    std::filesystem::create_directories(folder / part, error);
    if (error) {
      throw Error(ErrorKind::kStorage, (folder / part).string(),
                  "cannot be made: " + error.message(), "");
    }
  }
}

void SequenceWriter::add(double timestamp_s, const cv::Mat& color, const cv::Mat& depth_m) {
  if (color.empty() || color.size() != depth_m.size() || depth_m.type() != CV_32FC1) {
    throw Error(ErrorKind::kMisuse, "image", "colour and depth do not go together",
                "one size, and depth as 32-bit float");
  }
  const std::string time = fmt::format("{:.6f}", timestamp_s);
  const std::string color_file = "rgb/" + time + ".png";
  const std::string depth_file = "depth/" + time + ".png";
  write_png(folder_ / color_file, color);
  write_png(folder_ / depth_file, stored_depth(depth_m, depth_units_per_metre_));
  color_list_ += fmt::format("{} {}\n", time, color_file);
  depth_list_ += fmt::format("{} {}\n", time, depth_file);
}

void SequenceWriter::finish() {
  write_text(folder_ / "depth.txt", depth_list_);
  write_text(folder_ / "rgb.txt", color_list_);
}

}  // namespace cairn

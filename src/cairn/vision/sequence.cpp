// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/sequence.hpp"

#include <algorithm>
#include <cstdint>
#include <system_error>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/vision/detail/tum_layout.hpp"
#include "cairn/vision/image.hpp"

namespace cairn {
namespace {

std::vector<detail::ImageEntry> list_in(const std::filesystem::path& file, const LogSink& log) {
  FileReader reader(file);
  return detail::read_image_list(reader, log);
}

}  // namespace

constexpr OptionRange kSequenceRange = {.least = 0.0,
                                        .most = 1e9,
                                        .expected = "a positive number",
                                        .least_is = OptionRange::End::kExcluded,
                                        .most_is = OptionRange::End::kExcluded};
constexpr OptionField kSequenceFields[] = {
    {"depth_units_per_metre", option_at<&SequenceOptions::depth_units_per_metre>, kSequenceRange},
    {"max_time_difference_s", option_at<&SequenceOptions::max_time_difference_s>, kSequenceRange,
     "--max-time-difference",
     "Largest time difference between a colour image and its depth image, seconds"},
};
constinit const OptionTable SequenceOptions::table = {"SequenceOptions", kSequenceFields};

void SequenceOptions::validate() const {
  check_options(*this);
}

RgbdSequence::RgbdSequence(const std::filesystem::path& folder, const SequenceOptions& options,
                           const LogSink& log)
    : depth_units_per_metre_(options.depth_units_per_metre) {
  options.validate();
  std::error_code ignored;
  const std::filesystem::file_type type = std::filesystem::status(folder, ignored).type();
  // If the type is unknown, the reader of the list says why.
  reject_if(
      type != std::filesystem::file_type::directory && type != std::filesystem::file_type::none,
      folder.string(), "not a folder", "the folder of a sequence with rgb.txt and depth.txt");
  const std::vector<detail::ImageEntry> color = list_in(folder / "rgb.txt", log);
  const std::vector<detail::ImageEntry> depth = list_in(folder / "depth.txt", log);
  for (const detail::ImagePair& pair :
       detail::associate_images(color, depth, options.max_time_difference_s)) {
    SequenceFrame frame{color[pair.color].timestamp_s, folder / color[pair.color].file, {}};
    if (pair.depth) {
      frame.depth = folder / depth[*pair.depth].file;
    } else {
      ++frames_without_depth_;
    }
    frames_.push_back(std::move(frame));
  }
  unused_depth_images_ = depth.size() - (frames_.size() - frames_without_depth_);
}

RgbdSequence::Images RgbdSequence::read(std::size_t frame) const {
  refuse_if(frame >= frames_.size(), "frame", fmt::format("{} of {}", frame, frames_.size()),
            "the position of a frame");
  Images images;
  images.gray = read_gray_image(frames_[frame].color);
  if (const auto& path = frames_[frame].depth) {
    const StoredDepthImage stored = read_depth_image(*path);
    reject_if(!same_size(stored, images.gray), path->string(),
              fmt::format("{} x {} pixels", stored.width, stored.height),
              fmt::format("{} x {}, as its colour image", images.gray.width, images.gray.height));
    const auto metres_per_unit = static_cast<float>(1.0 / depth_units_per_metre_);
    images.depth = DepthImage(stored.width, stored.height);
    std::transform(
        stored.values.begin(), stored.values.end(), images.depth.values.begin(),
        [&](std::uint16_t units) { return static_cast<float>(units) * metres_per_unit; });
  }
  return images;
}

}  // namespace cairn

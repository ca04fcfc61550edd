// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/sequence.hpp"

#include <algorithm>
#include <cstdint>
#include <system_error>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/detail/recorded_images.hpp"
#include "cairn/vision/detail/rectification.hpp"
#include "cairn/vision/detail/sequence_layouts.hpp"

namespace cairn {

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

ImageSequence::ImageSequence(const std::filesystem::path& path, const SequenceOptions& options,
                             const LogSink& log) {
  options.validate();
  detail::SequenceLists lists;
  if (detail::RecordedImages::is_at(path)) {
    recorded_ = std::make_shared<detail::RecordedImages>(path, options.topics, log);
    lists = recorded_->lists(!options.rig);
  } else {
    refuse_if(!options.topics.empty(), "topics", "given, but " + path.string() + " has none",
              "a recording");
    std::error_code ignored;
    const std::filesystem::file_type type = std::filesystem::status(path, ignored).type();
    reject_if(type == std::filesystem::file_type::not_found, path.string(), "does not exist",
              "the folder of a sequence, or a bag, .mcap or .db3 of ROS");
    // If the type is unknown, the reader of the list says why.
    reject_if(
        type != std::filesystem::file_type::directory && type != std::filesystem::file_type::none,
        path.string(), "neither a folder nor a recording",
        "the folder of a sequence, or a bag, .mcap or .db3 of ROS");
    lists = detail::read_sequence_lists(path, !options.rig, log);
  }
  depth_units_per_metre_ = options.depth_units_per_metre.value_or(lists.depth_units_per_metre);
  camera_ = lists.camera;
  unknown_depth_ = lists.unknown_depth;
  is_stereo_ = !lists.calibration.empty();
  refuse_if(options.rig && !is_stereo_, "rig", "given, but " + path.string() + " is RGB-D",
            "one camera");
  // The two images of a stereo pair are taken at once; what moves in between has another disparity.
  constexpr double kAtOnce = 0.001;
  const double tolerance_s = is_stereo() ? std::min(kAtOnce, options.max_time_difference_s)
                                         : options.max_time_difference_s;
  partners_ = detail::associate_images(lists.images, lists.partners, tolerance_s);
  for (std::size_t i = 0; i < lists.images.size(); ++i) {
    SequenceFrame& frame =
        frames_.emplace_back(lists.images[i].timestamp_s, path / lists.images[i].file);
    if (!partners_[i]) {
      ++frames_without_depth_;
    } else {
      (is_stereo() ? frame.right : frame.depth) = path / lists.partners[*partners_[i]].file;
    }
  }
  unused_depth_images_ = lists.partners.size() - (frames_.size() - frames_without_depth_);
  reject_if(
      is_stereo() && frames_without_depth_ == frames_.size(), path.string(),
      lists.partners.empty()
          ? "no image of the right camera"
          : fmt::format("no pair of images within {} s: the first are from {:.6f} and {:.6f} s",
                        tolerance_s, lists.images[0].timestamp_s, lists.partners[0].timestamp_s),
      "pairs of images that were taken at once");
  if (is_stereo_) {
    rectify(options.rig ? *options.rig : *lists.rig,
            options.rig ? "rig" : lists.calibration.string());
  }
}

void ImageSequence::rectify(StereoRig rig, const std::string& source) {
  if (rig.left.width == 0) {
    const GrayImage first = image_of<GrayImage>(0);
    for (Camera* const camera : {&rig.left, &rig.right}) {
      camera->width = first.width;
      camera->height = first.height;
    }
  }
  rectification_ = std::make_shared<detail::Rectification>(rig, source);
}

bool ImageSequence::is_in(const std::filesystem::path& path) {
  return detail::RecordedImages::is_at(path) || detail::has_sequence_files(path);
}

double ImageSequence::baseline_m() const {
  return rectification_ ? rectification_->baseline_m() : 0.0;
}

Camera ImageSequence::camera(const std::optional<Camera>& given) const {
  if (!rectification_) {
    if (!given && recorded_) return recorded_->camera();
    const std::optional<Camera>& known = given ? given : camera_;
    refuse_if(!known, "camera", "not given", "the camera of an RGB-D sequence");
    return *known;
  }
  refuse_if(given.has_value(), "camera", "given, but the stereo sequence has its calibration",
            "no camera");
  return rectification_->camera();
}

Trajectory ImageSequence::recorded_poses(const std::string& topic) const {
  refuse_if(!recorded_, "topic", printable(topic) + " of a folder", "a recording");
  const Trajectory recorded = recorded_->poses(topic);
  if (!rectification_) return recorded;
  std::vector<TimedPose> poses(recorded.poses().begin(), recorded.poses().end());
  for (TimedPose& pose : poses) {
    pose.world_from_camera = pose.world_from_camera * rectification_->left_from_rectified();
  }
  return Trajectory(std::move(poses));
}

const SequenceFrame& ImageSequence::files_of(std::size_t frame) const {
  refuse_if(frame >= frames_.size(), "frame", fmt::format("{} of {}", frame, frames_.size()),
            "the position of a frame");
  return frames_[frame];
}

template <class ImageOf>
ImageOf ImageSequence::image_of(std::size_t frame) const {
  const std::filesystem::path& file = files_of(frame).color;
  if (recorded_) return recorded_->image<ImageOf>(frame, file);
  return decode_image<ImageOf>(read_file(file), file);
}

DepthImage ImageSequence::depth_of(std::size_t frame) const {
  const std::filesystem::path& file = *frames_[frame].depth;
  if (recorded_) return recorded_->depth(*partners_[frame], file, depth_units_per_metre_);
  StoredDepthImage stored = read_depth_image(file);
  if (unknown_depth_) std::ranges::replace(stored.values, *unknown_depth_, std::uint16_t{0});
  return metric_depth(stored, depth_units_per_metre_);
}

ImageSequence::Images ImageSequence::read(std::size_t frame) const {
  const SequenceFrame& files = files_of(frame);
  Images images;
  images.gray = image_of<GrayImage>(frame);
  const auto reject_unless_same = [&](const auto& image, const std::filesystem::path& file,
                                      std::string_view other) {
    reject_if(
        !same_size(image, images.gray), file.string(),
        fmt::format("{} x {} pixels", image.width, image.height),
        fmt::format("{} x {}, as its {} image", images.gray.width, images.gray.height, other));
  };
  if (files.depth) {
    images.depth = depth_of(frame);
    reject_unless_same(images.depth, *files.depth, "colour");
  }
  if (files.right) {
    images.right = recorded_ ? recorded_->right(*partners_[frame], *files.right)
                             : read_gray_image(*files.right);
    reject_unless_same(images.right, *files.right, "left");
  }
  if (rectification_) {
    require_rig_size(images.gray, files.color);
    images.gray = rectification_->left(std::move(images.gray));
    if (files.right) images.right = rectification_->right(std::move(images.right));
  }
  return images;
}

ColorImage ImageSequence::read_color(std::size_t frame) const {
  ColorImage image = image_of<ColorImage>(frame);
  if (!rectification_) return image;
  require_rig_size(image, files_of(frame).color);
  return rectification_->left(std::move(image));
}

template <class ImageOf>
void ImageSequence::require_rig_size(const ImageOf& image,
                                     const std::filesystem::path& file) const {
  const Camera& camera = rectification_->camera();
  reject_if(image.width != camera.width || image.height != camera.height, file.string(),
            fmt::format("{} x {} pixels", image.width, image.height),
            fmt::format("{} x {}, as the camera has", camera.width, camera.height));
}

}  // namespace cairn

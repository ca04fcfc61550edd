// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include "cairn/core/log.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/camera.hpp"
#include "cairn/vision/detail/sequence_layouts.hpp"
#include "cairn/vision/image.hpp"

namespace cairn::detail {

/// The images of an RGB-D or stereo camera in a recording of ROS. Knows where the images are, and reads them one by
/// one.
class RecordedImages {
 public:
  static bool is_at(const std::filesystem::path& path);

  /// @param topics see choose_topics()
  /// @throws Error (input) as Recording and choose_topics(), and if another camera than that of the images took the
  ///         depth and the recording does not state where it is; (misuse) if this build reads no recordings
  RecordedImages(const std::filesystem::path& path, const std::string& topics, const LogSink& log);
  ~RecordedImages();

  /// Times are those of the messages' headers. Of several images at one time, the first is kept.
  /// @param needs_rig whether the calibration of a stereo camera is read, and must exist
  SequenceLists lists(bool needs_rig) const;
  /// The camera of the images of an RGB-D camera.
  /// @throws Error (input) if it is not recorded or not calibrated
  Camera camera() const;

  /// Poses of the camera of the images, see camera_poses().
  Trajectory poses(const std::string& topic) const;

  // Images by position in the lists. Thread-safe; names are for errors.
  template <class ImageOf>  // GrayImage or ColorImage
  ImageOf image(std::size_t i, const std::filesystem::path& name) const;
  GrayImage right(std::size_t i, const std::filesystem::path& name) const;
  /// Depth for the pixels of the image, even if another camera measured the depth.
  DepthImage depth(std::size_t i, const std::filesystem::path& name, double units_per_metre) const;

 private:
  struct Content;
  std::unique_ptr<const Content> content_;
};

}  // namespace cairn::detail

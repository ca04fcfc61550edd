// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/core/log.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/geometry/trajectory.hpp"
#include "cairn/map/camera_calibration.hpp"
#include "cairn/vision/image.hpp"

namespace cairn {

namespace detail {
class FileLock;
class RecordedImages;
class Rectification;
}  // namespace detail

/// The files of one frame of a sequence; for a recording, descriptive names of the messages.
struct SequenceFrame {
  double timestamp_s = 0.0;                    ///< time of the colour or left image
  std::filesystem::path color;                 ///< colour image; left image of a stereo sequence
  std::optional<std::filesystem::path> depth;  ///< std::nullopt if no depth image is close in time
  std::optional<std::filesystem::path> right;  ///< std::nullopt without a simultaneous right image
};

struct SequenceOptions {
  /// Units per metre of depths stored as integers; positive. std::nullopt: the layout's scale, 5000
  /// for TUM and ICL-NUIM, 1000 for 7-Scenes and recordings.
  std::optional<double> depth_units_per_metre = {};
  double max_time_difference_s = 0.02;  ///< between a colour image and its depth image; positive
  /// Topics of a recording: "IMAGE,DEPTH" or "LEFT,RIGHT"; empty: automatic, see choose_topics().
  std::string topics = {};
  /// Calibration that replaces a stereo sequence's own. Cameras of width 0 get the images' size.
  std::optional<StereoRig> rig = {};

  static const OptionTable table;
  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Units of TUM's depth images per metre.
inline constexpr double kTumDepthUnits = 5000.0;

/// An RGB-D or stereo sequence on disk, in the layout of the TUM RGB-D benchmark, ICL-NUIM,
/// 7-Scenes, KITTI odometry or EuRoC, or a Recording of ROS. The constructor detects the layout and
/// loads the lists. Images are read one by one; stereo pairs are rectified.
class ImageSequence {
 public:
  /// @throws Error (input) naming file, line and field if lists or calibration cannot be read, and
  ///        for a stereo sequence without images simultaneous to 1 ms; (misuse) for a rig with an
  ///        RGB-D sequence
  explicit ImageSequence(const std::filesystem::path& path, const SequenceOptions& options = {},
                         const LogSink& log = {});

  /// Whether the path is a recording, or a folder with a file of one of the layouts.
  static bool is_in(const std::filesystem::path& path);

  /// In temporal order.
  std::span<const SequenceFrame> frames() const { return frames_; }
  /// Number of frames with neither a depth nor a right image.
  std::size_t frames_without_depth() const { return frames_without_depth_; }
  /// Number of depth or right images without a frame.
  std::size_t unused_depth_images() const { return unused_depth_images_; }

  /// Whether camera() needs no argument: for stereo, recordings and layouts with a known camera.
  bool has_camera() const { return is_stereo() || recorded_ != nullptr || camera_.has_value(); }
  bool is_stereo() const { return is_stereo_; }
  /// Baseline of a stereo sequence, metres; else 0.
  double baseline_m() const;
  /// Units per metre of depth stored as integers.
  double depth_units_per_metre() const { return depth_units_per_metre_; }
  /// The camera of the images that read() returns: the rectified camera of a stereo sequence;
  /// otherwise `given`, or else the camera of the recording or layout.
  /// @throws Error (misuse) if no camera is known, or a camera is given for a stereo sequence;
  ///         (input) for a recorded camera that is not calibrated
  Camera camera(const std::optional<Camera>& given) const;

  /// Poses of the camera of read(), from a topic of a recording; see camera_poses().
  /// @throws Error as camera_poses(); (misuse) if the sequence is not a recording
  Trajectory recorded_poses(const std::string& topic) const;

  /// Images of one frame.
  struct Images {
    GrayImage gray;
    DepthImage depth;  ///< empty if the frame has none
    GrayImage right;   ///< empty if the frame has none
  };
  /// Thread-safe.
  /// @throws Error (input) naming the file: missing, truncated, damaged, or colour and depth of different
  ///        sizes
  Images read(std::size_t frame) const;
  /// The image of `frames()[frame].color`, which read() returns in grey. Thread-safe.
  /// @throws Error as read()
  ColorImage read_color(std::size_t frame) const;

 private:
  void rectify(StereoRig rig, const std::string& source);
  const SequenceFrame& files_of(std::size_t frame) const;
  template <class ImageOf>
  ImageOf image_of(std::size_t frame) const;
  DepthImage depth_of(std::size_t frame) const;
  template <class ImageOf>
  void require_rig_size(const ImageOf& image, const std::filesystem::path& file) const;

  double depth_units_per_metre_ = kTumDepthUnits;
  bool is_stereo_ = false;
  std::optional<Camera> camera_;                                // known by the layout
  std::optional<std::uint16_t> unknown_depth_;                  // besides 0
  std::shared_ptr<const detail::Rectification> rectification_;  // for stereo only
  std::shared_ptr<const detail::RecordedImages> recorded_;      // for recordings only
  std::vector<SequenceFrame> frames_;
  std::vector<std::optional<std::size_t>> partners_;  // per frame: index in the partners' list
  std::size_t frames_without_depth_ = 0;
  std::size_t unused_depth_images_ = 0;
};

/// Format of colour images.
enum class ColorFormat {
  kPng,   ///< lossless
  kJpeg,  ///< quality 95: several times faster to write and smaller
};

/// Writes an RGB-D sequence in the layout of the TUM benchmark, or a stereo sequence in EuRoC's
/// layout. add() writes images and finish() writes the lists, so that an unfinished folder is not
/// mistaken for a sequence. The destructor of an unfinished writer deletes its files. A folder has
/// one writer at a time. A killed process leaves a hidden list of its files in the folder; the next
/// writer deletes these files and uses the folder.
class SequenceWriter {
 public:
  /// Creates the folder.
  /// @param depth_units_per_metre scale of the stored depth; positive
  /// @throws Error (storage) if the folder cannot be created or another writer uses it, (misuse) if
  ///        it holds a sequence
  explicit SequenceWriter(const std::filesystem::path& folder,
                          ColorFormat color_format = ColorFormat::kPng,
                          double depth_units_per_metre = kTumDepthUnits);
  /// For a stereo sequence.
  /// @throws Error as above; (misuse) for camera models that EuRoC's layout does not support
  SequenceWriter(const std::filesystem::path& folder, const StereoRig& rig,
                 ColorFormat color_format);
  ~SequenceWriter();
  SequenceWriter(const SequenceWriter&) = delete;
  SequenceWriter& operator=(const SequenceWriter&) = delete;

  /// Adds a frame. Thread-safe; frames may be added in any order.
  /// @param depth_m depth of the colour image's size; values that are not finite: no reading
  /// @throws Error (storage) naming the file; (misuse) for images of different sizes, or a
  ///        timestamp that equals an earlier one to the microsecond
  void add(double timestamp_s, const ColorImage& color, const DepthImage& depth_m);
  /// Adds a stereo pair.
  void add(double timestamp_s, const ColorImage& left, const ColorImage& right);
  /// Writes another file into the sequence's folder; replaces one of that name. Not thread-safe.
  /// @throws Error (storage) naming the file
  void add_file(const std::string& name, const std::function<void(const ByteSink&)>& write);
  /// Writes the lists, in temporal order.
  void finish();

  /// Whether the sequence in this folder is unfinished: its writer still runs or was killed.
  static bool is_unfinished(const std::filesystem::path& folder);

 private:
  // The images of one camera.
  struct Part {
    std::filesystem::path images;  // folder, relative to the sequence's
    std::filesystem::path list;
  };
  struct Entry {
    double timestamp_s;
    std::string time;  // as the layout writes it
    std::array<std::string, 2> files;
  };

  SequenceWriter(const std::filesystem::path& folder, ColorFormat color_format,
                 double depth_units_per_metre, std::array<Part, 2> parts);
  bool is_stereo() const;
  Entry add_entry(double timestamp_s, std::string_view second_ending);
  void write_color(const std::string& file, const ColorImage& image) const;
  void take_folder();
  void delete_leftovers() const;
  void make_folder(const std::filesystem::path& folder);
  void list(std::string names) const;
  void discard();

  std::filesystem::path folder_;
  std::array<Part, 2> parts_;
  ColorFormat color_format_;
  double depth_units_per_metre_;
  // The hidden file, locked until the sequence is finished.
  std::unique_ptr<detail::FileLock> unfinished_;
  std::vector<std::filesystem::path> made_;  // created folders, outermost first
  std::mutex mutex_;
  std::vector<Entry> entries_;
  std::vector<std::filesystem::path> files_;  // other than images
  bool finished_ = false;
};

}  // namespace cairn

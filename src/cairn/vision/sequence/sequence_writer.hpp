// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/vision/sequence/image.hpp"

namespace cairn {

namespace detail {
class FileLock;
}

/// Format of colour images.
enum class ColorFormat {
  kPng,   ///< lossless
  kJpeg,  ///< quality 95: several times faster to write and smaller
};

struct SequenceWriterOptions {
  double depth_units_per_metre = 5000.0;  ///< of the stored depth; positive
  ColorFormat color_format = ColorFormat::kPng;

  /// @throws Error (misuse) naming the field
  void validate() const;
};

/// Writes an RGB-D sequence in the layout of the TUM benchmark. Images are written by add(), the lists by
/// finish(), so that an unfinished folder is not mistaken for a sequence. Destroying an unfinished writer
/// removes what it wrote. A folder has one writer at a time. A killed process leaves a hidden file in it that lists
/// what it wrote; the next writer deletes that and takes the folder over.
class SequenceWriter {
 public:
  /// Creates the folder.
  /// @throws Error (storage) if it cannot be created or another writer is at work in it, (misuse) if it holds a
  ///        sequence
  explicit SequenceWriter(const std::filesystem::path& folder,
                          const SequenceWriterOptions& options = {});
  ~SequenceWriter();
  SequenceWriter(const SequenceWriter&) = delete;
  SequenceWriter& operator=(const SequenceWriter&) = delete;

  /// Thread-safe: frames may come in any order, and several at once.
  /// @param depth_m of the colour image's size; values that are not finite count as no reading
  /// @throws Error (storage) naming the file; (misuse) for images of different sizes, or a timestamp that
  ///        was added before, to the microsecond
  void add(double timestamp_s, const ColorImage& color, const DepthImage& depth_m);
  /// Writes another file of the sequence into its folder, over one of that name. Not thread-safe.
  /// @throws Error (storage) naming the file
  void add_file(const std::string& name, const std::function<void(const ByteSink&)>& write);
  /// Writes the lists, in the order of time.
  void finish();

  /// Whether the sequence in this folder is not finished: its writer is at work or was killed.
  static bool is_unfinished(const std::filesystem::path& folder);

 private:
  struct Entry {
    double timestamp_s;
    std::string time;
    std::string color;
    std::string depth;
  };

  void take_folder();
  void delete_leftovers() const;
  void make_folder(const std::filesystem::path& folder);
  void list(std::string names) const;
  void discard();

  std::filesystem::path folder_;
  SequenceWriterOptions options_;
  // The hidden file, locked until the sequence is finished.
  std::unique_ptr<detail::FileLock> unfinished_;
  std::vector<std::filesystem::path> made_;  // created folders, outermost first
  std::mutex mutex_;
  std::vector<Entry> entries_;
  std::vector<std::filesystem::path> files_;  // other than images
  bool finished_ = false;
};

}  // namespace cairn

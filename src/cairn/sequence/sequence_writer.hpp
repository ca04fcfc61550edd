// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/sequence/image.hpp"

namespace cairn {

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
/// removes what it wrote. A killed process leaves a hidden file in the folder, and the next writer takes the
/// folder over.
class SequenceWriter {
 public:
  /// Creates the folder.
  /// @throws Error (storage) if it cannot be created, (misuse) if it holds a sequence
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

  /// Whether a writer was killed before it had finished the sequence in this folder.
  static bool left_unfinished(const std::filesystem::path& folder);

 private:
  struct Entry {
    double timestamp_s;
    std::string time;
    std::string color;
    std::string depth;
  };

  std::filesystem::path folder_;
  SequenceWriterOptions options_;
  std::vector<std::filesystem::path> made_;  // created folders, innermost first
  std::mutex mutex_;
  std::vector<Entry> entries_;
  std::vector<std::filesystem::path> files_;  // other than images
  bool finished_ = false;
};

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core/mat.hpp>

namespace cairn {

/// Writes an RGB-D sequence in the layout of the TUM benchmark. Images are written as they come; the
/// lists by finish(), so that an unfinished folder is not taken for a sequence.
class SequenceWriter {
 public:
  /// Makes the folder.
  /// @throws Error (storage) if it cannot be made, (misuse) if it holds a sequence already
  explicit SequenceWriter(const std::filesystem::path& folder,
                          double depth_units_per_metre = 5000.0);

  /// @param color   8-bit grey or blue, green, red
  /// @param depth_m 32-bit float of the same size, metres; 0 or not finite where there is no reading
  void add(double timestamp_s, const cv::Mat& color, const cv::Mat& depth_m);
  void finish();

 private:
  std::filesystem::path folder_;
  double depth_units_per_metre_;
  std::string color_list_ = "# timestamp filename\n";
  std::string depth_list_ = "# timestamp filename\n";
};

}  // namespace cairn

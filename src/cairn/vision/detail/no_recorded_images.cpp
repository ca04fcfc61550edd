// SPDX-License-Identifier: BSD-3-Clause
// In the place of recorded_images.cpp where the libraries that it needs are left out.
#include "cairn/core/error.hpp"
#include "cairn/vision/detail/recorded_images.hpp"

namespace cairn::detail {

struct RecordedImages::Content {};

bool RecordedImages::is_at(const std::filesystem::path& path) {
  const std::filesystem::path ending = path.extension();
  return ending == ".mcap" || ending == ".bag" || ending == ".db3";
}

RecordedImages::RecordedImages(const std::filesystem::path& path, const std::string&,
                               const LogSink&) {
  throw Error(ErrorKind::kMisuse, path.string(), "this build of Cairn reads no recordings of ROS",
              "one with CAIRN_WITH_BAGS");
}

RecordedImages::~RecordedImages() = default;

// No object of it is ever there.
SequenceLists RecordedImages::lists(bool) const {
  return {};
}

Camera RecordedImages::camera() const {
  return {};
}

Trajectory RecordedImages::poses(const std::string&) const {
  return {};
}

template <class ImageOf>
ImageOf RecordedImages::image(std::size_t, const std::filesystem::path&) const {
  return {};
}
template GrayImage RecordedImages::image(std::size_t, const std::filesystem::path&) const;
template ColorImage RecordedImages::image(std::size_t, const std::filesystem::path&) const;

GrayImage RecordedImages::right(std::size_t, const std::filesystem::path&) const {
  return {};
}

DepthImage RecordedImages::depth(std::size_t, const std::filesystem::path&, double) const {
  return {};
}

}  // namespace cairn::detail

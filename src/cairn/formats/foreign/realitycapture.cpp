// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/formats/detail/bytes/record_reader.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/formats/detail/foreign/written_frames.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

struct ImageSize {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
};

// From the first bytes of a PNG or JPEG image; std::nullopt for others.
std::optional<ImageSize> image_size(std::string_view bytes) {
  const auto number = [&](std::size_t place, std::size_t count) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) {
      value = value << 8 | static_cast<std::uint8_t>(bytes[place + i]);
    }
    return value;
  };
  if (bytes.starts_with("\x89PNG\r\n\x1a\n") && bytes.size() >= 24) {
    return ImageSize{number(16, 4), number(20, 4)};
  }
  if (!bytes.starts_with("\xff\xd8")) return std::nullopt;
  for (std::size_t place = 2; place + 9 <= bytes.size() && number(place, 1) == 0xff;) {
    const std::uint32_t marker = number(place + 1, 1);
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame) return ImageSize{number(place + 7, 2), number(place + 5, 2)};
    place += 2 + number(place + 2, 2);
  }
  return std::nullopt;
}

std::optional<ImageSize> image_size(const fs::path& path) {
  if (!is_file(path)) return std::nullopt;
  constexpr std::size_t kEnough = std::size_t{1} << 18;  // for what cameras write before the size
  FileReader file(path);
  std::string bytes(kEnough, '\0');
  std::size_t size = 0;
  for (std::size_t got = 1; got > 0 && size < bytes.size(); size += got) {
    got = file.read(bytes.data() + size, bytes.size() - size);
  }
  return image_size(std::string_view(bytes).substr(0, size));
}

class RealityCaptureReader {
 public:
  RealityCaptureReader(ByteSource& source, fs::path folder, const Execution& execution)
      : progress_(execution, source.size().value_or(0)),
        in_(source, progress_, Separator::kComma),
        folder_(std::move(folder)),
        out_(source.name(), execution, kPixelCentre) {}

  LandmarkMap read() && {
    read_header();
    while (in_.next_record()) read_frame();
    out_.lost(without_size_,
              fmt::format("of {} frames have no known camera: the file states no size "
                          "of their images, and no PNG or JPEG image is there",
                          out_.frame_count()));
    out_.lost(without_model_,
              "cameras are unknown to the map: their distortion k4, t1 or t2 is not 0");
    return std::move(out_).finish();
  }

 private:
  void read_header() {
    in_.next_line();
    while (in_.has_word()) columns_.emplace_back(in_.word("name of a column"));
    for (const char* name : {"#name", "x", "y", "alt", "heading", "pitch", "roll"}) {
      if (std::find(columns_.begin(), columns_.end(), name) == columns_.end()) {
        in_.refuse("names of columns", fmt::format("there is no {}", name),
                   "#name,x,y,alt,heading,pitch,roll and, for cameras, f,px,py,k1,k2,k3,k4,t1,t2");
      }
    }
  }

  void read_frame() {
    SfmFrame frame{.id = FrameId{out_.frame_count()}};
    std::map<std::string_view, double> values;
    for (const std::string& column : columns_) {
      if (column == "#name") {
        frame.image_name = in_.word("name");
      } else {
        values[column] = in_.number(column);
      }
    }
    in_.expect_line_end();
    frame.centre = {values["x"], values["y"], values["alt"]};
    // The heading is clockwise; a camera without rotation looks down, with the top of its image to the north.
    const auto turn = [&](const char* angle, double sign, const Eigen::Vector3d& axis) {
      return Eigen::AngleAxisd(sign * values[angle] * std::numbers::pi / 180.0, axis);
    };
    frame.world_from_camera = turn("heading", -1.0, Eigen::Vector3d::UnitZ()) *
                              turn("pitch", 1.0, Eigen::Vector3d::UnitX()) *
                              turn("roll", 1.0, Eigen::Vector3d::UnitY()) *
                              Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);
    if (values.contains("f")) frame.camera = camera_of(values, frame.image_name);
    out_.add_frame(std::move(frame));
  }

  std::optional<CameraIndex> camera_of(std::map<std::string_view, double>& values,
                                       const std::string& image) {
    const auto size = image_size(folder_ / image);
    if (!size) {
      ++without_size_;
      return std::nullopt;
    }
    // Programs disagree on the order of t1 and t2, and Cairn has no model with k4.
    if (values["k4"] != 0.0 || values["t1"] != 0.0 || values["t2"] != 0.0) {
      ++without_model_;
      return std::nullopt;
    }
    const double side = std::max(size->width, size->height);
    constexpr double kFilmMm = 36.0;  // the focal length is of this width
    const double focal = values["f"] / kFilmMm * side;
    Camera camera = opencv_camera(CameraId{out_.tables().cameras.size()}, size->width, size->height,
                                  {focal, focal, values["px"] * side + 0.5 * size->width,
                                   values["py"] * side + 0.5 * size->height},
                                  {.k1 = values["k1"], .k2 = values["k2"], .k3 = values["k3"]});
    const std::string key =
        fmt::format("{} {} {}", camera.width, camera.height, fmt::join(camera.parameters, " "));
    if (!out_.has_camera(key)) out_.add_camera(key, std::move(camera));
    return out_.camera(key);
  }

  ReadingProgress progress_;
  TextRecords in_;
  fs::path folder_;
  SfmBuilder out_;
  std::vector<std::string> columns_;
  std::size_t without_size_ = 0;
  std::size_t without_model_ = 0;
};

}  // namespace

LandmarkMap read_realitycapture(ByteSource& source, const fs::path& folder,
                                const Execution& execution) {
  return RealityCaptureReader(source, folder, execution).read();
}

LandmarkMap read_realitycapture_file(const MapInput& input, const Execution& execution) {
  return read_realitycapture(*input.source, input.path.parent_path(), execution);
}

}  // namespace cairn::detail

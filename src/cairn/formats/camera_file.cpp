// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/camera_file.hpp"

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn {
namespace {

double parse_positive(std::string_view text, const std::string& place, std::string_view key) {
  const auto number = parse_number(text);
  if (!number || *number <= 0.0) {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", place, key),
                printable(text) + " is not a positive number", "a positive number");
  }
  return *number;
}

std::uint32_t parse_size(std::string_view text, const std::string& place, std::string_view key) {
  constexpr std::uint64_t kLargest = 1 << 16;
  const auto number = parse_unsigned(text);
  if (!number || *number == 0 || *number > kLargest) {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", place, key),
                printable(text) + " is no image size", "1 to 65536 pixels");
  }
  return static_cast<std::uint32_t>(*number);
}

std::vector<double> parse_list(std::string_view text, const std::string& place) {
  const auto refuse = [&](std::string_view what) {
    throw Error(ErrorKind::kInput, place + ": parameters", what, "[number, number, ...]");
  };
  if (text.size() < 2 || text.front() != '[' || text.back() != ']') refuse("no list in brackets");
  text = text.substr(1, text.size() - 2);
  std::vector<double> numbers;
  while (!trimmed(text).empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    const std::string_view word = trimmed(text.substr(0, comma));
    const auto number = parse_number(word);
    if (!number) refuse(printable(word) + " is not a number");
    numbers.push_back(*number);
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return numbers;
}

}  // namespace

Camera tum_camera(const std::string& name) {
  // Calibration published with the benchmark; the images of fr3 are already undistorted.
  const auto camera = [](std::vector<double> parameters) {
    return Camera{CameraId{0}, "FULL_OPENCV", 640, 480, std::move(parameters)};
  };
  if (name == "fr1") {
    return camera({517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358,
                   0.002628, 1.163314, 0.0, 0.0, 0.0});
  }
  if (name == "fr2") {
    return camera({520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257,
                   -0.000105, 0.917205, 0.0, 0.0, 0.0});
  }
  if (name == "fr3") {
    return Camera{CameraId{0}, "PINHOLE", 640, 480, {535.4, 539.2, 320.1, 247.6}};
  }
  throw Error(ErrorKind::kMisuse, "camera", printable(name) + " is no camera of the TUM benchmark",
              "fr1, fr2 or fr3");
}

std::optional<double> tum_readout_s(const std::string& name) {
  if (name == "fr1") return 0.026;
  return std::nullopt;
}

CameraFile read_camera_file(ByteSource& source) {
  CameraFile result;
  LineReader lines(source);
  while (const auto line = lines.next()) {
    const std::string_view text = trimmed(line->substr(0, line->find('#')));
    if (text.empty()) continue;
    const std::string place = fmt::format("{}:{}", source.name(), lines.line_number());
    const std::size_t colon = text.find(':');
    const std::string_view key = trimmed(text.substr(0, colon));
    const std::string_view value =
        colon == std::string_view::npos ? std::string_view() : trimmed(text.substr(colon + 1));
    if (key == "model") {
      result.camera.model = std::string(value);
    } else if (key == "width") {
      result.camera.width = parse_size(value, place, key);
    } else if (key == "height") {
      result.camera.height = parse_size(value, place, key);
    } else if (key == "parameters") {
      result.camera.parameters = parse_list(value, place);
    } else if (key == "depth_units_per_metre") {
      result.depth_units_per_metre = parse_positive(value, place, key);
    } else if (key == "readout_s") {
      result.readout_s = parse_positive(value, place, key);
    } else {
      throw Error(ErrorKind::kInput, place, printable(key) + " is no key",
                  "model, width, height, parameters, depth_units_per_metre or readout_s");
    }
  }
  const std::string defect = camera_defect(result.camera);
  if (!defect.empty()) throw Error(ErrorKind::kInput, source.name(), defect, "a usable camera");
  return result;
}

std::string camera_file_text(const CameraFile& file) {
  std::string text = fmt::format(
      "# Pixels: the centre of the top-left pixel is (0, 0).\n"
      "model: {}\nwidth: {}\nheight: {}\nparameters: [",
      file.camera.model, file.camera.width, file.camera.height);
  for (std::size_t i = 0; i < file.camera.parameters.size(); ++i) {
    if (i > 0) text += ", ";
    append_number(text, file.camera.parameters[i]);
  }
  text += "]\n";
  if (file.depth_units_per_metre) {
    text += "depth_units_per_metre: ";
    append_number(text, *file.depth_units_per_metre);
    text += '\n';
  }
  if (file.readout_s) {
    text += "readout_s: ";
    append_number(text, *file.readout_s);
    text += '\n';
  }
  return text;
}

}  // namespace cairn

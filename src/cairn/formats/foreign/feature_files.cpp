// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/feature_files.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/foreign/sfm_builder.hpp"
#include "cairn/map/operations.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

std::optional<fs::path> file_of(const FeatureFiles& files, const std::string& name) {
  for (const fs::path& folder : files.folders) {
    if (fs::path path = folder / name; is_file(path)) return path;
  }
  return std::nullopt;
}

// A histogram of SIFT has eight gradients; VLFeat's first one is Lowe's first, its second one Lowe's last.
void put_in_order_of_lowe(std::vector<std::uint8_t>& descriptor) {
  constexpr std::ptrdiff_t kGradients = 8;
  for (auto begin = descriptor.begin(); begin != descriptor.end(); begin += kGradients) {
    std::reverse(begin + 1, begin + kGradients);
  }
}

class FeatureReader {
 public:
  FeatureReader(const LandmarkMap& model, const FeatureFiles& files, const std::string& place,
                const Execution& execution)
      : landmarks_(model, files.has_landmark),
        files_(files),
        place_(place),
        execution_(execution) {}

  std::optional<DescriptorColumn> read() {
    const std::size_t frames = landmarks_.model().frame_count();
    for (std::uint32_t i = 0; i < frames; ++i) {
      if (execution_.stop.stop_requested()) {
        throw Error(ErrorKind::kCancelled, place_, "reading was cancelled", "");
      }
      if (!landmarks_.wanted(FrameIndex{i}).empty()) take(FrameIndex{i});
    }
    auto column = landmarks_.column(std::string(files_.type.kind), files_.type.numbers);
    if (column && without_file_ > 0) {
      log_remark(execution_.log, place_,
                 fmt::format("{} images have no file of features: no descriptors", without_file_));
    }
    if (unfit_ > 0) {
      log_remark(execution_.log, place_,
                 fmt::format("the features of {} images are left out; the first: {}", unfit_,
                             first_defect_),
                 RemarkKind::kLoss);
    }
    return column;
  }

 private:
  void take(FrameIndex frame) {
    const std::string name = files_.name(frame);
    const auto path = file_of(files_, name + ".desc");
    if (!path) {
      ++without_file_;
      return;
    }
    try {
      take(frame, name, *path);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kInput) throw;
      // The user did not name this file, and the model is complete without it.
      if (unfit_++ == 0) first_defect_ = error.what();
    }
  }

  void take(FrameIndex frame, const std::string& name, const fs::path& path) {
    const std::size_t size = files_.type.numbers * (files_.type.are_floats ? sizeof(float) : 1);
    const std::string content = read_file(path);
    const std::span<const char> rows = feature_descriptors(content, size, path.string());
    const std::size_t count = rows.size() / size;
    std::vector<Pixel> positions;
    const auto positions_path = file_of(files_, name + ".feat");
    if (positions_path) {
      positions = feature_positions(read_file(*positions_path), positions_path->string());
    }
    const auto wanted = landmarks_.wanted(frame);
    const bool fits =
        std::ranges::all_of(wanted, [&](const auto& one) { return one.keypoint < count; }) &&
        (!positions_path || landmarks_.are_near(frame, [&](std::uint32_t keypoint) {
          return keypoint < positions.size() ? std::optional(positions[keypoint]) : std::nullopt;
        }));
    if (!fits) {
      throw Error(ErrorKind::kInput, path.string(), "has other features than the model observes",
                  "those of the same extraction");
    }
    for (const auto& one : wanted) set(one, rows.subspan(one.keypoint * size, size));
  }

  void set(const ModelDescriptors::Wanted& wanted, std::span<const char> row) {
    if (files_.type.are_floats) {
      std::vector<float> values(files_.type.numbers);
      std::memcpy(values.data(), row.data(), row.size());
      landmarks_.set(wanted, std::span<const float>(values));
    } else {
      std::vector<std::uint8_t> bytes(row.begin(), row.end());
      if (files_.type.is_vlfeat) put_in_order_of_lowe(bytes);
      landmarks_.set(wanted, std::span<const std::uint8_t>(bytes));
    }
  }

  ModelDescriptors landmarks_;
  const FeatureFiles& files_;
  const std::string& place_;
  const Execution& execution_;
  std::size_t without_file_ = 0;
  std::size_t unfit_ = 0;
  std::string first_defect_;
};

}  // namespace

std::span<const char> feature_descriptors(std::string_view bytes, std::size_t size,
                                          const std::string& place) {
  std::uint64_t count = 0;
  reject_if(bytes.size() < sizeof count, place, fmt::format("has {} bytes", bytes.size()),
            "the number of descriptors in 8 bytes");
  std::memcpy(&count, bytes.data(), sizeof count);
  bytes.remove_prefix(sizeof count);
  const bool is_whole = bytes.size() % size == 0 && bytes.size() / size == count;
  reject_if(!is_whole, place, fmt::format("has {} bytes for {} descriptors", bytes.size(), count),
            fmt::format("{} for each", size));
  return {bytes.data(), bytes.size()};
}

std::vector<Pixel> feature_positions(std::string_view text, const std::string& place) {
  MemoryReader source(text, place);
  LineReader lines(source);
  std::vector<Pixel> positions;
  std::vector<std::string_view> words;
  while (const auto line = lines.next()) {
    split_words(*line, words);
    if (words.empty()) continue;
    const auto x = parse_number(words[0]);
    const auto y = words.size() > 1 ? parse_number(words[1]) : std::nullopt;
    if (!x || !y) {
      throw Error(ErrorKind::kInput, fmt::format("{}: line {}", place, lines.line_number()),
                  printable(*line), "x y scale orientation");
    }
    positions.push_back({*x, *y});
  }
  return positions;
}

LandmarkMap with_feature_files(LandmarkMap model, const FeatureFiles& files,
                               const std::string& place, const Execution& execution) {
  auto column = FeatureReader(model, files, place, execution).read();
  if (!column) return model;
  MapTables tables = std::move(model).tables();
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn::detail

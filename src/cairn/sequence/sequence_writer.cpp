// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/sequence/sequence_writer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/sequence/image_file.hpp"

namespace cairn {
namespace {

constexpr int kJpegQuality = 95;

// In the folder of a sequence from its first file to its last.
constexpr std::string_view kUnfinished = ".sequence.cairn-unfinished";

StoredDepthImage stored_depth(const DepthImage& depth_m, double units_per_metre) {
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  StoredDepthImage stored(depth_m.width, depth_m.height);
  for (std::size_t i = 0; i < stored.values.size(); ++i) {
    const double units = depth_m.values[i] * units_per_metre + 0.5;
    // Depths beyond the format's range become 0 (no reading), as for a real camera.
    if (units > 0.0 && units < kMost + 1.0) stored.values[i] = static_cast<std::uint16_t>(units);
  }
  return stored;
}

}  // namespace

void SequenceWriterOptions::validate() const {
  const bool possible = depth_units_per_metre > 0.0 && std::isfinite(depth_units_per_metre);
  if (!possible) {
    throw Error(ErrorKind::kMisuse, "SequenceWriterOptions.depth_units_per_metre",
                fmt::format("{}", depth_units_per_metre), "a positive number");
  }
}

SequenceWriter::SequenceWriter(const std::filesystem::path& folder,
                               const SequenceWriterOptions& options)
    : folder_(folder), options_(options) {
  options_.validate();
  if (std::filesystem::exists(folder / "rgb.txt") && !left_unfinished(folder)) {
    throw Error(ErrorKind::kMisuse, folder.string(), "holds a sequence already", "a new folder");
  }
  std::error_code ignored;
  for (const auto& part : {folder / "rgb", folder / "depth", folder}) {
    if (!std::filesystem::exists(part, ignored)) made_.push_back(part);
  }
  for (const auto& part : {folder / "rgb", folder / "depth"}) {
    std::error_code error;
    std::filesystem::create_directories(part, error);
    if (error) {
      throw Error(ErrorKind::kStorage, part.string(), "cannot be made: " + error.message(), "");
    }
  }
  write_file(
      folder / kUnfinished, [](const ByteSink&) {}, Durability::kLater);
}

SequenceWriter::~SequenceWriter() {
  if (finished_) return;
  std::error_code ignored;
  for (const Entry& entry : entries_) {
    std::filesystem::remove(folder_ / entry.color, ignored);
    std::filesystem::remove(folder_ / entry.depth, ignored);
  }
  for (const auto& file : files_) std::filesystem::remove(file, ignored);
  std::filesystem::remove(folder_ / kUnfinished, ignored);
  // Removes only empty folders; keeps other files.
  for (const auto& made : made_) std::filesystem::remove(made, ignored);
}

void SequenceWriter::add(double timestamp_s, const ColorImage& color, const DepthImage& depth_m) {
  if (color.empty() || !same_size(color, depth_m) || !color.consistent() || !depth_m.consistent()) {
    throw Error(ErrorKind::kMisuse, "image", "colour and depth do not go together", "one size");
  }
  const std::string time = fmt::format("{:.6f}", timestamp_s);
  const bool png = options_.color_format == ColorFormat::kPng;
  const Entry entry{timestamp_s, time, "rgb/" + time + (png ? ".png" : ".jpg"),
                    "depth/" + time + ".png"};
  {
    const std::lock_guard lock(mutex_);
    const auto same = [&](const Entry& other) { return other.time == time; };
    if (std::any_of(entries_.begin(), entries_.end(), same)) {
      throw Error(ErrorKind::kMisuse, "timestamp", time + " was added before", "another time");
    }
    entries_.push_back(entry);
  }
  if (png) {
    write_png(folder_ / entry.color, color, Durability::kLater);
  } else {
    write_jpeg(folder_ / entry.color, color, kJpegQuality, Durability::kLater);
  }
  write_png(folder_ / entry.depth, stored_depth(depth_m, options_.depth_units_per_metre),
            Durability::kLater);
}

void SequenceWriter::add_file(const std::string& name,
                              const std::function<void(const ByteSink&)>& write) {
  files_.push_back(folder_ / name);
  write_file(files_.back(), write);
}

void SequenceWriter::finish() {
  const std::lock_guard lock(mutex_);
  std::sort(entries_.begin(), entries_.end(),
            [](const Entry& a, const Entry& b) { return a.timestamp_s < b.timestamp_s; });
  std::string color_list = "# timestamp filename\n";
  std::string depth_list = "# timestamp filename\n";
  for (const Entry& entry : entries_) {
    color_list += fmt::format("{} {}\n", entry.time, entry.color);
    depth_list += fmt::format("{} {}\n", entry.time, entry.depth);
  }
  // Writes the images to the disk before the lists that name them.
  sync_files(folder_);
  add_file("depth.txt", [&](const ByteSink& sink) { sink(depth_list); });
  add_file("rgb.txt", [&](const ByteSink& sink) { sink(color_list); });
  const std::filesystem::path unfinished = folder_ / kUnfinished;
  std::error_code error;
  std::filesystem::remove(unfinished, error);
  if (error) {
    throw Error(ErrorKind::kStorage, unfinished.string(), "cannot be deleted: " + error.message(),
                "");
  }
  finished_ = true;
}

bool SequenceWriter::left_unfinished(const std::filesystem::path& folder) {
  std::error_code ignored;
  return std::filesystem::exists(folder / kUnfinished, ignored);
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <ranges>
#include <string_view>
#include <system_error>

#include <fmt/format.h>
#include <unistd.h>

#include "cairn/core/detail/file_lock.hpp"
#include "cairn/core/detail/require.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/vision/detail/sequence_layouts.hpp"
#include "cairn/vision/image.hpp"
#include "cairn/vision/sequence.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kJpegQuality = 95;

// In the folder of a sequence from its first file to its last, locked by its writer. Lists the files, one a line,
// before they are made.
constexpr std::string_view kUnfinished = ".sequence.cairn-unfinished";

// Of all layouts.
constexpr std::array<std::string_view, 6> kFolders = {
    "rgb", "depth", "mav0/cam0", "mav0/cam0/data", "mav0/cam1", "mav0/cam1/data"};

[[noreturn]] void fail(const fs::path& path, std::string_view what, const std::error_code& why) {
  throw Error(ErrorKind::kStorage, path.string(), fmt::format("{}: {}", what, why.message()), "");
}

std::string_view ending_of(ColorFormat format) {
  return format == ColorFormat::kPng ? ".png" : ".jpg";
}

}  // namespace

SequenceWriter::SequenceWriter(const fs::path& folder, ColorFormat color_format,
                               double depth_units_per_metre)
    : SequenceWriter(folder, color_format, depth_units_per_metre,
                     {Part{"rgb", "rgb.txt"}, Part{"depth", "depth.txt"}}) {}

SequenceWriter::SequenceWriter(const fs::path& folder, const StereoRig& rig,
                               ColorFormat color_format)
    : SequenceWriter(folder, color_format, 1.0,
                     {Part{"mav0/cam0/data", "mav0/cam0/data.csv"},
                      Part{"mav0/cam1/data", "mav0/cam1/data.csv"}}) {
  // The body is the left camera.
  const std::string texts[] = {detail::euroc_camera_text(rig.left, Rigid3()),
                               detail::euroc_camera_text(rig.right, rig.left_from_right)};
  for (std::size_t camera = 0; camera < parts_.size(); ++camera) {
    add_file((parts_[camera].list.parent_path() / "sensor.yaml").string(),
             [&](const ByteSink& sink) { sink(texts[camera]); });
  }
}

SequenceWriter::SequenceWriter(const fs::path& folder, ColorFormat color_format,
                               double depth_units_per_metre, std::array<Part, 2> parts)
    : folder_(folder),
      parts_(std::move(parts)),
      color_format_(color_format),
      depth_units_per_metre_(depth_units_per_metre) {
  detail::require(depth_units_per_metre > 0.0 && std::isfinite(depth_units_per_metre),
                  "depth_units_per_metre", depth_units_per_metre, "a positive number");
  try {
    take_folder();
    for (const Part& part : parts_) {
      fs::path made = folder;
      for (const fs::path& step : part.images) make_folder(made /= step);
    }
  } catch (...) {
    discard();
    throw;
  }
}

void SequenceWriter::take_folder() {
  const auto refuse_sequence = [&] {
    std::error_code ignored;
    if (!fs::exists(folder_ / parts_[0].list, ignored)) return;
    throw Error(ErrorKind::kMisuse, folder_.string(), "holds a sequence already", "a new folder");
  };
  if (!is_unfinished(folder_)) refuse_sequence();
  make_folder(folder_);
  unfinished_ = std::make_unique<detail::FileLock>(folder_ / kUnfinished, true);
  unfinished_->require();
  if (unfinished_->is_new()) {
    refuse_sequence();  // another writer may just have finished it
  } else {
    delete_leftovers();
  }
}

void SequenceWriter::delete_leftovers() const {
  FileReader list(unfinished_->path());
  LineReader lines(list);
  while (const auto line = lines.next()) {
    const fs::path name(*line);
    const fs::path part = name.parent_path();
    const bool is_in_folder =
        !name.has_root_directory() && name.has_filename() && name.filename() != ".." &&
        (part.empty() || std::find(kFolders.begin(), kFolders.end(), part) != kFolders.end());
    if (!is_in_folder) continue;
    const std::string hidden = fmt::format(".{}.cairn-unfinished", name.filename().string());
    std::error_code error;
    for (const fs::path& file : {folder_ / name, folder_ / part / hidden}) {
      if (fs::is_directory(fs::symlink_status(file, error)))
        continue;  // of a list that was cut short
      fs::remove(file, error);
      if (error) fail(file, "cannot be deleted", error);
    }
  }
  if (::ftruncate(unfinished_->descriptor(), 0) != 0) {
    fail(unfinished_->path(), "cannot be written", {errno, std::generic_category()});
  }
}

void SequenceWriter::make_folder(const fs::path& folder) {
  std::error_code error;
  const bool was_left = unfinished_ && !unfinished_->is_new();
  if (was_left || !fs::exists(folder, error)) made_.push_back(folder);
  fs::create_directories(folder, error);
  if (error) fail(folder, "cannot be made", error);
}

// Notes files in the hidden one, before they are made.
void SequenceWriter::list(std::string names) const {
  while (!names.empty()) {
    const ssize_t written = ::write(unfinished_->descriptor(), names.data(), names.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      fail(unfinished_->path(), "cannot be written", {errno, std::generic_category()});
    }
    names.erase(0, static_cast<std::size_t>(written));
  }
}

// Deletes the files while the folder is locked, so that no other writer takes over what is being deleted.
void SequenceWriter::discard() {
  std::error_code ignored;
  for (const Entry& entry : entries_) {
    for (const std::string& file : entry.files) fs::remove(folder_ / file, ignored);
  }
  for (const auto& file : files_) fs::remove(file, ignored);
  // Removes only empty folders; keeps other files.
  const auto remove_made = [&](bool outermost) {
    for (const fs::path& made : std::views::reverse(made_)) {
      if ((made == folder_) == outermost) fs::remove(made, ignored);
    }
  };
  remove_made(false);
  if (unfinished_ && unfinished_->holds()) fs::remove(unfinished_->path(), ignored);
  remove_made(true);
}

SequenceWriter::~SequenceWriter() {
  if (!finished_) discard();
}

void SequenceWriter::add(double timestamp_s, const ColorImage& color, const DepthImage& depth_m) {
  refuse_if(
      color.empty() || !same_size(color, depth_m) || !color.consistent() || !depth_m.consistent(),
      "image", "colour and depth do not go together", "one size");
  refuse_if(is_stereo(), "image", "a depth image in a stereo sequence", "two images in colour");
  const Entry entry = add_entry(timestamp_s, ".png");
  write_color(entry.files[0], color);
  write_png(folder_ / entry.files[1], stored_depth(depth_m, depth_units_per_metre_),
            Durability::kLater);
}

void SequenceWriter::add(double timestamp_s, const ColorImage& left, const ColorImage& right) {
  refuse_if(left.empty() || !same_size(left, right) || !left.consistent() || !right.consistent(),
            "image", "left and right do not go together", "one size");
  refuse_if(!is_stereo(), "image", "a stereo pair in an RGB-D sequence", "colour and depth");
  const Entry entry = add_entry(timestamp_s, ending_of(color_format_));
  write_color(entry.files[0], left);
  write_color(entry.files[1], right);
}

bool SequenceWriter::is_stereo() const {
  return parts_[0].list.extension() == ".csv";
}

SequenceWriter::Entry SequenceWriter::add_entry(double timestamp_s,
                                                std::string_view second_ending) {
  // EuRoC's layout counts nanoseconds; both to the microsecond.
  const std::string time = is_stereo() ? fmt::format("{}", std::llround(1e6 * timestamp_s) * 1000)
                                       : fmt::format("{:.6f}", timestamp_s);
  const auto file_in = [&](const Part& part, std::string_view ending) {
    return fmt::format("{}/{}{}", part.images.string(), time, ending);
  };
  Entry entry{timestamp_s,
              time,
              {file_in(parts_[0], ending_of(color_format_)), file_in(parts_[1], second_ending)}};
  const std::lock_guard lock(mutex_);
  const auto same = [&](const Entry& other) { return other.time == time; };
  refuse_if(std::any_of(entries_.begin(), entries_.end(), same), "timestamp",
            time + " was added before", "another time");
  entries_.push_back(entry);
  list(entry.files[0] + "\n" + entry.files[1] + "\n");
  return entry;
}

void SequenceWriter::write_color(const std::string& file, const ColorImage& image) const {
  if (color_format_ == ColorFormat::kPng) {
    write_png(folder_ / file, image, Durability::kLater);
  } else {
    write_jpeg(folder_ / file, image, kJpegQuality, Durability::kLater);
  }
}

void SequenceWriter::add_file(const std::string& name,
                              const std::function<void(const ByteSink&)>& write) {
  files_.push_back(folder_ / name);
  list(name + "\n");
  write_file(files_.back(), write);
}

void SequenceWriter::finish() {
  const std::lock_guard lock(mutex_);
  std::sort(entries_.begin(), entries_.end(),
            [](const Entry& a, const Entry& b) { return a.timestamp_s < b.timestamp_s; });
  std::array<std::string, 2> lists;
  for (std::size_t part = 0; part < parts_.size(); ++part) {
    lists[part] = is_stereo() ? "#timestamp [ns],filename\n" : "# timestamp filename\n";
    for (const Entry& entry : entries_) {
      lists[part] += is_stereo() ? fmt::format("{},{}\n", entry.time,
                                               fs::path(entry.files[part]).filename().string())
                                 : fmt::format("{} {}\n", entry.time, entry.files[part]);
    }
  }
  // Writes the images to the disk before the lists that name them.
  sync_files(folder_);
  for (const std::size_t part : {1, 0}) {
    add_file(parts_[part].list.string(), [&](const ByteSink& sink) { sink(lists[part]); });
  }
  std::error_code error;
  fs::remove(unfinished_->path(), error);
  if (error) fail(unfinished_->path(), "cannot be deleted", error);
  finished_ = true;
  unfinished_.reset();
}

bool SequenceWriter::is_unfinished(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / kUnfinished, ignored);
}

}  // namespace cairn

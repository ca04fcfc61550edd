// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/map_file.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/format_row.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"

namespace cairn {
namespace {

// Frames and observations aside, which the format's row says it cannot hold.
void log_point_losses(const LandmarkMap& map, std::string_view format, const LogSink& log) {
  const std::vector<std::string_view> columns = column_names(map.landmarks().columns);
  detail::log_losses(log, map,
                     {.timestamps = true,
                      .keypoints = true,
                      .depths = true,
                      .octaves = true,
                      .measured = true,
                      .covariances = true,
                      .length_unit = true,
                      .columns = columns},
                     format);
}

// A source that returns the bytes already read again, because pipes cannot seek. Skips a byte order mark.
class PrefixedSource final : public ByteSource {
 public:
  PrefixedSource(const std::string& prefix, ByteSource& rest)
      : prefix_(without_byte_order_mark(prefix)),
        mark_size_(prefix.size() - prefix_.size()),
        rest_(rest) {}

  const std::string& name() const override { return rest_.name(); }
  std::optional<std::uint64_t> size() const override {
    const auto size = rest_.size();
    return size ? std::optional(*size - std::min<std::uint64_t>(*size, mark_size_)) : size;
  }
  std::size_t read(char* buffer, std::size_t capacity) override {
    if (position_ == prefix_.size()) return rest_.read(buffer, capacity);
    const std::size_t count = prefix_.copy(buffer, capacity, position_);
    position_ += count;
    return count;
  }
  void rewind() override {
    // Rewinds to the first byte, then skips the bytes that this class returns itself.
    rest_.rewind();
    std::string again(mark_size_ + prefix_.size(), '\0');
    for (std::size_t count = 0; count < again.size();) {
      const std::size_t more = rest_.read(again.data() + count, again.size() - count);
      if (more == 0) break;
      count += more;
    }
    position_ = 0;
  }

  std::string_view prefix() const { return prefix_; }

 private:
  std::string prefix_;
  std::size_t mark_size_;
  ByteSource& rest_;
  std::size_t position_ = 0;
};

// "a, b or c".
std::string alternatives(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 == words.size() ? " or " : ", ";
    text += words[i];
  }
  return text;
}

bool has_ending(const std::filesystem::path& path, const std::string& ending) {
  if (ending == "/") return path.has_parent_path() && !path.has_filename();
  if (ending.starts_with('.')) return path.extension() == ending;
  return path.filename() == ending;
}

// Names the file at the start of a message, if it is a Git LFS pointer: readers find these damaged.
void refuse_lfs_pointer(std::string_view message) {
  for (std::size_t end = message.find(':'); end != std::string_view::npos;
       end = message.find(':', end + 1)) {
    const std::filesystem::path path(message.substr(0, end));
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored)) continue;
    FileReader file(path);
    if (!detail::is_lfs_pointer(detail::first_bytes_of(file))) return;
    const auto pointer = foreign_content(path);
    throw Error(ErrorKind::kInput, path.string(), pointer->what, pointer->advice);
  }
}

// Splits "path#N", unless a file with that full name exists.
MapInput input_at(const std::filesystem::path& path) {
  MapInput input;
  input.path = path;
  std::error_code ignored;
  const std::string text = path.string();
  const std::size_t hash = text.rfind('#');
  if (hash == std::string::npos || hash == 0 || std::filesystem::exists(path, ignored)) {
    return input;
  }
  input.path = text.substr(0, hash);
  input.part = text.substr(hash + 1);
  return input;
}

// Also an empty file, or one with the right name: the reader says what is wrong.
bool looks_like_native(const MapInput& input) {
  if (input.source == nullptr) return false;
  const std::size_t first = input.first_bytes.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos || input.path.extension() == ".map") return true;
  const std::string_view text = input.first_bytes.substr(first);
  return text.starts_with("CAIRN") || text.starts_with("FRAME") || text.starts_with("LANDMARK");
}

std::string uuid_of(const detail::Hash128& hash) {
  constexpr std::uint64_t kVersion8 = 0x8000;
  constexpr std::uint64_t kVariant = 0x8000;
  return fmt::format("{:08x}-{:04x}-{:04x}-{:04x}-{:012x}", hash.high >> 32,
                     (hash.high >> 16) & 0xffff, kVersion8 | (hash.high & 0x0fff),
                     kVariant | ((hash.low >> 48) & 0x3fff), hash.low & 0xffffffffffff);
}

}  // namespace

FormatRegistry::FormatRegistry(std::vector<MapFormat> formats) : formats_(std::move(formats)) {
  for (auto format = formats_.begin(); format != formats_.end(); ++format) {
    const auto same = [&](const MapFormat& other) { return other.name == format->name; };
    refuse_if(std::any_of(formats_.begin(), format, same), "map format " + printable(format->name),
              "is there twice", "distinct names");
  }
}

FormatRegistry FormatRegistry::extended_by(std::vector<MapFormat> more) const {
  std::vector<MapFormat> all = formats_;
  std::move(more.begin(), more.end(), std::back_inserter(all));
  return FormatRegistry(std::move(all));
}

const MapFormat* FormatRegistry::find(std::string_view name) const {
  const auto found = std::find_if(formats_.begin(), formats_.end(),
                                  [&](const MapFormat& format) { return format.name == name; });
  return found == formats_.end() ? nullptr : &*found;
}

const MapFormat* FormatRegistry::format_of_ending(const std::filesystem::path& path) const {
  for (const MapFormat& format : formats_) {
    for (const std::string& ending : format.endings) {
      if (has_ending(path, ending)) return &format;
    }
  }
  return nullptr;
}

std::string FormatRegistry::endings_text() const {
  std::vector<std::string> words;
  for (const MapFormat& format : formats_) {
    for (const std::string& ending : format.endings) {
      words.push_back(ending == "/" ? fmt::format("/ ({})", format.title) : ending);
    }
  }
  return alternatives(words);
}

std::string FormatRegistry::titles_text() const {
  std::vector<std::string> titles;
  for (const MapFormat& format : formats_) {
    if (format.is_read) titles.push_back(format.title);
  }
  return alternatives(titles);
}

std::string FormatRegistry::written_names_text() const {
  std::vector<std::string> names;
  for (const MapFormat& format : formats_) {
    if (format.is_written()) names.push_back(format.name);
  }
  return alternatives(names);
}

void FormatRegistry::refuse_folder(const std::filesystem::path& path) const {
  std::size_t maps = 0;
  std::filesystem::path first;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    // Most .txt files are not maps.
    if (format_of_ending(entry->path()) == nullptr || has_ending(entry->path(), ".txt")) continue;
    ++maps;
    if (first.empty() || entry->path() < first) first = entry->path();
  }
  if (error)
    throw Error(ErrorKind::kInput, path.string(), "cannot be read: " + error.message(), "");
  if (const auto known = foreign_content(path)) {
    throw Error(ErrorKind::kInput, path.string(), known->what, known->advice);
  }
  if (maps > 0) {
    throw Error(ErrorKind::kInput, path.string(),
                fmt::format("is a folder; it holds {} file{} with the ending of a map", maps,
                            maps == 1 ? "" : "s"),
                "the path of one map, such as " + first.string());
  }
  if (this == &native_formats()) {
    throw Error(
        ErrorKind::kInput, path.string(), "is a folder, but no map in a format of Cairn's own",
        "a map file; all_formats().read() of cairn::foreign_formats reads folders of COLMAP "
        "and other systems");
  }
  throw Error(ErrorKind::kInput, path.string(), "is a folder, but no map in a known format",
              "a map file, or a folder that is one map");
}

const MapFormat* FormatRegistry::recognised(const MapInput& input) const {
  const auto format = std::find_if(formats_.rbegin(), formats_.rend(), [&](const MapFormat& f) {
    return f.recognises && f.recognises(input);
  });
  return format == formats_.rend() ? nullptr : &*format;
}

std::vector<std::filesystem::path> FormatRegistry::maps_of_folder(
    const std::filesystem::path& folder) const {
  if (recognised({.path = folder}) != nullptr) return {folder};
  constexpr int kDeepest = 3;                  // as colmap/sparse/0
  constexpr std::size_t kMostFolders = 10000;  // of a folder that was not meant
  std::vector<std::filesystem::path> maps;
  std::vector<std::filesystem::path> level = {folder};
  std::size_t visited = 0;
  for (int depth = 0; depth < kDeepest; ++depth) {
    std::vector<std::filesystem::path> next;
    for (const std::filesystem::path& above : level) {
      std::error_code error;
      for (std::filesystem::directory_iterator entry(above, error), end; !error && entry != end;
           entry.increment(error)) {
        std::error_code ignored;
        const std::filesystem::path& path = entry->path();
        if (path.filename().string().starts_with('.') || !entry->is_directory(ignored)) continue;
        if (++visited > kMostFolders) break;
        (recognised({.path = path}) != nullptr ? maps : next).push_back(path);
      }
    }
    level = std::move(next);
  }
  std::sort(maps.begin(), maps.end());
  return maps;
}

LandmarkMap FormatRegistry::read(const std::filesystem::path& path,
                                 const Execution& execution) const {
  MapInput input = input_at(path);
  const auto read_recognised = [&]() -> std::optional<LandmarkMap> {
    const MapFormat* const format = recognised(input);
    if (format == nullptr) return std::nullopt;
    if (input.part && !format->holds_several) {
      throw Error(ErrorKind::kInput, path.string(),
                  fmt::format("a map in format {} is one map, not several", format->title),
                  "a path without " + printable("#" + *input.part));
    }
    try {
      return format->read(input, execution);
    } catch (const Error& error) {
      refuse_lfs_pointer(error.what());
      throw;
    }
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(input.path, ignored)) {
    const std::vector<std::filesystem::path> maps = maps_of_folder(input.path);
    if (maps.size() > 1) {
      std::vector<std::string> names;
      for (const std::filesystem::path& map : maps) names.push_back(map.string());
      constexpr std::size_t kShown = 8;
      names.resize(std::min(names.size(), kShown));
      throw Error(ErrorKind::kInput, input.path.string(),
                  fmt::format("holds {} maps in folders", maps.size()),
                  "one of them: " + alternatives(names));
    }
    if (maps.empty()) refuse_folder(input.path);
    if (maps.front() != input.path) {
      detail::log_remark(execution.log, input.path.string(),
                         "the map in " + maps.front().string() + " is read");
    }
    input.path = maps.front();
    return *read_recognised();
  }
  FileReader file(input.path);  // says why, if it cannot be opened
  PrefixedSource source(detail::first_bytes_of(file), file);
  input.first_bytes = source.prefix();
  input.source = &source;
  const bool is_pointer = detail::is_lfs_pointer(input.first_bytes);  // whatever its name says
  if (!is_pointer) {
    if (auto map = read_recognised()) return *std::move(map);
  }
  if (const auto known = foreign_content(input)) {
    throw Error(ErrorKind::kInput, path.string(), known->what,
                known->advice.empty() ? titles_text() : std::string(known->advice));
  }
  const std::string_view line = trimmed(input.first_bytes.substr(0, input.first_bytes.find('\n')));
  throw Error(ErrorKind::kInput, path.string(),
              fmt::format("is in no known map format: it begins with {}", printable(line)),
              titles_text());
}

const MapFormat& FormatRegistry::format_to_write(const std::filesystem::path& path,
                                                 const MapWriteOptions& options) const {
  if (!options.format.empty()) {
    const MapFormat* const named = find(options.format);
    if (named != nullptr && named->is_written()) return *named;
    throw Error(ErrorKind::kMisuse, path.string(),
                printable(options.format) + " names no map format that can be written",
                written_names_text());
  }
  const MapFormat* const format = format_of_ending(path);
  refuse_if(format == nullptr || !format->is_written(), path.string(),
            "the extension " + printable(path.extension().string()) + " names no map format",
            endings_text());
  return *format;
}

void FormatRegistry::write(const LandmarkMap& map, const std::filesystem::path& path,
                           const MapWriteOptions& options, const Execution& execution) const {
  const MapFormat& format = format_to_write(path, options);
  if (format.write) {
    format.write(map, path, options, execution);
  } else {
    write_file(path, [&](const ByteSink& sink) { format.write_to(map, sink, options, execution); });
  }
}

const FormatRegistry& native_formats() {
  static const FormatRegistry formats({
      {.name = "text",
       .title = "Cairn text",
       .endings = {".map", ".txt"},
       .recognises = &looks_like_native,
       .read = &detail::read_source<&read_native>,
       .write_to =
           [](const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options,
              const Execution& execution) {
             write_native(map, sink, options.native_version, execution);
           }},
      {.name = "binary",
       .title = "Cairn binary",
       .endings = {".cairn"},
       // Without the line end, which may be different in a damaged file.
       .recognises = detail::begins_with(kBinaryMagic.substr(0, 6)),
       .read = &detail::read_source<&read_binary>,
       .write_to = detail::written_by<&write_binary>},
      {.name = "ply",
       .title = "PLY",
       .endings = {".ply"},
       .holds_frames = false,
       .recognises = detail::begins_with("ply\n", "ply\r"),
       .read = &detail::read_source<&read_ply>,
       .write_to =
           [](const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options,
              const Execution& execution) {
             log_point_losses(map, "PLY", execution.log);
             write_ply(map, sink, options);
           }},
      {.name = "pcd",
       .title = "PCD",
       .endings = {".pcd"},
       .holds_frames = false,
       .recognises = detail::begins_with("# .PCD", "VERSION"),
       .read = &detail::read_source<&read_pcd>,
       .write_to =
           [](const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options,
              const Execution& execution) {
             log_point_losses(map, "PCD", execution.log);
             if (!options.double_precision &&
                 detail::is_rounded_by_floats(map.landmarks().positions)) {
               detail::log_remark(
                   execution.log, "PCD",
                   "single precision rounds positions so far from the origin; double "
                   "precision does not",
                   RemarkKind::kLoss);
             }
             write_pcd(map, sink, options);
           }},
  });
  return formats;
}

LandmarkMap read_map(const std::filesystem::path& path, const Execution& execution) {
  return native_formats().read(path, execution);
}

void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options, const Execution& execution) {
  native_formats().write(map, path, options, execution);
}

std::string uuid_of(std::string_view bytes) {
  return uuid_of(detail::hash_of(bytes));
}

std::string content_uuid(const LandmarkMap& map) {
  detail::Hasher hasher;
  const auto hash = [&](const LandmarkMap& content) {
    write_binary(content, [&](std::string_view bytes) { hasher.update(bytes); });
  };
  if (map.info().uuid) {
    LandmarkMap copy = map;
    MapTables tables = std::move(copy).tables();
    tables.info.uuid.reset();
    hash(LandmarkMap(std::move(tables)));
  } else {
    hash(map);
  }
  return uuid_of(hasher.digest());
}

LandmarkMap with_content_uuid(LandmarkMap map) {
  std::string uuid = content_uuid(map);
  MapTables tables = std::move(map).tables();
  tables.info.uuid = std::move(uuid);
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn

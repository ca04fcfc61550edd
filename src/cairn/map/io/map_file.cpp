// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/io/map_file.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/text.hpp"
#include "cairn/map/io/binary.hpp"
#include "cairn/map/io/native.hpp"
#include "cairn/map/io/pcd.hpp"
#include "cairn/map/io/ply.hpp"

namespace cairn {
namespace {

// A source whose first bytes were taken already and are handed out again: pipes cannot go back. A byte
// order mark among them is left out.
class PrefixedSource final : public ByteSource {
 public:
  PrefixedSource(std::string prefix, ByteSource& rest)
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
    // Back to the first byte, and past all that are handed out from here.
    rest_.rewind();
    std::string again(mark_size_ + prefix_.size(), '\0');
    for (std::size_t count = 0; count < again.size();) {
      const std::size_t more = rest_.read(again.data() + count, again.size() - count);
      if (more == 0) break;
      count += more;
    }
    position_ = 0;
  }

 private:
  std::string prefix_;
  std::size_t mark_size_;
  ByteSource& rest_;
  std::size_t position_ = 0;
};

MapFormat format_of_content(std::string_view first_bytes) {
  // Up to the line end: that of a damaged file may be another.
  if (first_bytes.starts_with(kBinaryMagic.substr(0, 6))) return MapFormat::kBinary;
  if (first_bytes.starts_with("ply\n") || first_bytes.starts_with("ply\r")) return MapFormat::kPly;
  if (first_bytes.starts_with("# .PCD") || first_bytes.starts_with("VERSION")) {
    return MapFormat::kPcd;
  }
  return MapFormat::kNative;
}

}  // namespace

std::optional<MapFormat> format_of_extension(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".map" || extension == ".txt") return MapFormat::kNative;
  if (extension == ".cairn") return MapFormat::kBinary;
  if (extension == ".ply") return MapFormat::kPly;
  if (extension == ".pcd") return MapFormat::kPcd;
  return std::nullopt;
}

bool holds_whole_map(MapFormat format) {
  return format == MapFormat::kNative || format == MapFormat::kBinary;
}

LandmarkMap read_map(const std::filesystem::path& path, const MapReadOptions& options) {
  FileReader file(path);
  std::string first_bytes(16, '\0');
  std::size_t count = 0;
  while (count < first_bytes.size()) {
    const std::size_t more = file.read(first_bytes.data() + count, first_bytes.size() - count);
    if (more == 0) break;
    count += more;
  }
  first_bytes.resize(count);
  const MapFormat format = format_of_content(without_byte_order_mark(first_bytes));
  PrefixedSource source(std::move(first_bytes), file);
  switch (format) {
    case MapFormat::kBinary:
      return read_binary(source, options);
    case MapFormat::kPly:
      return read_ply(source, options);
    case MapFormat::kPcd:
      return read_pcd(source, options);
    case MapFormat::kNative:
      break;
  }
  return read_native(source, options);
}

void write_map(const LandmarkMap& map, const ByteSink& sink, MapFormat format,
               const MapWriteOptions& options) {
  switch (format) {
    case MapFormat::kNative:
      write_native(map, sink, options.native_version, options.progress);
      break;
    case MapFormat::kBinary:
      write_binary(map, sink, options.progress);
      break;
    case MapFormat::kPly:
      write_ply(map, sink, {.ascii = options.ascii});
      break;
    case MapFormat::kPcd:
      write_pcd(map, sink, {.ascii = options.ascii, .double_precision = options.double_precision});
      break;
  }
}

void write_map(const LandmarkMap& map, const std::filesystem::path& path,
               const MapWriteOptions& options) {
  const auto format = options.format ? options.format : format_of_extension(path);
  if (!format) {
    throw Error(ErrorKind::kMisuse, path.string(),
                "the extension " + printable(path.extension().string()) + " names no map format",
                ".map, .txt, .cairn, .ply or .pcd");
  }
  write_file(path, [&](const ByteSink& sink) { write_map(map, sink, *format, options); });
}

}  // namespace cairn

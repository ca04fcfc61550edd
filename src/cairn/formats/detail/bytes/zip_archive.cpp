// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/zip_archive.hpp"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/bytes/zlib_stream.hpp"
#include "cairn/formats/detail/memory_budget.hpp"

namespace cairn::detail {
namespace {

constexpr std::uint32_t kLocal = 0x04034b50;
constexpr std::uint32_t kCentral = 0x02014b50;
constexpr std::uint32_t kEnd = 0x06054b50;
constexpr std::uint32_t kIn64 = 0xffffffff;
constexpr std::size_t kLocalSize = 30;
constexpr std::size_t kCentralSize = 46;
constexpr std::size_t kEndSize = 22;
constexpr std::uint16_t kStored = 0;
constexpr std::uint16_t kDeflated = 8;

class Archive {
 public:
  Archive(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {}

  std::map<std::string, std::string> read() {
    const std::size_t end = find_end();
    const std::uint64_t count = number(end + 10, 2);
    std::uint64_t place = number(end + 16, 4);
    if (place == kIn64 || count == 0xffff)
      refuse("has more than 65534 members or 4 GiB", "a smaller one");
    std::map<std::string, std::string> members;
    std::uint64_t budget = memory_budget(bytes_.size());
    for (std::uint64_t i = 0; i < count; ++i) {
      if (number(place, 4) != kCentral) refuse("its directory is damaged", "a ZIP archive");
      const std::uint64_t flags = number(place + 8, 2);
      const std::uint64_t method = number(place + 10, 2);
      const std::uint64_t crc = number(place + 16, 4);
      std::uint64_t packed = number(place + 20, 4);
      std::uint64_t size = number(place + 24, 4);
      const std::uint64_t name_size = number(place + 28, 2);
      const std::uint64_t extra_size = number(place + 30, 2);
      const std::uint64_t comment_size = number(place + 32, 2);
      std::uint64_t local = number(place + 42, 4);
      const std::string name(piece(place + kCentralSize, name_size));
      take_64(place + kCentralSize + name_size, extra_size, size, packed, local);
      if ((flags & 1U) != 0) refuse(printable(name) + " is encrypted", "an open archive");
      const std::uint64_t data = local + kLocalSize + number(local + 26, 2) + number(local + 28, 2);
      if (number(local, 4) != kLocal)
        refuse(printable(name) + " is not where it should be", "a ZIP archive");
      const std::string_view content = piece(data, packed);
      if (size > budget)
        refuse(printable(name) + fmt::format(" unpacks to {} bytes", size), "less");
      budget -= size;
      members.insert_or_assign(name, unpack(content, method, size, crc, name));
      place += kCentralSize + name_size + extra_size + comment_size;
    }
    return members;
  }

 private:
  [[noreturn]] void refuse(const std::string& what, std::string_view expected) const {
    throw Error(ErrorKind::kInput, where_, what, expected);
  }

  std::string_view piece(std::uint64_t place, std::uint64_t size) const {
    if (place > bytes_.size() || size > bytes_.size() - place) {
      refuse(fmt::format("refers to byte {} of {}", place + size, bytes_.size()),
             "a whole ZIP archive");
    }
    return bytes_.substr(static_cast<std::size_t>(place), static_cast<std::size_t>(size));
  }

  std::uint64_t number(std::uint64_t place, std::size_t bytes) const {
    const std::string_view text = piece(place, bytes);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i) {
      value |= std::uint64_t{static_cast<unsigned char>(text[i])} << (8 * i);
    }
    return value;
  }

  // The last record, which a comment of up to 65535 bytes may follow.
  std::size_t find_end() const {
    constexpr std::size_t kComment = 65535;
    if (bytes_.size() >= kEndSize) {
      const std::size_t last = bytes_.size() - kEndSize;
      const std::size_t first = last > kComment ? last - kComment : 0;
      for (std::size_t place = last + 1; place-- > first;) {
        if (number(place, 4) == kEnd) return place;
      }
    }
    refuse("has no end record: it may have been cut", "a ZIP archive");
  }

  // Sizes that do not fit into 32 bits are in an extra field.
  void take_64(std::uint64_t place, std::uint64_t length, std::uint64_t& size,
               std::uint64_t& packed, std::uint64_t& local) const {
    const std::uint64_t end = place + length;
    while (place + 4 <= end) {
      const std::uint64_t id = number(place, 2);
      const std::uint64_t field_end = place + 4 + number(place + 2, 2);
      std::uint64_t next = place + 4;
      for (std::uint64_t* value : {&size, &packed, &local}) {
        if (id != 1 || *value != kIn64 || next + 8 > field_end) continue;
        *value = number(next, 8);
        next += 8;
      }
      place = field_end;
    }
  }

  std::string unpack(std::string_view content, std::uint64_t method, std::uint64_t size,
                     std::uint64_t crc, const std::string& name) const {
    std::string result;
    if (method == kStored && content.size() == size) {
      result = content;
    } else if (method == kDeflated) {
      auto unpacked = inflate_raw(content, size);
      if (!unpacked) refuse(printable(name) + " cannot be unpacked", "deflated data");
      result = std::move(*unpacked);
    } else {
      refuse(printable(name) + fmt::format(" is packed by method {}", method),
             "0 (stored) or 8 (deflate)");
    }
    if (crc32_of(result) != crc) refuse(printable(name) + " is damaged", "its checksum");
    return result;
  }

  std::string_view bytes_;
  const std::string& where_;
};

void append(std::string& out, std::uint64_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i, value >>= 8) out += static_cast<char>(value & 0xffU);
}

}  // namespace

std::map<std::string, std::string> read_zip(std::string_view archive, const std::string& where) {
  return Archive(archive, where).read();
}

void ZipWriter::write(const std::string& bytes) {
  sink_(bytes);
  offset_ += bytes.size();
}

void ZipWriter::add(std::string_view name, std::string_view content) {
  if (offset_ + content.size() > std::numeric_limits<std::uint32_t>::max() - 65536) {
    throw Error(ErrorKind::kMisuse, ".npz", "the map is larger than 4 GiB", "another format");
  }
  constexpr std::uint64_t kVersion = 20;
  constexpr std::uint64_t kDate = 0x21;  // 1 January 1980: files of equal maps are equal
  std::string common;
  append(common, kVersion, 2);
  append(common, 0, 2);
  append(common, kStored, 2);
  append(common, 0, 2);
  append(common, kDate, 2);
  append(common, crc32_of(content), 4);
  append(common, content.size(), 4);
  append(common, content.size(), 4);
  append(common, name.size(), 2);
  append(common, 0, 2);
  append(directory_, kCentral, 4);
  append(directory_, kVersion, 2);
  directory_ += common;
  append(directory_, 0, 2 + 2 + 2 + 4);
  append(directory_, offset_, 4);
  directory_ += name;
  std::string header;
  append(header, kLocal, 4);
  header += common;
  header += name;
  write(header);
  sink_(content);
  offset_ += content.size();
  ++members_;
}

void ZipWriter::finish() {
  std::string end;
  append(end, kEnd, 4);
  append(end, 0, 4);
  append(end, members_, 2);
  append(end, members_, 2);
  append(end, directory_.size(), 4);
  append(end, offset_, 4);
  append(end, 0, 2);
  write(directory_);
  write(end);
}

}  // namespace cairn::detail

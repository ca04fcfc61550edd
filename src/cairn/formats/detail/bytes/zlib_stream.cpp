// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/zlib_stream.hpp"

#include <algorithm>
#include <limits>

#include <zlib.h>

#include "cairn/formats/detail/memory_budget.hpp"

namespace cairn::detail {
namespace {

// @param window_bits as inflateInit2 takes them: negative for raw deflate
std::optional<std::string> inflate(const void* packed, std::size_t packed_size, std::uint64_t most,
                                   int window_bits) {
  if (packed_size > std::numeric_limits<uInt>::max()) return std::nullopt;
  z_stream stream{};
  stream.next_in = static_cast<Bytef*>(const_cast<void*>(packed));  // NOLINT: zlib does not write
  stream.avail_in = static_cast<uInt>(packed_size);
  if (inflateInit2(&stream, window_bits) != Z_OK) return std::nullopt;
  std::string content;
  int status = Z_OK;
  while (status == Z_OK) {
    constexpr std::size_t kInflated = std::size_t{1} << 16;
    const std::size_t had = content.size();
    content.resize(had + kInflated);
    stream.next_out = reinterpret_cast<Bytef*>(content.data() + had);
    stream.avail_out = static_cast<uInt>(kInflated);
    status = ::inflate(&stream, Z_NO_FLUSH);
    content.resize(had + kInflated - stream.avail_out);
    if (content.size() > most) status = Z_MEM_ERROR;
  }
  inflateEnd(&stream);
  if (status != Z_STREAM_END) return std::nullopt;
  return content;
}

}  // namespace

std::optional<std::string> inflate_zlib(std::span<const std::byte> packed) {
  return inflate(packed.data(), packed.size(), memory_budget(packed.size()), MAX_WBITS);
}

std::optional<std::string> inflate_raw(std::string_view packed, std::uint64_t size) {
  const std::uint64_t most = std::min<std::uint64_t>(size, memory_budget(packed.size()));
  auto content = inflate(packed.data(), packed.size(), most, -MAX_WBITS);
  if (content && content->size() != size) return std::nullopt;
  return content;
}

std::uint32_t crc32_of(std::string_view bytes) {
  uLong crc = ::crc32(0, nullptr, 0);
  while (!bytes.empty()) {
    const std::size_t count = std::min<std::size_t>(bytes.size(), std::numeric_limits<uInt>::max());
    crc = ::crc32(crc, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(count));
    bytes.remove_prefix(count);
  }
  return static_cast<std::uint32_t>(crc);
}

}  // namespace cairn::detail

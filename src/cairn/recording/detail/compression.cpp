// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/recording/detail/compression.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>

#include <bzlib.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

// Each fills `out` and returns the number of bytes; other than its size if the data are damaged.
std::size_t unpack_lz4(std::string_view packed, std::string& out) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0)
    return ~std::size_t{0};
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      made, &LZ4F_freeDecompressionContext);
  std::size_t filled = 0;
  while (!packed.empty()) {
    std::size_t produced = out.size() - filled;
    std::size_t consumed = packed.size();
    const std::size_t hint = LZ4F_decompress(context.get(), out.data() + filled, &produced,
                                             packed.data(), &consumed, nullptr);
    const bool stands = produced == 0 && consumed == 0;
    if (LZ4F_isError(hint) != 0 || stands) return ~std::size_t{0};
    filled += produced;
    packed.remove_prefix(consumed);
  }
  return filled;
}

std::size_t unpack_zstd(std::string_view packed, std::string& out) {
  return ZSTD_decompress(out.data(), out.size(), packed.data(), packed.size());
}

std::size_t unpack_bz2(std::string_view packed, std::string& out) {
  auto size = static_cast<unsigned int>(out.size());
  const int status = BZ2_bzBuffToBuffDecompress(out.data(), &size, const_cast<char*>(packed.data()),
                                                static_cast<unsigned int>(packed.size()), 0, 0);
  return status == BZ_OK ? size : ~std::size_t{0};
}

}  // namespace

std::string unpacked(std::string_view name, std::string_view packed, std::uint64_t size,
                     const std::string& place) {
  constexpr std::uint64_t kAlways = std::uint64_t{1} << 26;
  constexpr std::uint64_t kMost = std::numeric_limits<std::int32_t>::max();
  const std::uint64_t most = std::min(kMost, std::max(kAlways, 256 * std::uint64_t{packed.size()}));
  reject_if(size > most || packed.size() > kMost, place,
            fmt::format("a chunk of {} bytes, packed in {}", size, packed.size()),
            fmt::format("at most {} bytes", most));
  const auto unpack = name == "lz4"    ? &unpack_lz4
                      : name == "zstd" ? &unpack_zstd
                      : name == "bz2"  ? &unpack_bz2
                                       : nullptr;
  reject_if(unpack == nullptr, place, "a chunk compressed by " + printable(name),
            "none, lz4, zstd or bz2");
  std::string out(static_cast<std::size_t>(size), '\0');
  reject_if(unpack(packed, out) != out.size(), place, fmt::format("damaged {} data", name),
            fmt::format("a chunk that unpacks to {} bytes", size));
  return out;
}

std::uint32_t checksum_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace cairn::detail

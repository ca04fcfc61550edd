// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cairn::detail {

/// Decompresses a zlib stream; std::nullopt if it is damaged or exceeds memory_budget() of its packed size.
std::optional<std::string> inflate_zlib(std::span<const std::byte> packed);

/// The same for a raw deflate stream, as in a ZIP archive.
/// @param size required size when unpacked
std::optional<std::string> inflate_raw(std::string_view packed, std::uint64_t size);

/// The checksum of ZIP archives.
std::uint32_t crc32_of(std::string_view bytes);

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cairn::detail {

/// Unpacks a chunk.
/// @param name "lz4" (frames), "zstd" or "bz2"
/// @param size of the unpacked bytes, as the file states it; not trusted
/// @param place of the chunk, for messages
/// @throws Error (input) for another name, damage, another size, or more than 64 MiB and 256 times the packed bytes
std::string unpacked(std::string_view name, std::string_view packed, std::uint64_t size,
                     const std::string& place);

/// The CRC-32 of bytes, as MCAP stores it.
std::uint32_t checksum_of(std::string_view bytes);

}  // namespace cairn::detail

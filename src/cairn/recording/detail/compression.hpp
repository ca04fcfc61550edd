// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cairn::detail {

/// Unpacks a chunk.
/// @param name "lz4" (frames), "zstd" or "bz2"
/// @param size number of unpacked bytes that the file states; not trusted
/// @param place place of the chunk in messages
/// @throws Error (input) for another name, damage, a wrong size, or a size of more than 64 MiB and of more than 256
///         times the packed bytes
std::string unpacked(std::string_view name, std::string_view packed, std::uint64_t size,
                     const std::string& place);

/// The CRC-32 of bytes, as MCAP stores it.
std::uint32_t checksum_of(std::string_view bytes);

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace cairn::detail {

/// The cell that ends a row: the first 8 hexadecimal digits of the 128-bit XXH3 hash of the row's text before
/// it, which ends with a comma.
std::string row_checksum(std::string_view before);

/// Number of bytes of a table up to its first incomplete or damaged row. 0 if the header is incomplete or contains
/// zero bytes, as after a power failure while the header was written.
/// @throws Error (input) if the table does not begin with the header
std::size_t sound_size(std::string_view table, std::string_view header, std::string_view name);

}  // namespace cairn::detail

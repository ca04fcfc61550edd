// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include "cairn/core/file.hpp"

namespace cairn::detail {

/// The next bytes of a source, as many as recognition takes.
std::string first_bytes_of(ByteSource& source);

/// Whether a file that begins so is a Git LFS pointer: a small text in place of the file.
bool is_lfs_pointer(std::string_view first_bytes);

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/formats/format_registry.hpp"

namespace cairn {

/// Names content that no map format reads, for messages.
struct ForeignContent {
  std::string_view what;    ///< e.g. "is a ROS bag"
  std::string_view advice;  ///< what to give instead; empty: a map in a known format
};

/// What a file is, by its first bytes and its name, or a folder, by the names in it; std::nullopt if unknown.
std::optional<ForeignContent> foreign_content(const MapInput& input);
std::optional<ForeignContent> foreign_content(const std::filesystem::path& path);

/// The next bytes of a source, as many as recognition takes.
std::string first_bytes_of(ByteSource& source);

/// Whether a file that begins so is a Git LFS pointer: a small text in place of the file.
bool is_lfs_pointer(std::string_view first_bytes);

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>

namespace cairn::detail {

/// Writes a folder completely or not at all: `produce` fills a folder beside it, which is then renamed.
/// @param folder must not exist, or be empty
/// @throws Error (storage) naming the folder and the reason
void write_folder(const std::filesystem::path& folder,
                  const std::function<void(const std::filesystem::path& unfinished)>& produce);

}  // namespace cairn::detail

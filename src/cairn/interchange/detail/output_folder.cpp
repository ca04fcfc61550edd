// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/interchange/detail/output_folder.hpp"

#include <string>
#include <system_error>

#include <fmt/format.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

namespace fs = std::filesystem;

// A new folder beside `folder`.
fs::path new_folder_beside(const fs::path& folder) {
  constexpr int kMostNames = 1000;
  for (int i = 0; i < kMostNames; ++i) {
    fs::path candidate = folder;
    candidate += fmt::format(".unfinished{}", i);
    std::error_code error;
    if (fs::create_directory(candidate, error)) return candidate;
    if (error && error != std::errc::file_exists) {
      throw Error(ErrorKind::kStorage, folder.string(), "cannot be written: " + error.message(),
                  "");
    }
  }
  throw Error(ErrorKind::kStorage, folder.string(),
              "cannot be written: there are too many unfinished folders beside it", "");
}

}  // namespace

void write_folder(const fs::path& folder, const std::function<void(const fs::path&)>& produce) {
  const fs::path target = folder.has_filename() ? folder : folder.parent_path();
  std::error_code ignored;
  if (fs::exists(target, ignored)) {
    if (!fs::is_directory(target, ignored)) {
      throw Error(ErrorKind::kStorage, target.string(), "cannot be written: it is a file",
                  "a new or an empty folder");
    }
    if (!fs::is_empty(target, ignored)) {
      throw Error(ErrorKind::kStorage, target.string(),
                  "cannot be written: the folder is not empty", "a new or an empty folder");
    }
  }
  const fs::path unfinished = new_folder_beside(target);
  try {
    produce(unfinished);
    fs::rename(unfinished, target);
  } catch (const fs::filesystem_error& error) {
    fs::remove_all(unfinished, ignored);
    throw Error(ErrorKind::kStorage, target.string(),
                "cannot be written: " + error.code().message(), "");
  } catch (...) {
    fs::remove_all(unfinished, ignored);
    throw;
  }
}

}  // namespace cairn::detail

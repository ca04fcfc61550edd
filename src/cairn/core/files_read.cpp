// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/files_read.hpp"

#include "cairn/core/file.hpp"
#include "cairn/core/hash.hpp"

namespace cairn {
namespace {

thread_local FilesRead* innermost_record = nullptr;

}  // namespace

FilesRead::FilesRead() : outer_(innermost_record) {
  innermost_record = this;
}

FilesRead::~FilesRead() {
  innermost_record = outer_;
}

void note_file_read(const std::filesystem::path& path) {
  for (FilesRead* record = innermost_record; record != nullptr; record = record->outer_) {
    if (record->known_.insert(path).second) record->paths_.push_back(path);
  }
}

std::string hash_files(const std::vector<std::filesystem::path>& paths) {
  Hasher hasher;
  for (const std::filesystem::path& path : paths) {
    hasher.update(hash_file(path) + "\n");
  }
  return "xxh3:" + to_string(hasher.digest());
}

}  // namespace cairn

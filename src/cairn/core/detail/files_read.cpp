// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/files_read.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

namespace cairn::detail {
namespace {

thread_local FilesRead* innermost_record = nullptr;

// The file of an output, which no path identifies.
struct OutputIdentity {
  std::string option;
  dev_t device = 0;
  ino_t number = 0;
};

std::vector<OutputIdentity>& outputs_not_to_read() {
  static std::vector<OutputIdentity> outputs;
  return outputs;
}

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
  for (const std::filesystem::path& path : paths) hasher.update(hash_file(path) + "\n");
  return "xxh3:" + to_string(hasher.digest());
}

void refuse_to_read(const std::vector<NamedOutput>& outputs) {
  outputs_not_to_read().clear();
  for (const NamedOutput& output : outputs) {
    struct stat status = {};
    if (::stat(output.path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) continue;
    outputs_not_to_read().push_back({output.option, status.st_dev, status.st_ino});
  }
}

void require_no_output(const std::filesystem::path& path, const struct stat& status) {
  for (const OutputIdentity& output : outputs_not_to_read()) {
    if (output.device != status.st_dev || output.number != status.st_ino) continue;
    throw Error(ErrorKind::kMisuse, output.option, fmt::format("{} is an input too", path.string()),
                "a file of its own");
  }
}

}  // namespace cairn::detail

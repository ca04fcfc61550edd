// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/outputs.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

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

}  // namespace cairn

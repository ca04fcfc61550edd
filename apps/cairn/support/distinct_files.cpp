// SPDX-License-Identifier: BSD-3-Clause
#include "support/distinct_files.hpp"

#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/files_read.hpp"
#include "cairn/core/error.hpp"

namespace cairn::cli {
namespace {

namespace fs = std::filesystem;

// Whether both name one file, which need not exist yet. Devices and pipes may be named twice.
bool are_one_file(const std::string& a, const std::string& b) {
  std::error_code error;
  const bool exist = fs::exists(a, error) && fs::exists(b, error);
  if (exist) {
    const bool special = fs::is_other(a, error);
    return !special && fs::equivalent(a, b, error) && !error;
  }
  if (fs::exists(a, error) || fs::exists(b, error)) return false;
  const fs::path first = fs::weakly_canonical(fs::absolute(a, error), error);
  if (error) return a == b;
  const fs::path second = fs::weakly_canonical(fs::absolute(b, error), error);
  return error ? a == b : first == second;
}

}  // namespace

void require_distinct_files(const std::vector<NamedPath>& inputs,
                            const std::vector<NamedPath>& outputs) {
  const auto refuse_one_file = [](const NamedPath& output, const NamedPath& other,
                                  std::string_view role) {
    if (!are_one_file(output.path, other.path)) return;
    // A positional argument is named by its role: "the input".
    const bool positional = !other.option.starts_with("--");
    throw Error(
        ErrorKind::kMisuse, output.option,
        fmt::format("{} is {} too", output.path,
                    positional ? (other.one_of_several ? "one of the " : "the ") + other.option
                               : fmt::format("{} {}", role, other.option)),
        "a file of its own");
  };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (const NamedPath& input : inputs) refuse_one_file(outputs[i], input, "the input");
    for (std::size_t j = 0; j < i; ++j) refuse_one_file(outputs[i], outputs[j], "the output");
  }
  // Inputs that no word names: those that lie in a folder, or that a list or an earlier result names.
  std::vector<detail::NamedOutput> written;
  for (const NamedPath& output : outputs) written.push_back({output.option, output.path});
  detail::refuse_to_read(written);
}

}  // namespace cairn::cli

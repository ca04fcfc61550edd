// SPDX-License-Identifier: BSD-3-Clause
#include "support/command_line.hpp"

#include "cairn/core/text.hpp"

namespace cairn::cli {
namespace {

std::vector<std::string>& words() {
  static std::vector<std::string> kept = {"cairn"};
  return kept;
}

}  // namespace

void keep_command_line(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) words().push_back(without_password(argv[i]));
}

const std::vector<std::string>& command_line() {
  return words();
}

}  // namespace cairn::cli

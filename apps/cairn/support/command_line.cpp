// SPDX-License-Identifier: BSD-3-Clause
#include "support/command_line.hpp"

namespace cairn::cli {
namespace {

std::vector<std::string>& words() {
  static std::vector<std::string> kept = {"cairn"};
  return kept;
}

}  // namespace

void keep_command_line(int argc, char** argv) {
  if (argc > 1) words().insert(words().end(), argv + 1, argv + argc);
}

const std::vector<std::string>& command_line() {
  return words();
}

}  // namespace cairn::cli

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/processor.hpp"

#include <array>
#include <cstdio>
#include <memory>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

namespace cairn::detail {
namespace {

// "x86-64-v3" if that is the highest level that the C library's loader calls supported, "" if it names none.
std::string highest_level_of_loader() {
  const auto close = [](std::FILE* file) { ::pclose(file); };
  const std::unique_ptr<std::FILE, decltype(close)> help(
      ::popen("/lib64/ld-linux-x86-64.so.2 --help 2>&1", "r"), close);
  if (!help) return {};
  std::string text;
  std::array<char, 4096> part{};
  while (const std::size_t size = std::fread(part.data(), 1, part.size(), help.get())) {
    text.append(part.data(), size);
  }
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {  // the highest comes first
    const std::size_t begin = line.find("x86-64-v");
    if (begin != std::string::npos && line.find("(supported") != std::string::npos) {
      return line.substr(begin, 9);
    }
  }
  return text.find("x86-64-v") == std::string::npos ? "" : "x86-64";
}

TEST(Processor, IsOfTheHighestLevelThatTheLoaderSupports) {
  const std::string expected = highest_level_of_loader();
  if (expected.empty()) GTEST_SKIP() << "the loader of the C library names no levels of x86-64";
  EXPECT_EQ(processor_kind(), expected);
}

}  // namespace
}  // namespace cairn::detail

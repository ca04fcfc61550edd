// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "cairn/core/error.hpp"

namespace cairn::benchmarks {

/// The main function of a study.
/// @param usage of the words that follow the program's name, of which there must be `least`
/// @param run   is given these words
/// @return 2 for wrong words, 1 for another failure; both are printed
template <class Run>
int study_main(int argc, char** argv, std::size_t least, const char* usage, const Run& run) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < least) {
    std::fprintf(stderr, "usage: %s %s\n", argv[0], usage);
    return 2;
  }
  try {
    run(words);
    return 0;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.kind() == ErrorKind::kMisuse ? 2 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

}  // namespace cairn::benchmarks

// SPDX-License-Identifier: BSD-3-Clause
// Starts the executable that has the verb. Uses the C library alone: loading the C++ library takes as long as all the
// rest of `cairn --version`.
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <limits.h>
#include <unistd.h>

#include "cairn/core/version_number.hpp"

namespace {

bool is_one_of(const char* word, const char* a, const char* b) {
  return std::strcmp(word, a) == 0 || std::strcmp(word, b) == 0;
}

int print_version() {
  std::printf("cairn %s\n", cairn::kVersion);
  if (std::fflush(stdout) == 0) return 0;
  std::fputs("cairn: stdout: cannot be written\n", stderr);
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && is_one_of(argv[1], "--version", "-V")) return print_version();
  const bool is_quick = argc > 1 && is_one_of(argv[1], "align", "info");
  char path[PATH_MAX + 256];
  const ssize_t length = readlink("/proc/self/exe", path, PATH_MAX);
  if (length > 0) {
    path[length] = '\0';
    char* const name = std::strrchr(path, '/') + 1;
    std::snprintf(name, 256, "%s/%s", CAIRN_LIBEXEC, is_quick ? "cairn-quick" : "cairn");
    // Ceres's logger prints each step that fails; the result says whether the adjustment converged.
    setenv("GLOG_minloglevel", "2", 0);
    execv(path, argv);
  }
  std::fprintf(stderr, "cairn: '%s': cannot be started: %s; it is a part of cairn\n", path,
               std::strerror(errno));
  return 1;
}

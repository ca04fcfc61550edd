// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcntl.h>
#include <unistd.h>

namespace cairn::testing {

/// Closes the standard input until it ends: the first file that is opened meanwhile has the number 0.
class WithoutStandardInput {
 public:
  WithoutStandardInput() : kept_(::fcntl(0, F_DUPFD_CLOEXEC, 3)) { ::close(0); }
  ~WithoutStandardInput() {
    if (kept_ < 0) return;  // it was closed before
    ::dup2(kept_, 0);
    ::close(kept_);
  }
  WithoutStandardInput(const WithoutStandardInput&) = delete;
  WithoutStandardInput& operator=(const WithoutStandardInput&) = delete;

 private:
  int kept_;
};

}  // namespace cairn::testing

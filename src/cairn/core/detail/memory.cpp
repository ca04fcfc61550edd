// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/memory.hpp"

#include <cstddef>
#include <cstdint>

#include <sys/mman.h>
#include <unistd.h>

namespace cairn {

void populate([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_POPULATE_WRITE  // Linux 5.14
  // Only pages entirely inside; the others may contain other objects.
  static const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  const std::size_t before = (page - reinterpret_cast<std::uintptr_t>(memory) % page) % page;
  if (bytes < before + page) return;
  ::madvise(static_cast<char*>(memory) + before, (bytes - before) / page * page,
            MADV_POPULATE_WRITE);
#endif
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/memory.hpp"

#include <cstdint>

#include <sys/mman.h>
#include <unistd.h>

namespace cairn::detail {

void populate([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) {
#if defined(MADV_HUGEPAGE) || defined(MADV_POPULATE_WRITE)
  // Only pages entirely inside; the others may contain other objects.
  static const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  const std::size_t before = (page - reinterpret_cast<std::uintptr_t>(memory) % page) % page;
  if (bytes < before + page) return;
  char* const begin = static_cast<char*>(memory) + before;
  const std::size_t size = (bytes - before) / page * page;
#ifdef MADV_HUGEPAGE
  constexpr std::size_t kWorthwhile = std::size_t{4} << 20U;  // two huge pages of x86-64
  if (size >= kWorthwhile) ::madvise(begin, size, MADV_HUGEPAGE);
#endif
#ifdef MADV_POPULATE_WRITE  // Linux 5.14
  ::madvise(begin, size, MADV_POPULATE_WRITE);
#endif
#endif
}

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/memory.hpp"

#include <cstdint>

#include <sys/mman.h>
#include <unistd.h>

namespace cairn {

void populate([[maybe_unused]] void* memory, [[maybe_unused]] std::size_t bytes) {
#ifdef MADV_POPULATE_WRITE  // Linux 5.14
  // The pages that lie wholly inside: the rest may be another's.
  static const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto address = reinterpret_cast<std::uintptr_t>(memory);
  const std::uintptr_t begin = (address + page - 1) / page * page;
  const std::uintptr_t end = (address + bytes) / page * page;
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_POPULATE_WRITE);
#endif
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/processor.hpp"

#include <sys/utsname.h>

namespace cairn::detail {

std::string processor_kind() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return "x86-64-v4";
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
      __builtin_cpu_supports("bmi2")) {
    return "x86-64-v3";
  }
  return __builtin_cpu_supports("sse4.2") ? "x86-64-v2" : "x86-64";
#else
  utsname name{};
  return ::uname(&name) == 0 ? name.machine : "unknown";
#endif
}

}  // namespace cairn::detail

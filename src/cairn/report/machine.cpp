// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include <fmt/format.h>
#include <sys/utsname.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/text.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {
namespace {

// Linux lists its processors in a file; "model name" is their commercial name.
std::string processor_name() {
  try {
    FileReader file("/proc/cpuinfo");
    LineReader lines(file);
    while (const auto line = lines.next()) {
      const std::size_t colon = line->find(':');
      if (colon != std::string_view::npos && trimmed(line->substr(0, colon)) == "model name") {
        return std::string(trimmed(line->substr(colon + 1)));
      }
    }
  } catch (const Error&) {  // another system
  }
  return {};
}

}  // namespace

Machine this_machine(unsigned threads) {
  Machine machine;
  utsname name = {};
  if (::uname(&name) == 0) {
    machine.system = fmt::format("{} {} {}", name.sysname, name.release, name.machine);
  }
  machine.processor = processor_name();
  machine.threads = threads;
  return machine;
}

}  // namespace cairn::report

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/error.hpp"
#include "cairn/report/report.hpp"

#ifdef CAIRN_VIEWER_PAGE

// The assembler takes the file in as it is: a megabyte of text as a C++ literal takes a compiler long.
asm(R"(
.pushsection .rodata
.balign 16
.global cairn_viewer_page_begin
cairn_viewer_page_begin:
.incbin ")" CAIRN_VIEWER_PAGE R"("
.global cairn_viewer_page_end
cairn_viewer_page_end:
.byte 0
.popsection
)");

extern "C" {
extern const char cairn_viewer_page_begin[];  // NOLINT(readability-identifier-naming)
extern const char cairn_viewer_page_end[];    // NOLINT(readability-identifier-naming)
}

namespace cairn::report {

bool has_viewer() {
  return true;
}

std::string_view viewer_page() {
  return {cairn_viewer_page_begin, cairn_viewer_page_end};
}

}  // namespace cairn::report

#else

namespace cairn::report {

bool has_viewer() {
  return false;
}

std::string_view viewer_page() {
  throw Error(ErrorKind::kMisuse, "report", "this build of Cairn has no viewer",
              "a build with -DCAIRN_WITH_VIEWER=ON, which takes Node.js and npm");
}

}  // namespace cairn::report

#endif

// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/alignment/document.hpp"

#include "fuzz/imported.hpp"

// Results of alignments as JSON.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cairn::testing::expect_read_or_refused([&] {
    for (const cairn::AlignmentRecord& record :
         cairn::read_alignments(cairn::testing::text_of(data, size), "input")) {
      const std::string once = cairn::to_json(record, cairn::HistoryDetail::kMatches);
      const std::string document =
          R"({"schema": {"name": "cairn.align", "version": 2}, "results": [)" + once + "]}";
      const std::vector<cairn::AlignmentRecord> again = cairn::read_alignments(document, "written");
      if (again.size() != 1 || cairn::to_json(again[0], cairn::HistoryDetail::kMatches) != once) {
        cairn::testing::abort_because("a result written twice differs");
      }
    }
  });
  return 0;
}

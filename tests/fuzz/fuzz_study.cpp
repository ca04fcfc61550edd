// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/experiments/study.hpp"

#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cairn::testing::expect_read_or_refused([&] {
    const cairn::Study study =
        cairn::parse_study(std::string(cairn::testing::text_of(data, size)), "input");
    if (cairn::canonical_text(study).empty()) cairn::testing::abort_because("a study of nothing");
    const cairn::StudyPlan plan(study);
    if (plan.size() == 0) cairn::testing::abort_because("a study without runs");
    plan.trial(0);
    plan.trial(plan.size() - 1);
  });
  return 0;
}

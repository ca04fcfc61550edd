// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/option_table.hpp"

#include <cmath>
#include <cstddef>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

using ::testing::ThrowsMessage;

struct InnerOptions {
  std::size_t count = 3;
};

struct OuterOptions {
  double share = 0.5;
  std::optional<double> limit_s = {};
  bool fast = false;
  InnerOptions inner = {};

  static const OptionTable table;
};

constexpr OptionField kOuterFields[] = {
    {"share", option_at<&OuterOptions::share>, kProbability},
    {"limit_s", option_at<&OuterOptions::limit_s>, kFinitePositive},
    {"fast", option_at<&OuterOptions::fast>},
    {"count", option_at<&OuterOptions::inner, &InnerOptions::count>, kAtLeastOne},
};
constinit const OptionTable OuterOptions::table = {"OuterOptions", kOuterFields};

TEST(OptionTable, AcceptsTheDefaultsAndBothEndsOfARange) {
  OuterOptions options;
  EXPECT_NO_THROW(check_options(options));
  options.limit_s = 1e-9;
  options.inner.count = 1;
  EXPECT_NO_THROW(check_options(options));
}

TEST(OptionTable, NamesTheFieldItsValueAndTheRange) {
  OuterOptions options;
  options.share = 1.0;
  EXPECT_THAT([&] { check_options(options); },
              ThrowsMessage<Error>("OuterOptions.share: 1; expected at least 0.5 and below 1"));
  options.share = std::nan("");
  EXPECT_THROW(check_options(options), Error);
}

TEST(OptionTable, ChecksOptionalNumbersAndFieldsOfStructsWithin) {
  OuterOptions options;
  options.limit_s = 0.0;
  EXPECT_THAT([&] { check_options(options); },
              ThrowsMessage<Error>("OuterOptions.limit_s: 0; expected a positive number"));
  options.limit_s = INFINITY;
  EXPECT_THROW(check_options(options), Error);
  options = {};
  options.inner.count = 0;
  EXPECT_THAT([&] { check_options(options); },
              ThrowsMessage<Error>("OuterOptions.count: 0; expected at least 1"));
}

}  // namespace
}  // namespace cairn

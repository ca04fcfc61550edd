// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/number_text.hpp"

#include <bit>
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

TEST(ParseNumber, TakesDecimals) {
  EXPECT_EQ(parse_number("1"), 1.0);
  EXPECT_EQ(parse_number("-0.5e-3"), -0.5e-3);
  EXPECT_EQ(parse_number("+2"), 2.0);
  EXPECT_TRUE(std::signbit(parse_number("-0").value()));
}

TEST(ParseNumber, RefusesAllElse) {
  for (const char* text : {"", "+", "-", "+-1", "1x", " 1", "1 ", "nan", "inf", "-inf", "0x10",
                           "1e999", "1e-999", "1,5", "one"}) {
    EXPECT_EQ(parse_number(text), std::nullopt) << text;
  }
}

TEST(ParseUnsigned, TakesSixtyFourBitsAndNoMore) {
  EXPECT_EQ(parse_unsigned("18446744073709551615"), UINT64_MAX);
  for (const char* text : {"18446744073709551616", "-1", "+1", "1.0", "", "0x1"}) {
    EXPECT_EQ(parse_unsigned(text), std::nullopt) << text;
  }
}

TEST(AppendNumber, IsShortestAndParsesBackToTheSameBits) {
  std::string text;
  append_number(text, 0.1);
  EXPECT_EQ(text, "0.1");
  Random random(5);
  for (int i = 0; i < 20000; ++i) {
    const double value = std::ldexp(random.normal(), static_cast<int>(random.index(600)) - 300);
    text.clear();
    append_number(text, value);
    ASSERT_EQ(std::bit_cast<std::uint64_t>(parse_number(text).value()),
              std::bit_cast<std::uint64_t>(value));
  }
}

}  // namespace
}  // namespace cairn

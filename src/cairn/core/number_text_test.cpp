// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/number_text.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"

namespace cairn {
namespace {

TEST(ReadSixDecimals, ReadsWhatPrintfWritesAsTheStandardLibraryDoes) {
  Random random(8);
  for (int i = 0; i < 200000; ++i) {
    const double scale = std::pow(10.0, static_cast<double>(random.index(8)));
    // It wants eight bytes after the point.
    const std::string text = fmt::format("{:.6f} 1", random.uniform(-scale, scale));
    double ours = 0.5;
    double theirs = 0.5;
    const char* const end = text.data() + text.size();
    ASSERT_EQ(read_six_decimals(text.data(), end, ours), end - 2) << text;
    std::from_chars(text.data(), end, theirs);
    ASSERT_EQ(std::bit_cast<std::uint64_t>(ours), std::bit_cast<std::uint64_t>(theirs)) << text;
  }
}

TEST(ReadSixDecimals, LeavesAllElseToOthers) {
  for (const std::string_view text :
       {"", "-", "1", "1.000000", "1.00000 00", "1.0000000 0", "123456789.000000 0", "+1.000000 0",
        "--1.000000 0", ".500000 000", "1,000000 0", "1.00-000 0", "1.0000:0 0", "1.00 000 0"}) {
    double value = 0.5;
    EXPECT_EQ(read_six_decimals(text.data(), text.data() + text.size(), value), nullptr) << text;
    EXPECT_EQ(value, 0.5) << text;
  }
}

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

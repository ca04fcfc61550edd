// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/csv.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Csv, ReadsBackWhatItWrote) {
  Csv csv({"name", "value", "more"});
  csv << "plain" << 0.1 << std::optional<double>();
  csv.end_row();
  csv << "a \"quoted\", text\nof two lines" << std::uint64_t{7} << std::string_view("");
  csv.end_row();
  const auto rows = parse_csv(csv.text(), "t.csv");
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_THAT(rows[0].cells, ElementsAre("name", "value", "more"));
  EXPECT_THAT(rows[1].cells, ElementsAre("plain", "0.1", ""));
  EXPECT_THAT(rows[2].cells, ElementsAre("a \"quoted\", text\nof two lines", "7", ""));
  EXPECT_EQ(rows[1].line, 2U);
  EXPECT_EQ(rows[2].line, 3U);
  EXPECT_EQ(rows[2].end, csv.text().size());
}

TEST(Csv, LeavesOutALastRowThatWasCut) {
  const std::string text = "a,b\n1,2\n3,4";
  for (std::size_t size = 8; size <= text.size(); ++size) {
    const auto rows = parse_csv(std::string_view(text).substr(0, size), "t.csv");
    ASSERT_EQ(rows.size(), 2U);
    EXPECT_EQ(rows.back().end, 8U);
  }
  EXPECT_EQ(parse_csv("a\n\"open", "t.csv").size(), 1U);
  EXPECT_TRUE(parse_csv("", "t.csv").empty());
}

TEST(Csv, TakesLineEndsOfBothKinds) {
  const auto rows = parse_csv("a,b\r\n1,\"x\"\r\n", "t.csv");
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_THAT(rows[1].cells, ElementsAre("1", "x"));
}

TEST(Csv, NamesTheLineOfAMisplacedQuote) {
  const auto message = [](std::string_view text) -> std::string {
    try {
      parse_csv(text, "t.csv");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message("a\nb\"c\n"), HasSubstr("t.csv:2: a quote within a cell"));
  EXPECT_THAT(message("a\n\"b\"c\n"), HasSubstr("t.csv:2: text after a closing quote"));
}

TEST(ParseCsv, LeavesOutAByteOrderMark) {
  const auto rows = parse_csv("\xEF\xBB\xBF\"a\",b\n1,2\n", "t.csv");
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].cells, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(rows[0].end, 9U);
}

}  // namespace
}  // namespace cairn::detail

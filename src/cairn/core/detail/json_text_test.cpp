// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/json_text.hpp"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

std::string nested(std::size_t depth, const std::string& open, const std::string& close) {
  std::string text;
  for (std::size_t i = 0; i < depth; ++i) text += open;
  text += "1";
  for (std::size_t i = 0; i < depth; ++i) text += close;
  return text;
}

std::string refusal(const std::string& text) {
  return testing::refusal(ErrorKind::kInput, [&] { parse_json<json>(text, "a.json"); });
}

TEST(ParseJson, ReadsValuesAndSaysWhatIsNone) {
  EXPECT_EQ(parse_json<json>(R"({"a": [1, "]", null]})", "a.json"),
            json({{"a", {1, "]", nullptr}}}));
  EXPECT_EQ(parse_json<nlohmann::ordered_json>("{\"b\": 1, \"a\": 2}", "a")->begin().key(), "b");
  for (const char* none : {"", "{", "[1,]", "\"", "\"\\", "]]", "nan", "{} {}"}) {
    EXPECT_FALSE(parse_json<json>(none, "a.json")) << none;
  }
}

TEST(ParseJson, RefusesNestingThatStackCouldNotHold) {
  const std::string lists = nested(kDeepestJson, "[", "]");
  EXPECT_TRUE(parse_json<json>(lists, "a.json"));
  EXPECT_TRUE(parse_json<json>(nested(kDeepestJson, "{\"a\":", "}"), "a.json"));
  EXPECT_EQ(
      refusal("[" + lists + "]"),
      "a.json: byte 100: lists and objects are nested too deeply; expected at most 100 within "
      "each other");
  EXPECT_THAT(refusal(nested(kDeepestJson + 1, "{\"a\":", "}")), HasSubstr("nested too deeply"));
  EXPECT_THAT(refusal(nested(1'000'000, "[", "]")), HasSubstr("nested too deeply"));
  EXPECT_THAT(refusal(std::string(1'000'000, '[')), HasSubstr("nested too deeply"));
}

std::string object_of(std::size_t keys) {
  std::string text = "{";
  for (std::size_t i = 0; i < keys; ++i) {
    text += (i == 0 ? "\"a:" : ",\"a:") + std::to_string(i) + R"(": {"b": 1})";
  }
  return text + "}";
}

TEST(ParseJson, RefusesObjectsWhoseKeysWouldTakeQuadraticTime) {
  using nlohmann::ordered_json;
  const std::string most = object_of(kMostOrderedJsonKeys);
  EXPECT_EQ(parse_json<ordered_json>("[" + most + "," + most + "]", "a")->size(), 2U);
  EXPECT_THAT(testing::refusal(
                  ErrorKind::kInput,
                  [&] { parse_json<ordered_json>(object_of(kMostOrderedJsonKeys + 1), "a.json"); }),
              HasSubstr("an object has too many keys; expected at most 1000"));
  EXPECT_EQ(parse_json<json>(object_of(100'000), "a")->size(), 100'000U);
}

TEST(ParseJson, CountsWhatIsNestedOnly) {
  std::string beside = "[[]";
  for (int i = 0; i < 1000; ++i) beside += ", {}, []";
  EXPECT_TRUE(parse_json<json>(beside + "]", "a.json"));
  EXPECT_TRUE(parse_json<json>('"' + std::string(1000, '[') + "\\\"" + std::string(1000, '{') + '"',
                               "a.json"));
}

}  // namespace
}  // namespace cairn::detail

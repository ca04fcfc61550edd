// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/text.hpp"

#include <string>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

TEST(Trimmed, TakesBlanksOffTheEndsOnly) {
  EXPECT_EQ(trimmed("a"), "a");
  EXPECT_EQ(trimmed(" \ta b\t c \r"), "a b\t c");
  EXPECT_EQ(trimmed("\na\n"), "\na\n") << "a line end is no blank";
}

TEST(Trimmed, LeavesNothingOfBlanks) {
  EXPECT_EQ(trimmed(""), "");
  EXPECT_EQ(trimmed(" \t\r "), "");
}

TEST(PlainText, LeavesTextAsItIs) {
  for (const std::string text : {"", "desk.map: 12 m", "Grüße, 机器人, 🤖, עברית", "a'b\"\\~"}) {
    EXPECT_EQ(plain_text(text), text);
  }
}

TEST(PlainText, Utf8IsTold) {
  for (const std::string text : {"", "a\tb", "Grüße, 机器人, 🤖"})
    EXPECT_TRUE(is_utf8(text)) << text;
  for (const std::string text : {"caf\xe9.png", "\xc3", "\xed\xa0\x80", "\xc0\x80", "a\x80"}) {
    EXPECT_FALSE(is_utf8(text)) << text;
  }
}

TEST(PlainText, SpellsOutWhatCommandsATerminal) {
  EXPECT_EQ(plain_text("\x1b[2Jdesk\r\n\t\x07\x7f"), "\\x1b[2Jdesk\\x0d\\x0a\\x09\\x07\\x7f");
  EXPECT_EQ(plain_text("a\nb\tc\rd", "\n\t"), "a\nb\tc\\x0dd");
  EXPECT_EQ(plain_text("\xc2\x9b"
                       "2J"),
            "\\xc2\\x9b2J")
      << "C1 control";
  EXPECT_EQ(plain_text(std::string("a\0b", 3)), "a\\x00b");
}

TEST(PlainText, SpellsOutWhatReordersText) {
  for (const std::string mark : {"\u202e", "\u2066", "\u2069", "\u200f", "\u061c", "\u2028"}) {
    const std::string plain = plain_text("gpj" + mark + ".map");
    EXPECT_EQ(plain.find(mark), std::string::npos);
    EXPECT_TRUE(plain.starts_with("gpj\\x"));
    EXPECT_TRUE(plain.ends_with(".map"));
  }
}

TEST(PlainText, SpellsOutWhatIsNoUtf8) {
  EXPECT_EQ(plain_text("\x9b"
                       "2J"),
            "\\x9b2J");
  EXPECT_EQ(plain_text("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(plain_text("\xc3"), "\\xc3") << "cut off";
  EXPECT_EQ(plain_text("\xc0\xaf"), "\\xc0\\xaf") << "longer than need be";
  EXPECT_EQ(plain_text("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "surrogate";
  EXPECT_EQ(plain_text("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond U+10FFFF";
}

TEST(Error, HoldsPlainText) {
  const Error error(ErrorKind::kInput, "\x1b]0;title\x07.map", "what\n", "more\u202e");
  EXPECT_STREQ(error.what(), "\\x1b]0;title\\x07.map: what\\x0a; expected more\\xe2\\x80\\xae");
}

TEST(WithoutPassword, HidesItWhereverAUrlHasIt) {
  EXPECT_EQ(without_password("postgresql://ada:secret@host:1/town?password=secret&x=1"),
            "postgresql://ada:***@host:1/town?password=***&x=1");
  EXPECT_EQ(without_password("postgresql://ada:se@cret@host"), "postgresql://ada:***@host");
  EXPECT_EQ(without_password("postgresql://ada@host:5432/town"), "postgresql://ada@host:5432/town");
  EXPECT_EQ(without_password("postgresql://host:5432/town?user=ada"),
            "postgresql://host:5432/town?user=ada");
  EXPECT_EQ(without_password("postgresql://host?sslpassword=secret&password=secret"),
            "postgresql://host?sslpassword=***&password=***");
  // A password that is not escaped, or what may be one.
  for (const std::string password : {"se/cret", "se?cret", "se@cret", "se#c:ret", "/"}) {
    EXPECT_EQ(without_password("postgresql://ada:" + password + "@host/town"),
              "postgresql://ada:***@host/town");
    EXPECT_EQ(without_password("postgresql://host/?password=" + password),
              "postgresql://host/?password=***");
  }
  EXPECT_EQ(without_password("postgresql://ada:secret@host/?password=se@cret&x=1"),
            "postgresql://ada:***&x=1");
  EXPECT_EQ(without_password("postgresql://host:5432/a@b"), "postgresql://host:***@b");
  EXPECT_EQ(without_password("a:b@c/town.atlas"), "a:b@c/town.atlas");
}

}  // namespace
}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/markup.hpp"

#include <gtest/gtest.h>

namespace cairn::report {
namespace {

TEST(MarkupText, LeavesPlainTextAlone) {
  EXPECT_EQ(markup_text("later.map to earlier.map, 5 °"), "later.map to earlier.map, 5 °");
  EXPECT_EQ(markup_text("\xf0\x9f\x97\xba"), "\xf0\x9f\x97\xba");
  EXPECT_EQ(markup_text(""), "");
}

TEST(MarkupText, EscapesWhatWouldBeMarkup) {
  EXPECT_EQ(markup_text("</title><script>alert('1' & \"2\")"),
            "&lt;/title&gt;&lt;script&gt;alert(&#39;1&#39; &amp; &quot;2&quot;)");
}

TEST(MarkupText, ReplacesWhatNoDocumentMayHold) {
  EXPECT_EQ(markup_text("a\x01\x7f\tb\r\n"), "a\xef\xbf\xbd\xef\xbf\xbd b  ");
  EXPECT_EQ(markup_text(std::string_view("\0", 1)), "\xef\xbf\xbd");
}

TEST(MarkupText, ReplacesWhatIsNoUtf8) {
  const std::string r = "\xef\xbf\xbd";
  EXPECT_EQ(markup_text("\xff"), r);
  EXPECT_EQ(markup_text("a\xc3"), "a" + r);                   // cut off
  EXPECT_EQ(markup_text("\xc0\xbc"), r + r);                  // '<' in two bytes
  EXPECT_EQ(markup_text("\xe0\x80\xbc"), r + r + r);          // and in three
  EXPECT_EQ(markup_text("\xed\xa0\x80"), r + r + r);          // a surrogate
  EXPECT_EQ(markup_text("\xf4\x90\x80\x80"), r + r + r + r);  // beyond Unicode
  EXPECT_EQ(markup_text("\xef\xbf\xbf"), r + r + r);          // no character
  EXPECT_EQ(markup_text("\xc3<"), r + "&lt;");                // the next byte is its own
}

}  // namespace
}  // namespace cairn::report

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/text.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/error.hpp"

#include <string>

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Error, SaysWhereWhatAndExpected) {
  const Error error(ErrorKind::kInput, "a.map:3", "'x' is not a number", "a number");
  EXPECT_STREQ(error.what(), "a.map:3: 'x' is not a number; expected a number");
  EXPECT_EQ(error.kind(), ErrorKind::kInput);
}

TEST(Error, LeavesOutWhatIsEmpty) {
  EXPECT_STREQ(Error(ErrorKind::kMisuse, "", "k is 0", "").what(), "k is 0");
}

TEST(Printable, MakesAnyBytesReadable) {
  EXPECT_EQ(printable(std::string_view("a\x01\xff", 3)), "'a\\x01\\xff'");
  EXPECT_EQ(printable(std::string(100, 'a')), "'" + std::string(40, 'a') + "'...");
}

}  // namespace
}  // namespace cairn

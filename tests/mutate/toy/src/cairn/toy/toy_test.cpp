// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

int tested(int a, int b);
int called(int a, int b);
int constant();

TEST(Toy, Adds) {
  EXPECT_EQ(tested(2, 3), 5);
}

TEST(Toy, IsCalled) {
  EXPECT_EQ(called(2, 0), 2);
}

TEST(Toy, HasASize) {
  EXPECT_EQ(constant(), 3 * static_cast<int>(sizeof(int)) + 6);
}

// SPDX-License-Identifier: BSD-3-Clause
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

int tested(int a, int b);
int called(int a, int b);
int constant();
int called_in_child(int a, int b);
void set_last(std::vector<int>& values, int value);

TEST(Toy, Adds) {
  EXPECT_EQ(tested(2, 3), 5);
}

TEST(Toy, IsCalled) {
  EXPECT_EQ(called(2, 0), 2);
}

TEST(Toy, HasASize) {
  EXPECT_EQ(constant(), 3 * static_cast<int>(sizeof(int)) + 6);
}

TEST(Toy, DividesInAChild) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(called_in_child(6, 3));
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 2);
}

TEST(Toy, SetsTheLast) {
  std::vector<int> values = {1, 2};
  set_last(values, 3);
  EXPECT_EQ(values, (std::vector<int>{1, 3}));
}

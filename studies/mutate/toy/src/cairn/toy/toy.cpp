// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <vector>

// Its test sees a wrong operator.
int tested(int a, int b) {
  return a + b;
}

// Its test does not.
int called(int a, int b) {
  return a - b;
}

// No test calls it.
int uncalled(int a, int b) {
  return a * b;
}

// The array's size has to be a constant, so a choice does not compile. A string holds no operator.
int constant() {
  return static_cast<int>(sizeof(std::array<int, 3>) + sizeof("a + b"));
}

// Only a child process of its test calls it.
int called_in_child(int a, int b) {
  return a / b;
}

// Without a fault, what is assigned is kept.
void set_last(std::vector<int>& values, int value) {
  values.back() = value;
}

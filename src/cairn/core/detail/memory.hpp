// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace cairn {

/// Asks the operating system for the pages of some memory at once, which takes half the time of as
/// many page faults. What the memory holds stays; where the system cannot do so, nothing happens.
void populate(void* memory, std::size_t bytes);

/// Reserves room that is going to be filled at once.
template <class T>
void reserve_populated(std::vector<T>& vector, std::size_t count) {
  vector.reserve(count);
  populate(vector.data() + vector.size(), (vector.capacity() - vector.size()) * sizeof(T));
}

}  // namespace cairn

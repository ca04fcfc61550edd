// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace cairn::detail {

/// Allocates all pages of a memory range at once, huge pages where they fit, because page faults would take longer
/// than filling the memory. Keeps the content. Has no effect if the operating system does not support it.
void populate(void* memory, std::size_t bytes);

/// Reserves memory that the caller is about to fill.
template <class T>
void reserve_populated(std::vector<T>& vector, std::size_t count) {
  vector.reserve(count);
  populate(vector.data() + vector.size(), (vector.capacity() - vector.size()) * sizeof(T));
}

}  // namespace cairn::detail

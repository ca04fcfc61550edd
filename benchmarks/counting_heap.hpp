// SPDX-License-Identifier: BSD-3-Clause
// What programs that are built with counting_heap.cpp take of the heap: it replaces operator new.
#pragma once

#include <cstddef>

namespace cairn::benchmarks {

/// Bytes of heap taken since it was made. One at a time: a second one resets the peak of the first.
class HeapUse {
 public:
  HeapUse();

  /// Taken and not given back.
  std::size_t kept() const;
  /// The most at any time.
  std::size_t peak() const;

 private:
  std::size_t before_;
};

}  // namespace cairn::benchmarks

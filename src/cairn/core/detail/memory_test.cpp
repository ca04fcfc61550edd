// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/memory.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gmock/gmock.h>
#include <sys/mman.h>
#include <unistd.h>

namespace cairn::detail {
namespace {

std::size_t page_size() {
  return static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

// Pages of mapped memory that are there.
std::ptrdiff_t resident(void* memory, std::size_t pages) {
  std::vector<unsigned char> there(pages);
  EXPECT_EQ(::mincore(memory, pages * page_size(), there.data()), 0);
  return std::count_if(there.begin(), there.end(),
                       [](unsigned char one) { return (one & 1U) != 0; });
}

#ifdef MADV_POPULATE_WRITE  // glibc 2.35

TEST(Memory, PagesInsideTheRangeAreThereAndOthersAreNot) {
  constexpr std::size_t kPages = 16;
  const std::size_t page = page_size();
  void* const memory =
      ::mmap(nullptr, kPages * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  if (::madvise(memory, page, MADV_POPULATE_WRITE) != 0) {
    ::munmap(memory, kPages * page);
    GTEST_SKIP() << "the kernel (before Linux 5.14) does not populate memory";
  }
  EXPECT_EQ(resident(memory, kPages), 1);
  char* const begin = static_cast<char*>(memory);
  // From the middle of the fifth page to the middle of the ninth: three whole pages.
  populate(begin + 4 * page + page / 2, 4 * page);
  EXPECT_EQ(resident(memory, kPages), 1 + 3);
  EXPECT_EQ(resident(begin + 5 * page, 3), 3);
  populate(begin + 10 * page + 1, page);  // no whole page
  EXPECT_EQ(resident(memory, kPages), 1 + 3);
  populate(begin + 10 * page, page);
  EXPECT_EQ(resident(memory, kPages), 1 + 3 + 1);
  ::munmap(memory, kPages * page);
}

#endif

TEST(Memory, ContentIsKept) {
  constexpr std::size_t kSize = std::size_t{9} << 20U;  // huge pages fit in
  std::vector<std::uint8_t> bytes(kSize);
  for (std::size_t i = 0; i < kSize; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7 + i / 4096);
  const std::vector<std::uint8_t> before = bytes;
  populate(bytes.data() + 3, kSize - 5);
  EXPECT_TRUE(bytes == before);
}

TEST(Memory, AVectorHasItsElementsAndRoomForMore) {
  std::vector<double> values = {1.0, 2.0};
  reserve_populated(values, 1'000'000);
  EXPECT_GE(values.capacity(), 1'000'000U);
  EXPECT_THAT(values, ::testing::ElementsAre(1.0, 2.0));
}

}  // namespace
}  // namespace cairn::detail

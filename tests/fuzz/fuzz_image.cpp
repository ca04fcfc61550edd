// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdint>
#include <string>

#include "cairn/vision/image.hpp"

#include "fuzz/file_in_memory.hpp"
#include "fuzz/imported.hpp"

// NOLINTBEGIN(readability-identifier-naming): named by libFuzzer
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);
// NOLINTEND(readability-identifier-naming)

namespace {

constexpr std::size_t kPngStart = 8;

std::uint32_t big_endian(const std::uint8_t* bytes) {
  return std::uint32_t{bytes[0]} << 24U | std::uint32_t{bytes[1]} << 16U |
         std::uint32_t{bytes[2]} << 8U | bytes[3];
}

std::uint32_t checksum(const std::uint8_t* bytes, std::size_t size) {
  std::uint32_t crc = 0xffffffffU;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
  }
  return ~crc;
}

bool is_png(const std::uint8_t* data, std::size_t size) {
  return size > kPngStart && data[0] == 0x89 && data[1] == 'P';
}

// A chunk of a PNG with a wrong checksum is refused before it is looked at.
void mend_checksums(std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kFrame = 12;  // length, type, checksum
  for (std::size_t at = kPngStart; at + kFrame <= size;) {
    const std::size_t length = big_endian(data + at);
    if (length > size - at - kFrame) return;
    const std::uint32_t crc = checksum(data + at + 4, length + 4);
    for (unsigned i = 0; i < 4; ++i) {
      data[at + 8 + length + i] = static_cast<std::uint8_t>(crc >> (24U - 8U * i));
    }
    at += length + kFrame;
  }
}

// Whether a header asks for more pixels than can be decoded many times a second. That the reader limits them
// is tested elsewhere.
bool is_large(const std::uint8_t* data, std::size_t size) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 18U;
  const auto large = [](std::uint64_t width, std::uint64_t height) {
    const bool refused = width > 16384 || height > 16384;
    return !refused && width * height > kMost;
  };
  if (is_png(data, size)) {
    return size >= 24 && large(big_endian(data + 16), big_endian(data + 20));
  }
  for (std::size_t i = 0; i + 9 <= size; ++i) {
    if (data[i] != 0xff || data[i + 1] < 0xc0 || data[i + 1] > 0xcf) continue;
    const auto height = static_cast<std::uint64_t>(data[i + 5] << 8 | data[i + 6]);
    const auto width = static_cast<std::uint64_t>(data[i + 7] << 8 | data[i + 8]);
    if (large(width, height)) return true;
  }
  return false;
}

}  // namespace

// Images as PNG and JPEG.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path = cairn::testing::path_in_memory("image");
  if (is_large(data, size)) return 0;
  cairn::testing::write_bytes(path, cairn::testing::text_of(data, size));
  const std::string name = path.string();
  cairn::testing::expect_read_or_refused([&] { cairn::read_gray_image(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::read_color_image(path); }, name);
  cairn::testing::expect_read_or_refused([&] { cairn::read_depth_image(path); }, name);
  return 0;
}

// NOLINTBEGIN(readability-identifier-naming)
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned int seed) {
  const std::size_t mutated = LLVMFuzzerMutate(data, size, max_size);
  if (is_png(data, mutated) && seed % 8 != 0) mend_checksums(data, mutated);
  return mutated;
}
// NOLINTEND(readability-identifier-naming)

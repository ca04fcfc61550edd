// SPDX-License-Identifier: BSD-3-Clause
#include <cstring>

#include "cairn/core/detail/hash.hpp"
#include "cairn/formats/map_file.hpp"

#include "fuzz/round_trip.hpp"

namespace {

void expect_round_trip(std::string_view bytes) {
  cairn::testing::expect_round_trip(
      bytes, cairn::testing::Fidelity::kEveryByte,
      [](cairn::ByteSource& source) { return cairn::read_binary(source); },
      [](const cairn::LandmarkMap& map, const cairn::ByteSink& sink) {
        cairn::write_binary(map, sink);
      });
}

// With the right size and checksum, past which no mutation gets by itself.
std::string sealed(std::string bytes) {
  constexpr std::size_t kSizePlace = 16;
  const std::uint64_t size = bytes.size();
  std::memcpy(bytes.data() + kSizePlace, &size, sizeof size);
  const std::size_t checksum_place = bytes.size() - sizeof(cairn::detail::Hash128);
  cairn::detail::Hasher hasher;
  hasher.update(std::string_view(bytes).substr(0, checksum_place));
  const cairn::detail::Hash128 hash = hasher.digest();
  std::memcpy(bytes.data() + checksum_place, &hash, sizeof hash);
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  expect_round_trip(bytes);
  constexpr std::size_t kHeaderAndChecksum = 72;
  if (size >= kHeaderAndChecksum) expect_round_trip(sealed(bytes));
  return 0;
}

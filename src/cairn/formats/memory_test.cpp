// SPDX-License-Identifier: BSD-3-Clause
// What reading a map takes of memory. A program of its own: it replaces the global allocation
// functions by counting ones.
#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/splats.hpp"

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define CAIRN_TEST_SANITIZED
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CAIRN_TEST_SANITIZED
#endif

namespace {

// Bytes of heap in use, and the most since the last reset.
std::atomic<std::size_t> in_use = 0;
std::atomic<std::size_t> peak = 0;

}  // namespace

#ifndef CAIRN_TEST_SANITIZED
// The other forms of new and delete call these. Inlined, they look mismatched to GCC.
[[gnu::noinline]] void* operator new(std::size_t size) {
  void* const memory = std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  const std::size_t now = in_use += ::malloc_usable_size(memory);
  if (now > peak) peak = now;
  return memory;
}

[[gnu::noinline]] void operator delete(void* memory) noexcept {
  in_use -= ::malloc_usable_size(memory);
  std::free(memory);
}

[[gnu::noinline]] void operator delete(void* memory, std::size_t /*size*/) noexcept {
  in_use -= ::malloc_usable_size(memory);
  std::free(memory);
}
#endif

namespace cairn {
namespace {

class MapMemory : public ::testing::Test {
 protected:
  void SetUp() override {
#ifdef CAIRN_TEST_SANITIZED
    GTEST_SKIP() << "a sanitizer owns the heap of this build: nothing was measured";
#endif
  }
};

struct Usage {
  std::size_t peak = 0;  // beyond what was in use before
  std::size_t kept = 0;  // by the map that was read; 0 where the file was refused
  std::string refusal;
};

Usage read(std::string_view text, const auto& read_format) {
  Usage usage;
  MemoryReader source(text, "desk.map");
  const std::size_t before = in_use;
  peak = before;
  try {
    const LandmarkMap map = read_format(source);
    usage.peak = peak - before;
    usage.kept = in_use - before;
  } catch (const Error& error) {
    usage.peak = peak - before;
    usage.refusal = error.what();
  }
  return usage;
}

Usage read(std::string_view text) {
  return read(text, [](ByteSource& source) { return read_native(source); });
}

Usage read_as_binary(std::string_view bytes) {
  return read(bytes, [](ByteSource& source) { return read_binary(source); });
}

constexpr std::size_t kMegabyte = std::size_t{1} << 20;

// Frames, then landmarks of three observations each; after each landmark `extras`, of its id.
std::string map_text(std::size_t bytes, std::string head, auto extras) {
  std::string text = std::move(head);
  for (int i = 0; i < 300; ++i) text += fmt::format("FRAME {} 0.5 {} 0.125 1 0 0 0\n", i, i);
  for (std::size_t i = 0; text.size() < bytes; ++i) {
    text += fmt::format(
        "LANDMARK {} 0.512345 -1.23456 2.000123 0.000123 0 0 0 0.000123 0 0 0 0.000923 3 {} "
        "447.925 255.343 {} 422.061 255.322 {} 401.512 250.531\n",
        i, i % 300, (i + 7) % 300, (i + 50) % 300);
    extras(text, i);
  }
  return text;
}

TEST_F(MapMemory, OfReadingVersion1IsLittleMoreThanTheMap) {
  const std::string text =
      map_text(20 * kMegabyte, "", [](std::string& /*text*/, std::size_t /*id*/) {});
  const Usage usage = read(text);
  ASSERT_EQ(usage.refusal, "");
  // 112 bytes a landmark and 20 an observation of which each has three; nothing is kept in reserve.
  const auto landmarks = static_cast<double>(std::count(text.begin(), text.end(), 'L'));
  EXPECT_NEAR(static_cast<double>(usage.kept), landmarks * (112 + 3 * 20), 0.02 * 20 * kMegabyte);
  EXPECT_LE(static_cast<double>(usage.peak), 1.5 * static_cast<double>(usage.kept));
  RecordProperty("peak_bytes", static_cast<int>(usage.peak));
  RecordProperty("kept_bytes", static_cast<int>(usage.kept));
}

TEST_F(MapMemory, IsNotReservedForWhatIsNoObservation) {
  const std::string text = map_text(20 * kMegabyte, "CAIRN 2\n", [](std::string& out, std::size_t) {
    out +=
        "# a comment of many words: 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23\n";
  });
  const Usage usage = read(text);
  ASSERT_EQ(usage.refusal, "");
  const auto landmarks = static_cast<double>(std::count(text.begin(), text.end(), 'K'));
  EXPECT_NEAR(static_cast<double>(usage.kept), landmarks * (112 + 3 * 20), 0.02 * 20 * kMegabyte);
  EXPECT_LE(static_cast<double>(usage.peak), 1.5 * static_cast<double>(usage.kept));
}

TEST_F(MapMemory, OfReadingVersion2GrowsByDoublingAtMost) {
  const std::string text =
      map_text(20 * kMegabyte, "CAIRN 2\nCOLUMN a\n", [](std::string& out, std::size_t id) {
        out += fmt::format("COLOR {0} 1 2 3\nVALUE {0} a 0.5\nDETAIL {0} 1 2.5 0 2 2.5 1 3 2.5 2\n",
                           id);
      });
  const Usage usage = read(text);
  ASSERT_EQ(usage.refusal, "");
  // What version 2 adds is not counted beforehand: while it grows, old and new stand side by side.
  const auto landmarks = static_cast<double>(std::count(text.begin(), text.end(), 'K'));
  const double counted = landmarks * (112 + 3 * 20);
  const double added = landmarks * (4 + 8 + 3 * (8 + 16 + 8));
  EXPECT_LE(static_cast<double>(usage.kept), 1.02 * (counted + 2 * added));
  EXPECT_LE(static_cast<double>(usage.peak), 1.02 * (counted + 3 * added));
}

TEST_F(MapMemory, IsNotDecidedByTheCountOfObservations) {
  for (const std::string_view count :
       {"18446744073709551615", "4294967296", "1152921504606846976"}) {
    const Usage usage = read(
        fmt::format("FRAME 1 0 0 0 1 0 0 0\nLANDMARK 1 0 0 0 0 0 0 0 0 0 0 0 0 {} 1 1 1\n", count));
    EXPECT_NE(usage.refusal.find("the record ends after 1 of"), std::string::npos) << usage.refusal;
    EXPECT_LE(usage.peak, 4 * kMegabyte);
  }
}

TEST_F(MapMemory, OfReadingTheBinaryFormIsThatOfTheMap) {
  std::string bytes;
  write_binary(synthetic_map({.seed = 1, .landmarks = 20000}),
               [&](std::string_view piece) { bytes += piece; });
  const Usage usage = read_as_binary(bytes);
  ASSERT_EQ(usage.refusal, "");
  // Optional numbers take twice the room in memory.
  EXPECT_LE(usage.kept, 2 * bytes.size());
  EXPECT_LE(static_cast<double>(usage.peak), 1.1 * static_cast<double>(usage.kept));
}

TEST_F(MapMemory, OfSplatsIsLittleMoreThanTheirFile) {
  constexpr std::size_t kSplats = 20000;
  std::string ply = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n"
      "property float y\nproperty float z\n",
      kSplats);
  const std::vector<std::string> names = testing::splat_names(3);
  for (const std::string& name : names) ply += fmt::format("property float {}\n", name);
  ply += "end_header\n";
  const std::string one((3 + names.size()) * sizeof(float), '\0');
  for (std::size_t i = 0; i < kSplats; ++i) ply += one;
  const Usage usage = read(ply, [](ByteSource& source) { return read_ply(source); });
  ASSERT_EQ(usage.refusal, "");
  // Ids, positions, covariances and colours are added.
  EXPECT_LE(static_cast<double>(usage.kept), 1.5 * static_cast<double>(ply.size()));
  EXPECT_LE(static_cast<double>(usage.peak), 1.7 * static_cast<double>(ply.size()));
}

TEST_F(MapMemory, IsNotDecidedByTheCountsOfTheBinaryForm) {
  std::string intact;
  write_binary(synthetic_map({.seed = 1, .landmarks = 100}),
               [&](std::string_view piece) { intact += piece; });
  // The header's counts, and the first sections' places and sizes.
  for (std::size_t byte = 24; byte < 24 + 8 * 20; byte += 8) {
    for (const std::uint64_t count :
         {~std::uint64_t{0}, std::uint64_t{1} << 60, std::uint64_t{1} << 31, intact.size() / 20}) {
      std::string bytes = intact;
      std::memcpy(bytes.data() + byte, &count, sizeof count);
      detail::Hasher hasher;
      hasher.update(std::string_view(bytes).substr(0, bytes.size() - 16));
      const detail::Hash128 hash = hasher.digest();
      std::memcpy(bytes.data() + bytes.size() - 16, &hash, sizeof hash);
      const Usage usage = read_as_binary(bytes);
      EXPECT_NE(usage.refusal, "") << byte << " " << count;
      EXPECT_EQ(usage.refusal.find(": checksum: "), std::string::npos) << usage.refusal;
      EXPECT_LE(usage.peak, kMegabyte);
    }
  }
}

TEST_F(MapMemory, StaysInProportionToAnyFile) {
  // Lines that look like records by their first letter, and blanks that make fields.
  std::string fields = "LANDMARK";
  while (fields.size() < 4 * kMegabyte) fields += " 1";
  for (const std::string& line :
       {std::string("L\n"), std::string("F\n"), std::string("LLLLLLLLLLLLLLLLLLLLLLLLL\n"),
        std::string("FFFFFFFFFFFFFFFFFFFFFFFFF\n"), std::string("L - - - - - - - - - - -\n"),
        fields + "\n", std::string("\n"), std::string("FRAME"), std::string(1, '\0')}) {
    std::string text;
    while (text.size() < 4 * kMegabyte) text += line;
    const Usage usage = read(text);
    EXPECT_NE(usage.refusal, "");
    EXPECT_LE(usage.peak, 16 * text.size() + 4 * kMegabyte) << line.substr(0, 40);
  }
}

TEST_F(MapMemory, IsBoundedForDeclaredColumnsAndDescriptors) {
  // The most that declarations make of a file: every landmark carries all that any one has.
  std::string text = fmt::format("CAIRN 2\nDESCRIPTORS X {}\n", kMostDescriptorBytes);
  for (std::size_t i = 0; i < kMostNamedColumns; ++i) text += fmt::format("COLUMN {}\n", i);
  const std::size_t landmarks = 2000;
  for (std::size_t i = 0; i < landmarks; ++i) text += fmt::format("LANDMARK {} 0 0 0 - -\n", i);
  const Usage usage = read(text);
  ASSERT_EQ(usage.refusal, "");
  const std::size_t each = kMostDescriptorBytes + 8 * kMostNamedColumns;
  EXPECT_LE(usage.peak, landmarks * each + 16 * text.size() + 4 * kMegabyte);
}

TEST_F(MapMemory, OfColumnsIsRefusedBeyondAMultipleOfTheFile) {
  // Short landmarks, each with room for much that is not there.
  const std::size_t landmarks = 60'000;
  const auto landmarks_after = [&](std::string text) {
    for (std::size_t i = 0; i < landmarks; ++i) text += fmt::format("LANDMARK {} 0 0 0 - -\n", i);
    return text;
  };
  std::string columns = "CAIRN 2\n";
  for (std::size_t i = 0; i < kMostNamedColumns; ++i) columns += fmt::format("COLUMN {}\n", i);
  const std::string descriptors = fmt::format("CAIRN 2\nDESCRIPTORS X {}\n", kMostDescriptorBytes);
  const std::string known = "DESCRIPTOR 59999 " + std::string(2 * kMostDescriptorBytes, '0') + "\n";
  for (const std::string& text :
       {landmarks_after(columns), landmarks_after(columns) + "VALUE 59999 7 1\n",
        landmarks_after(descriptors), landmarks_after(descriptors) + known}) {
    const Usage usage = read(text);
    EXPECT_NE(usage.refusal.find("descriptors and columns of 60000 landmarks take 245760000 bytes"),
              std::string::npos)
        << usage.refusal;
    EXPECT_LE(usage.peak, 32 * text.size() + 64 * kMegabyte);
  }
}

}  // namespace
}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cairn::detail {

/// A hash of 128 bits.
struct Hash128 {
  std::uint64_t low = 0;
  std::uint64_t high = 0;

  friend bool operator==(const Hash128&, const Hash128&) = default;
};

/// 32 hexadecimal digits, as printed by `xxhsum -H2`.
std::string to_string(const Hash128& hash);

/// 128-bit XXH3 (seed 0) of bytes that come in pieces.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;

  void update(std::string_view bytes);
  /// Hash of all bytes so far.
  Hash128 digest() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// 128-bit XXH3 (seed 0) of these bytes.
Hash128 hash_of(std::string_view bytes);

}  // namespace cairn::detail

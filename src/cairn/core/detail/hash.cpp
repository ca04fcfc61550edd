// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/core/detail/hash.hpp"

#include <fmt/format.h>

// Header-only, so that consumers need not find a library to link.
#define XXH_INLINE_ALL
#include <xxhash.h>

namespace cairn::detail {

struct Hasher::State {
  XXH3_state_t xxh3;  // over-aligned, which `new` supports
};

std::string to_string(const Hash128& hash) {
  return fmt::format("{:016x}{:016x}", hash.high, hash.low);
}

Hasher::Hasher() : state_(std::make_unique<State>()) {
  XXH3_128bits_reset(&state_->xxh3);
}

Hasher::~Hasher() = default;

void Hasher::update(std::string_view bytes) {
  XXH3_128bits_update(&state_->xxh3, bytes.data(), bytes.size());
}

Hash128 Hasher::digest() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(&state_->xxh3);
  return {hash.low64, hash.high64};
}

Hash128 hash_of(std::string_view bytes) {
  Hasher hasher;
  hasher.update(bytes);
  return hasher.digest();
}

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#include <utility>

#include <fmt/format.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn {
namespace {

std::string uuid_of(const detail::Hash128& hash) {
  constexpr std::uint64_t kVersion8 = 0x8000;
  constexpr std::uint64_t kVariant = 0x8000;
  return fmt::format("{:08x}-{:04x}-{:04x}-{:04x}-{:012x}", hash.high >> 32,
                     (hash.high >> 16) & 0xffff, kVersion8 | (hash.high & 0x0fff),
                     kVariant | ((hash.low >> 48) & 0x3fff), hash.low & 0xffffffffffff);
}

}  // namespace

std::string uuid_of(std::string_view bytes) {
  return uuid_of(detail::hash_of(bytes));
}

std::string content_uuid(const LandmarkMap& map) {
  detail::Hasher hasher;
  const auto hash = [&](const LandmarkMap& content) {
    write_binary(content, [&](std::string_view bytes) { hasher.update(bytes); });
  };
  if (map.info().uuid) {
    LandmarkMap copy = map;
    MapTables tables = std::move(copy).tables();
    tables.info.uuid.reset();
    hash(LandmarkMap(std::move(tables)));
  } else {
    hash(map);
  }
  return uuid_of(hasher.digest());
}

LandmarkMap with_content_uuid(LandmarkMap map) {
  std::string uuid = content_uuid(map);
  MapTables tables = std::move(map).tables();
  tables.info.uuid = std::move(uuid);
  return LandmarkMap(std::move(tables));
}

}  // namespace cairn

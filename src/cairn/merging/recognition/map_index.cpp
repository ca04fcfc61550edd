// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/recognition/map_index.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/hamming.hpp"
#include "cairn/core/random.hpp"
#include "cairn/placement/descriptors.hpp"

namespace cairn {
namespace {

constexpr std::size_t kNone = static_cast<std::size_t>(-1);

}  // namespace

void RecognitionOptions::validate() const {
  const auto refuse = [](const char* field, double value, const char* expected) {
    throw Error(ErrorKind::kMisuse, fmt::format("RecognitionOptions.{}", field),
                fmt::format("{}", value), expected);
  };
  if (landmarks < 1) refuse("landmarks", static_cast<double>(landmarks), "at least 1");
  if (!(max_difference >= 0.0 && max_difference < 0.5)) {
    refuse("max_difference", max_difference, "0 to below 0.5");
  }
  if (tables < 1 || tables > 64) refuse("tables", static_cast<double>(tables), "1 to 64");
  if (key_bits < 8 || key_bits > 24) refuse("key_bits", static_cast<double>(key_bits), "8 to 24");
}

MapIndex::MapIndex(const RecognitionOptions& options) : options_(options) {
  options_.validate();
}

// Descriptors of the most observed landmarks, one behind the other.
std::vector<std::uint64_t> MapIndex::words_of(const LandmarkMap& map) const {
  std::vector<std::uint64_t> words;
  const auto& descriptors = map.landmarks().descriptors;
  if (!descriptors || descriptors->kind != kind_ || descriptors->bytes_each != bytes_each_) {
    return words;
  }
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (descriptors->known[i] != 0) rows.push_back(i);
  }
  if (rows.size() > options_.landmarks) {
    const auto end = rows.begin() + static_cast<std::ptrdiff_t>(options_.landmarks);
    std::nth_element(rows.begin(), end, rows.end(), [&](std::uint32_t a, std::uint32_t b) {
      const std::size_t of_a = map.observation_count(LandmarkIndex{a});
      const std::size_t of_b = map.observation_count(LandmarkIndex{b});
      return of_a != of_b ? of_a > of_b : a < b;
    });
    rows.erase(end, rows.end());
    std::sort(rows.begin(), rows.end());
  }
  words.assign(rows.size() * words_each_, 0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::memcpy(words.data() + i * words_each_, descriptors->bytes.data() + rows[i] * bytes_each_,
                bytes_each_);
  }
  return words;
}

std::size_t MapIndex::add(const LandmarkMap& map) {
  const auto& descriptors = map.landmarks().descriptors;
  if (kind_.empty() && descriptors && is_binary(descriptors->kind) && map.landmark_count() > 0) {
    kind_ = descriptors->kind;
    bytes_each_ = descriptors->bytes_each;
    words_each_ = (bytes_each_ + 7) / 8;
    Random random(options_.seed);
    const std::size_t bits = std::min(8 * bytes_each_, std::size_t{65536});
    std::vector<std::uint16_t> order(bits);
    for (std::size_t table = 0; table < options_.tables; ++table) {
      // The first of a random permutation, anew for each table.
      std::iota(order.begin(), order.end(), std::uint16_t{0});
      for (std::size_t i = 0; i < options_.key_bits; ++i) {
        if (i < bits) std::swap(order[i], order[i + random.index(bits - i)]);
        bits_.push_back(order[std::min(i, bits - 1)]);
      }
    }
  }
  const std::vector<std::uint64_t> words =
      words_each_ == 0 ? std::vector<std::uint64_t>() : words_of(map);
  const std::size_t count = words_each_ == 0 ? 0 : words.size() / words_each_;
  const std::size_t number = entries_of_.size();
  first_of_.push_back(map_of_.size());
  entries_of_.push_back(count);
  words_.insert(words_.end(), words.begin(), words.end());
  map_of_.insert(map_of_.end(), count, static_cast<std::uint32_t>(number));
  return number;
}

std::uint32_t MapIndex::key(std::size_t table, std::span<const std::uint64_t> descriptor) const {
  std::uint32_t key = 0;
  const std::uint16_t* const bits = bits_.data() + table * options_.key_bits;
  for (std::size_t i = 0; i < options_.key_bits; ++i) {
    key |= static_cast<std::uint32_t>((descriptor[bits[i] / 64] >> (bits[i] % 64)) & 1) << i;
  }
  return key;
}

// By counting: entries with one key lie together, in their order.
void MapIndex::prepare() const {
  if (prepared_ == map_of_.size() && !starts_.empty()) return;
  starts_.assign(options_.tables, {});
  entries_.assign(options_.tables, {});
  const std::size_t keys = std::size_t{1} << options_.key_bits;
  std::vector<std::uint32_t> key_of(map_of_.size());
  for (std::size_t table = 0; table < options_.tables; ++table) {
    std::vector<std::uint32_t>& starts = starts_[table];
    starts.assign(keys + 1, 0);
    for (std::size_t i = 0; i < map_of_.size(); ++i) {
      key_of[i] = key(table, {words_.data() + i * words_each_, words_each_});
      ++starts[key_of[i] + 1];
    }
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
    entries_[table].resize(map_of_.size());
    for (std::size_t i = 0; i < map_of_.size(); ++i) {
      entries_[table][next[key_of[i]]++] = static_cast<std::uint32_t>(i);
    }
  }
  prepared_ = map_of_.size();
}

std::vector<RecognitionCandidate> MapIndex::find(std::size_t map, std::size_t most) const {
  return find(
      std::span(words_).subspan(first_of_[map] * words_each_, entries_of_[map] * words_each_), most,
      map);
}

std::vector<RecognitionCandidate> MapIndex::find(const LandmarkMap& map, std::size_t most) const {
  if (words_each_ == 0) return {};
  return find(words_of(map), most, kNone);
}

std::vector<RecognitionCandidate> MapIndex::find(std::span<const std::uint64_t> words,
                                                 std::size_t most, std::size_t except) const {
  if (words_each_ > 0) prepare();
  if (words.empty()) return {};
  const auto limit = static_cast<int>(
      std::floor(options_.max_difference * 8.0 * static_cast<double>(bytes_each_)));
  std::vector<double> scores(size(), 0.0);
  std::vector<std::uint32_t> voted(size(), 0);  // landmark that last voted for the map, from 1
  std::vector<std::uint32_t> found;
  for (std::size_t i = 0; i * words_each_ < words.size(); ++i) {
    const std::span descriptor = words.subspan(i * words_each_, words_each_);
    const auto landmark = static_cast<std::uint32_t>(i + 1);
    found.clear();
    const auto look = [&](std::size_t table, std::uint32_t bucket) {
      const std::vector<std::uint32_t>& entries = entries_[table];
      for (std::uint32_t at = starts_[table][bucket]; at < starts_[table][bucket + 1]; ++at) {
        const std::uint32_t entry = entries[at];
        const std::uint32_t map = map_of_[entry];
        if (map == except || voted[map] == landmark) continue;
        const std::span other(words_.data() + entry * words_each_, words_each_);
        if (hamming_distance(descriptor, other) > limit) continue;
        voted[map] = landmark;
        found.push_back(map);
      }
    };
    for (std::size_t table = 0; table < options_.tables; ++table) {
      const std::uint32_t exact = key(table, descriptor);
      look(table, exact);
      for (std::size_t bit = 0; bit < options_.key_bits; ++bit) {
        look(table, exact ^ (std::uint32_t{1} << bit));
      }
    }
    if (found.empty()) continue;
    const double weight =
        std::log(static_cast<double>(size() + 1) / static_cast<double>(found.size()));
    for (const std::uint32_t map : found) scores[map] += weight;
  }
  std::vector<RecognitionCandidate> candidates;
  for (std::size_t map = 0; map < scores.size(); ++map) {
    if (scores[map] > 0.0) candidates.push_back({map, scores[map]});
  }
  const auto better = [](const RecognitionCandidate& a, const RecognitionCandidate& b) {
    return a.score != b.score ? a.score > b.score : a.map < b.map;
  };
  const std::size_t count = std::min(most, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count),
                    candidates.end(), better);
  candidates.resize(count);
  return candidates;
}

std::size_t MapIndex::memory() const {
  std::size_t bytes = words_.capacity() * sizeof(std::uint64_t) +
                      map_of_.capacity() * sizeof(std::uint32_t) +
                      entries_of_.capacity() * 2 * sizeof(std::size_t);
  for (std::size_t table = 0; table < entries_.size(); ++table) {
    bytes += (entries_[table].capacity() + starts_[table].capacity()) * sizeof(std::uint32_t);
  }
  return bytes;
}

}  // namespace cairn

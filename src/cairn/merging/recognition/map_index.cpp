// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/merging/recognition/map_index.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

#include "cairn/core/detail/hamming.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

constexpr std::size_t kNone = static_cast<std::size_t>(-1);
constexpr std::size_t kLandmarks = 600;    // of a map, the most observed ones
constexpr double kMaxDifference = 0.1953;  // share of differing bits of one landmark's descriptors
constexpr std::size_t kTables = 3;
constexpr std::size_t kComparisons = 256;  // bits of descriptors that are not binary
// Of such descriptors; with fewer, comparisons hardly differ.
constexpr std::size_t kLeastBytes = 8;

}  // namespace

// Descriptors of the most observed landmarks, one after another.
std::vector<std::uint8_t> MapIndex::bytes_of(const LandmarkMap& map) const {
  std::vector<std::uint8_t> bytes;
  const auto& descriptors = map.landmarks().descriptors;
  if (!descriptors || descriptors->kind != kind_ || descriptors->bytes_each != bytes_each_) {
    return bytes;
  }
  std::vector<std::uint32_t> rows;
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    if (descriptors->known[i] != 0) rows.push_back(i);
  }
  if (rows.size() > kLandmarks) {
    const auto end = rows.begin() + static_cast<std::ptrdiff_t>(kLandmarks);
    std::nth_element(rows.begin(), end, rows.end(), [&](std::uint32_t a, std::uint32_t b) {
      const std::size_t of_a = map.observation_count(LandmarkIndex{a});
      const std::size_t of_b = map.observation_count(LandmarkIndex{b});
      return of_a != of_b ? of_a > of_b : a < b;
    });
    rows.erase(end, rows.end());
    std::sort(rows.begin(), rows.end());
  }
  for (const std::uint32_t row : rows) {
    const auto one = descriptors->descriptor(row, 0);
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  return bytes;
}

// Bits of descriptors, from their bytes.
std::vector<std::uint64_t> MapIndex::words_of(std::span<const std::uint8_t> bytes) const {
  const std::size_t count = bytes_each_ == 0 ? 0 : bytes.size() / bytes_each_;
  std::vector<std::uint64_t> words(count * words_each_, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const auto row = bytes.subspan(i * bytes_each_, bytes_each_);
    if (comparisons_.empty()) {
      std::memcpy(words.data() + i * words_each_, row.data(), bytes_each_);
      continue;
    }
    for (std::size_t bit = 0; bit < comparisons_.size(); ++bit) {
      const bool is_set = comparisons_[bit].of(row) > comparisons_[bit].mean;
      words[i * words_each_ + bit / 64] |= std::uint64_t{is_set} << (bit % 64);
    }
  }
  return words;
}

std::size_t MapIndex::add(const LandmarkMap& map) {
  const auto& descriptors = map.landmarks().descriptors;
  const auto has_any = [](const DescriptorColumn& column) {
    return std::any_of(column.known.begin(), column.known.end(), [](auto is) { return is != 0; });
  };
  const auto is_usable = [](const DescriptorColumn& column) {
    return is_binary(column.kind) || column.bytes_each >= kLeastBytes;
  };
  // A map whose descriptors are all unknown must not set the kind: no bits can be chosen from none.
  if (kind_.empty() && descriptors && is_usable(*descriptors) && has_any(*descriptors)) {
    kind_ = descriptors->kind;
    bytes_each_ = descriptors->bytes_each;
    bits_each_ = is_binary(kind_) ? 8 * bytes_each_ : kComparisons;
    words_each_ = (bits_each_ + 63) / 64;
  }
  const std::vector<std::uint8_t> bytes = bytes_of(map);
  const std::size_t count = bytes_each_ == 0 ? 0 : bytes.size() / bytes_each_;
  const std::size_t number = entries_of_.size();
  const std::size_t first = this->descriptors();
  if (first + count > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorKind::kMisuse, "MapIndex", "more than 2^32 descriptors", "fewer maps");
  }
  first_of_.push_back(static_cast<std::uint32_t>(first));
  entries_of_.push_back(count);
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  return number;
}

std::size_t MapIndex::map_of(std::uint32_t descriptor) const {
  // Maps without descriptors begin at the same position as the next map; the last of them owns it.
  const auto after = std::upper_bound(first_of_.begin(), first_of_.end(), descriptor);
  return static_cast<std::size_t>(after - first_of_.begin()) - 1;
}

// Statistics of the descriptors' bits in these maps.
namespace {

class BitStatistics {
 public:
  BitStatistics(std::span<const std::uint64_t> words, std::size_t words_each) {
    constexpr std::size_t kSample = 2048;
    const std::size_t count = words.size() / words_each;
    const std::size_t step = std::max<std::size_t>(1, count / kSample);
    for (std::size_t i = 0; i < count; i += step) {
      sample_.push_back(words.subspan(i * words_each, words_each));
    }
  }

  // Absolute mean of the bit as ±1: 0 for a bit that is as often 1 as 0, 1 for one that never changes.
  double bias(std::size_t bit) const {
    double sum = 0.0;
    for (const auto& words : sample_) sum += sign(words, bit);
    return std::abs(sum) / static_cast<double>(sample_.size());
  }
  // Absolute correlation of two bits.
  double likeness(std::size_t a, std::size_t b) const {
    double sum = 0.0;
    for (const auto& words : sample_) sum += sign(words, a) * sign(words, b);
    return std::abs(sum) / static_cast<double>(sample_.size());
  }

 private:
  static double sign(std::span<const std::uint64_t> words, std::size_t bit) {
    return ((words[bit / 64] >> (bit % 64)) & 1) != 0 ? 1.0 : -1.0;
  }

  std::vector<std::span<const std::uint64_t>> sample_;
};

}  // namespace

void MapIndex::choose_comparisons() const {
  comparisons_.clear();
  if (is_binary(kind_)) return;
  constexpr std::size_t kSample = 4096;
  const std::size_t step = std::max<std::size_t>(1, descriptors() / kSample);
  Random random(seed_);
  while (comparisons_.size() < kComparisons) {
    Comparison& one = comparisons_.emplace_back();
    for (std::size_t i = 0; i < one.places.size();) {
      one.places[i] = static_cast<std::uint16_t>(random.index(bytes_each_));
      const auto end = one.places.begin() + static_cast<std::ptrdiff_t>(i);
      i += std::find(one.places.begin(), end, one.places[i]) == end ? 1 : 0;
    }
    std::int64_t sum = 0;
    std::int64_t count = 0;
    for (std::size_t i = 0; i < descriptors(); i += step, ++count) {
      sum += one.of(std::span(bytes_).subspan(i * bytes_each_, bytes_each_));
    }
    one.mean = static_cast<int>(sum / count);
  }
}

void MapIndex::choose_bits() const {
  const std::size_t bits = std::min(bits_each_, std::size_t{65536});
  // With more bits, most keys would be empty, and a query searches all neighbouring keys.
  const auto log2 = static_cast<std::size_t>(std::bit_width(descriptors()));
  key_bits_ = std::min(std::clamp<std::size_t>(log2 - 1, 14, 22), bits);
  const BitStatistics statistics(words_, words_each_);
  std::vector<double> bias(bits);
  for (std::size_t bit = 0; bit < bits; ++bit) bias[bit] = statistics.bias(bit);

  Random random(seed_);
  bits_.clear();
  std::vector<std::uint16_t> order(bits);
  for (std::size_t table = 0; table < kTables; ++table) {
    std::iota(order.begin(), order.end(), std::uint16_t{0});
    for (std::size_t i = 0; i < bits; ++i) std::swap(order[i], order[i + random.index(bits - i)]);
    std::vector<std::uint16_t> chosen;
    // Relaxes the limit until enough bits are chosen.
    for (double worst = 0.3; chosen.size() < key_bits_; worst += 0.2) {
      for (const std::uint16_t bit : order) {
        if (chosen.size() == key_bits_) break;
        const bool is_own = std::none_of(chosen.begin(), chosen.end(), [&](std::uint16_t other) {
          return other == bit || statistics.likeness(bit, other) > worst;
        });
        if (bias[bit] <= worst && is_own) chosen.push_back(bit);
      }
    }
    bits_.insert(bits_.end(), chosen.begin(), chosen.end());
  }
}

std::uint32_t MapIndex::key(std::size_t table, std::span<const std::uint64_t> descriptor) const {
  std::uint32_t key = 0;
  const std::uint16_t* const bits = bits_.data() + table * key_bits_;
  for (std::size_t i = 0; i < key_bits_; ++i) {
    key |= static_cast<std::uint32_t>((descriptor[bits[i] / 64] >> (bits[i] % 64)) & 1) << i;
  }
  return key;
}

// Counting sort: entries with the same key become adjacent, in their order.
void MapIndex::prepare() const {
  const std::lock_guard lock(preparing_);
  if (words_each_ == 0 || (prepared_ == descriptors() && !starts_.empty())) return;
  choose_comparisons();
  words_ = words_of(bytes_);
  choose_bits();
  starts_.assign(kTables, {});
  entries_.assign(kTables, {});
  const std::size_t keys = std::size_t{1} << key_bits_;
  std::vector<std::uint32_t> key_of(descriptors());
  for (std::size_t table = 0; table < kTables; ++table) {
    std::vector<std::uint32_t>& starts = starts_[table];
    starts.assign(keys + 1, 0);
    for (std::size_t i = 0; i < key_of.size(); ++i) {
      key_of[i] = key(table, {words_.data() + i * words_each_, words_each_});
      ++starts[key_of[i] + 1];
    }
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    std::vector<std::uint32_t> next(starts.begin(), starts.end() - 1);
    entries_[table].resize(key_of.size());
    for (std::size_t i = 0; i < key_of.size(); ++i) {
      entries_[table][next[key_of[i]]++] = static_cast<std::uint32_t>(i);
    }
  }
  prepared_ = descriptors();
}

std::vector<RecognitionCandidate> MapIndex::find(std::size_t map, std::size_t most) const {
  prepare();  // which may move the words
  return find(
      std::span(words_).subspan(first_of_[map] * words_each_, entries_of_[map] * words_each_), most,
      map);
}

std::vector<RecognitionCandidate> MapIndex::find(const LandmarkMap& map, std::size_t most) const {
  prepare();
  return find(words_of(bytes_of(map)), most, kNone);
}

namespace {

std::vector<RecognitionCandidate> best_of(std::span<const double> scores, std::size_t most) {
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

}  // namespace

std::vector<RecognitionCandidate> MapIndex::find(std::span<const std::uint64_t> words,
                                                 std::size_t most, std::size_t except) const {
  if (words.empty()) return {};
  const auto limit = static_cast<int>(std::floor(kMaxDifference * static_cast<double>(bits_each_)));
  // Prefetches the next entries while others are compared, because they are scattered in memory.
  constexpr std::size_t kAhead = 12;
  const std::size_t landmarks = words.size() / words_each_;
  const std::size_t probes = 1 + key_bits_;
  const std::size_t most_filed =
      32 + 16 * descriptors() / (std::size_t{1} << std::min<std::size_t>(key_bits_, 63));
  std::vector<std::uint32_t> buckets(landmarks * kTables * probes);
  for (std::size_t i = 0, at = 0; i < landmarks; ++i) {
    for (std::size_t table = 0; table < kTables; ++table) {
      const std::uint32_t exact = key(table, words.subspan(i * words_each_, words_each_));
      buckets[at++] = exact;
      for (std::size_t bit = 0; bit < key_bits_; ++bit) {
        buckets[at++] = exact ^ (std::uint32_t{1} << bit);
      }
    }
  }
  struct Filed {
    std::uint32_t landmark;
    std::uint32_t begin;
    std::uint32_t end;
    std::uint32_t table;
  };
  std::vector<Filed> filed;
  for (std::size_t at = 0; at < buckets.size(); ++at) {
    const auto table_of = [&](std::size_t probe) { return probe / probes % kTables; };
    if (const std::size_t next = at + kAhead; next < buckets.size()) {
      __builtin_prefetch(&starts_[table_of(next)][buckets[next]]);
    }
    const std::size_t table = table_of(at);
    const std::uint32_t* const starts = &starts_[table][buckets[at]];
    if (starts[0] == starts[1] || starts[1] - starts[0] > most_filed) continue;
    filed.push_back({static_cast<std::uint32_t>(at / (probes * kTables)), starts[0], starts[1],
                     static_cast<std::uint32_t>(table)});
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;  // landmark of the query, descriptor
  for (std::size_t at = 0; at < filed.size(); ++at) {
    if (const std::size_t next = at + kAhead; next < filed.size()) {
      __builtin_prefetch(&entries_[filed[next].table][filed[next].begin]);
    }
    for (std::uint32_t entry = filed[at].begin; entry < filed[at].end; ++entry) {
      pairs.emplace_back(filed[at].landmark, entries_[filed[at].table][entry]);
    }
  }
  std::vector<double> scores(size(), 0.0);
  std::vector<std::uint32_t> voted(size(), 0);  // landmark that last voted for the map, from 1
  std::vector<std::size_t> found;
  for (std::size_t at = 0; at < pairs.size();) {
    const std::uint32_t landmark = pairs[at].first;
    const std::span descriptor = words.subspan(landmark * words_each_, words_each_);
    found.clear();
    for (; at < pairs.size() && pairs[at].first == landmark; ++at) {
      if (const std::size_t next = at + kAhead; next < pairs.size()) {
        __builtin_prefetch(words_.data() + pairs[next].second * words_each_);
      }
      const std::uint32_t entry = pairs[at].second;
      const std::span other(words_.data() + entry * words_each_, words_each_);
      if (detail::hamming_distance(descriptor, other) > limit) continue;
      const std::size_t map = map_of(entry);
      if (map == except || voted[map] == landmark + 1) continue;
      voted[map] = landmark + 1;
      found.push_back(map);
    }
    if (found.empty()) continue;
    const double weight =
        std::log(static_cast<double>(size() + 1) / static_cast<double>(found.size()));
    for (const std::size_t map : found) scores[map] += weight;
  }
  return best_of(scores, most);
}

std::size_t MapIndex::memory() const {
  std::size_t bytes = bytes_.capacity() + words_.capacity() * sizeof(std::uint64_t) +
                      first_of_.capacity() * sizeof(std::uint32_t) +
                      entries_of_.capacity() * sizeof(std::size_t);
  for (std::size_t table = 0; table < entries_.size(); ++table) {
    bytes += (entries_[table].capacity() + starts_[table].capacity()) * sizeof(std::uint32_t);
  }
  return bytes;
}

}  // namespace cairn

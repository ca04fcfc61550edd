// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

/// A map that may show the same place.
struct RecognitionCandidate {
  std::size_t map = 0;  ///< number from add()
  double score = 0.0;   ///< higher is likelier; comparable within one query only
};

/// Finds maps that may show the same place as a query map, without aligning any: an inverted index
/// over binary descriptors. Other descriptors, e.g. SIFT, are converted to 256 bits first. Each bit
/// compares four of the descriptor's bytes a, b, c and d, chosen at random once. It is set if a + b
/// exceeds c + d by more than the mean difference over the indexed maps (random projections,
/// Charikar 2002; sparse, Achlioptas 2003). In real images, the bits of 84 % of SIFT matches are
/// similar enough to count as a match, and so are those of 0.03 % of other pairs.
///
/// Each table stores a descriptor under a key of a few of its bits (Indyk and Motwani 1998), drawn
/// at random from bits that are balanced and uncorrelated in these maps. Other bits would map most
/// descriptors to few keys. A query looks up its key and the keys that differ in one bit (Lv et al.
/// 2007), skips overfull keys, and keeps descriptors with few differing bits. Each query landmark
/// votes for the maps in which it is found, with weight log((number of maps + 1) / number of maps in
/// which it is found), so that ubiquitous landmarks hardly count. The same maps, order and seed
/// give the same result.
class MapIndex {
 public:
  /// @param seed seed of the random choice of bits
  explicit MapIndex(std::uint64_t seed = 0) : seed_(seed) {}

  /// Adds a map: its most observed landmarks, at most 600. @return its number, from 0
  std::size_t add(const LandmarkMap& map);
  std::size_t size() const { return entries_of_.size(); }
  /// Whether the index contains landmarks of a map. The first known descriptor sets the kind; maps
  /// without descriptors of this kind are never found.
  bool holds(std::size_t map) const { return entries_of_[map] > 0; }

  /// The maps most similar to map number `map`, at most `most`, likeliest first; equal scores are
  /// ordered by number. The first call after an add() prepares the index. Any number of threads may
  /// call this function.
  std::vector<RecognitionCandidate> find(std::size_t map, std::size_t most) const;
  /// The same for any map.
  std::vector<RecognitionCandidate> find(const LandmarkMap& map, std::size_t most) const;

  /// Memory of the index in bytes.
  std::size_t memory() const;

 private:
  std::vector<std::uint8_t> bytes_of(const LandmarkMap& map) const;
  std::vector<std::uint64_t> words_of(std::span<const std::uint8_t> bytes) const;
  std::size_t descriptors() const {
    return size() == 0 ? 0 : first_of_.back() + entries_of_.back();
  }
  void choose_comparisons() const;
  std::size_t map_of(std::uint32_t descriptor) const;
  void choose_bits() const;
  std::uint32_t key(std::size_t table, std::span<const std::uint64_t> descriptor) const;
  void prepare() const;
  std::vector<RecognitionCandidate> find(std::span<const std::uint64_t> words, std::size_t most,
                                         std::size_t except) const;

  std::uint64_t seed_;
  std::string kind_;            // kind of the descriptors; empty until the first one
  std::size_t bytes_each_ = 0;  // per descriptor
  std::size_t words_each_ = 0;  // 64-bit words per descriptor
  std::size_t bits_each_ = 0;
  // All descriptors: bytes, and bits without spare capacity.
  std::vector<std::uint8_t> bytes_;
  mutable std::vector<std::uint64_t> words_;  // made on the first query after an add()
  // One bit of a converted descriptor: whether a + b - c - d of its bytes at these places exceeds
  // the mean.
  struct Comparison {
    std::array<std::uint16_t, 4> places;
    int mean;

    int of(std::span<const std::uint8_t> bytes) const {
      return bytes[places[0]] + bytes[places[1]] - bytes[places[2]] - bytes[places[3]];
    }
  };
  mutable std::vector<Comparison> comparisons_;  // one per bit; empty for binary descriptors
  std::vector<std::size_t> entries_of_;          // number of descriptors per map
  std::vector<std::uint32_t> first_of_;          // first descriptor of each map, ascending
  // Tables as lists by key, made on the first query after an add().
  mutable std::size_t key_bits_ = 0;
  mutable std::vector<std::uint16_t> bits_;  // key_bits_ bits per table
  mutable std::vector<std::vector<std::uint32_t>> starts_;
  mutable std::vector<std::vector<std::uint32_t>> entries_;
  mutable std::size_t prepared_ = 0;
  mutable std::mutex preparing_;
};

}  // namespace cairn

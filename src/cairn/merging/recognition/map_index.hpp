// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "cairn/map/landmark_map.hpp"

namespace cairn {

struct RecognitionOptions {
  std::size_t landmarks = 600;  ///< most of a map that take part: the most observed
  double max_difference =
      0.1953;              ///< share of bits in which descriptors of one landmark may differ
  std::size_t tables = 3;  ///< of the index
  /// Of each table, 8 to 24; 0: as many as leave a few descriptors under a key, at least 14.
  std::size_t key_bits = 0;
  std::uint64_t seed = 0;  ///< of the choice of bits

  /// @throws Error (misuse) naming the field, its value and what it may be
  void validate() const;
};

/// A map that may show the same place.
struct RecognitionCandidate {
  std::size_t map = 0;  ///< number that add() gave it
  double score = 0.0;   ///< higher is likelier; compares within one query only
};

/// Which of many maps may show the place that a map shows, without aligning any: an inverted index over
/// binary descriptors.
///
/// A descriptor is filed in each table under a key of a few of its bits, drawn at random (Indyk and Motwani
/// 1998) from those that are about as often 1 as 0 in these maps and go their own way: bits that mostly say the
/// same would file everything under few keys. A query looks under its key and those that differ in one bit (Lv
/// et al. 2007), passes over keys under which far more is filed than under others, and keeps what differs in few
/// bits altogether. Each landmark of the query votes for the maps it is found in, with log(maps / maps it is found
/// in): what is everywhere tells nothing. Same maps in the same order and seed, same result.
class MapIndex {
 public:
  explicit MapIndex(const RecognitionOptions& options = {});

  /// Takes a map in. @return its number, from 0
  std::size_t add(const LandmarkMap& map);
  std::size_t size() const { return entries_of_.size(); }
  /// Whether a map has landmarks here; one without binary descriptors of the kind of the first that has some
  /// is never found.
  bool holds(std::size_t map) const { return entries_of_[map] > 0; }

  /// The first call after an add() prepares the index; until it returns, no other thread may ask.
  /// Of a map that add() took: the others, likeliest first, at most `most`; of equal scores the lower number.
  std::vector<RecognitionCandidate> find(std::size_t map, std::size_t most) const;
  /// Of any map.
  std::vector<RecognitionCandidate> find(const LandmarkMap& map, std::size_t most) const;

  /// Bytes that the index takes.
  std::size_t memory() const;

 private:
  std::vector<std::uint64_t> words_of(const LandmarkMap& map) const;
  std::size_t descriptors() const { return words_each_ == 0 ? 0 : words_.size() / words_each_; }
  std::size_t map_of(std::uint32_t descriptor) const;
  void choose_bits() const;
  std::uint32_t key(std::size_t table, std::span<const std::uint64_t> descriptor) const;
  void prepare() const;
  std::vector<RecognitionCandidate> find(std::span<const std::uint64_t> words, std::size_t most,
                                         std::size_t except) const;

  RecognitionOptions options_;
  std::string kind_;            // of the descriptors; empty until there are some
  std::size_t bytes_each_ = 0;  // of a descriptor
  std::size_t words_each_ = 0;
  // Of all descriptors; without room to spare once the tables are made.
  mutable std::vector<std::uint64_t> words_;
  std::vector<std::size_t> entries_of_;  // of each map
  std::vector<std::uint32_t> first_of_;  // descriptor of each map, ascending
  // Tables as lists by key, made when first asked after an add().
  mutable std::size_t key_bits_ = 0;
  mutable std::vector<std::uint16_t> bits_;  // key_bits_ of each table
  mutable std::vector<std::vector<std::uint32_t>> starts_;
  mutable std::vector<std::vector<std::uint32_t>> entries_;
  mutable std::size_t prepared_ = 0;
};

}  // namespace cairn

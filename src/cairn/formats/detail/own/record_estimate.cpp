// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/own/record_estimate.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

namespace cairn::detail {
namespace {

struct TokenCount {
  std::uint64_t starts = 0;
  std::uint64_t dash_ends = 0;  // of those ending in '-'
};

// Counts the tokens of a text that follows the byte `before`. First counts in parallel byte counters, which
// the compiler vectorises, in too few steps to overflow them.
TokenCount count_tokens(char before, std::string_view text) {
  constexpr std::size_t kLanes = 32;
  constexpr std::size_t kMostSteps = 255;
  const auto starts = [](char a, char b) {
    return static_cast<std::uint8_t>((b > ' ') & (a <= ' '));
  };
  const auto ends_dash = [](char a, char b) {
    return static_cast<std::uint8_t>((b <= ' ') & (a == '-'));
  };
  if (text.empty()) return {};
  TokenCount count{starts(before, text[0]), ends_dash(before, text[0])};
  const char* next = text.data() + 1;
  const char* const end = text.data() + text.size();
  while (end - next >= std::ptrdiff_t{kLanes}) {
    std::array<std::uint8_t, kLanes> lane_starts{};
    std::array<std::uint8_t, kLanes> lane_ends{};
    const std::size_t steps = std::min(static_cast<std::size_t>(end - next) / kLanes, kMostSteps);
    for (std::size_t step = 0; step < steps; ++step, next += kLanes) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const char a = *(next + lane - 1);
        const char b = next[lane];
        lane_starts[lane] = static_cast<std::uint8_t>(lane_starts[lane] + starts(a, b));
        lane_ends[lane] = static_cast<std::uint8_t>(lane_ends[lane] + ends_dash(a, b));
      }
    }
    for (const std::uint8_t lane : lane_starts) count.starts += lane;
    for (const std::uint8_t lane : lane_ends) count.dash_ends += lane;
  }
  for (; next != end; ++next) {
    count.starts += starts(next[-1], *next);
    count.dash_ends += ends_dash(next[-1], *next);
  }
  return count;
}

// Estimates the number of records in a text, block by block.
class RecordEstimate {
 public:
  void add(std::string_view block) {
    const TokenCount all = count_tokens(before_, block);
    in_landmarks_.starts += all.starts;
    in_landmarks_.dash_ends += all.dash_ends;
    bytes_ += block.size();
    while (!block.empty()) {
      if (before_ == '\n') {
        in_landmark_ = block[0] == 'L';
        counts_.landmarks += in_landmark_ ? 1 : 0;
        counts_.frames += block[0] == 'F' ? 1 : 0;
      }
      const std::size_t newline = block.find('\n');
      const std::string_view line =
          newline == std::string_view::npos ? block : block.substr(0, newline + 1);
      // Most lines are landmarks; the tokens of other lines are subtracted.
      if (!in_landmark_) {
        const TokenCount others = count_tokens(before_, line);
        in_landmarks_.starts -= others.starts;
        in_landmarks_.dash_ends -= others.dash_ends;
      }
      before_ = line.back();
      block.remove_prefix(line.size());
    }
  }

  RecordCounts counts() const {
    // The shortest record bounds the number of records, whatever the lines' first letters are.
    constexpr std::uint64_t kShortestFrame = sizeof("FRAME 0 0 0 0 0 0 0 1");
    constexpr std::uint64_t kShortestLandmark = sizeof("LANDMARK 0 0 0 0 - -");
    RecordCounts counts = counts_;
    counts.frames = std::min(counts.frames, bytes_ / kShortestFrame);
    counts.landmarks = std::min(counts.landmarks, bytes_ / kShortestLandmark);
    const std::uint64_t in_observations =
        in_landmarks_.starts + 8 * std::min(in_landmarks_.dash_ends, counts.landmarks);
    const std::uint64_t in_records = 15 * counts.landmarks;
    if (in_observations > in_records) counts.observations = (in_observations - in_records) / 3;
    return counts;
  }

 private:
  RecordCounts counts_;
  TokenCount in_landmarks_;
  std::uint64_t bytes_ = 0;
  bool in_landmark_ = false;
  char before_ = '\n';  // the last byte seen
};

}  // namespace

RecordCounts estimate_records(ByteSource& source) {
  RecordEstimate estimate;
  std::vector<char> block(block_size_for(source));
  while (const std::size_t size = source.read(block.data(), block.size())) {
    estimate.add({block.data(), size});
  }
  source.rewind();
  return estimate.counts();
}

}  // namespace cairn::detail

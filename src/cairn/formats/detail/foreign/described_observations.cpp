// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/described_observations.hpp"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/memory_budget.hpp"

namespace cairn::detail {
std::size_t medoid(std::span<const std::span<const std::uint8_t>> descriptors,
                   DescriptorNorm norm) {
  constexpr std::size_t kMost = 64;
  descriptors = descriptors.first(std::min(descriptors.size(), kMost));
  std::size_t best = 0;
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    std::uint64_t sum = 0;
    for (const auto& other : descriptors) sum += descriptor_difference(descriptors[i], other, norm);
    if (sum < least) {
      least = sum;
      best = i;
    }
  }
  return best;
}

void append_distinct(DescriptorColumn& column,
                     std::span<const std::span<const std::uint8_t>> descriptors,
                     DescriptorNorm norm) {
  std::vector<std::span<const std::uint8_t>> chosen;
  if (!descriptors.empty()) {
    for (const std::size_t i :
         distinct_descriptors(descriptors, medoid(descriptors, norm), kDistinctViews, norm)) {
      chosen.push_back(descriptors[i]);
    }
  }
  append_descriptors(column, chosen);
}

void require_descriptor_budget(std::uint64_t descriptor_bytes, std::uint64_t file_bytes,
                               const std::string& name) {
  if (descriptor_bytes <= memory_budget(file_bytes)) return;
  throw Error(ErrorKind::kInput, name, fmt::format("descriptors take {} bytes", descriptor_bytes),
              "at most 32 times the bytes of the files and 64 MiB");
}

void DescribedObservations::add(const Entry& entry, std::span<const std::uint8_t> descriptor) {
  entries_.push_back(entry);
  if (bytes_each_ == 0) return;
  bytes_.insert(bytes_.end(), descriptor.begin(), descriptor.end());
  ends_.push_back(bytes_.size());
}

std::size_t DescribedObservations::fill(MapTables& tables, const std::string& kind,
                                        DescriptorNorm norm) && {
  const std::vector<LandmarkId>& ids = tables.landmarks.ids;
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> rows(entries_.size(), kNone);
  ObservationTable& table = tables.observations;
  table.offsets.assign(ids.size() + 1, 0);
  std::size_t left_out = 0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const LandmarkId id{entries_[i].landmark_id};
    const auto found = std::lower_bound(ids.begin(), ids.end(), id);
    if (found == ids.end() || *found != id) {
      ++left_out;
      continue;
    }
    rows[i] = static_cast<std::uint32_t>(found - ids.begin());
    ++table.offsets[rows[i] + 1];
  }
  for (std::size_t i = 0; i < ids.size(); ++i) table.offsets[i + 1] += table.offsets[i];
  std::vector<std::uint64_t> next(table.offsets.begin(), table.offsets.end() - 1);
  const std::size_t count = table.offsets.back();
  std::vector<std::size_t> entry_of(count);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    if (rows[i] != kNone) entry_of[next[rows[i]]++] = i;
  }
  for (std::size_t row = 0; row < ids.size(); ++row) {
    const auto at = [&](std::uint64_t k) {
      return entry_of.begin() + static_cast<std::ptrdiff_t>(k);
    };
    std::stable_sort(
        at(table.offsets[row]), at(table.offsets[row + 1]),
        [&](std::size_t a, std::size_t b) { return entries_[a].frame < entries_[b].frame; });
  }
  table.frames.reserve(count);
  table.pixels.reserve(count);
  for (const std::size_t i : entry_of) {
    const Entry& entry = entries_[i];
    table.frames.push_back(entry.frame);
    table.pixels.push_back(entry.pixel);
    table.keypoints.push_back(entry.keypoint);
    table.depths.push_back(entry.depth);
    table.octaves.push_back(entry.octave);
  }
  if (bytes_each_ > 0) {
    DescriptorColumn column{kind, bytes_each_, {}, {}};
    std::vector<std::span<const std::uint8_t>> of_landmark;
    for (std::size_t row = 0; row < ids.size(); ++row) {
      of_landmark.clear();
      for (std::uint64_t k = table.offsets[row]; k < table.offsets[row + 1]; ++k) {
        const std::size_t begin = entry_of[k] == 0 ? 0 : ends_[entry_of[k] - 1];
        if (begin == ends_[entry_of[k]]) continue;
        of_landmark.push_back(std::span(bytes_).subspan(begin, bytes_each_));
      }
      append_distinct(column, of_landmark, norm);
    }
    if (std::find(column.known.begin(), column.known.end(), 1) != column.known.end()) {
      tables.landmarks.descriptors = std::move(column);
    }
  }
  if (count == 0) table.offsets.clear();  // unknown, as in ObservationList
  entries_ = {};
  bytes_ = {};
  ends_ = {};
  return left_out;
}

}  // namespace cairn::detail

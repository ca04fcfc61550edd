// SPDX-License-Identifier: BSD-3-Clause
// Which of many maps show the place of a map: time of a query, memory, and how often the partner is found.
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

#include "cairn/core/random.hpp"
#include "cairn/merging/recognition/map_index.hpp"

namespace {

using namespace cairn;

constexpr std::size_t kBytes = 32;
constexpr std::size_t kLandmarks = 600;

using Bits = std::vector<std::uint8_t>;

// As ORB's are: looks come in kinds, and some bits are mostly alike.
class Looks {
 public:
  Looks() : random_(1) {
    for (double& share : ones_) share = random_.uniform(0.25, 0.75);
    for (int i = 0; i < 500; ++i) kinds_.push_back(anything());
  }
  Bits landmark() { return changed(kinds_[random_.index(kinds_.size())], 0.25); }
  Bits seen(const Bits& landmark) { return changed(landmark, 0.1); }

 private:
  Bits anything() {
    Bits bits(8 * kBytes);
    for (std::size_t i = 0; i < bits.size(); ++i) bits[i] = random_.chance(ones_[i]) ? 1 : 0;
    return bits;
  }
  Bits changed(const Bits& bits, double share) {
    Bits other = bits;
    for (std::size_t i = 0; i < bits.size(); ++i) {
      if (random_.chance(share)) other[i] = random_.chance(ones_[i]) ? 1 : 0;
    }
    return other;
  }

  Random random_;
  std::vector<double> ones_ = std::vector<double>(8 * kBytes);
  std::vector<Bits> kinds_;
};

LandmarkMap map_of(const std::vector<Bits>& place, std::size_t begin, Looks& looks) {
  MapTables tables;
  DescriptorColumn column{"ORB", kBytes, {}, {}};
  for (std::size_t i = 0; i < kLandmarks; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(0.0, 0.0, 1.0);
    column.known.push_back(1);
    const Bits bits = looks.seen(place[begin + i]);
    for (std::size_t k = 0; k < kBytes; ++k) {
      unsigned byte = 0;
      for (std::size_t bit = 0; bit < 8; ++bit) byte |= unsigned{bits[8 * k + bit]} << bit;
      column.bytes.push_back(static_cast<std::uint8_t>(byte));
    }
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

// Two maps of each place share a third of their landmarks.
void recognition(benchmark::State& state) {
  const auto maps = static_cast<std::size_t>(state.range(0));
  Looks looks;
  MapIndex index;
  std::vector<Bits> place(2 * kLandmarks - kLandmarks / 3);
  while (index.size() < maps) {
    for (Bits& landmark : place) landmark = looks.landmark();
    index.add(map_of(place, 0, looks));
    index.add(map_of(place, place.size() - kLandmarks, looks));
  }
  std::size_t asked = 0;
  std::size_t first_ten = 0;
  (void)index.find(std::size_t{0}, 1);  // makes the tables
  for (auto _ : state) {
    const std::size_t map = asked++ * 7919 % index.size();
    for (const RecognitionCandidate& candidate : index.find(map, 10)) {
      if (candidate.map == (map ^ 1)) ++first_ten;
    }
  }
  state.counters["memory_MB"] = static_cast<double>(index.memory()) / 1e6;
  state.counters["recall_at_10"] = static_cast<double>(first_ten) / static_cast<double>(asked);
}
BENCHMARK(recognition)->Arg(50)->Arg(500)->Arg(5000)->Unit(benchmark::kMillisecond);

}  // namespace

// SPDX-License-Identifier: BSD-3-Clause
// Which of many maps show the place of a map: time of a query, memory, and how often the partner is found.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "cairn/core/random.hpp"
#include "cairn/merging/recognition/map_index.hpp"

namespace {

using namespace cairn;

constexpr std::size_t kLandmarks = 600;
constexpr std::size_t kKinds = 500;  // of looks

using Values = std::vector<std::uint8_t>;

// As ORB's are: looks come in kinds, and some bits are mostly alike. A value is a bit.
class OrbLooks {
 public:
  static constexpr const char* kKind = "ORB";
  static constexpr std::size_t kBytes = 32;

  OrbLooks() {
    for (double& share : ones_) share = random_.uniform(0.25, 0.75);
    for (std::size_t i = 0; i < kKinds; ++i) kinds_.push_back(anything());
  }
  Values landmark() { return changed(kinds_[random_.index(kKinds)], 0.25); }
  Values seen(const Values& landmark) {
    const Values bits = changed(landmark, 0.1);
    Values bytes(kBytes, 0);
    for (std::size_t i = 0; i < bits.size(); ++i) {
      bytes[i / 8] = static_cast<std::uint8_t>(bytes[i / 8] | bits[i] << i % 8);
    }
    return bytes;
  }

 private:
  Values anything() {
    Values bits(8 * kBytes);
    for (std::size_t i = 0; i < bits.size(); ++i) bits[i] = random_.chance(ones_[i]) ? 1 : 0;
    return bits;
  }
  Values changed(const Values& bits, double share) {
    Values other = bits;
    for (std::size_t i = 0; i < bits.size(); ++i) {
      if (random_.chance(share)) other[i] = random_.chance(ones_[i]) ? 1 : 0;
    }
    return other;
  }

  Random random_{1};
  std::vector<double> ones_ = std::vector<double>(8 * kBytes);
  std::vector<Values> kinds_;
};

// As SIFT's are in real images: bytes of a mean of 32, some of which are usually larger, and those of two views of a
// landmark differ by a standard deviation of 13. Looks come in kinds.
class SiftLooks {
 public:
  static constexpr const char* kKind = "SIFT";
  static constexpr std::size_t kBytes = 128;

  SiftLooks() {
    for (double& mean : means_) mean = random_.uniform(16.0, 48.0);
    for (std::size_t i = 0; i < kKinds; ++i) kinds_.push_back(anything());
  }
  Values landmark() {
    const Values& kind = kinds_[random_.index(kKinds)];
    const Values own = anything();
    Values mixed(kBytes);
    for (std::size_t i = 0; i < kBytes; ++i) {
      mixed[i] = static_cast<std::uint8_t>((kind[i] + 3 * own[i]) / 4);
    }
    return mixed;
  }
  Values seen(const Values& landmark) {
    constexpr double kNoise = 9.0;
    Values bytes(kBytes);
    for (std::size_t i = 0; i < kBytes; ++i)
      bytes[i] = byte(landmark[i] + kNoise * random_.normal());
    return bytes;
  }

 private:
  static std::uint8_t byte(double value) {
    return static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
  }
  Values anything() {
    Values bytes(kBytes);
    for (std::size_t i = 0; i < kBytes; ++i) {
      bytes[i] = byte(-means_[i] * std::log(random_.uniform(1e-9, 1.0)));
    }
    return bytes;
  }

  Random random_{1};
  std::vector<double> means_ = std::vector<double>(kBytes);
  std::vector<Values> kinds_;
};

template <class Looks>
LandmarkMap map_of(const std::vector<Values>& place, std::size_t begin, Looks& looks) {
  MapTables tables;
  DescriptorColumn column{Looks::kKind, Looks::kBytes, {}, {}};
  for (std::size_t i = 0; i < kLandmarks; ++i) {
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(0.0, 0.0, 1.0);
    column.known.push_back(1);
    const Values bytes = looks.seen(place[begin + i]);
    column.bytes.insert(column.bytes.end(), bytes.begin(), bytes.end());
  }
  tables.landmarks.descriptors = std::move(column);
  return LandmarkMap(std::move(tables));
}

// Two maps of each place share a third of their landmarks.
template <class Looks>
void recognition(benchmark::State& state) {
  const auto maps = static_cast<std::size_t>(state.range(0));
  Looks looks;
  MapIndex index;
  std::vector<Values> place(2 * kLandmarks - kLandmarks / 3);
  while (index.size() < maps) {
    for (Values& landmark : place) landmark = looks.landmark();
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
BENCHMARK(recognition<OrbLooks>)->Arg(50)->Arg(500)->Arg(5000)->Unit(benchmark::kMillisecond);
BENCHMARK(recognition<SiftLooks>)->Arg(50)->Arg(1000)->Arg(5000)->Unit(benchmark::kMillisecond);

}  // namespace

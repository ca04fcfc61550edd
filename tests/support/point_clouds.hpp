// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <gtest/gtest.h>

#include "cairn/core/file.hpp"
#include "cairn/map/landmark_map.hpp"

#include "support/maps.hpp"

namespace cairn::testing {

/// Bytes that come in pieces and without a size, as from a pipe.
class Pipe final : public ByteSource {
 public:
  Pipe(std::string_view bytes, std::size_t piece) : bytes_(bytes), piece_(piece) {}
  const std::string& name() const override { return name_; }
  std::optional<std::uint64_t> size() const override { return std::nullopt; }
  std::size_t read(char* buffer, std::size_t capacity) override {
    const std::size_t count = bytes_.copy(buffer, std::min(capacity, piece_));
    bytes_.remove_prefix(count);
    return count;
  }
  void rewind() override { FAIL() << "a pipe cannot go back"; }

 private:
  std::string name_ = "pipe";
  std::string_view bytes_;
  std::size_t piece_;
};

/// Bit for bit, but any NaN for any other.
inline bool same_bits(double a, double b) {
  return detail::same(a, b);
}

/// Ids, positions, colours, covariances and the named columns of `a` are in `b`, bit for bit.
inline void expect_same_landmarks(const LandmarkMap& a, const LandmarkMap& b) {
  ASSERT_EQ(a.landmarks().ids, b.landmarks().ids);
  EXPECT_EQ(a.landmarks().colors, b.landmarks().colors);
  ASSERT_EQ(a.has_covariances(), b.has_covariances());
  for (std::uint32_t i = 0; i < a.landmark_count(); ++i) {
    EXPECT_TRUE(detail::same(a.landmarks().positions[i], b.landmarks().positions[i])) << i;
    const auto covariance = a.covariance(LandmarkIndex{i});
    const auto other = b.covariance(LandmarkIndex{i});
    ASSERT_EQ(covariance.has_value(), other.has_value());
    if (covariance) {
      EXPECT_TRUE(detail::same(*covariance, *other)) << i;
    }
  }
  for (const NamedColumn& column : a.landmarks().columns) {
    const NamedColumn* const other = b.column(column.name);
    ASSERT_NE(other, nullptr) << column.name;
    for (std::size_t i = 0; i < column.values.size(); ++i) {
      EXPECT_TRUE(same_bits(column.values[i], other->values[i])) << column.name << i;
    }
  }
}

/// Three landmarks with numbers that a detour over too few digits would change.
/// @param largest_id of the second landmark
inline MapTables rich_tables(LandmarkId largest_id) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  MapTables tables;
  LandmarkTable& landmarks = tables.landmarks;
  landmarks.ids = {LandmarkId{7}, largest_id, LandmarkId{0}};
  landmarks.positions = {{0.1, -0.0, 1.0 / 3.0},
                         {5e-324, -999999999.9999999, -2.2250738585072014e-308},
                         {std::nextafter(1.0, 2.0), 123456789.123456789, -1e-7}};
  Eigen::Matrix3d covariance;
  covariance << 1.0 / 3.0, 0.1, -1e-9, 0.1, 0.7, 1.0 / 7.0, -1e-9, 1.0 / 7.0, 1e5;
  landmarks.covariances = {covariance, Eigen::Matrix3d::Constant(kNan), covariance / 3.0};
  landmarks.colors = {Color{255, 0, 1}, Color{2, 128, 255}, Color{0, 0, 0}};
  landmarks.columns = {{"confidence", {0.1, kNan, 2.0 / 3.0}}, {"w", {-0.0, 1e-310, 3.0}}};
  return tables;
}

/// The most address space that this program has had, KiB; 0 where the system does not tell.
inline std::int64_t peak_memory_kb() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    std::int64_t size = 0;
    if (word == "VmPeak:" && status >> size) return size;
  }
  return 0;
}

}  // namespace cairn::testing

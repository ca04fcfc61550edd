// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/detail/own/binary_layout.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn::detail {
namespace {

class BinaryWriter {
 public:
  BinaryWriter(const LandmarkMap& map, const ByteSink& sink, const Progress& progress)
      : map_(map), sink_(sink), progress_(progress) {
    const std::span<const Camera> cameras = map.cameras();
    const std::span<const Rig> rigs = map.rigs();
    code_sections(*this, MapParts{map.info(), cameras, rigs, map.frames(), map.landmarks(),
                                  map.observations()});
    std::sort(plan_.begin(), plan_.end(),
              [](const Planned& a, const Planned& b) { return a.column < b.column; });
  }

  void write() {
    std::uint64_t end = kHeaderSize + plan_.size() * kTableEntrySize;
    for (const Planned& section : plan_) end = aligned(end) + section.size;
    size_ = aligned(end) + kChecksumSize;
    put(kBinaryMagic);
    put(kBinaryVersion);
    put(std::uint32_t{map_.info().length_unit == LengthUnit::kFree});
    put(size_);
    put(std::uint64_t{map_.frame_count()});
    put(std::uint64_t{map_.landmark_count()});
    put(std::uint64_t{map_.observation_count()});
    put(std::uint64_t{plan_.size()});
    std::uint64_t begin = kHeaderSize + plan_.size() * kTableEntrySize;
    for (const Planned& section : plan_) {
      put(static_cast<std::uint64_t>(section.column));
      put(begin);
      put(section.size);
      begin = aligned(begin + section.size);
    }
    for (const Planned& section : plan_) {
      section.write();
      pad();
    }
    flush();
    const detail::Hash128 hash = hasher_.digest();
    put(hash.low);
    put(hash.high);
    flush();
  }

  // ---- what code_sections() calls

  void text(MapColumn column, const std::optional<std::string>& text) {
    if (text) plan_bytes(column, *text);
  }
  template <class Entry, class Describe>
  void entry(MapColumn column, const std::optional<Entry>& entry, const Describe& describe) {
    if (entry) entries(column, std::span(&*entry, 1), describe);
  }
  template <class Entries, class Describe>
  void entries(MapColumn column, const Entries& entries, const Describe& describe) {
    Fields fields;
    for (const auto& entry : entries) describe(fields, entry);
    plan_bytes(column, std::move(fields.bytes));
  }
  template <class Row>
  void rows(MapColumn column, const std::vector<Row>& rows) {
    const std::string_view bytes(reinterpret_cast<const char*>(rows.data()),
                                 rows.size() * sizeof(Row));
    plan(column, bytes.size(), [this, bytes] { put(bytes); });
  }

  template <std::size_t kNumbers, class Value, class Describe>
  void numbers(MapColumn column, const OptionalColumn<Value>& values, const Describe& describe) {
    plan(column, 8 * kNumbers * values.size(), [this, &values, describe] {
      Fields fields;
      for (const std::optional<Value> value : values) {
        fields.bytes.clear();
        if (value) {
          describe(fields, *value);
        } else {
          for (std::size_t i = 0; i < kNumbers; ++i) fields(kUnknownNumber);
        }
        put(fields.bytes);
      }
    });
  }

  template <class Value>
  void integers(MapColumn column, const OptionalColumn<Value>& values, std::int64_t /*least*/,
                std::int64_t /*most*/) {
    plan(column, 8 * values.size(), [this, &values] {
      for (const auto& value : values) put(value ? to_integer(*value) : kUnknownInteger);
    });
  }

  void names(MapColumn column, const std::vector<std::string>& names) {
    entries(column, names, [](Fields& fields, const std::string& name) { fields(name); });
  }

  void covariances(const std::vector<Eigen::Matrix3d>& covariances) {
    plan(MapColumn::kCovariances, 72 * covariances.size(), [this, &covariances] {
      for (const Eigen::Matrix3d& covariance : covariances) {
        const bool known = !std::isnan(covariance(0, 0));
        for (const double entry : covariance.reshaped()) put(known ? entry : kUnknownNumber);
      }
    });
  }

  void colors(const OptionalColumn<Color>& colors) {
    plan(MapColumn::kColors, 4 * colors.size(), [this, &colors] {
      for (const auto& color : colors) {
        const Color rgb = color.value_or(Color{});
        for (const std::uint8_t value : {rgb.red, rgb.green, rgb.blue}) put(value);
        put(std::uint8_t{color.has_value()});
      }
    });
  }

  void descriptors(const std::optional<DescriptorColumn>& descriptors) {
    if (!descriptors) return;
    Fields kind;
    kind(static_cast<std::uint32_t>(descriptors->bytes_each));
    plan_bytes(MapColumn::kDescriptorKind, kind.bytes + descriptors->kind);
    rows(MapColumn::kKnownDescriptors, descriptors->known);
    rows(MapColumn::kDescriptors, descriptors->bytes);
    rows(MapColumn::kFurtherOffsets, descriptors->further_offsets);
    rows(MapColumn::kFurtherDescriptors, descriptors->further);
  }

  void named_columns(const std::vector<NamedColumn>& columns) {
    entries(MapColumn::kColumnNames, columns,
            [](Fields& fields, const NamedColumn& column) { fields(column.name); });
    plan(MapColumn::kColumnValues, 8 * columns.size() * map_.landmark_count(), [this, &columns] {
      for (const NamedColumn& column : columns) {
        for (const double value : column.values) put(std::isnan(value) ? kUnknownNumber : value);
      }
    });
  }

  void offsets(const std::vector<std::uint64_t>& offsets) { rows(MapColumn::kOffsets, offsets); }

 private:
  struct Planned {
    MapColumn column;
    std::uint64_t size;
    std::function<void()> write;
  };

  // The bytes of entries.
  struct Fields {
    std::string bytes;

    template <class Number>
      requires std::is_arithmetic_v<Number>
    void operator()(Number number, std::string_view /*what*/ = {}) {
      bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
    }
    void operator()(const std::optional<double>& number, std::string_view /*what*/) {
      (*this)(number.value_or(kUnknownNumber));
    }
    void operator()(const std::string& text, std::string_view /*what*/ = {}) {
      if (!std::in_range<std::uint32_t>(text.size())) {
        throw Error(ErrorKind::kMisuse, "binary map",
                    fmt::format("a text of {} bytes", text.size()), "fewer than 2^32");
      }
      (*this)(static_cast<std::uint32_t>(text.size()));
      bytes += text;
    }
    void filled(const std::string& text, std::string_view what) { (*this)(text, what); }
    void operator()(const std::vector<double>& numbers, std::string_view what) {
      list(numbers, what, [&](double number) { (*this)(number); });
    }
    void both(double number, double /*mirrored*/) { (*this)(number); }
    template <class Entry, class Describe>
    void list(const std::vector<Entry>& entries, std::string_view /*what*/,
              const Describe& describe) {
      (*this)(static_cast<std::uint32_t>(entries.size()));
      for (const Entry& entry : entries) describe(entry);
    }
  };

  void flush() {
    hasher_.update(buffer_);
    sink_(buffer_);
    buffer_.clear();
    if (progress_) progress_(static_cast<double>(written_) / static_cast<double>(size_));
  }

  void put(std::string_view bytes) {
    written_ += bytes.size();
    while (!bytes.empty()) {
      const std::string_view block = bytes.substr(0, kBinaryBlock - buffer_.size());
      buffer_ += block;
      bytes.remove_prefix(block.size());
      if (buffer_.size() == kBinaryBlock) flush();
    }
  }

  template <class Number>
    requires std::is_arithmetic_v<Number>
  void put(Number number) {
    put(std::string_view(reinterpret_cast<const char*>(&number), sizeof number));
  }

  void pad() { put(std::string_view("\0\0\0\0\0\0\0", aligned(written_) - written_)); }

  // Leaves out an empty section.
  void plan(MapColumn column, std::uint64_t size, std::function<void()> write) {
    if (size > 0) plan_.push_back({column, size, std::move(write)});
  }
  void plan_bytes(MapColumn column, std::string bytes) {
    const std::uint64_t size = bytes.size();
    plan(column, size, [this, bytes = std::move(bytes)] { put(bytes); });
  }

  const LandmarkMap& map_;
  const ByteSink& sink_;
  const Progress& progress_;
  std::vector<Planned> plan_;
  detail::Hasher hasher_;
  std::string buffer_;
  std::uint64_t size_ = 0;
  std::uint64_t written_ = 0;
};

}  // namespace
}  // namespace cairn::detail

namespace cairn {

void write_binary(const LandmarkMap& map, const ByteSink& sink, const Execution& execution) {
  detail::BinaryWriter(map, sink, execution.progress).write();
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/own/point_columns.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <concepts>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/losses.hpp"
#include "cairn/geometry/limits.hpp"
#include "cairn/map/column_motion.hpp"
#include "cairn/map/splats.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kPointBlock = std::size_t{1} << 20;

template <class T>
bool parse_scalar(std::string_view text, T& value) {
  // printf writes a plus sign, which from_chars does not accept.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc{} && stop == end;
}

// Bytes of a field in a binary point, without a list.
std::uint64_t fixed_size(const PointField& field) {
  return field.list_count ? 0 : field.count * size_of(field.type);
}

std::uint64_t fixed_size(const std::vector<PointField>& fields) {
  std::uint64_t size = 0;
  for (const PointField& field : fields) size += fixed_size(field);
  return size;
}

bool has_lists(const std::vector<PointField>& fields) {
  return std::any_of(fields.begin(), fields.end(),
                     [](const PointField& field) { return field.list_count.has_value(); });
}

// Name and fields of a kind of binary records.
struct PointRecords {
  const std::vector<PointField>& fields;
  std::uint64_t count;
  std::string_view name;
  bool big_endian;
};

[[noreturn]] void refuse_truncated(const HeadedSource& source, std::uint64_t end,
                                   const PointRecords& records, std::uint64_t done,
                                   const std::size_t* field) {
  std::string where = fmt::format("{}: byte {}", source.name(), end);
  if (field != nullptr) {
    where += fmt::format(": field {} ({})", *field + 1, records.fields[*field].name);
  }
  std::string expected = "all of them";
  if (!has_lists(records.fields)) {
    expected = fmt::format("{} bytes for each", fixed_size(records.fields));
  }
  throw Error(ErrorKind::kInput, where,
              fmt::format("the file ends after {} of {} {}", done, records.count, records.name),
              expected);
}

// Refuses fixed-size records that start at `begin` if only `present` bytes exist.
[[noreturn]] void refuse_cut(const HeadedSource& source, std::uint64_t begin, std::uint64_t present,
                             const PointRecords& records) {
  const std::uint64_t stride = fixed_size(records.fields);
  std::uint64_t rest = present % stride;
  if (rest == 0) refuse_truncated(source, begin + present, records, present / stride, nullptr);
  std::size_t field = 0;
  while (rest >= fixed_size(records.fields[field])) rest -= fixed_size(records.fields[field++]);
  refuse_truncated(source, begin + present, records, present / stride, &field);
}

// Refuses more records than the source's size allows, before reading or allocating memory.
void check_presence(const HeadedSource& source, const PointRecords& records) {
  if (has_lists(records.fields)) return;
  const std::uint64_t stride = fixed_size(records.fields);
  const auto remaining = source.remaining();
  if (remaining && records.count > *remaining / stride) {
    refuse_cut(source, source.offset(), *remaining, records);
  }
}

// Reads one record with lists. Copies the bytes outside the lists to `fixed` unless null.
void walk_record(HeadedSource& source, const PointRecords& records, std::uint64_t done,
                 char* fixed) {
  const auto expect_bytes = [&](std::size_t count, std::size_t field) {
    const std::string_view bytes = source.peek(count);
    if (bytes.size() < count) {
      refuse_truncated(source, source.offset() + bytes.size(), records, done, &field);
    }
    return bytes.data();
  };
  for (std::size_t i = 0; i < records.fields.size(); ++i) {
    const PointField& field = records.fields[i];
    if (!field.list_count) {
      const std::size_t size = size_of(field.type);
      const char* const bytes = expect_bytes(size, i);
      if (fixed != nullptr) {
        std::memcpy(fixed, bytes, size);
        fixed += size;
      }
      source.consume(size);
      continue;
    }
    const char* const bytes = expect_bytes(size_of(*field.list_count), i);
    const auto length = with_type(*field.list_count, [&]<class T>() {
      return static_cast<std::int64_t>(load_scalar<T>(bytes, records.big_endian));
    });
    if (length < 0) {
      throw Error(ErrorKind::kInput,
                  fmt::format("{}: byte {}: field {} ({})", source.name(), source.offset(), i + 1,
                              field.name),
                  fmt::format("a list of {} values", length), "0 or more");
    }
    source.consume(size_of(*field.list_count));
    // Cannot overflow: a list's length has at most 32 bits.
    const std::uint64_t size = static_cast<std::uint64_t>(length) * size_of(field.type);
    if (source.skip(size) < size) refuse_truncated(source, source.offset(), records, done, &i);
  }
}

constexpr std::size_t kRowBlock = std::size_t{1} << 20;
constexpr std::size_t kAlpha = kChannelNames.size();  // index of the channel that follows them

template <std::floating_point Number>
void append_text_value(std::string& out, Number value) {
  std::array<char, 32> buffer;
  // Some readers do not accept the sign of a NaN.
  if (std::isnan(value)) value = std::abs(value);
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  out.append(buffer.data(), result.ptr);
}
void append_text_value(std::string& out, std::uint64_t value) {
  append_number(out, value);
}

// Returns the number of replaced values.
template <class Replacement>
std::size_t replace_infinite(ColumnValues& values, const Replacement& replacement) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isinf(values[i])) continue;
    values.set(i, replacement(values[i]));
    ++count;
  }
  return count;
}

// By column: whether a splat has it in single precision, as trainers write all properties. Those of splats and normals
// are rounded, others only if that loses nothing.
std::vector<bool> single_precision_columns(const SplatColumns& splats,
                                           std::span<const NamedColumn> columns) {
  const Similarity3 any_turn(Rigid3::from_roll_pitch_yaw({0, 0, 0}, 1.0, 1.0, 1.0));
  const ColumnMotion turning(column_names(columns), any_turn, "splats");
  std::vector<bool> single;
  for (const NamedColumn& column : columns) {
    single.push_back(std::all_of(column.values.begin(), column.values.end(), [](double value) {
      return std::isnan(value) || static_cast<double>(static_cast<float>(value)) == value;
    }));
  }
  for (const std::size_t column : turning.changed()) single[column] = true;
  for (const std::size_t column : splats.all()) single[column] = true;
  return single;
}

}  // namespace

std::optional<LengthUnit> unit_in_comment(std::string_view comment) {
  for (const LengthUnit unit : {LengthUnit::kMetres, LengthUnit::kFree}) {
    if (comment == unit_comment(unit)) return unit;
  }
  return std::nullopt;
}

std::string unit_comment(LengthUnit unit) {
  return fmt::format("cairn length_unit {}", unit == LengthUnit::kFree ? "free" : "metres");
}

PointTable::PointTable(PointFormat format, std::string source, std::string_view where,
                       std::vector<PointField> fields, const Execution& execution)
    : source_(std::move(source)),
      execution_(execution),
      fields_(std::move(fields)),
      slots_(fields_.size()) {
  choose_slots(format, where);
}

void PointTable::choose_slots(PointFormat format, std::string_view where) {
  std::unordered_map<std::string_view, std::size_t> by_name;
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const PointField& field = fields_[i];
    if (format == PointFormat::kPcd && field.name == "_") continue;  // padding
    if (field.list_count || field.count != 1) {
      lost(fmt::format("field {} left out: it is not one number a point", printable(field.name)));
    } else if (!is_visible(field.name)) {
      lost(fmt::format("field {} left out: its name is not visible ASCII", printable(field.name)));
    } else {
      by_name.emplace(field.name, i);
      slots_[i].role = Role::kColumn;
    }
  }
  const auto find = [&](std::string_view name) -> const PointField* {
    const auto found = by_name.find(name);
    return found == by_name.end() ? nullptr : &fields_[found->second];
  };
  const auto use = [&](std::string_view name, Role role, std::size_t index) {
    slots_[by_name.at(name)] = {role, index};
  };

  for (std::size_t i = 0; i < 3; ++i) {
    reject_if(find(kAxisNames[i]) == nullptr, where,
              fmt::format("no scalar field '{}'", kAxisNames[i]), "x, y and z");
    use(kAxisNames[i], Role::kPosition, i);
  }
  has_covariances_ =
      std::all_of(kCovarianceEntries.begin(), kCovarianceEntries.end(),
                  [&](const CovarianceEntry& entry) { return find(entry.name) != nullptr; });
  for (std::size_t i = 0; has_covariances_ && i < kCovarianceEntries.size(); ++i) {
    use(kCovarianceEntries[i].name, Role::kCovariance, i);
  }
  bool may_have_channels = true;
  if (format == PointFormat::kPcd) {
    // Ignores 'rgba' if there is an 'rgb', even one that is not a colour: it keeps its name, so that no
    // colour could be written beside it.
    const std::string_view name = find("rgb") != nullptr ? "rgb" : "rgba";
    const PointField* const packed = find(name);
    has_colors_ = packed != nullptr && size_of(packed->type) == 4;
    if (has_colors_) use(name, Role::kPackedColor, 0);
    may_have_channels = !has_colors_ && find("rgb") == nullptr;
  }
  const bool has_channels =
      may_have_channels &&
      std::all_of(kChannelNames.begin(), kChannelNames.end(), [&](std::string_view name) {
        const PointField* const channel = find(name);
        return channel != nullptr && channel->type == ScalarType::kUint8;
      });
  for (std::size_t i = 0; has_channels && i < 3; ++i) use(kChannelNames[i], Role::kChannel, i);
  has_colors_ = has_colors_ || has_channels;
  if (const PointField* const id = find("id"); id != nullptr && is_integer(id->type)) {
    use("id", Role::kId, 0);
    has_ids_ = true;
    ids_are_signed_ = scalar(id->type).kind == 'i';
  }
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    if (slots_[i].role != Role::kColumn) continue;
    slots_[i].index = columns_.size();
    columns_.push_back({fields_[i].name, {}});
  }
}

void PointTable::expect_binary() {
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    if (slots_[i].role != Role::kColumn || fields_[i].type != ScalarType::kFloat32) continue;
    columns_[slots_[i].index].values = std::vector<float>();
  }
}

void PointTable::reserve(std::size_t rows) {
  positions_.reserve(rows);
  if (has_covariances_) covariances_.reserve(rows);
  if (has_colors_) colors_.reserve(rows);
  if (has_ids_) ids_.reserve(rows);
  for (NamedColumn& column : columns_) column.values.reserve(rows);
}

void PointTable::grow(std::size_t rows) {
  const std::size_t size = positions_.size() + rows;
  positions_.resize(size);
  if (has_covariances_) covariances_.resize(size);
  if (has_colors_) colors_.resize(size, Color{});
  if (has_ids_) ids_.resize(size);
  for (NamedColumn& column : columns_) column.values.resize(size);
}

template <class T>
void PointTable::put(Slot slot, std::size_t row, T value) {
  switch (slot.role) {
    case Role::kPosition:
      positions_[row][static_cast<Eigen::Index>(slot.index)] = static_cast<double>(value);
      break;
    case Role::kCovariance: {
      const CovarianceEntry& entry = kCovarianceEntries[slot.index];
      covariances_[row](entry.row, entry.column) = static_cast<double>(value);
      covariances_[row](entry.column, entry.row) = static_cast<double>(value);
      break;
    }
    case Role::kColumn:
      columns_[slot.index].values.set(row, static_cast<double>(value));
      break;
    default:
      if constexpr (std::is_integral_v<T>) {
        using Widest = std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>;
        put_integer(slot, row, static_cast<std::uint64_t>(Widest{value}));
      }
  }
}

void PointTable::put_integer(Slot slot, std::size_t row, std::uint64_t bits) {
  const auto byte = [&](int shift) { return static_cast<std::uint8_t>(bits >> shift & 0xffU); };
  switch (slot.role) {
    case Role::kChannel: {
      Color color = colors_[row].value();
      std::uint8_t* const channels[] = {&color.red, &color.green, &color.blue};
      *channels[slot.index] = byte(0);
      colors_[row] = color;
      break;
    }
    case Role::kPackedColor:
      colors_[row] = Color{byte(16), byte(8), byte(0)};
      break;
    case Role::kId:
      ids_[row] = bits;
      break;
    default:
      break;
  }
}

void PointTable::append_text(std::string_view row, std::uint64_t line_number) {
  grow(1);
  split_words(row, words_);
  std::size_t taken = 0;
  const auto next = [&](const PointField& field) {
    ++taken;
    if (taken > words_.size()) {
      refuse(line_number, taken, field.name, "missing", "more fields on this line");
    }
    return words_[taken - 1];
  };
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const PointField& field = fields_[i];
    if (slots_[i].role != Role::kSkipped) {
      const std::string_view token = next(field);
      put_text(i, token, line_number, taken);
      continue;
    }
    std::uint64_t count = field.count;
    if (field.list_count) {
      const std::string_view token = next(field);
      if (!parse_scalar(token, count)) {
        refuse(line_number, taken, field.name,
               fmt::format("{} is no length of a list", printable(token)), "an unsigned integer");
      }
    }
    for (; count > 0; --count) next(field);
  }
  if (taken < words_.size()) {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}: field {}", source_, line_number, taken + 1),
                fmt::format("{} is too much", printable(words_[taken])), "the line to end here");
  }
}

void PointTable::put_text(std::size_t field, std::string_view text, std::uint64_t line,
                          std::uint64_t token) {
  const Slot slot = slots_[field];
  const ScalarType type = fields_[field].type;
  const std::size_t row = positions_.size() - 1;
  if (is_integer(type)) {
    with_type(type, [&]<class T>() {
      if constexpr (std::is_integral_v<T>) {
        T value = 0;
        if (!parse_scalar(text, value)) {
          refuse(line, token, fields_[field].name,
                 fmt::format("{} does not fit the field", printable(text)),
                 fmt::format("an integer from {} to {}", std::numeric_limits<T>::min(),
                             std::numeric_limits<T>::max()));
        }
        put(slot, row, value);
      }
    });
    return;
  }
  double value = 0.0;
  if (!parse_scalar(text, value)) {
    refuse(line, token, fields_[field].name, fmt::format("{} is not a number", printable(text)),
           "a decimal number, or nan");
  }
  if (slot.role != Role::kPackedColor) {
    put(slot, row, value);
  } else if (std::isnan(value)) {
    // Printing the colour's bits as a number lost the colour.
    colors_[row].reset();
  } else if (std::abs(value) <= std::numeric_limits<float>::max()) {
    put(slot, row, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
  } else {
    refuse(line, token, fields_[field].name, fmt::format("{} is no colour", printable(text)),
           "the bits of 0x00RRGGBB as a number of 32 bits");
  }
}

void PointTable::put_run(std::size_t field, std::size_t first_row, std::size_t rows,
                         const char* bytes, std::size_t step, bool big_endian) {
  const Slot slot = slots_[field];
  if (slot.role == Role::kSkipped) return;
  // Never read as a float, because the colour's bits may be a signalling NaN, which would change.
  const ScalarType type =
      slot.role == Role::kPackedColor ? ScalarType::kUint32 : fields_[field].type;
  with_type(type, [&]<class T>() {
    for (std::size_t i = 0; i < rows; ++i) {
      put(slot, first_row + i, load_scalar<T>(bytes + i * step, big_endian));
    }
  });
}

void PointTable::append_binary(const char* bytes, std::size_t rows, bool big_endian) {
  const std::size_t first_row = positions_.size();
  const auto stride = static_cast<std::size_t>(fixed_size(fields_));
  grow(rows);
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    put_run(i, first_row, rows, bytes, stride, big_endian);
    bytes += fixed_size(fields_[i]);
  }
}

void PointTable::append_columns(const std::vector<const char*>& columns, std::size_t rows) {
  const std::size_t first_row = positions_.size();
  grow(rows);
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    put_run(i, first_row, rows, columns[i], size_of(fields_[i].type), false);
  }
}

void PointTable::drop_points_without_position() {
  const std::size_t size = positions_.size();
  std::vector<char> kept(size);
  for (std::size_t i = 0; i < size; ++i) kept[i] = are_coordinates(positions_[i]) ? 1 : 0;
  const auto left_out = std::count(kept.begin(), kept.end(), 0);
  if (left_out == 0) return;
  lost(far_landmarks_text(static_cast<std::size_t>(left_out), size));
  const auto compact = [&](auto& column) {
    if (column.empty()) return;
    std::size_t to = 0;
    for (std::size_t from = 0; from < size; ++from) {
      if (kept[from] != 0) column[to++] = column[from];
    }
    column.resize(to);
  };
  compact(positions_);
  compact(covariances_);
  compact(colors_);
  compact(ids_);
  for (NamedColumn& column : columns_) column.values.visit(compact);
}

void PointTable::forget_infinite_values() {
  if (const auto splats = splat_columns(columns_)) {
    // Of an opacity of 0 or 1, or of an axis without length: not unknown.
    std::vector<std::size_t> logarithms = splats->log_scales;
    logarithms.push_back(splats->opacity);
    for (const std::size_t column : logarithms) {
      constexpr double kMost = 80.0;  // its exponential is finite in single precision too
      replace_infinite(columns_[column].values,
                       [](double value) { return std::copysign(kMost, value); });
    }
  }
  for (NamedColumn& column : columns_) {
    const std::size_t count = replace_infinite(
        column.values, [](double) { return std::numeric_limits<double>::quiet_NaN(); });
    if (count == 0) continue;
    lost(fmt::format("{} infinite values of field {} taken as unknown", count,
                     printable(column.name)));
  }
}

void PointTable::take_ids(LandmarkTable& landmarks) {
  const std::size_t size = landmarks.positions.size();
  landmarks.ids.reserve(size);
  const auto number = [&] {
    for (std::size_t i = 0; i < size; ++i) landmarks.ids.push_back(LandmarkId{i});
  };
  if (!has_ids_) return number();
  bool usable = true;
  if (ids_are_signed_) {
    usable = std::none_of(ids_.begin(), ids_.end(),
                          [](std::uint64_t id) { return static_cast<std::int64_t>(id) < 0; });
  }
  if (usable &&
      std::adjacent_find(ids_.begin(), ids_.end(), std::greater_equal<>()) != ids_.end()) {
    std::vector<std::uint64_t> sorted = ids_;
    std::sort(sorted.begin(), sorted.end());
    usable = std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();
  }
  if (usable) {
    for (const std::uint64_t id : ids_) landmarks.ids.push_back(LandmarkId{id});
    return;
  }
  log_remark(
      execution_.log, source_,
      "the field 'id' is no id, for some values are negative or occur twice: kept as a column");
  number();
  NamedColumn column{"id", {}};
  column.values.reserve(size);
  for (const std::uint64_t id : ids_) {
    column.values.push_back(ids_are_signed_ ? static_cast<double>(static_cast<std::int64_t>(id))
                                            : static_cast<double>(id));
  }
  landmarks.columns.push_back(std::move(column));
}

// Whether a file has fields that Cairn writes for landmarks from features, and others do not write so.
bool PointTable::has_fields_of_cairn() const {
  const auto is_field = [&](std::size_t i, std::string_view name) {
    return i < fields_.size() && fields_[i].name == name;
  };
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    if (is_field(i, "observations") && fields_[i].type == ScalarType::kUint32 &&
        is_field(i + 1, "id") && is_integer(fields_[i + 1].type)) {
      return true;
    }
    std::size_t entry = 0;
    while (entry < kCovarianceEntries.size() &&
           is_field(i + entry, kCovarianceEntries[entry].name) &&
           fields_[i + entry].type == ScalarType::kFloat64) {
      ++entry;
    }
    if (entry == kCovarianceEntries.size()) return true;
  }
  return false;
}

LandmarkMap PointTable::finish(std::optional<LengthUnit> unit) && {
  drop_points_without_position();
  forget_infinite_values();
  MapTables tables;
  tables.info.length_unit =
      unit.value_or(has_fields_of_cairn() ? LengthUnit::kMetres : LengthUnit::kFree);
  LandmarkTable& landmarks = tables.landmarks;
  landmarks.positions = std::move(positions_);
  landmarks.covariances = std::move(covariances_);
  landmarks.colors = std::move(colors_);
  landmarks.columns = std::move(columns_);
  const auto splats = splat_columns(landmarks.columns);
  if (splats && splats->base_color && !landmarks.colors.empty()) {
    lost("red, green and blue left out: the colours of splats follow from f_dc_0 to f_dc_2");
  }
  if (splats && !has_covariances_) set_splat_looks(*splats, landmarks);
  take_ids(landmarks);
  if (execution_.progress) execution_.progress(1.0);
  return LandmarkMap(std::move(tables), [this](MapColumn, std::size_t) { return source_; });
}

void PointTable::refuse(std::uint64_t line, std::uint64_t token, std::string_view field,
                        std::string_view what, std::string_view expected) const {
  throw Error(ErrorKind::kInput, fmt::format("{}:{}: field {} ({})", source_, line, token, field),
              what, expected);
}

void PointTable::lost(const std::string& text) const {
  log_remark(execution_.log, source_, text, RemarkKind::kLoss);
}

void read_text_points(TextRows& rows, HeadedSource& source, std::uint64_t count,
                      std::string_view points, PointTable& table) {
  if (const auto size = source.size()) {
    // Each value has at least a digit and a separator.
    const std::uint64_t least = 2 * table.fields().size();
    table.reserve(static_cast<std::size_t>(std::min(count, *size / least)));
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string_view row = rows.next(i, count, points);
    table.append_text(row, rows.line_number());
  }
}

void read_binary_points(HeadedSource& source, std::uint64_t count, std::string_view points,
                        bool big_endian, PointTable& table) {
  const PointRecords records{table.fields(), count, points, big_endian};
  check_presence(source, records);
  const auto stride = static_cast<std::size_t>(fixed_size(records.fields));
  table.expect_binary();
  if (const auto remaining = source.remaining()) {
    table.reserve(static_cast<std::size_t>(std::min(count, *remaining / stride)));
  }
  const std::uint64_t begin = source.offset();
  std::uint64_t done = 0;
  if (!has_lists(records.fields)) {
    while (done < count) {
      const std::string_view bytes = source.peek(stride);
      const std::uint64_t rows = std::min<std::uint64_t>(bytes.size() / stride, count - done);
      if (rows == 0) refuse_cut(source, begin, source.offset() - begin + bytes.size(), records);
      table.append_binary(bytes.data(), static_cast<std::size_t>(rows), big_endian);
      source.consume(static_cast<std::size_t>(rows) * stride);
      done += rows;
    }
    return;
  }
  const std::uint64_t rows_at_once = kPointBlock / stride + 1;
  std::vector<char> fixed(rows_at_once * stride);
  while (done < count) {
    const std::uint64_t rows = std::min(rows_at_once, count - done);
    for (std::uint64_t i = 0; i < rows; ++i) {
      walk_record(source, records, done + i, fixed.data() + i * stride);
    }
    table.append_binary(fixed.data(), static_cast<std::size_t>(rows), big_endian);
    done += rows;
  }
}

void skip_binary_records(HeadedSource& source, const std::vector<PointField>& fields,
                         std::uint64_t count, std::string_view records_name, bool big_endian) {
  // Records without fields have no bytes.
  if (fields.empty()) return;
  const PointRecords records{fields, count, records_name, big_endian};
  check_presence(source, records);
  if (has_lists(fields)) {
    for (std::uint64_t i = 0; i < count; ++i) walk_record(source, records, i, nullptr);
    return;
  }
  const std::uint64_t stride = fixed_size(fields);
  const std::uint64_t begin = source.offset();
  const bool fits = count <= std::numeric_limits<std::uint64_t>::max() / stride;
  const std::uint64_t size = fits ? count * stride : std::numeric_limits<std::uint64_t>::max();
  if (const std::uint64_t skipped = source.skip(size); skipped < size) {
    refuse_cut(source, begin, skipped, records);
  }
}

bool is_rounded_by_floats(const Eigen::AlignedBox3d& box) {
  constexpr double kShare = 1e-5;
  if (box.isEmpty() || !(box.sizes().maxCoeff() > 0.0)) return false;
  const double farthest = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
  return double{std::numeric_limits<float>::epsilon()} * farthest > kShare * box.sizes().maxCoeff();
}

bool is_rounded_by_floats(std::span<const Eigen::Vector3d> points) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points) box.extend(point);
  return is_rounded_by_floats(box);
}

PointRows::PointRows(const LandmarkMap& map, PointFormat format, ScalarType position_type)
    : map_(map) {
  const LandmarkTable& landmarks = map.landmarks();
  const bool are_splats = format == PointFormat::kSplats;
  for (std::size_t i = 0; i < 3; ++i) add(kAxisNames[i], position_type, Content::kPosition, i);
  for (std::size_t i = 0; !are_splats && map.has_covariances() && i < kCovarianceEntries.size();
       ++i) {
    add(kCovarianceEntries[i].name, ScalarType::kFloat64, Content::kCovariance, i);
  }
  // Point formats cannot mark a colour as unknown, so colours are written only if all are known.
  const bool all_colored =
      !landmarks.colors.empty() && !(are_splats && map.column("f_dc_0") != nullptr) &&
      std::all_of(landmarks.colors.begin(), landmarks.colors.end(),
                  [](const std::optional<Color>& color) { return color.has_value(); });
  if (all_colored && format == PointFormat::kPcd) {
    add("rgb", ScalarType::kUint32, Content::kPackedColor);
  } else if (all_colored) {
    for (std::size_t i = 0; i < 3; ++i)
      add(kChannelNames[i], ScalarType::kUint8, Content::kChannel, i);
    if (format == PointFormat::kFoxglove) {
      add("alpha", ScalarType::kUint8, Content::kChannel, kAlpha);
    }
  }
  const bool has_counts = !are_splats && !map.observations().offsets.empty();
  if (has_counts) add("observations", ScalarType::kUint32, Content::kCount);
  const bool ids_fit_32_bits = std::all_of(
      landmarks.ids.begin(), landmarks.ids.end(),
      [](LandmarkId id) { return id.value <= std::numeric_limits<std::uint32_t>::max(); });
  if (!are_splats && map.column("id") == nullptr &&
      (ids_fit_32_bits || format == PointFormat::kPcd)) {
    add("id", ids_fit_32_bits ? ScalarType::kUint32 : ScalarType::kUint64, Content::kId);
  }
  const std::vector<bool> single =
      are_splats ? single_precision_columns(*splat_columns(landmarks.columns), landmarks.columns)
                 : std::vector<bool>();
  for (std::size_t i = 0; i < landmarks.columns.size(); ++i) {
    const std::string& name = landmarks.columns[i].name;
    if (has_counts && name == "observations") continue;
    const bool taken = std::any_of(fields_.begin(), fields_.end(),
                                   [&](const PointField& field) { return field.name == name; });
    refuse_if(taken || (format == PointFormat::kPcd && name == "_"), "column " + printable(name),
              "the format has another meaning for this name", "another name");
    add(name, are_splats && single[i] ? ScalarType::kFloat32 : ScalarType::kFloat64,
        Content::kColumn, i);
  }
}

void PointRows::add(std::string name, ScalarType type, Content content, std::size_t index) {
  fields_.push_back({.name = std::move(name), .type = type, .count = 1, .list_count = {}});
  cells_.push_back({content, index});
}

template <class Put>
void PointRows::visit(std::size_t field, std::size_t row, Put&& put) const {
  const LandmarkTable& landmarks = map_.landmarks();
  const std::size_t index = cells_[field].index;
  switch (cells_[field].content) {
    case Content::kPosition: {
      const double coordinate = landmarks.positions[row][static_cast<Eigen::Index>(index)];
      if (fields_[field].type == ScalarType::kFloat32) {
        put(static_cast<float>(coordinate));
      } else {
        put(coordinate);
      }
      break;
    }
    case Content::kCovariance: {
      const Eigen::Matrix3d& covariance = landmarks.covariances[row];
      const CovarianceEntry& entry = kCovarianceEntries[index];
      constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
      put(std::isnan(covariance(0, 0)) ? kUnknown : covariance(entry.row, entry.column));
      break;
    }
    case Content::kChannel: {
      const Color color = *landmarks.colors[row];
      constexpr std::uint8_t kOpaque = 255;
      put(index == kAlpha ? kOpaque
          : index == 0    ? color.red
          : index == 1    ? color.green
                          : color.blue);
      break;
    }
    case Content::kPackedColor: {
      const Color color = *landmarks.colors[row];
      put(std::uint32_t{color.red} << 16 | std::uint32_t{color.green} << 8 |
          std::uint32_t{color.blue});
      break;
    }
    case Content::kCount: {
      const auto& offsets = map_.observations().offsets;
      put(static_cast<std::uint32_t>(std::min<std::uint64_t>(
          offsets[row + 1] - offsets[row], std::numeric_limits<std::uint32_t>::max())));
      break;
    }
    case Content::kId: {
      const std::uint64_t id = landmarks.ids[row].value;
      if (fields_[field].type == ScalarType::kUint32) {
        put(static_cast<std::uint32_t>(id));
      } else {
        put(id);
      }
      break;
    }
    case Content::kColumn:
      if (fields_[field].type == ScalarType::kFloat32) {
        put(static_cast<float>(landmarks.columns[index].values[row]));
      } else {
        put(landmarks.columns[index].values[row]);
      }
      break;
  }
}

void PointRows::write(std::string header, bool ascii, const ByteSink& sink) const {
  std::string buffer = std::move(header);
  for (std::size_t row = 0; row < map_.landmark_count(); ++row) {
    for (std::size_t field = 0; field < fields_.size(); ++field) {
      if (ascii) {
        if (field > 0) buffer += ' ';
        visit(field, row, [&]<class T>(T value) {
          using Text = std::conditional_t<std::is_integral_v<T>, std::uint64_t, T>;
          append_text_value(buffer, Text{value});
        });
      } else {
        visit(field, row, [&](auto value) { append_scalar(buffer, value); });
      }
    }
    if (ascii) buffer += '\n';
    if (buffer.size() >= kRowBlock) {
      sink(buffer);
      buffer.clear();
    }
  }
  sink(buffer);
}

}  // namespace cairn::detail

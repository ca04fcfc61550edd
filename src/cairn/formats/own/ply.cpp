// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/own/ply.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"

namespace cairn {
namespace {

using detail::HeadedSource;
using detail::PointField;
using detail::PointTable;
using detail::ScalarType;

// The writer uses the first name of a type, which every reader knows.
constexpr std::array<std::pair<std::string_view, ScalarType>, 16> kTypeNames = {{
    {"char", ScalarType::kInt8},
    {"int8", ScalarType::kInt8},
    {"uchar", ScalarType::kUint8},
    {"uint8", ScalarType::kUint8},
    {"short", ScalarType::kInt16},
    {"int16", ScalarType::kInt16},
    {"ushort", ScalarType::kUint16},
    {"uint16", ScalarType::kUint16},
    {"int", ScalarType::kInt32},
    {"int32", ScalarType::kInt32},
    {"uint", ScalarType::kUint32},
    {"uint32", ScalarType::kUint32},
    {"float", ScalarType::kFloat32},
    {"float32", ScalarType::kFloat32},
    {"double", ScalarType::kFloat64},
    {"float64", ScalarType::kFloat64},
}};

std::string_view name_of(ScalarType type) {
  return std::find_if(kTypeNames.begin(), kTypeNames.end(),
                      [&](const auto& entry) { return entry.second == type; })
      ->first;
}

enum class Encoding { kAscii, kLittleEndian, kBigEndian };

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::string place;  // "file:line" where it is declared
  std::vector<PointField> properties;
};

class HeaderReader {
 public:
  explicit HeaderReader(HeadedSource& source) : source_(source) {}

  void read() {
    if (next_line("the line 'ply'") != "ply") refuse("the file does not start with 'ply'", "it");
    for (;;) {
      rest_ = next_line("end_header");
      const std::string_view keyword = word();
      if (keyword == "comment" && !unit_) unit_ = detail::unit_in_comment(rest_);
      if (keyword.empty() || keyword == "comment" || keyword == "obj_info") continue;
      if (keyword == "format") {
        read_format();
      } else if (keyword == "element") {
        read_element();
      } else if (keyword == "property") {
        read_property();
      } else if (keyword == "end_header") {
        expect_line_end();
        break;
      } else {
        refuse(fmt::format("unknown keyword {}", printable(keyword)),
               "format, comment, obj_info, element, property or end_header");
      }
    }
    if (!encoding_) refuse("the header ends without the format", "a line 'format ...'");
    if (vertex() == nullptr) refuse("no element 'vertex' in the header", "one");
  }

  Encoding encoding() const { return *encoding_; }
  std::optional<LengthUnit> length_unit() const { return unit_; }
  const std::vector<Element>& elements() const { return elements_; }
  const Element* vertex() const {
    const auto found = std::find_if(elements_.begin(), elements_.end(), [](const Element& element) {
      return element.name == "vertex";
    });
    return found == elements_.end() ? nullptr : &*found;
  }

 private:
  std::string_view next_line(std::string_view expected) { return source_.header_line(expected); }

  // The next word of the line; empty at its end.
  std::string_view word() {
    const std::size_t size = std::min(rest_.find_first_of(kBlanks), rest_.size());
    const std::string_view result = rest_.substr(0, size);
    rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlanks, size), rest_.size()));
    return result;
  }

  [[noreturn]] void refuse(std::string_view what, std::string_view expected) const {
    throw Error(ErrorKind::kInput, source_.header_place(), what, expected);
  }

  void expect_line_end() const {
    if (!rest_.empty()) {
      refuse(fmt::format("{} is too much", printable(rest_)), "the line to end before it");
    }
  }

  void read_format() {
    if (encoding_) refuse("the format is stated above already", "it once");
    const std::string_view encoding = word();
    if (encoding == "ascii") {
      encoding_ = Encoding::kAscii;
    } else if (encoding == "binary_little_endian") {
      encoding_ = Encoding::kLittleEndian;
    } else if (encoding == "binary_big_endian") {
      encoding_ = Encoding::kBigEndian;
    } else {
      refuse(fmt::format("unknown format {}", printable(encoding)),
             "ascii, binary_little_endian or binary_big_endian");
    }
    const std::string_view version = word();
    if (version != "1.0") refuse(fmt::format("PLY version {}", printable(version)), "1.0");
    expect_line_end();
  }

  void read_element() {
    Element element;
    element.name = std::string(word());
    if (element.name.empty()) refuse("an element without a name", "element NAME COUNT");
    for (const Element& above : elements_) {
      if (above.name == element.name) {
        refuse(fmt::format("element {} stands above already", printable(element.name)),
               "distinct names");
      }
    }
    if (++entries_ > detail::kFieldLimit) refuse_length();
    const std::string_view count = word();
    const auto value = parse_unsigned(count);
    if (!value) {
      refuse(fmt::format("count {} is no unsigned integer", printable(count)),
             "element NAME COUNT");
    }
    if (element.name == "vertex" && *value >= detail::kPointLimit) {
      refuse(fmt::format("{} vertices", *value), "fewer than 2^32");
    }
    element.count = *value;
    element.place = source_.header_place();
    expect_line_end();
    elements_.push_back(std::move(element));
  }

  void read_property() {
    if (elements_.empty()) refuse("a property above all elements", "an element line first");
    if (++entries_ > detail::kFieldLimit) refuse_length();
    PointField field;
    std::string_view type = word();
    if (type == "list") {
      const std::string_view count_type = word();
      field.list_count = scalar_type(count_type);
      if (!detail::is_integer(*field.list_count)) {
        refuse(fmt::format("lists whose length is of type {}", printable(count_type)),
               "an integer type");
      }
      type = word();
    }
    field.type = scalar_type(type);
    field.name = std::string(word());
    if (field.name.empty()) {
      refuse("a property without a name", "property TYPE NAME or property list TYPE TYPE NAME");
    }
    expect_line_end();
    std::vector<PointField>& properties = elements_.back().properties;
    for (const PointField& above : properties) {
      if (above.name == field.name) {
        refuse(fmt::format("property {} stands above already", printable(field.name)),
               "distinct names");
      }
    }
    properties.push_back(std::move(field));
  }

  ScalarType scalar_type(std::string_view name) const {
    const auto found = std::find_if(kTypeNames.begin(), kTypeNames.end(),
                                    [&](const auto& entry) { return entry.first == name; });
    if (found == kTypeNames.end()) {
      refuse(fmt::format("unknown type {}", printable(name)),
             "char, uchar, short, ushort, int, uint, float, double or one with its bits, as int8");
    }
    return found->second;
  }

  [[noreturn]] void refuse_length() const {
    refuse("too many elements and properties", fmt::format("at most {}", detail::kFieldLimit));
  }

  HeadedSource& source_;
  std::string_view rest_;
  std::optional<Encoding> encoding_;
  std::optional<LengthUnit> unit_;
  std::vector<Element> elements_;
  std::size_t entries_ = 0;
};

std::string plural_of(const Element& element) {
  return "records of element " + printable(element.name);
}

}  // namespace

LandmarkMap read_ply(ByteSource& source, const MapReadOptions& options) {
  HeadedSource headed(source, options);
  HeaderReader header(headed);
  header.read();
  const Element* const vertex = header.vertex();
  constexpr std::string_view kVertices = "vertices";
  PointTable table(detail::PointFormat::kPly, source.name(), vertex->place, vertex->properties,
                   options);
  for (const Element& element : header.elements()) {
    if (&element != vertex && options.log) {
      options.log({fmt::format("{}: {} {} left out: only vertices are landmarks", source.name(),
                               element.count, plural_of(element)),
                   RemarkKind::kLoss});
    }
  }
  if (header.encoding() == Encoding::kAscii) {
    detail::TextRows rows(headed, options.log);
    for (const Element& element : header.elements()) {
      if (&element == vertex) {
        detail::read_text_points(rows, headed, element.count, kVertices, table);
      } else if (!element.properties.empty()) {
        const std::string records = plural_of(element);
        for (std::uint64_t i = 0; i < element.count; ++i) rows.next(i, element.count, records);
      }
    }
    rows.expect_end();
  } else {
    const bool big_endian = header.encoding() == Encoding::kBigEndian;
    for (const Element& element : header.elements()) {
      if (&element == vertex) {
        detail::read_binary_points(headed, element.count, kVertices, big_endian, table);
      } else {
        detail::skip_binary_records(headed, element.properties, element.count, plural_of(element),
                                    big_endian);
      }
    }
    headed.expect_end();
  }
  return std::move(table).finish(header.length_unit());
}

void write_ply(const LandmarkMap& map, const ByteSink& sink, const PlyWriteOptions& options) {
  const detail::PointRows rows(map, detail::PointFormat::kPly, detail::ScalarType::kFloat64);
  std::string header =
      fmt::format("ply\nformat {} 1.0\n", options.ascii ? "ascii" : "binary_little_endian");
  header += fmt::format("comment {}\n", detail::unit_comment(map.info().length_unit));
  header += fmt::format("element vertex {}\n", map.landmark_count());
  for (const PointField& field : rows.fields()) {
    header += fmt::format("property {} {}\n", name_of(field.type), field.name);
  }
  header += "end_header\n";
  rows.write(std::move(header), options.ascii, sink);
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/own/ply_header.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn::detail {
namespace {

class PlyHeaderReader {
 public:
  explicit PlyHeaderReader(HeadedSource& source) : source_(source) {}

  PlyHeader read() {
    if (next_line("the line 'ply'") != "ply") refuse("the file does not start with 'ply'", "it");
    for (;;) {
      rest_ = next_line("end_header");
      const std::string_view keyword = word();
      if (keyword == "comment" && !header_.length_unit) {
        header_.length_unit = unit_in_comment(rest_);
      }
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
    if (!has_format_) refuse("the header ends without the format", "a line 'format ...'");
    if (header_.vertex() == nullptr) refuse("no element 'vertex' in the header", "one");
    for (const PointField& property : header_.vertex()->properties) {
      if (property.name == "packed_position") {
        refuse("these are Gaussian splats in compressed PLY", kExpectedSplats);
      }
    }
    return std::move(header_);
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
    if (has_format_) refuse("the format is stated above already", "it once");
    const std::string_view encoding = word();
    if (encoding == "ascii") {
      header_.encoding = PlyEncoding::kAscii;
    } else if (encoding == "binary_little_endian") {
      header_.encoding = PlyEncoding::kLittleEndian;
    } else if (encoding == "binary_big_endian") {
      header_.encoding = PlyEncoding::kBigEndian;
    } else {
      refuse(fmt::format("unknown format {}", printable(encoding)),
             "ascii, binary_little_endian or binary_big_endian");
    }
    const std::string_view version = word();
    has_format_ = true;
    if (version != "1.0") refuse(fmt::format("PLY version {}", printable(version)), "1.0");
    expect_line_end();
  }

  void read_element() {
    PlyElement element;
    element.name = std::string(word());
    if (element.name.empty()) refuse("an element without a name", "element NAME COUNT");
    for (const PlyElement& above : header_.elements) {
      if (above.name == element.name) {
        refuse(fmt::format("element {} stands above already", printable(element.name)),
               "distinct names");
      }
    }
    if (++entries_ > kFieldLimit) refuse_length();
    const std::string_view count = word();
    const auto value = parse_unsigned(count);
    if (!value) {
      refuse(fmt::format("count {} is no unsigned integer", printable(count)),
             "element NAME COUNT");
    }
    if (element.name == "vertex" && *value >= kPointLimit) {
      refuse(fmt::format("{} vertices", *value), "fewer than 2^32");
    }
    element.count = *value;
    element.place = source_.header_place();
    expect_line_end();
    header_.elements.push_back(std::move(element));
  }

  void read_property() {
    if (header_.elements.empty()) refuse("a property above all elements", "an element line first");
    if (++entries_ > kFieldLimit) refuse_length();
    PointField field;
    std::string_view type = word();
    if (type == "list") {
      const std::string_view count_type = word();
      field.list_count = scalar_type(count_type);
      if (!is_integer(*field.list_count)) {
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
    std::vector<PointField>& properties = header_.elements.back().properties;
    for (const PointField& above : properties) {
      if (above.name == field.name) {
        refuse(fmt::format("property {} stands above already", printable(field.name)),
               "distinct names");
      }
    }
    properties.push_back(std::move(field));
  }

  ScalarType scalar_type(std::string_view name) const {
    const auto found = std::find_if(kScalars.begin(), kScalars.end(), [&](const Scalar& scalar) {
      return !scalar.c_name.empty() && (scalar.c_name == name || scalar.name == name);
    });
    if (found == kScalars.end()) {
      refuse(fmt::format("unknown type {}", printable(name)),
             "char, uchar, short, ushort, int, uint, float, double or one with its bits, as int8");
    }
    return found->type;
  }

  [[noreturn]] void refuse_length() const {
    refuse("too many elements and properties", fmt::format("at most {}", kFieldLimit));
  }

  HeadedSource& source_;
  std::string_view rest_;
  PlyHeader header_;
  bool has_format_ = false;
  std::size_t entries_ = 0;
};

}  // namespace

const PlyElement* PlyHeader::vertex() const {
  const auto found = std::find_if(elements.begin(), elements.end(), [](const PlyElement& element) {
    return element.name == "vertex";
  });
  return found == elements.end() ? nullptr : &*found;
}

PlyHeader read_ply_header(HeadedSource& source) {
  return PlyHeaderReader(source).read();
}

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/carry_along.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/map/turning_columns.hpp"

namespace cairn {
namespace {

constexpr std::size_t kMostRecords = std::size_t{1} << 20;  // properties

enum class Form { kAscii, kLittle, kBig };

// Bytes and kind of a type's name; 0 bytes for an unknown name.
struct Scalar {
  std::size_t bytes = 0;
  bool is_float = false;
  bool is_signed = false;
};

Scalar scalar_of(std::string_view name) {
  if (name == "char" || name == "int8") return {1, false, true};
  if (name == "uchar" || name == "uint8") return {1};
  if (name == "short" || name == "int16") return {2, false, true};
  if (name == "ushort" || name == "uint16") return {2};
  if (name == "int" || name == "int32") return {4, false, true};
  if (name == "uint" || name == "uint32") return {4};
  if (name == "float" || name == "float32") return {4, true};
  if (name == "double" || name == "float64") return {8, true};
  return {};
}

struct Property {
  std::string name;
  Scalar type;
  std::optional<Scalar> count;  // of a list
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    const std::size_t end = std::min(line.find_first_of(kBlanks), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
  return words;
}

// Indices of the vertex properties to be transformed.
struct Movable {
  std::array<std::size_t, 3> position{};
  std::vector<std::array<std::size_t, 3>> normals;
  std::optional<std::array<std::size_t, 6>> covariance;
};

class Mover {
 public:
  Mover(const ByteSource& source, std::string text, const Similarity3& new_from_old,
        const ByteSink& sink)
      : name_(source.name()),
        text_(std::move(text)),
        new_from_old_(new_from_old),
        rotation_(new_from_old.rigid().rotation()),
        sink_(sink) {}

  void run() {
    read_header();
    sink_(std::string_view(text_).substr(0, place_));
    for (const Element& element : elements_) {
      if (element.name == "vertex") {
        move_vertices(element);
        sink_(std::string_view(text_).substr(place_));  // copies the rest unchanged
        return;
      }
      pass_over(element);
    }
    refuse("header", "has no element vertex", "vertices");
  }

 private:
  [[noreturn]] void refuse(const std::string& where, std::string_view what,
                           std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", name_, where), what, expected);
  }

  std::string_view next_line() {
    const std::size_t end = text_.find('\n', place_);
    if (end == std::string::npos) {
      refuse(fmt::format("line {}", line_ + 1), "the file ends here", "more lines");
    }
    const std::string_view line = std::string_view(text_).substr(place_, end - place_);
    place_ = end + 1;
    ++line_;
    return line;
  }

  void read_header() {
    if (trimmed(next_line()) != "ply") refuse("line 1", "is not ply", "a PLY file");
    std::size_t properties = 0;
    for (;;) {
      const auto words = words_of(next_line());
      const auto bad = [&] {
        refuse(fmt::format("line {}", line_), "is no line of a PLY header", "element, property");
      };
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") return;
      if (words[0] == "format" && words.size() > 1) {
        if (words[1] != "ascii" && words[1] != "binary_little_endian" &&
            words[1] != "binary_big_endian")
          bad();
        form_ = words[1] == "ascii"                  ? Form::kAscii
                : words[1] == "binary_little_endian" ? Form::kLittle
                                                     : Form::kBig;
      } else if (words[0] == "element" && words.size() == 3) {
        const auto count = parse_unsigned(words[2]);
        if (!count) bad();
        elements_.push_back({std::string(words[1]), *count, {}});
      } else if (words[0] == "property" && !elements_.empty() && ++properties < kMostRecords) {
        Property property;
        const bool is_list = words.size() == 5 && words[1] == "list";
        if (is_list) property.count = scalar_of(words[2]);
        if (!is_list && words.size() != 3) bad();
        property.type = scalar_of(words[is_list ? 3 : 1]);
        property.name = words.back();
        if (property.type.bytes == 0 || (property.count && property.count->bytes == 0)) bad();
        elements_.back().properties.push_back(std::move(property));
      } else {
        bad();
      }
    }
  }

  Movable movable_of(const Element& vertex) const {
    const auto find = [&](std::string_view name) -> std::optional<std::size_t> {
      for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
        if (vertex.properties[i].name == name && !vertex.properties[i].count) return i;
      }
      return std::nullopt;
    };
    const auto floats = [&]<std::size_t N>(const std::array<std::string_view, N>& names)
        -> std::optional<std::array<std::size_t, N>> {
      std::array<std::size_t, N> places{};
      for (std::size_t i = 0; i < N; ++i) {
        const auto place = find(names.at(i));
        if (!place || !vertex.properties[*place].type.is_float) return std::nullopt;
        places.at(i) = *place;
      }
      return places;
    };
    std::vector<std::string_view> names;
    for (const Property& property : vertex.properties) names.push_back(property.name);
    TurningColumns turning = turning_columns(names);
    if (turning.are_splats && !(new_from_old_.linear() == Eigen::Matrix3d::Identity())) {
      refuse("header", "has Gaussian splats, whose spherical harmonics would not follow",
             "points or a mesh");
    }
    for (const std::size_t i : std::as_const(turning.vectors) | std::views::join) {
      const Property& part = vertex.properties[i];
      if (part.count || !part.type.is_float) {
        refuse("header", "has normals that are no numbers of type float or double",
               "normals that can be turned");
      }
    }
    const auto position = floats(std::array<std::string_view, 3>{"x", "y", "z"});
    if (!position)
      refuse("header", "has no x, y and z of type float or double", "positions of vertices");
    return {*position, std::move(turning.vectors),
            floats(std::array<std::string_view, 6>{"cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz",
                                                   "cov_zz"})};
  }

  // New values of one vertex.
  void move(const Movable& movable, std::vector<double>& values) const {
    const auto vector = [&](const std::array<std::size_t, 3>& places) {
      return Eigen::Vector3d(values[places[0]], values[places[1]], values[places[2]]);
    };
    const auto put = [&](const std::array<std::size_t, 3>& places, const Eigen::Vector3d& x) {
      for (std::size_t i = 0; i < 3; ++i) values[places.at(i)] = x[static_cast<Eigen::Index>(i)];
    };
    put(movable.position, new_from_old_ * vector(movable.position));
    for (const auto& normal : movable.normals) put(normal, rotation_ * vector(normal));
    if (!movable.covariance) return;
    const auto& c = *movable.covariance;
    Eigen::Matrix3d covariance;
    covariance << values[c[0]], values[c[1]], values[c[2]], values[c[1]], values[c[3]],
        values[c[4]], values[c[2]], values[c[4]], values[c[5]];
    const double scale = new_from_old_.scale();
    covariance = scale * scale * rotation_ * covariance * rotation_.transpose();
    const std::array<double, 6> upper = {covariance(0, 0), covariance(0, 1), covariance(0, 2),
                                         covariance(1, 1), covariance(1, 2), covariance(2, 2)};
    for (std::size_t i = 0; i < 6; ++i) values[c.at(i)] = upper.at(i);
  }

  static std::vector<bool> moved_places(const Element& vertex, const Movable& movable) {
    std::vector<bool> moved(vertex.properties.size(), false);
    for (const std::size_t i : movable.position) moved[i] = true;
    for (const std::size_t i : movable.normals | std::views::join) moved[i] = true;
    if (movable.covariance) {
      for (const std::size_t i : *movable.covariance) moved[i] = true;
    }
    return moved;
  }

  void move_vertices(const Element& vertex) {
    const Movable movable = movable_of(vertex);
    const std::vector<bool> moved = moved_places(vertex, movable);
    std::vector<double> values(vertex.properties.size(), 0.0);
    std::string out;
    for (std::uint64_t row = 0; row < vertex.count; ++row) {
      if (form_ == Form::kAscii) {
        move_line(vertex, movable, moved, values, out);
      } else {
        move_record(vertex, movable, moved, values, out);
      }
      constexpr std::size_t kLarge = std::size_t{1} << 20;
      if (out.size() < kLarge) continue;
      sink_(out);
      out.clear();
    }
    sink_(out);
  }

  void move_line(const Element& vertex, const Movable& movable, const std::vector<bool>& moved,
                 std::vector<double>& values, std::string& out) {
    const auto words = words_of(next_line());
    // Where each property's words begin.
    std::vector<std::size_t> first(vertex.properties.size());
    std::size_t word = 0;
    const auto number = [&](std::size_t i) {
      double value = 0.0;
      if (i >= words.size()) {
        refuse(fmt::format("line {}", line_), fmt::format("has {} fields", words.size()),
               "more of them");
      }
      const auto [end, error] =
          std::from_chars(words[i].data(), words[i].data() + words[i].size(), value);
      if (error != std::errc() || end != words[i].data() + words[i].size()) {
        refuse(fmt::format("line {}", line_), printable(words[i]) + " is not a number", "a number");
      }
      return value;
    };
    for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
      first[i] = word;
      if (moved[i]) values[i] = number(word);
      if (vertex.properties[i].count) {
        const double count = number(word);
        if (!(count >= 0.0) || count > static_cast<double>(words.size())) {
          refuse(fmt::format("line {}", line_), "has a list of impossible length", "its words");
        }
        word += static_cast<std::size_t>(count);
      }
      ++word;
    }
    if (word > words.size()) number(word - 1);
    move(movable, values);
    std::size_t property = 0;
    for (std::size_t i = 0; i < words.size(); ++i) {
      while (property + 1 < first.size() && first[property + 1] <= i) ++property;
      if (i > 0) out += ' ';
      if (moved[property] && first[property] == i) {
        put_number(vertex.properties[property].type, values[property], out);
      } else {
        out += words[i];
      }
    }
    out += '\n';
  }

  static void put_number(const Scalar& type, double value, std::string& out) {
    if (!std::isfinite(value)) {
      out += "nan";
    } else if (type.bytes == 4) {
      out += fmt::format("{}", static_cast<float>(value));
    } else {
      append_number(out, value);
    }
  }

  void require_bytes(std::uint64_t count) const {
    if (count > text_.size() - place_) {
      refuse(fmt::format("byte {}", place_), "the file ends within an element",
             fmt::format("{} bytes more", count));
    }
  }

  // As an unsigned number in native byte order.
  std::uint64_t bits(std::size_t place, std::size_t bytes) const {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i) {
      const std::size_t at = place + (form_ == Form::kBig ? i : bytes - 1 - i);
      value = value << 8 | static_cast<unsigned char>(text_[at]);
    }
    return value;
  }

  std::uint64_t property_bytes(const Property& property, std::size_t place) const {
    if (!property.count) return property.type.bytes;
    const std::size_t head = property.count->bytes;
    if (head > text_.size() - place) return head;
    std::uint64_t count = bits(place, head);
    if (property.count->is_float) {
      const double value = head == 4
                               ? double{std::bit_cast<float>(static_cast<std::uint32_t>(count))}
                               : std::bit_cast<double>(count);
      count = value >= 0.0 && value < 4294967296.0 ? static_cast<std::uint64_t>(value)
                                                   : ~std::uint64_t{0} >> 4;
    }
    // A negative length becomes far too large here, and is refused.
    return head + std::min<std::uint64_t>(count, std::uint64_t{1} << 50) * property.type.bytes;
  }

  void move_record(const Element& vertex, const Movable& movable, const std::vector<bool>& moved,
                   std::vector<double>& values, std::string& out) {
    const std::size_t start = place_;
    std::vector<std::size_t> places(vertex.properties.size());
    for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
      const Property& property = vertex.properties[i];
      const std::uint64_t size = property_bytes(property, place_);
      require_bytes(size);
      places[i] = place_;
      if (moved[i]) {
        const std::uint64_t raw = bits(place_, property.type.bytes);
        values[i] = property.type.bytes == 4
                        ? double{std::bit_cast<float>(static_cast<std::uint32_t>(raw))}
                        : std::bit_cast<double>(raw);
      }
      place_ += static_cast<std::size_t>(size);
    }
    move(movable, values);
    const std::size_t in_out = out.size();
    out.append(text_, start, place_ - start);
    for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
      if (!moved[i]) continue;
      const std::size_t bytes = vertex.properties[i].type.bytes;
      const std::uint64_t raw = bytes == 4
                                    ? std::bit_cast<std::uint32_t>(static_cast<float>(values[i]))
                                    : std::bit_cast<std::uint64_t>(values[i]);
      for (std::size_t j = 0; j < bytes; ++j) {
        const std::size_t at = form_ == Form::kBig ? bytes - 1 - j : j;
        out[in_out + places[i] - start + at] = static_cast<char>(raw >> (8 * j) & 0xffU);
      }
    }
  }

  void pass_over(const Element& element) {
    const std::size_t start = place_;
    for (std::uint64_t row = 0; row < element.count; ++row) {
      if (form_ == Form::kAscii) {
        next_line();
        continue;
      }
      if (element.properties.empty()) break;
      for (const Property& property : element.properties) {
        const std::uint64_t size = property_bytes(property, place_);
        require_bytes(size);
        place_ += static_cast<std::size_t>(size);
      }
    }
    sink_(std::string_view(text_).substr(start, place_ - start));
  }

  std::string name_;
  std::string text_;
  const Similarity3& new_from_old_;
  Eigen::Matrix3d rotation_;
  const ByteSink& sink_;
  Form form_ = Form::kAscii;
  std::vector<Element> elements_;
  std::size_t place_ = 0;
  std::uint64_t line_ = 0;
};

}  // namespace

void move_ply(ByteSource& source, const Similarity3& new_from_old, const ByteSink& sink) {
  Mover(source, read_all(source), new_from_old, sink).run();
}

}  // namespace cairn

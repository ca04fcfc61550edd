// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/own/ply_header.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/column_motion.hpp"

namespace cairn {
namespace {

using detail::PlyElement;
using detail::PointField;
using detail::ScalarType;

// Indices of the vertex properties to be transformed.
struct Movable {
  std::array<std::size_t, 3> position{};
  ColumnMotion others;  // normals and splats
  std::optional<std::array<std::size_t, 6>> covariance;
};

class PlyMover {
 public:
  PlyMover(const ByteSource& source, std::string text, const Similarity3& new_from_old,
           const ByteSink& sink)
      : name_(source.name()),
        text_(std::move(text)),
        new_from_old_(new_from_old),
        rotation_(new_from_old.rigid().rotation()),
        sink_(sink) {}

  void run() {
    read_header();
    sink_(std::string_view(text_).substr(0, place_));
    for (const PlyElement& element : header_.elements) {
      if (element.name == "vertex") {
        move_vertices(element);
        sink_(std::string_view(text_).substr(place_));  // copies the rest unchanged
        return;
      }
      pass_over(element);
    }
  }

 private:
  [[noreturn]] void refuse(const std::string& where, std::string_view what,
                           std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", name_, where), what, expected);
  }

  void read_header() {
    MemoryReader source(text_, name_);
    const Execution execution;
    detail::HeadedSource headed(source, execution);
    header_ = detail::read_ply_header(headed);
    is_big_endian_ = header_.encoding == detail::PlyEncoding::kBigEndian;
    place_ = headed.offset();
    line_ = headed.header_lines();
  }

  bool is_ascii() const { return header_.encoding == detail::PlyEncoding::kAscii; }

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

  Movable movable_of(const PlyElement& vertex) const {
    const auto find = [&](std::string_view name) -> std::optional<std::size_t> {
      for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
        if (vertex.properties[i].name == name && !vertex.properties[i].list_count) return i;
      }
      return std::nullopt;
    };
    const auto floats = [&]<std::size_t N>(const std::array<std::string_view, N>& names)
        -> std::optional<std::array<std::size_t, N>> {
      std::array<std::size_t, N> places{};
      for (std::size_t i = 0; i < N; ++i) {
        const auto place = find(names.at(i));
        if (!place || is_integer(vertex.properties[*place].type)) return std::nullopt;
        places.at(i) = *place;
      }
      return places;
    };
    std::vector<std::string_view> names;
    for (const PointField& property : vertex.properties) names.push_back(property.name);
    ColumnMotion others(names, new_from_old_, fmt::format("{}: header", name_));
    for (const std::size_t i : others.changed()) {
      const PointField& part = vertex.properties[i];
      if (part.list_count || is_integer(part.type)) {
        refuse(
            "header",
            fmt::format("property {} is no number of type float or double", printable(part.name)),
            "normals and splats that can be turned");
      }
    }
    const auto position = floats(std::array<std::string_view, 3>{"x", "y", "z"});
    if (!position)
      refuse("header", "has no x, y and z of type float or double", "positions of vertices");
    return {*position, std::move(others),
            floats(std::array<std::string_view, 6>{"cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz",
                                                   "cov_zz"})};
  }

  // New values of one vertex.
  void move(const Movable& movable, std::vector<double>& values) {
    const auto vector = [&](const std::array<std::size_t, 3>& places) {
      return Eigen::Vector3d(values[places[0]], values[places[1]], values[places[2]]);
    };
    const auto put = [&](const std::array<std::size_t, 3>& places, const Eigen::Vector3d& x) {
      for (std::size_t i = 0; i < 3; ++i) values[places.at(i)] = x[static_cast<Eigen::Index>(i)];
    };
    const Eigen::Vector3d before = vector(movable.position);
    const Eigen::Vector3d after = new_from_old_ * before;
    put(movable.position, after);
    if (before.allFinite()) {
      before_.extend(before);
      after_.extend(after);
    }
    movable.others.move(values);
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

  static std::vector<bool> moved_places(const PlyElement& vertex, const Movable& movable) {
    std::vector<bool> moved(vertex.properties.size(), false);
    for (const std::size_t i : movable.position) moved[i] = true;
    for (const std::size_t i : movable.others.changed()) moved[i] = true;
    if (movable.covariance) {
      for (const std::size_t i : *movable.covariance) moved[i] = true;
    }
    return moved;
  }

  void move_vertices(const PlyElement& vertex) {
    const Movable movable = movable_of(vertex);
    const std::vector<bool> moved = moved_places(vertex, movable);
    std::vector<double> values(vertex.properties.size(), 0.0);
    std::string out;
    for (std::uint64_t row = 0; row < vertex.count; ++row) {
      if (is_ascii()) {
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
    // Rounds more than the input did.
    const bool are_floats = std::ranges::all_of(movable.position, [&](std::size_t i) {
      return vertex.properties[i].type == ScalarType::kFloat32;
    });
    if (are_floats && detail::is_rounded_by_floats(after_) &&
        !detail::is_rounded_by_floats(before_)) {
      refuse("header",
             "x, y and z are float, which rounds positions as far from the origin as the "
             "new ones",
             "properties of type double, or a pose nearer to the origin");
    }
  }

  void move_line(const PlyElement& vertex, const Movable& movable, const std::vector<bool>& moved,
                 std::vector<double>& values, std::string& out) {
    const auto words = detail::words_of(next_line());
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
      if (vertex.properties[i].list_count) {
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

  static void put_number(ScalarType type, double value, std::string& out) {
    if (!std::isfinite(value)) {
      out += "nan";
    } else if (type == ScalarType::kFloat32) {
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

  std::uint64_t property_bytes(const PointField& property, std::size_t place) const {
    if (!property.list_count) return size_of(property.type);
    const std::size_t head = size_of(*property.list_count);
    if (head > text_.size() - place) return head;
    const double count =
        detail::load_number(*property.list_count, text_.data() + place, is_big_endian_);
    // A negative length becomes far too large here, and is refused.
    constexpr double kMost = 1e15;
    const double entries = count >= 0.0 ? std::min(count, kMost) : kMost;
    return head + static_cast<std::uint64_t>(entries) * size_of(property.type);
  }

  void move_record(const PlyElement& vertex, const Movable& movable, const std::vector<bool>& moved,
                   std::vector<double>& values, std::string& out) {
    const std::size_t start = place_;
    std::vector<std::size_t> places(vertex.properties.size());
    for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
      const PointField& property = vertex.properties[i];
      const std::uint64_t size = property_bytes(property, place_);
      require_bytes(size);
      places[i] = place_;
      if (moved[i]) {
        values[i] = detail::load_number(property.type, text_.data() + place_, is_big_endian_);
      }
      place_ += static_cast<std::size_t>(size);
    }
    move(movable, values);
    const std::size_t in_out = out.size();
    out.append(text_, start, place_ - start);
    for (std::size_t i = 0; i < vertex.properties.size(); ++i) {
      if (!moved[i]) continue;
      char* const stored = out.data() + in_out + places[i] - start;
      if (vertex.properties[i].type == ScalarType::kFloat32) {
        detail::store_scalar(stored, static_cast<float>(values[i]), is_big_endian_);
      } else {
        detail::store_scalar(stored, values[i], is_big_endian_);
      }
    }
  }

  void pass_over(const PlyElement& element) {
    const std::size_t start = place_;
    for (std::uint64_t row = 0; row < element.count; ++row) {
      if (is_ascii()) {
        next_line();
        continue;
      }
      if (element.properties.empty()) break;
      for (const PointField& property : element.properties) {
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
  detail::PlyHeader header_;
  bool is_big_endian_ = false;
  std::size_t place_ = 0;
  std::uint64_t line_ = 0;
  Eigen::AlignedBox3d before_;  // of the positions
  Eigen::AlignedBox3d after_;
};

}  // namespace

void move_ply(ByteSource& source, const Similarity3& new_from_old, const ByteSink& sink) {
  PlyMover(source, read_all(source), new_from_old, sink).run();
}

}  // namespace cairn

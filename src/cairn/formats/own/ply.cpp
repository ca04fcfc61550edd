// SPDX-License-Identifier: BSD-3-Clause
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/own/ply_header.hpp"
#include "cairn/formats/detail/own/point_columns.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/splats.hpp"

namespace cairn {
namespace {

using detail::PlyElement;

std::string plural_of(const PlyElement& element) {
  return "records of element " + printable(element.name);
}

}  // namespace

LandmarkMap read_ply(ByteSource& source, const Execution& execution) {
  detail::HeadedSource headed(source, execution);
  const detail::PlyHeader header = detail::read_ply_header(headed);
  const PlyElement* const vertex = header.vertex();
  constexpr std::string_view kVertices = "vertices";
  detail::PointTable table(detail::PointFormat::kPly, source.name(), vertex->place,
                           vertex->properties, execution);
  for (const PlyElement& element : header.elements) {
    if (&element != vertex && execution.log) {
      execution.log({fmt::format("{}: {} {} left out: only vertices are landmarks", source.name(),
                                 element.count, plural_of(element)),
                     RemarkKind::kLoss});
    }
  }
  if (header.encoding == detail::PlyEncoding::kAscii) {
    detail::TextRows rows(headed, execution.log);
    for (const PlyElement& element : header.elements) {
      if (&element == vertex) {
        detail::read_text_points(rows, headed, element.count, kVertices, table);
      } else if (!element.properties.empty()) {
        const std::string records = plural_of(element);
        for (std::uint64_t i = 0; i < element.count; ++i) rows.next(i, element.count, records);
      }
    }
    rows.expect_end();
  } else {
    const bool big_endian = header.encoding == detail::PlyEncoding::kBigEndian;
    for (const PlyElement& element : header.elements) {
      if (&element == vertex) {
        detail::read_binary_points(headed, element.count, kVertices, big_endian, table);
      } else {
        detail::skip_binary_records(headed, element.properties, element.count, plural_of(element),
                                    big_endian);
      }
    }
    headed.expect_end();
  }
  return std::move(table).finish(header.length_unit);
}

void write_ply(const LandmarkMap& map, const ByteSink& sink, const MapWriteOptions& options) {
  const bool are_splats = splat_columns(map.landmarks().columns).has_value();
  const bool are_floats =  // as trainers write them
      are_splats && !detail::is_rounded_by_floats(map.landmarks().positions);
  const detail::PointRows rows(
      map, are_splats ? detail::PointFormat::kSplats : detail::PointFormat::kPly,
      are_floats ? detail::ScalarType::kFloat32 : detail::ScalarType::kFloat64);
  std::string header =
      fmt::format("ply\nformat {} 1.0\n", options.ascii ? "ascii" : "binary_little_endian");
  const std::string unit =
      fmt::format("comment {}\n", detail::unit_comment(map.info().length_unit));
  if (!are_splats) header += unit;
  header += fmt::format("element vertex {}\n", map.landmark_count());
  for (const detail::PointField& field : rows.fields()) {
    header += fmt::format("property {} {}\n", detail::scalar(field.type).c_name, field.name);
  }
  if (are_splats) header += unit;  // the viewer of the original trainer has the count in line 3
  header += "end_header\n";
  rows.write(std::move(header), options.ascii, sink);
}

}  // namespace cairn

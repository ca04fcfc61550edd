// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/detail/json_text.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/pose_graph_file.hpp"

namespace cairn {
namespace {

using detail::JsonValue;
using Json = nlohmann::ordered_json;  // to write

constexpr std::string_view kSchema = "cairn.pose_graph";
constexpr std::uint64_t kGraphVersion = 1;
constexpr std::uint64_t kMostIds = std::numeric_limits<std::uint64_t>::max();

Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

Json to_json(const Similarity3& pose) {
  const Eigen::Vector3d& t = pose.translation();
  const Eigen::Quaterniond q = pose.rigid().quaternion();
  return {{"scale", pose.scale()},
          {"translation", {t.x(), t.y(), t.z()}},
          {"quaternion", {q.w(), q.x(), q.y(), q.z()}}};
}

template <class Matrix>
Json to_json(const std::optional<Matrix>& matrix) {
  if (!matrix) return nullptr;
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix->rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix->cols(); ++j) row.push_back((*matrix)(i, j));
    rows.push_back(std::move(row));
  }
  return rows;
}

Similarity3 similarity_of(const JsonValue& json) {
  const Eigen::Vector3d translation = json.at("translation").vector3();
  const std::vector<double> q = json.at("quaternion").numbers(4);
  const Eigen::Quaterniond rotation(q[0], q[1], q[2], q[3]);
  if (!(std::abs(rotation.norm() - 1.0) <= 1e-3)) {
    json.at("quaternion").refuse(fmt::format("norm {:.6g}", rotation.norm()), "norm 1 within 1e-3");
  }
  const double scale = json.at("scale").number();
  if (!(scale > 0.0)) json.at("scale").refuse(fmt::format("{}", scale), "a positive number");
  return {scale, Rigid3(rotation, translation)};
}

template <class Matrix>
std::optional<Matrix> matrix_of(const JsonValue& json) {
  if (json.json().is_null()) return std::nullopt;
  constexpr std::size_t kSize = Matrix::RowsAtCompileTime;
  if (json.size() != kSize) {
    json.refuse(fmt::format("has {} entries", json.size()), fmt::format("{} rows", kSize));
  }
  Matrix result;
  for (std::size_t i = 0; i < kSize; ++i) {
    const std::vector<double> row = json.at(i).numbers(kSize);
    for (std::size_t j = 0; j < kSize; ++j) {
      result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = row[j];
    }
  }
  return result;
}

std::string text_or_empty(const JsonValue& json) {
  return json.json().is_null() ? std::string() : json.text();
}

LinkKind kind_of(const JsonValue& json) {
  for (const LinkKind kind : {LinkKind::kOdometry, LinkKind::kPlacement, LinkKind::kManual}) {
    if (json.text() == to_string(kind)) return kind;
  }
  json.refuse(printable(json.text()), "odometry, placement or manual");
}

}  // namespace

std::string pose_graph_text(const PoseGraph& graph) {
  graph.validate();
  Json json = {{"schema", {{"name", kSchema}, {"version", kGraphVersion}}},
               {"nodes", Json::array()},
               {"links", Json::array()}};
  for (const PoseNode& node : graph.nodes) {
    json["nodes"].push_back({{"id", node.id.value},
                             {"name", text_or_null(node.name)},
                             {"session", text_or_null(node.session)},
                             {"world_from_node", to_json(node.world_from_node)}});
  }
  for (const Link& link : graph.links) {
    json["links"].push_back(
        {{"target", link.target.value},
         {"source", link.source.value},
         {"target_from_source", to_json(*link.target_from_source)},
         {"covariance", to_json(link.covariance)},
         {"covariance_with_scale", to_json(link.covariance_with_scale)},
         {"kind", to_string(link.kind)},
         {"probability", link.probability ? Json(*link.probability) : Json(nullptr)}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

bool is_pose_graph_text(std::string_view beginning) {
  const std::string_view text = without_byte_order_mark(beginning).substr(0, 1024);
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '{' &&
         text.find(fmt::format("\"{}\"", kSchema)) != std::string_view::npos;
}

PoseGraph read_pose_graph(ByteSource& source) {
  const nlohmann::json json = detail::read_json(source);
  const JsonValue document(json, source.name() + ": ");
  const JsonValue schema = document.at("schema");
  if (const std::string& name = schema.at("name").text(); name != kSchema) {
    schema.at("name").refuse(printable(name), kSchema);
  }
  const std::uint64_t version = schema.at("version").unsigned_number(kMostIds);
  if (version != kGraphVersion) {
    schema.at("version").refuse(std::to_string(version), std::to_string(kGraphVersion));
  }
  PoseGraph graph;
  document.at("nodes").each([&](const JsonValue& node) {
    graph.nodes.push_back({NodeId{node.at("id").unsigned_number(kMostIds)},
                           text_or_empty(node.at("name")), text_or_empty(node.at("session")),
                           similarity_of(node.at("world_from_node"))});
  });
  document.at("links").each([&](const JsonValue& value) {
    Link link;
    link.target = NodeId{value.at("target").unsigned_number(kMostIds)};
    link.source = NodeId{value.at("source").unsigned_number(kMostIds)};
    link.target_from_source = similarity_of(value.at("target_from_source"));
    link.covariance = matrix_of<Matrix6d>(value.at("covariance"));
    link.covariance_with_scale = matrix_of<Matrix7d>(value.at("covariance_with_scale"));
    link.kind = kind_of(value.at("kind"));
    const JsonValue probability = value.at("probability");
    if (!probability.json().is_null()) link.probability = probability.number();
    graph.links.push_back(std::move(link));
  });
  graph.validate(source.name());
  return graph;
}

}  // namespace cairn

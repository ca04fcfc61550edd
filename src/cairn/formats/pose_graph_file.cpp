// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/pose_graph_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/detail/json_text.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/bytes/json_document.hpp"
#include "cairn/formats/detail/bytes/words.hpp"
#include "cairn/formats/detail/own/numbered_fields.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {
namespace {

using detail::NumberedFields;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr std::string_view kVertex = "VERTEX_SE3:QUAT";
constexpr std::string_view kEdge = "EDGE_SE3:QUAT";
constexpr std::string_view kFix = "FIX";
constexpr std::string_view kVertexForm = "VERTEX_SE3:QUAT id x y z qx qy qz qw";

constexpr std::array<const char*, 4> kQuaternionNames = {"qx", "qy", "qz", "qw"};

std::uint64_t id_of(NumberedFields& fields, const char* name) {
  return fields.integer<std::uint64_t>(name, "a whole number from 0 to 18446744073709551615");
}

template <class Part>
void read_pose(NumberedFields& fields, Part& part) {
  part.translation[0] = fields.coordinate("x");
  part.translation[1] = fields.coordinate("y");
  part.translation[2] = fields.coordinate("z");
  double squared = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    part.quaternion[i] = fields.number(kQuaternionNames[i]);
    squared += part.quaternion[i] * part.quaternion[i];
  }
  const double norm = std::sqrt(squared);
  if (std::abs(norm - 1.0) <= 1e-2) return;
  fields.refuse_line(fmt::format("qx qy qz qw: quaternion of norm {:.6g}", norm),
                     "norm 1 within 1e-2");
}

// Ids that a line names, to be looked up when all vertices are known.
struct Reference {
  std::uint64_t id = 0;
  std::uint64_t line = 0;
};

void check_ids(const G2oGraph& graph, std::span<const std::uint64_t> vertex_lines,
               std::span<const Reference> references, const std::string& name) {
  std::vector<Reference> known;
  known.reserve(graph.vertices.size());
  for (std::size_t i = 0; i < graph.vertices.size(); ++i) {
    known.push_back({graph.vertices[i].id, vertex_lines[i]});
  }
  const auto before = [](const Reference& a, const Reference& b) {
    return std::pair(a.id, a.line) < std::pair(b.id, b.line);
  };
  std::sort(known.begin(), known.end(), before);
  for (std::size_t i = 1; i < known.size(); ++i) {
    if (known[i].id != known[i - 1].id) continue;
    throw Error(ErrorKind::kInput, fmt::format("{}:{}: field 2 (id)", name, known[i].line),
                fmt::format("vertex {} is in line {} already", known[i].id, known[i - 1].line),
                "each id once");
  }
  for (const Reference& reference : references) {
    const auto found =
        std::lower_bound(known.begin(), known.end(), Reference{reference.id, 0}, before);
    if (found != known.end() && found->id == reference.id) continue;
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", name, reference.line),
                fmt::format("there is no vertex {}", reference.id), "the id of a vertex");
  }
}

void put(detail::TextOutput& out, std::span<const double> numbers) {
  for (const double number : numbers) out.words(number);
}

Rigid3 pose_of(const std::array<double, 3>& t, const std::array<double, 4>& q) {
  return {Eigen::Quaterniond(q[3], q[0], q[1], q[2]), Eigen::Vector3d(t[0], t[1], t[2])};
}

template <class Part>
void set_pose(Part& part, const Similarity3& pose, std::string_view where) {
  if (pose.scale() != 1.0) {
    throw Error(ErrorKind::kMisuse, where, fmt::format("its scale is {}", pose.scale()),
                "1: g2o's SE3 has no scale");
  }
  const Eigen::Quaterniond q = pose.rigid().quaternion();
  const Eigen::Vector3d& t = pose.translation();
  part.translation = {t.x(), t.y(), t.z()};
  part.quaternion = {q.x(), q.y(), q.z(), q.w()};
}

// Derivative of g2o's error by Cairn's left perturbation (δt, δφ): with R the measured rotation,
// measured⁻¹·(t + δt, Exp(δφ)·R) = (Rᵀδt, Exp(Rᵀδφ)), whose quaternion's vector part is ½Rᵀδφ.
Matrix6 error_by_perturbation(const Rigid3& measured) {
  const Eigen::Matrix3d turned = measured.rotation().transpose();
  Matrix6 jacobian = Matrix6::Zero();
  jacobian.topLeftCorner<3, 3>() = turned;
  jacobian.bottomRightCorner<3, 3>() = 0.5 * turned;
  return jacobian;
}

// The inverse of a positive definite matrix; std::nullopt for others.
std::optional<Matrix6> inverse(const Matrix6& matrix) {
  const auto result = inverse_of_positive_definite(matrix);
  if (!result || !result->allFinite()) return std::nullopt;
  return 0.5 * (*result + result->transpose());
}

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

bool is_g2o(std::string_view beginning) {
  for (beginning = without_byte_order_mark(beginning); !beginning.empty();) {
    const std::size_t end = std::min(beginning.find('\n'), beginning.size());
    const std::string_view line = trimmed(beginning.substr(0, end));
    beginning.remove_prefix(std::min(end + 1, beginning.size()));
    if (line.empty() || line.front() == '#') continue;
    return line.starts_with("VERTEX_") || line.starts_with("EDGE_") || line.starts_with("FIX ");
  }
  return false;
}

G2oGraph read_g2o(ByteSource& source, const LogSink& log) {
  G2oGraph graph;
  std::vector<std::uint64_t> vertex_lines;
  std::vector<Reference> references;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    const std::string_view text = trimmed(*line);
    if (text.empty() || text.front() == '#') continue;
    const std::uint64_t number = lines.line_number();
    NumberedFields fields(text, source.name(), number);
    const std::string_view tag = fields.word("tag");
    if (tag == kVertex) {
      G2oGraph::Vertex& vertex = graph.vertices.emplace_back();
      vertex.id = id_of(fields, "id");
      read_pose(fields, vertex);
      vertex_lines.push_back(number);
    } else if (tag == kEdge) {
      G2oGraph::Edge& edge = graph.edges.emplace_back();
      edge.from = id_of(fields, "from");
      edge.to = id_of(fields, "to");
      if (edge.from == edge.to) {
        fields.refuse_line(fmt::format("links vertex {} with itself", edge.from), "two vertices");
      }
      read_pose(fields, edge);
      for (double& entry : edge.information) entry = fields.number("information");
      references.push_back({edge.from, number});
      references.push_back({edge.to, number});
    } else if (tag == kFix) {
      graph.fixed.push_back(id_of(fields, "id"));
      references.push_back({graph.fixed.back(), number});
    } else {
      fields.refuse(printable(tag) + " is not read", "VERTEX_SE3:QUAT, EDGE_SE3:QUAT or FIX");
    }
    fields.expect_end(tag);
  }
  if (graph.vertices.empty()) {
    throw Error(ErrorKind::kInput, source.name(), "no vertices", kVertexForm);
  }
  check_ids(graph, vertex_lines, references, source.name());
  return graph;
}

void write_g2o(const G2oGraph& graph, const ByteSink& sink) {
  detail::TextOutput out(sink);
  for (const G2oGraph::Vertex& vertex : graph.vertices) {
    out.words(kVertex, vertex.id);
    put(out, vertex.translation);
    put(out, vertex.quaternion);
    out.line();
  }
  for (const std::uint64_t id : graph.fixed) {
    out.words(kFix, id);
    out.line();
  }
  for (const G2oGraph::Edge& edge : graph.edges) {
    out.words(kEdge, edge.from, edge.to);
    put(out, edge.translation);
    put(out, edge.quaternion);
    put(out, edge.information);
    out.line();
  }
  out.flush();
}

PoseGraph pose_graph(const G2oGraph& graph) {
  PoseGraph result;
  for (const G2oGraph::Vertex& vertex : graph.vertices) {
    result.nodes.push_back(
        {NodeId{vertex.id}, {}, {}, pose_of(vertex.translation, vertex.quaternion)});
  }
  for (const G2oGraph::Edge& edge : graph.edges) {
    Link link;
    link.target = NodeId{edge.from};
    link.source = NodeId{edge.to};
    const Rigid3 measured = pose_of(edge.translation, edge.quaternion);
    link.target_from_source = measured;
    Matrix6 information;
    std::size_t next = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) information(i, j) = information(j, i) = edge.information[next++];
    }
    const Matrix6 jacobian = error_by_perturbation(measured);
    const Matrix6 ours = jacobian.transpose() * information * jacobian;
    if (const auto covariance = inverse(0.5 * (ours + ours.transpose()))) {
      link.covariance = *covariance;
    }
    const auto [least, most] = std::minmax(edge.from, edge.to);
    link.kind = most - least == 1 ? LinkKind::kOdometry : LinkKind::kPlacement;
    result.links.push_back(link);
  }
  return result;
}

G2oGraph g2o_graph(const PoseGraph& graph) {
  G2oGraph result;
  for (const PoseNode& node : graph.nodes) {
    G2oGraph::Vertex vertex;
    vertex.id = node.id.value;
    set_pose(vertex, node.world_from_node, fmt::format("node {}", node.id.value));
    result.vertices.push_back(vertex);
  }
  for (const Link& link : graph.links) {
    const std::string where = fmt::format("link {} to {}", link.target.value, link.source.value);
    G2oGraph::Edge edge;
    edge.from = link.target.value;
    edge.to = link.source.value;
    set_pose(edge, link.target_from_source.value(), where);
    if (!link.covariance) {
      throw Error(ErrorKind::kMisuse, where, "it has no covariance", "one: g2o requires it");
    }
    const Matrix6 jacobian = error_by_perturbation(link.target_from_source->rigid());
    const Matrix6 theirs = jacobian * Matrix6(*link.covariance) * jacobian.transpose();
    const auto information = inverse(0.5 * (theirs + theirs.transpose()));
    if (!information) {
      throw Error(ErrorKind::kMisuse, where, "its covariance has no inverse",
                  "a positive definite matrix");
    }
    std::size_t next = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) edge.information[next++] = (*information)(i, j);
    }
    result.edges.push_back(edge);
  }
  return result;
}

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

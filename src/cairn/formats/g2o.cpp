// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/pose_graph_file.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr std::string_view kVertex = "VERTEX_SE3:QUAT";
constexpr std::string_view kEdge = "EDGE_SE3:QUAT";
constexpr std::string_view kFix = "FIX";
constexpr std::string_view kVertexForm = "VERTEX_SE3:QUAT id x y z qx qy qz qw";
constexpr std::string_view kEdgeForm =
    "EDGE_SE3:QUAT from to x y z qx qy qz qw and 21 numbers of the information matrix";

constexpr std::array<std::string_view, 7> kPose = {"x", "y", "z", "qx", "qy", "qz", "qw"};

// The words of a line, one after another.
class G2oFields {
 public:
  G2oFields(std::string_view line, std::string place, std::string_view form)
      : line_(line), place_(std::move(place)), form_(form) {}

  std::string_view word(std::string_view name) {
    line_.remove_prefix(std::min(line_.find_first_not_of(kBlanks), line_.size()));
    ++field_;
    if (line_.empty()) throw Error(ErrorKind::kInput, where(name), "missing", form_);
    const std::string_view found = line_.substr(0, line_.find_first_of(kBlanks));
    line_.remove_prefix(found.size());
    return found;
  }
  std::uint64_t id(std::string_view name) {
    const std::string_view found = word(name);
    if (const auto number = parse_unsigned(found)) return *number;
    throw Error(ErrorKind::kInput, where(name), printable(found) + " is no id",
                "a whole number from 0 to 18446744073709551615");
  }
  double number(std::string_view name) {
    const std::string_view found = word(name);
    if (const auto value = parse_number(found)) return *value;
    throw Error(ErrorKind::kInput, where(name), printable(found) + " is not a number",
                "a finite decimal number");
  }
  double coordinate(std::string_view name) {
    const double value = number(name);
    if (std::abs(value) <= kLargestCoordinate) return value;
    throw Error(ErrorKind::kInput, where(name), fmt::format("{:g} is beyond the limit", value),
                kExpectedCoordinates);
  }
  void pose(std::array<double, 3>& translation, std::array<double, 4>& quaternion) {
    for (std::size_t i = 0; i < 3; ++i) translation[i] = coordinate(kPose[i]);
    double squared = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      quaternion[i] = number(kPose[3 + i]);
      squared += quaternion[i] * quaternion[i];
    }
    const double norm = std::sqrt(squared);
    if (std::abs(norm - 1.0) <= 1e-2) return;
    throw Error(ErrorKind::kInput, place_,
                fmt::format("qx qy qz qw: quaternion of norm {:.6g}", norm), "norm 1 within 1e-2");
  }
  void end() {
    if (trimmed(line_).empty()) return;
    throw Error(ErrorKind::kInput, place_, fmt::format("more than {} fields", field_), form_);
  }
  const std::string& place() const { return place_; }

 private:
  std::string where(std::string_view name) const {
    return fmt::format("{}: field {} ({})", place_, field_, name);
  }

  std::string_view line_;
  std::string place_;
  std::string_view form_;
  int field_ = 0;
};

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

void append(std::string& text, std::span<const double> numbers) {
  for (const double number : numbers) {
    text += ' ';
    append_number(text, number);
  }
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
    const std::string_view tag = text.substr(0, text.find_first_of(kBlanks));
    const std::uint64_t number = lines.line_number();
    std::string place = fmt::format("{}:{}", source.name(), number);
    if (tag == kVertex) {
      G2oFields fields(text, std::move(place), kVertexForm);
      fields.word("tag");
      G2oGraph::Vertex vertex;
      vertex.id = fields.id("id");
      fields.pose(vertex.translation, vertex.quaternion);
      fields.end();
      graph.vertices.push_back(vertex);
      vertex_lines.push_back(number);
    } else if (tag == kEdge) {
      G2oFields fields(text, std::move(place), kEdgeForm);
      fields.word("tag");
      G2oGraph::Edge edge;
      edge.from = fields.id("from");
      edge.to = fields.id("to");
      if (edge.from == edge.to) {
        throw Error(ErrorKind::kInput, fields.place(),
                    fmt::format("links vertex {} with itself", edge.from), "two vertices");
      }
      fields.pose(edge.translation, edge.quaternion);
      for (double& entry : edge.information) entry = fields.number("information");
      fields.end();
      graph.edges.push_back(edge);
      references.push_back({edge.from, number});
      references.push_back({edge.to, number});
    } else if (tag == kFix) {
      G2oFields fields(text, std::move(place), "FIX id");
      fields.word("tag");
      graph.fixed.push_back(fields.id("id"));
      fields.end();
      references.push_back({graph.fixed.back(), number});
    } else {
      throw Error(ErrorKind::kInput, place + ": field 1 (tag)", printable(tag) + " is not read",
                  "VERTEX_SE3:QUAT, EDGE_SE3:QUAT or FIX");
    }
  }
  if (graph.vertices.empty()) {
    throw Error(ErrorKind::kInput, source.name(), "no vertices", kVertexForm);
  }
  check_ids(graph, vertex_lines, references, source.name());
  return graph;
}

void write_g2o(const G2oGraph& graph, const ByteSink& sink) {
  std::string text;
  const auto end_line = [&] {
    text += '\n';
    if (text.size() < std::size_t{1} << 16) return;
    sink(text);
    text.clear();
  };
  for (const G2oGraph::Vertex& vertex : graph.vertices) {
    text += fmt::format("{} {}", kVertex, vertex.id);
    append(text, vertex.translation);
    append(text, vertex.quaternion);
    end_line();
  }
  for (const std::uint64_t id : graph.fixed) {
    text += fmt::format("{} {}", kFix, id);
    end_line();
  }
  for (const G2oGraph::Edge& edge : graph.edges) {
    text += fmt::format("{} {} {}", kEdge, edge.from, edge.to);
    append(text, edge.translation);
    append(text, edge.quaternion);
    append(text, edge.information);
    end_line();
  }
  sink(text);
}

PoseGraph pose_graph(const G2oGraph& graph) {
  PoseGraph result;
  for (const G2oGraph::Vertex& vertex : graph.vertices) {
    result.nodes.push_back(
        {NodeId{vertex.id}, {}, {}, pose_of(vertex.translation, vertex.quaternion)});
  }
  for (const G2oGraph::Edge& edge : graph.edges) {
    PoseLink link;
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
  for (const PoseLink& link : graph.links) {
    const std::string where = fmt::format("link {} to {}", link.target.value, link.source.value);
    G2oGraph::Edge edge;
    edge.from = link.target.value;
    edge.to = link.source.value;
    set_pose(edge, link.target_from_source, where);
    if (!link.covariance) {
      throw Error(ErrorKind::kMisuse, where, "it has no covariance", "one: g2o requires it");
    }
    const Matrix6 jacobian = error_by_perturbation(link.target_from_source.rigid());
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

}  // namespace cairn

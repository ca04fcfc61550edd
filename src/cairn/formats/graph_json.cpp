// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/error.hpp"
#include "cairn/core/json_text.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/pose_graph_file.hpp"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;  // to write
using Document = nlohmann::json;      // to read: of many keys, it finds one fast

constexpr std::string_view kSchema = "cairn.pose_graph";
constexpr int kGraphVersion = 1;

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

// A value of a document with its place.
class Value {
 public:
  Value(const Document& json, std::string place) : json_(json), place_(std::move(place)) {}

  Value at(const char* name) const {
    if (!json_.is_object()) refuse("an object");
    const auto found = json_.find(name);
    if (found == json_.end()) {
      throw Error(ErrorKind::kInput, place_, fmt::format("'{}' is missing", name), "");
    }
    return {*found, fmt::format("{}: {}", place_, name)};
  }
  /// @param size 0: any
  std::size_t array(std::size_t size) const {
    if (!json_.is_array() || (size > 0 && json_.size() != size)) {
      refuse(size > 0 ? fmt::format("an array of {}", size) : "an array");
    }
    return json_.size();
  }
  Value operator[](std::size_t i) const { return {json_[i], fmt::format("{}[{}]", place_, i)}; }
  bool is_null() const { return json_.is_null(); }
  double number() const {
    if (!json_.is_number()) refuse("a number");
    return json_.get<double>();
  }
  std::uint64_t id() const {
    if (!json_.is_number_unsigned()) refuse("a whole number from 0 to 18446744073709551615");
    return json_.get<std::uint64_t>();
  }
  std::string text() const {
    if (!json_.is_string()) refuse("text");
    return json_.get<std::string>();
  }
  std::string text_or_empty() const { return is_null() ? std::string() : text(); }

  [[noreturn]] void refuse(std::string_view expected) const {
    const std::string found =
        json_.is_structured()
            ? json_.type_name()
            : printable(json_.dump(-1, ' ', true, Document::error_handler_t::replace));
    throw Error(ErrorKind::kInput, place_, found, expected);
  }

  Similarity3 pose() const {
    const Value t = at("translation");
    t.array(3);
    const Value q = at("quaternion");
    q.array(4);
    const Eigen::Quaterniond rotation(q[0].number(), q[1].number(), q[2].number(), q[3].number());
    if (!(std::abs(rotation.norm() - 1.0) <= 1e-3)) {
      throw Error(ErrorKind::kInput, q.place_, fmt::format("norm {:.6g}", rotation.norm()),
                  "norm 1 within 1e-3");
    }
    const Value scale = at("scale");
    if (!(scale.number() > 0.0)) scale.refuse("a positive number");
    return {scale.number(), Rigid3(rotation, {t[0].number(), t[1].number(), t[2].number()})};
  }
  template <class Matrix>
  std::optional<Matrix> matrix() const {
    if (is_null()) return std::nullopt;
    constexpr auto kSize = static_cast<std::size_t>(Matrix::RowsAtCompileTime);
    array(kSize);
    Matrix result;
    for (std::size_t i = 0; i < kSize; ++i) {
      (*this)[i].array(kSize);
      for (std::size_t j = 0; j < kSize; ++j) {
        result(static_cast<int>(i), static_cast<int>(j)) = (*this)[i][j].number();
      }
    }
    return result;
  }
  LinkKind kind() const {
    const std::string word = text();
    for (const LinkKind kind : {LinkKind::kOdometry, LinkKind::kPlacement, LinkKind::kManual}) {
      if (word == to_string(kind)) return kind;
    }
    refuse("odometry, placement or manual");
  }

 private:
  const Document& json_;
  std::string place_;
};

Document parsed(const std::string& text, const std::string& name) {
  check_json(text, name, std::numeric_limits<std::size_t>::max());
  try {
    return Document::parse(text);
  } catch (const Document::exception& error) {
    // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
    const std::string_view what = error.what();
    const std::size_t end = what.find("] ");
    throw Error(ErrorKind::kInput, name,
                end == std::string_view::npos ? what : what.substr(end + 2), "");
  }
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
  for (const PoseLink& link : graph.links) {
    json["links"].push_back(
        {{"target", link.target.value},
         {"source", link.source.value},
         {"target_from_source", to_json(link.target_from_source)},
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
  const Document json = parsed(read_all(source), source.name());
  const Value document(json, source.name());
  const Value schema = document.at("schema");
  if (schema.at("name").text() != kSchema) schema.at("name").refuse(kSchema);
  if (schema.at("version").id() != kGraphVersion) schema.at("version").refuse("1");
  PoseGraph graph;
  const Value nodes = document.at("nodes");
  const std::size_t node_count = nodes.array(0);
  for (std::size_t i = 0; i < node_count; ++i) {
    const Value node = nodes[i];
    graph.nodes.push_back({NodeId{node.at("id").id()}, node.at("name").text_or_empty(),
                           node.at("session").text_or_empty(), node.at("world_from_node").pose()});
  }
  const Value links = document.at("links");
  const std::size_t link_count = links.array(0);
  for (std::size_t i = 0; i < link_count; ++i) {
    const Value value = links[i];
    PoseLink link;
    link.target = NodeId{value.at("target").id()};
    link.source = NodeId{value.at("source").id()};
    link.target_from_source = value.at("target_from_source").pose();
    link.covariance = value.at("covariance").matrix<Matrix6d>();
    link.covariance_with_scale = value.at("covariance_with_scale").matrix<Matrix7d>();
    link.kind = value.at("kind").kind();
    const Value probability = value.at("probability");
    if (!probability.is_null()) link.probability = probability.number();
    graph.links.push_back(std::move(link));
  }
  graph.validate(source.name());
  return graph;
}

}  // namespace cairn

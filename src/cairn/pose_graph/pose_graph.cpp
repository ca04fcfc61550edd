// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/pose_graph/pose_graph.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/geometry/decompositions.hpp"
#include "cairn/geometry/limits.hpp"

namespace cairn {
namespace {

constexpr std::string_view kExpectedPose =
    "a translation from -1e9 to 1e9 and a scale from 1e-9 to 1e9";

// "is not finite" or "is beyond the limit"; empty if the pose is valid.
std::string_view defect_of(const Similarity3& pose) {
  const bool has_scale =
      pose.scale() <= kLargestCoordinate && pose.scale() >= 1.0 / kLargestCoordinate;
  return has_scale ? coordinate_defect(pose.rigid()) : "is beyond the limit";
}

// Allows an error of 1e-6 of the largest entry, because decimals are rounded; the same as for landmarks.
template <class Matrix>
std::string defect_of(const Matrix& covariance) {
  if (!covariance.allFinite()) return "an entry is not finite";
  const double tolerance = 1e-6 * covariance.cwiseAbs().maxCoeff();
  if ((covariance - covariance.transpose()).cwiseAbs().maxCoeff() > tolerance) {
    return "not symmetric";
  }
  const auto values = symmetric_eigenvalues<Matrix::RowsAtCompileTime>(covariance);
  return values[0] < -tolerance ? "indefinite" : "";
}

}  // namespace

std::string_view to_string(LinkKind kind) {
  switch (kind) {
    case LinkKind::kOdometry:
      return "odometry";
    case LinkKind::kPlacement:
      return "placement";
    case LinkKind::kManual:
      return "manual";
  }
  return "unknown";
}

std::string_view to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAligned:
      return "aligned";
    case Verdict::kAmbiguous:
      return "ambiguous";
    case Verdict::kRejected:
      return "rejected";
  }
  return "unknown";
}

bool Link::connects() const {
  return target_from_source && verdict.value_or(Verdict::kAligned) == Verdict::kAligned;
}

std::string_view Link::status() const {
  return verdict ? to_string(*verdict) : "stated";
}

std::optional<Matrix7d> Link::full_covariance() const {
  if (covariance_with_scale || !covariance) return covariance_with_scale;
  Matrix7d full = Matrix7d::Zero();
  full.topLeftCorner<6, 6>() = *covariance;
  return full;
}

void PoseGraph::validate(std::string_view where) const {
  const auto refuse = [&](const std::string& place, std::string_view what,
                          std::string_view expected) {
    throw Error(ErrorKind::kInput, fmt::format("{}: {}", where, place), what, expected);
  };
  std::vector<NodeId> ids;
  ids.reserve(nodes.size());
  for (const PoseNode& node : nodes) {
    ids.push_back(node.id);
    if (const auto defect = defect_of(node.world_from_node); !defect.empty()) {
      refuse(fmt::format("node {}", node.id.value), fmt::format("its pose {}", defect),
             kExpectedPose);
    }
  }
  std::sort(ids.begin(), ids.end());
  if (const auto twice = std::adjacent_find(ids.begin(), ids.end()); twice != ids.end()) {
    refuse(fmt::format("node {}", twice->value), "its id occurs twice", "each id once");
  }
  for (std::size_t i = 0; i < links.size(); ++i) {
    const Link& link = links[i];
    const std::string place =
        fmt::format("link {} ({} to {})", i, link.target.value, link.source.value);
    for (const NodeId end : {link.target, link.source}) {
      if (!std::binary_search(ids.begin(), ids.end(), end)) {
        refuse(place, fmt::format("there is no node {}", end.value), "the id of a node");
      }
    }
    if (link.target == link.source) refuse(place, "it links a node with itself", "two nodes");
    if (!link.connects())
      refuse(place, "it does not connect them", "a transform, stated or aligned");
    if (const auto transform = defect_of(*link.target_from_source); !transform.empty()) {
      refuse(place, fmt::format("its transform {}", transform), kExpectedPose);
    }
    std::string defect = link.covariance ? defect_of(*link.covariance) : "";
    if (defect.empty() && link.covariance_with_scale) {
      defect = defect_of(*link.covariance_with_scale);
    }
    if (!defect.empty()) refuse(place, "its covariance is none: " + defect, "a covariance");
    if (link.probability && !(*link.probability >= 0.0 && *link.probability <= 1.0)) {
      refuse(place, fmt::format("its probability is {}", *link.probability), "0 to 1");
    }
  }
}

}  // namespace cairn

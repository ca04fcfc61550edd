// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/detail/row_bytes.hpp"

#include <bit>
#include <cmath>
#include <vector>

#include "cairn/core/detail/hash.hpp"
#include "cairn/geometry/decompositions.hpp"

namespace cairn {

namespace {

void append(std::string& bytes, std::uint64_t value) {
  for (int i = 0; i < 8; ++i) bytes += static_cast<char>((value >> (8 * i)) & 0xff);
}

void append(std::string& bytes, double value) {
  append(bytes, std::bit_cast<std::uint64_t>(value));
}

// The numbers in `bytes`; std::nullopt unless there are `count` and all are finite.
std::optional<std::vector<double>> numbers(std::string_view bytes, std::size_t count) {
  if (bytes.size() != 8 * count) return std::nullopt;
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < 8; ++k) {
      bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[8 * i + k])) << (8 * k);
    }
    values.push_back(std::bit_cast<double>(bits));
    if (!std::isfinite(values.back())) return std::nullopt;
  }
  return values;
}

template <class Matrix>
std::string matrix_bytes(const Matrix& matrix) {
  std::string bytes;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) append(bytes, double{matrix(i, j)});
  }
  return bytes;
}

template <class Matrix>
std::optional<Matrix> covariance_of_bytes(std::string_view bytes) {
  constexpr int kSize = Matrix::RowsAtCompileTime;
  const auto values = numbers(bytes, static_cast<std::size_t>(kSize * kSize));
  if (!values) return std::nullopt;
  Matrix matrix;
  for (Eigen::Index i = 0; i < kSize * kSize; ++i) {
    matrix(i / kSize, i % kSize) = (*values)[static_cast<std::size_t>(i)];
  }
  const double largest = matrix.cwiseAbs().maxCoeff();
  if ((matrix - matrix.transpose()).cwiseAbs().maxCoeff() > 1e-6 * largest) return std::nullopt;
  if (symmetric_eigenvalues<kSize>(matrix)[0] < -1e-6 * largest) return std::nullopt;
  return matrix;
}

}  // namespace

std::string pose_bytes(const Similarity3& pose) {
  const Eigen::Quaterniond q = pose.rigid().quaternion();
  const Eigen::Vector3d& t = pose.translation();
  std::string bytes;
  for (const double value : {pose.scale(), q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) {
    append(bytes, value);
  }
  return bytes;
}

std::optional<Similarity3> pose_of_bytes(std::string_view bytes) {
  const auto values = numbers(bytes, 8);
  if (!values) return std::nullopt;
  const std::vector<double>& v = *values;
  const Eigen::Quaterniond q(v[1], v[2], v[3], v[4]);
  if (!(v[0] > 0.0) || std::abs(q.norm() - 1.0) > 1e-6) return std::nullopt;
  return Similarity3(v[0], Rigid3(q, Eigen::Vector3d(v[5], v[6], v[7])));
}

std::string covariance_bytes(const Matrix6d& covariance) {
  return matrix_bytes(covariance);
}

std::string covariance_bytes(const Matrix7d& covariance) {
  return matrix_bytes(covariance);
}

std::optional<Matrix6d> covariance6_of_bytes(std::string_view bytes) {
  return covariance_of_bytes<Matrix6d>(bytes);
}

std::optional<Matrix7d> covariance7_of_bytes(std::string_view bytes) {
  return covariance_of_bytes<Matrix7d>(bytes);
}

std::string extent_bytes(const NodeExtent& extent) {
  std::string bytes;
  for (int axis = 0; axis < 3; ++axis) append(bytes, extent.centre[axis]);
  append(bytes, extent.radius);
  return bytes;
}

std::optional<NodeExtent> extent_of_bytes(std::string_view bytes) {
  const auto values = numbers(bytes, 4);
  if (!values || !((*values)[3] > 0.0)) return std::nullopt;
  return NodeExtent{{(*values)[0], (*values)[1], (*values)[2]}, (*values)[3]};
}

RowBytes& RowBytes::add(std::uint64_t value) {
  append(bytes_, value);
  return *this;
}

RowBytes& RowBytes::add(std::string_view bytes) {
  append(bytes_, std::uint64_t{bytes.size()});
  bytes_ += bytes;
  return *this;
}

RowBytes& RowBytes::add(const std::optional<std::uint64_t>& value) {
  append(bytes_, std::uint64_t{value ? 1U : 0U});
  append(bytes_, value.value_or(0));
  return *this;
}

RowBytes& RowBytes::add(double value) {
  append(bytes_, value);
  return *this;
}

std::string RowBytes::digest() const {
  const detail::Hash128 hash = detail::hash_of(bytes_);
  std::string result;
  for (const std::uint64_t half : {hash.high, hash.low}) {
    for (int i = 7; i >= 0; --i) result += static_cast<char>((half >> (8 * i)) & 0xff);
  }
  return result;
}

std::string hexadecimal(std::string_view bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string digits;
  for (const char c : bytes) {
    digits += kDigits[static_cast<unsigned char>(c) >> 4];
    digits += kDigits[static_cast<unsigned char>(c) & 15];
  }
  return digits;
}

std::optional<std::string> bytes_of_hexadecimal(std::string_view digits) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  if (digits.size() % 2 != 0) return std::nullopt;
  std::string bytes;
  for (std::size_t i = 0; i < digits.size(); i += 2) {
    const std::size_t high = kDigits.find(digits[i]);
    const std::size_t low = kDigits.find(digits[i + 1]);
    if (high == kDigits.npos || low == kDigits.npos) return std::nullopt;
    bytes += static_cast<char>(16 * high + low);
  }
  return bytes;
}

std::string digest_of(const AtlasNode& node) {
  return RowBytes()
      .add(node.id.value)
      .add(node.name)
      .add(node.session)
      .add(node.map)
      .add(static_cast<std::uint64_t>(node.length_unit))
      .add(node.frames)
      .add(node.landmarks)
      .add(node.observations)
      .add(extent_bytes(node.extent))
      .digest();
}

LinkBlobs blobs_of(const Link& link) {
  LinkBlobs blobs;
  if (link.target_from_source) blobs.target_from_source = pose_bytes(*link.target_from_source);
  if (link.covariance) blobs.covariance = covariance_bytes(*link.covariance);
  if (link.covariance_with_scale) {
    blobs.covariance_with_scale = covariance_bytes(*link.covariance_with_scale);
  }
  return blobs;
}

Verdict stored_verdict(const Link& link) {
  return link.verdict.value_or(Verdict::kAligned);
}

std::optional<Verdict> verdict_of_stored(LinkKind kind, Verdict verdict) {
  if (kind != LinkKind::kPlacement && verdict == Verdict::kAligned) return std::nullopt;
  return verdict;
}

std::string digest_of(const Link& link, const LinkBlobs& blobs) {
  return RowBytes()
      .add(link.id.value)
      .add(link.target.value)
      .add(link.source.value)
      .add(static_cast<std::uint64_t>(link.kind))
      .add(static_cast<std::uint64_t>(stored_verdict(link)))
      .add(link.probability.value_or(-1.0))
      .add(link.reason)
      .add(blobs.target_from_source)
      .add(blobs.covariance)
      .add(blobs.covariance_with_scale)
      .digest();
}

PoseBlobs blobs_of(const AtlasPose& pose) {
  return {pose_bytes(pose.frame_from_node), covariance_bytes(pose.covariance)};
}

std::string digest_of(const AtlasPose& pose, std::uint64_t row, const PoseBlobs& blobs) {
  return RowBytes()
      .add(row)
      .add(pose.node.value)
      .add(pose.frame.value)
      .add(blobs.frame_from_node)
      .add(blobs.covariance)
      .digest();
}

bool operator==(const AtlasPose& a, const AtlasPose& b) {
  constexpr double kRounding = 1e-12;
  return a.node == b.node && a.frame == b.frame &&
         a.frame_from_node.matrix().isApprox(b.frame_from_node.matrix(), kRounding) &&
         (a.covariance == b.covariance || a.covariance.isApprox(b.covariance, kRounding));
}

const AtlasNode* AtlasState::find(const std::string& name) const {
  for (const auto& [id, node] : nodes) {
    if (node.name == name) return &node;
  }
  return nullptr;
}

}  // namespace cairn

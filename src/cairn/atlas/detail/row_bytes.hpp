// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/atlas/store/store.hpp"

namespace cairn {

// Numbers in stores: little-endian doubles, without gaps.

/// Scale, quaternion w x y z, translation x y z: 64 bytes.
std::string pose_bytes(const Similarity3& pose);
/// @return std::nullopt unless the bytes are a pose of finite numbers
std::optional<Similarity3> pose_of_bytes(std::string_view bytes);

/// 36 or 49 numbers, row-major.
std::string covariance_bytes(const Matrix6d& covariance);
std::string covariance_bytes(const Matrix7d& covariance);
/// @return std::nullopt unless the bytes are a covariance of that size
std::optional<Matrix6d> covariance6_of_bytes(std::string_view bytes);
std::optional<Matrix7d> covariance7_of_bytes(std::string_view bytes);

/// Centre x y z and radius: 32 bytes.
std::string extent_bytes(const NodeExtent& extent);
std::optional<NodeExtent> extent_of_bytes(std::string_view bytes);

/// Bytes of a row's fields, from which its digest is computed. Texts follow their lengths, so that
/// different rows have different bytes.
class RowBytes {
 public:
  RowBytes& add(std::uint64_t value);
  RowBytes& add(std::string_view bytes);
  RowBytes& add(const std::optional<std::uint64_t>& value);
  RowBytes& add(double value);

  /// 128-bit XXH3: 16 bytes, big-endian.
  std::string digest() const;

 private:
  std::string bytes_;
};

/// 16 bytes as 32 hexadecimal digits, and back.
std::string hexadecimal(std::string_view bytes);
std::optional<std::string> bytes_of_hexadecimal(std::string_view digits);

std::string digest_of(const AtlasNode& node);
/// The numbers of a link as stored; empty if absent. Reading may change the last digit, because quaternions
/// are normalised.
struct LinkBlobs {
  std::string target_from_source;
  std::string covariance;
  std::string covariance_with_scale;
};
LinkBlobs blobs_of(const Link& link);

// A stated link, from odometry or a person, is stored with the verdict "aligned", as in earlier versions.
Verdict stored_verdict(const Link& link);
std::optional<Verdict> verdict_of_stored(LinkKind kind, Verdict verdict);

std::string digest_of(const Link& link, const LinkBlobs& blobs);

/// The numbers of a pose as stored.
struct PoseBlobs {
  std::string frame_from_node;
  std::string covariance;
};
PoseBlobs blobs_of(const AtlasPose& pose);
/// @param row number of the pose's row
std::string digest_of(const AtlasPose& pose, std::uint64_t row, const PoseBlobs& blobs);

}  // namespace cairn

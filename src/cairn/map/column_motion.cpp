// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/map/column_motion.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

std::vector<std::array<std::size_t, 3>> normals_among(std::span<const std::string_view> names) {
  std::vector<std::string> plain;
  for (const std::string_view name : names) plain.push_back(plain_column_name(name));
  const auto find = [&](const std::string& sought) {
    return static_cast<std::size_t>(std::find(plain.begin(), plain.end(), sought) - plain.begin());
  };
  std::vector<std::array<std::size_t, 3>> normals;
  for (const std::string stem : {"n", "normal"}) {
    const std::array<std::size_t, 3> vector = {find(stem + "x"), find(stem + "y"),
                                               find(stem + "z")};
    if (*std::max_element(vector.begin(), vector.end()) < plain.size()) normals.push_back(vector);
  }
  return normals;
}

}  // namespace

ColumnMotion::ColumnMotion(std::span<const std::string_view> names, const Similarity3& new_from_old,
                           std::string_view where)
    : rotation_(new_from_old.rigid().rotation()),
      quaternion_(new_from_old.rigid().quaternion()),
      log_scale_(std::log(new_from_old.scale())) {
  if (new_from_old.linear() == Eigen::Matrix3d::Identity()) return;
  normals_ = normals_among(names);
  for (const auto& normal : normals_) changed_.insert(changed_.end(), normal.begin(), normal.end());
  if (!has_splat_names(names)) return;
  splats_ = splat_columns(names);
  reject_if(!splats_, where, "has Gaussian splats in no known layout, which cannot be turned",
            "rot_0 to rot_3, scale_0 to scale_2, opacity, and f_rest_ of degree 0 to 4");
  harmonics_ = harmonics_rotation(splats_->degree, rotation_);
  changed_.insert(changed_.end(), splats_->rotation.begin(), splats_->rotation.end());
  changed_.insert(changed_.end(), splats_->log_scales.begin(), splats_->log_scales.end());
  changed_.insert(changed_.end(), splats_->harmonics.begin(), splats_->harmonics.end());
}

void ColumnMotion::move(std::span<double> row) const {
  for (const auto& [x, y, z] : normals_) {
    const Eigen::Vector3d turned = rotation_ * Eigen::Vector3d(row[x], row[y], row[z]);
    row[x] = turned.x();
    row[y] = turned.y();
    row[z] = turned.z();
  }
  if (splats_) move_splat(row);
}

void ColumnMotion::move_splat(std::span<double> row) const {
  const auto& [w, x, y, z] = splats_->rotation;
  // Not normalised, so that the way back leads to the same numbers.
  const Eigen::Quaterniond turned =
      quaternion_ * Eigen::Quaterniond(row[w], row[x], row[y], row[z]);
  row[w] = turned.w();
  row[x] = turned.x();
  row[y] = turned.y();
  row[z] = turned.z();
  for (const std::size_t scale : splats_->log_scales) row[scale] += log_scale_;
  std::size_t next = 0;
  while (next < splats_->harmonics.size()) {  // a channel
    for (const HarmonicsRotation& matrix : harmonics_) {
      const std::span<const std::size_t> places =
          std::span(splats_->harmonics).subspan(next, static_cast<std::size_t>(matrix.rows()));
      Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 2 * kMostSplatDegree + 1, 1> old(matrix.rows());
      for (std::size_t i = 0; i < places.size(); ++i) {
        old[static_cast<Eigen::Index>(i)] = row[places[i]];
      }
      for (std::size_t i = 0; i < places.size(); ++i) {
        row[places[i]] = matrix.row(static_cast<Eigen::Index>(i)).dot(old);
      }
      next += places.size();
    }
  }
}

void move_columns(std::span<NamedColumn> columns, const Similarity3& new_from_old,
                  std::string_view where) {
  const ColumnMotion motion(column_names(columns), new_from_old, where);
  if (motion.changed().empty()) return;
  std::vector<double> row(columns.size(), 0.0);
  for (std::size_t i = 0; i < columns.front().values.size(); ++i) {
    for (const std::size_t column : motion.changed()) row[column] = columns[column].values[i];
    motion.move(row);
    for (const std::size_t column : motion.changed()) columns[column].values.set(i, row[column]);
  }
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <string>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"

namespace cairn {
namespace {

// "Normal_X" as "normalx".
std::string plain_name(std::string_view name) {
  std::string plain;
  for (const char c : name) {
    if (c != '_') plain += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  }
  return plain;
}

TurningColumns turning_columns_of(std::span<const NamedColumn> columns) {
  std::vector<std::string_view> names;
  for (const NamedColumn& column : columns) names.push_back(column.name);
  return turning_columns(names);
}

[[noreturn]] void refuse_splats(std::string_view name) {
  throw Error(ErrorKind::kInput, name,
              "has Gaussian splats, whose spherical harmonics would not follow",
              "points without the columns of splats");
}

}  // namespace

TurningColumns turning_columns(std::span<const std::string_view> names) {
  std::vector<std::string> plain;
  for (const std::string_view name : names) plain.push_back(plain_name(name));
  const auto find = [&](std::string_view sought) {
    return static_cast<std::size_t>(std::find(plain.begin(), plain.end(), sought) - plain.begin());
  };
  TurningColumns result;
  for (const std::string stem : {"n", "normal"}) {
    const std::array<std::size_t, 3> vector = {find(stem + "x"), find(stem + "y"),
                                               find(stem + "z")};
    if (*std::max_element(vector.begin(), vector.end()) < plain.size()) {
      result.vectors.push_back(vector);
    }
  }
  result.are_splats = std::min(find("rot0"), find("frest0")) < plain.size();
  return result;
}

void require_no_splats(const LandmarkMap& map, std::string_view name) {
  if (turning_columns_of(map.landmarks().columns).are_splats) refuse_splats(name);
}

std::vector<NamedColumn> transformed_columns(std::span<const NamedColumn> columns,
                                             const Similarity3& new_from_old) {
  std::vector<NamedColumn> result(columns.begin(), columns.end());
  if (new_from_old.linear() == Eigen::Matrix3d::Identity()) return result;
  const TurningColumns turning = turning_columns_of(columns);
  if (turning.are_splats) refuse_splats("map");
  const Eigen::Matrix3d rotation = new_from_old.rigid().rotation();
  for (const std::array<std::size_t, 3>& at : turning.vectors) {
    for (std::size_t i = 0; i < result[at[0]].values.size(); ++i) {
      const Eigen::Vector3d turned =
          rotation * Eigen::Vector3d(result[at[0]].values[i], result[at[1]].values[i],
                                     result[at[2]].values[i]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        result[at.at(axis)].values[i] = turned[static_cast<Eigen::Index>(axis)];
      }
    }
  }
  return result;
}

}  // namespace cairn

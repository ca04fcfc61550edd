// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "cairn/geometry/rigid3.hpp"
#include "cairn/map/landmark_map.hpp"
#include "support/arguments.hpp"

namespace cairn::cli {

/// Keeps the order in which fields are set.
using Json = nlohmann::ordered_json;

/// A map with what a document says of where it came from.
struct LoadedMap {
  std::string path;
  LandmarkMap map;
  Json description;  ///< path, hash, format counts
};

LoadedMap load_map(const std::string& path, const CommonArguments& common);

/// The head that every document has; `schema` is e.g. "align".
Json document(const std::string& schema, const CommonArguments& common, Json inputs, Json options);

/// Writes a document where --json says; nothing if it was not given.
void write_document(const Json& json, const CommonArguments& common);

Json to_json(const Rigid3& pose);
Json to_json(const Eigen::Vector3d& vector);
Json to_json(const Matrix6d& matrix);
template <class Value>
Json to_json(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}

/// "metres" or "free".
std::string to_string(LengthUnit unit);

}  // namespace cairn::cli

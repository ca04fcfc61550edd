// SPDX-License-Identifier: BSD-3-Clause
#include "support/saved_alignments.hpp"

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/json_text.hpp"

namespace cairn::cli {
namespace {

using nlohmann::json;

// The value at a JSON pointer, if it is there and of that type.
template <class Value>
std::optional<Value> value_at(const json& document, const char* pointer) {
  const json::json_pointer place(pointer);
  if (!document.contains(place)) return std::nullopt;
  try {
    return document.at(place).get<Value>();
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

// Nothing if it is no positive semidefinite matrix of six or seven rows.
std::optional<Eigen::MatrixXd> covariance_of_rows(const json& rows) {
  try {
    const auto numbers = rows.get<std::vector<std::vector<double>>>();
    const std::size_t size = numbers.size();
    if (size != 6 && size != 7) return std::nullopt;
    Eigen::MatrixXd matrix(size, size);
    for (std::size_t row = 0; row < size; ++row) {
      if (numbers[row].size() != size) return std::nullopt;
      for (std::size_t column = 0; column < size; ++column) {
        matrix(row, column) = numbers[row][column];
      }
    }
    const bool is_symmetric = (matrix - matrix.transpose()).norm() <= 1e-9 * matrix.norm();
    if (!is_symmetric) return std::nullopt;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> spectrum(matrix, Eigen::EigenvaluesOnly);
    const double most = spectrum.eigenvalues().maxCoeff();
    return spectrum.eigenvalues().minCoeff() >= -1e-9 * most ? std::optional(matrix) : std::nullopt;
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

}  // namespace

std::optional<Matrix4d> matrix_of_rows(const json& rows) {
  try {
    const auto numbers = rows.get<std::array<std::array<double, 4>, 4>>();
    Matrix4d matrix;
    for (int i = 0; i < 16; ++i) {
      matrix(i / 4, i % 4) =
          numbers[static_cast<std::size_t>(i / 4)][static_cast<std::size_t>(i % 4)];
    }
    return matrix;
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

SavedAlignments read_alignments(const std::string& path) {
  constexpr std::string_view kExpected = "what 'cairn align --json' writes";
  const auto refuse = [&](std::string_view what) {
    throw Error(ErrorKind::kInput, path, what, kExpected);
  };
  const std::optional<json> parsed = parse_json<json>(read_file(path), path);
  if (!parsed) refuse("is no JSON");
  const json& document = *parsed;
  const auto results = value_at<json>(document, "/results");
  if (!results || !results->is_array() || results->empty()) {
    refuse("holds no results of an alignment");
  }
  SavedAlignments saved;
  saved.source_path = value_at<std::string>(document, "/inputs/source/path");
  saved.source_hash = value_at<std::string>(document, "/inputs/source/hash");
  saved.min_observations = value_at<std::size_t>(document, "/options/min_observations");
  for (std::size_t i = 0; i < results->size(); ++i) {
    const json& result = (*results)[i];
    const auto rows = value_at<json>(result, "/target_from_source");
    if (!rows) refuse(fmt::format("result {} has no target_from_source", i));
    SavedAlignment alignment;
    alignment.confidence = value_at<std::string>(result, "/confidence").value_or("unnamed");
    alignment.status = value_at<std::string>(result, "/status").value_or("unknown");
    alignment.length_unit = value_at<std::string>(result, "/length_unit").value_or("metres");
    if (!rows->is_null()) {
      const auto matrix = matrix_of_rows(*rows);
      if (!matrix) refuse(fmt::format("result {}: target_from_source is no 4x4 matrix", i));
      try {
        const json scale = value_at<json>(result, "/scale").value_or(nullptr);
        if (!scale.is_null() && !scale.is_number()) {
          refuse(fmt::format("result {}: scale is no number", i));
        }
        alignment.target_from_source =
            Similarity3(scale.is_null() ? 1.0 : scale.get<double>(), Rigid3::from_matrix(*matrix));
      } catch (const Error& error) {
        throw Error(ErrorKind::kInput, fmt::format("{}: result {}", path, i), error.what(), "");
      }
    }
    const json covariance = value_at<json>(result, "/covariance").value_or(nullptr);
    if (!covariance.is_null()) {
      alignment.covariance = covariance_of_rows(covariance);
      if (!alignment.covariance) {
        refuse(
            fmt::format("result {}: covariance is no positive semidefinite 6x6 or 7x7 matrix", i));
      }
    }
    saved.results.push_back(std::move(alignment));
  }
  return saved;
}

}  // namespace cairn::cli

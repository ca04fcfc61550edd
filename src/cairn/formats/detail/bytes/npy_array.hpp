// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/formats/detail/bytes/scalars.hpp"

// NumPy arrays in .npy format (NEP 1).
namespace cairn::detail {

inline constexpr std::string_view kNpyMagic = "\x93NUMPY";

/// Header of an array.
struct NpyHeader {
  std::string type;  ///< e.g. "<f8"
  bool is_fortran = false;
  std::vector<std::uint64_t> shape;
};

/// @param dictionary the header's Python dictionary, which follows the sizes
/// @param where place for error messages
/// @throws Error (input) for an invalid header
NpyHeader parse_npy_header(std::string_view dictionary, const std::string& where);

/// A view of an array in memory; the memory must outlive the view.
class NpyArray {
 public:
  /// @throws Error (input) for a damaged array, a type other than f4 f8 i1-i8 u1-u8 b1 S U, or one not stored
  ///         little-endian in C order
  NpyArray(std::string_view bytes, std::string where);

  const std::vector<std::uint64_t>& shape() const { return header_.shape; }
  /// Product of the shape.
  std::uint64_t size() const { return size_; }
  bool is_text() const { return kind_ == 'S' || kind_ == 'U'; }
  /// 'f', 'i', 'u', 'b', 'S' or 'U', and the bytes per element.
  char kind() const { return kind_; }
  std::size_t item_size() const { return item_; }
  std::string_view data() const { return data_; }
  const std::string& where() const { return where_; }

  double number(std::uint64_t index) const;
  /// @throws Error (input) for a number that is negative or not whole
  std::uint64_t whole(std::uint64_t index) const;
  std::string text() const;

 private:
  std::string where_;
  NpyHeader header_;
  char kind_ = 'f';
  std::size_t item_ = 8;
  std::optional<ScalarType> number_;  // std::nullopt for texts
  std::uint64_t size_ = 1;
  std::string_view data_;
};

/// The .npy file of an array in C order.
/// @param data little-endian
std::string npy_bytes(std::string_view type, const std::vector<std::uint64_t>& shape,
                      std::string_view data);

}  // namespace cairn::detail

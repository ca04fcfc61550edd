// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

// The types of numbers in files, by which PLY, PCD, NumPy and kapture store them.
namespace cairn::detail {

enum class ScalarType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64,
};

struct Scalar {
  ScalarType type;
  char kind;  ///< as in NumPy: 'i' (signed), 'u' (unsigned), 'f'; PCD writes it as a capital
  std::size_t size;
  std::string_view
      c_name;  ///< PLY's first name, which every reader knows; empty where PLY has no such type
  std::string_view name;  ///< NumPy's name, and PLY's second one
};

inline constexpr std::array<Scalar, 10> kScalars = {{
    {ScalarType::kInt8, 'i', 1, "char", "int8"},
    {ScalarType::kUint8, 'u', 1, "uchar", "uint8"},
    {ScalarType::kInt16, 'i', 2, "short", "int16"},
    {ScalarType::kUint16, 'u', 2, "ushort", "uint16"},
    {ScalarType::kInt32, 'i', 4, "int", "int32"},
    {ScalarType::kUint32, 'u', 4, "uint", "uint32"},
    {ScalarType::kInt64, 'i', 8, "", "int64"},
    {ScalarType::kUint64, 'u', 8, "", "uint64"},
    {ScalarType::kFloat32, 'f', 4, "float", "float32"},
    {ScalarType::kFloat64, 'f', 8, "double", "float64"},
}};

constexpr const Scalar& scalar(ScalarType type) {
  return kScalars[static_cast<std::size_t>(type)];
}
constexpr std::size_t size_of(ScalarType type) {
  return scalar(type).size;
}
constexpr bool is_integer(ScalarType type) {
  return scalar(type).kind != 'f';
}
/// The type of this kind and size; std::nullopt if there is none.
std::optional<ScalarType> scalar_type(char kind, std::size_t size);

/// Calls `function` with the C++ type of a scalar as template argument.
template <class Function>
decltype(auto) with_type(ScalarType type, Function&& function) {
  switch (type) {
    case ScalarType::kInt8:
      return function.template operator()<std::int8_t>();
    case ScalarType::kUint8:
      return function.template operator()<std::uint8_t>();
    case ScalarType::kInt16:
      return function.template operator()<std::int16_t>();
    case ScalarType::kUint16:
      return function.template operator()<std::uint16_t>();
    case ScalarType::kInt32:
      return function.template operator()<std::int32_t>();
    case ScalarType::kUint32:
      return function.template operator()<std::uint32_t>();
    case ScalarType::kInt64:
      return function.template operator()<std::int64_t>();
    case ScalarType::kUint64:
      return function.template operator()<std::uint64_t>();
    case ScalarType::kFloat32:
      return function.template operator()<float>();
    case ScalarType::kFloat64:
      break;
  }
  return function.template operator()<double>();
}

/// Loads a number of either byte order.
template <class Number>
Number load_scalar(const char* bytes, bool is_big_endian = false) {
  std::array<char, sizeof(Number)> copy;
  std::memcpy(copy.data(), bytes, copy.size());
  if (is_big_endian != (std::endian::native == std::endian::big)) {
    for (std::size_t i = 0; i < copy.size() / 2; ++i) std::swap(copy[i], copy[copy.size() - 1 - i]);
  }
  return std::bit_cast<Number>(copy);
}

/// Stores a number in either byte order.
template <class Number>
void store_scalar(char* bytes, Number value, bool is_big_endian = false) {
  const auto stored = load_scalar<Number>(reinterpret_cast<const char*>(&value), is_big_endian);
  std::memcpy(bytes, &stored, sizeof stored);
}

template <class Number>
void append_scalar(std::string& out, Number value) {
  std::array<char, sizeof value> bytes;
  store_scalar(bytes.data(), value);
  out.append(bytes.data(), bytes.size());
}

/// The number as a double; an integer of 64 bits may be rounded.
double load_number(ScalarType type, const char* bytes, bool is_big_endian = false);

}  // namespace cairn::detail

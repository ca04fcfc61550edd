// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/npy_array.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn::detail {
namespace {

[[noreturn]] void refuse(const std::string& where, std::string_view what,
                         std::string_view expected) {
  throw Error(ErrorKind::kInput, where, what, expected);
}

// The value after a key: a word, a quoted text, or a tuple.
std::string_view value_of(std::string_view dictionary, std::string_view key) {
  const std::size_t place = dictionary.find(key);
  if (place == std::string_view::npos) return {};
  dictionary.remove_prefix(place + key.size());
  const std::size_t colon = dictionary.find(':');
  if (colon == std::string_view::npos) return {};
  dictionary = trimmed(dictionary.substr(colon + 1));
  const bool is_tuple = dictionary.starts_with('(');
  const std::size_t end = dictionary.find_first_of(is_tuple ? ")" : ",}");
  if (end == std::string_view::npos) return {};
  return trimmed(dictionary.substr(0, is_tuple ? end + 1 : end));
}

}  // namespace

NpyHeader parse_npy_header(std::string_view dictionary, const std::string& where) {
  NpyHeader header;
  const std::string_view type = value_of(dictionary, "'descr'");
  if (type.size() < 3 || type.front() != '\'' || type.back() != '\'') {
    refuse(where + ": descr", printable(type) + " is no simple type", "a type such as '<f8'");
  }
  header.type = type.substr(1, type.size() - 2);
  const std::string_view order = value_of(dictionary, "'fortran_order'");
  if (order != "False" && order != "True") {
    refuse(where + ": fortran_order", printable(order), "False or True");
  }
  header.is_fortran = order == "True";
  const std::string_view shape = value_of(dictionary, "'shape'");
  if (shape.size() < 2 || shape.front() != '(')
    refuse(where + ": shape", printable(shape), "a tuple");
  std::string_view rest = shape.substr(1, shape.size() - 2);
  while (!trimmed(rest).empty()) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const auto size = parse_unsigned(trimmed(rest.substr(0, comma)));
    if (!size || header.shape.size() == 8) refuse(where + ": shape", printable(shape), "sizes");
    header.shape.push_back(*size);
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  return header;
}

NpyArray::NpyArray(std::string_view bytes, std::string where) : where_(std::move(where)) {
  constexpr std::size_t kSizes = 8;  // magic and version
  if (!bytes.starts_with(kNpyMagic) || bytes.size() < kSizes + 4) {
    refuse(where_, "is no array of NumPy", "the bytes of an .npy file");
  }
  const auto byte = [&](std::size_t i) {
    return std::size_t{static_cast<unsigned char>(bytes[i])};
  };
  const bool is_short = byte(6) < 2;
  std::size_t length = byte(8) | byte(9) << 8;
  if (!is_short) length |= byte(10) << 16 | byte(11) << 24;
  const std::size_t begin = kSizes + (is_short ? 2 : 4);
  if (length > bytes.size() - begin) {
    refuse(where_,
           fmt::format("its header has {} bytes, but {} are left", length, bytes.size() - begin),
           "a whole header");
  }
  header_ = parse_npy_header(bytes.substr(begin, length), where_);
  data_ = bytes.substr(begin + length);
  const std::string_view type = header_.type;
  const auto item = type.size() > 2 ? parse_unsigned(type.substr(2)) : std::nullopt;
  kind_ = type.size() > 2 ? type[1] : '?';
  number_ = item ? scalar_type(kind_ == 'b' ? 'u' : kind_, *item) : std::nullopt;
  const bool is_number = number_ && (kind_ != 'b' || *item == 1);
  const bool is_known = is_number || (item && *item <= 65536 && is_text());
  const bool is_little = type.front() == '<' || type.front() == '|';
  if (!is_known || !is_little) {
    refuse(where_ + ": descr", printable(type) + " is no type that Cairn reads",
           "'<f4', '<f8', integers or '|S' texts, little-endian");
  }
  item_ = static_cast<std::size_t>(kind_ == 'U' ? 4 * *item : *item);
  if (header_.is_fortran && header_.shape.size() > 1) {
    refuse(where_ + ": fortran_order", "True", "False: numpy.ascontiguousarray makes it so");
  }
  for (const std::uint64_t size : header_.shape) {
    if (size != 0 && size_ > (std::uint64_t{1} << 48) / size) {
      refuse(where_ + ": shape", "is too large", "as many numbers as there are bytes for");
    }
    size_ *= size;
  }
  if (size_ * item_ != data_.size()) {
    refuse(where_,
           fmt::format("({}) numbers of {} bytes in {} bytes", fmt::join(header_.shape, ", "),
                       item_, data_.size()),
           "as many bytes as the shape says");
  }
}

double NpyArray::number(std::uint64_t index) const {
  if (!number_) refuse(where_, "is a text", "numbers");
  return load_number(*number_, data_.data() + index * item_);
}

std::uint64_t NpyArray::whole(std::uint64_t index) const {
  const double value = number(index);
  constexpr double kMost = 9007199254740992.0;  // 2^53, which integers may exceed
  const bool fits = is_integer(*number_) || value <= kMost;
  if (!(value >= 0.0) || !fits || value != std::floor(value)) {
    refuse(where_, fmt::format("entry {} is {}", index, value), "a whole number, 0 or more");
  }
  return with_type(*number_, [&]<class Number>() {
    return static_cast<std::uint64_t>(load_scalar<Number>(data_.data() + index * item_));
  });
}

std::string NpyArray::text() const {
  if (!is_text() || size_ != 1) refuse(where_, "is no single text", "a text");
  std::string text;
  const std::size_t step = kind_ == 'U' ? 4 : 1;
  for (std::size_t i = 0; i < item_ && data_[i] != '\0'; i += step) text += data_[i];
  return text;
}

std::string npy_bytes(std::string_view type, const std::vector<std::uint64_t>& shape,
                      std::string_view data) {
  std::string dictionary =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}{}), }}", type,
                  fmt::join(shape, ", "), shape.size() == 1 ? "," : "");
  // The data start at a multiple of 64.
  constexpr std::size_t kBefore = 10;
  dictionary.append(63 - (kBefore + dictionary.size()) % 64, ' ');
  dictionary += '\n';
  std::string bytes(kNpyMagic);
  bytes += '\x01';
  bytes += '\0';
  bytes += static_cast<char>(dictionary.size() & 0xffU);
  bytes += static_cast<char>(dictionary.size() >> 8);
  bytes += dictionary;
  bytes += data;
  return bytes;
}

}  // namespace cairn::detail

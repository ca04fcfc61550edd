// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/bytes/record_reader.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 20;

}  // namespace

void ReadingProgress::advance(std::uint64_t bytes, const std::string& source) {
  read_ += bytes;
  if (execution_.stop.stop_requested()) {
    throw Error(ErrorKind::kCancelled, source, "reading was cancelled", "");
  }
  if (execution_.progress && total_ > 0) {
    execution_.progress(std::min(1.0, static_cast<double>(read_) / static_cast<double>(total_)));
  }
}

BinaryRecords::BinaryRecords(ByteSource& source, ReadingProgress& progress)
    : source_(source), progress_(progress), buffer_(block_size_for(source)) {}

bool BinaryRecords::fill(std::size_t least) {
  if (end_ - begin_ >= least) return true;
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
            buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
  end_ -= begin_;
  begin_ = 0;
  if (buffer_.size() < least) buffer_.resize(std::max(least, 2 * buffer_.size()));
  while (end_ < least) {
    const std::size_t more = source_.read(buffer_.data() + end_, buffer_.size() - end_);
    if (more == 0) return false;
    end_ += more;
    progress_.advance(more, source_.name());
  }
  return true;
}

template <class Number>
Number BinaryRecords::number(std::string_view field) {
  static_assert(std::endian::native == std::endian::little);
  field_offset_ = offset_;
  if (!fill(sizeof(Number))) {
    refuse(field, fmt::format("the file ends after {} bytes", offset_ + (end_ - begin_)),
           fmt::format("{} bytes more", sizeof(Number)));
  }
  Number value;
  std::memcpy(&value, buffer_.data() + begin_, sizeof value);
  begin_ += sizeof value;
  offset_ += sizeof value;
  return value;
}

template std::uint8_t BinaryRecords::number(std::string_view);
template std::uint32_t BinaryRecords::number(std::string_view);
template std::int32_t BinaryRecords::number(std::string_view);
template std::uint64_t BinaryRecords::number(std::string_view);
template float BinaryRecords::number(std::string_view);
template double BinaryRecords::number(std::string_view);

std::string BinaryRecords::text(std::string_view field) {
  field_offset_ = offset_;
  std::string text;
  for (;;) {
    if (!fill(1)) refuse(field, "the file ends within a text", "a zero byte behind it");
    const char* const begin = buffer_.data() + begin_;
    const char* const end = buffer_.data() + end_;
    const char* const zero = std::find(begin, end, '\0');
    text.append(begin, zero);
    const auto taken = static_cast<std::size_t>(zero - begin) + (zero != end ? 1 : 0);
    begin_ += taken;
    offset_ += taken;
    if (zero != end) return text;
  }
}

std::uint64_t BinaryRecords::count(std::string_view field, std::uint64_t least_bytes) {
  const std::uint64_t count = u64(field);
  if (const auto left = bytes_left(); left && count > *left / least_bytes) {
    refuse(field, fmt::format("{} records, but {} bytes are left", count, *left),
           fmt::format("at least {} bytes a record", least_bytes));
  }
  return count;
}

std::size_t BinaryRecords::room_for(std::uint64_t count) const {
  return source_.size() ? static_cast<std::size_t>(count) : 0;
}

std::optional<std::uint64_t> BinaryRecords::bytes_left() const {
  const auto size = source_.size();
  return size ? std::optional(*size - std::min(*size, offset_)) : size;
}

void BinaryRecords::expect_end() {
  field_offset_ = offset_;
  if (fill(1)) refuse("end", "there are bytes behind the last record", "the end of the file");
}

std::string BinaryRecords::place() const {
  return fmt::format("{}: byte {}", source_.name(), field_offset_);
}

void BinaryRecords::refuse(std::string_view field, std::string_view what,
                           std::string_view expected) const {
  throw Error(ErrorKind::kInput, fmt::format("{}: {}", place(), field), what, expected);
}

TextRecords::TextRecords(ByteSource& source, ReadingProgress& progress, Separator separator,
                         bool logs_cut_line)
    : source_(source),
      progress_(progress),
      lines_(source, logs_cut_line ? progress.log() : LogSink()),
      separator_(separator) {}

bool TextRecords::next_line() {
  const auto line = lines_.next();
  if (lines_.bytes_read() - reported_ >= kBlock || !line) {
    progress_.advance(lines_.bytes_read() - reported_, source_.name());
    reported_ = lines_.bytes_read();
  }
  line_ = line.value_or(std::string_view());
  at_end_ = !line;
  return line.has_value();
}

bool TextRecords::next_record() {
  while (next_line()) {
    const std::string_view text = trimmed(line_);
    if (!text.empty() && text.front() != '#') return true;
  }
  return false;
}

std::string_view TextRecords::word(std::string_view field) {
  if (!has_word()) refuse(field, "the line ends before it", "one word more");
  if (separator_ == Separator::kBlanks) {
    const std::size_t end = std::min(line_.find_first_of(kBlanks), line_.size());
    const std::string_view word = line_.substr(0, end);
    line_.remove_prefix(end);
    return word;
  }
  const std::size_t end = line_.find(static_cast<char>(separator_));
  const std::string_view word = line_.substr(0, end);
  at_end_ = end == std::string_view::npos;
  line_.remove_prefix(at_end_ ? line_.size() : end + 1);
  return separator_ == Separator::kComma ? trimmed(word) : word;
}

bool TextRecords::has_word() {
  if (separator_ != Separator::kBlanks) return !at_end_;
  line_ = trimmed(line_);
  return !line_.empty();
}

std::string_view TextRecords::rest() {
  at_end_ = true;
  return trimmed(std::exchange(line_, std::string_view()));
}

double TextRecords::number(std::string_view field) {
  const auto value = optional_number(field);
  if (!value) refuse(field, "'' is not a number", "a finite decimal number");
  return *value;
}

std::optional<double> TextRecords::optional_number(std::string_view field) {
  const std::string_view text = trimmed(word(field));
  if (text.empty()) return std::nullopt;
  const auto value = parse_number(text);
  if (!value) refuse(field, printable(text) + " is not a number", "a finite decimal number");
  return value;
}

double TextRecords::number_or_nan(std::string_view field) {
  const std::string_view text = word(field);
  if (const auto value = parse_number(text)) return *value;
  for (const std::string_view unknown : {"nan", "-nan", "inf", "-inf", "NaN", "Infinity"}) {
    if (text == unknown) return std::numeric_limits<double>::quiet_NaN();
  }
  refuse(field, printable(text) + " is not a number", "a decimal number, or nan");
}

std::uint64_t TextRecords::unsigned_number(std::string_view field, std::uint64_t most) {
  const std::string_view text = word(field);
  const auto value = parse_unsigned(text);
  if (!value || *value > most) {
    refuse(field, printable(text) + " is not a whole number",
           fmt::format("a whole number from 0 to {}", most));
  }
  return *value;
}

std::int64_t TextRecords::signed_number(std::string_view field) {
  const std::string_view text = word(field);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    refuse(field, printable(text) + " is not a whole number", "a whole number");
  }
  return value;
}

void TextRecords::expect_line_end() {
  if (has_word()) refuse("end of the line", printable(line_) + " stands there", "no more words");
}

std::string TextRecords::place() const {
  return fmt::format("{}:{}", source_.name(), lines_.line_number());
}

void TextRecords::refuse(std::string_view field, std::string_view what,
                         std::string_view expected) const {
  throw Error(ErrorKind::kInput, fmt::format("{}: {}", place(), field), what, expected);
}

}  // namespace cairn::detail

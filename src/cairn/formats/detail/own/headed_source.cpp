// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/own/headed_source.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/formats/detail/losses.hpp"

namespace cairn::detail {
namespace {

constexpr std::size_t kHeaderBlock = std::size_t{1} << 20;

}  // namespace

HeadedSource::HeadedSource(ByteSource& source, const Execution& execution)
    : source_(source), execution_(execution), buffer_(block_size_for(source)) {}

std::string_view HeadedSource::header_line(std::string_view expected) {
  // Only lines that fit into one block, which bounds the memory.
  constexpr std::size_t kLongest = kHeaderBlock - 1;
  std::string_view bytes = peek(1);
  for (;;) {
    const std::size_t size = bytes.find('\n');
    if (size <= kLongest) {
      ++header_lines_;
      consume(size + 1);
      return trimmed(bytes.substr(0, size));
    }
    const std::size_t known = bytes.size();
    if (known <= kLongest) bytes = peek(known + 1);
    if (bytes.size() == known) break;
  }
  ++header_lines_;
  reject_if(bytes.size() > kLongest, header_place(), "a header line of more than a megabyte",
            expected);
  throw Error(ErrorKind::kInput, header_place(), "the file ends within its header", expected);
}

std::string HeadedSource::header_place() const {
  return fmt::format("{}:{}", name(), header_lines_);
}

std::string_view HeadedSource::peek(std::size_t least) {
  while (end_ - begin_ < least) {
    if (begin_ > 0) {
      std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
      end_ -= begin_;
      begin_ = 0;
    }
    // Doubles with the bytes that arrive, independent of the requested number.
    if (end_ == buffer_.size()) buffer_.resize(2 * buffer_.size());
    const std::size_t count = read_more(buffer_.data() + end_, buffer_.size() - end_);
    if (count == 0) break;
    end_ += count;
  }
  return {buffer_.data() + begin_, end_ - begin_};
}

void HeadedSource::consume(std::size_t count) {
  begin_ += count;
  offset_ += count;
}

std::uint64_t HeadedSource::skip(std::uint64_t count) {
  std::uint64_t left = count;
  while (left > 0) {
    const std::size_t here =
        static_cast<std::size_t>(std::min<std::uint64_t>(peek(1).size(), left));
    if (here == 0) break;
    consume(here);
    left -= here;
  }
  return count - left;
}

std::optional<std::uint64_t> HeadedSource::remaining() const {
  const auto size = source_.size();
  if (!size) return std::nullopt;
  return *size > offset_ ? *size - offset_ : 0;
}

void HeadedSource::expect_end() {
  // Editors and some writers end a file with a newline.
  constexpr std::size_t kMostFilling = std::size_t{1} << 16;
  constexpr std::string_view kFilling = "\n\r\t ";
  const std::string_view rest = peek(kMostFilling + 1);
  if (rest.empty()) return;
  if (rest.size() <= kMostFilling && rest.find_first_not_of(kFilling) == std::string_view::npos) {
    log_remark(
        execution_.log, fmt::format("{}: byte {}", name(), offset_),
        fmt::format("{} bytes after the data that the header announces; left out", rest.size()),
        RemarkKind::kLoss);
    return;
  }
  throw Error(ErrorKind::kInput, fmt::format("{}: byte {}", name(), offset_),
              "more data than the header announces", "the file to end here");
}

std::size_t HeadedSource::read(char* buffer, std::size_t capacity) {
  std::size_t count = end_ - begin_;
  if (count > 0) {
    count = std::min(count, capacity);
    std::memcpy(buffer, buffer_.data() + begin_, count);
    begin_ += count;
  } else {
    count = read_more(buffer, capacity);
  }
  offset_ += count;
  return count;
}

void HeadedSource::rewind() {
  source_.rewind();
  begin_ = end_ = 0;
  offset_ = received_ = header_lines_ = 0;
}

std::size_t HeadedSource::read_more(char* buffer, std::size_t capacity) {
  if (received_ >= next_report_) {
    constexpr std::uint64_t kReportEvery = std::uint64_t{1} << 22;
    next_report_ = received_ + kReportEvery;
    if (execution_.stop.stop_requested()) {
      throw Error(ErrorKind::kCancelled, name(), "reading was cancelled", "");
    }
    if (const auto size = source_.size(); execution_.progress && size && *size > 0) {
      execution_.progress(
          std::min(1.0, static_cast<double>(received_) / static_cast<double>(*size)));
    }
  }
  const std::size_t count = source_.read(buffer, capacity);
  received_ += count;
  return count;
}

TextRows::TextRows(HeadedSource& source, LogSink log)
    : source_(source), header_lines_(source.header_lines()), lines_(source), log_(std::move(log)) {}

std::optional<std::string_view> TextRows::next_filled() {
  while (const auto line = lines_.next()) {
    const std::string_view row = trimmed(*line);
    if (!row.empty()) return row;
  }
  return std::nullopt;
}

std::string_view TextRows::next(std::uint64_t done, std::uint64_t count, std::string_view rows) {
  const auto row = next_filled();
  const auto where = [&] { return fmt::format("{}:{}", source_.name(), line_number()); };
  if (!row) {
    throw Error(ErrorKind::kInput, where(),
                fmt::format("the file ends after {} of {} {}", done, count, rows),
                "a line for each");
  }
  if (!lines_.line_was_terminated() && log_) {
    log_({fmt::format("{}: the last line does not end; its last number may have been cut off",
                      where()),
          RemarkKind::kLoss});
  }
  return *row;
}

void TextRows::expect_end() {
  const auto row = next_filled();
  if (!row) return;
  throw Error(ErrorKind::kInput, fmt::format("{}:{}", source_.name(), line_number()),
              fmt::format("{} is more than the header announces", printable(*row)),
              "the file to end here");
}

}  // namespace cairn::detail

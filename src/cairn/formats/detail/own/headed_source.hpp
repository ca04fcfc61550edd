// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"

namespace cairn::detail {

/// A source with a text header followed by a body. Handles progress and cancellation.
class HeadedSource final : public ByteSource {
 public:
  HeadedSource(ByteSource& source, const Execution& execution);

  /// The next line of the header, without line end and surrounding blanks. Valid until the next call.
  /// @throws Error (input) at the end of the source, or if the line is too long
  std::string_view header_line(std::string_view expected);
  /// "file:line" of the last header line returned.
  std::string header_place() const;
  std::uint64_t header_lines() const { return header_lines_; }

  /// The next bytes: at least `least`, fewer only at the end. Valid until the next call.
  std::string_view peek(std::size_t least);
  void consume(std::size_t count);
  /// Skips bytes. @return the number of bytes skipped
  std::uint64_t skip(std::uint64_t count);
  /// Bytes returned so far.
  std::uint64_t offset() const { return offset_; }
  /// Bytes left; std::nullopt if the source has no size.
  std::optional<std::uint64_t> remaining() const;
  /// @throws Error (input) unless all bytes were read, or the rest consists of line ends, blanks and zeros. Such a
  ///         rest is logged as a loss
  void expect_end();

  const std::string& name() const override { return source_.name(); }
  std::optional<std::uint64_t> size() const override { return source_.size(); }
  std::size_t read(char* buffer, std::size_t capacity) override;
  void rewind() override;

 private:
  std::size_t read_more(char* buffer, std::size_t capacity);

  ByteSource& source_;
  const Execution& execution_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t offset_ = 0;
  std::uint64_t received_ = 0;
  std::uint64_t next_report_ = 0;
  std::uint64_t header_lines_ = 0;
};

/// The lines of a text body that are not blank.
class TextRows {
 public:
  /// @param log receives a loss if the last row has no line end
  TextRows(HeadedSource& source, LogSink log);

  /// The next row, after `done` of `count` rows.
  /// @throws Error (input) if there is none
  std::string_view next(std::uint64_t done, std::uint64_t count, std::string_view rows);
  std::uint64_t line_number() const { return header_lines_ + lines_.line_number(); }
  /// @throws Error (input) if there is another row
  void expect_end();

 private:
  std::optional<std::string_view> next_filled();

  const HeadedSource& source_;
  std::uint64_t header_lines_;
  LineReader lines_;
  LogSink log_;
};

}  // namespace cairn::detail

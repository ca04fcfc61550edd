// SPDX-License-Identifier: BSD-3-Clause
#include "support/console.hpp"

#include <algorithm>
#include <cstdio>

#include <unistd.h>

#include "cairn/core/text.hpp"

namespace cairn::cli {
namespace {

constexpr std::string_view kLayout = "\n\t";  // what our own text is laid out with

}  // namespace

void print_raw(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
}

void print_error(std::string_view text) {
  const std::string plain = plain_text(text, kLayout);
  std::fwrite(plain.data(), 1, plain.size(), stderr);
}

namespace {

// On a terminal, one line over the last.
void draw(std::string_view line) {
  std::fwrite("\r\x1b[K", 1, 4, stderr);
  std::fwrite(line.data(), 1, line.size(), stderr);
  std::fflush(stderr);
}

using Clock = std::chrono::steady_clock;

class ProgressBar {
 public:
  explicit ProgressBar(std::string label) : label_(std::move(label)) {}
  ~ProgressBar() {
    if (shown_) draw({});
  }
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void update(double share, const std::string& detail) {
    const auto now = Clock::now();
    if (now - start_ < std::chrono::seconds(1)) return;
    if (shown_ && now - last_ < std::chrono::milliseconds(100)) return;
    constexpr int kWidth = 30;
    const double clamped = std::clamp(share, 0.0, 1.0);
    const int filled = static_cast<int>(clamped * kWidth);
    draw(plain_text(fmt::format("{} [{}{}] {:3.0f} %{}{}", label_, std::string(filled, '#'),
                                std::string(kWidth - filled, '.'), 100.0 * clamped,
                                detail.empty() ? "" : "  ", detail)));
    shown_ = true;
    last_ = now;
  }

 private:
  std::string label_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point last_;
  bool shown_ = false;
};

}  // namespace

Console::Console(bool quiet, Answer answer) : quiet_(quiet), answer_(answer) {}

void Console::print(std::string_view text) const {
  if (answer_ == Answer::kToStdout) print_raw(plain_text(text, kLayout));
  if (answer_ == Answer::kToStderr && !quiet_) print_error(text);
}

void Console::remark(std::string_view text) const {
  if (quiet_) return;
  if (::isatty(STDERR_FILENO) != 0) draw({});  // over a progress bar
  print_error(fmt::format("cairn: {}\n", text));
}

LogSink Console::log() const {
  return [console = *this](std::string_view text) { console.remark(text); };
}

Progress Console::progress(const std::string& label) const {
  auto show = detailed_progress(label);
  if (!show) return {};
  return [show = std::move(show)](double share) { show(share, {}); };
}

std::function<void(double, const std::string&)> Console::detailed_progress(
    const std::string& label) const {
  if (quiet_ || ::isatty(STDERR_FILENO) == 0) return {};
  return [bar = std::make_shared<ProgressBar>(label)](double share, const std::string& detail) {
    bar->update(share, detail);
  };
}

std::string fixed(double value, int digits) {
  const std::string text = fmt::format("{:.{}f}", value, digits);
  const bool is_zero = text.find_first_not_of("-0.") == std::string::npos;
  return is_zero && text.starts_with('-') ? text.substr(1) : text;
}

Table::Table(std::vector<std::string> header) {
  rows_.push_back(std::move(header));
}

void Table::add_row(std::vector<std::string> cells) {
  rows_.push_back(std::move(cells));
}

std::string Table::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += i == 0 ? fmt::format("{:<{}}", row[i], widths[i])
                     : fmt::format("  {:>{}}", row[i], widths[i]);
    }
    text += '\n';
  }
  return text;
}

}  // namespace cairn::cli

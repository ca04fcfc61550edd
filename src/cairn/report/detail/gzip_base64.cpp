// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/detail/gzip_base64.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include <zlib.h>

namespace cairn::report::detail {
namespace {

constexpr std::string_view kDigits =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr int kLevel = 4;  // lists of matches come out as small as at 6, in a quarter of the time
constexpr int kGzip = 16;  // added to the window's size it asks zlib for gzip's header

}  // namespace

struct GzipBase64::State {
  explicit State(const ByteSink& to) : sink(to), compressed(std::size_t{1} << 16) {
    if (deflateInit2(&stream, kLevel, Z_DEFLATED, MAX_WBITS + kGzip, MAX_MEM_LEVEL,
                     Z_DEFAULT_STRATEGY) != Z_OK) {
      throw std::bad_alloc();
    }
  }
  ~State() { deflateEnd(&stream); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  void deflate_all(int flush) {
    do {
      stream.next_out = compressed.data();
      stream.avail_out = static_cast<uInt>(compressed.size());
      deflate(&stream, flush);  // cannot fail: the stream is valid and has room to write to
      encode(compressed.size() - stream.avail_out);
    } while (stream.avail_out == 0);
  }

  // Takes the first `count` bytes of `compressed`; up to two wait for the next piece.
  void encode(std::size_t count) {
    waiting.insert(waiting.end(), compressed.begin(),
                   compressed.begin() + static_cast<std::ptrdiff_t>(count));
    const std::size_t whole = waiting.size() / 3 * 3;
    text.clear();
    for (std::size_t i = 0; i < whole; i += 3) append(waiting[i], waiting[i + 1], waiting[i + 2]);
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(whole));
    if (!text.empty()) sink(text);
  }

  void append(std::uint8_t a, std::uint8_t b, std::uint8_t c) {
    const std::uint32_t bits = std::uint32_t{a} << 16U | std::uint32_t{b} << 8U | c;
    for (const unsigned shift : {18U, 12U, 6U, 0U}) text += kDigits[bits >> shift & 63U];
  }

  const ByteSink& sink;
  z_stream stream = {};
  std::vector<std::uint8_t> compressed;
  std::vector<std::uint8_t> waiting;
  std::string text;
};

GzipBase64::GzipBase64(const ByteSink& sink) : state_(std::make_unique<State>(sink)) {}
GzipBase64::~GzipBase64() = default;

void GzipBase64::write(std::string_view bytes) {
  z_stream& stream = state_->stream;
  while (!bytes.empty()) {
    const std::size_t count = std::min<std::size_t>(bytes.size(), std::numeric_limits<uInt>::max());
    // zlib takes what it only reads as not const, too.
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(count);
    state_->deflate_all(Z_NO_FLUSH);
    bytes.remove_prefix(count);
  }
}

void GzipBase64::finish() {
  state_->deflate_all(Z_FINISH);
  std::vector<std::uint8_t>& rest = state_->waiting;
  if (rest.empty()) return;
  const std::size_t padding = 3 - rest.size();
  rest.resize(3, 0);
  state_->text.clear();
  state_->append(rest[0], rest[1], rest[2]);
  state_->text.replace(4 - padding, padding, padding, '=');
  state_->sink(state_->text);
}

}  // namespace cairn::report::detail

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <zlib.h>

namespace cairn::testing {

/// The least page that a report can be written into.
inline constexpr std::string_view kStubPage =
    "<!DOCTYPE html>\n<html><head><title><!--CAIRN:TITLE--></title></head>\n"
    "<body><!--CAIRN:DATA--></body></html>\n";

inline std::string from_base64(std::string_view text) {
  static constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  if (text.size() % 4 != 0) throw std::runtime_error("base64 of a wrong length");
  std::string bytes;
  std::uint32_t bits = 0;
  int count = 0;
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) throw std::runtime_error("no base64");
    bits = bits << 6U | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes += static_cast<char>(bits >> count & 0xffU);
    }
  }
  return bytes;
}

inline std::string gunzipped(const std::string& bytes) {
  z_stream stream = {};
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  constexpr int kGzip = 16;
  if (inflateInit2(&stream, MAX_WBITS + kGzip) != Z_OK) throw std::runtime_error("inflateInit2");
  std::string result;
  std::vector<char> block(std::size_t{1} << 16);
  int status = Z_OK;
  while (status == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(block.data());
    stream.avail_out = static_cast<uInt>(block.size());
    status = inflate(&stream, Z_NO_FLUSH);
    result.append(block.data(), block.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (status != Z_STREAM_END || stream.avail_in != 0) throw std::runtime_error("no whole gzip");
  return result;
}

/// What a report's page holds, as a reader sees it.
struct ReportPage {
  nlohmann::json document;
  std::string buffers;

  explicit ReportPage(std::string_view html)
      : document(nlohmann::json::parse(element(html, "cairn-report"))),
        buffers(element(html, "cairn-buffers")) {}

  /// The bytes of an element as they stand in the page: base64.
  static std::string_view encoded(std::string_view html, std::string_view id) {
    const std::size_t name = html.find("id=\"" + std::string(id) + "\"");
    if (name == std::string_view::npos) throw std::runtime_error("the page lacks an element");
    const std::size_t begin = html.find('>', name) + 1;
    return html.substr(begin, html.find('<', begin) - begin);
  }

  /// The numbers that a reference of the document names.
  template <class Number>
  std::vector<Number> numbers(const nlohmann::json& reference, std::string_view type) const {
    if (reference.at("type") != type) {
      throw std::runtime_error("a buffer of type " + reference.at("type").get<std::string>());
    }
    const auto offset = reference.at("offset").get<std::size_t>();
    std::vector<Number> result(reference.at("count").get<std::size_t>());
    if (offset % 8 != 0 || offset + sizeof(Number) * result.size() > buffers.size()) {
      throw std::runtime_error("a buffer out of bounds");
    }
    std::memcpy(result.data(), buffers.data() + offset, sizeof(Number) * result.size());
    return result;
  }

 private:
  static std::string element(std::string_view html, std::string_view id) {
    return gunzipped(from_base64(encoded(html, id)));
  }
};

/// The match of each source landmark in each iteration, as a reader replays them.
inline std::vector<std::vector<std::int32_t>> replayed(const ReportPage& page,
                                                       const nlohmann::json& matches) {
  std::vector<std::vector<std::int32_t>> iterations = {
      page.numbers<std::int32_t>(matches.at("first"), "i32")};
  const auto counts = page.numbers<std::uint32_t>(matches.at("change_counts"), "u32");
  const auto changed = page.numbers<std::uint32_t>(matches.at("changed"), "u32");
  const auto targets = page.numbers<std::int32_t>(matches.at("targets"), "i32");
  std::size_t next = 0;
  for (const std::uint32_t count : counts) {
    std::vector<std::int32_t> current = iterations.back();
    for (std::uint32_t i = 0; i < count; ++i, ++next) {
      current.at(changed.at(next)) = targets.at(next);
    }
    iterations.push_back(std::move(current));
  }
  return iterations;
}

}  // namespace cairn::testing

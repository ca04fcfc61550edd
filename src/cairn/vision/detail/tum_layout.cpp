// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/tum_layout.hpp"

#include <algorithm>
#include <filesystem>
#include <string_view>

#include <fmt/format.h>

#include "cairn/core/detail/time_association.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

namespace cairn::detail {
namespace {

// Whether a path stays within the folder it is relative to.
bool stays_inside(const std::string& file) {
  const std::filesystem::path path(file);
  return path.is_relative() &&
         std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
}

struct NumberedEntry {
  ImageEntry entry;
  std::uint64_t line;
};

NumberedEntry parse_entry(std::string_view line, const std::string& source, std::uint64_t number) {
  const std::string place = fmt::format("{}:{}", source, number);
  const std::string_view time = line.substr(0, line.find_first_of(kBlanks));
  const auto timestamp = parse_number(time);
  reject_if(!timestamp, place + ": field 1 (timestamp)", printable(time) + " is not a number",
            "seconds");
  return {{*timestamp, file_inside(std::string(trimmed(line.substr(time.size()))), place)}, number};
}

}  // namespace

std::string file_inside(std::string file, const std::string& place) {
  reject_if(file.empty(), place + ": field 2 (file)", "missing", "timestamp file");
  reject_if(!stays_inside(file), place + ": field 2 (file)",
            printable(file) + " leaves the sequence's folder", "a path inside it");
  return file;
}

std::vector<ImageEntry> read_image_list(ByteSource& source, const LogSink& log) {
  std::vector<NumberedEntry> entries;
  LineReader lines(source, log);
  while (const auto line = lines.next()) {
    const std::string_view text = trimmed(*line);
    if (text.empty() || text.front() == '#') continue;
    entries.push_back(parse_entry(text, source.name(), lines.line_number()));
  }
  reject_if(entries.empty(), source.name(), "no images", "lines of timestamp and file");
  const auto earlier = [](const NumberedEntry& a, const NumberedEntry& b) {
    return a.entry.timestamp_s < b.entry.timestamp_s;
  };
  if (!std::is_sorted(entries.begin(), entries.end(), earlier)) {
    if (log) log(source.name() + ": the images are not in the order of time; sorted");
    std::stable_sort(entries.begin(), entries.end(), earlier);
  }
  std::vector<ImageEntry> result;
  for (NumberedEntry& entry : entries) {
    reject_if(!result.empty() && result.back().timestamp_s == entry.entry.timestamp_s,
              fmt::format("{}:{}: field 1 (timestamp)", source.name(), entry.line),
              fmt::format("{:.6f} stands above already", entry.entry.timestamp_s),
              "each timestamp once");
    result.push_back(std::move(entry.entry));
  }
  return result;
}

std::vector<std::optional<std::size_t>> associate_images(const std::vector<ImageEntry>& images,
                                                         const std::vector<ImageEntry>& partners,
                                                         double max_difference_s) {
  const auto times = [](const std::vector<ImageEntry>& entries) {
    std::vector<double> result;
    result.reserve(entries.size());
    for (const ImageEntry& entry : entries) result.push_back(entry.timestamp_s);
    return result;
  };
  std::vector<std::optional<std::size_t>> partner_of(images.size());
  for (const auto& [i, j] : associate_times(times(images), times(partners), max_difference_s)) {
    partner_of[i] = j;
  }
  return partner_of;
}

}  // namespace cairn::detail

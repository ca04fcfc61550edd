// SPDX-License-Identifier: BSD-3-Clause
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"

#include "fuzz/imported.hpp"

// The input is a folder: of each file its path on a line behind an ASCII record separator, then its content.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::map<std::string, std::string_view, std::less<>> content;
  std::string_view rest = cairn::testing::text_of(data, size);
  constexpr char kSeparator = '\x1e';
  while (!rest.empty()) {
    if (rest.front() == kSeparator) rest.remove_prefix(1);
    const std::string_view file = rest.substr(0, rest.find(kSeparator));
    rest.remove_prefix(file.size());
    const std::size_t line_end = file.find('\n');
    if (line_end == std::string_view::npos) continue;
    content.emplace(file.substr(0, line_end), file.substr(line_end + 1));
  }
  const cairn::detail::KaptureFiles files{
      "input",
      [&](const std::string& path) -> std::unique_ptr<cairn::ByteSource> {
        const auto found = content.find(path);
        if (found == content.end()) return nullptr;
        return std::make_unique<cairn::MemoryReader>(found->second, "input/" + path);
      },
      [&](const std::string& folder) {
        std::vector<std::string> names;
        for (const auto& [path, bytes] : content) {
          if (!path.starts_with(folder + "/")) continue;
          const std::string below = path.substr(folder.size() + 1);
          const std::string name = below.substr(0, below.find('/'));
          if (names.empty() || names.back() != name) names.push_back(name);
        }
        return names;
      }};
  cairn::testing::expect_read_or_refused([&] { cairn::detail::read_kapture(files); });
  return 0;
}

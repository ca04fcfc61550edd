// SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <string>

#include "cairn/vision/sequence.hpp"

#include "fuzz/file_in_memory.hpp"
#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

// The lists of a sequence's images: of colour and, behind a zero, of depth.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path folder = [] {
    const std::filesystem::path made = cairn::testing::path_in_memory("sequence");
    std::filesystem::create_directory(made);
    return made;
  }();
  const std::string_view all = cairn::testing::text_of(data, size);
  const std::size_t zero = all.find('\0');
  cairn::testing::write_bytes(folder / "rgb.txt", all.substr(0, zero));
  cairn::testing::write_bytes(folder / "depth.txt",
                              zero == std::string_view::npos ? "" : all.substr(zero + 1));
  cairn::testing::expect_read_or_refused(
      [&] {
        const cairn::ImageSequence sequence(folder, {}, [](std::string_view) {});
        double last = -std::numeric_limits<double>::infinity();
        for (const cairn::SequenceFrame& frame : sequence.frames()) {
          if (!(frame.timestamp_s > last)) cairn::testing::abort_because("times do not ascend");
          last = frame.timestamp_s;
          const std::string path = frame.color.lexically_normal().string();
          if (!path.starts_with(folder.string() + "/")) {
            cairn::testing::abort_because("leaves its folder: " + path);
          }
        }
      },
      folder.string());
  return 0;
}

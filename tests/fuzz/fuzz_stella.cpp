// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/foreign_formats.hpp"

#include "fuzz/imported.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
    const cairn::LandmarkMap map = cairn::detail::read_stella(source);
    bool all_have_cameras = !map.frames().cameras.empty();
    for (const auto& camera : map.frames().cameras) {
      all_have_cameras = all_have_cameras && camera.has_value();
    }
    if (all_have_cameras) cairn::detail::write_stella(map, [](std::string_view) {});
  });
  return 0;
}

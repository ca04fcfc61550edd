// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/detail/foreign/feature_files.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "fuzz/imported.hpp"

// Points as text, .npy and .npz, cameras as CSV, features, and what moves a PLY file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (auto* const read : {&cairn::detail::read_plain_points, &cairn::detail::read_npy_points,
                           &cairn::detail::read_npz_points}) {
    cairn::testing::expect_read_or_refused([&] {
      cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
      read(source, {});
    });
  }
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
    cairn::detail::read_realitycapture(source, "/nowhere");
  });
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
    cairn::move_ply(source, {}, [](std::string_view) {});
  });
  const std::string_view text = cairn::testing::text_of(data, size);
  cairn::testing::expect_read_or_refused(
      [&] { cairn::detail::feature_descriptors(text, 128, "input"); });
  cairn::testing::expect_read_or_refused([&] { cairn::detail::feature_positions(text, "input"); });
  return 0;
}

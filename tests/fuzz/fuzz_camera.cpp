// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/formats/camera_file.hpp"

#include "fuzz/imported.hpp"
#include "fuzz/token_mutator.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cairn::testing::expect_read_or_refused([&] {
    cairn::MemoryReader source(cairn::testing::text_of(data, size), "input");
    const cairn::CameraFile file = cairn::read_calibration_file(source);
    if (file.rig) return;
    const std::string text = cairn::camera_file_text(file);
    cairn::MemoryReader written(text, "written");
    const cairn::CameraFile again = cairn::read_camera_file(written);
    if (again.camera != file.camera || again.depth_units_per_metre != file.depth_units_per_metre) {
      cairn::testing::abort_because("written and read back it differs");
    }
    // What is accepted can be projected with.
    if (!cairn::camera_defect(file.camera).empty()) cairn::testing::abort_because("of no use");
    cairn::project(file.camera, {0.1, -0.2, 1.0});
    cairn::unproject(file.camera, {10.0, 20.0});
  });
  return 0;
}

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/camera_file.hpp"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

#include "support/refusal.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

CameraFile parsed_camera(std::string_view text) {
  MemoryReader reader(text, "camera.yaml");
  return read_camera_file(reader);
}

std::string camera_refusal(std::string_view text) {
  return testing::refusal(ErrorKind::kInput, [&] { parsed_camera(text); });
}

TEST(CameraFile, ComesBackAsWritten) {
  for (const char* name : {"fr1", "fr2", "fr3"}) {
    const CameraFile before{tum_camera(name), 5000.0};
    const CameraFile after = parsed_camera(camera_file_text(before));
    EXPECT_EQ(after.camera, before.camera);
    EXPECT_EQ(after.depth_units_per_metre, 5000.0);
    EXPECT_FALSE(after.readout_s);
  }
  const CameraFile rolling = parsed_camera(camera_file_text({tum_camera("fr1"), {}, 0.026}));
  EXPECT_EQ(rolling.readout_s, 0.026);
  EXPECT_FALSE(rolling.depth_units_per_metre);
}

TEST(CameraFile, ReadsWhatAPersonWrites) {
  const CameraFile file = parsed_camera(
      "# my camera\r\nmodel: PINHOLE   # no distortion\n\nwidth:640\nheight : 480\n"
      "parameters: [ 500,501.5 ,320, 240 ]\n");
  EXPECT_EQ(file.camera.model, "PINHOLE");
  EXPECT_EQ(file.camera.width, 640U);
  EXPECT_EQ(file.camera.height, 480U);
  EXPECT_EQ(file.camera.parameters, (std::vector<double>{500, 501.5, 320, 240}));
  EXPECT_FALSE(file.depth_units_per_metre);
}

TEST(CameraFile, NamesLineAndKeyOfWhatItRefuses) {
  EXPECT_THAT(camera_refusal(""), HasSubstr("camera.yaml: camera model"));
  EXPECT_THAT(camera_refusal("model PINHOLE\n"),
              HasSubstr("camera.yaml:1: 'model PINHOLE' is no key"));
  EXPECT_THAT(camera_refusal("\nwidth: 0\n"),
              HasSubstr("camera.yaml:2: width: '0' is no image size"));
  EXPECT_THAT(camera_refusal("height: 99999999999999999999\n"), HasSubstr("height"));
  EXPECT_THAT(camera_refusal("parameters: 1 2 3\n"), HasSubstr("parameters: no list in brackets"));
  EXPECT_THAT(camera_refusal("parameters: [1, x]\n"), HasSubstr("'x' is not a number"));
  EXPECT_THAT(camera_refusal("depth_units_per_metre: -1\n"), HasSubstr("not a positive number"));
  EXPECT_THAT(camera_refusal("readout_s: 0\n"),
              HasSubstr("readout_s: '0' is not a positive number"));
  EXPECT_THAT(camera_refusal("model: PINHOLE\nwidth: 4\nheight: 4\nparameters: [1]\n"),
              HasSubstr("has 4 parameters"));
}

TEST(TumCamera, KnowsTheThreeAndNoOther) {
  EXPECT_EQ(camera_defect(tum_camera("fr1")), "");
  EXPECT_EQ(camera_defect(tum_camera("fr3")), "");
  EXPECT_THROW(tum_camera("fr4"), Error);
}

}  // namespace
}  // namespace cairn

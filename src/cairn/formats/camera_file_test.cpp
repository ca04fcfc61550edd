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

// As the programs write them; each beside what their documents say of its numbers.
constexpr const char* kRosInfo =
    "image_width: 640\nimage_height: 480\ncamera_name: head\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [500, 0, 320,\n         0., 510.0, 240,\n         0, 0, 1]\n"
    "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
    "  data: [0.1, -2.0e-01, 0.001, 0.002, 0]\nrectification_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nprojection_matrix:\n  rows: 3\n  cols: 4\n"
    "  data: [505, 0, 321, 0, 0, 505, 241, 0, 0, 0, 1, 0]\n";
constexpr const char* kSensor =
    "#General sensor definitions.\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
    "  data: [0.0, -1.0, 0.0, 0.1,\n         1.0, 0.0, 0.0, 0.2,\n         0.0, 0.0, 1.0, 0.3,\n"
    "         0.0, 0.0, 0.0, 1.0]\nrate_hz: 20\nresolution: [640, 480]\ncamera_model: pinhole\n"
    "intrinsics: [500, 510, 320, 240] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n"
    "distortion_coefficients: [0.1, -0.2, 0.001, 0.002]\n";
constexpr const char* kChain =
    "cam0:\n  cam_overlaps: [1]\n  camera_model: pinhole\n"
    "  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]\n  distortion_model: radtan\n"
    "  intrinsics: [500, 510, 320, 240]\n  resolution: [640, 480]\n  rostopic: /cam0/image_raw\n"
    "cam1:\n  T_cn_cnm1:\n  - [0.8, 0.0, 0.6, -0.07]\n  - [0.0, 1.0, 0.0, 0.01]\n"
    "  - [-0.6, 0.0, 0.8, 0.02]\n  - [0.0, 0.0, 0.0, 1.0]\n  cam_overlaps: [0]\n"
    "  camera_model: pinhole\n  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]\n"
    "  distortion_model: equidistant\n  intrinsics: [400, 410, 300, 200]\n"
    "  resolution: [640, 480]\n  rostopic: /cam1/image_raw\n";
constexpr const char* kOpenCvPair =
    "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]\nD1: !!opencv-matrix\n   rows: 1\n"
    "   cols: 5\n   dt: d\n   data: [ 1.0000000000000001e-01, -2.0e-01, 0.001,\n       0.002, 0. "
    "]\n"
    "M2: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 400., 0., 300., 0., 410., 200., 0., 0., 1. ]\nD2: !!opencv-matrix\n   rows: 1\n"
    "   cols: 5\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n"
    "%YAML:1.0\n---\nR: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
    "   data: [ 0.8, 0., 0.6, 0., 1., 0., -0.6, 0., 0.8 ]\nT: !!opencv-matrix\n   rows: 3\n"
    "   cols: 1\n   dt: d\n   data: [ -0.07, 0.01, 0.02 ]\n";

std::string with(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

CameraFile parsed_calibration(std::string_view text) {
  MemoryReader reader(text, "calib.yaml");
  return read_calibration_file(reader);
}

StereoRig parsed_pair(std::string_view left, std::string_view right) {
  MemoryReader left_reader(left, "left.yaml");
  MemoryReader right_reader(right, "right.yaml");
  return read_stereo_files(left_reader, right_reader);
}

std::string calibration_refusal(std::string_view text) {
  return testing::refusal(ErrorKind::kInput, [&] { parsed_calibration(text); });
}

const Camera kDistorted{
    CameraId{0}, "OPENCV", 640, 480, {500, 510, 320, 240, 0.1, -0.2, 0.001, 0.002}};

TEST(CameraFile, ReadsOneCameraOfOtherPrograms) {
  const std::string chain(kChain);
  const std::string opencv =
      "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nK: !!opencv-matrix\n   data: "
      "[ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]\nD: !!opencv-matrix\n   data: [ 0.1, -0.2,\n"
      "       0.001, 0.002, 0. ]\n";
  const std::string items = with(kRosInfo, "[0.1, -2.0e-01, 0.001, 0.002, 0]",
                                 "\n  - 0.1\n  - -0.2\n  - 0.001\n  - 0.002\n  - 0");
  for (const std::string& text : {std::string(kRosInfo), items, std::string(kSensor),
                                  chain.substr(0, chain.find("cam1:")), opencv}) {
    EXPECT_EQ(parsed_camera(text).camera, kDistorted) << text;
    EXPECT_FALSE(parsed_calibration(text).rig);
  }
  const std::string fisheye = with(kSensor, "radial-tangential", "equidistant");
  EXPECT_EQ(parsed_camera(fisheye).camera.model, "OPENCV_FISHEYE");
  EXPECT_EQ(parsed_camera(with(kRosInfo, "plumb_bob", "\"plumb_bob\"")).camera, kDistorted);
  EXPECT_EQ(parsed_camera(with(kSensor, "radial-tangential", "none")).camera.model, "PINHOLE");
}

// Kalibr's T_cn_cnm1 takes points from cam0 to cam1, and OpenCV's R and T from the first camera to the second.
TEST(CameraFile, APairSeesAPointWhereItsProgramSays) {
  const Eigen::Vector3d in_left(0.4, -0.3, 2.0);
  const Eigen::Vector3d in_right(0.8 * 0.4 + 0.6 * 2.0 - 0.07, -0.3 + 0.01,
                                 -0.6 * 0.4 + 0.8 * 2.0 + 0.02);
  const std::string with_k = with(with(kOpenCvPair, "M1", "K1"), "M2", "K2");
  const std::string sized = std::string(kOpenCvPair) + "image_width: 640\nimage_height: 480\n";
  for (const std::string& text : {std::string(kChain), std::string(kOpenCvPair), with_k, sized}) {
    const CameraFile file = parsed_calibration(text);
    ASSERT_TRUE(file.rig);
    EXPECT_LT((file.rig->left_from_right * in_right - in_left).norm(), 1e-12) << text;
    EXPECT_EQ(file.rig->left.parameters, kDistorted.parameters);
    EXPECT_EQ(file.rig->right.parameters[0], 400);
    EXPECT_EQ(file.rig->right.parameters.size(), text == kChain ? 8U : 4U);
  }
  EXPECT_EQ(parsed_calibration(sized).rig->right.width, 640U);
  EXPECT_EQ(parsed_calibration(kOpenCvPair).rig->right.width, 0U) << "not stated";
  EXPECT_THAT(camera_refusal(kChain), HasSubstr("camera.yaml: holds a stereo pair"));
}

// Rows as Kalibr lists them.
std::string rows(const std::string& key, const std::string& x, const std::string& y,
                 const std::string& z) {
  return "  " + key + ":\n  - [" + x + "]\n  - [" + y + "]\n  - [" + z +
         "]\n  - [0.0, 0.0, 0.0, 1.0]\n";
}

// Kalibr's T_cam_imu takes points from the IMU to a camera; OpenVINS's T_imu_cam takes them back.
TEST(CameraFile, APairMayStateWhereItsImuIs) {
  const std::string imu = rows("T", "0, -1, 0, 0.1", "1, 0, 0, 0.2", "0, 0, 1, 0.3");
  const std::string moved = rows("T", "0, -0.8, 0.6, 0.19", "1, 0, 0, 0.21", "0, 0.6, 0.8, 0.2");
  const std::string back = rows("T", "0, -1, 0, 0.09", "0.8, 0, 0.6, 0.13", "-0.6, 0, 0.8, 0.32");
  const std::string between =
      rows("T_cn_cnm1", "0.8, 0.0, 0.6, -0.07", "0.0, 1.0, 0.0, 0.01", "-0.6, 0.0, 0.8, 0.02");
  const auto chain = [&](const std::string& key, const std::string& left,
                         const std::string& right) {
    return with(with(kChain, between, with(right, "T", key)), "cam0:\n",
                "cam0:\n" + with(left, "T", key));
  };
  const Rigid3 stated = parsed_calibration(kChain).rig->left_from_right;
  for (const std::string& text : {chain("T_cam_imu", imu, moved), chain("T_imu_cam", back, imu)}) {
    const CameraFile file = parsed_calibration(text);
    ASSERT_TRUE(file.rig);
    EXPECT_LT(file.rig->left_from_right.difference_to(stated).norm(), 1e-12) << text;
  }
  EXPECT_THAT(calibration_refusal(with(kChain, between, with(imu, "T", "T_cam_imu"))),
              HasSubstr("cam1.T_cn_cnm1 is missing"));
}

constexpr const char* kSettings =
    "%YAML:1.0\n# Camera Parameters. Adjust them!\nCamera.type: \"PinHole\"\nCamera.fx: 500\n"
    "Camera.fy: 510\nCamera.cx: 320\nCamera.cy: 240\nCamera.k1: 0.1\nCamera.k2: -0.2\n"
    "Camera.p1: 0.001\nCamera.p2: 0.002\nCamera.width: 640\nCamera.height: 480\nCamera.fps: 30.\n"
    "Camera.RGB: 1\nViewer.PointSize:2\n";
constexpr const char* kNested =
    "Camera:\n  name: \"a camera\"\n  setup: \"RGBD\"\n  model: \"perspective\"\n\n  fx: 500\n  "
    "fy: 510\n"
    "  cx: 320\n  cy: 240\n\n  k1: 0.1\n  k2: -0.2\n  p1: 0.001\n  p2: 0.002\n  k3: 0.0\n\n  fps: "
    "30.0\n"
    "  cols: 640\n  rows: 480\n";

TEST(CameraFile, ReadsTheSettingsOfSlamSystems) {
  const std::string orb(kSettings);
  const std::string nested(kNested);
  for (const std::string& text : {orb, nested}) {
    const CameraFile file = parsed_camera(text);
    EXPECT_EQ(file.camera, kDistorted) << text;
    EXPECT_FALSE(file.depth_units_per_metre);
  }
  // A baseline beside a depth factor is that of the depth camera's projector.
  for (const std::string& text :
       {orb + "Camera.bf: 40.0\nDepthMapFactor: 5000.0 # 1.0 for bags\n",
        orb + "Stereo.b: 0.08\nRGBD.DepthMapFactor: 5000.0\n",
        nested + "  focal_x_baseline: 40.0\nPreprocessing:\n  depthmap_factor: 5000.0\n"}) {
    const CameraFile file = parsed_camera(text);
    EXPECT_EQ(file.camera, kDistorted) << text;
    EXPECT_EQ(file.depth_units_per_metre, 5000.0);
  }
  const std::string fisheye = with(
      with(with(with(orb, "PinHole", "KannalaBrandt8"), "p1", "k3"), "p2", "k4"), "0.002", "0.003");
  EXPECT_EQ(
      parsed_camera(fisheye).camera,
      (Camera{
          CameraId{0}, "OPENCV_FISHEYE", 640, 480, {500, 510, 320, 240, 0.1, -0.2, 0.001, 0.003}}));
  EXPECT_EQ(parsed_camera(nested + "  focal_x_baseline: 40.0\n").camera, kDistorted) << "RGBD";
  EXPECT_THAT(camera_refusal("Camera:\n  model: \"equirectangular\"\n  cols: 2\n"),
              HasSubstr("Camera.model: 'equirectangular'; expected PinHole"));
  EXPECT_THAT(camera_refusal(with(orb, "PinHole", "Omni")),
              HasSubstr("camera.yaml:3: Camera.type: 'Omni'; expected PinHole, Rectified"));
  EXPECT_THAT(camera_refusal(with(orb, "Camera.width: 640\n", "")),
              HasSubstr("Camera.width is missing"));
  EXPECT_THAT(camera_refusal(with(orb, "0.001", "x")), HasSubstr("Camera.p1: 'x' is not a number"));
}

TEST(CameraFile, ReadsPairsInTheSettingsOfSlamSystems) {
  const std::string orb(kSettings);
  for (const std::string& text : {orb + "Stereo.b: 0.08\n", orb + "Camera.bf: 40.0\n",
                                  with(kNested, "RGBD", "stereo") + "  focal_x_baseline: 40.0\n"}) {
    const CameraFile file = parsed_calibration(text);
    ASSERT_TRUE(file.rig) << text;
    EXPECT_EQ(file.rig->right, kDistorted);
    EXPECT_LT(file.rig->left_from_right
                  .difference_to({Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.08, 0.0, 0.0)})
                  .norm(),
              1e-12);
  }
  const std::string second =
      "Camera2.fx: 400\nCamera2.fy: 410\nCamera2.cx: 300\nCamera2.cy: 200\n"
      "Stereo.T_c1_c2: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n"
      "  data: [ 0.8, 0, -0.6, 0.1,\n    0, 1, 0, 0.2,\n    0.6, 0, 0.8, 0.3,\n    0, 0, 0, 1]\n";
  std::string first = orb;
  for (const char* const key : {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"}) {
    first = with(first, std::string("Camera.") + key, std::string("Camera1.") + key);
  }
  const StereoRig apart = *parsed_calibration(first + second).rig;
  EXPECT_EQ(apart.left, kDistorted);
  EXPECT_EQ(apart.right, (Camera{CameraId{0}, "PINHOLE", 640, 480, {400, 410, 300, 200}}));
  EXPECT_LT(
      (apart.left_from_right * Eigen::Vector3d(1, 1, 1) - Eigen::Vector3d(0.3, 1.2, 1.7)).norm(),
      1e-12);
  // Of the raw images: the left camera is turned to the rectified one by 0.8, 0.6; the right one is not.
  const std::string turned = "[0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8]";
  const std::string straight = "[1, 0, 0, 0, 1, 0, 0, 0, 1]";
  const auto raw = [&](const std::string& left, const std::string& right, const std::string& end,
                       const std::string& indent) {
    const std::string data = end.empty() ? "" : end + "data:";
    return indent + with(left, "?", "K") + data + "[600, 0, 310, 0, 610, 230, 0, 0, 1]\n" + indent +
           with(left, "?", "D") + data + "[0.1, -0.2, 0.001, 0.002]\n" + indent +
           with(left, "?", "R") + data + turned + "\n" + indent + with(right, "?", "K") + data +
           "[700, 0, 310, 0, 710, 230, 0, 0, 1]\n" + indent + with(right, "?", "D") + data +
           "[0, 0, 0, 0, 0]\n" + indent + with(right, "?", "R") + data + "\n" + indent + "  " +
           straight + "\n";
  };
  const std::string of_orb = orb + "Camera.bf: 40.0\n" +
                             raw("LEFT.?: ", "RIGHT.?: ", "!!opencv-matrix\n   rows: 3\n   ", "");
  const std::string of_stella = with(kNested, "RGBD", "stereo") +
                                "  focal_x_baseline: 40.0\nStereoRectifier:\n" +
                                raw("?_left: ", "?_right: ", "", "  ");
  for (const std::string& text : {of_orb, of_stella}) {
    const StereoRig rig = *parsed_calibration(text).rig;
    EXPECT_EQ(rig.left.parameters[0], 600) << text;
    EXPECT_EQ(rig.left.model, "OPENCV");
    EXPECT_EQ(rig.right, (Camera{CameraId{0}, "PINHOLE", 640, 480, {700, 710, 310, 230}}));
    EXPECT_LT((rig.left_from_right * Eigen::Vector3d(0, 0, 1) -
               Eigen::Vector3d(0.08 * 0.8 - 0.6, 0.0, 0.08 * 0.6 + 0.8))
                  .norm(),
              1e-12);
  }
}

TEST(CameraFile, APairOfFilesSaysWhereItsCamerasAre) {
  // Both turned by 90 degrees about z on the body, so that the body's y is the left camera's x.
  const StereoRig euroc = parsed_pair(kSensor, with(kSensor, "0.2,", "0.32,"));
  EXPECT_LT((euroc.left_from_right.translation() - Eigen::Vector3d(0.12, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(euroc.left, kDistorted);
  const StereoRig ros = parsed_pair(kRosInfo, with(kRosInfo, "321, 0,", "321, -60.6,"));
  EXPECT_LT((ros.left_from_right.translation() - Eigen::Vector3d(0.12, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(ros.right, kDistorted);
  EXPECT_THAT(testing::refusal(ErrorKind::kInput, [&] { parsed_pair(kRosInfo, kRosInfo); }),
              HasSubstr("right.yaml: does not say where the right camera is"));
}

TEST(CameraFile, NamesWhatIsWrongInFilesOfOtherPrograms) {
  const auto refused = [](const char* text, const std::string& from, const std::string& to) {
    return calibration_refusal(with(text, from, to));
  };
  EXPECT_THAT(refused(kRosInfo, "image_width: 640\n", ""), HasSubstr("image_width is missing"));
  EXPECT_THAT(refused(kRosInfo, "640", "640.5"), HasSubstr("calib.yaml:1: image_width: '640.5'"));
  EXPECT_THAT(refused(kRosInfo, "plumb_bob", "fov"), HasSubstr("distortion model 'fov'"));
  EXPECT_THAT(refused(kRosInfo, "[500, 0,", "[500, 3,"),
              HasSubstr("calib.yaml:7: camera_matrix.data: no camera matrix without skew"));
  EXPECT_THAT(refused(kRosInfo, "[500, 0,", "[0, 0,"), HasSubstr("was not calibrated"));
  EXPECT_THAT(refused(kRosInfo, "0, 0, 1]\ndis", "0, 0, 1, 2]\ndis"), HasSubstr("10 numbers"));
  EXPECT_THAT(refused(kRosInfo, "-2.0e-01", "nan"), HasSubstr("'nan' is not a number"));
  EXPECT_THAT(refused(kRosInfo, "camera_name", "image_width"), HasSubstr("stands above already"));
  EXPECT_THAT(refused(kSensor, "resolution", "size"), HasSubstr("resolution is missing"));
  EXPECT_THAT(refused(kSensor, "pinhole", "omni"),
              HasSubstr("camera_model: 'omni'; expected pinhole"));
  EXPECT_THAT(refused(kSensor, "[500, 510, 320, 240]", "[50]"), HasSubstr("intrinsics: 1 numbers"));
  EXPECT_THAT(refused(kSensor, "0.0, 1.0]", "0.0, 2.0]"), HasSubstr("T_BS.data: "));
  EXPECT_THAT(refused(kChain, "0.8, 0.0, 0.6, -0.07", "0.8, 0.0, 0.7, -0.07"),
              HasSubstr("calib.yaml:10: cam1.T_cn_cnm1: "));
  EXPECT_THAT(calibration_refusal(std::string(kChain) + "cam2:\n  intrinsics: [1, 1, 1, 1]\n"),
              HasSubstr("a third camera"));
  const std::string pair(kOpenCvPair);
  EXPECT_THAT(calibration_refusal(pair.substr(0, pair.find("R:"))),
              HasSubstr("R or T is missing; expected the extrinsics of stereo_calib"));
  EXPECT_THAT(refused(kOpenCvPair, "0.002, 0. ]", "0.002 ]"),
              HasSubstr("D1.data: 4 coefficients, which may be a fisheye's"));
  EXPECT_EQ(parsed_calibration("fisheye_model: 1\n" + with(kOpenCvPair, "0.002, 0. ]", "0.002 ]"))
                .rig->left.model,
            "OPENCV_FISHEYE");
}

TEST(TumCamera, KnowsTheThreeAndNoOther) {
  EXPECT_EQ(camera_defect(tum_camera("fr1")), "");
  EXPECT_EQ(camera_defect(tum_camera("fr3")), "");
  EXPECT_THROW(tum_camera("fr4"), Error);
}

}  // namespace
}  // namespace cairn

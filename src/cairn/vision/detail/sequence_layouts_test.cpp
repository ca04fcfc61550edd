// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/sequence_layouts.hpp"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/vision/sequence.hpp"

#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr const char* kMatrices =
    "P0: 50 0 16 0 0 50 12 0 0 0 1 0\nP1: 50 0 16 -25 0 50 12 0 0 0 1 0\n";
constexpr const char* kSensor =
    "# camera\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, 0.1,\n"
    "         0.0, 1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]\n"
    "rate_hz: 20\nresolution: [32, 24]\ncamera_model: pinhole\nintrinsics: [50, 51, 16, 12] #fu\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [0.1, 0.2, 0.001, 0.002]\n";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

// Folders of few small images; members may be written over.
struct Folder : testing::TemporaryFolder {
  void image(const std::string& name, std::uint32_t width = 32) const {
    std::filesystem::create_directories((*this / name).parent_path());
    write_png(*this / name, GrayImage(width, 24, 50));
  }
  void kitti(const std::string& times = "0.0\n0.1\n") const {
    for (const char* const camera : {"image_0", "image_1"}) {
      for (const char* const file : {"/000000.png", "/000001.png"})
        image(camera + std::string(file));
    }
    write("calib.txt", kMatrices);
    write("times.txt", times);
  }
  void euroc() const {
    for (const char* const camera : {"mav0/cam0/", "mav0/cam1/"}) {
      image(camera + std::string("data/1.png"));
      write(camera + std::string("data.csv"), "#timestamp [ns],filename\n1000000000,1.png\n");
      write(camera + std::string("sensor.yaml"),
            replaced(kSensor, "0.1", camera[8] == '0' ? "0.1" : "0.3"));
    }
  }
  std::string refused() const {
    return testing::message_of(ErrorKind::kInput, [&] { ImageSequence(path()).read(0); });
  }
};

TEST(SequenceLayouts, ReadsKittiOdometry) {
  const Folder folder;
  folder.kitti();
  const ImageSequence sequence(folder.path());
  ASSERT_EQ(sequence.frames().size(), 2U);
  EXPECT_EQ(sequence.frames()[1].timestamp_s, 0.1);
  EXPECT_EQ(sequence.frames()[1].right, folder / "image_1/000001.png");
  EXPECT_TRUE(sequence.is_stereo());
  EXPECT_DOUBLE_EQ(sequence.baseline_m(), 0.5);
  const Camera camera = sequence.camera(std::nullopt);
  EXPECT_EQ(camera, (Camera{CameraId{0}, "PINHOLE", 32, 24, {50, 50, 16, 12}}));
  EXPECT_EQ(sequence.read(0).right, GrayImage(32, 24, 50));
  EXPECT_THROW(sequence.camera(camera), Error) << "it has its own";
}

TEST(SequenceLayouts, ReadsEuroc) {
  const Folder folder;
  folder.euroc();
  for (const char* const part : {"", "mav0"}) {
    const ImageSequence sequence(folder / part);
    ASSERT_EQ(sequence.frames().size(), 1U);
    EXPECT_EQ(sequence.frames()[0].timestamp_s, 1.0);
    EXPECT_NEAR(sequence.baseline_m(), 0.2, 1e-12);
    EXPECT_EQ(sequence.camera(std::nullopt).model, "PINHOLE") << "rectified";
    EXPECT_EQ(sequence.read(0).right.width, 32U);
  }
}

void write_depth(const std::filesystem::path& file, std::uint16_t value) {
  StoredDepthImage depth(32, 24, 1000);
  depth.at(3, 4) = value;
  std::filesystem::create_directories(file.parent_path());
  write_png(file, depth);
}

TEST(SequenceLayouts, Reads7Scenes) {
  const Folder folder;
  for (const char* const number : {"000000", "000001", "000010"}) {
    folder.image("frame-" + std::string(number) + ".color.png");
    write_depth(folder / ("frame-" + std::string(number) + ".depth.png"), 65535);
    folder.write("frame-" + std::string(number) + ".pose.txt", "1 0 0 0\n");
  }
  std::filesystem::remove(folder / "frame-000001.depth.png");
  testing::Remarks remarks;
  const ImageSequence sequence(folder.path(), {}, remarks.sink());
  ASSERT_EQ(sequence.frames().size(), 3U);
  EXPECT_EQ(sequence.frames()[2].timestamp_s, 10.0);
  EXPECT_EQ(sequence.frames()[2].depth, folder / "frame-000010.depth.png");
  EXPECT_EQ(sequence.frames_without_depth(), 1U);
  EXPECT_EQ(sequence.read(0).depth.at(0, 0), 1.0F);
  EXPECT_EQ(sequence.read(0).depth.at(3, 4), 0.0F) << "65535 is no reading";
  EXPECT_EQ(sequence.camera(std::nullopt).parameters, (std::vector<double>{585, 585, 320, 240}));
  EXPECT_THAT(remarks.texts, ::testing::ElementsAre(HasSubstr("7-Scenes is not calibrated")));
}

TEST(SequenceLayouts, ReadsIclNuim) {
  const Folder folder;
  for (const char* const number : {"1", "2"}) {
    folder.image("rgb/" + std::string(number) + ".png");
    write_depth(folder / ("depth/" + std::string(number) + ".png"), 65535);
  }
  folder.write("associations.txt", "1 depth/1.png 1 rgb/1.png\n2 depth/2.png 2 rgb/2.png\n");
  const ImageSequence sequence(folder.path());
  ASSERT_EQ(sequence.frames().size(), 2U);
  EXPECT_EQ(sequence.frames()[1].timestamp_s, 2.0);
  EXPECT_EQ(sequence.frames()[1].color, folder / "rgb/2.png");
  EXPECT_EQ(sequence.frames()[1].depth, folder / "depth/2.png");
  EXPECT_FLOAT_EQ(sequence.read(0).depth.at(0, 0), 0.2F);
  EXPECT_FLOAT_EQ(sequence.read(0).depth.at(3, 4), 13.107F);
  EXPECT_EQ(sequence.camera(std::nullopt).parameters,
            (std::vector<double>{481.2, 480, 319.5, 239.5}));
  // The lines of a recording, as TUM's tools write them, are of no known camera.
  folder.write("associations.txt",
               "5.25 rgb/1.png 5.26 depth/1.png\n5.5 rgb/2.png 5.51 depth/2.png");
  const ImageSequence other(folder.path());
  EXPECT_EQ(other.frames()[1].depth, folder / "depth/2.png");
  EXPECT_FALSE(other.has_camera());
  folder.write("associations.txt", "1 depth/1.png x rgb/1.png\n");
  EXPECT_THAT(folder.refused(), HasSubstr("associations.txt:1: field 1 (timestamp): 'x'"));
}

TEST(SequenceLayouts, UnknownFoldersAreToldTheLayoutsAndWhatIsMissing) {
  const Folder folder;
  EXPECT_THAT(folder.refused(), HasSubstr("holds no sequence"));
  EXPECT_THAT(folder.refused(), HasSubstr("TUM RGB-D (rgb.txt, depth.txt)"));
  EXPECT_THAT(folder.refused(), HasSubstr("EuRoC (mav0/cam0/data.csv"));
  folder.kitti();
  std::filesystem::remove(folder / "calib.txt");
  EXPECT_THAT(folder.refused(),
              HasSubstr("calib.txt is missing of a sequence in the layout of KITTI odometry"));
}

TEST(SequenceLayouts, NamesWhatIsWrongInKittiOdometry) {
  const Folder folder;
  folder.kitti();
  folder.write("calib.txt", "P0: 50 0 16 0 0 50 12 0 0 0 1 0\n");
  EXPECT_THAT(folder.refused(), HasSubstr("calib.txt: P1 is missing"));
  folder.write("calib.txt", "P0: 50 0 16\n");
  EXPECT_THAT(folder.refused(), HasSubstr("calib.txt:1: P0: 3 numbers"));
  folder.write("calib.txt", replaced(kMatrices, "-25", "x"));
  EXPECT_THAT(folder.refused(), HasSubstr("calib.txt:2: P1: 'x' is not a number"));
  folder.write("calib.txt", replaced(kMatrices, "-25", "0"));
  EXPECT_THAT(folder.refused(), HasSubstr("a baseline of 0 m"));
  folder.write("calib.txt", replaced(kMatrices, "-25", "-25000"));
  EXPECT_THAT(folder.refused(), HasSubstr("a baseline of 500 m"));
  folder.write("calib.txt", replaced(kMatrices, "-25", "25"));
  EXPECT_THAT(folder.refused(), HasSubstr("swapped"));
  folder.kitti("0.0\n");
  EXPECT_THAT(folder.refused(), HasSubstr("times.txt: 1 times for more images"));
  folder.kitti("0.1\n0.1\n");
  EXPECT_THAT(folder.refused(), HasSubstr("times.txt:2: 0.1 s is not later"));
}

TEST(SequenceLayouts, NamesWhatIsWrongInEuroc) {
  const Folder folder;
  const auto with = [&](const std::string& from, const std::string& to) {
    folder.euroc();
    folder.write("mav0/cam1/sensor.yaml", replaced(kSensor, from, to));
    return folder.refused();
  };
  EXPECT_THAT(with("resolution", "size"), HasSubstr("cam1/sensor.yaml: resolution is missing"));
  EXPECT_THAT(with("0.1,", "0.1,"), HasSubstr("a baseline of 0 m"));
  folder.euroc();
  folder.write("mav0/cam0/data.csv", "1.5,1.png\n");
  EXPECT_THAT(folder.refused(), HasSubstr("data.csv:1: field 1 (timestamp)"));
  folder.write("mav0/cam0/data.csv", "1000000000,../1.png\n");
  EXPECT_THAT(folder.refused(), HasSubstr("leaves the sequence's folder"));
}

// The same cameras, given: calibration files of the layout are not read, and need not be there.
TEST(SequenceLayouts, AGivenRigTakesThePlaceOfTheCalibration) {
  const Camera camera{CameraId{0}, "PINHOLE", 0, 0, {50, 50, 16, 12}};
  const StereoRig rig{camera, camera, Rigid3(Eigen::Quaterniond::Identity(), {0.3, 0.0, 0.0})};
  const Folder folder;
  folder.euroc();
  folder.kitti();
  for (const char* const file : {"mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml", "calib.txt"}) {
    std::filesystem::remove(folder / file);
  }
  for (const char* const part : {"", "mav0"}) {
    const ImageSequence sequence(folder / part, {.rig = rig});
    EXPECT_DOUBLE_EQ(sequence.baseline_m(), 0.3);
    EXPECT_EQ(sequence.camera(std::nullopt).width, 32U) << "of the images";
    EXPECT_EQ(sequence.read(0).right, GrayImage(32, 24, 50));
  }
  const auto refused = [&](const StereoRig& given) {
    return testing::message_of(ErrorKind::kInput,
                               [&] { ImageSequence(folder.path(), {.rig = given}); });
  };
  StereoRig wrong = rig;
  wrong.left_from_right = rig.left_from_right.inverse();
  EXPECT_THAT(refused(wrong), HasSubstr("rig: the right camera is 0.3 m to the left"));
  wrong.left_from_right = Rigid3(Eigen::Quaterniond::Identity(), {300.0, 0.0, 0.0});
  EXPECT_THAT(refused(wrong), HasSubstr("rig: a baseline of 300 m; expected 0.005 to 10 m"));
  wrong = rig;
  wrong.left.width = wrong.left.height = wrong.right.width = wrong.right.height = 64;
  EXPECT_THROW(ImageSequence(folder.path(), {.rig = wrong}).read(0), Error);
}

TEST(SequenceLayouts, PairsAreTakenAtOnce) {
  const Folder folder;
  folder.euroc();
  const auto right_at = [&](const char* nanoseconds) {
    folder.write("mav0/cam1/data.csv", std::string(nanoseconds) + ",1.png\n");
  };
  right_at("1000900000");
  EXPECT_EQ(ImageSequence(folder.path()).frames_without_depth(), 0U);
  right_at("1005000000");
  EXPECT_THAT(folder.refused(), HasSubstr("no pair of images within 0.001 s"));
}

TEST(SequenceLayouts, AMissingRightImageIsCountedAndAllAreAnError) {
  const Folder folder;
  folder.kitti();
  std::filesystem::remove(folder / "image_1/000001.png");
  testing::Remarks remarks;
  const ImageSequence sequence(folder.path(), {}, remarks.sink());
  EXPECT_EQ(sequence.frames_without_depth(), 1U);
  EXPECT_THAT(remarks.texts, ::testing::ElementsAre(HasSubstr("1 of 2 images are missing")));
  EXPECT_TRUE(sequence.read(1).right.empty());
  std::filesystem::remove(folder / "image_1/000000.png");
  EXPECT_THAT(folder.refused(), HasSubstr("no image of the right camera"));
  folder.kitti();
  folder.image("image_1/000000.png", 40);
  EXPECT_THAT(folder.refused(), HasSubstr("40 x 24 pixels; expected 32 x 24, as its left image"));
}

}  // namespace
}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/foreign/conventions.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn::detail {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::refusal;
using testing::reprojection;
using ::testing::StartsWith;
using testing::TemporaryFolder;

template <class Number>
std::string raw_bytes_of(const std::vector<Number>& numbers) {
  std::string bytes(numbers.size() * sizeof(Number), '\0');
  if (!numbers.empty()) std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

using Files = std::map<std::string, std::string>;

// By the rules of the format: a camera at the origin and one turned by a half turn about z and shifted, which see
// two points.
Files small_files() {
  return {
      {"sensors/sensors.txt",
       "# kapture format: 1.1\n# sensor_device_id, name, sensor_type, [sensor_params]+\n"
       "cam0, a phone, camera, PINHOLE, 200, 100, 160, 150, 100.5, 50.5\n"
       "gps0, , gnss, EPSG:4326\nwifi0, , wifi\n"},
      {"sensors/records_camera.txt",
       "# kapture format: 1.1\n# timestamp, device_id, image_path\n"
       "20, cam0, seq/b.jpg\n10, cam0, seq/a.jpg\n30, cam0, seq/c.jpg\n"},
      {"sensors/trajectories.txt",
       "# kapture format: 1.1\n10, cam0, 1, 0, 0, 0, 0, 0, 0\n20, cam0, 0, 0, 0, 2, 1, 2, 3\n"
       "30, cam0, , , , , 1, 2, 3\n"},
      {"sensors/records_gnss.txt", "10, gps0, 8.54, 47.37, 408.0, 0, 1.5\n"},
      {"reconstruction/points3d.txt",
       "# kapture format: 1.1\n# X, Y, Z, R, G, B\n1, 2, 10, 255, 127.6, 0\nnan, 0, 0, 0, 0, 0\n"
       "-1,0,1e1,0,0,0\n"},
      {"reconstruction/observations.txt",
       "# kapture format: 1.1\n0, SIFT, seq/a.jpg, 1, seq/b.jpg, 0\n2, SIFT, seq/a.jpg, 0, "
       "seq/c.jpg, 0\n"
       "2, other, seq/a.jpg, 0\n"},
      {"reconstruction/keypoints/SIFT/keypoints.txt", "# kapture format: 1.1\nSIFT, float32, 3\n"},
      {"reconstruction/keypoints/SIFT/seq/a.jpg.kpt",
       raw_bytes_of<float>({84.5F, 50.5F, 1.0F, 116.5F, 80.5F, 1.0F})},
      {"reconstruction/keypoints/SIFT/seq/b.jpg.kpt", raw_bytes_of<float>({100.0F, 50.0F, 2.0F})},
      {"reconstruction/descriptors/mine/descriptors.txt",
       "# kapture format: 1.1\nSIFT, uint8, 4, SIFT, L2\n"},
      {"reconstruction/descriptors/mine/seq/a.jpg.desc",
       raw_bytes_of<std::uint8_t>({1, 2, 3, 4, 5, 6, 7, 8})},
  };
}

class KaptureTest : public testing::ImportTest {
 protected:
  LandmarkMap read(const Files& files, const std::string& name = "k") {
    std::filesystem::remove_all(folder_ / "k");
    for (const auto& [path, content] : files) {
      const std::filesystem::path file = folder_ / ("k/" + path);
      std::filesystem::create_directories(file.parent_path());
      folder_.write("k/" + path, content);
    }
    return ImportTest::read(folder_ / name);
  }
  std::string refused(const Files& files) {
    return testing::message_of(ErrorKind::kInput, [&] { read(files); });
  }
  // With one file of the small folder replaced.
  std::string refused(const std::string& path, const std::string& content) {
    Files files = small_files();
    files[path] = content;
    return refused(files);
  }
};

TEST_F(KaptureTest, ImagesWithAPoseBecomeFramesAndPointsLandmarks) {
  const LandmarkMap map = read(small_files());
  EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{10}, FrameId{20}));
  EXPECT_THAT(map.frames().image_names, ElementsAre("seq/a.jpg", "seq/b.jpg"));
  // Poses are camera_from_world: a half turn, then (1, 2, 3).
  EXPECT_LT((map.world_from_camera(FrameIndex{1}) * Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_LT((map.frames().translations[1] - Eigen::Vector3d(1, 2, -3)).norm(), 1e-12);
  ASSERT_EQ(map.cameras().size(), 1U);
  EXPECT_EQ(map.cameras()[0], (Camera{CameraId{0}, "PINHOLE", 200, 100, {160, 150, 100, 50}}));
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{0}, LandmarkId{2}));
  EXPECT_EQ(map.landmarks().positions[1], Eigen::Vector3d(-1, 0, 10));
  EXPECT_EQ(map.landmarks().colors[0], (Color{255, 128, 0}));
  EXPECT_THAT(map.observing_frames(LandmarkIndex{0}), ElementsAre(FrameIndex{0}, FrameIndex{1}));
  EXPECT_THAT(map.observing_frames(LandmarkIndex{1}), ElementsAre(FrameIndex{0}));
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{0})[0], (Pixel{116, 80}));
  EXPECT_EQ(map.observations().keypoints[0], 1U);
  // By the formula: 160 / 10 + 100, 150 * 2 / 10 + 50.
  const auto seen = project(map.cameras()[0], map.landmarks().positions[0]);
  ASSERT_TRUE(seen.has_value());
  EXPECT_EQ(*seen, (Pixel{116, 80}));
}

TEST_F(KaptureTest, DescriptorsAndGnssPositionsComeAlong) {
  const LandmarkMap map = read(small_files());
  ASSERT_TRUE(map.landmarks().descriptors.has_value());
  EXPECT_EQ(map.landmarks().descriptors->kind, "SIFT");
  EXPECT_THAT(map.landmarks().descriptors->bytes, ElementsAre(5, 6, 7, 8, 1, 2, 3, 4));
  ASSERT_EQ(map.frames().gnss.size(), 2U);
  EXPECT_EQ(map.frames().gnss[0], (GnssFix{{47.37, 8.54, 408.0}, std::nullopt}));
  EXPECT_FALSE(map.frames().gnss[1].has_value());
}

TEST_F(KaptureTest, SaysWhatIsLost) {
  Files files = small_files();
  files["sensors/records_wifi.txt"] = "";
  files["reconstruction/matches/SIFT/a"] = "";
  read(files);
  EXPECT_THAT(remarks_.losses,
              ElementsAre(HasSubstr("1 images without a pose"),
                          HasSubstr("1 points without a finite position"),
                          HasSubstr("1 observations by images without a pose"),
                          HasSubstr("1 observations of other keypoints than 'SIFT'"),
                          HasSubstr("not read: 'sensors/records_wifi.txt', "
                                    "'reconstruction/matches'")));
  EXPECT_THAT(remarks_.losses[0], StartsWith((folder_ / "k").string()));
  EXPECT_EQ(remarks_.texts, remarks_.losses);
}

TEST_F(KaptureTest, IsNamedByItsFolderOrAnyOfItsFiles) {
  const LandmarkMap map = read(small_files());
  for (const char* name : {"k/", "k/sensors/sensors.txt", "k/reconstruction/points3d.txt"}) {
    EXPECT_THAT(ImportTest::read(folder_ / name), testing::EqualsMap(map)) << name;
  }
}

TEST_F(KaptureTest, CamerasOfARigHaveThePoseOfTheRig) {
  Files files = small_files();
  files["sensors/sensors.txt"] += "cam1, , camera, SIMPLE_PINHOLE, 200.0, 100.0, 160, 100, 50\n";
  files["sensors/rigs.txt"] =
      "# kapture format: 1.1\nrig, cam0, 1, 0, 0, 0, 0, 0, 0\nrig, cam1, 1, 0, 0, 0, -0.5, 0, 0\n";
  files["sensors/records_camera.txt"] = "10, cam0, a\n10, cam1, b\n";
  files["sensors/trajectories.txt"] = "10, rig, 0, 0, 0, 1, 1, 2, 3\n";
  files.erase("reconstruction/observations.txt");
  const LandmarkMap map = read(files);
  EXPECT_THAT(map.frames().image_names, ElementsAre("a", "b"));
  EXPECT_THAT(map.frames().ids, ElementsAre(FrameId{0}, FrameId{1})) << "one time, two images";
  EXPECT_LT((map.frames().translations[0] - Eigen::Vector3d(1, 2, -3)).norm(), 1e-12);
  // sensor_from_rig: half a metre to the right in a rig that is turned by a half turn.
  EXPECT_LT((map.frames().translations[1] - Eigen::Vector3d(0.5, 2, -3)).norm(), 1e-12);
  EXPECT_THAT(map.rigs(), ElementsAre(Rig{RigId{0},
                                          {{CameraIndex{0}, {1, 0, 0, 0}, {0, 0, 0}},
                                           {CameraIndex{1}, {1, 0, 0, 0}, {-0.5, 0, 0}}}}));
  EXPECT_THAT(map.frames().instants, ElementsAre(InstantId{0}, InstantId{0}));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("timestamps are not distinct")));
}

TEST_F(KaptureTest, ASensorInVeryManyRigsIsRefused) {
  Files files = small_files();
  std::string& rigs = files["sensors/rigs.txt"];
  for (int i = 0; i < 100; ++i) rigs += fmt::format("rig{}, cam0, 1, 0, 0, 0, 0, 0, 0\n", i);
  read(files);
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 cameras are in several rigs")));
  rigs += "rig, cam0, 1, 0, 0, 0, 0, 0, 0\n";
  EXPECT_THAT(refused(files),
              HasSubstr("rigs.txt:101: sensor_device_id: 'cam0' is in more than 100 rigs"));
}

TEST_F(KaptureTest, Version1HasOneTypeOfKeypoints) {
  Files files = small_files();
  files["sensors/sensors.txt"].replace(18, 3, "1.0");
  files["reconstruction/observations.txt"] = "0, seq/a.jpg, 1, seq/b.jpg, 0\n2, seq/a.jpg, 0\n";
  const auto move = [&](const std::string& from, const std::string& to) {
    files[to] = files[from];
    files.erase(from);
  };
  const std::string keypoints = "reconstruction/keypoints/";
  for (const char* name : {"keypoints.txt", "seq/a.jpg.kpt", "seq/b.jpg.kpt"}) {
    move(keypoints + "SIFT/" + name, keypoints + name);
  }
  files["reconstruction/descriptors/descriptors.txt"] = "SIFT, uint8, 4\n";
  move("reconstruction/descriptors/mine/seq/a.jpg.desc",
       "reconstruction/descriptors/seq/a.jpg.desc");
  const LandmarkMap map = read(files);
  EXPECT_EQ(map.observation_count(), 3U);
  EXPECT_THAT(map.landmarks().descriptors->bytes, ElementsAre(5, 6, 7, 8, 1, 2, 3, 4));
  files["sensors/sensors.txt"].replace(18, 3, "2.0");
  EXPECT_THAT(refused(files), HasSubstr("sensors.txt: kapture format '2.0'; expected 1.0 or 1.1"));
}

TEST_F(KaptureTest, DescriptorsOfFloatsBecomeBytes) {
  Files files = small_files();
  files["reconstruction/descriptors/mine/descriptors.txt"] = "r2d2, float32, 2, SIFT, L2\n";
  files["reconstruction/descriptors/mine/seq/a.jpg.desc"] = raw_bytes_of<float>({-1, 1, 0, 0.5F});
  EXPECT_THAT(read(files).landmarks().descriptors->bytes, ElementsAre(128, 192, 1, 255));
}

TEST_F(KaptureTest, CompanionsMayBeMissing) {
  const auto without = [](const std::vector<const char*>& paths) {
    Files files = small_files();
    for (const char* path : paths) {
      std::erase_if(files, [&](const auto& file) { return file.first.starts_with(path); });
    }
    return files;
  };
  LandmarkMap map = read(without({"sensors/trajectories.txt"}));
  EXPECT_EQ(map.frame_count(), 0U);
  EXPECT_EQ(map.landmark_count(), 2U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("there is no sensors/trajectories.txt")));

  map = read(without({"sensors/records_camera.txt"}));
  EXPECT_EQ(map.frame_count(), 0U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("there is no sensors/records_camera.txt")));

  map = read(without({"reconstruction/observations.txt"}));
  EXPECT_FALSE(map.has_observations());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("there is no reconstruction/observations.txt")));

  Files untracked = small_files();
  untracked["reconstruction/observations.txt"] = "# kapture format: 1.1\n";
  map = read(untracked);
  EXPECT_FALSE(map.has_observations());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("observations.txt holds none that can be used")));

  map = read(without({"reconstruction/points3d.txt", "reconstruction/observations.txt"}));
  EXPECT_EQ(map.landmark_count(), 0U);
  EXPECT_EQ(map.frame_count(), 2U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("there is no reconstruction/points3d.txt")));

  map = read(without({"reconstruction/keypoints"}));
  EXPECT_FALSE(map.has_observations());
  EXPECT_THAT(remarks_.losses,
              Contains(HasSubstr("keypoints.txt: where 3 observations are is unknown")));

  map = read(without({"reconstruction/keypoints/SIFT/seq/b.jpg.kpt"}));
  EXPECT_EQ(map.observation_count(), 2U);
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 observations by images without keypoints")));

  Files packed = without({"reconstruction/keypoints/SIFT/seq/b.jpg.kpt"});
  packed["reconstruction/keypoints/SIFT/keypoints.tar"] = "";
  read(packed);
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("keypoints.tar are not read: unpack it")));

  map = read(without({"reconstruction/descriptors"}));
  EXPECT_FALSE(map.landmarks().descriptors.has_value());
}

TEST_F(KaptureTest, CamerasWithoutAModelAreUnknown) {
  Files files = small_files();
  files["sensors/sensors.txt"] =
      "# kapture format: 1.1\ncam0, , camera, UNKNOWN_CAMERA, 200, 100\ngps0, , gnss\n";
  const LandmarkMap map = read(files);
  EXPECT_EQ(map.frame_count(), 2U);
  EXPECT_TRUE(map.frames().cameras.empty());
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("camera 'cam0' is unknown to kapture")));
  files["sensors/sensors.txt"] =
      "# kapture format: 1.1\ncam0, , camera, OF_MY_OWN, 200, 100, 3\ngps0, , gnss, EPSG:2154\n";
  read(files);
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("camera 'cam0' is unknown to the map")));
  EXPECT_THAT(remarks_.losses, Contains(HasSubstr("1 GNSS positions are not in EPSG:4326")));
}

TEST_F(KaptureTest, ErrorsSayWhere) {
  const std::string sensors = "# kapture format: 1.1\ngps0, , gnss\ncam0, , camera, ";
  EXPECT_THAT(refused("sensors/sensors.txt", sensors + "PINHOLE, wide"),
              HasSubstr("sensors/sensors.txt:3: width: 'wide' is not a number"));
  EXPECT_THAT(refused("sensors/sensors.txt", sensors + "PINHOLE, 1e300, 3"),
              HasSubstr("sensors.txt:3: width: 1e+300 is no size"));
  EXPECT_THAT(refused("sensors/sensors.txt", sensors + "PINHOLE"),
              HasSubstr("sensors.txt:3: width: the line ends before it"));
  EXPECT_THAT(refused("sensors/trajectories.txt", "10, cam0, 1, 0, 0, 0, 0, 0\n"),
              HasSubstr("trajectories.txt:1: tz: the line ends before it"));
  EXPECT_THAT(refused("sensors/trajectories.txt", "10, cam0, 0, 0, 0, 0, 0, 0, 0\n"),
              HasSubstr("trajectories.txt:1: qw: the quaternion has no direction"));
  EXPECT_THAT(refused("sensors/trajectories.txt", "10, cam0, 1, 0, 0, 0, 0, 0, 0"),
              HasSubstr("trajectories.txt:1: the last line does not end with a newline"));
  EXPECT_THAT(refused("sensors/trajectories.txt",
                      "10, cam0, 1, 0, 0, 0, 0, 0, 0\n10, cam0, 1, 0, 0, 0, 0, 0, 1\n"),
              HasSubstr("trajectories.txt:2: device_id: 'cam0' has two poses at 10"));
  EXPECT_THAT(refused("sensors/trajectories.txt", "10, cam0, 1, 0, 0, 0, 2e9, 0, 0\n"),
              HasSubstr("trajectories.txt: frame 10: translation"));
  EXPECT_THAT(refused("sensors/records_camera.txt", "1.5, cam0, a\n"),
              HasSubstr("records_camera.txt:1: timestamp: '1.5' is not a whole number"));
  EXPECT_THAT(refused("sensors/records_camera.txt", "10, cam7, a\n"),
              HasSubstr("records_camera.txt:1: device_id: 'cam7' is no camera of sensors.txt"));
  EXPECT_THAT(refused("sensors/records_camera.txt", "10, cam0, ../../secret\n"),
              HasSubstr("image_path: '../../secret' leads out of the folder"));
  EXPECT_THAT(refused("sensors/records_camera.txt", "10, cam0, a\n20, cam0, a\n"),
              HasSubstr("records_camera.txt: the image 'a' stands there twice"));
  EXPECT_THAT(refused("sensors/records_gnss.txt", "10, gps0, 8.5, 95, 0, 0, 0\n"),
              HasSubstr("records_gnss.txt:1: x: latitude 95 is out of range"));
  EXPECT_THAT(refused("reconstruction/points3d.txt", "1, 2\n"),
              HasSubstr("points3d.txt:1: Z: the line ends before it"));
  EXPECT_THAT(refused("reconstruction/points3d.txt", "1, 2, 3, 4, 5\n"),
              HasSubstr("points3d.txt:1: B: the line ends before it"));
  EXPECT_THAT(refused("reconstruction/points3d.txt", "1, 2, 3, 4, 5, 256\n"),
              HasSubstr("points3d.txt:1: B: 256 is no colour"));
  EXPECT_THAT(refused("reconstruction/observations.txt", "3, SIFT, seq/a.jpg, 0\n"),
              HasSubstr("observations.txt:1: point3d_id: 3 of 3 points"));
  EXPECT_THAT(refused("reconstruction/observations.txt", "0, SIFT, seq/a.jpg\n"),
              HasSubstr("observations.txt:1: feature_id: the line ends before it"));
  EXPECT_THAT(refused("reconstruction/observations.txt", "0, SIFT, seq/a.jpg, 2\n"),
              HasSubstr("observations.txt: feature 2 of 'seq/a.jpg', which has 2"));
  EXPECT_THAT(refused("reconstruction/observations.txt", "0, ../../.., seq/a.jpg, 2\n"),
              HasSubstr("keypoints_type: '../../..' leads out of the folder"));
  Files none = small_files();
  none.erase("sensors/sensors.txt");
  EXPECT_THAT(refused(none), HasSubstr("is a folder, but no map in a known format"));
}

TEST_F(KaptureTest, HostileSizesAreRefused) {
  const std::string keypoints = "reconstruction/keypoints/SIFT/keypoints.txt";
  EXPECT_THAT(refused(keypoints, "SIFT, float32, 65537\n"),
              HasSubstr("keypoints.txt:1: dsize: '65537' is not a whole number"));
  EXPECT_THAT(refused(keypoints, "SIFT, float32, 0\n"), HasSubstr("dsize: is 0"));
  EXPECT_THAT(refused(keypoints, "SIFT, float32, 1\n"), HasSubstr("keypoints of one number"));
  EXPECT_THAT(refused(keypoints, "SIFT, complex64, 4\n"),
              HasSubstr("dtype: 'complex64' is no known type"));
  EXPECT_THAT(refused(keypoints, "SIFT, float64, 4\n"),
              HasSubstr("a.jpg.kpt: 24 bytes are no whole number of features; expected 32 bytes"));
  EXPECT_THAT(refused("reconstruction/keypoints/SIFT/seq/a.jpg.kpt",
                      raw_bytes_of<float>({NAN, 0.0F, 1.0F, 0.0F, 0.0F, 1.0F})),
              HasSubstr("a.jpg.kpt: keypoint 0 is not finite"));
  // One descriptor of 4096 bytes, which every observation names in four bytes.
  Files files = small_files();
  files["reconstruction/descriptors/mine/descriptors.txt"] = "SIFT, uint8, 4096, SIFT, L2\n";
  files["reconstruction/descriptors/mine/seq/a.jpg.desc"] = std::string(8192, 'x');
  std::string& observations = files["reconstruction/observations.txt"];
  observations = "0, SIFT";
  for (int i = 0; i < 30000; ++i) observations += ",seq/a.jpg,1";
  observations += "\n";
  EXPECT_THAT(refused(files), HasSubstr("descriptors take"));
}

TEST_F(KaptureTest, EveryCutOfAFileIsReadOrRefusedByName) {
  read(small_files());
  for (const auto& [path, content] : small_files()) {
    for (std::size_t size = 0; size < content.size(); ++size) {
      folder_.write("k/" + path, content.substr(0, size));
      const std::string message =
          refusal(ErrorKind::kInput, [&] { ImportTest::read(folder_ / "k/"); });
      if (!message.empty()) {
        EXPECT_THAT(message, StartsWith((folder_ / "k").string())) << path << ' ' << size;
      }
    }
    folder_.write("k/" + path, content);
  }
}

// A synthetic map written by the rules of the format. Poses may be written the wrong way round.
Files files_of(const LandmarkMap& map, bool world_from_camera) {
  const auto number = [](double x) { return fmt::format("{:.17g}", x); };
  Files files;
  const Camera& camera = map.cameras()[0];
  std::string& sensors = files["sensors/sensors.txt"];
  sensors = fmt::format("# kapture format: 1.1\ncam, , camera, {}, {}, {}", camera.model,
                        camera.width, camera.height);
  for (std::size_t i = 0; i < camera.parameters.size(); ++i) {
    const bool is_centre = i == 2 || i == 3;  // of PINHOLE
    sensors += ", " + number(camera.parameters[i] + (is_centre ? 0.5 : 0.0));
  }
  std::vector<std::vector<double>> keypoints(map.frame_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    const std::string image = fmt::format("{:05}.png", i);
    files["sensors/records_camera.txt"] += fmt::format("{}, cam, {}\n", 100 + i, image);
    Rigid3 pose = map.world_from_camera(FrameIndex{i});
    if (!world_from_camera) pose = pose.inverse();
    const Eigen::Quaterniond q = pose.quaternion();
    const Eigen::Vector3d& t = pose.translation();
    files["sensors/trajectories.txt"] +=
        fmt::format("{}, cam, {}, {}, {}, {}, {}, {}, {}\n", 100 + i, number(q.w()), number(q.x()),
                    number(q.y()), number(q.z()), number(t.x()), number(t.y()), number(t.z()));
  }
  for (std::uint32_t i = 0; i < map.landmark_count(); ++i) {
    const Eigen::Vector3d& x = map.landmarks().positions[i];
    files["reconstruction/points3d.txt"] +=
        fmt::format("{}, {}, {}\n", number(x.x()), number(x.y()), number(x.z()));
    std::string line = fmt::format("{}, mine", i);
    const auto frames = map.observing_frames(LandmarkIndex{i});
    for (std::size_t k = 0; k < frames.size(); ++k) {
      std::vector<double>& of_frame = keypoints[frames[k].value];
      line += fmt::format(", {:05}.png, {}", frames[k].value, of_frame.size() / 2);
      const Pixel pixel = map.observed_pixels(LandmarkIndex{i})[k];
      of_frame.insert(of_frame.end(), {pixel.u + 0.5, pixel.v + 0.5});
    }
    files["reconstruction/observations.txt"] += line + "\n";
  }
  files["reconstruction/keypoints/mine/keypoints.txt"] = "mine, float64, 2\n";
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    files[fmt::format("reconstruction/keypoints/mine/{:05}.png.kpt", i)] =
        raw_bytes_of(keypoints[i]);
  }
  return files;
}

TEST_F(KaptureTest, AWholeMapComesBack) {
  const LandmarkMap map = synthetic_map({.seed = 5, .landmarks = 400, .frames = 12});
  ASSERT_EQ(map.cameras()[0].model, "PINHOLE");
  const LandmarkMap back = read(files_of(map, false));
  ASSERT_EQ(back.landmark_count(), map.landmark_count());
  EXPECT_EQ(back.landmarks().positions, map.landmarks().positions);
  ASSERT_EQ(back.observation_count(), map.observation_count());
  for (std::uint32_t i = 0; i < map.frame_count(); ++i) {
    EXPECT_LT(map.world_from_camera(FrameIndex{i})
                  .difference_to(back.world_from_camera(FrameIndex{i}))
                  .norm(),
              1e-12);
  }
  EXPECT_NEAR(reprojection(back).median, reprojection(map).median, 1e-9);
}

TEST_F(KaptureTest, TheDetectiveFindsPosesTheWrongWayRound) {
  const LandmarkMap map = synthetic_map({.seed = 5, .landmarks = 400, .frames = 12});
  EXPECT_EQ(check_conventions(read(files_of(map, false))).verdict, ConventionVerdict::kAsFormat);
  const LandmarkMap wrong = read(files_of(map, true));
  const ConventionCheck check = check_conventions(wrong);
  ASSERT_EQ(check.verdict, ConventionVerdict::kOther);
  EXPECT_LT(reprojection(reread(wrong, check.best.reading)).median,
            reprojection(map).median + 1e-6);
}

}  // namespace
}  // namespace cairn::detail

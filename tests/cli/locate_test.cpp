// SPDX-License-Identifier: BSD-3-Clause
// cairn locate, on a short sequence that cairn simulate made, and on real images.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/formats/map_file.hpp"
#include "cairn/formats/trajectory_file.hpp"

#include "cli.hpp"
#include "support/real_data.hpp"

namespace cairn::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class LocateCliTest : public CliTest {
 protected:
  void SetUp() override {
#ifdef CAIRN_HAS_SIMULATION
    // Made once: no test changes it.
    static const TemporaryFolder made;
    static const CommandResult result = [] {
      CommandResult last;
      for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
               {"simulate", "s", "--environment", "desk", "--frames", "24", "--rate", "6"},
               {"simulate", "other", "--environment", "kitchen", "--seed", "5", "--frames", "2"},
               { "map",
                 "s",
                 "-o",
                 "desk.map",
                 "--start-from",
                 "s/groundtruth.txt" }}) {
        last = run_command(command(words), {.folder = made.path()});
        if (last.exit_code != kDone) return last;
      }
      return last;
    }();
    ASSERT_EQ(result.exit_code, kDone) << result.errors;
    fs::create_directory_symlink(made / "s", path("s"));
    fs::create_directory_symlink(made / "other", path("other"));
    fs::copy(made / "desk.map", path("desk.map"));
#else
    GTEST_SKIP() << "built without the simulation: cairn locate was not tested on made images";
#endif
  }
};

constexpr const char* kImage = "s/rgb/2.000000.jpg";

TEST_F(LocateCliTest, SaysWhereAnImageWasTaken) {
  const Json json = document(
      {"locate", "desk.map", kImage, "--camera", "s/camera.yaml", "--trajectory", "found.tum"});
  EXPECT_EQ(json.at("schema").at("name"), "cairn.locate");
  const Json& result = json.at("results").at(0);
  EXPECT_EQ(result.at("verdict"), "located");
  EXPECT_GE(result.at("probability").get<double>(), 0.99);
  EXPECT_EQ(result.at("covariance").size(), 6U);
  EXPECT_GT(result.at("matches").size(), 50U);
  FileReader found(path("found.tum"));
  const auto poses = read_trajectory(found);
  FileReader truth(path("s/groundtruth.txt"));
  const auto true_poses = read_trajectory(truth);
  ASSERT_EQ(poses.poses().size(), 1U);
  EXPECT_NEAR(poses.poses()[0].timestamp_s, 2.0, 1e-9);
  const LandmarkMap map = read_map(path("desk.map"));
  for (const Json& match : result.at("matches")) {
    const auto landmark = map.find(LandmarkId{match.at(0).get<std::uint64_t>()});
    ASSERT_TRUE(landmark) << match;
    const auto pixel = project(map.cameras()[0], poses.poses()[0].world_from_camera.inverse() *
                                                     map.landmarks().positions[landmark->value]);
    ASSERT_TRUE(pixel);
    EXPECT_NEAR(pixel->u, match.at(1).get<double>(), 8.0);
    EXPECT_NEAR(pixel->v, match.at(2).get<double>(), 8.0);
  }
  for (const TimedPose& pose : true_poses.poses()) {
    if (std::abs(pose.timestamp_s - 2.0) > 1e-3) continue;
    const Vector6d off = poses.poses()[0].world_from_camera.difference_to(pose.world_from_camera);
    EXPECT_LT(off.head<3>().norm(), 0.02);
    EXPECT_LT(off.tail<3>().norm(), 0.01);
  }
}

TEST_F(LocateCliTest, TakesTheMapsOwnCamera) {
  EXPECT_THAT(answer({"locate", "desk.map", kImage}), HasSubstr("2.000000.jpg: located: "));
  EXPECT_THAT(answer({"locate", "desk.map", kImage, "--depth", "s/depth/2.000000.png"}),
              HasSubstr("standard deviations"));
}

TEST_F(LocateCliTest, TakesTheImagesOfAFolder) {
  fs::create_directories(path("photos/more"));
  fs::copy(path(kImage), path("photos/b.JPG"));
  fs::copy(path("other/rgb/0.000000.jpg"), path("photos/a.jpg"));
  fs::copy(path(kImage), path("photos/more/c.jpg"));
  write("photos/notes.txt", "no image");
  const CommandResult result = cairn({"locate", "desk.map", "photos", "--json", "r.json"});
  EXPECT_EQ(result.exit_code, kNoAlignment) << "one is of another place";
  const Json results = Json::parse(content("r.json")).at("results");
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results.at(0).at("image"), "photos/a.jpg");
  EXPECT_NE(results.at(0).at("verdict"), "located");
  EXPECT_EQ(results.at(1).at("image"), "photos/b.JPG");
  EXPECT_EQ(results.at(1).at("verdict"), "located");
  expect_refusal({"locate", "desk.map", "s"}, kBadInput, {"s: no image is in this folder"});
}

// COLMAP estimates a camera for each image.
TEST_F(LocateCliTest, TakesAnImageOfTheMapByItsOwnCamera) {
  MapTables tables = read_map(path("desk.map")).tables();
  Camera other = tables.cameras.front();
  other.id = CameraId{7};
  other.parameters = {600.0, 600.0, 319.5, 239.5};
  tables.cameras.push_back(other);
  tables.frames.cameras.back() = CameraIndex{1};
  const std::string image = "s/rgb/" + tables.frames.image_names.front();
  write_map(LandmarkMap(std::move(tables)), path("two.map"));
  EXPECT_THAT(answer({"locate", "two.map", image, "--json", "r.json"}), HasSubstr(": located: "));
  const Json result = Json::parse(content("r.json")).at("results").at(0);
  EXPECT_EQ(result.at("camera").at("parameters").at(0), 525.0);
  EXPECT_TRUE(result.at("focal_length_sigma").is_null()) << "it was not searched";
}

TEST_F(LocateCliTest, RefusesAPoseThroughAnotherLens) {
  const Words words = {
      "locate", "desk.map", kImage, "--camera", "PINHOLE 640 480 480 480 319.5 239.5",
      "--json", "r.json"};
  const CommandResult other = cairn(words);
  EXPECT_EQ(other.exit_code, kNoAlignment);
  EXPECT_THAT(other.output, AllOf(HasSubstr("rejected: the matches fit another lens far better"),
                                  HasSubstr("hint: State the image's camera by --camera")));
  EXPECT_EQ(Json::parse(content("r.json")).at("results").at(0).at("failure"), "lens");
}

// The matches that agree with a pose through the wrong lens fit that lens; those that do not agree show the other one.
TEST_F(LocateCliTest, RefusesMostPosesThroughALensOffCentre) {
  const CommandResult all = cairn({"locate", "desk.map", "s/rgb", "--camera",
                                   "PINHOLE 640 480 525 525 360 239.5", "--json", "r.json"});
  EXPECT_EQ(all.exit_code, kNoAlignment);
  const Json results = Json::parse(content("r.json")).at("results");
  EXPECT_EQ(results.size(), 24U);
  EXPECT_LE(
      std::ranges::count(results, "located", [](const Json& one) { return one.at("verdict"); }), 3);
}

TEST_F(LocateCliTest, RefusesImagesOfOtherPlaces) {
  const CommandResult result =
      cairn({"locate", "desk.map", kImage, "other/rgb/0.000000.jpg", "--trajectory", "found.tum"});
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(result.output, HasSubstr("2.000000.jpg: located: "));
  EXPECT_THAT(result.output, HasSubstr("0.000000.jpg: rejected: "));
  FileReader found(path("found.tum"));
  EXPECT_EQ(read_trajectory(found).poses().size(), 1U) << "only what is located";
  EXPECT_THAT(cairn({"locate", "desk.map", "other/rgb/0.000000.jpg", "-o", "none.map"}).output,
              HasSubstr("no image is located, so none.map is not written"));
  EXPECT_FALSE(fs::exists(path("none.map")));
}

TEST_F(LocateCliTest, SaysWhatToTryOnlyWhereAnImageIsRejected) {
  EXPECT_THAT(answer({"locate", "desk.map", kImage}), Not(HasSubstr("hint:")));
  const Words words = {"locate", "desk.map", "other/rgb/0.000000.jpg", "--json", "r.json"};
  const std::string known = cairn(words).output;
  EXPECT_THAT(known, HasSubstr("\n  hint: Check that the image shows"));
  EXPECT_THAT(known, HasSubstr("hint: Add --camera unknown if"));
  const Json json = Json::parse(content("r.json"));
  EXPECT_THAT(json.at("results").at(0).at("failure"),
              ::testing::AnyOf("few_matches", "few_inliers"));
  Words unknown = words;
  unknown.insert(unknown.end(), {"--camera", "unknown"});
  EXPECT_THAT(cairn(unknown).output, AllOf(HasSubstr("hint: Give the image's lens by --camera"),
                                           Not(HasSubstr("--camera unknown"))));
}

TEST_F(LocateCliTest, BeginsAtTheFocalLengthOfExifData) {
  // A focal length of 30 mm of a 35 mm camera.
  const std::string tiff(
      "II*\0\x08\0\0\0\x01\0\x69\x87\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0"
      "\x01\0\x05\xa4\x03\0\x01\0\0\0\x1e\0\0\0\0\0\0\0",
      44);
  const std::string segment = std::string("\xff\xe1\0\x34", 4) + std::string("Exif\0\0", 6) + tiff;
  write("photo.jpg", content(kImage).insert(2, segment));
  const Words words = {"locate", "desk.map", "photo.jpg", "--camera", "unknown"};
  const Json result = document(words).at("results").at(0);
  EXPECT_NEAR(result.at("exif_focal_length").get<double>(), 30.0 / 43.2666 * 800.0, 0.01);
  EXPECT_THAT(answer(words), HasSubstr("px; 554.7 px by EXIF"));
  Words known = words;
  known.back() = "s/camera.yaml";
  EXPECT_FALSE(document(known).at("results").at(0).contains("exif_focal_length"));
}

TEST_F(LocateCliTest, FindsOneLensForAllImages) {
  write("none.jpg", "text");
  const Words words = {
      "locate",   "desk.map", "s/rgb/1.000000.jpg", "s/rgb/2.000000.jpg", "s/rgb/3.000000.jpg",
      "--camera", "shared"};
  for (const Json& result : document(words).at("results")) {
    EXPECT_EQ(result.at("verdict"), "located") << result;
    EXPECT_NEAR(result.at("camera").at("parameters").at(0).get<double>(), 525.0, 0.03 * 525.0);
    EXPECT_GT(result.at("focal_length_sigma").get<double>(), 0.0);
  }
  EXPECT_EQ(
      cairn({"locate", "desk.map", kImage, "--camera", "shared", "--depth", "s/depth/2.000000.png"})
          .exit_code,
      kWrongUsage);
  // The images that can be read are located all the same.
  Words with_text = words;
  with_text.insert(with_text.end(), {"none.jpg"});
  const CommandResult result = cairn(with_text);
  EXPECT_EQ(result.exit_code, kBadInput);
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("2.000000.jpg: located"), HasSubstr("none.jpg: unreadable: ")));
}

TEST_F(LocateCliTest, NamesPlacesThatAnImageDoesNotTellApart) {
  const LandmarkMap once = read_map(path("desk.map"));
  MapTables twice = LandmarkMap(once).tables();
  const Eigen::Vector3d away(10.0, 0.0, 0.0);
  LandmarkTable& landmarks = twice.landmarks;
  const std::size_t count = once.landmark_count();
  for (std::size_t i = 0; i < count; ++i) {
    landmarks.ids.push_back(LandmarkId{landmarks.ids[i].value + 1000000});
    landmarks.positions.emplace_back(landmarks.positions[i] + away);
  }
  DescriptorColumn& column = *landmarks.descriptors;
  column.further_offsets.clear();
  column.further.clear();
  column.known.insert(column.known.end(), column.known.begin(), column.known.begin() + count);
  const std::vector<std::uint8_t> bytes = column.bytes;
  column.bytes.insert(column.bytes.end(), bytes.begin(), bytes.end());
  landmarks.covariances.clear();
  landmarks.colors = {};
  landmarks.columns.clear();
  twice.observations = {};
  write_map(LandmarkMap(std::move(twice)), path("twice.map"));
  const CommandResult result = cairn({"locate", "twice.map", kImage});
  EXPECT_EQ(result.exit_code, kNoAlignment);
  EXPECT_THAT(result.output, ::testing::ContainsRegex("hint: Use an image that also shows what "
                                                      "tells two places apart: .* near .* near .*"
                                                      "are (9.9|10).* m from each other"));
}

TEST_F(LocateCliTest, LetsTheMapGrowByWhatTheImagesShow) {
  answer(
      {"map", "s", "-o", "parts", "--mini-map-length", "8f", "--start-from", "s/groundtruth.txt"});
  fs::copy(path("parts/0000.map"), path("start.map"));
  const std::string text =
      answer({"locate", "start.map", "s/rgb/1.166667.jpg", "s/rgb/1.666667.jpg",
              "s/rgb/2.000000.jpg", "-o", "bigger.map", "--triangulate", "--adjust"});
  EXPECT_THAT(text, AllOf(HasSubstr("new landmarks, seen by two or more of the 3 located images"),
                          HasSubstr("adjusted: reprojection error")));
  const LandmarkMap start = read_map(path("start.map"));
  const LandmarkMap bigger = read_map(path("bigger.map"));
  EXPECT_EQ(bigger.frame_count(), start.frame_count() + 3);
  EXPECT_GT(bigger.landmark_count(), start.landmark_count() + 10);
  EXPECT_TRUE(bigger.has_covariances());
  EXPECT_TRUE(bigger.landmarks().colors[bigger.landmark_count() - 1]);
  expect_refusal({"locate", "start.map", "s/rgb/1.166667.jpg", "--triangulate"}, kWrongUsage,
                 {"--triangulate", "--output"});
}

// The odometry has a world of its own.
TEST_F(LocateCliTest, LocatesImagesTogetherByTheirPosesRelativeToEachOther) {
  answer({"convert", "s/groundtruth.txt", "odometry.tum", "--transform", "1 2 3 10 20 90"});
  const Words words = {"locate",  "desk.map",     "s/rgb/1.000000.jpg", "s/rgb/2.000000.jpg",
                       "--poses", "odometry.tum", "--trajectory",       "found.tum"};
  const std::string text = answer(words);
  EXPECT_THAT(text, AllOf(HasSubstr("all images together: located: probability >99"),
                          HasSubstr("\n1.000000.jpg: "), HasSubstr("\n2.000000.jpg: ")));
  FileReader found(path("found.tum"));
  const Trajectory poses = read_trajectory(found);
  FileReader truth(path("s/groundtruth.txt"));
  const Trajectory true_poses = read_trajectory(truth);
  ASSERT_EQ(poses.size(), 2U);
  for (const TimedPose& pose : poses.poses()) {
    const TimedPose* const there = nearest_pose(true_poses, pose.timestamp_s);
    const Vector6d off = pose.world_from_camera.difference_to(there->world_from_camera);
    EXPECT_LT(off.head<3>().norm(), 0.02);
    EXPECT_LT(off.tail<3>().norm(), 0.01);
  }
  const Json json = document(words);
  EXPECT_EQ(json.at("inputs").at("poses").at("path"), "odometry.tum");
  EXPECT_EQ(json.at("options").at("poses"), "odometry.tum");
  EXPECT_EQ(json.at("results").size(), 2U);
  write("1.000000.jpg", "no image");
  const CommandResult one =
      cairn({"locate", "desk.map", "1.000000.jpg", kImage, "--poses", "zero.tum"});
  EXPECT_THAT(one.errors, HasSubstr("zero.tum"));
  write("zero.tum", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
  const CommandResult other =
      cairn({"locate", "desk.map", "1.000000.jpg", kImage, "--poses", "zero.tum"});
  EXPECT_EQ(other.exit_code, kBadInput);
  EXPECT_THAT(other.output, AllOf(HasSubstr("all images together: located"),
                                  HasSubstr("1.000000.jpg: unreadable")));
}

TEST_F(LocateCliTest, RefusesPosesThatDoNotFitTheImages) {
  const std::string first = "s/rgb/1.000000.jpg";
  write("still.tum", "1 0 0 0 0 0 0 1\n2 5 0 0 0 0 0 1\n");
  const CommandResult wrong = cairn({"locate", "desk.map", first, kImage, "--poses", "still.tum"});
  EXPECT_EQ(wrong.exit_code, kNoAlignment);
  EXPECT_THAT(wrong.output, AllOf(HasSubstr("all images together: rejected: the given poses "
                                            "contradict 1 of the 2 images"),
                                  HasSubstr("hint: Check --poses"), Not(HasSubstr("\n  tx ty"))));
  expect_refusal({"locate", "desk.map", "s/rgb/0.000000.jpg", "--poses", "still.tum"}, kBadInput,
                 {"still.tum", "0.000000.jpg at 0.000000 s", "within 0.02 s"});
  fs::copy(path(first), path("photo.jpg"));
  expect_refusal({"locate", "desk.map", first, "photo.jpg", "--poses", "still.tum"}, kWrongUsage,
                 {"photo.jpg", "'photo' is no number", "found by the images' names"});
  expect_refusal({"locate", "desk.map", first, "--poses", "still.tum", "--camera", "unknown"},
                 kBadInput, {"1.000000.jpg", "an unknown camera", "--camera"});
  expect_refusal({"locate", "desk.map", first, "--poses", "still.tum", "--camera",
                  "PINHOLE 320 240 200 200 159.5 119.5"},
                 kBadInput, {"1.000000.jpg", "640 x 480"});
  expect_refusal({"locate", "desk.map", first, "--poses", "still.tum", "--depth", "d.png"},
                 kWrongUsage, {"--depth", "--poses"});
  MapTables tables = read_map(path("desk.map")).tables();
  tables.info.length_unit = LengthUnit::kFree;
  write_map(LandmarkMap(std::move(tables)), path("free.map"));
  expect_refusal({"locate", "free.map", first, "--poses", "still.tum"}, kBadInput,
                 {"free.map", "no unit of length", "in metres"});
}

// As merge() does; the map's own names stay.
TEST_F(LocateCliTest, TellsNewImagesOfOneNameApartByTheirFolders) {
  const auto images_after = [&](const std::string& first, const std::string& second) {
    for (const auto& [file, image] : {std::pair{first, kImage}, {second, "s/rgb/0.500000.jpg"}}) {
      fs::create_directories(fs::path(path(file)).parent_path());
      fs::copy_file(path(image), path(file), fs::copy_options::overwrite_existing);
    }
    answer({"locate", "desk.map", first, second, "-o", "bigger.map"});
    std::vector<std::string> names = read_map(path("bigger.map")).frames().image_names;
    return std::vector<std::string>(names.end() - 2, names.end());
  };
  using ::testing::ElementsAre;
  EXPECT_THAT(images_after("a/new.jpg", "a/other.jpg"), ElementsAre("new.jpg", "other.jpg"));
  EXPECT_THAT(images_after("a/new.jpg", "b c/new.jpg"), ElementsAre("a/new.jpg", "b_c/new.jpg"));
  EXPECT_THAT(images_after("a/rgb/new.jpg", "b/rgb/new.jpg"),
              ElementsAre("a/rgb/new.jpg", "b/rgb/new.jpg"));
  const std::string known = read_map(path("desk.map")).frames().image_names.front();
  EXPECT_THAT(images_after("a/" + known, "a/new.jpg"), ElementsAre("a/" + known, "a/new.jpg"));
  EXPECT_EQ(read_map(path("bigger.map")).frames().image_names.front(), known);
  expect_refusal({"locate", "desk.map", "a/new.jpg", "a/new.jpg", "-o", "bigger.map"}, kWrongUsage,
                 {"new.jpg", "each image once"});
}

#ifdef CAIRN_HAS_ATLAS
TEST_F(LocateCliTest, TakesAnAtlas) {
  answer(
      {"map", "s", "-o", "parts", "--mini-map-length", "12f", "--start-from", "s/groundtruth.txt"});
  answer({"atlas", "init", "--atlas", "desk.atlas"});
  answer({"atlas", "add", "--atlas", "desk.atlas", "parts/0000.map"});
  // One map is a world of its own.
  EXPECT_THAT(answer({"locate", "desk.atlas", "s/rgb/0.500000.jpg"}), HasSubstr("located: "));
  answer({"atlas", "add", "--atlas", "desk.atlas", "parts/0001.map"});
  EXPECT_EQ(cairn({"locate", "desk.atlas", kImage}).exit_code, kWrongUsage) << "no poses yet";
  answer({"atlas", "link", "--atlas", "desk.atlas"});
  answer({"atlas", "optimize", "--atlas", "desk.atlas"});
  EXPECT_THAT(answer({"locate", "desk.atlas", "s/rgb/0.500000.jpg", "s/rgb/3.500000.jpg"}),
              HasSubstr("3.500000.jpg: located: "));
}
#endif

TEST_F(LocateCliTest, GivesTheSameBytesWhateverTheNumberOfThreads) {
  const auto with = [&](const std::string& threads) {
    Json json =
        document({"locate", "desk.map", kImage, "s/rgb/0.500000.jpg", "--threads", threads});
    return json.at("results").dump();
  };
  EXPECT_EQ(with("1"), with("2"));
}

TEST_F(LocateCliTest, NamesWhatIsWrong) {
  expect_refusal({"locate", "desk.map", "nothing.png"}, kBadInput, {"nothing.png"});
  // Among others, a file that is no image costs them nothing.
  write("text.png", "no image");
  const CommandResult batch =
      cairn({"locate", "desk.map", "nothing.png", kImage, "text.png", "--json", "r.json"});
  EXPECT_EQ(batch.exit_code, kBadInput);
  EXPECT_THAT(batch.output,
              AllOf(HasSubstr("nothing.png: unreadable: "), HasSubstr("2.000000.jpg: located: "),
                    HasSubstr("text.png: unreadable: ")));
  const Json results = Json::parse(content("r.json")).at("results");
  EXPECT_EQ(results.at(0).at("verdict"), "unreadable");
  EXPECT_TRUE(results.at(0).at("probability").is_null());
  EXPECT_EQ(results.at(1).at("verdict"), "located");
  expect_refusal({"locate", "desk.map", kImage, "--camera", "PINHOLE 320 240 262 262 159.5 119.5"},
                 kBadInput, {"2.000000.jpg", "640 x 480 pixels", "320 x 240"});
  expect_refusal({"locate", "desk.map", kImage, kImage, "--depth", "s/depth/2.000000.png"},
                 kWrongUsage, {"--depth", "2 images"});
  expect_refusal({"locate", "desk.map", kImage, "--min-probability", "2"}, kWrongUsage,
                 {"--min-probability"});
  expect_refusal({"locate", "desk.map", kImage, "--features", "1"}, kWrongUsage, {"--features"});
  expect_refusal({"locate", "desk.map"}, kWrongUsage, {"images"});
  ASSERT_EQ(cairn({"convert", "desk.map", "bare.ply"}).exit_code, kDone);
  expect_refusal({"locate", "bare.ply", kImage, "--camera", "s/camera.yaml"}, kBadInput,
                 {"bare.ply: descriptors", "none", "ORB"});
}

// A suite of its own, which is skipped without real data.
class RealLocateTest : public LocateCliTest {};

// Images of one real session in the map of another; the truth is what motion capture says of the camera.
TEST_F(RealLocateTest, FindsImagesOfAnotherRealSession) {
  const auto data = real_data();
  if (!data) GTEST_SKIP() << kNoRealData;
  const fs::path xyz = *data / "tum_fr1_xyz";
  const fs::path desk = *data / "tum_fr1_desk";
  ASSERT_EQ(cairn({"map", xyz.string(), "--camera", "fr1", "-o", "xyz.map", "--start-from",
                   (xyz / "groundtruth.txt").string()})
                .exit_code,
            kDone);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(desk / "rgb")) names.push_back(entry.path());
  std::sort(names.begin(), names.end());
  Words words = {"locate", "xyz.map", "--camera", "fr1", "--trajectory", "found.tum"};
  for (std::size_t i = 0; i < 80; i += 8) words.push_back(names.at(i));
  words.push_back(path("other/rgb/0.000000.jpg"));
  EXPECT_EQ(cairn(words).exit_code, kNoAlignment) << "the last image is of another place";
  FileReader found_file(path("found.tum"));
  const Trajectory found = read_trajectory(found_file);
  FileReader truth_file(desk / "groundtruth.txt");
  const Trajectory truth = read_trajectory(truth_file);
  EXPECT_GE(found.poses().size(), 5U);
  EXPECT_LE(found.poses().size(), 10U);
  for (const TimedPose& pose : found.poses()) {
    const auto nearest = std::min_element(truth.poses().begin(), truth.poses().end(),
                                          [&](const TimedPose& a, const TimedPose& b) {
                                            return std::abs(a.timestamp_s - pose.timestamp_s) <
                                                   std::abs(b.timestamp_s - pose.timestamp_s);
                                          });
    const Vector6d off = pose.world_from_camera.difference_to(nearest->world_from_camera);
    EXPECT_LT(off.head<3>().norm(), 0.06) << pose.timestamp_s;
    EXPECT_LT(off.tail<3>().norm(), 0.06) << pose.timestamp_s;
  }
}

}  // namespace
}  // namespace cairn::testing

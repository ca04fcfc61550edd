// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/geometry/limits.hpp"

#include "support/maps.hpp"
#include "support/point_clouds.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using testing::EqualsMap;
using testing::full_map;
using testing::full_tables;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Le;
using testing::plain_map;
using testing::plain_tables;
using testing::several_map;
using ::testing::SizeIs;
using ::testing::StartsWith;
using testing::TemporaryFolder;

constexpr double kTextNan = std::numeric_limits<double>::quiet_NaN();

LandmarkMap read_text(std::string_view text, const Execution& execution = {}) {
  MemoryReader source(text, "desk.map");
  return read_native(source, execution);
}

LandmarkMap read_file(const std::filesystem::path& path) {
  FileReader file(path);
  return read_native(file);
}

std::string native_text(const LandmarkMap& map, std::optional<int> version = std::nullopt) {
  std::string text;
  write_native(
      map, [&](std::string_view bytes) { text += bytes; }, version);
  return text;
}

// The message with which a file is refused.
std::string text_refusal(const std::function<void()>& call, ErrorKind kind = ErrorKind::kInput) {
  const std::string message = testing::refusal(kind, call);
  return message.empty() ? "accepted" : message;
}

std::string text_refusal(std::string_view text) {
  return text_refusal([&] { read_text(text); });
}

struct Refused {
  std::string text;
  std::string message;
};

void expect_text_refused(const std::vector<Refused>& all) {
  for (const auto& [text, message] : all) EXPECT_EQ(text_refusal(text), message) << text;
}

// ---- reading what is right

constexpr const char* kPlain =
    "FRAME 1 0 0 0 1 0 0 0\n"
    "FRAME 2 0.1 0 0 1 0 0 0\n"
    "LANDMARK 1 0.5 0 2 1e-04 0 0 0 1e-04 0 0 0 9e-04 2 1 447.925 255.3 2 422.06 255.3\n"
    "LANDMARK 2 0 0 2 1e-04 0 0 0 1e-04 0 0 0 9e-04 1 2 292.735 255.3\n"
    "LANDMARK 3 1 1 4 1e-04 0 0 0 1e-04 0 0 0 9e-04 0\n";

TEST(ReadNative, ReadsVersion1) {
  EXPECT_THAT(read_text(kPlain), EqualsMap(plain_map()));
}

TEST(ReadNative, ReadsTheExampleOfTheFormatsDocument) {
  const LandmarkMap map = read_text(
      "CAIRN 2\n"
      "META world_frame desk\n"
      "CAMERA 0 PINHOLE 640 480 517.3 516.5 318.6 255.3\n"
      "FRAME 7 0 0 0 1 0 0 0\n"
      "TIME 7 1305031453.374112\n"
      "VIEW 7 0\n"
      "IMAGE 7 rgb/1305031453.359684.png\n"
      "FRAME 9 0.1 0 0 1 0 0 0\n"
      "LANDMARK 3 0.5 0 2 1e-4 0 0 0 1e-4 0 0 0 9e-4 2 7 447.925 255.3 9 422.06 255.3\n"
      "COLOR 3 200 180 40\n"
      "DETAIL 3 12 2.01 0 - 1.99 1\n"
      "LANDMARK 4 0 0 2 - 1 7 318.6 255.3\n");
  MapTables expected;
  expected.info.world_frame = "desk";
  expected.cameras = {{CameraId{0}, "PINHOLE", 640, 480, {517.3, 516.5, 318.6, 255.3}}};
  expected.frames.ids = {FrameId{7}, FrameId{9}};
  expected.frames.translations = {{0, 0, 0}, {0.1, 0, 0}};
  expected.frames.quaternions = {std::array{1.0, 0.0, 0.0, 0.0}, std::array{1.0, 0.0, 0.0, 0.0}};
  expected.frames.cameras = {CameraIndex{0}, std::nullopt};
  expected.frames.timestamps_s = {1305031453.374112, std::nullopt};
  expected.frames.image_names = {"rgb/1305031453.359684.png", ""};
  expected.landmarks.ids = {LandmarkId{3}, LandmarkId{4}};
  expected.landmarks.positions = {{0.5, 0, 2}, {0, 0, 2}};
  expected.landmarks.covariances = {Eigen::Vector3d(1e-4, 1e-4, 9e-4).asDiagonal(),
                                    Eigen::Matrix3d::Constant(kTextNan)};
  expected.landmarks.colors = {Color{200, 180, 40}, std::nullopt};
  expected.observations.offsets = {0, 2, 3};
  expected.observations.frames = {FrameIndex{0}, FrameIndex{1}, FrameIndex{0}};
  expected.observations.pixels = {{447.925, 255.3}, {422.06, 255.3}, {318.6, 255.3}};
  expected.observations.keypoints = {12U, std::nullopt, std::nullopt};
  expected.observations.depths = {2.01, 1.99, std::nullopt};
  expected.observations.octaves = {0, 1, std::nullopt};
  EXPECT_THAT(map, EqualsMap(LandmarkMap(std::move(expected))));
  // The document's own numbers hang together.
  const auto pixel = project(map.cameras()[0], map.landmarks().positions[0]);
  ASSERT_TRUE(pixel.has_value());
  EXPECT_NEAR(pixel->u, 447.925, 1e-9);
}

TEST(ReadNative, TakesCovariancesRowByRow) {
  const LandmarkMap map = read_text("LANDMARK 1 0 0 0 4 1 2 1 5 3 2 3 6 0\n");
  Eigen::Matrix3d expected;
  expected << 4, 1, 2, 1, 5, 3, 2, 3, 6;
  EXPECT_EQ(map.covariance(LandmarkIndex{0}), expected);
}

TEST(ReadNative, TakesNumbersInEveryUsualForm) {
  const LandmarkMap map = read_text("FRAME 1 +1.5 -2e3 .5 1. 0E0 -0 +0.0e-5\n");
  EXPECT_EQ(map.frames().translations[0], Eigen::Vector3d(1.5, -2000.0, 0.5));
  EXPECT_EQ(map.frames().quaternions[0][0], 1.0);
  EXPECT_TRUE(std::signbit(map.frames().quaternions[0][2]));
}

TEST(ReadNative, TakesIdsOf64Bits) {
  const LandmarkMap map = read_text(
      "FRAME 18446744073709551615 0 0 0 1 0 0 0\n"
      "LANDMARK 18446744073709551615 0 0 0 0 0 0 0 0 0 0 0 0 1 18446744073709551615 1 2\n");
  EXPECT_EQ(map.frames().ids[0].value, 18446744073709551615U);
  EXPECT_EQ(map.landmarks().ids[0].value, 18446744073709551615U);
  EXPECT_EQ(map.observation_count(LandmarkIndex{0}), 1U);
}

TEST(ReadNative, KeepsQuaternionsAsTheyAreStored) {
  for (const std::string_view q : {"1.0009 0 0 0", "0.9991 0 0 0",
                                   "0.241278 -0.91412 -0.292459 "
                                   "0.143657"}) {
    const std::string text = fmt::format("FRAME 239 1.032826 0.145306 1.395813 {}\n", q);
    EXPECT_EQ(native_text(read_text(text)), text);
  }
}

TEST(ReadNative, AcceptsOtherLineEndsAndBlanks) {
  std::string crlf;
  std::string padded;
  for (const char c : std::string(kPlain)) {
    crlf += c == '\n' ? "\r\n" : std::string(1, c);
    padded += c == '\n' ? " \t \r\n\n \t\n\t " : c == ' ' ? "\t  " : std::string(1, c);
  }
  EXPECT_THAT(read_text(crlf), EqualsMap(plain_map()));
  EXPECT_THAT(read_text(padded), EqualsMap(plain_map()));
}

TEST(ReadNative, FindsAnEmptyMapInAVersionLineAlone) {
  EXPECT_THAT(read_text("CAIRN 2\n"), EqualsMap(LandmarkMap()));
  EXPECT_THAT(read_text("\n  \nCAIRN 2\n"), EqualsMap(LandmarkMap()));
}

TEST(ReadNative, SkipsCommentsInVersion2) {
  EXPECT_THAT(read_text(fmt::format("CAIRN 2\n# a comment\n#\n  #FRAME\n{}# end\n", kPlain)),
              EqualsMap(plain_map()));
}

TEST(ReadNative, TakesExtrasOfFramesAnywhereBelow) {
  const LandmarkMap map = read_text(
      "CAIRN 2\nFRAME 1 0 0 0 1 0 0 0\nFRAME 2 0 0 0 1 0 0 0\nLANDMARK 1 0 0 0 - 0\n"
      "CAMERA 3 SIMPLE_PINHOLE 64 48 50 32 24\nIMAGE 1 a  b\tc\nVIEW 2 3\nTIME 2 -1.5\n");
  EXPECT_THAT(map.frames().image_names, ElementsAre("a  b\tc", ""));
  EXPECT_THAT(map.frames().cameras, ElementsAre(std::nullopt, CameraIndex{0}));
  EXPECT_THAT(map.frames().timestamps_s, ElementsAre(std::nullopt, -1.5));
}

TEST(ReadNative, TakesExtrasOfALandmarkInAnyOrder) {
  const LandmarkMap map = read_text(
      "CAIRN 2\nFRAME 1 0 0 0 1 0 0 0\nDESCRIPTORS ORB 2\nCOLUMN a\nCOLUMN b\n"
      "LANDMARK 5 0 0 0 - 1 1 0 0\n"
      "VALUE 5 b 2\nDETAIL 5 - - -3\nVALUE 5 a 1\nDESCRIPTOR 5 aB0f\nCOLOR 5 0 255 1\n"
      "LANDMARK 4 0 0 0 - 0\nDETAIL 4\n");
  EXPECT_EQ(map.column("a")->values[0], 1.0);
  EXPECT_EQ(map.column("b")->values[0], 2.0);
  EXPECT_TRUE(std::isnan(map.column("a")->values[1]));
  EXPECT_THAT(map.landmarks().descriptors->known, ElementsAre(1, 0));
  EXPECT_THAT(map.landmarks().descriptors->bytes, ElementsAre(0xab, 0x0f, 0, 0));
  EXPECT_THAT(map.landmarks().colors, ElementsAre(Color{0, 255, 1}, std::nullopt));
  EXPECT_THAT(map.observations().octaves, ElementsAre(-3));
  EXPECT_THAT(map.observations().keypoints, IsEmpty());
}

TEST(ReadNative, KnowsNoObservationsWhereTheCountIsUnknown) {
  const LandmarkMap map = read_text("CAIRN 2\nLANDMARK 1 0 0 0 - -\nLANDMARK 2 0 0 0 - -\n");
  EXPECT_FALSE(map.has_observations());
  EXPECT_FALSE(map.has_covariances());
  EXPECT_EQ(map.landmark_count(), 2U);
}

TEST(ReadNative, UndoesEscapes) {
  const LandmarkMap map =
      read_text("CAIRN 2\nMETA world_frame %20a%25%0A%7f%c3%A9 b%20\nMETA provenance %00\n");
  EXPECT_EQ(map.info().world_frame, " a%\n\x7f\xc3\xa9 b ");
  EXPECT_THAT(map.info().provenance, ElementsAre(std::string(1, '\0')));
}

TEST(ReadNative, ReadsAPipe) {
  testing::Pipe pipe(kPlain, 7);
  Execution execution;
  execution.progress = [](double) { ADD_FAILURE() << "a share of what?"; };
  EXPECT_THAT(read_native(pipe, execution), EqualsMap(plain_map()));
}

TEST(ReadNative, ReadsAFile) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_file(folder.write("a.map", kPlain)), EqualsMap(plain_map()));
}

// ---- refusing what is wrong

constexpr const char* kFrame = "FRAME 7 0 0 0 1 0 0 0\n";

std::string frame_line(std::string_view fields) {
  return fmt::format("\n{}FRAME {}\n", kFrame, fields);
}

// A landmark with the given field, from 1 (the record) to 17, put in the place of a right one.
std::string landmark_with(std::size_t field, std::string_view text) {
  std::vector<std::string> fields = {"LANDMARK", "3",    "0.5", "0",    "2",     "1e-4",
                                     "0",        "0",    "0",   "1e-4", "0",     "0",
                                     "0",        "9e-4", "1",   "7",    "447.9", "255.3"};
  fields[field - 1] = text;
  return fmt::format("{}{}\n", kFrame, fmt::join(fields, " "));
}

TEST(ReadNative, LeavesOutAByteOrderMarkAtTheStart) {
  EXPECT_EQ(read_text("\xef\xbb\xbf" + std::string(kFrame)).frame_count(), 1U);
}

TEST(ReadNative, NamesTheFieldOfACoordinateBeyondTheLimit) {
  expect_text_refused({
      {"FRAME 7 0 -1e40 0 1 0 0 0\n",
       "desk.map:1: field 4 (ty): -1e+40 is beyond the limit; expected numbers from -1e9 to 1e9"},
      {std::string(kFrame) + "LANDMARK 3 0 0 1 0 0 0 0 0 0 0 0 0 1 7 1 1e10\n",
       "desk.map:2: field 18 (v): 1e+10 is beyond the limit; expected numbers from -1e9 to "
       "1e9"},
  });
}

TEST(ReadNative, RefusesUnknownRecords) {
  expect_text_refused({
      {"FRAM 7 0 0 0 1 0 0 0\n", "desk.map:1: unknown record 'FRAM'; expected FRAME or LANDMARK"},
      {frame_line("8 0 0 0 1 0 0 0") + "frame 9 0 0 0 1 0 0 0\n",
       "desk.map:4: unknown record 'frame'; expected FRAME or LANDMARK"},
      {"# a comment\n", "desk.map:1: unknown record '#'; expected FRAME or LANDMARK"},
      {std::string(kFrame) + "TIME 7 1\n",
       "desk.map:2: unknown record 'TIME'; expected FRAME or LANDMARK"},
      {std::string(kFrame) + "CAIRN 2\n",
       "desk.map:2: unknown record 'CAIRN'; expected FRAME or LANDMARK"},
      {std::string(kFrame) + "\xef\xbb\xbf" + std::string(kFrame),
       R"(desk.map:2: unknown record '\xef\xbb\xbfFRAME'; expected FRAME or LANDMARK)"},
  });
}

TEST(ReadNative, RefusesBrokenFrames) {
  expect_text_refused({
      {frame_line(""), "desk.map:3: field 2 (id): missing; expected more fields on this line"},
      {frame_line("8 0 0 0 1 0 0"),
       "desk.map:3: field 9 (qz): missing; expected more fields on this line"},
      {frame_line("8 0 0 0 1 0 0 0 0"),
       "desk.map:3: field 10: '0' is too much; expected the FRAME record to end here"},
      {frame_line("8 0 abc 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): 'abc' is not a number; expected a finite decimal number"},
      {frame_line("8 0 1e 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): '1e' is not a number; expected a finite decimal number"},
      {frame_line("8 0 0x10 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): '0x10' is not a number; expected a finite decimal number"},
      {frame_line("8 0 1,5 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): '1,5' is not a number; expected a finite decimal number"},
      {frame_line("8 0 +-1 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): '+-1' is not a number; expected a finite decimal number"},
      {frame_line("8 0 + 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): '+' is not a number; expected a finite decimal number"},
      {frame_line("8 0 - 0 1 0 0 0"),
       "desk.map:3: field 4 (ty): '-' is not a number; expected a finite decimal number"},
      {frame_line("-8 0 0 0 1 0 0 0"),
       "desk.map:3: field 2 (id): '-8' is not one; expected an unsigned integer of at most 64 "
       "bits"},
      {frame_line("+8 0 0 0 1 0 0 0"),
       "desk.map:3: field 2 (id): '+8' is not one; expected an unsigned integer of at most 64 "
       "bits"},
      {frame_line("8.0 0 0 0 1 0 0 0"),
       "desk.map:3: field 2 (id): '8.0' is not one; expected an unsigned integer of at most 64 "
       "bits"},
      {frame_line("18446744073709551616 0 0 0 1 0 0 0"),
       "desk.map:3: field 2 (id): '18446744073709551616' is not one; expected an unsigned integer "
       "of at most 64 bits"},
      {frame_line("7 0 0 0 1 0 0 0"),
       "desk.map:3: field 2 (id): frame 7 stands above already; expected distinct ids"},
      {frame_line("8 0 0 0 1 0.05 0 0"),
       "desk.map:3: fields 6-9 (qw qx qy qz): frame 8: quaternion of norm 1.00125; expected norm 1 "
       "within "
       "1e-3"},
      {frame_line("8 0 0 0 0.998 0 0 0"),
       "desk.map:3: fields 6-9 (qw qx qy qz): frame 8: quaternion of norm 0.998; expected norm 1 "
       "within "
       "1e-3"},
      {frame_line("8 0 0 0 0 0 0 0"),
       "desk.map:3: fields 6-9 (qw qx qy qz): frame 8: quaternion of norm 0; expected norm 1 "
       "within 1e-3"},
      {frame_line("8 0 0 0 1e200 0 0 0"),
       "desk.map:3: fields 6-9 (qw qx qy qz): frame 8: quaternion of norm inf; expected norm 1 "
       "within 1e-3"},
  });
}

TEST(ReadNative, RefusesNumbersThatAreNotFinite) {
  constexpr std::array<const char*, 18> kNames = {"",    "",    "x",   "y",   "z",   "c00",
                                                  "c01", "c02", "c10", "c11", "c12", "c20",
                                                  "c21", "c22", "",    "",    "u",   "v"};
  for (std::size_t field = 3; field <= 18; ++field) {
    if (field == 15 || field == 16) continue;
    for (const std::string_view text :
         {"nan", "NaN", "-nan", "inf", "-inf", "infinity", "1e400", "-1e400", "1e-400"}) {
      EXPECT_EQ(text_refusal(landmark_with(field, text)),
                fmt::format("desk.map:2: field {} ({}): '{}' is not a number; expected a finite "
                            "decimal number",
                            field, kNames[field - 1], text));
    }
  }
}

TEST(ReadNative, RefusesBrokenLandmarks) {
  constexpr const char* kHead = "LANDMARK 3 0.5 0 2 1e-4 0 0 0 1e-4 0 0 0 9e-4";
  const auto landmark = [&](std::string_view rest) {
    return fmt::format("{}{}{}\n", kFrame, kHead, rest);
  };
  const std::string unsigned_expected = "; expected an unsigned integer of at most 64 bits";
  expect_text_refused({
      {landmark_with(2, "-3"), "desk.map:2: field 2 (id): '-3' is not one" + unsigned_expected},
      {landmark_with(2, "99999999999999999999"),
       "desk.map:2: field 2 (id): '99999999999999999999' is not one" + unsigned_expected},
      {landmark_with(4, "y"),
       "desk.map:2: field 4 (y): 'y' is not a number; expected a finite decimal number"},
      {landmark_with(6, "-"),
       "desk.map:2: field 6 (c00): '-' is not a number; expected a finite decimal number"},
      {landmark_with(15, "-"), "desk.map:2: field 15 (n): '-' is not one" + unsigned_expected},
      {landmark_with(15, "-1"), "desk.map:2: field 15 (n): '-1' is not one" + unsigned_expected},
      {landmark_with(15, "1.0"), "desk.map:2: field 15 (n): '1.0' is not one" + unsigned_expected},
      {landmark_with(15, "18446744073709551616"),
       "desk.map:2: field 15 (n): '18446744073709551616' is not one" + unsigned_expected},
      {landmark(""), "desk.map:2: field 15 (n): missing; expected more fields on this line"},
      {landmark(" 2 7 1 2"),
       "desk.map:2: the record ends after 1 of 2 observations; expected frame_id u v for each "
       "observation"},
      {landmark(" 1"),
       "desk.map:2: the record ends after 0 of 1 observations; expected frame_id u v for each "
       "observation"},
      {landmark(" 18446744073709551615 7 1 2"),
       "desk.map:2: the record ends after 1 of 18446744073709551615 observations; expected "
       "frame_id u v for each observation"},
      {landmark(" 1 7 1 2 7 1 2"),
       "desk.map:2: more than the 1 observations that were announced; expected the record to end "
       "after them"},
      {landmark(" 0 7 1 2"),
       "desk.map:2: more than the 0 observations that were announced; expected the record to end "
       "after them"},
      {landmark(" 1 7 1"), "desk.map:2: field 18 (v): missing; expected more fields on this line"},
      {landmark(" 1 7.0 1 2"),
       "desk.map:2: field 16 (observing frame): '7.0' is not one" + unsigned_expected},
      {landmark(" 1 8 1 2"),
       "desk.map:2: field 16 (observing frame): frame 8 is unknown; expected the id of a FRAME "
       "record above"},
      {landmark(" 1 8 1 2") + "FRAME 8 0 0 0 1 0 0 0\n",
       "desk.map:2: field 16 (observing frame): frame 8 is unknown; expected the id of a FRAME "
       "record above"},
      {landmark_with(7, "1e-5"),
       "desk.map:2: fields 6-14 (c00 ... c22): landmark 3: covariance is not symmetric: opposite "
       "entries "
       "differ by 1e-05; expected a symmetric positive semi-definite matrix"},
      {landmark_with(10, "-0.25"),
       "desk.map:2: fields 6-14 (c00 ... c22): landmark 3: covariance is indefinite: its smallest "
       "eigenvalue "
       "is -0.25; expected a symmetric positive semi-definite matrix"},
  });
  EXPECT_THAT(
      text_refusal("LANDMARK 1 0 0 0 1 2 0 2 1 0 0 0 1 0\n"),
      StartsWith("desk.map:1: fields 6-14 (c00 ... c22): landmark 1: covariance is indefinite"));
}

TEST(ReadNative, NamesTheSecondLineOfALandmarkThatOccursTwice) {
  struct Ids {
    std::vector<int> ids;
    int repeated;
    std::size_t line;  // counted from 1
  };
  for (const auto& [ids, repeated, line] :
       {Ids{{1, 2, 3, 3, 4}, 3, 4}, Ids{{9, 7, 7, 1}, 7, 3}, Ids{{5, 1, 9, 2, 5, 1}, 5, 5},
        Ids{{4, 4, 4}, 4, 2}, Ids{{3, 8, 1, 8, 3}, 8, 4}}) {
    std::string text;
    std::string spread;  // with lines in between
    for (const int id : ids) {
      text += fmt::format("LANDMARK {} 0 0 0 0 0 0 0 0 0 0 0 0 0\n", id);
      spread += fmt::format("\n \nLANDMARK {} 0 0 0 0 0 0 0 0 0 0 0 0 0\n", id);
    }
    const std::string rest = fmt::format(
        ": field 2 (id): landmark {}: the id occurs twice; expected distinct ids", repeated);
    EXPECT_EQ(text_refusal(text), fmt::format("desk.map:{}{}", line, rest));
    EXPECT_EQ(text_refusal(spread), fmt::format("desk.map:{}{}", 3 * line, rest));
  }
}

TEST(ReadNative, RefusesFilesWithoutRecords) {
  const std::string message = "desk.map: the file is empty; expected FRAME and LANDMARK records";
  for (const std::string_view text : {"", "\n", "\n\n  \n\t\r\n", "   "}) {
    EXPECT_EQ(text_refusal(text), message);
  }
}

TEST(ReadNative, SaysThatTheLastLineDoesNotEnd) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const std::string text = std::string(kFrame) + "FRAME 8 0 0 0 1 0 0 0";
  const auto frames = [&](const std::string& bytes) {
    MemoryReader source(bytes, "desk.map");
    return read_native(source, execution).frame_count();
  };
  EXPECT_EQ(frames(text + "\n"), 2U);
  EXPECT_EQ(frames(text + "\n  "), 2U);
  EXPECT_THAT(remarks.losses, ::testing::IsEmpty());
  EXPECT_EQ(frames(text), 2U);
  EXPECT_THAT(remarks.losses,
              ::testing::ElementsAre(HasSubstr("desk.map:2: the last line does not end")));
  EXPECT_THAT(text_refusal(text.substr(0, text.size() - 2)), HasSubstr("(qz): missing"));
  EXPECT_EQ(remarks.texts, remarks.losses);
}

TEST(ReadNative, LeavesOutLandmarksThatAreTooFarAway) {
  testing::Remarks remarks;
  const Execution execution{.log = remarks.sink()};
  const std::string text =
      "CAIRN 2\n" + std::string(kFrame) +
      "LANDMARK 3 0 0 5e11 - 1 7 1 2\nCOLOR 3 1 2 3\nLANDMARK 4 0 0 1 - 1 7 3 4\nCOLOR 4 5 6 7\n";
  MemoryReader source(text, "desk.map");
  const LandmarkMap map = read_native(source, execution);
  EXPECT_THAT(map.landmarks().ids, ::testing::ElementsAre(LandmarkId{4}));
  EXPECT_THAT(map.landmarks().colors, ::testing::ElementsAre(Color{5, 6, 7}));
  EXPECT_EQ(map.observed_pixels(LandmarkIndex{0})[0].u, 3.0);
  EXPECT_THAT(remarks.losses,
              ::testing::ElementsAre(HasSubstr("desk.map: 1 of 2 landmarks left out")));
  // Messages still name the line.
  EXPECT_THAT(text_refusal(text + "LANDMARK 4 0 0 1 - 0\n"), HasSubstr("desk.map:7: field 2 (id)"));
}

TEST(ReadNative, GivesAWholePartOrNothingOfACutFile) {
  for (const std::string& text : {std::string(kPlain), native_text(full_map())}) {
    const LandmarkMap whole = read_text(text);
    std::size_t accepted = 0;
    std::size_t accepted_within_lines = 0;
    for (std::size_t size = 0; size < text.size(); ++size) {
      const std::string_view cut = std::string_view(text).substr(0, size);
      try {
        const LandmarkMap part = read_text(cut);
        ++accepted;
        accepted_within_lines += cut.back() == '\n' ? 0 : 1;
        EXPECT_LE(part.frame_count(), whole.frame_count());
        EXPECT_LE(part.landmark_count(), whole.landmark_count());
        // What was read are whole records, the first of them.
        for (std::uint32_t i = 0; i < part.landmark_count(); ++i) {
          EXPECT_EQ(part.landmarks().ids[i], whole.landmarks().ids[i]);
          EXPECT_EQ(part.observation_count(LandmarkIndex{i}),
                    whole.observation_count(LandmarkIndex{i}));
        }
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::kInput);
        EXPECT_THAT(error.what(), StartsWith("desk.map"));
      }
    }
    // Cuts between records are accepted: one a line, but for the last and the empty file. Others are if the last record
    // may be whole.
    EXPECT_EQ(accepted - accepted_within_lines + 1,
              static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')));
  }
}

TEST(ReadNative, RefusesBytesThatAreNoText) {
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    std::string rubbish(1 + random() % 5000, '\0');
    for (char& c : rubbish) c = static_cast<char>(random());
    EXPECT_THAT(text_refusal(rubbish), StartsWith("desk.map:")) << i;
  }
  EXPECT_THAT(text_refusal(std::string("FRAME\0 7", 8)), StartsWith("desk.map:1: "));
  EXPECT_EQ(text_refusal(std::string("FRAME 7\0 0 0 0 1 0 0 0\n", 23)),
            "desk.map:1: field 2 (id): '7\\x00' is not one; expected an unsigned integer of at "
            "most 64 bits");
}

TEST(ReadNative, SurvivesDamageOfSingleBytes) {
  const std::string whole = native_text(full_map());
  std::mt19937 random(2);
  std::size_t refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = whole;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    try {
      const std::string text = native_text(read_text(damaged), 2);
      EXPECT_EQ(native_text(read_text(text), 2), text);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
      EXPECT_THAT(error.what(), StartsWith("desk.map"));
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000U);
}

TEST(ReadNative, SaysWhyAFileCannotBeRead) {
  const TemporaryFolder folder;
  EXPECT_EQ(text_refusal([&] { read_file(folder / "missing.map"); }),
            (folder / "missing.map").string() +
                ": cannot be read: No such file or directory; expected a readable file");
  EXPECT_EQ(text_refusal([&] { read_file(folder.path()); }),
            folder.path().string() + ": cannot be read: Is a directory; expected a readable file");
  const auto path = folder.write("broken.map", "FRAME x\n");
  EXPECT_EQ(
      text_refusal([&] { read_file(path); }),
      path.string() +
          ":1: field 2 (id): 'x' is not one; expected an unsigned integer of at most 64 bits");
}

TEST(ReadNative, SaysThatAFileMayNotBeRead) {
  if (::geteuid() == 0) {
    GTEST_SKIP() << "runs as root, whom file permissions do not bind: nothing was tested";
  }
  const TemporaryFolder folder;
  const auto path = folder.write("secret.map", kPlain);
  ASSERT_EQ(::chmod(path.c_str(), 0), 0);
  EXPECT_EQ(text_refusal([&] { read_file(path); }),
            path.string() + ": cannot be read: Permission denied; expected a readable file");
}

// ---- refusing what is wrong in version 2

TEST(ReadNative, RefusesOtherVersions) {
  expect_text_refused({
      {"CAIRN 4\n", "desk.map:1: field 2 (version): format version 4; expected 2 or 3"},
      {"CAIRN 1\n", "desk.map:1: field 2 (version): format version 1; expected 2 or 3"},
      {"CAIRN two\n",
       "desk.map:1: field 2 (version): 'two' is not one; expected an unsigned integer of at most "
       "64 bits"},
      {"CAIRN\n", "desk.map:1: field 2 (version): missing; expected more fields on this line"},
      {"CAIRN 2 3\n",
       "desk.map:1: field 3: '3' is too much; expected the CAIRN record to end here"},
      {"CAIRN 2\nCAIRN 2\n", "desk.map:2: unknown record 'CAIRN'; expected a record of version 2"},
      {"CAIRN 2\nPOINT 1\n", "desk.map:2: unknown record 'POINT'; expected a record of version 2"},
      {"# first\nCAIRN 2\n", "desk.map:1: unknown record '#'; expected FRAME or LANDMARK"},
  });
}

// Version 2 with a camera, a frame, descriptors, a column and a landmark of one observation on its
// lines 1 to 6, then `lines` from line 7.
std::string after_landmark(std::string_view lines) {
  return fmt::format(
      "CAIRN 2\nCAMERA 0 SIMPLE_PINHOLE 64 48 50 32 24\n{}DESCRIPTORS ORB 2\nCOLUMN weight\n"
      "LANDMARK 3 0 0 0 - 1 7 1 2\n{}\n",
      kFrame, lines);
}

constexpr const char* kSecond = "the same is said above already; expected it once";
constexpr const char* kMissing = "missing; expected more fields on this line";

TEST(ReadNative, RefusesBrokenMeta) {
  const auto meta = [](std::string_view lines) { return fmt::format("CAIRN 2\n{}\n", lines); };
  expect_text_refused({
      {meta("META"), fmt::format("desk.map:2: field 2 (key): {}", kMissing)},
      {meta("META colour red"),
       "desk.map:2: field 2 (key): 'colour' is no key; expected length_unit, world_frame, gravity, "
       "georeference, control_point, control_view, uuid or provenance"},
      {meta("META length_unit feet"),
       "desk.map:2: field 3 (length_unit): 'feet' is no unit of length; expected metres or free"},
      {meta("META length_unit free free"),
       "desk.map:2: field 4: 'free' is too much; expected the META record to end here"},
      {meta("META length_unit metres\nMETA length_unit free"),
       fmt::format("desk.map:3: {}", kSecond)},
      {meta("META world_frame"), fmt::format("desk.map:2: field 3 (world_frame): {}", kMissing)},
      {meta("META world_frame a\nMETA world_frame b"), fmt::format("desk.map:3: {}", kSecond)},
      {meta("META uuid a\nMETA uuid a"), fmt::format("desk.map:3: {}", kSecond)},
      {meta("META gravity 0 0 1\nMETA gravity 0 0 1"), fmt::format("desk.map:3: {}", kSecond)},
      {meta("META gravity 0 0"), fmt::format("desk.map:2: field 5 (z): {}", kMissing)},
      {meta("META gravity 0 0 -9.81"),
       "desk.map:2: fields 3-5 (x y z): gravity: (0, 0, -9.81) is not a unit vector; expected norm "
       "1 "
       "within 1e-3"},
      {meta("META georeference 47 8 400 1 1 0 0 0 0 0"),
       fmt::format("desk.map:2: field 13 (tz): {}", kMissing)},
      {meta("META georeference 91 8 400 1 1 0 0 0 0 0 0"),
       "desk.map:2: georeference: latitude 91 is out of range; expected degrees from -90 to 90 and "
       "-180 to 180, metres from -1e9 to 1e9"},
      {meta("META georeference 47 8 400 1 1 0 0 0 0 0 0\nMETA georeference 0 0 0 1 1 0 0 0 0 0 0"),
       fmt::format("desk.map:3: {}", kSecond)},
      {meta("META control_view 1 2 a.jpg"),
       "desk.map:2: no control point stands above; expected META control_point before it"},
      {meta("META control_point 47 8 -"), fmt::format("desk.map:2: field 6 (name): {}", kMissing)},
      {meta("META uuid a\nMETA control_point 47 8 1e10 nail"),
       "desk.map:3: control point 'nail': altitude 10000000000 is out of range; expected degrees "
       "from "
       "-90 to 90 and -180 to 180, metres from -1e9 to 1e9"},
      {meta("META provenance"), fmt::format("desk.map:2: field 3 (provenance): {}", kMissing)},
  });
  for (const std::string_view text : {"%", "a%", "a%2", "%2 b", "%g0", "%0g", "%%25", "100 %"}) {
    EXPECT_EQ(text_refusal(meta(fmt::format("META uuid {}", text))),
              "desk.map:2: field 3 (uuid): '%' that starts no escape; expected two hexadecimal "
              "digits after each '%'")
        << text;
  }
}

TEST(ReadNative, RefusesBrokenCameras) {
  const auto camera = [](std::string_view line) { return after_landmark(line); };
  expect_text_refused({
      {camera("CAMERA 0 SIMPLE_PINHOLE 64 48 50 32 24"),
       "desk.map:7: field 2 (id): camera 0 stands above already; expected distinct ids"},
      {camera("CAMERA 1 SIMPLE_PINHOLE 64 48 50 32"),
       "desk.map:7: camera model SIMPLE_PINHOLE has 3 parameters (f cx cy), not 2; expected a "
       "usable camera"},
      {camera("CAMERA 1 SIMPLE_PINHOLE 64 48 -50 32 24"),
       "desk.map:7: focal length f is -50, not positive; expected a usable camera"},
      {camera("CAMERA 1 SIMPLE_PINHOLE 0 48 50 32 24"),
       "desk.map:7: the image size is 0; expected a usable camera"},
      {camera("CAMERA 1 SIMPLE_PINHOLE 4294967296 48 50 32 24"),
       "desk.map:7: field 4 (width): '4294967296' is not one; expected an unsigned integer of 32 "
       "bits"},
      {camera("CAMERA 1 SIMPLE_PINHOLE 64 48 50 32 x"),
       "desk.map:7: field 8 (parameter): 'x' is not a number; expected a finite decimal number"},
      {camera("CAMERA 1"), fmt::format("desk.map:7: field 3 (model): {}", kMissing)},
  });
  EXPECT_THAT(
      text_refusal(camera("CAMERA 1 DOUBLE_SPHERE 64 48 50 32 24")),
      AllOf(StartsWith("desk.map:7: camera model 'DOUBLE_SPHERE' is none of SIMPLE_PINHOLE, "),
            HasSubstr("; expected a usable camera")));
}

TEST(ReadNative, RefusesBrokenExtrasOfFrames) {
  const std::string unknown = " is unknown; expected the id of a ";
  expect_text_refused({
      {after_landmark("TIME 8 1"),
       "desk.map:7: field 2 (frame): frame 8" + unknown + "FRAME record above"},
      {after_landmark("VIEW 8 0\nFRAME 8 0 0 0 1 0 0 0"),
       "desk.map:7: field 2 (frame): frame 8" + unknown + "FRAME record above"},
      {after_landmark("IMAGE 8 a"),
       "desk.map:7: field 2 (frame): frame 8" + unknown + "FRAME record above"},
      {after_landmark("VIEW 7 1\nCAMERA 1 SIMPLE_PINHOLE 64 48 50 32 24"),
       "desk.map:7: field 3 (camera): camera 1" + unknown + "CAMERA record above"},
      {after_landmark("TIME 7 1\nTIME 7 1"), fmt::format("desk.map:8: {}", kSecond)},
      {after_landmark("GNSS 7 47 8 400"),
       fmt::format("desk.map:7: field 6 (accuracy): {}", kMissing)},
      {after_landmark("GNSS 7 47 8 400 -\nGNSS 7 47 8 400 -"),
       fmt::format("desk.map:8: {}", kSecond)},
      {after_landmark("GNSS 7 47 8 400 0"),
       "desk.map:7: frame 7: GNSS accuracy 0; expected a positive number of metres, at most 1e9"},
      {after_landmark("VIEW 7 0\nVIEW 7 0"), fmt::format("desk.map:8: {}", kSecond)},
      {after_landmark("IMAGE 7 a\nIMAGE 7 a"), fmt::format("desk.map:8: {}", kSecond)},
      {after_landmark("TIME 7"), fmt::format("desk.map:7: field 3 (seconds): {}", kMissing)},
      {after_landmark("TIME 7 noon"),
       "desk.map:7: field 3 (seconds): 'noon' is not a number; expected a finite decimal number"},
      {after_landmark("TIME 7 1 2"),
       "desk.map:7: field 4: '2' is too much; expected the TIME record to end here"},
      {after_landmark("IMAGE 7"), fmt::format("desk.map:7: field 3 (image): {}", kMissing)},
      {after_landmark("IMAGE 7 a%zz"),
       "desk.map:7: field 3 (image): '%' that starts no escape; expected two hexadecimal digits "
       "after each '%'"},
  });
}

TEST(ReadNative, RefusesExtrasOfLandmarksOutOfPlace) {
  for (const std::string_view extra : {"COLOR 3 1 2 3", "DESCRIPTOR 3 0000", "VALUE 3 weight 1",
                                       "DETAIL 3 - - -", "MEASURED 3 - -"}) {
    const std::string elsewhere =
        ": field 2 (landmark): landmark 3 is not the one directly above; expected the id of the "
        "LANDMARK record above";
    EXPECT_EQ(text_refusal(after_landmark(fmt::format("LANDMARK 4 0 0 0 - 0\n{}", extra))),
              "desk.map:8" + elsewhere);
    EXPECT_EQ(text_refusal(fmt::format("CAIRN 2\n{}\n", extra)), "desk.map:2" + elsewhere);
    EXPECT_EQ(text_refusal(after_landmark(fmt::format("{0}\n{0}", extra))),
              fmt::format("desk.map:8: {}", kSecond));
    EXPECT_EQ(read_text(after_landmark(extra)).landmark_count(), 1U);
  }
}

TEST(ReadNative, RefusesBrokenExtrasOfLandmarks) {
  constexpr const char* kByte = "; expected an integer from 0 to 255";
  expect_text_refused({
      {after_landmark("COLOR 3 1 2"), fmt::format("desk.map:7: field 5 (blue): {}", kMissing)},
      {after_landmark("COLOR 3 1 256 3"),
       fmt::format("desk.map:7: field 4 (green): '256' is not one{}", kByte)},
      {after_landmark("COLOR 3 -1 2 3"),
       fmt::format("desk.map:7: field 3 (red): '-1' is not one{}", kByte)},
      {after_landmark("COLOR 3 1 2 3 4"),
       "desk.map:7: field 6: '4' is too much; expected the COLOR record to end here"},
      {after_landmark("DESCRIPTOR 3 00"),
       "desk.map:7: field 3 (descriptor): 2 hexadecimal digits; expected 4, two a byte"},
      {after_landmark("DESCRIPTOR 3 000000"),
       "desk.map:7: field 3 (descriptor): 6 hexadecimal digits; expected 4, two a byte"},
      {after_landmark("DESCRIPTOR 3 00g0"),
       "desk.map:7: field 3 (descriptor): not hexadecimal; expected digits 0-9 and a-f"},
      {after_landmark("DESCRIPTOR 3 00 00"),
       "desk.map:7: field 3 (descriptor): 2 hexadecimal digits; expected 4, two a byte"},
      {"CAIRN 2\nLANDMARK 3 0 0 0 - 0\nDESCRIPTOR 3 0000\n",
       "desk.map:3: no DESCRIPTORS record stands above; expected one"},
      {after_landmark("VALUE 3 height 1"),
       "desk.map:7: field 3 (column): 'height' is no column; expected the name of a COLUMN record "
       "above"},
      {after_landmark("VALUE 3 weight nan"),
       "desk.map:7: field 4 (value): 'nan' is not a number; expected a finite decimal number"},
      {after_landmark("VALUE 3 weight"), fmt::format("desk.map:7: field 4 (value): {}", kMissing)},
      {after_landmark("DETAIL 3"), fmt::format("desk.map:7: field 3 (keypoint): {}", kMissing)},
      {after_landmark("DETAIL 3 1 1"), fmt::format("desk.map:7: field 5 (octave): {}", kMissing)},
      {after_landmark("DETAIL 3 1 1 1 1"),
       "desk.map:7: field 6: '1' is too much; expected the DETAIL record to end here"},
      {after_landmark("DETAIL 3 4294967296 1 1"),
       "desk.map:7: field 3 (keypoint): '4294967296' is not one; expected an unsigned integer of "
       "32 bits, or -"},
      {after_landmark("DETAIL 3 1 inf 1"),
       "desk.map:7: field 4 (depth): 'inf' is not a number; expected a finite decimal number"},
      {after_landmark("DETAIL 3 1 1 0.5"),
       "desk.map:7: field 5 (octave): '0.5' is not one; expected an integer, or -"},
      {after_landmark("MEASURED 3 guess 1"),
       "desk.map:7: field 3 (source): 'guess' is no way to measure a pixel; expected corner, "
       "patch, reference or -"},
      {after_landmark("MEASURED 3 patch 0"),
       "desk.map:7: field 4 (sigma): 0; expected a positive number of pixels, at most 1e9, or -"},
      {after_landmark("MEASURED 3 patch 1\nMEASURED 3 patch 1"),
       "desk.map:8: the same is said above already; expected it once"},
  });
}

TEST(ReadNative, RefusesBrokenDeclarations) {
  std::string many;
  for (std::size_t i = 0; i < kMostNamedColumns; ++i) many += fmt::format("COLUMN c{}\n", i);
  EXPECT_EQ(read_text("CAIRN 2\n" + many).landmarks().columns.size(), kMostNamedColumns);
  expect_text_refused({
      {after_landmark("DESCRIPTORS ORB 2"), fmt::format("desk.map:7: {}", kSecond)},
      {"CAIRN 2\nDESCRIPTORS ORB 0\n", "desk.map:2: field 3 (bytes): 0 bytes; expected 1 to 4096"},
      {"CAIRN 2\nDESCRIPTORS ORB 4097\n",
       "desk.map:2: field 3 (bytes): 4097 bytes; expected 1 to 4096"},
      {"CAIRN 2\nDESCRIPTORS ORB 4294967296\n",
       "desk.map:2: field 3 (bytes): '4294967296' is not one; expected an unsigned integer"},
      {"CAIRN 2\nDESCRIPTORS \xc3\xa9 32\n",
       "desk.map:2: field 2 (kind): '\\xc3\\xa9' is not a name; expected visible ASCII"},
      {"CAIRN 2\nDESCRIPTORS ORB\n", fmt::format("desk.map:2: field 3 (bytes): {}", kMissing)},
      {after_landmark("COLUMN weight"), fmt::format("desk.map:7: {}", kSecond)},
      {"CAIRN 2\nCOLUMN a\x01z\n",
       "desk.map:2: field 2 (name): 'a\\x01z' is not a name; expected visible ASCII"},
      {"CAIRN 2\nCOLUMN\n", fmt::format("desk.map:2: field 2 (name): {}", kMissing)},
      {"CAIRN 2\nCOLUMN two words\n",
       "desk.map:2: field 3: 'words' is too much; expected the COLUMN record to end here"},
      {"CAIRN 2\n" + many + "COLUMN one_more\n",
       fmt::format("desk.map:{}: too many columns; expected at most {}", kMostNamedColumns + 2,
                   kMostNamedColumns)},
  });
}

TEST(ReadNative, RefusesMapsThatHalfKnowTheirObservations) {
  const std::string message =
      "desk.map:3: some observation counts are '-' and some are not; expected all of them or none, "
      "as for the first landmark";
  EXPECT_EQ(text_refusal("CAIRN 2\nLANDMARK 1 0 0 0 - -\nLANDMARK 2 0 0 0 - 0\n"), message);
  EXPECT_EQ(text_refusal("CAIRN 2\nLANDMARK 1 0 0 0 - 0\nLANDMARK 2 0 0 0 - -\n"), message);
  EXPECT_EQ(text_refusal("CAIRN 2\nLANDMARK 1 0 0 0 - - 7\n"),
            "desk.map:2: field 8: '7' is too much; expected the LANDMARK record to end here");
}

// ---- writing, and reading that back

TEST(WriteNative, WritesVersion1ByteForByte) {
  EXPECT_EQ(native_text(plain_map()), kPlain);
  EXPECT_EQ(native_text(plain_map(), 1), kPlain);
}

TEST(WriteNative, WritesVersion2ByteForByte) {
  EXPECT_EQ(native_text(plain_map(), 2), std::string("CAIRN 2\n") + kPlain);
  EXPECT_EQ(
      native_text(full_map()),
      "CAIRN 2\n"
      "META length_unit free\n"
      "META world_frame desk\n"
      "META gravity 0 0.6 0.8\n"
      "META georeference 47.37 8.54 408 2.5 0.6 0 0.8000004 0 1 -2 0.1\n"
      "META control_point 47.3702 8.5401 409.25 nail 1\n"
      "META control_view 12.5 -0 rgb/1.png\n"
      "META control_view 0.1 3e+05 %20b%25.png\n"
      "META control_point -0 180 - %0a\n"
      "META uuid 123e4567-e89b-12d3-a456-426614174000\n"
      "META provenance made by hand\n"
      "META provenance %20100 %25 of it%0a\n"
      "CAMERA 5 PINHOLE 640 480 517.3 516.5 318.6 255.3\n"
      "CAMERA 2 OPENCV_FISHEYE 320 240 190 191 160 120 0.01 -0.002 0 0\n"
      "DESCRIPTORS ORB 2\n"
      "COLUMN confidence\n"
      "COLUMN never_set\n"
      "FRAME 7 0 -0 0 1 0 0 0\n"
      "VIEW 7 2\n"
      "IMAGE 7 rgb/1.png\n"
      "GNSS 7 47.3701 8.54 410.5 3.5\n"
      "FRAME 18446744073709551615 0.1 0.2 -0.3 0.5 -0.5 0.5 0.5\n"
      "TIME 18446744073709551615 1305031453.374112\n"
      "FRAME 3 1e-310 4.5 0.3333333333333333 0.6 0 0.8000004 0\n"
      "TIME 3 0\n"
      "VIEW 3 5\n"
      "IMAGE 3 %2050%25%09of%7f\xc3\xa9%20\n"
      "GNSS 3 -0 -180 1e-300 -\n"
      "LANDMARK 30 0.5 0 2 2e-04 1e-05 -3e-05 1e-05 1e-04 0 -3e-05 0 9e-04 2 7 447.925 255.3 3 "
      "-0.5 479.5\n"
      "COLOR 30 200 180 40\n"
      "DESCRIPTOR 30 00ff\n"
      "VALUE 30 confidence 0.25\n"
      "DETAIL 30 12 2.01 - - 1.99 1\n"
      "MEASURED 30 reference 0.05 patch 0.4\n"
      "LANDMARK 10 -1 0.25 3 - 1 18446744073709551615 0.1 0.2\n"
      "DETAIL 10 4294967295 - -2147483648\n"
      "MEASURED 10 - 1.5\n"
      "LANDMARK 9223372036854775808 1e+08 -1e-300 0.1 0 0 0 0 0 0 0 0 0 0\n"
      "COLOR 9223372036854775808 0 0 0\n"
      "DESCRIPTOR 9223372036854775808 1ab2\n"
      "VALUE 9223372036854775808 confidence -0\n"
      "LANDMARK 20 0 0 1 2e-05 1.0000000000000002e-06 -3e-06 1.0000000000000002e-06 1e-05 0 "
      "-3e-06 0 9e-05 2 3 1e-05 1e+05 18446744073709551615 -0 3\n"
      "COLOR 20 255 255 255\n"
      "VALUE 20 confidence 1\n"
      "DETAIL 20 0 - 0 - - -\n"
      "MEASURED 20 corner - - -\n");
}

TEST(WriteNative, IsReadBackBitForBit) {
  EXPECT_THAT(read_text(native_text(plain_map(), 1)), EqualsMap(plain_map()));
  EXPECT_THAT(read_text(native_text(plain_map(), 2)), EqualsMap(plain_map()));
  EXPECT_THAT(read_text(native_text(full_map())), EqualsMap(full_map()));
  EXPECT_THAT(read_text(native_text(LandmarkMap())), EqualsMap(LandmarkMap()));
  MapTables unknown = full_tables();
  unknown.observations = {};
  const LandmarkMap map(std::move(unknown));
  EXPECT_THAT(read_text(native_text(map)), EqualsMap(map));
}

TEST(WriteNative, IsReadBackBitForBitWithAnyDoubles) {
  std::mt19937_64 random(3);
  const std::vector<double> corners = {0.0,
                                       -0.0,
                                       5e-324,
                                       -5e-324,
                                       std::numeric_limits<double>::min(),
                                       std::numeric_limits<double>::max(),
                                       std::numeric_limits<double>::lowest(),
                                       std::numeric_limits<double>::epsilon(),
                                       1e22,
                                       1e23,
                                       0.1,
                                       9007199254740993.0};
  // Any bit pattern that is a number, and every corner now and then; denormal on purpose too.
  const auto any = [&] {
    for (;;) {
      const std::uint64_t bits = random();
      if (bits % 8 == 0) return corners[random() % corners.size()];
      const auto value = std::bit_cast<double>(bits % 8 == 1 ? bits & 0x800fffffffffffffU : bits);
      if (std::isfinite(value)) return value;
    }
  };
  const auto within = [&](double limit) {
    for (;;) {
      const double value = any();
      if (std::abs(value) <= limit) return value;
    }
  };
  const auto length = [&] { return within(kLargestCoordinate); };
  const auto variance = [&] { return std::abs(within(kLargestVariance)); };
  MapTables tables;
  tables.observations.offsets = {0};
  for (std::uint32_t i = 0; i < 2000; ++i) {
    tables.frames.ids.push_back(FrameId{(random() & ~std::uint64_t{4095}) | i});
    tables.frames.translations.emplace_back(length(), length(), length());
    const auto angle = static_cast<double>(random() % 1000);
    tables.frames.quaternions.push_back({std::cos(angle), 0.0, std::sin(angle), -0.0});
    tables.landmarks.ids.push_back(LandmarkId{(random() & ~std::uint64_t{4095}) | i});
    tables.landmarks.positions.emplace_back(length(), length(), length());
    tables.landmarks.covariances.emplace_back(
        Eigen::Vector3d(variance(), variance(), variance()).asDiagonal());
    for (std::uint64_t k = random() % 4; k > 0; --k) {
      tables.observations.frames.push_back(FrameIndex{static_cast<std::uint32_t>(random() % 2000)});
      tables.observations.pixels.push_back({length(), length()});
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  const LandmarkMap version_1(tables);
  EXPECT_EQ(version_1_loss(version_1), std::nullopt);
  EXPECT_THAT(read_text(native_text(version_1, 1)), EqualsMap(version_1));

  tables.landmarks.columns = {{"any", {}}};
  tables.frames.timestamps_s.resize(2000);
  for (std::size_t i = 0; i < 2000; ++i) {
    tables.landmarks.columns[0].values.push_back(any());
    if (random() % 2 == 0) tables.frames.timestamps_s[i] = within(kLargestTimestamp);
  }
  for (std::size_t i = 0; i < tables.observations.frames.size(); ++i) {
    tables.observations.depths.emplace_back(length());
  }
  const LandmarkMap version_2(tables);
  EXPECT_THAT(read_text(native_text(version_2)), EqualsMap(version_2));
}

TEST(WriteNative, EscapesEveryTextSoThatItIsReadBack) {
  std::string all_bytes;
  for (int i = 0; i < 256; ++i) all_bytes += static_cast<char>(i);
  for (const std::string& text : {all_bytes, std::string(" "), std::string("  \t"),
                                  std::string("%"), std::string("%41"), std::string("# no comment"),
                                  std::string("\r\n"), std::string(" a "), std::string(1, '\0')}) {
    MapTables tables = plain_tables();
    tables.info.world_frame = text;
    tables.info.uuid = text;
    tables.info.provenance = {text, text};
    tables.frames.image_names = {text, "b"};
    const LandmarkMap map(std::move(tables));
    EXPECT_THAT(read_text(native_text(map)), EqualsMap(map));
  }
}

TEST(WriteNative, ChoosesVersion1WhereNothingIsLost) {
  EXPECT_EQ(version_1_loss(plain_map()), std::nullopt);
  EXPECT_THAT(native_text(plain_map()), StartsWith("FRAME"));
  EXPECT_THAT(native_text(full_map()), StartsWith("CAIRN 2\n"));
  EXPECT_EQ(native_text(LandmarkMap()), "CAIRN 2\n");
}

TEST(WriteNative, NamesWhatVersion1WouldLose) {
  struct Loss {
    const char* what;
    std::function<void(MapTables&)> add;
  };
  const std::vector<Loss> losses = {
      {"the free scale", [](MapTables& t) { t.info.length_unit = LengthUnit::kFree; }},
      {"the name of the world frame", [](MapTables& t) { t.info.world_frame = "desk"; }},
      {"the direction of gravity",
       [](MapTables& t) { t.info.gravity = Eigen::Vector3d(0.0, 0.0, -1.0); }},
      {"the georeference", [](MapTables& t) { t.info.georeference = GeoReference(); }},
      {"the control points",
       [](MapTables& t) {
         t.info.control_points = {{"nail", 47.0, 8.0, std::nullopt, {}}};
       }},
      {"the UUID", [](MapTables& t) { t.info.uuid = "a"; }},
      {"the provenance", [](MapTables& t) { t.info.provenance = {"a"}; }},
      {"the cameras",
       [](MapTables& t) {
         t.cameras = {{CameraId{0}, "SIMPLE_PINHOLE", 64, 48, {50, 32, 24}}};
       }},
      {"the frames' times",
       [](MapTables& t) {
         t.frames.timestamps_s = {1.0, std::nullopt};
       }},
      {"the frames' GNSS positions",
       [](MapTables& t) {
         t.frames.gnss = {std::nullopt, GnssFix()};
       }},
      {"the frames' image names",
       [](MapTables& t) {
         t.frames.image_names = {"", "a"};
       }},
      {"the landmarks' colours",
       [](MapTables& t) {
         t.landmarks.colors = {std::nullopt, Color{}, std::nullopt};
       }},
      {"the landmarks' descriptors",
       [](MapTables& t) {
         t.landmarks.descriptors = DescriptorColumn{"ORB", 1, {1, 0, 0}, {1, 0, 0}};
       }},
      {"the landmarks' named columns",
       [](MapTables& t) {
         t.landmarks.columns = {{"a", {1.0, 2.0, 3.0}}};
       }},
      {"that observations are unknown", [](MapTables& t) { t.observations = {}; }},
      {"that covariances are unknown", [](MapTables& t) { t.landmarks.covariances = {}; }},
      {"that covariances are unknown",
       [](MapTables& t) { t.landmarks.covariances[1].setConstant(kTextNan); }},
      {"the observations' keypoints, depths and octaves",
       [](MapTables& t) {
         t.observations.keypoints = {1U, std::nullopt, std::nullopt};
       }},
      {"the observations' keypoints, depths and octaves",
       [](MapTables& t) {
         t.observations.depths = {1.0, std::nullopt, std::nullopt};
       }},
      {"the observations' keypoints, depths and octaves",
       [](MapTables& t) {
         t.observations.octaves = {1, std::nullopt, std::nullopt};
       }},
      {"how the observations were measured",
       [](MapTables& t) {
         t.observations.sources = {PixelSource::kPatch, std::nullopt, std::nullopt};
       }},
      {"how the observations were measured",
       [](MapTables& t) {
         t.observations.sigmas_px = {0.5, std::nullopt, std::nullopt};
       }},
      {"that the map is empty", [](MapTables& t) { t = {}; }},
  };
  for (const Loss& loss : losses) {
    SCOPED_TRACE(loss.what);
    MapTables tables = plain_tables();
    loss.add(tables);
    const LandmarkMap map(std::move(tables));
    EXPECT_EQ(version_1_loss(map), loss.what);
    EXPECT_EQ(
        text_refusal([&] { native_text(map, 1); }, ErrorKind::kMisuse),
        fmt::format("version 1 of the text format: would lose {}; expected version 2", loss.what));
    EXPECT_THAT(native_text(map), StartsWith("CAIRN 2\n"));
    EXPECT_THAT(read_text(native_text(map)), EqualsMap(map));
  }
}

TEST(WriteNative, RefusesVersionsThatDoNotExist) {
  for (const int version : {0, 4, -1}) {
    EXPECT_EQ(text_refusal([&] { native_text(plain_map(), version); }, ErrorKind::kMisuse),
              fmt::format("version: {}; expected 1, 2 or 3", version));
  }
}

// ---- several descriptors of a landmark

TEST(WriteNative, WritesSeveralDescriptorsOneBelowTheOtherInVersion3) {
  const std::string text = native_text(several_map());
  EXPECT_THAT(text, StartsWith("CAIRN 3\n"));
  EXPECT_THAT(text, HasSubstr("\nDESCRIPTOR 30 00ff\nDESCRIPTOR 30 01fe\nDESCRIPTOR 30 0000\n"));
  EXPECT_THAT(read_text(text), EqualsMap(several_map()));
  // All else is as in version 2.
  std::string alike = native_text(full_map(), 3);
  EXPECT_THAT(alike, StartsWith("CAIRN 3\n"));
  alike[6] = '2';
  EXPECT_EQ(alike, native_text(full_map()));
  EXPECT_THAT(read_text(native_text(full_map(), 3)), EqualsMap(full_map()));
}

TEST(WriteNative, RefusesVersionsThatLoseFurtherDescriptors) {
  EXPECT_EQ(text_refusal([] { native_text(several_map(), 2); }, ErrorKind::kMisuse),
            "version 2 of the text format: would lose the landmarks' further descriptors; expected "
            "version 3");
  MapTables tables = plain_tables();
  tables.landmarks.descriptors =
      DescriptorColumn{"ORB", 1, {1, 0, 0}, {1, 0, 0}, {0, 1, 1, 1}, {2}};
  EXPECT_EQ(text_refusal([&] { native_text(LandmarkMap(tables), 1); }, ErrorKind::kMisuse),
            "version 1 of the text format: would lose the landmarks' descriptors; expected version "
            "3");
}

TEST(ReadNative, ReadsFurtherDescriptorsOfAnyLandmark) {
  const std::string head = "CAIRN 3\nDESCRIPTORS ORB 1\n";
  const LandmarkMap map = read_text(head +
                                    "LANDMARK 1 0 0 0 - -\nLANDMARK 2 0 0 0 - -\nDESCRIPTOR 2 0a\n"
                                    "COLOR 2 1 2 3\nDESCRIPTOR 2 0b\nLANDMARK 3 0 0 0 - -\n"
                                    "DESCRIPTOR 3 0c\nLANDMARK 4 0 0 0 - -\n");
  const DescriptorColumn& column = *map.landmarks().descriptors;
  EXPECT_THAT(column.known, ElementsAre(0, 1, 1, 0));
  EXPECT_THAT(column.bytes, ElementsAre(0, 0x0a, 0x0c, 0));
  EXPECT_THAT(column.further_offsets, ElementsAre(0, 0, 1, 1, 1));
  EXPECT_THAT(column.further, ElementsAre(0x0b));
  EXPECT_EQ(column.count(0), 0U);
  EXPECT_EQ(column.count(1), 2U);
  EXPECT_EQ(column.count(2), 1U);
}

TEST(ReadNative, RefusesASecondDescriptorInVersion2AndTooManyInVersion3) {
  const auto with = [](int version, std::size_t count) {
    std::string text = fmt::format("CAIRN {}\nDESCRIPTORS ORB 1\nLANDMARK 1 0 0 0 - -\n", version);
    for (std::size_t i = 0; i < count; ++i) text += fmt::format("DESCRIPTOR 1 {:02x}\n", i);
    return text;
  };
  EXPECT_EQ(text_refusal(with(2, 2)),
            "desk.map:5: the same is said above already; expected it once");
  EXPECT_EQ(read_text(with(3, kMostDescriptorsEach)).landmarks().descriptors->count(0),
            kMostDescriptorsEach);
  EXPECT_EQ(text_refusal(with(3, kMostDescriptorsEach + 1)),
            "desk.map:20: too many descriptors of one landmark; expected at most 16");
  EXPECT_EQ(text_refusal(with(3, 2) + "DESCRIPTOR 1 0g\n"),
            "desk.map:6: field 3 (descriptor): not hexadecimal; expected digits 0-9 and a-f");
  EXPECT_EQ(text_refusal("CAIRN 3\nPOINT 1\n"),
            "desk.map:2: unknown record 'POINT'; expected a record of version 3");
}

TEST(ReadNative, RefusesEveryLineOfSeveralDescriptorsThatIsCut) {
  const std::string whole = native_text(several_map());
  for (std::size_t size = whole.find("DESCRIPTOR 30"); size + 1 < whole.size(); ++size) {
    if (whole[size - 1] == '\n') continue;  // whole lines
    EXPECT_NE(text_refusal(whole.substr(0, size)), "") << size;
  }
}

// ---- covariances of poses

TEST(WriteNative, WritesCovariancesOfPosesInVersion3) {
  MapTables tables = plain_tables();
  Matrix6d covariance = Matrix6d::Identity();
  covariance(1, 3) = covariance(3, 1) = 0.5;
  tables.frames.pose_covariances = {std::nullopt, covariance};
  const LandmarkMap map(tables);
  const std::string text = native_text(map);
  EXPECT_THAT(text, StartsWith("CAIRN 3\n"));
  EXPECT_THAT(text, HasSubstr("\nPOSE_COVARIANCE 2 1 0 0 0 0 0 1 0 0.5 0 0 1 0 0 0 1 0 0 1 0 1\n"));
  EXPECT_THAT(read_text(text), EqualsMap(map));
  EXPECT_EQ(text_refusal([&] { native_text(map, 2); }, ErrorKind::kMisuse),
            "version 2 of the text format: would lose the covariances of the frames' poses; "
            "expected version 3");
  EXPECT_EQ(text_refusal([&] { native_text(map, 1); }, ErrorKind::kMisuse),
            "version 1 of the text format: would lose the covariances of the frames' poses; "
            "expected version 3");
}

TEST(ReadNative, RefusesBrokenCovariancesOfPoses) {
  const std::string head = "CAIRN 3\nFRAME 2 0 0 0 1 0 0 0\nPOSE_COVARIANCE ";
  const std::string good = "2 1 0 0 0 0 0 1 0 0.5 0 0 1 0 0 0 1 0 0 1 0 1\n";
  EXPECT_EQ(read_text(head + good).frames().pose_covariances.size(), 1U);
  EXPECT_EQ(text_refusal(head + "3 1\n"),
            "desk.map:3: field 2 (frame): frame 3 is unknown; expected the id of a FRAME record "
            "above");
  EXPECT_THAT(text_refusal(head + "2 1 0 0\n"), StartsWith("desk.map:3: field 6 (covariance): "));
  EXPECT_THAT(text_refusal(head + good.substr(0, good.size() - 1) + " 7\n"),
              StartsWith("desk.map:3: "));
  EXPECT_EQ(text_refusal(head + good + "POSE_COVARIANCE " + good),
            "desk.map:4: the same is said above already; expected it once");
  EXPECT_EQ(text_refusal(head + "2 1 0 0 0 0 0 1 0 1.5 0 0 1 0 0 0 1 0 0 1 0 1\n"),
            "desk.map:3: frame 2: pose covariance has a correlation that is greater than 1; "
            "expected a symmetric matrix without negative eigenvalues");
  EXPECT_THAT(text_refusal("CAIRN 2" + (head + good).substr(7)),
              HasSubstr("unknown record 'POSE_COVARIANCE'; expected a record of version 2"));
}

// ---- long files

// About `megabytes` of version 1 in frames and landmarks with three observations each.
std::string long_text(std::size_t megabytes) {
  std::string text;
  for (int i = 0; i < 100; ++i) text += fmt::format("FRAME {} 0.5 {} 0.125 1 0 0 0\n", i, i);
  for (std::size_t i = 0; text.size() < megabytes << 20; ++i) {
    text += fmt::format(
        "LANDMARK {} 0.5 {} 2 1e-04 0 0 0 1e-04 0 0 0 9e-04 3 {} 447.925 255.3 {} 422.06 255.3 "
        "{} 1.5 2.5\n",
        i, i % 1000, i % 100, (i + 7) % 100, (i + 50) % 100);
  }
  return text;
}

TEST(ReadNative, IsReadBackBitForBitOverManyBlocks) {
  const std::string text = long_text(5);
  EXPECT_TRUE(native_text(read_text(text)) == text);  // too long to be printed
}

TEST(ReadNative, ReportsProgressThatNeverGoesBack) {
  std::vector<double> shares;
  Execution execution;
  execution.progress = [&](double share) { shares.push_back(share); };
  read_text(long_text(13), execution);
  EXPECT_THAT(shares, SizeIs(Ge(3U)));
  EXPECT_THAT(shares, Each(AllOf(Ge(0.0), Le(1.0))));
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_GT(shares.back(), 0.5);
}

TEST(WriteNative, ReportsProgressThatNeverGoesBack) {
  const LandmarkMap map = read_text(long_text(20));
  std::vector<double> shares;
  write_native(map, [](std::string_view) {}, 1,
               {.progress = [&](double share) { shares.push_back(share); }});
  EXPECT_THAT(shares, SizeIs(Ge(2U)));
  EXPECT_THAT(shares, Each(AllOf(Ge(0.0), Le(1.0))));
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
}

TEST(ReadNative, StopsWhenAskedTo) {
  std::stop_source stop;
  Execution execution;
  execution.stop = stop.get_token();
  std::size_t reports = 0;
  execution.progress = [&](double) {
    if (++reports == 2) stop.request_stop();
  };
  const std::string text = long_text(13);
  EXPECT_EQ(text_refusal([&] { read_text(text, execution); }, ErrorKind::kCancelled),
            "desk.map: reading was cancelled");
  EXPECT_EQ(reports, 2U);
  // Asked for before it began, even of a small file.
  EXPECT_EQ(text_refusal([&] { read_text(kPlain, execution); }, ErrorKind::kCancelled),
            "desk.map: reading was cancelled");
}

}  // namespace
}  // namespace cairn

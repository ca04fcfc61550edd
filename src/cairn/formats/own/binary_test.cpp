// SPDX-License-Identifier: BSD-3-Clause
#include <bit>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/maps.hpp"
#include "support/point_clouds.hpp"
#include "support/real_data.hpp"
#include "support/refusal.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using testing::EqualsMap;
using testing::full_map;
using testing::full_tables;
using ::testing::HasSubstr;
using testing::plain_map;
using testing::several_map;
using ::testing::StartsWith;
using testing::TemporaryFolder;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kUnknownBits = 0x7ff8000000000000;
constexpr std::uint64_t kHuge = std::numeric_limits<std::uint64_t>::max();

std::string binary(const LandmarkMap& map) {
  std::string bytes;
  write_binary(map, [&](std::string_view piece) { bytes += piece; });
  return bytes;
}

std::string text(const LandmarkMap& map) {
  std::string bytes;
  write_native(map, [&](std::string_view piece) { bytes += piece; });
  return bytes;
}

LandmarkMap read_bytes(std::string_view bytes) {
  MemoryReader source(bytes, "desk.cairn");
  return read_binary(source);
}

std::string binary_refusal(std::string_view bytes) {
  const std::string message = testing::refusal(ErrorKind::kInput, [&] { read_bytes(bytes); });
  return message.empty() ? "accepted" : message;
}

// A file taken to pieces: what is said of it here is from docs/formats.md, not from the code.
class File {
 public:
  explicit File(std::string bytes) : bytes_(std::move(bytes)) {}
  explicit File(const LandmarkMap& map) : File(binary(map)) {}

  template <class Number>
  Number at(std::uint64_t byte) const {
    Number value = 0;
    std::memcpy(&value, bytes_.data() + byte, sizeof value);
    return value;
  }
  template <class Number>
  void set(std::uint64_t byte, Number value) {
    std::memcpy(bytes_.data() + byte, &value, sizeof value);
  }

  /// Where the table speaks of a section.
  std::uint64_t entry(MapColumn column) const {
    for (std::uint64_t i = 0; i < at<std::uint64_t>(48); ++i) {
      if (at<std::uint64_t>(56 + 24 * i) == static_cast<std::uint64_t>(column)) return 56 + 24 * i;
    }
    throw std::out_of_range("no such section");
  }
  std::uint64_t begin(MapColumn column) const { return at<std::uint64_t>(entry(column) + 8); }
  std::uint64_t size(MapColumn column) const { return at<std::uint64_t>(entry(column) + 16); }

  /// Fills a section with a number.
  template <class Number>
  void fill(MapColumn column, Number value) {
    for (std::uint64_t i = 0; i < size(column); i += sizeof value) set(begin(column) + i, value);
  }

  /// With the right size and checksum.
  std::string sealed() const {
    File file(bytes_);
    file.set<std::uint64_t>(16, bytes_.size());
    detail::Hasher hasher;
    hasher.update(std::string_view(file.bytes_).substr(0, bytes_.size() - 16));
    file.set(bytes_.size() - 16, hasher.digest().low);
    file.set(bytes_.size() - 8, hasher.digest().high);
    return file.bytes_;
  }

  std::string& bytes() { return bytes_; }

 private:
  std::string bytes_;
};

// ---- what is kept

std::vector<std::pair<const char*, LandmarkMap>> example_maps() {
  const auto changed = [](const std::function<void(MapTables&)>& change) {
    MapTables tables = full_tables();
    change(tables);
    return LandmarkMap(std::move(tables));
  };
  return {
      {"everything", full_map()},
      {"several descriptors of a landmark", several_map()},
      {"what version 1 holds", plain_map()},
      {"nothing", LandmarkMap()},
      {"frames only", changed([](MapTables& t) {
         t.landmarks = {};
         t.observations = {};
       })},
      {"landmarks only", changed([](MapTables& t) {
         t.frames = {};
         t.cameras = {};
         t.observations = {};
       })},
      {"declared columns without landmarks", changed([](MapTables& t) {
         t.landmarks = {};
         t.landmarks.descriptors = DescriptorColumn{"ORB", 32, {}, {}};
         t.landmarks.columns = {{"a", {}}, {"b", {}}};
         t.observations = {};
       })},
      {"landmarks never observed", changed([](MapTables& t) {
         t.observations = {};
         t.observations.offsets.assign(5, 0);
       })},
      {"no info", changed([](MapTables& t) { t.info = {}; })},
      {"synthetic", synthetic_map({.seed = 1, .landmarks = 3000})},
  };
}

TEST(WriteBinary, IsReadBackBitForBit) {
  for (const auto& [name, map] : example_maps()) {
    SCOPED_TRACE(name);
    EXPECT_THAT(read_bytes(binary(map)), EqualsMap(map));
  }
}

TEST(WriteBinary, AndTheTextFormatLoseNothingToEachOther) {
  for (const auto& [name, map] : example_maps()) {
    SCOPED_TRACE(name);
    const std::string as_binary = binary(map);
    const std::string as_text = text(map);
    EXPECT_EQ(text(read_bytes(as_binary)), as_text);
    MemoryReader source(as_text, "desk.map");
    EXPECT_EQ(binary(read_native(source)), as_binary);
  }
}

TEST(WriteBinary, AndTheTextFormatHoldCamerasOfAllModels) {
  MapTables tables = testing::plain_tables();
  for (const CameraModel& model : camera_models()) {
    Camera camera{CameraId{tables.cameras.size()}, std::string(model.name), 640, 480, {}};
    for (std::size_t i = 0; i < model.parameters.size(); ++i) {
      camera.parameters.push_back(0.1 + 0.05 * static_cast<double>(i));
    }
    tables.cameras.push_back(camera);
  }
  const LandmarkMap map(std::move(tables));
  EXPECT_EQ(map.cameras().size(), 18U);
  EXPECT_THAT(read_bytes(binary(map)), EqualsMap(map));
  const std::string as_text = text(map);
  MemoryReader source(as_text, "desk.map");
  EXPECT_THAT(read_native(source), EqualsMap(map));
}

TEST(WriteBinary, HasOneFormForUnknown) {
  MapTables tables = full_tables();
  const auto odd = std::bit_cast<double>(std::uint64_t{0xfff8000000000123});
  tables.landmarks.covariances[1](0, 0) = odd;
  tables.landmarks.covariances[1](2, 1) = 7.0;
  tables.landmarks.columns[0].values.set(1, odd);
  EXPECT_EQ(binary(LandmarkMap(std::move(tables))), binary(full_map()));
}

TEST(WriteBinary, ReportsItsProgressAndCanBeStopped) {
  const LandmarkMap map = synthetic_map({.seed = 1, .landmarks = 20000});
  double last = 0.0;
  write_binary(map, [](std::string_view) {}, {.progress = [&](double share) {
                 EXPECT_GE(share, last);
                 EXPECT_LE(share, 1.0);
                 last = share;
               }});
  EXPECT_EQ(last, 1.0);
  EXPECT_THROW(
      write_binary(
          map, [](std::string_view) {},
          {.progress = [](double) { throw Error(ErrorKind::kCancelled, "", "stop", ""); }}),
      Error);
}

TEST(ReadBinary, ReportsItsProgressAndCanBeStopped) {
  const std::string bytes = binary(synthetic_map({.seed = 1, .landmarks = 20000}));
  MemoryReader source(bytes, "desk.cairn");
  std::stop_source stop;
  Execution execution;
  execution.stop = stop.get_token();
  double last = 0.0;
  int calls = 0;
  execution.progress = [&](double share) {
    EXPECT_GE(share, last);
    EXPECT_LE(share, 1.0);
    last = share;
    ++calls;
  };
  read_binary(source, execution);
  EXPECT_GT(calls, 3);
  stop.request_stop();
  try {
    read_binary(source, execution);
    FAIL() << "not stopped";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
    EXPECT_STREQ(error.what(), "desk.cairn: reading was cancelled");
  }
}

TEST(ReadBinary, ReadsAPipe) {
  const std::string bytes = binary(full_map());
  testing::Pipe pipe(bytes, 7);
  EXPECT_THAT(read_binary(pipe), EqualsMap(full_map()));
}

TEST(ReadMap, KnowsBinaryMapsByContentAndWritesThemByExtension) {
  const TemporaryFolder folder;
  write_map(full_map(), folder / "a.cairn");
  EXPECT_EQ(testing::read_text(folder / "a.cairn"), binary(full_map()));
  std::filesystem::rename(folder / "a.cairn", folder / "a.map");
  EXPECT_THAT(read_map(folder / "a.map"), EqualsMap(full_map()));
}

TEST(ReadMap, NamesWhatATransferAsTextDoes) {
  const TemporaryFolder folder;
  std::string bytes = binary(full_map());
  bytes.erase(bytes.find('\r'), 1);
  try {
    read_map(folder.write("a.cairn", bytes));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(R"(a.cairn: byte 0: magic: '\x89CAIRN\x0a\x01'; expected)"
                                        R"( '\x89CAIRN\x0d\x0a')"));
  }
}

// ---- refusing what is wrong

TEST(ReadBinary, RefusesATruncatedFile) {
  const std::string bytes = binary(full_map());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::string message = binary_refusal(bytes.substr(0, size));
    if (size < 8) {
      EXPECT_THAT(message, StartsWith("desk.cairn: byte 0: magic: ")) << size;
    } else {
      EXPECT_THAT(message, HasSubstr(fmt::format("the file ends after {} bytes", size)));
    }
    // A file that states the size it has been cut to is damaged all the same.
    if (size >= 72) {
      File file(bytes.substr(0, size));
      file.set<std::uint64_t>(16, size);
      EXPECT_THAT(binary_refusal(file.bytes()), HasSubstr("checksum")) << size;
      EXPECT_NE(binary_refusal(file.sealed()), "accepted") << size;
    }
  }
}

TEST(ReadBinary, RefusesEveryFlippedBit) {
  const std::string bytes = binary(full_map());
  for (std::size_t byte = 0; byte < bytes.size(); ++byte) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = bytes;
      damaged[byte] = static_cast<char>(damaged[byte] ^ (1 << bit));
      EXPECT_THAT(binary_refusal(damaged), StartsWith("desk.cairn: byte ")) << byte << " " << bit;
    }
  }
}

// What the checksum vouches for is checked no less.
TEST(ReadBinary, AcceptsNoTwoFilesForOneMap) {
  const std::string bytes = binary(full_map());
  int accepted = 0;
  for (std::size_t byte = 0; byte < bytes.size() - 16; ++byte) {
    for (const int flip : {1, 0x80, 0xff}) {
      File file(bytes);
      file.bytes()[byte] = static_cast<char>(bytes[byte] ^ flip);
      const std::string sealed = file.sealed();
      if (sealed == bytes) continue;  // the size, which is set right again
      try {
        EXPECT_EQ(binary(read_bytes(sealed)), sealed) << byte;
        ++accepted;
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::kInput);
        EXPECT_THAT(error.what(), StartsWith("desk.cairn: byte ")) << byte;
      }
    }
  }
  EXPECT_GT(accepted, 100) << "most numbers may be others";
}

struct Breach {
  std::function<void(File&)> commit;
  std::string message;  // after the file's name
};

void expect_bytes_refused(const std::vector<Breach>& breaches) {
  for (const Breach& breach : breaches) {
    File file(full_map());
    breach.commit(file);
    EXPECT_EQ(binary_refusal(file.sealed()), "desk.cairn: " + breach.message);
  }
}

std::string byte_of(MapColumn column, std::uint64_t offset = 0) {
  return fmt::format("byte {}: ", File(full_map()).begin(column) + offset);
}
std::string byte_of_entry(MapColumn column, std::uint64_t offset = 0) {
  return fmt::format("byte {}: ", File(full_map()).entry(column) + offset);
}

template <class Number>
std::function<void(File&)> setting(MapColumn column, std::uint64_t offset, Number value) {
  return [=](File& file) { file.set(file.begin(column) + offset, value); };
}

TEST(ReadBinary, RefusesWhatIsNoneOfOurs) {
  EXPECT_EQ(binary_refusal(""), "desk.cairn: byte 0: magic: ''; expected '\\x89CAIRN\\x0d\\x0a'");
  EXPECT_EQ(binary_refusal("CAIRN 2\n"),
            "desk.cairn: byte 0: magic: 'CAIRN 2\\x0a'; expected '\\x89CAIRN\\x0d\\x0a'");
  EXPECT_EQ(binary_refusal("\x89"
                           "CAIRN\r\n"),
            "desk.cairn: byte 8: size: the file ends after 8 bytes; expected at least 72");
  std::string longer = binary(full_map());
  const std::size_t size = longer.size();
  longer += '\0';
  EXPECT_EQ(binary_refusal(longer),
            fmt::format("desk.cairn: byte 16: size: the file goes on to byte {}; expected {} "
                        "bytes, as it states",
                        size + 1, size));
  std::string damaged = binary(full_map());
  damaged[200] = static_cast<char>(~damaged[200]);
  EXPECT_THAT(binary_refusal(damaged),
              StartsWith(fmt::format("desk.cairn: byte {}: checksum: the bytes before are damaged: "
                                     "their XXH3 is ",
                                     size - 16)));
}

TEST(ReadBinary, RefusesABrokenHeader) {
  const std::uint64_t size = binary(full_map()).size();
  const std::string in_file = fmt::format("in a file of {} bytes", size);
  expect_bytes_refused({
      {[](File& f) { f.set<std::uint32_t>(8, 2); },
       "byte 8: version: format version 2; expected 1"},
      {[](File& f) { f.set<std::uint32_t>(12, 2); },
       "byte 12: unit of length: 2; expected 0 (metres) or 1 (free)"},
      {[](File& f) { f.set(24, kHuge); },
       fmt::format("byte 24: frames: {} frames; expected at most {} {}", kHuge, size / 64,
                   in_file)},
      {[](File& f) { f.set(32, std::uint64_t{1} << 32); },
       fmt::format("byte 32: landmarks: {} landmarks; expected at most {} {}",
                   std::uint64_t{1} << 32, size / 32, in_file)},
      {[](File& f) { f.set(40, kHuge / 20 + 2); },
       fmt::format("byte 40: observations: {} observations; expected at most {} {}", kHuge / 20 + 2,
                   size / 20, in_file)},
      {[](File& f) { f.set(48, kHuge / 24 + 1); },
       fmt::format("byte 48: sections: {} sections; expected at most {} {}", kHuge / 24 + 1,
                   size / 24, in_file)},
      {[=](File& f) { f.set(48, size / 24); },
       fmt::format("byte 48: sections: the table of {} sections ends at byte {}; expected an end "
                   "before the checksum at {}",
                   size / 24, 56 + size / 24 * 24, size - 16)},
      {[](File& f) { f.set<std::uint64_t>(24, 2); },
       byte_of_entry(MapColumn::kFrameIds, 16) + "frame ids: 24 bytes; expected 16: 2 times 8"},
      {[](File& f) { f.set<std::uint64_t>(32, 5); },
       byte_of_entry(MapColumn::kLandmarkIds, 16) +
           "landmark ids: 32 bytes; expected 40: 5 times 8"},
      {[](File& f) { f.set<std::uint64_t>(40, 4); },
       byte_of_entry(MapColumn::kObservingFrames, 16) +
           "observing frames: 20 bytes; expected 16: 4 times 4"},
  });
}

TEST(ReadBinary, RefusesABrokenTable) {
  const File intact(full_map());
  const std::uint64_t uuid = intact.begin(MapColumn::kUuid);
  const std::uint64_t checksum = binary(full_map()).size() - 16;
  const std::uint64_t end = File(full_map()).begin(MapColumn::kControlPoints) +
                            File(full_map()).size(MapColumn::kControlPoints);
  const std::uint64_t room = checksum - uuid;
  const auto uuid_entry = [](std::uint64_t offset, std::uint64_t value) {
    return [=](File& f) { f.set(f.entry(MapColumn::kUuid) + offset, value); };
  };
  const std::string at_number = byte_of_entry(MapColumn::kUuid) + "section: ";
  const std::string at_begin = byte_of_entry(MapColumn::kUuid, 8) + "uuid: ";
  const std::string at_size = byte_of_entry(MapColumn::kUuid, 16) + "uuid: ";
  const std::string once = "; expected each at most once, in the order of their numbers";
  expect_bytes_refused({
      {uuid_entry(0, 0), at_number + "0 is no section; expected 1 to 36"},
      {uuid_entry(0, 37), at_number + "37 is no section; expected 1 to 36"},
      {uuid_entry(0, kHuge), at_number + fmt::format("{} is no section; expected 1 to 36", kHuge)},
      {uuid_entry(0, 2), at_number + "2 (gravity) occurs twice" + once},
      {uuid_entry(0, 1), at_number + "1 (world frame) stands below 2" + once},
      {uuid_entry(8, uuid + 8),
       at_begin + fmt::format("begins at byte {}; expected byte {}", uuid + 8, uuid)},
      {uuid_entry(8, 0), at_begin + fmt::format("begins at byte 0; expected byte {}", uuid)},
      {uuid_entry(16, 0),
       at_size + fmt::format("0 bytes; expected 1 to {}, before the checksum", room)},
      {uuid_entry(16, room + 1),
       at_size + fmt::format("{} bytes; expected 1 to {}, before the checksum", room + 1, room)},
      {uuid_entry(16, kHuge),
       at_size + fmt::format("{} bytes; expected 1 to {}, before the checksum", kHuge, room)},
      {[](File& f) { f.set<char>(f.begin(MapColumn::kWorldFrame) + 4, 'x'); },
       byte_of(MapColumn::kWorldFrame, 4) + "padding: 'x'; expected zero"},
      {[=](File& f) { f.bytes().insert(checksum, 8, '\0'); },
       fmt::format("byte {}: sections: bytes that belong to no section; expected the checksum at "
                   "byte {}",
                   end, checksum)},
  });
}

// A file without one of its sections; all behind it moves.
std::string without(const LandmarkMap& map, MapColumn column) {
  File file(map);
  const std::uint64_t removed = (file.size(column) + 7) / 8 * 8;
  const std::uint64_t entry = file.entry(column);
  file.bytes().erase(file.begin(column), removed);
  file.bytes().erase(entry, 24);
  const std::uint64_t count = file.at<std::uint64_t>(48) - 1;
  file.set(48, count);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t place = 56 + 24 * i + 8;
    file.set(place, file.at<std::uint64_t>(place) - 24 - (56 + 24 * i >= entry ? removed : 0));
  }
  return file.sealed();
}

TEST(ReadBinary, RefusesAMissingSection) {
  for (const auto& [column, message] : std::vector<std::pair<MapColumn, std::string>>{
           {MapColumn::kFrameIds, "byte 48: frame ids: 0 bytes; expected 24: 3 times 8"},
           {MapColumn::kTranslations, "byte 48: translations: 0 bytes; expected 72: 3 times 24"},
           {MapColumn::kQuaternions, "byte 48: quaternions: 0 bytes; expected 96: 3 times 32"},
           {MapColumn::kLandmarkIds, "byte 48: landmark ids: 0 bytes; expected 32: 4 times 8"},
           {MapColumn::kPositions, "byte 48: positions: 0 bytes; expected 96: 4 times 24"},
           {MapColumn::kKnownDescriptors,
            "byte 48: known descriptors: 0 bytes; expected 4: 4 times 1"},
           {MapColumn::kDescriptors, "byte 48: descriptors: 0 bytes; expected 8: 4 times 2"},
           {MapColumn::kColumnValues, "byte 48: column values: 0 bytes; expected 64: 4 times 16"},
           {MapColumn::kObservingFrames,
            "byte 48: observing frames: 0 bytes; expected 20: 5 times 4"},
           {MapColumn::kPixels, "byte 48: pixels: 0 bytes; expected 80: 5 times 16"},
       }) {
    EXPECT_EQ(binary_refusal(without(full_map(), column)), "desk.cairn: " + message);
  }
  EXPECT_THAT(binary_refusal(without(full_map(), MapColumn::kOffsets)),
              HasSubstr("observation offsets: missing; expected one a landmark and one more"));
  EXPECT_THAT(binary_refusal(without(full_map(), MapColumn::kDescriptorKind)),
              HasSubstr("known descriptors: 4 bytes; expected 0: 4 times 0"));
  EXPECT_THAT(binary_refusal(without(full_map(), MapColumn::kColumnNames)),
              HasSubstr("column values: 64 bytes; expected 0: 4 times 0"));
  EXPECT_THAT(read_bytes(without(full_map(), MapColumn::kCovariances)).has_covariances(), false);
}

TEST(ReadBinary, RefusesBrokenFurtherDescriptors) {
  const File intact(several_map());
  const auto at = [&](MapColumn column, std::uint64_t offset) {
    return fmt::format("desk.cairn: byte {}: ", intact.begin(column) + offset);
  };
  const auto refused = [&](MapColumn column, std::uint64_t offset, std::uint64_t value) {
    File file(several_map());
    file.set(file.begin(column) + offset, value);
    return binary_refusal(file.sealed());
  };
  const std::uint64_t size = binary(several_map()).size();
  const std::string most =
      fmt::format(" further descriptors; expected 1 to {} in a file of {} bytes", size / 2, size);
  const std::string last = at(MapColumn::kFurtherOffsets, 32) + "further offsets: ";
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 32, kHuge), last + fmt::format("{}", kHuge) + most);
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 32, kHuge / 2 + 1),
            last + fmt::format("{}", kHuge / 2 + 1) + most);
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 32, 0), last + "0" + most);
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 32, 4),
            at(MapColumn::kFurtherDescriptors, 0) +
                "further descriptors: 6 bytes; expected 8: 1 times 8");
  const std::string ranges =
      "further offsets: offsets of further descriptors: do not cut the further descriptors into "
      "one range a landmark; expected ascending from 0 to their number, one more than there are "
      "landmarks";
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 0, 1), at(MapColumn::kFurtherOffsets, 0) + ranges);
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 8, kHuge),
            at(MapColumn::kFurtherOffsets, 16) + ranges);
  EXPECT_EQ(refused(MapColumn::kFurtherOffsets, 16, 3),
            at(MapColumn::kFurtherOffsets, 8) +
                "further offsets: landmark 10: further descriptors without a first one; expected "
                "a descriptor that represents the landmark");
  EXPECT_THAT(binary_refusal(without(several_map(), MapColumn::kFurtherOffsets)),
              HasSubstr("further descriptors: 6 bytes; expected 0"));
  EXPECT_THAT(binary_refusal(without(several_map(), MapColumn::kFurtherDescriptors)),
              HasSubstr("further descriptors: 0 bytes; expected 6"));
  EXPECT_THAT(binary_refusal(without(several_map(), MapColumn::kDescriptorKind)),
              HasSubstr("known descriptors: 4 bytes; expected 0"));
  File none(several_map());
  none.set<std::uint32_t>(none.begin(MapColumn::kDescriptorKind), 0);
  EXPECT_THAT(binary_refusal(none.sealed()), StartsWith("desk.cairn: byte "));
}

TEST(ReadBinary, RefusesBrokenCovariancesOfPoses) {
  constexpr MapColumn kColumn = MapColumn::kPoseCovariances;
  const auto at = [](std::uint64_t offset) {
    return fmt::format("desk.cairn: byte {}: pose covariances: ",
                       File(several_map()).begin(kColumn) + offset);
  };
  const auto refused = [](std::uint64_t offset, auto value) {
    File file(several_map());
    file.set(file.begin(kColumn) + offset, value);
    return binary_refusal(file.sealed());
  };
  constexpr std::uint64_t kRow = 21 * sizeof(double);
  EXPECT_EQ(File(several_map()).size(kColumn), 3 * kRow);
  EXPECT_EQ(refused(kRow + 8, 1.0), at(kRow + 8) +
                                        "1 of the bits 3ff0000000000000; expected "
                                        "7ff8000000000000 where unknown, else a number");
  EXPECT_THAT(refused(2 * kRow + 8, kInfinity), HasSubstr("an entry that is not finite"));
  EXPECT_THAT(refused(2 * kRow, -1.0), HasSubstr("pose covariance is indefinite"));
  File unknown(several_map());
  unknown.fill(kColumn, kUnknownBits);
  EXPECT_EQ(binary_refusal(unknown.sealed()),
            at(0) + "nothing is known in it; expected the section left out");
}

TEST(ReadBinary, RefusesEveryTruncationOfSeveralDescriptors) {
  const std::string whole = binary(several_map());
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(binary_refusal(whole.substr(0, size)), "accepted") << size;
  }
}

TEST(ReadBinary, RefusesBrokenTexts) {
  // A length that is too long: `field` at `offset`, wanting so many bytes, `rest` of them missing.
  const auto too_long = [](MapColumn column, std::uint64_t offset, std::string_view field,
                           std::uint64_t wanted = 4294967295) {
    const std::uint64_t rest = File(full_map()).size(column) - offset - 4;
    return Breach{setting<std::uint32_t>(column, offset, 4294967295),
                  byte_of(column, offset + 4) +
                      fmt::format("{}: the section ends after {} bytes; expected {} bytes", field,
                                  rest, wanted)};
  };
  expect_bytes_refused({
      too_long(MapColumn::kProvenance, 0, "provenance: a text"),
      too_long(MapColumn::kImageNames, 0, "image names: a name"),
      too_long(MapColumn::kColumnNames, 0, "column names: a name"),
      too_long(MapColumn::kCameras, 16, "cameras: model"),
      too_long(MapColumn::kCameras, 27, "cameras: parameters", 8 * 4294967295ULL),
      {[](File& f) { f.fill<char>(MapColumn::kProvenance, 0); },
       byte_of(MapColumn::kProvenance) + "provenance: an empty text; expected none"},
      {[](File& f) { f.fill<char>(MapColumn::kImageNames, 0); },
       byte_of(MapColumn::kImageNames) + "image names: more names than frames; expected 3 names"},
      {setting<char>(MapColumn::kColumnNames, 4, ' '),
       byte_of(MapColumn::kColumnNames) +
           "column names: column ' onfidence': not a name; expected visible ASCII, no blanks"},
      {setting<char>(MapColumn::kDescriptorKind, 4, '\n'),
       byte_of(MapColumn::kDescriptorKind) +
           "descriptor kind: landmark descriptors: kind is not a name; expected visible ASCII, no "
           "blanks"},
  });
}

TEST(ReadBinary, RefusesBrokenInfoAndCameras) {
  expect_bytes_refused({
      {setting(MapColumn::kGravity, 16, 9.81),
       byte_of(MapColumn::kGravity) +
           "gravity: gravity: (0, 0.6, 9.81) is not a unit vector; expected norm 1 within 1e-3"},
      {setting(MapColumn::kGeoReference, 0, 91.0),
       byte_of(MapColumn::kGeoReference) + "georeference: georeference: latitude 91 is out of "
                                           "range; expected degrees from -90 to 90 "
                                           "and -180 to 180, metres from -1e9 to 1e9"},
      {setting(MapColumn::kGeoReference, 24, kUnknownBits),
       byte_of(MapColumn::kGeoReference) +
           "georeference: georeference: scale nan; expected a scale from 1e-9 to 1e9"},
      {setting<std::uint64_t>(MapColumn::kCameras, 0, 2),
       byte_of(MapColumn::kCameras) +
           "cameras: camera 2: the id occurs twice; expected distinct ids"},
      {setting<std::uint32_t>(MapColumn::kCameras, 8, 0),
       byte_of(MapColumn::kCameras) +
           "cameras: camera 5: the image size is 0; expected a usable camera"},
  });
}

TEST(ReadBinary, RefusesBrokenFrames) {
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  expect_bytes_refused({
      {setting<std::uint64_t>(MapColumn::kFrameIds, 16, 7),
       byte_of(MapColumn::kFrameIds, 16) +
           "frame ids: frame 7: the id occurs twice; expected distinct ids"},
      {setting(MapColumn::kTranslations, 48, kInfinity),
       byte_of(MapColumn::kTranslations, 48) +
           "translations: frame 3: translation (inf, 4.5, 0.3333333333333333) is not finite; "
           "expected numbers from -1e9 to 1e9"},
      {setting(MapColumn::kQuaternions, 0, 1.0625),
       byte_of(MapColumn::kQuaternions) +
           "quaternions: frame 7: quaternion of norm 1.0625; expected norm 1 within 1e-3"},
      {setting<std::int64_t>(MapColumn::kFrameCameras, 16, 2),
       byte_of(MapColumn::kFrameCameras, 16) +
           "frame cameras: frame 3: refers to a camera that the map does not have; expected the "
           "index of a camera"},
      {setting<std::int64_t>(MapColumn::kFrameCameras, 16, -1),
       byte_of(MapColumn::kFrameCameras, 16) +
           fmt::format("frame cameras: -1; expected 0 to 4294967295, or {} where unknown", lowest)},
      {[=](File& f) { f.fill(MapColumn::kFrameCameras, lowest); },
       byte_of(MapColumn::kFrameCameras) +
           "frame cameras: nothing is known in it; expected the section left out"},
      {setting(MapColumn::kTimestamps, 8, -kInfinity),
       byte_of(MapColumn::kTimestamps, 8) + "timestamps: frame 18446744073709551615: timestamp is "
                                            "not finite; expected seconds, from -1e20 to 1e20"},
      {setting(MapColumn::kTimestamps, 8, kUnknownBits + 1),
       byte_of(MapColumn::kTimestamps, 8) +
           "timestamps: nan of the bits 7ff8000000000001; expected 7ff8000000000000 where unknown, "
           "else a number"},
      {[](File& f) { f.fill(MapColumn::kTimestamps, kUnknownBits); },
       byte_of(MapColumn::kTimestamps) +
           "timestamps: nothing is known in it; expected the section left out"},
      {setting(MapColumn::kControlPoints, 0, 91.0),
       byte_of(MapColumn::kControlPoints) + "control points: control point 'nail 1': latitude 91 "
                                            "is out of range; expected degrees from "
                                            "-90 to 90 and -180 to 180, metres from -1e9 to 1e9"},
      {setting<std::uint32_t>(MapColumn::kControlPoints, 24, 1000),
       byte_of(MapColumn::kControlPoints, 28) +
           fmt::format("control points: name: the section ends after {} bytes; expected 1000 bytes",
                       File(full_map()).size(MapColumn::kControlPoints) - 28)},
      {setting(MapColumn::kGnss, 24, -1.0),
       byte_of(MapColumn::kGnss) + "GNSS positions: frame 7: GNSS accuracy -1; expected a positive "
                                   "number of metres, at most 1e9"},
      {setting(MapColumn::kGnss, 40, 0.0), byte_of(MapColumn::kGnss, 40) +
                                               "GNSS positions: 0 of the bits 0000000000000000; "
                                               "expected 7ff8000000000000 where unknown, "
                                               "else a number"},
      {[](File& f) { f.fill(MapColumn::kGnss, kUnknownBits); },
       byte_of(MapColumn::kGnss) +
           "GNSS positions: nothing is known in it; expected the section left out"},
  });
}

TEST(ReadBinary, RefusesBrokenLandmarks) {
  const auto covariance = [](std::uint64_t offset, double value) {
    return setting(MapColumn::kCovariances, offset, value);
  };
  expect_bytes_refused({
      {setting<std::uint64_t>(MapColumn::kLandmarkIds, 24, 30),
       byte_of(MapColumn::kLandmarkIds, 24) +
           "landmark ids: landmark 30: the id occurs twice; expected distinct ids"},
      {setting(MapColumn::kPositions, 24, kUnknownBits),
       byte_of(MapColumn::kPositions, 24) + "positions: landmark 10: position (nan, 0.25, 3) is "
                                            "not finite; expected numbers from -1e9 to 1e9"},
      {covariance(8, 2e-5), byte_of(MapColumn::kCovariances) +
                                "covariances: landmark 30: covariance is not symmetric: opposite "
                                "entries differ by 1e-05; expected a symmetric positive "
                                "semi-definite matrix"},
      {covariance(144, -0.25), byte_of(MapColumn::kCovariances, 144) +
                                   "covariances: landmark 9223372036854775808: covariance is "
                                   "indefinite: its smallest eigenvalue is -0.25; expected a "
                                   "symmetric positive semi-definite matrix"},
      {covariance(144 + 32, kInfinity),
       byte_of(MapColumn::kCovariances, 144) +
           "covariances: landmark 9223372036854775808: covariance is an entry is not finite; "
           "expected a symmetric positive semi-definite matrix"},
      {covariance(72 + 40, 0.5), byte_of(MapColumn::kCovariances, 72 + 40) +
                                     "covariances: 0.5 of the bits 3fe0000000000000; expected "
                                     "7ff8000000000000 where unknown, else a number"},
      {[](File& f) { f.fill(MapColumn::kCovariances, kUnknownBits); },
       byte_of(MapColumn::kCovariances) +
           "covariances: nothing is known in it; expected the section left out"},
      {setting<std::uint8_t>(MapColumn::kColors, 3, 2),
       byte_of(MapColumn::kColors) +
           "colours: 200 180 40 2; expected red, green, blue and 1, or four zeros where unknown"},
      {setting<std::uint8_t>(MapColumn::kColors, 4, 9),
       byte_of(MapColumn::kColors, 4) +
           "colours: 9 0 0 0; expected red, green, blue and 1, or four zeros where unknown"},
      {[](File& f) { f.fill<char>(MapColumn::kColors, 0); },
       byte_of(MapColumn::kColors) +
           "colours: nothing is known in it; expected the section left out"},
      {setting<std::uint32_t>(MapColumn::kDescriptorKind, 0, 4294967295),
       byte_of(MapColumn::kDescriptors) +
           "descriptors: 8 bytes; expected 17179869180: 4 times 4294967295"},
      {setting<std::uint8_t>(MapColumn::kKnownDescriptors, 1, 2),
       byte_of(MapColumn::kKnownDescriptors, 1) +
           "known descriptors: landmark 10: descriptor is neither known nor zero; expected 1 for "
           "known, or 0 and all its bytes zero"},
      {setting<std::uint8_t>(MapColumn::kDescriptors, 2, 1),
       byte_of(MapColumn::kKnownDescriptors, 1) +
           "known descriptors: landmark 10: descriptor is neither known nor zero; expected 1 for "
           "known, or 0 and all its bytes zero"},
      {setting(MapColumn::kColumnValues, 40, kInfinity),
       byte_of(MapColumn::kColumnValues, 40) +
           "column values: landmark 10: infinite in column 'never_set'; expected a number, or NaN "
           "where unknown"},
      {setting(MapColumn::kColumnValues, 0, ~std::uint64_t{0}),
       byte_of(MapColumn::kColumnValues) +
           "column values: -nan of the bits ffffffffffffffff; expected 7ff8000000000000 where "
           "unknown, else a number"},
  });
}

TEST(ReadBinary, RefusesBrokenObservations) {
  constexpr const char* kOffsets =
      "offsets: observation offsets: do not cut the observations into one range a landmark; "
      "expected ascending from 0 to their number, one more than there are landmarks";
  const auto lowest = std::numeric_limits<std::int64_t>::min();
  expect_bytes_refused({
      {setting<std::uint64_t>(MapColumn::kOffsets, 0, 1), byte_of(MapColumn::kOffsets) + kOffsets},
      {setting<std::uint64_t>(MapColumn::kOffsets, 16, 1),
       byte_of(MapColumn::kOffsets, 16) + kOffsets},
      {setting<std::uint64_t>(MapColumn::kOffsets, 32, kHuge),
       byte_of(MapColumn::kOffsets, 32) + kOffsets},
      {setting<std::uint32_t>(MapColumn::kObservingFrames, 16, 3),
       byte_of(MapColumn::kObservingFrames, 16) + "observing frames: landmark 20: observed by a "
                                                  "frame that the map does not have; expected "
                                                  "the index of a frame"},
      {setting(MapColumn::kPixels, 32, kInfinity),
       byte_of(MapColumn::kPixels, 32) + "pixels: landmark 10: pixel (inf, 0.2) is not finite; "
                                         "expected numbers from -1e9 to 1e9"},
      {setting<std::int64_t>(MapColumn::kKeypoints, 8, 4294967296),
       byte_of(MapColumn::kKeypoints, 8) +
           fmt::format("keypoints: 4294967296; expected 0 to 4294967295, or {} where unknown",
                       lowest)},
      {setting(MapColumn::kDepths, 0, kInfinity),
       byte_of(MapColumn::kDepths) +
           "depths: landmark 30: depth is not finite; expected metres, from -1e9 to 1e9"},
      {setting<std::int64_t>(MapColumn::kPixelSources, 8, 3),
       byte_of(MapColumn::kPixelSources, 8) +
           fmt::format("sources: 3; expected 0 to 2, or {} where unknown", lowest)},
      {setting(MapColumn::kPixelSigmas, 8, -1.0),
       byte_of(MapColumn::kPixelSigmas, 8) +
           "sigmas: landmark 30: sigma -1; expected a positive number of pixels, at most 1e9"},
      {setting<std::int64_t>(MapColumn::kOctaves, 8, -2147483649),
       byte_of(MapColumn::kOctaves, 8) +
           fmt::format(
               "octaves: -2147483649; expected -2147483648 to 2147483647, or {} where unknown",
               lowest)},
  });
}

// ---- real data

TEST(RealMapInBinary, IsReadBackBitForBit) {
  const auto folder = testing::real_data();
  if (!folder) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = read_map(*folder / "map_fr1_desk.txt");
  const std::string bytes = binary(map);
  EXPECT_THAT(read_bytes(bytes), EqualsMap(map));
  const std::string as_text = text(map);
  EXPECT_EQ(text(read_bytes(bytes)), as_text);
  MemoryReader source(as_text, "desk.map");
  EXPECT_EQ(binary(read_native(source)), bytes);
}

}  // namespace
}  // namespace cairn

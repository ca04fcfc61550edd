// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "cairn/core/error.hpp"
#include "cairn/formats/detail/foreign/foreign_formats.hpp"
#include "cairn/formats/map_file.hpp"

#include "support/imported_maps.hpp"
#include "support/maps.hpp"
#include "support/point_clouds.hpp"
#include "support/real_data.hpp"

namespace cairn::detail {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class PlainPointsTest : public testing::ImportTest {
 protected:
  LandmarkMap read_text(std::string_view bytes) { return read_bytes(bytes, "points"); }
  std::string refused(std::string_view bytes) { return ImportTest::refused(bytes, "points"); }
};

std::string npy(const std::string& header, std::size_t doubles) {
  std::string bytes = "\x93NUMPY";
  bytes += '\x01';
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 255);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  for (std::size_t i = 0; i < doubles; ++i) {
    const double value = static_cast<double>(i) + 0.5;
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  return bytes;
}

// A ZIP archive of one deflated member.
std::string archive_of(const std::string& name, const std::string& content) {
  std::string packed(compressBound(content.size()), '\0');
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(content.data()));
  stream.avail_in = static_cast<uInt>(content.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  std::string archive;
  const auto add = [&](std::uint64_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) archive += static_cast<char>(value >> (8 * i));
  };
  const auto add_common = [&] {
    for (const std::uint64_t x : {20, 0, 8, 0, 0}) add(x, 2);  // version, flags, method, time, date
    add(crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size())),
        4);
    add(packed.size(), 4);
    add(content.size(), 4);
    add(name.size(), 2);
    add(0, 2);
  };
  add(0x04034b50, 4);
  add_common();
  archive += name + packed;
  const std::size_t directory = archive.size();
  add(0x02014b50, 4);
  add(20, 2);
  add_common();
  archive.append(14, '\0');  // comment, disk, attributes, place of the member
  archive += name;
  const std::size_t end = archive.size();
  add(0x06054b50, 4);
  for (const std::uint64_t x : {0, 0, 1, 1}) add(x, 2);
  add(end - directory, 4);
  add(directory, 4);
  add(0, 2);
  return archive;
}

TEST_F(PlainPointsTest, LinesBecomeLandmarks) {
  for (const char* text : {"# comment\n\n 1 2 3\n4 5 6\n", "1,2,3\r\n4, 5, 6\r\n", "1;2;3\n4;5;6\n",
                           "X,Y,Z\n1,2,3\n4,5,6\n"}) {
    SCOPED_TRACE(text);
    const LandmarkMap map = read_text(text);
    EXPECT_THAT(map.landmarks().positions,
                ElementsAre(Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6)));
    EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{0}, LandmarkId{1}));
    EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
    EXPECT_FALSE(map.has_observations());
    EXPECT_TRUE(remarks_.texts.empty());
  }
}

TEST_F(PlainPointsTest, HeaderNamesTheColumns) {
  const LandmarkMap map = read_text("id,z,weight,X,y,name\n7,3,0.5,1,2,tip\n9,3,,1,2,top\n");
  EXPECT_EQ(map.landmarks().positions.at(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(map.landmarks().ids, ElementsAre(LandmarkId{7}, LandmarkId{9}));
  EXPECT_EQ(map.column("weight")->values[0], 0.5);
  EXPECT_TRUE(std::isnan(map.column("weight")->values[1])) << "an empty cell is unknown";
  EXPECT_EQ(map.info().length_unit, LengthUnit::kFree);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("hold no numbers are left out: 'name'")));
  EXPECT_THAT(refused("x,y,z,w\n1,2,3\n"),
              HasSubstr("points:2: the line has 3 fields; expected 4"));
  EXPECT_THAT(refused("x,y,z,w\n1,2,3,4\n1,2,3,four\n"),
              HasSubstr("points:3: field 4 (w): 'four'"));
  EXPECT_THAT(refused("# a table\nx,y,z\none,2,3\n"),
              HasSubstr("points:3: x 'one' is not a number; expected a decimal number, or nan"));
}

TEST_F(PlainPointsTest, PointsThatAreNotFiniteAreLeftOut) {
  EXPECT_EQ(read_text("1 2 3\n1 nan 3\n1 2 -inf\n1 2 5e11\n").landmark_count(), 1U);
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("3 of 4 landmarks left out: a coordinate is not finite")));
}

TEST_F(PlainPointsTest, TextErrorsNameLineAndField) {
  EXPECT_THAT(refused("1 2 3\n1 x 3\n"), HasSubstr("points:2: field 2 (y): 'x' is not a number"));
  EXPECT_THAT(refused("1 2 3\n1 2\n"),
              HasSubstr("points:2: the line has 2 fields; expected 3, as the first line has"));
  EXPECT_THAT(refused("1,5;2,5;3,5\n4,5;5,5;6,5\n"), HasSubstr("begins with '1,5;2,5;3,5'"))
      << "decimal commas";
}

TEST_F(PlainPointsTest, ALastLineThatDoesNotEndIsRead) {
  for (const char* const text : {"1 2 3\n4 5 6", "x,y,z\n1,2,3\n4,5,6"}) {
    EXPECT_EQ(read_text(text).landmark_count(), 2U);
    EXPECT_THAT(remarks_.texts, ElementsAre(HasSubstr("the last line does not end")));
  }
}

TEST_F(PlainPointsTest, TrajectoriesAndTransformsAreNoPoints) {
  EXPECT_THAT(
      refused("1.5 0 1 2 0 0 0 1\n1.6 0 1 2 0.6 0 0 0.8\n"),
      HasSubstr("points: holds a trajectory (timestamp tx ty tz qx qy qz qw); expected points"));
  EXPECT_THAT(refused("1.5 0 1 2 0 0 0 1 17\n1.6 0 1 2 0.6 0 0 0.8 18\n"),
              HasSubstr("holds a trajectory"))
      << "with a further column";
  EXPECT_THAT(refused("5 1 2 0 0 0 1\n4 1 2 0.6 0 0 0.8\n"), HasSubstr("holds poses"));
  const std::string motion = "0 -1 0 1.5 1 0 0 2.5 0 0 1 3.5";
  for (const std::string& row :
       {motion, "7 " + motion, motion + " 0 0 0 1", "7 " + motion + " 0 0 0 1"}) {
    EXPECT_THAT(refused(row + "\n" + row + "\n"), HasSubstr("holds poses, each line a matrix"));
  }
  for (const char* const header : {"t,x,y,z,qx,qy,qz,qw\n", "# t x y z q_w q_x q_y q_z\n"}) {
    EXPECT_THAT(refused(header + std::string("1 2 3 4 0 0 0 1\n")), HasSubstr("holds poses"));
  }
  EXPECT_THAT(refused("1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n"),
              HasSubstr("points: holds a transform of 4x4 numbers; expected points"));
  EXPECT_THAT(refused("1 0 0 0\n0.6 0.8 0 0\n"), HasSubstr("holds quaternions"));
}

TEST_F(PlainPointsTest, ModelsOfColmapUnderOtherNamesAreNamed) {
  EXPECT_THAT(refused("# 3D point list\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n"
                      "944 7.8 3.7 8.5 143 102 69 0.05 2 8472 1 6282\n"
                      "12 7.8 3.7 8.5 143 102 69 0.05 2 8472 1 6282 4 7\n"),
              HasSubstr("holds COLMAP's points3D.txt under another name; expected the name "
                        "points3D.txt"));
  EXPECT_THAT(refused("1 0.6 0 0 0.8 1.5 2.5 3.5 1 a.jpg\n4.5 5.5 -1\n"),
              HasSubstr("holds COLMAP's images.txt under another name"));
}

// What no header names must follow from the numbers: else a time or an id would become x.
TEST_F(PlainPointsTest, ColumnsThatNothingNamesAreRefused) {
  const std::string message =
      "and nothing says which are x, y and z; the first may be a time or an id; expected a first "
      "line that names the columns, such as 'id x y z'";
  EXPECT_THAT(refused("175.25 0 0.5 0.25 1.5\n175.25 3 0.25 0.5 0.75\n"),
              HasSubstr("points: its lines have 5 numbers, " + message));
  EXPECT_THAT(refused("7 0.5 0.25 0.5\n3 0.25 0.5 0.75\n5 0.5 0.5 0.5\n"),
              HasSubstr("its lines have 4 numbers, " + message));
  EXPECT_THAT(refused("1.5 0.5 0.25 0.5\n1.75 0.25 0.5 0.75\n"), HasSubstr(message));
  EXPECT_THAT(
      refused("1.5 2.5 3.5 -4.5\n0.5 1.5 2.5 3.5\n"),
      HasSubstr("its lines have 4 numbers, and nothing says which are x, y and z; expected"));
  EXPECT_THAT(
      refused("1.5 2.5 3.5 4.5 a\n"),
      HasSubstr("points:1: field 5: 'a' is not a number; expected numbers, or a first line"));
  EXPECT_THAT(refused("1.5 2.5 3.5 4\n0.5 1 1\n"), HasSubstr("points:2: the line has 3 fields"));
  // A name that says so is believed, unless the numbers contradict.
  EXPECT_EQ(read_bytes("1.5 2.5 3.5 -4.5\n0.5 1.5 2.5 3.5\n", "a.xyz").landmark_count(), 2U);
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("columns without a name are left out: 4")));
  EXPECT_THAT(ImportTest::refused("175.25 0 0.5 0.25 1.5\n175.25 3 0.25 0.5 0.75\n", "a.xyz"),
              HasSubstr(message));
}

TEST_F(PlainPointsTest, ColoursNormalsAndIntensitiesFollowThePosition) {
  const auto names = [&](const std::string& text) {
    const LandmarkMap map = read_text(text);
    EXPECT_EQ(map.landmarks().positions.at(0), Eigen::Vector3d(1.5, 2.5, 3.5));
    EXPECT_THAT(remarks_.texts, Contains(HasSubstr("the columns have no names; taken as x y z")));
    std::string all = map.landmarks().colors.empty() ? "" : "colours ";
    for (const NamedColumn& column : map.landmarks().columns) all += column.name + " ";
    return all;
  };
  EXPECT_EQ(names("1.5 2.5 3.5 255 0 7\n0.5 1 1 1 2 3\n"), "colours ");
  EXPECT_EQ(names("1.5 2.5 3.5 2.55e+02 0.0 7.00\n"), "colours ") << "as numpy.savetxt writes";
  EXPECT_EQ(names("1.5 2.5 3.5 256\n0.5 1 1 3\n"), "intensity ");
  EXPECT_EQ(names("1.5 2.5 3.5 0.25\n0.5 1 1 1\n"), "intensity ");
  EXPECT_EQ(names("1.5 2.5 3.5 -1093 1 2 3\n0.5 1 1 9 4 5 6\n"), "colours intensity ");
  EXPECT_EQ(names("1.5,2.5,3.5,0,-0.6,0.8\n0.5,1,1,0,0,1\n"), "nx ny nz ");
  EXPECT_EQ(names("1.5 2.5 3.5 1 2 3 0 -0.6 0.8\n"), "colours nx ny nz ");
  EXPECT_EQ(names("1.5 2.5 3.5 0 -0.6 0.8 1 2 3\n"), "colours nx ny nz ");
  EXPECT_EQ(names("1.5 2.5 3.5 1 2 3 0.5\n"), "colours ");
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("columns without a name are left out: 7")));
  EXPECT_EQ(names("1.5 2.5 3.5 1 2 3 4\n0.5 1 1 1 2 3 4\n"), "") << "which are the colours?";
}

TEST_F(PlainPointsTest, HeadersAsPeopleWriteThem) {
  for (const char* const text : {
           "pos_x, pos_y, pos_z\n1, 2, 3\n",
           "\"x\",\"y\",\"z\"\n\"1\",\"2\",\"3\"\n",
           "Points:0,Points:1,Points:2\n1,2,3\n",
           "Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2\n1,2,3\n",
           "X [m];Y [m];Z [m]\n1;2;3\n",
           "Position.X\tPosition.Y\tPosition.Z\n1\t2\t3\n",
           "//X Y Z\n1 2 3\n",
           "# x y z\n1 2 3\n",
           "#x,y,z,\n1,2,3,\n",
           "x,y,z,\n1,2,3,\n",
       }) {
    const LandmarkMap map = read_text(text);
    EXPECT_EQ(map.landmarks().positions.at(0), Eigen::Vector3d(1, 2, 3)) << text;
    EXPECT_THAT(map.landmarks().columns, ::testing::IsEmpty()) << text;
    EXPECT_THAT(remarks_.texts, ::testing::IsEmpty()) << text;
  }
}

TEST_F(PlainPointsTest, HeadersNameOtherColumnsToo) {
  // Row numbers of pandas.
  const LandmarkMap pandas = read_text(",z,x,y,R,G,B\n4,3,1,2,7,8,9\n6,3,1,2,255,0,0\n");
  EXPECT_EQ(pandas.landmarks().positions.at(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(pandas.landmarks().ids, ElementsAre(LandmarkId{4}, LandmarkId{6}));
  EXPECT_THAT(pandas.landmarks().colors, ElementsAre(Color{7, 8, 9}, Color{255, 0, 0}));
  EXPECT_THAT(remarks_.texts, ::testing::IsEmpty());
  // Colours from 0 to 1 are no bytes, even if the first ones look so.
  EXPECT_EQ(read_text("x y z r g b\n1 2 3 0 0 1\n1 2 3 0.5 0 1\n").column("r")->values[1], 0.5);
  const LandmarkMap commented =
      read_text("# columns: id x y z error in px\n#id,x,y,z,error\nnail,1,2,3,0.5\n");
  EXPECT_EQ(commented.landmarks().positions.at(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(commented.column("error")->values[0], 0.5);
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("columns that hold no numbers are left out: 'id'")));
  const LandmarkMap time = read_text("# time id x y z\n1.5 7 1 2 3\n1.5 9 1 2 3\n");
  EXPECT_THAT(time.landmarks().ids, ElementsAre(LandmarkId{7}, LandmarkId{9}));
  EXPECT_EQ(read_text("x,y,z,in pixels\n1,2,3,4\n").column("in_pixels")->values[0], 4.0);
  EXPECT_THAT(refused("x,y,z,x\n1,2,3,4\n"), HasSubstr("two columns have the name 'x'"));
  EXPECT_THAT(refused("name,lat,lon\na,47,8\n"),
              HasSubstr("points:1: the table names no columns x, y and z"));
}

TEST_F(PlainPointsTest, APipeIsReadLikeAFile) {
  const std::string text = "1.5 2.5 3.5 255 0 7\n0.5 1 1 1 2 3\n";
  testing::Pipe pipe(text, 5);
  EXPECT_EQ(read_plain_points(pipe).landmarks().colors.size(), 2U);
}

// Compressed bytes may look like the names of a table.
TEST_F(PlainPointsTest, BytesWithCommasAreNoTable) {
  const std::string bytes("\x1f\x8b\x08\x08>x,k,r\nq,w,z\0\x02", 18);
  EXPECT_THAT(refusal(ErrorKind::kInput, [&] { read(folder_.write("a.map.gz", bytes)); }),
              HasSubstr("is compressed by gzip"));
}

TEST_F(PlainPointsTest, CairnTextIsNotMistakenForPoints) {
  EXPECT_EQ(read_text("FRAME 1 0 0 0 1 0 0 0\n").frame_count(), 1U);
  EXPECT_THAT(refused("hello world again\n"), HasSubstr("is in no known map format"));
}

TEST_F(PlainPointsTest, NumPyArraysBecomeLandmarks) {
  const LandmarkMap map =
      read_text(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }   \n", 6));
  EXPECT_THAT(map.landmarks().positions,
              ElementsAre(Eigen::Vector3d(0.5, 1.5, 2.5), Eigen::Vector3d(3.5, 4.5, 5.5)));
}

TEST_F(PlainPointsTest, NumPyArraysOfOtherKindsAreRefused) {
  EXPECT_THAT(refused(npy("{'descr': '<i8', 'fortran_order': False, 'shape': (2, 3), }\n", 6)),
              HasSubstr("descr: '<i8' is no type of positions"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': True, 'shape': (2, 3), }\n", 6)),
              HasSubstr("fortran_order"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (6,), }\n", 6)),
              HasSubstr("shape: (6); expected (N, 3)"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 3), }\n", 6)),
              HasSubstr("position: the file ends after"));
  EXPECT_THAT(refused(npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 3), }\n", 6)),
              HasSubstr("there are bytes behind the last record"));
  const std::string whole = npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }\n", 6);
  for (std::size_t size = 6; size < whole.size(); ++size) {
    EXPECT_THAT(refused(whole.substr(0, size)), HasSubstr("points: byte ")) << size;
  }
}

// As PLY, CSV has no ids beyond 32 bits, of which this map has one.
TEST_F(PlainPointsTest, TablesKeepWhatTheyHavePlaceFor) {
  MapTables tables = testing::full_tables();
  tables.landmarks.colors[1] = Color{7, 8, 9};
  const LandmarkMap map{MapTables(tables)};
  for (const char* name : {"out.csv", "out.npz"}) {
    SCOPED_TRACE(name);
    const LandmarkMap back = read(write(map, name));
    EXPECT_EQ(back.landmarks().positions, map.landmarks().positions);
    EXPECT_EQ(back.landmarks().colors, map.landmarks().colors);
    ASSERT_TRUE(back.has_covariances());
    EXPECT_EQ(back.covariance(LandmarkIndex{0}), map.covariance(LandmarkIndex{0}));
    EXPECT_FALSE(back.covariance(LandmarkIndex{1}));
    EXPECT_EQ(back.column("confidence")->values[0], 0.25);
    EXPECT_EQ(back.column("observations")->values[0], 2.0);
  }
  const LandmarkMap npz = read(folder_ / "out.npz");
  EXPECT_EQ(npz.landmarks().ids, map.landmarks().ids);
  EXPECT_EQ(npz.landmarks().descriptors->kind, "ORB");
  EXPECT_EQ(npz.landmarks().descriptors->bytes, map.landmarks().descriptors->bytes);
  EXPECT_EQ(npz.landmarks().descriptors->known, map.landmarks().descriptors->known);
  for (const char* name : {"out.xyz", "out.npy"}) {
    EXPECT_EQ(read(write(map, name)).landmarks().positions, map.landmarks().positions) << name;
  }
}

TEST_F(PlainPointsTest, ArchivesKeepSeveralDescriptorsOfALandmark) {
  const LandmarkMap map = testing::several_map();
  const LandmarkMap back = read(write(map, "out.npz"));
  EXPECT_EQ(back.landmarks().descriptors->further_offsets,
            map.landmarks().descriptors->further_offsets);
  EXPECT_EQ(back.landmarks().descriptors->further, map.landmarks().descriptors->further);
  EXPECT_THAT(remarks_.texts, Not(Contains(HasSubstr("further"))));
  EXPECT_THAT(remarks_.texts, Not(Contains(HasSubstr("one entry a point"))));
}

TEST_F(PlainPointsTest, WritingSaysWhatHasNoPlace) {
  write(testing::full_map(), "out.csv");
  EXPECT_THAT(remarks_.texts,
              Contains(HasSubstr("provenance, GNSS positions, descriptors 'ORB'; left out")));
  write(testing::full_map(), "out.npy");
  EXPECT_THAT(remarks_.texts, Contains(HasSubstr("covariances, colours, descriptors 'ORB'")));
}

TEST_F(PlainPointsTest, DamagedArchivesAreRefused) {
  write(testing::full_map(), "out.npz");
  const std::string whole = testing::read_text(folder_ / "out.npz");
  EXPECT_THAT(refused(whole.substr(0, whole.size() / 2)), HasSubstr("has no end record"));
  std::string damaged = whole;
  damaged[200] = static_cast<char>(damaged[200] ^ 1);
  EXPECT_THAT(refused(damaged), HasSubstr("is damaged; expected its checksum"));
  for (std::size_t i = 0; i < whole.size(); i += 13) {
    damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    // Some bytes mean nothing, such as dates.
    try {
      read_bytes(damaged, "points");
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kInput) << error.what();
    }
  }
}

// points=numpy.float32([[1, 2, 3]]), weight=numpy.uint8([7]), packed as numpy.savez_compressed does, by
// Python's zipfile with ZIP64 headers.
TEST_F(PlainPointsTest, ArchivesOfNumPyAreRead) {
  constexpr std::string_view kHex =
      "504b03042d0000000000000021001c08ab35ffffffffffffffff0a001400706f696e74732e6e7079010010008c"
      "000000000000008c00000000000000934e554d5059010076007b276465736372273a20273c6634272c2027666f"
      "727472616e5f6f72646572273a2046616c73652c20277368617065273a2028312c2033292c207d202020202020"
      "202020202020202020202020202020202020202020202020202020202020202020202020202020202020202020"
      "202020202020200a0000803f0000004000004040504b03042d0000000000000021004e17c529ffffffffffffff"
      "ff0a0014007765696768742e6e70790100100081000000000000008100000000000000934e554d505901007600"
      "7b276465736372273a20277c7531272c2027666f727472616e5f6f72646572273a2046616c73652c2027736861"
      "7065273a2028312c292c207d202020202020202020202020202020202020202020202020202020202020202020"
      "2020202020202020202020202020202020202020202020202020200a07504b01022d032d000000000000002100"
      "1c08ab358c0000008c0000000a0000000000000000000000800100000000706f696e74732e6e7079504b01022d"
      "032d0000000000000021004e17c52981000000810000000a00000000000000000000008001c800000077656967"
      "68742e6e7079504b0506000000000200020070000000850100000000";
  std::string bytes;
  for (std::size_t i = 0; i < kHex.size(); i += 2) {
    bytes += static_cast<char>(std::stoi(std::string(kHex.substr(i, 2)), nullptr, 16));
  }
  const LandmarkMap map = read_text(bytes);
  EXPECT_EQ(map.landmarks().positions.at(0), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(map.column("weight")->values[0], 7.0);
}

TEST_F(PlainPointsTest, ArchivesTakeMemoryInProportionToTheirSize) {
  const auto points = [](std::size_t count) {
    const std::string header =
        "{'descr': '|u1', 'fortran_order': False, 'shape': (" + std::to_string(count) + ", 3), }\n";
    return archive_of("xyz.npy", npy(header, 0) + std::string(3 * count, '\1'));
  };
  EXPECT_EQ(read_text(points(1000)).landmark_count(), 1000U);
  // Twelve million bytes fit when unpacked, but not as numbers of eight bytes.
  EXPECT_THAT(refused(points(4'000'000)),
              AllOf(HasSubstr("its arrays take 10800"),
                    HasSubstr("at most 32 times the bytes of the archive and 64 MiB")));
}

TEST_F(PlainPointsTest, OtherArchivesAreNoArrays) {
  EXPECT_THAT(refused(archive_of("notes.txt", "hello")),
              HasSubstr("is a ZIP archive without NumPy arrays"));
}

TEST(RealPlainPoints, AreRead) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const LandmarkMap map = all_formats().read(*data / "foreign/points/MapPoints.txt");
  EXPECT_GT(map.landmark_count(), 5000U);
}

}  // namespace
}  // namespace cairn::detail

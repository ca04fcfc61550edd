// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/formats/map_file.hpp"

#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using namespace std::string_view_literals;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

std::string name_of(const std::filesystem::path& path) {
  const auto known = foreign_content(path);
  return known ? std::string(known->what) : "unknown";
}

TEST(ForeignContent, NamesFilesByTheirFirstBytes) {
  const TemporaryFolder folder;
  const std::pair<std::string_view, const char*> kFiles[] = {
      {"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "Git LFS pointer"},
      {"#ROSBAG V2.0\n", "ROS bag"},
      {"\x89MCAP0\r\n", "MCAP recording"},
      {"SQLite format 3\0"sv, "SQLite database"},
      {"LASF\0\0"sv, "LAS or LAZ"},
      {"ASTM-E57", "E57"},
      {"OFF\n3 0 0\n", "OFF mesh"},
      {"# obj\nv 1 2 3\nv 4 5 6\n", "OBJ mesh"},
      {"2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n", "PTX scan"},
      {"2\r\n1 2 3 0 1 2 3\r\n4 5 6 0 1 2 3\r\n", "PTS point cloud"},
      {"VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n", "pose graph in g2o"},
      {"\x16\0\0\0\0\0\0\0serialization::archive"sv, "ORB-SLAM3"},
      {"Ogawa\xff\0\1"sv, "Alembic scene"},
      {"\x01\x03\0\0\0\0\0\0\0"
       "0.3"sv,
       "OpenMVG's sfm_data.bin"},
      {"<?xml version=\"1.0\"?>\n<document>\n <chunk label=\"1\">", "Metashape"},
      {"<? xml version=\"1.0\" ?>\n<cameras>", "an XML document"},
      {"<!DOCTYPE html>\n<html>", "web page"},
      {"#name,x,y,alt,heading,pitch,roll\n", "RealityCapture"},
      {"{\"schema\": {\"name\": \"cairn.align\"}}", "result of Cairn"},
      {"[1, 2]", "is JSON"},
      {"\x89PNG\r\n", "is an image"},
      {"\0\0\0\x18"
       "ftypmp42"sv,
       "is a video"},
      {"PK\x03\x04", "ZIP archive"},
      {"\x1f\x8b\x08", "gzip"},
      {"\xff\xfe"
       "1\0"sv,
       "UTF-16"},
      {"abc\0"sv, "binary file of no known format"},
      {"hello world", "unknown"},
      {"", "unknown"},
  };
  for (const auto& [bytes, what] : kFiles) {
    EXPECT_THAT(name_of(folder.write("file", bytes)), HasSubstr(what));
  }
}

TEST(ForeignContent, NamesFilesByTheirEndingsWhereBytesSayNothing) {
  const TemporaryFolder folder;
  const float point[4] = {1.5F, -2.0F, 0.25F, 0.5F};
  const std::string scan(reinterpret_cast<const char*>(point), sizeof point);
  EXPECT_THAT(name_of(folder.write("0.bin", scan + scan)), HasSubstr("lidar scan as KITTI"));
  EXPECT_THAT(name_of(folder.write("1.bin", scan + "x")), HasSubstr("binary file of no known"));
  EXPECT_THAT(name_of(folder.write("0.dat", scan)), HasSubstr("binary file of no known"));
  EXPECT_THAT(name_of(folder.write("a.splat", "")), HasSubstr("Gaussian splats"));
  EXPECT_THAT(name_of(folder.write("a.SPZ", "\x1f\x8b")), HasSubstr("Gaussian splats"));
}

TEST(ForeignContent, NamesFoldersByWhatTheyHold) {
  const std::pair<std::vector<const char*>, const char*> kFolders[] = {
      {{"rgb.txt", "depth.txt"}, "RGB-D sequence in TUM layout"},
      {{"color/0.jpg", "depth/0.png", "pose/0.txt"}, "ScanNet"},
      {{"results/0.jpg", "traj.txt"}, "Replica"},
      {{"rgb/0.png", "depth/0.png"}, "without the lists"},
      {{"mav0/a"}, "EuRoC"},
      {{"image_0/0.png", "image_1/0.png"}, "stereo sequence in KITTI"},
      {{"rgb.mp4", "odometry.csv"}, "phone"},
      {{"metadata.yaml", "bag.db3"}, "ROS 2 bag"},
      {{"a.JPG", "b.jpg", "notes.txt"}, "folder of images"},
      {{"a.jpg", "notes.txt", "more.txt"}, "unknown"},
      {{}, "unknown"},
  };
  for (const auto& [files, what] : kFolders) {
    const TemporaryFolder folder;
    for (const char* const file : files) {
      std::filesystem::create_directories((folder / file).parent_path());
      folder.write(file, "");
    }
    EXPECT_THAT(name_of(folder.path()), HasSubstr(what));
  }
  EXPECT_EQ(name_of("/nowhere/at/all"), "unknown");
}

TEST(ForeignContent, SaysWhatTakesIt) {
  const TemporaryFolder folder;
  folder.write("rgb.txt", "");
  folder.write("depth.txt", "");
  EXPECT_THAT(std::string(foreign_content(folder.path())->advice), HasSubstr("'cairn map'"));
  const auto atlas = folder.write("a.osa", "22 serialization::archive 17");
  EXPECT_THAT(std::string(foreign_content(atlas)->advice), HasSubstr("docs/from_orbslam3.md"));
}

}  // namespace
}  // namespace cairn

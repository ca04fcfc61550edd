// SPDX-License-Identifier: BSD-3-Clause
// Files of real users, as their programs wrote them: each is read, or refused with what would help.
#include <filesystem>
#include <ostream>
#include <string>
#include <vector>

#include "cli.hpp"
#include "support/real_data.hpp"

namespace cairn::testing {
namespace {

using ::testing::HasSubstr;

// A command on files in the folder of cases.
struct UserCase {
  std::vector<std::string> words;
  int exit_code = 0;
  std::string says;  // on standard output or error
};

std::ostream& operator<<(std::ostream& out, const UserCase& one) {
  for (const std::string& word : one.words) out << word << " ";
  return out;
}

class CasesTest : public CliTest, public ::testing::WithParamInterface<UserCase> {
 protected:
  void SetUp() override {
    const auto data = real_data();
    if (!data) GTEST_SKIP() << kNoRealData;
    cases_ = *data / "cases";
    if (!std::filesystem::is_directory(cases_)) {
      GTEST_SKIP() << cases_ << " is not there: nothing was tested";
    }
  }

  std::filesystem::path cases_;
};

TEST_P(CasesTest, IsAnsweredAsTheUserNeeds) {
  const UserCase& one = GetParam();
  std::vector<std::string> words;
  for (const std::string& word : one.words) {
    const std::filesystem::path in_cases = cases_ / word;
    const bool is_input = word.find('/') != std::string::npos && std::filesystem::exists(in_cases);
    words.push_back(is_input ? in_cases.string() : word);
  }
  const CommandResult result = cairn(words);
  const std::string all = result.output + result.errors;
  EXPECT_EQ(result.exit_code, one.exit_code) << all;
  EXPECT_THAT(all, HasSubstr(one.says));
}

UserCase reads(const std::string& file, const std::string& says) {
  return {{"info", file}, 0, says};
}

UserCase refuses(const std::string& file, const std::string& says) {
  return {{"info", file}, 3, says};
}

UserCase evaluates(const std::string& file, const std::string& says) {
  const std::string folder = "trajectory_nan_header_comma_ns/";
  return {{"evaluate", "trajectory", folder + file, folder + "gt.txt"}, 0, says};
}

INSTANTIATE_TEST_SUITE_P(
    Conventions, CasesTest,
    ::testing::Values(reads("colmap_nvm/by_colmap.nvm",
                            "measurements are from the corner of the images"),
                      reads("ply_unit/bo.ply", "length unit             free"),
                      reads("points_without_tracks/notrack_a", "no point has a track"),
                      reads("instant_ngp_layout/colmap.db", "colmap_sparse/0"),
                      reads("instant_ngp_layout/colmap_sparse", "colmap_sparse/0 is read"),
                      reads("instant_ngp_layout/colmap_text", "frames                  3,")));

INSTANTIATE_TEST_SUITE_P(
    Unusual, CasesTest,
    ::testing::Values(
        reads("csv_headers/pandas.csv", "landmarks"), reads("csv_headers/quoted.csv", "landmarks"),
        reads("csv_headers/pos.csv", "landmarks"), reads("csv_headers/veloview.csv", "landmarks"),
        reads("csv_headers/ref_pointcloud.ply", "landmarks"),
        reads("one_far_landmark/ssvio.pcd", "30211 of 33438 landmarks left out"),
        reads("one_far_landmark/test_color_map.msg", "2 of 1297 landmarks left out"),
        reads("stella_nan_depths/neu_map_0.msg", "depths left out: not finite"),
        reads("pcd_ascii_without_last_newline/crlf_asc_nolast.ply", "the last line does not end"),
        reads("pcd_ascii_without_last_newline/ism_test_cat.pcd", "the last line does not end"),
        reads("pcd_ascii_without_last_newline/nolast.xyz", "the last line does not end"),
        reads("pcd_trailing_byte/person.pcd", "1 bytes after the data"),
        reads("pcd_width_0_height_0/map_0.pcd", "POINTS, 1341, is their number"),
        evaluates("nan.txt", "17 of 827 poses left out"), evaluates("head.csv", "827 poses"),
        evaluates("mcd.csv", "827 poses"), evaluates("comma.csv", "no line names the columns"),
        evaluates("unsorted.txt", "not in the order of time; sorted"),
        UserCase{{"evaluate", "trajectory", "trajectory_duplicate_times/KF.txt",
                  "trajectory_duplicate_times/Cam.txt"},
                 0,
                 "they have the time of one before"}));

INSTANTIATE_TEST_SUITE_P(
    NoMaps, CasesTest,
    ::testing::Values(refuses("columns_read_as_xyz/KF.txt", "cairn evaluate trajectory"),
                      refuses("columns_read_as_xyz/MapPoints.txt",
                              "nothing says which are x, y and z"),
                      refuses("columns_read_as_xyz/kitti.txt", "cairn evaluate trajectory"),
                      refuses("columns_read_as_xyz/points3d_renamed.txt", "COLMAP's points3D.txt"),
                      refuses("columns_read_as_xyz/replica_traj.txt", "cairn evaluate trajectory"),
                      refuses("not_a_map/a.las", "is a LAS or LAZ point cloud"),
                      refuses("not_a_map/kitti4.bin", "lidar scan"),
                      refuses("not_a_map/lfs.db", "git lfs pull"),
                      refuses("not_a_map/mapping.osa", "docs/from_orbslam3.md"),
                      refuses("not_a_map/o3d.pts", "is a PTS point cloud"),
                      refuses("not_a_map/obj.obj", "is an OBJ mesh"),
                      refuses("not_a_map/off.off", "is an OFF mesh"),
                      refuses("not_a_map/ptx.ptx", "is a PTX scan"),
                      reads("not_a_map/pose_graph.g2o", "vertices                91"),
                      refuses("unknown_content/lfs.nvm", "git lfs pull"),
                      refuses("unknown_content/lfs_colmap", "git lfs pull"),
                      refuses("unknown_content/lfs_reconstruction.json", "git lfs pull"),
                      refuses("unknown_content/metashape_cameras.xml", "Metashape"),
                      refuses("unknown_content/cameras_ddd.xml", "XML document"),
                      reads("unknown_content/realitycapture.csv",
                            "2 of 2 frames have no known camera: the file states no size")));

// What stands twice, mirror images and common grids are no evidence of one place.
UserCase aligns(const std::string& folder, const std::string& source, const std::string& target,
                int exit_code, const std::string& says) {
  return {{"align", folder + source, folder + target}, exit_code, says};
}

INSTANTIATE_TEST_SUITE_P(
    Doubles, CasesTest,
    ::testing::Values(aligns("can_two_labels/", "oback.cairn", "efront.cairn", 4,
                             "descriptor matches agree with another pose"),
                      aligns("can_two_labels/", "efront.cairn", "oback.cairn", 4, "ambiguous"),
                      aligns("can_two_labels/", "oback.cairn", "eback.cairn", 0, "aligned"),
                      aligns("can_two_labels/", "ofront.cairn", "efront.cairn", 0, "aligned"),
                      aligns("mirror_milk_0/", "a.xyz", "b.xyz", 4,
                             "the mirror image of the source fits better"),
                      aligns("lattice_rounded_cap_person/", "a.pcd", "b.pcd", 4, "rejected"),
                      aligns("one_voxel_grid/", "room.xyz", "other.xyz", 4, "rejected"),
                      reads("one_voxel_grid/room.xyz", "lie on a grid of 0.15 x 0.15 x 0.15")));

INSTANTIATE_TEST_SUITE_P(
    Splats, CasesTest,
    ::testing::Values(UserCase{{"convert", "splat_and_normals/b_splat.ply", "y.ply", "--transform",
                                "0 0 0 0 0 90"},
                               0,
                               "y.ply: 1853 landmarks"},
                      UserCase{{"align", "splat_and_normals/b_splat.ply",
                                "splat_and_normals/a_splat.ply", "-o", "x.ply"},
                               0,
                               "aligned"},
                      UserCase{{"merge", "splat_and_normals/b_splat.ply",
                                "splat_and_normals/a_splat.ply", "-o", "x.ply"},
                               0,
                               "3,706 landmarks became"}));

INSTANTIATE_TEST_SUITE_P(
    Pairs, CasesTest,
    ::testing::Values(
        UserCase{{"align", "ply_unit/bo.ply", "ply_unit/be3.ply"}, 0, "aligned"},
        UserCase{{"align", "points_without_tracks/notrack_a", "points_without_tracks/notrack_b"},
                 0,
                 "943 of 943 landmarks"},
        UserCase{
            {"align", "deformation_false_refusal/fta.cairn", "deformation_false_refusal/ftb.cairn",
             "--truth", "deformation_false_refusal/truth_fta_ftb.txt"},
            0,
            "aligned"},
        UserCase{{"merge", "merge_common_images/0", "merge_common_images/1", "-o", "m/"},
                 0,
                 "merge_common_images/1 is folded: 7 of its 26 images are elsewhere in "
                 "merge_common_images/0, 1.39 away and turned by 105 deg: '61.jpg', '65.jpg', "
                 "'67.jpg', '69.jpg', '70.jpg', '72.jpg', '74.jpg'"},
        UserCase{
            {"align", "merge_common_images/1", "merge_common_images/0", "-o", "fold.ply"},
            0,
            "1.39 away and turned by 105 deg: '61.jpg', '65.jpg', '67.jpg', '69.jpg', '70.jpg', "
            "'72.jpg', '74.jpg'; they are left out of fold.ply"},
        reads("merge_common_images/1",
              "7 images ('61.jpg', '65.jpg', '67.jpg', '69.jpg', '70.jpg', "
              "'72.jpg', '74.jpg') are where others are"),
        UserCase{
            {"align", "submodels_common_images_refused/1", "submodels_common_images_refused/4"},
            0,
            "20 images are in both maps"},
        UserCase{{"report", "report_of_folder/model", "-o", "r.html"}, 0, "wrote r.html"}));

}  // namespace
}  // namespace cairn::testing

// SPDX-License-Identifier: BSD-3-Clause
// The Point Cloud Library as judge: its own IterativeClosestPoint, base and with our correspondence
// estimation, against cairn::align.
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>
#include <pcl/registration/icp.h>

#include "cairn/core/error.hpp"
#include "cairn/evaluation/pose_error.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/registration/icp.hpp"

#include "adapters/pcl/confidence_correspondence_estimation.hpp"
#include "support/real_data.hpp"
#include "support/temporary_folder.hpp"

namespace cairn {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Icp = pcl::IterativeClosestPoint<pcl::PointXYZ, pcl::PointXYZ, double>;
using Confident =
    pcl_adapter::ConfidenceCorrespondenceEstimation<pcl::PointXYZ, pcl::PointXYZ, double>;

constexpr double kDegree = std::numbers::pi / 180.0;

// PCL's clouds hold single precision: both sides get the same numbers.
PointSet rounded_to_float(PointSet points) {
  for (Eigen::Vector3d& position : points.positions) {
    position = position.cast<float>().cast<double>();
  }
  return points;
}

Cloud::Ptr cloud_of(const PointSet& points) {
  Cloud::Ptr cloud(new Cloud);
  for (const Eigen::Vector3d& position : points.positions) {
    cloud->push_back({static_cast<float>(position.x()), static_cast<float>(position.y()),
                      static_cast<float>(position.z())});
  }
  return cloud;
}

struct PclResult {
  Rigid3 target_from_source;
  double score = 0.0;
  bool reached_limit = false;
};

PclResult align_by_pcl(const PointSet& source, const PointSet& target, const IcpOptions& options) {
  Icp icp;
  if (!target.confidences.empty()) {
    icp.setCorrespondenceEstimation(
        pcl::make_shared<Confident>(target.confidences, options.k, source.confidences));
  }
  icp.setUseReciprocalCorrespondences(options.reciprocal);
  if (std::isfinite(options.max_distance)) icp.setMaxCorrespondenceDistance(options.max_distance);
  icp.setMaximumIterations(options.max_iterations);
  icp.setInputSource(cloud_of(source));
  icp.setInputTarget(cloud_of(target));
  Cloud aligned;
  icp.align(aligned, Eigen::Matrix4d(options.initial.matrix()));
  PclResult result;
  result.target_from_source = Rigid3::from_matrix(Matrix4d(icp.getFinalTransformation()));
  result.score = icp.getFitnessScore();
  using Criteria = pcl::registration::DefaultConvergenceCriteria<double>;
  result.reached_limit =
      icp.getConvergeCriteria()->getConvergenceState() == Criteria::CONVERGENCE_CRITERIA_ITERATIONS;
  return result;
}

struct MapPair {
  LandmarkMap source;
  LandmarkMap target;
};

// The two halves of the authors' own map, later half as source.
std::optional<MapPair> real_pair() {
  const auto data = testing::real_data();
  if (!data) return std::nullopt;
  const LandmarkMap map = read_map(*data / "map_fr1_desk.txt");
  return MapPair{cut_frames(map, FrameId{120}, FrameId{240}),
                 cut_frames(map, FrameId{0}, FrameId{120})};
}

std::vector<std::optional<Metric>> strategies() {
  return {std::nullopt, covariance_metric(), observations_metric(), distance_metric()};
}

std::string name_of(const std::optional<Metric>& metric) {
  return metric ? metric->name : "base";
}

std::vector<Rigid3> displacements() {
  return {Rigid3(), Rigid3::from_roll_pitch_yaw({0, 0, 0}, 0, 0, 30 * kDegree),
          Rigid3::from_roll_pitch_yaw({-0.5, 0.5, 0}, 0, 0, 0),
          Rigid3::from_roll_pitch_yaw({0.5, -0.5, 0}, 0, 0, -10 * kDegree),
          Rigid3::from_roll_pitch_yaw({0, 1, 0.4}, 10 * kDegree, 0, 22.5 * kDegree)};
}

void expect_one_step_agrees(const MapPair& pair, const IcpOptions& base_options) {
  for (const auto& metric : strategies()) {
    const PointSet source = rounded_to_float(point_set(pair.source, metric));
    const PointSet target = rounded_to_float(point_set(pair.target, metric));
    for (const Rigid3& initial : displacements()) {
      SCOPED_TRACE(name_of(metric));
      IcpOptions options = base_options;
      options.initial = initial;
      options.max_iterations = 1;
      const RegistrationResult ours = icp(source, target, options);
      const PclResult theirs = align_by_pcl(source, target, options);
      const PoseError error =
          pose_error(ours.target_from_source, theirs.target_from_source, source.positions);
      EXPECT_LT(error.rotation_rad, 1e-6);
      EXPECT_LT(error.translation, 1e-6);
      EXPECT_NEAR(*ours.score, theirs.score, 1e-5 * theirs.score);
    }
  }
}

TEST(PclPeer, TakesTheSameStepOnSyntheticMaps) {
  const SyntheticPair pair = synthetic_pair({.seed = 3, .landmarks = 1500});
  expect_one_step_agrees({transformed(pair.source, pair.target_from_source), pair.target}, {});
}

TEST(PclPeer, TakesTheSameReciprocalStepOnSyntheticMaps) {
  const SyntheticPair pair = synthetic_pair({.seed = 4, .landmarks = 1500});
  IcpOptions options;
  options.reciprocal = true;
  options.max_distance = 0.5;
  expect_one_step_agrees({transformed(pair.source, pair.target_from_source), pair.target}, options);
}

TEST(PclPeer, TakesTheSameStepOnTheRealMap) {
  const auto pair = real_pair();
  if (!pair) GTEST_SKIP() << testing::kNoRealData;
  expect_one_step_agrees(*pair, {});
}

TEST(PclPeer, ReachesTheSamePoseOnTheRealMap) {
  const auto pair = real_pair();
  if (!pair) GTEST_SKIP() << testing::kNoRealData;
  int compared = 0;
  int runs = 0;
  for (const auto& metric : strategies()) {
    const PointSet source = rounded_to_float(point_set(pair->source, metric));
    const PointSet target = rounded_to_float(point_set(pair->target, metric));
    for (const Rigid3& initial : displacements()) {
      IcpOptions options;
      options.initial = initial;
      options.stop_at_repetition = false;
      const RegistrationResult ours = icp(source, target, options);
      const PclResult theirs = align_by_pcl(source, target, options);
      ++runs;
      const PoseError error =
          pose_error(ours.target_from_source, theirs.target_from_source, source.positions);
      if (ours.stop_reason == StopReason::kIterationLimit || theirs.reached_limit) continue;
      SCOPED_TRACE(name_of(metric));
      ++compared;
      EXPECT_LT(error.rotation_rad, 1e-5);
      EXPECT_LT(error.translation, 1e-5);
      EXPECT_NEAR(*ours.score, theirs.score, 1e-3 * theirs.score);
    }
  }
  EXPECT_GE(compared, runs / 3) << "too few runs stop early to compare anything";
}

TEST(PclPeer, ChoosesTheNearestForOneCandidateOrWithoutConfidences) {
  const SyntheticPair pair = synthetic_pair({.seed = 5, .landmarks = 300});
  const Cloud::Ptr source = cloud_of(point_set(pair.target, std::nullopt));
  const Cloud::Ptr target = cloud_of(point_set(pair.source, std::nullopt));
  pcl::registration::CorrespondenceEstimation<pcl::PointXYZ, pcl::PointXYZ, double> nearest;
  Confident one_candidate(std::vector<double>(target->size(), 1.0), 1);
  Confident no_confidences({}, 5);
  using Estimation =
      pcl::registration::CorrespondenceEstimationBase<pcl::PointXYZ, pcl::PointXYZ, double>;
  std::vector<pcl::Correspondences> found;
  for (Estimation* const estimation :
       std::initializer_list<Estimation*>{&nearest, &one_candidate, &no_confidences}) {
    estimation->setInputSource(source);
    estimation->setInputTarget(target);
    estimation->determineCorrespondences(found.emplace_back());
  }
  ASSERT_EQ(found[0].size(), source->size());
  for (std::size_t i = 0; i < source->size(); ++i) {
    EXPECT_EQ(found[0][i].index_match, found[1][i].index_match);
    EXPECT_EQ(found[0][i].index_match, found[2][i].index_match);
  }
}

TEST(PclPeer, LeavesOutPointsThatAreNotFinite) {
  Cloud::Ptr source(new Cloud);
  source->push_back({std::numeric_limits<float>::quiet_NaN(), 0, 0});
  source->push_back({1, 0, 0});
  source->is_dense = false;
  Cloud::Ptr target(new Cloud);
  target->push_back({1, 0, 0});
  target->push_back({2, 0, 0});
  Confident estimation({1.0, 2.0}, 2);
  estimation.setInputSource(source);
  estimation.setInputTarget(target);
  pcl::Correspondences found;
  estimation.determineCorrespondences(found);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].index_query, 1);
  EXPECT_EQ(found[0].index_match, 1);
  estimation.determineCorrespondences(found, 0.5);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].index_match, 0) << "the more confident one lies beyond the distance";
}

TEST(PclPeer, WorksForOtherPointTypesAndAsAClone) {
  using Point = pcl::PointXYZI;
  pcl::PointCloud<Point>::Ptr source(new pcl::PointCloud<Point>);
  source->push_back(Point(0.1F, 0, 0, 7));
  pcl::PointCloud<Point>::Ptr target(new pcl::PointCloud<Point>);
  target->push_back(Point(0, 0, 0, 1));
  target->push_back(Point(1, 0, 0, 1));
  pcl_adapter::ConfidenceCorrespondenceEstimation<Point, Point> estimation({1.0, 3.0}, 2);
  const auto clone = estimation.clone();
  clone->setInputSource(source);
  clone->setInputTarget(target);
  pcl::Correspondences found;
  clone->determineReciprocalCorrespondences(found);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].index_match, 1);
}

TEST(PclPeer, RefusesConfidencesOfAnotherCloud) {
  Cloud::Ptr cloud(new Cloud);
  cloud->push_back({0, 0, 0});
  Confident estimation({1.0, 2.0});
  estimation.setInputSource(cloud);
  estimation.setInputTarget(cloud);
  pcl::Correspondences found;
  EXPECT_THROW(estimation.determineCorrespondences(found), Error);
  EXPECT_THROW(Confident({}, 0), Error);
}

void expect_same_points(const LandmarkMap& map, const Cloud& cloud) {
  ASSERT_EQ(cloud.size(), map.landmark_count());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(cloud[i].getVector3fMap(), map.landmarks().positions[i].cast<float>());
  }
}

TEST(PclPeer, ReadsTheFilesThatCairnWrites) {
  const testing::TemporaryFolder folder;
  const LandmarkMap map = synthetic_map({.seed = 6, .landmarks = 200});
  for (const bool ascii : {false, true}) {
    Cloud cloud;
    write_map(map, folder / "a.pcd", {.ascii = ascii});
    ASSERT_EQ(pcl::io::loadPCDFile((folder / "a.pcd").string(), cloud), 0);
    expect_same_points(map, cloud);
    // Positions in PLY are doubles, which PCL reads but does not put into its point types.
    write_map(map, folder / "a.ply", {.ascii = ascii});
    pcl::PCLPointCloud2 points;
    ASSERT_EQ(pcl::io::loadPLYFile((folder / "a.ply").string(), points), 0);
    ASSERT_EQ(points.width * points.height, map.landmark_count());
    ASSERT_EQ(points.fields[0].name, "x");
    for (std::size_t i = 0; i < map.landmark_count(); ++i) {
      double x = 0.0;
      std::memcpy(&x, points.data.data() + i * points.point_step + points.fields[0].offset,
                  sizeof x);
      EXPECT_EQ(x, map.landmarks().positions[i].x());
    }
  }
}

TEST(PclPeer, WritesFilesThatCairnReads) {
  const testing::TemporaryFolder folder;
  const Cloud::Ptr cloud = cloud_of(point_set(synthetic_map({.seed = 8, .landmarks = 200}), {}));
  const std::string pcd = (folder / "a.pcd").string();
  const std::string ply = (folder / "a.ply").string();
  pcl::io::savePCDFileASCII(pcd, *cloud);
  // PCL's text has fewer digits than a float.
  EXPECT_EQ(read_map(pcd).landmark_count(), cloud->size());
  pcl::io::savePCDFileBinary(pcd, *cloud);
  expect_same_points(read_map(pcd), *cloud);
  pcl::io::savePCDFileBinaryCompressed(pcd, *cloud);
  expect_same_points(read_map(pcd), *cloud);
  pcl::io::savePLYFileBinary(ply, *cloud);
  expect_same_points(read_map(ply), *cloud);
}

}  // namespace
}  // namespace cairn

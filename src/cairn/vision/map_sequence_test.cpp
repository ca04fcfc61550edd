// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/map_sequence.hpp"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"
#include "cairn/vision/detail/tracker.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

const Camera kCamera{{1}, "PINHOLE", 320, 240, {260.0, 260.0, 159.5, 119.5}};
constexpr double kWall = 2.0;     // m to a wall that the camera moves along
constexpr int kPixelsAFrame = 4;  // by which its image moves: exact, without any rendering
constexpr double kMetresAFrame = kPixelsAFrame * kWall / 260.0;

// A wall of random spots of several sizes.
const cv::Mat& wall() {
  static const cv::Mat wall_image = [] {
    Random random(1);
    cv::Mat sum = cv::Mat::zeros(240, 900, CV_32FC1);
    for (const int size : {5, 11, 23}) {
      cv::Mat spots(sum.rows / size + 1, sum.cols / size + 1, CV_32FC1);
      for (int y = 0; y < spots.rows; ++y) {
        for (int x = 0; x < spots.cols; ++x) {
          spots.at<float>(y, x) = static_cast<float>(random.uniform(0.0, 85.0));
        }
      }
      cv::Mat large;
      cv::resize(spots, large, {}, size, size, cv::INTER_NEAREST);
      sum += large(cv::Rect(0, 0, sum.cols, sum.rows));
    }
    cv::Mat image;
    sum.convertTo(image, CV_8U);
    cv::GaussianBlur(image, image, {5, 5}, 0.9);
    return image;
  }();
  return wall_image;
}

FrameImages frame_at(std::size_t i) {
  FrameImages frame;
  frame.timestamp_s = 10.0 + 0.1 * static_cast<double>(i);
  frame.name = std::to_string(i) + ".png";
  const cv::Mat seen = wall()(cv::Rect(static_cast<int>(i) * kPixelsAFrame, 0, 320, 240)).clone();
  frame.gray = GrayImage(320, 240, {seen.begin<std::uint8_t>(), seen.end<std::uint8_t>()});
  frame.depth_m = DepthImage(320, 240, static_cast<float>(kWall));
  return frame;
}

MiniMapLength every_frames(std::size_t frames) {
  MiniMapLength length;
  length.frames = frames;
  return length;
}

MiniMapLength every_metres(double metres) {
  MiniMapLength length;
  length.metres = metres;
  return length;
}

const MapSequenceOptions kDefaults;

Rigid3 true_pose(std::size_t i) {
  return Rigid3::from_roll_pitch_yaw({static_cast<double>(i) * kMetresAFrame, 0.0, 0.0}, 0, 0, 0);
}

void expect_true(const Trajectory& trajectory, double tolerance_m = 0.01) {
  for (const TimedPose& pose : trajectory.poses()) {
    const auto i = static_cast<std::size_t>(std::lround((pose.timestamp_s - 10.0) / 0.1));
    const Vector6d off = true_pose(i).difference_to(pose.world_from_camera);
    EXPECT_LT(off.head<3>().norm(), tolerance_m) << i;
    EXPECT_LT(off.tail<3>().norm(), tolerance_m) << i;
  }
}

TEST(MapFrames, CountsWhatBecameOfEachFrame) {
  std::vector<MappingProgress> told;
  MapSequenceOptions options;
  options.on_frame = [&](const MappingProgress& progress) { told.push_back(progress); };
  const MappedSequence mapped = map_frames(30, frame_at, kCamera, options);
  EXPECT_EQ(mapped.frames, 30U);
  EXPECT_EQ(mapped.tracked, 30U);
  EXPECT_EQ(mapped.waiting, 0U);
  EXPECT_EQ(mapped.unreadable, 0U);
  EXPECT_EQ(mapped.frames_without_depth, 0U);
  EXPECT_TRUE(mapped.lost.empty());
  EXPECT_TRUE(mapped.links.empty());
  ASSERT_EQ(mapped.maps.size(), 1U);
  EXPECT_EQ(mapped.keyframes, mapped.maps[0].frame_count());
  EXPECT_GE(mapped.keyframes, 3U);
  EXPECT_LE(mapped.keyframes, 15U);
  EXPECT_GT(mapped.mean_tracked_landmarks, 100.0);
  ASSERT_TRUE(mapped.median_reprojection_error);
  EXPECT_LT(*mapped.median_reprojection_error, 0.5);
  ASSERT_EQ(mapped.trajectory.size(), 30U);
  expect_true(mapped.trajectory);
  ASSERT_EQ(told.size(), 30U);
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_EQ(told[i].frame, i + 1) << "in the order of frames";
    EXPECT_EQ(told[i].frames, 30U);
  }
}

TEST(MapFrames, TheMapNamesItsFramesAndLandmarks) {
  const LandmarkMap map = std::move(map_frames(20, frame_at, kCamera, kDefaults).maps.at(0));
  EXPECT_EQ(map.frames().image_names.front(), "0.png");
  EXPECT_EQ(map.frames().timestamps_s.front(), 10.0);
  for (std::size_t k = 0; k < map.frame_count(); ++k) {
    const std::size_t i = map.frames().ids[k].value;
    EXPECT_EQ(map.frames().image_names[k], std::to_string(i) + ".png");
  }
  ASSERT_TRUE(map.has_covariances());
  ASSERT_TRUE(map.landmarks().descriptors);
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    EXPECT_NEAR(map.landmarks().positions[l].z(), kWall, 0.05);
    const auto covariance = map.covariance(LandmarkIndex{l});
    ASSERT_TRUE(covariance);
    EXPECT_TRUE(covariance->allFinite());
    EXPECT_GT(covariance->determinant(), 0.0);
    EXPECT_GE(map.observation_count(LandmarkIndex{l}), 1U);
  }
}

TEST(MapFrames, MapOptionsChooseWhatTheMapHolds) {
  MapSequenceOptions options;
  options.map.min_observations = 2;
  options.map.descriptors = false;
  options.map.covariance = LandmarkCovariance::kMarginal;
  const LandmarkMap map = std::move(map_frames(20, frame_at, kCamera, options).maps.at(0));
  EXPECT_FALSE(map.landmarks().descriptors);
  ASSERT_GT(map.landmark_count(), 50U);
  for (std::uint32_t l = 0; l < map.landmark_count(); ++l) {
    EXPECT_GE(map.observation_count(LandmarkIndex{l}), 2U);
  }
}

// The start is asked for with the time of the first frame that a map can begin with.
TEST(MapFrames, BeginsAtTheStartPose) {
  const Trajectory known(
      {{10.0, Rigid3()}, {10.25, Rigid3::from_roll_pitch_yaw({1.0, 0.5, -0.25}, 0.0, 0.0, 0.5)}});
  std::vector<double> asked;
  MapSequenceOptions options;
  options.odometry.start = [&](double time) {
    asked.push_back(time);
    return interpolated(known, time, 1.0).value();
  };
  const auto read = [](std::size_t i) {
    FrameImages frame = frame_at(i);
    if (i < 2) frame.depth_m = {};
    return frame;
  };
  const MappedSequence mapped = map_frames(12, read, kCamera, options);
  EXPECT_THAT(asked, ::testing::ElementsAre(::testing::DoubleEq(10.2)));
  EXPECT_EQ(mapped.waiting, 2U);
  EXPECT_EQ(mapped.frames_without_depth, 2U);
  EXPECT_EQ(mapped.tracked, 10U);
  const TimedPose& first = mapped.trajectory.poses().front();
  EXPECT_DOUBLE_EQ(first.timestamp_s, 10.2);
  const Vector6d off = Rigid3::from_roll_pitch_yaw({0.8, 0.4, -0.2}, 0.0, 0.0, 0.4)
                           .difference_to(first.world_from_camera);
  EXPECT_LT(off.norm(), 1e-9) << "four fifths of the way";
}

TEST(MapFrames, StretchesWithoutTrackingAreReported) {
  const auto read = [](std::size_t i) {
    FrameImages frame = frame_at(i);
    if ((i >= 12 && i < 16) || i == 22) frame.gray = GrayImage(320, 240);
    return frame;
  };
  const MappedSequence mapped = map_frames(30, read, kCamera, kDefaults);
  ASSERT_EQ(mapped.lost.size(), 2U);
  EXPECT_EQ(mapped.lost[0].frames, 4U);
  EXPECT_DOUBLE_EQ(mapped.lost[0].first_timestamp_s, 11.2);
  EXPECT_DOUBLE_EQ(mapped.lost[0].last_timestamp_s, 11.5);
  EXPECT_EQ(mapped.lost[1].frames, 1U);
  EXPECT_EQ(mapped.lost_frames(), 5U);
  EXPECT_EQ(mapped.tracked, 25U);
  EXPECT_EQ(mapped.trajectory.size(), 25U);
  expect_true(mapped.trajectory, 0.02);
}

TEST(MapFrames, UnreadableFramesAreLeftOutAndLogged) {
  const auto read = [](std::size_t i) {
    FrameImages frame = frame_at(i);
    if (i == 0 || i == 5) {
      frame.gray = {};
      frame.defect = "damaged: " + frame.name;
    }
    return frame;
  };
  std::vector<std::string> log;
  const MappedSequence mapped =
      map_frames(12, read, kCamera, kDefaults,
                 {.log = [&](std::string_view line) { log.emplace_back(line); }});
  EXPECT_EQ(mapped.unreadable, 2U);
  EXPECT_EQ(mapped.waiting, 1U);
  EXPECT_EQ(mapped.lost_frames(), 1U);
  EXPECT_EQ(mapped.tracked, 10U);
  EXPECT_THAT(log,
              ::testing::ElementsAre(HasSubstr("damaged: 0.png"), HasSubstr("damaged: 5.png")));
}

// Each mini-map begins, in its own frame, with the keyframe that ended the one before.
void expect_chain(const MappedSequence& mapped) {
  ASSERT_EQ(mapped.links.size() + 1, mapped.maps.size());
  Rigid3 first_from_map;
  for (std::size_t m = 0; m < mapped.maps.size(); ++m) {
    const LandmarkMap& map = mapped.maps[m];
    if (m > 0) {
      const Rigid3 link = mapped.links[m - 1].target_from_source->rigid();
      const LandmarkMap& before = mapped.maps[m - 1];
      const auto last = static_cast<std::uint32_t>(before.frame_count() - 1);
      EXPECT_EQ(map.frames().timestamps_s.front(), before.frames().timestamps_s.back());
      EXPECT_LT(before.world_from_camera(FrameIndex{last}).difference_to(link).norm(), 1e-9);
      EXPECT_LT(map.world_from_camera(FrameIndex{0}).difference_to(Rigid3()).norm(), 1e-12);
      EXPECT_TRUE(mapped.links[m - 1].covariance->allFinite());
      EXPECT_GT(mapped.links[m - 1].covariance->trace(), 0.0);
      first_from_map = first_from_map * link;
    }
    for (std::uint32_t k = 0; k < map.frame_count(); ++k) {
      const auto pose = interpolated(mapped.trajectory, map.frames().timestamps_s[k].value());
      ASSERT_TRUE(pose);
      const Rigid3 chained = first_from_map * map.world_from_camera(FrameIndex{k});
      EXPECT_LT(pose->difference_to(chained).norm(), 1e-6) << m << ' ' << k;
    }
  }
}

TEST(MapFrames, CutsIntoMiniMapsAfterSoManyFrames) {
  MapSequenceOptions options;
  options.mini_maps = every_frames(10);
  const MappedSequence mapped = map_frames(40, frame_at, kCamera, options);
  EXPECT_EQ(mapped.tracked, 40U);
  EXPECT_EQ(mapped.trajectory.size(), 40U);
  // The frame on which one ends is the first of the next: 10, 9, 9, 9 and 3 new ones.
  ASSERT_EQ(mapped.maps.size(), 5U);
  expect_chain(mapped);
  expect_true(mapped.trajectory, 0.02);
}

TEST(MapFrames, CutsIntoMiniMapsWhereThereIsDepth) {
  MapSequenceOptions options;
  options.mini_maps = every_frames(10);
  const MappedSequence mapped = map_frames(
      30,
      [](std::size_t i) {
        FrameImages frame = frame_at(i);
        if (i >= 9 && i < 12) frame.depth_m = {};
        return frame;
      },
      kCamera, options);
  EXPECT_EQ(mapped.frames_without_depth, 3U);
  EXPECT_EQ(mapped.tracked, 30U);
  expect_true(mapped.trajectory);
  ASSERT_GE(mapped.maps.size(), 2U);
  EXPECT_NEAR(mapped.maps[1].frames().timestamps_s.front().value(), 10.0 + 0.1 * 12, 1e-9);
}

TEST(MapFrames, CutsIntoMiniMapsAfterSoMuchPath) {
  MapSequenceOptions options;
  options.mini_maps = every_metres(0.4);
  const MappedSequence mapped = map_frames(40, frame_at, kCamera, options);
  expect_chain(mapped);
  EXPECT_EQ(mapped.maps.size(), 3U) << "of " << 39 * kMetresAFrame << " m";
  for (std::size_t m = 0; m + 1 < mapped.maps.size(); ++m) {
    EXPECT_NEAR(mapped.links[m].target_from_source->translation().norm(), 0.42, 0.03);
  }
}

// A cut after the very last frame would begin a mini-map of nothing new.
TEST(MapFrames, ACutAtTheEndLeavesNoEmptyMiniMap) {
  MapSequenceOptions options;
  options.mini_maps = every_frames(10);
  const MappedSequence mapped = map_frames(19, frame_at, kCamera, options);
  ASSERT_EQ(mapped.maps.size(), 2U);
  expect_chain(mapped);
}

TEST(FrameImages, AreGreyWithTheirDepth) {
  const std::vector<std::uint8_t> bgr = {0, 0, 0, 255, 255, 255, 255, 0, 0, 0, 0, 255};
  const std::vector<float> depth = {1.0F, 2.0F, 0.0F, 3.0F};
  const FrameImages images = frame_images(1.5, 2, 2, bgr, depth);
  EXPECT_EQ(images.timestamp_s, 1.5);
  EXPECT_EQ(images.name, "1.500000");
  EXPECT_EQ(images.gray.at(0, 0), 0);
  EXPECT_EQ(images.gray.at(1, 0), 255);
  EXPECT_LT(images.gray.at(0, 1), images.gray.at(1, 1));  // blue, red
  EXPECT_EQ(images.depth_m.at(1, 1), 3.0F);
  EXPECT_TRUE(frame_images(1.5, 2, 2, bgr, {}).depth_m.empty());
  EXPECT_THROW(frame_images(1.5, 2, 3, bgr, depth), Error);
}

TEST(MapFrames, NoFramesNoMap) {
  const MappedSequence mapped = map_frames(0, frame_at, kCamera, kDefaults);
  EXPECT_EQ(mapped.frames, 0U);
  EXPECT_TRUE(mapped.maps.empty());
  EXPECT_TRUE(mapped.trajectory.empty());
}

TEST(MapFrames, StopsWhenAsked) {
  std::stop_source source;
  const Execution execution{.stop = source.get_token(), .progress = [&](double share) {
                              if (share == 5.0 / 40.0) source.request_stop();
                            }};
  try {
    map_frames(40, frame_at, kCamera, kDefaults, execution);
    FAIL() << "it went on";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kCancelled);
  }
}

TEST(MapFrames, AnErrorOfTheSourceComesThrough) {
  const auto read = [](std::size_t i) {
    if (i == 7) throw Error(ErrorKind::kInput, "7.png", "is cut off", "a whole image");
    return frame_at(i);
  };
  EXPECT_THROW(map_frames(20, read, kCamera, kDefaults), Error);
}

TEST(MapSequenceOptions, ValuesOutOfRangeAreNamed) {
  const auto message = [](const auto& change) -> std::string {
    MapSequenceOptions options;
    change(options);
    try {
      map_frames(1, frame_at, kCamera, options);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::kMisuse);
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_THAT(message([](auto& o) { o.mini_maps = every_metres(0.0); }),
              HasSubstr("mini_maps.metres"));
  EXPECT_THAT(message([](auto& o) { o.mini_maps = every_metres(std::nan("")); }),
              HasSubstr("mini_maps.metres"));
  EXPECT_THAT(message([](auto& o) { o.mini_maps = every_frames(1); }),
              HasSubstr("mini_maps.frames"));
  EXPECT_THAT(message([](auto& o) { o.map.min_observations = 0; }),
              HasSubstr("MapOptions.min_observations"));
  EXPECT_THAT(message([](auto& o) { o.odometry.min_tracked = 5; }),
              HasSubstr("OdometryOptions.min_tracked"));
  EXPECT_THAT(message([](auto& o) { o.odometry.readout_s = -0.01; }),
              HasSubstr("OdometryOptions.readout_s"));
  EXPECT_THAT(message([](auto& o) { o.odometry.adjusted_keyframes = 0; }),
              HasSubstr("OdometryOptions.adjusted_keyframes"));
  EXPECT_THAT(message([](auto& o) { o.odometry.final_iterations = -1; }),
              HasSubstr("OdometryOptions.final_iterations"));
  EXPECT_THAT(message([](auto& o) { o.odometry.noise.pixel = 0.0; }),
              HasSubstr("SensorNoise.pixel"));
  EXPECT_THAT(message([](auto& o) { o.odometry.noise.depth_quadratic = -1.0; }),
              HasSubstr("SensorNoise.depth_quadratic"));
  EXPECT_THAT(message([](auto& o) { o.odometry.features.count = 1; }),
              HasSubstr("FeatureOptions.count"));
}

TEST(Tracker, BeginsANewMapOnlyAfterATrackedFrame) {
  detail::Tracker tracker(kCamera, {});
  EXPECT_FALSE(tracker.last_pose());
  EXPECT_THROW(tracker.begin_new_map({}), Error);
  const auto track = [&](const FrameImages& frame) {
    return tracker.track(frame.timestamp_s,
                         tracker.extractor().extract(detail::matrix_of(frame.gray),
                                                     detail::matrix_of(frame.depth_m)),
                         "");
  };
  EXPECT_EQ(track(frame_at(0)).status, FrameStatus::kTracked);
  EXPECT_EQ(track(frame_at(1)).status, FrameStatus::kTracked);
  FrameImages black = frame_at(2);
  black.gray = GrayImage(320, 240);
  EXPECT_EQ(track(black).status, FrameStatus::kLost);
  EXPECT_FALSE(tracker.last_pose());
  EXPECT_THROW(tracker.begin_new_map({}), Error);
  EXPECT_EQ(track(frame_at(3)).status, FrameStatus::kTracked);
  const detail::FinishedMap finished = tracker.begin_new_map({});
  EXPECT_EQ(finished.map.frame_count(), 2U) << "the first and the last";
  EXPECT_EQ(finished.trajectory.size(), 3U);
  EXPECT_NEAR(finished.to_next.target_from_source->translation().x(), 3 * kMetresAFrame, 0.01);
  EXPECT_LT(tracker.last_pose()->difference_to(Rigid3()).norm(), 1e-12);
  EXPECT_EQ(tracker.map({}).frame_count(), 1U);
}

TEST(StatedCovariance, IsMillimetresAndMilliradiansWhereTheMarginalIsNone) {
  const Matrix6d stated = stated_covariance(Matrix6d::Zero());
  EXPECT_TRUE(Eigen::MatrixXd(stated).isDiagonal(0.0));
  for (int i = 0; i < 6; ++i) {
    const double deviation = std::sqrt(stated(i, i));  // m, rad
    EXPECT_GT(deviation, 0.003) << i;
    EXPECT_LT(deviation, 0.005) << i;
    EXPECT_EQ(stated(i, i), stated(i < 3 ? 0 : 3, i < 3 ? 0 : 3))
        << "the axes of one kind are alike";
  }
}

TEST(StatedCovariance, AddsTenMarginalDeviations) {
  Eigen::Matrix<double, 6, 6> root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = 1e-3 * std::sin(i * i + 1.0);
  const Matrix6d marginal = root * root.transpose();
  const Matrix6d more = stated_covariance(marginal) - stated_covariance(Matrix6d::Zero());
  EXPECT_TRUE(more.isApprox(100.0 * marginal, 1e-9)) << more;
}

}  // namespace
}  // namespace cairn

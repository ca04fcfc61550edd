// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/detail/features.hpp"

#include <algorithm>
#include <array>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/core/detail/hamming.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/random.hpp"

#include "support/refusal.hpp"

namespace cairn::detail {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

const Camera kPlain{{1}, "PINHOLE", 320, 240, {260.0, 260.0, 159.5, 119.5}};

// Bright and dark spots, so that there are corners everywhere.
cv::Mat textured(cv::Size size, std::uint64_t seed, double contrast = 255.0) {
  Random random(seed);
  cv::Mat image(size.height / 6 + 1, size.width / 6 + 1, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(127.5 + contrast * (random.uniform() - 0.5));
    }
  }
  cv::Mat large;
  cv::resize(image, large, size, 0.0, 0.0, cv::INTER_NEAREST);
  cv::GaussianBlur(large, large, {3, 3}, 0.7);
  return large;
}

TEST(HammingDistance, CountsTheBitsThatDiffer) {
  const Descriptor none{};
  const Descriptor all{~0ULL, ~0ULL, ~0ULL, ~0ULL};
  const Descriptor three{1, 0, 1ULL << 63U, 4};
  EXPECT_EQ(detail::hamming_distance(none, none), 0);
  EXPECT_EQ(detail::hamming_distance(none, all), 256);
  EXPECT_EQ(detail::hamming_distance(three, none), 3);
  EXPECT_EQ(detail::hamming_distance(all, three), 253);
}

std::vector<std::uint32_t> found_near(const Features& features, const Eigen::Vector2d& pixel,
                                      double radius) {
  std::vector<std::uint32_t> found;
  features.visit_near(pixel, radius, [&](std::uint32_t index) { found.push_back(index); });
  std::sort(found.begin(), found.end());
  return found;
}

std::vector<std::uint32_t> truly_near(const Features& features, const Eigen::Vector2d& pixel,
                                      double radius) {
  std::vector<std::uint32_t> near;
  for (std::uint32_t i = 0; i < features.size(); ++i) {
    const Eigen::Vector2f offset = features.keypoints()[i].pixel - pixel.cast<float>();
    if (offset.cwiseAbs().maxCoeff() <= static_cast<float>(radius)) near.push_back(i);
  }
  return near;
}

// Undistorted pixels may lie beside the image.
TEST(Features, VisitNearFindsWhatBruteForceFinds) {
  Random random(1);
  const auto keypoints = [&](std::size_t count) {
    std::vector<Keypoint> made(count);
    for (Keypoint& keypoint : made) {
      keypoint.pixel =
          Eigen::Vector2d(random.uniform(-40, 360), random.uniform(-40, 280)).cast<float>();
    }
    return made;
  };
  Features features(keypoints(500), std::vector<Descriptor>(500),
                    {cv::Mat::zeros(240, 320, CV_8UC1)}, {});
  features.add(keypoints(100), std::vector<Descriptor>(100));
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2d at(random.uniform(-60, 380), random.uniform(-60, 300));
    const double radius = random.uniform(0.0, 50.0);
    EXPECT_THAT(found_near(features, at, radius),
                ElementsAreArray(truly_near(features, at, radius)));
  }
}

// All strong texture is on the left; the right is ten times fainter and must not be left empty.
TEST(FeatureExtractor, SpreadsCornersOverTheImage) {
  cv::Mat image = textured({320, 240}, 2);
  const cv::Rect right(160, 0, 160, 240);
  textured({160, 240}, 3, 40.0).copyTo(image(right));
  const FeatureExtractor extractor(kPlain, {.count = 500});
  const Features features = extractor.extract(image, {});
  EXPECT_LE(features.size(), 500U + extractor.scales().size());
  EXPECT_GT(features.size(), 300U);
  std::array<int, 12> counts{};
  for (const Keypoint& keypoint : features.keypoints()) {
    const int column = static_cast<int>(keypoint.raw.u / 80.0);
    const int row = static_cast<int>(keypoint.raw.v / 80.0);
    ASSERT_TRUE(column >= 0 && column < 4 && row >= 0 && row < 3);
    ++counts[static_cast<std::size_t>(4 * row + column)];
  }
  for (const int count : counts) EXPECT_GE(count, 5);
}

TEST(FeatureExtractor, FindsNothingWhereNothingIs) {
  const FeatureExtractor extractor(kPlain, {});
  EXPECT_EQ(extractor.extract(cv::Mat(240, 320, CV_8UC1, cv::Scalar(255)), {}).size(), 0U);
  const Camera tiny{{1}, "PINHOLE", 20, 20, {20.0, 20.0, 9.5, 9.5}};
  EXPECT_EQ(FeatureExtractor(tiny, {}).extract(textured({20, 20}, 4), {}).size(), 0U);
}

TEST(FeatureExtractor, DescribesAddedKeypointsByWhatTheImageShowsThere) {
  const FeatureExtractor extractor(kPlain, {});
  Features features = extractor.extract(textured({320, 240}, 5), {});
  const std::size_t corners = features.corners();
  ASSERT_EQ(corners, features.size());
  // The corners themselves once more, and one at the edge.
  std::vector<Keypoint> again(features.keypoints().begin(), features.keypoints().end());
  Keypoint at_edge = again.front();
  at_edge.raw = {3.0, 100.0};
  again.push_back(at_edge);
  features.add(again, std::vector<Descriptor>(again.size()));
  EXPECT_EQ(features.corners(), corners);
  const auto shown = extractor.describe_added(features);
  ASSERT_EQ(shown.size(), corners + 1);
  EXPECT_FALSE(shown.back());
  // Refinement moves some to a neighbouring pixel.
  std::size_t same = 0;
  for (std::size_t i = 0; i < corners; ++i) {
    same += shown[i] && *shown[i] == features.descriptors()[i] ? 1 : 0;
  }
  EXPECT_GT(same, corners * 7 / 10);
}

TEST(FeatureExtractor, FindsTheSameCornersInAShiftedImage) {
  const cv::Mat large = textured({360, 280}, 5);
  const FeatureExtractor extractor(kPlain, {.levels = 1});
  const Features a = extractor.extract(large(cv::Rect(0, 0, 320, 240)).clone(), {});
  const Features b = extractor.extract(large(cv::Rect(10, 6, 320, 240)).clone(), {});
  std::size_t inside = 0;
  std::size_t again = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Eigen::Vector2f expected = a.keypoints()[i].pixel - Eigen::Vector2f(10.0F, 6.0F);
    if (expected.x() < 25 || expected.y() < 25) continue;
    ++inside;
    b.visit_near(expected.cast<double>(), 0.01, [&](std::uint32_t j) {
      again += detail::hamming_distance(a.descriptors()[i], b.descriptors()[j]) == 0 ? 1 : 0;
    });
  }
  EXPECT_GT(inside, 200U);
  EXPECT_GT(static_cast<double>(again), 0.75 * static_cast<double>(inside));
}

// OpenCV's functions for the models that are named after them.
TEST(Project, AgreesWithOpenCv) {
  Random random(11);
  std::vector<cv::Point3d> points;
  for (int i = 0; i < 200; ++i) {
    points.emplace_back(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), 1.0);
  }
  const cv::Vec3d none(0.0, 0.0, 0.0);
  const cv::Matx33d matrix(500.0, 0.0, 320.0, 0.0, 480.0, 240.0, 0.0, 0.0, 1.0);
  std::vector<double> d = {0.03, -0.01, 0.002, -0.003, 0.004, 0.02, -0.005, 0.006};
  std::vector<double> parameters = {500.0, 480.0, 320.0, 240.0};
  parameters.insert(parameters.end(), d.begin(), d.end());
  const auto expect_same = [&](const Camera& camera, const std::vector<cv::Point2d>& expected) {
    ASSERT_EQ(expected.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto pixel = project(camera, {points[i].x, points[i].y, points[i].z});
      ASSERT_TRUE(pixel.has_value());
      EXPECT_NEAR(pixel->u, expected[i].x, 1e-9) << camera.model;
      EXPECT_NEAR(pixel->v, expected[i].y, 1e-9) << camera.model;
    }
  };
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(points, none, none, matrix, d, pixels);
  expect_same({{1}, "FULL_OPENCV", 640, 480, parameters}, pixels);
  d.resize(4);
  parameters.resize(8);
  cv::projectPoints(points, none, none, matrix, d, pixels);
  expect_same({{1}, "OPENCV", 640, 480, parameters}, pixels);
  cv::fisheye::projectPoints(points, pixels, none, none, matrix, d);
  expect_same({{1}, "OPENCV_FISHEYE", 640, 480, parameters}, pixels);
}

TEST(FeatureExtractor, RefusesAPanorama) {
  const Camera panorama{{1}, "EQUIRECTANGULAR", 640, 320, {640, 320}};
  EXPECT_THAT(testing::message_of(ErrorKind::kMisuse, [&] { FeatureExtractor(panorama, {}); }),
              HasSubstr("is a panorama (EQUIRECTANGULAR)"));
}

class UndistortionTest : public ::testing::TestWithParam<Camera> {};
INSTANTIATE_TEST_SUITE_P(
    Models, UndistortionTest,
    ::testing::Values(kPlain, Camera{{1}, "SIMPLE_RADIAL", 640, 480, {520.0, 320.0, 240.0, -0.1}},
                      Camera{{1},
                             "FULL_OPENCV",
                             640,
                             480,
                             {517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633,
                              0.0, 0.0, 0.0}},
                      Camera{{1},
                             "OPENCV_FISHEYE",
                             640,
                             480,
                             {400.0, 400.0, 319.5, 239.5, 0.05, -0.01, 0.002, 0.0}}),
    [](const auto& camera) { return camera.param.model; });

// Where the distorted camera sees a point, the undistorted pixel is where the pinhole sees it.
TEST_P(UndistortionTest, AgreesWithTheCamera) {
  const Camera& camera = GetParam();
  const FeatureExtractor extractor(camera, {});
  Random random(6);
  int compared = 0;
  while (compared < 500) {
    const Eigen::Vector3d x(random.uniform(-0.8, 0.8), random.uniform(-0.6, 0.6), 1.0);
    const auto raw = project(camera, x);
    if (!raw || raw->u < 0.0 || raw->v < 0.0 || raw->u > camera.width - 1.0 ||
        raw->v > camera.height - 1.0) {
      continue;
    }
    ++compared;
    const Eigen::Vector2d expected = extractor.pinhole().project(x);
    EXPECT_LT((extractor.undistorted(*raw).cast<double>() - expected).norm(), 0.03)
        << expected.transpose();
  }
}

TEST(FeatureExtractor, DepthIsThatOfTheSurface) {
  const FeatureExtractor extractor(kPlain, {});
  cv::Mat depth(240, 320, CV_32FC1, cv::Scalar(2.0F));
  EXPECT_FLOAT_EQ(extractor.depth_at(depth, {100.2, 50.4}), 2.0F);
  EXPECT_FLOAT_EQ(extractor.depth_at(depth, {0.0, 0.0}), 0.0F) << "four readings are too few";
  depth.at<float>(51, 100) = 0.0F;  // a hole beside good readings
  EXPECT_FLOAT_EQ(extractor.depth_at(depth, {100.0, 50.0}), 2.0F);
  EXPECT_EQ(extractor.depth_at({}, {100.0, 50.0}), 0.0F);
}

TEST(FeatureExtractor, DepthIsUnknownWhereTwoSurfacesMeet) {
  const FeatureExtractor extractor(kPlain, {});
  cv::Mat depth(240, 320, CV_32FC1, cv::Scalar(1.0F));
  depth.colRange(100, 320) = 2.0F;
  EXPECT_FLOAT_EQ(extractor.depth_at(depth, {90.0, 50.0}), 1.0F);
  EXPECT_FLOAT_EQ(extractor.depth_at(depth, {110.0, 50.0}), 2.0F);
  for (const double u : {99.0, 99.6, 100.0}) {
    EXPECT_EQ(extractor.depth_at(depth, {u, 50.0}), 0.0F) << u;
  }
}

TEST(FeatureExtractor, DepthIsUnknownWithoutReadings) {
  const FeatureExtractor extractor(kPlain, {.max_depth_m = 3.0});
  cv::Mat depth = cv::Mat::zeros(240, 320, CV_32FC1);
  EXPECT_EQ(extractor.depth_at(depth, {50.0, 50.0}), 0.0F);
  depth = 5.0F;
  EXPECT_EQ(extractor.depth_at(depth, {50.0, 50.0}), 0.0F);
  depth = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(extractor.depth_at(depth, {50.0, 50.0}), 0.0F);
}

template <class Call>
std::string refusal(const Call& call) {
  return testing::refusal(ErrorKind::kMisuse, call);
}

TEST(FeatureExtractor, ImagesOfAnotherSizeOrKindAreRefused) {
  const FeatureExtractor extractor(kPlain, {});
  const cv::Mat gray(240, 320, CV_8UC1, cv::Scalar(0));
  EXPECT_THAT(refusal([&] { extractor.extract(cv::Mat::zeros(480, 640, CV_8UC1), {}); }),
              HasSubstr("640 x 480"));
  EXPECT_THAT(refusal([&] { extractor.extract({}, {}); }), HasSubstr("0 x 0"));
  EXPECT_THAT(refusal([&] { extractor.extract(cv::Mat::zeros(240, 320, CV_8UC3), {}); }),
              HasSubstr("8 bit"));
  EXPECT_THAT(refusal([&] { extractor.extract(gray, cv::Mat::zeros(120, 160, CV_32FC1)); }),
              HasSubstr("depth image"));
  EXPECT_THAT(refusal([&] { extractor.extract(gray, cv::Mat::zeros(240, 320, CV_16UC1)); }),
              HasSubstr("32-bit float"));
}

TEST(FeatureOptions, ValuesOutOfRangeAreNamed) {
  const auto message = [](const auto& change) {
    FeatureOptions options;
    change(options);
    return refusal([&] { options.validate(); });
  };
  EXPECT_THAT(message([](auto& o) { o.count = 49; }), HasSubstr("FeatureOptions.count: 49"));
  EXPECT_THAT(message([](auto& o) { o.count = 20001; }), HasSubstr("count"));
  EXPECT_THAT(message([](auto& o) { o.levels = 0; }), HasSubstr("FeatureOptions.levels"));
  EXPECT_THAT(message([](auto& o) { o.scale = 1.0; }), HasSubstr("FeatureOptions.scale"));
  EXPECT_THAT(message([](auto& o) { o.scale = std::nan(""); }), HasSubstr("scale"));
  EXPECT_THAT(message([](auto& o) { o.threshold = 255; }), HasSubstr("FeatureOptions.threshold"));
  EXPECT_THAT(message([](auto& o) { o.least_threshold = 21; }), HasSubstr("least_threshold"));
  EXPECT_THAT(message([](auto& o) { o.max_depth_m = 0.0; }), HasSubstr("max_depth_m"));
  EXPECT_THAT(message([](auto& o) { o.max_depth_m = std::nan(""); }), HasSubstr("max_depth_m"));
  EXPECT_NO_THROW(FeatureOptions().validate());
}

TEST(FeatureExtractor, ACameraWithADefectIsRefused) {
  Camera camera = kPlain;
  camera.parameters[0] = 0.0;
  EXPECT_THAT(refusal([&] { FeatureExtractor(camera, {}); }), HasSubstr("camera"));
}

}  // namespace
}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/vision/image_locator.hpp"

#include <cmath>
#include <cstring>
#include <functional>
#include <tuple>
#include <vector>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "cairn/core/error.hpp"
#include "cairn/map/operations.hpp"
#include "cairn/vision/detail/described_image.hpp"
#include "cairn/vision/detail/features.hpp"

#include "support/textured_wall.hpp"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TexturedWall;

GrayImage image_of(const cv::Mat& gray) {
  GrayImage image(static_cast<std::uint32_t>(gray.cols), static_cast<std::uint32_t>(gray.rows));
  std::memcpy(image.values.data(), gray.data, image.values.size());
  return image;
}

DepthImage flat_depth() {
  return DepthImage(640, 480, static_cast<float>(TexturedWall::kDepthM));
}

// Where the camera is after so many pixels of way.
Rigid3 pose_at(int right, int down, double unit = 1.0) {
  return {Eigen::Quaterniond::Identity(),
          unit * TexturedWall::kMetresPerPixel * Eigen::Vector3d(right, down, 0.0)};
}

// The corners of the wall's middle as landmarks, once or again so many units to the right.
MapTables wall_tables(double unit = 1.0, const std::vector<double>& copies = {0.0}) {
  const detail::FeatureExtractor extractor(TexturedWall::camera(), {});
  const detail::Features features =
      extractor.extract(TexturedWall().gray(60, 40), TexturedWall::depth_m());
  MapTables tables;
  tables.cameras = {TexturedWall::camera()};
  DescriptorColumn descriptors{.kind = "ORB", .bytes_each = 32, .known = {}, .bytes = {}};
  for (const double copy : copies) {
    for (std::size_t i = 0; i < features.size(); ++i) {
      const Eigen::Vector3d here = extractor.pinhole().back_project(
          features.keypoints()[i].pixel.cast<double>(), TexturedWall::kDepthM);
      tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size()});
      tables.landmarks.positions.emplace_back(unit * (pose_at(60, 40) * here) +
                                              Eigen::Vector3d(copy, 0.0, 0.0));
      descriptors.known.push_back(1);
      const auto* const bytes =
          reinterpret_cast<const std::uint8_t*>(features.descriptors()[i].data());
      descriptors.bytes.insert(descriptors.bytes.end(), bytes, bytes + 32);
    }
  }
  tables.landmarks.descriptors = std::move(descriptors);
  return tables;
}

LandmarkMap wall_map() {
  return LandmarkMap(wall_tables());
}

GrayImage image_at(int right, int down) {
  return image_of(TexturedWall().gray(right, down));
}

TEST(ImageLocator, FindsWhereAnImageWasTaken) {
  const LandmarkMap map = wall_map();
  const ImageLocator locator(map, TexturedWall::camera());
  for (const auto& [right, down] : {std::pair{60, 40}, {0, 0}, {120, 30}, {90, 70}}) {
    const ImageLocation found = locator.locate(image_at(right, down));
    ASSERT_TRUE(found.located) << found.reason;
    EXPECT_FALSE(found.failure);
    EXPECT_GE(found.probability, 0.99);
    ASSERT_TRUE(found.world_from_camera);
    const Vector6d off = found.world_from_camera->difference_to(pose_at(right, down));
    EXPECT_LT(off.head<3>().norm(), 0.004) << right;
    EXPECT_LT(off.tail<3>().norm(), 0.002) << right;
    ASSERT_TRUE(found.covariance);
    EXPECT_LT(off.dot(found.covariance->inverse() * off), 40.0) << right;
    EXPECT_GT(found.matches.size(), 100U);
    for (const ImageMatch& match : found.matches) {
      EXPECT_LT(match.landmark.value, map.landmark_count());
      EXPECT_LT(match.pixel.u, 640.0);
    }
  }
}

TEST(ImageLocator, FindsLandmarksByAnyOfTheirDescriptors) {
  // What represents each landmark looks like something else.
  MapTables tables = wall_tables();
  DescriptorColumn& column = *tables.landmarks.descriptors;
  column.further = column.bytes;
  for (std::uint64_t i = 0; i <= column.known.size(); ++i) column.further_offsets.push_back(i);
  cv::RNG random(3);
  for (std::uint8_t& byte : column.bytes) byte = static_cast<std::uint8_t>(random.uniform(0, 256));
  const LandmarkMap map(std::move(tables));
  const ImageLocation found = ImageLocator(map, TexturedWall::camera()).locate(image_at(90, 70));
  ASSERT_TRUE(found.located) << found.reason;
  const Vector6d off = found.world_from_camera->difference_to(pose_at(90, 70));
  EXPECT_LT(off.head<3>().norm(), 0.004);
  MapTables one_each = LandmarkMap(map).tables();
  one_each.landmarks.descriptors->further.clear();
  one_each.landmarks.descriptors->further_offsets.clear();
  EXPECT_FALSE(ImageLocator(LandmarkMap(std::move(one_each)), TexturedWall::camera())
                   .locate(image_at(90, 70))
                   .located);
}

TEST(ImageLocator, IsTheSameIfFurtherDescriptorsRepeatTheFirst) {
  MapTables tables = wall_tables();
  DescriptorColumn& column = *tables.landmarks.descriptors;
  column.further = column.bytes;
  for (std::uint64_t i = 0; i <= column.known.size(); ++i) column.further_offsets.push_back(i);
  const ImageLocation one =
      ImageLocator(wall_map(), TexturedWall::camera()).locate(image_at(120, 30));
  const ImageLocation twice = ImageLocator(LandmarkMap(std::move(tables)), TexturedWall::camera())
                                  .locate(image_at(120, 30));
  EXPECT_EQ(one.reason, twice.reason);
  EXPECT_EQ(one.world_from_camera->matrix(), twice.world_from_camera->matrix());
}

TEST(ImageLocator, RefusesAnImageOfAnotherPlace) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  cv::RNG random(8);
  cv::Mat coarse(60, 80, CV_8UC1);
  random.fill(coarse, cv::RNG::UNIFORM, 0, 256);
  cv::Mat other;
  cv::resize(coarse, other, {}, 8.0, 8.0, cv::INTER_CUBIC);
  const ImageLocation found = locator.locate(image_of(other));
  EXPECT_FALSE(found.located) << found.reason;
  EXPECT_FALSE(found.world_from_camera);
  EXPECT_LT(found.probability, 0.5);
}

TEST(ImageLocator, SaysThatNothingIsSeen) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const ImageLocation found = locator.locate(GrayImage(640, 480, 90));
  EXPECT_FALSE(found.located);
  EXPECT_FALSE(found.estimate);
  EXPECT_EQ(found.probability, 0.0);
  EXPECT_EQ(found.failure, LocationFailure::kFewMatches);
  EXPECT_THAT(found.reason, HasSubstr("0 of 0 corners"));
}

// A thing may stand elsewhere today: what one part of the image shows does not locate all of it.
TEST(ImageLocator, RefusesWhatOneSmallPartShows) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const cv::Mat whole = TexturedWall().gray(60, 40);
  const auto with_part = [&](const cv::Rect& part) {
    cv::Mat image(480, 640, CV_8UC1, cv::Scalar(90));
    whole(part).copyTo(image(part));
    return locator.locate(image_of(image));
  };
  const ImageLocation small = with_part({250, 170, 130, 130});
  EXPECT_GT(small.matches.size(), 20U) << small.reason;
  EXPECT_FALSE(small.located) << small.reason;
  EXPECT_TRUE(small.failure == LocationFailure::kFewInliers ||
              small.failure == LocationFailure::kImprobable);
  EXPECT_THAT(small.reason, ::testing::ContainsRegex("these count as [0-9]+ independent matches, "
                                                     "and [0-9]+ would decide"));
  EXPECT_TRUE(with_part({100, 60, 420, 360}).located);
}

// Of two places that look the same none is the right one.
TEST(ImageLocator, RefusesToChooseBetweenPlacesThatLookTheSame) {
  const LandmarkMap twice(wall_tables(1.0, {0.0, 10.0}));
  const ImageLocation found = ImageLocator(twice, TexturedWall::camera()).locate(image_at(60, 40));
  EXPECT_FALSE(found.located) << found.reason;
  EXPECT_EQ(found.failure, LocationFailure::kAmbiguous);
  ASSERT_TRUE(found.estimate);
  ASSERT_TRUE(found.rival);
  EXPECT_NEAR((found.rival->translation() - found.estimate->translation()).norm(), 10.0, 0.01);
  EXPECT_THAT(found.reason, HasSubstr("at another pose"));
}

TEST(ImageLocator, UsesDepth) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const ImageLocation flat = locator.locate(image_at(90, 50));
  const ImageLocation deep = locator.locate(image_at(90, 50), flat_depth());
  ASSERT_TRUE(deep.located);
  EXPECT_LT((*deep.covariance)(2, 2), 0.9 * (*flat.covariance)(2, 2));
  EXPECT_LT(deep.world_from_camera->difference_to(pose_at(90, 50)).head<3>().norm(), 0.004);
}

TEST(ImageLocator, KeepsTheUnitOfAMapWithoutScale) {
  for (const double unit : {0.01, 250.0}) {
    MapTables tables = wall_tables(unit);
    tables.info.length_unit = LengthUnit::kFree;
    const ImageLocator locator(LandmarkMap(std::move(tables)), TexturedWall::camera());
    // The depth would contradict it.
    const ImageLocation found = locator.locate(image_at(90, 50), flat_depth());
    ASSERT_TRUE(found.located) << found.reason;
    const Vector6d off = found.world_from_camera->difference_to(pose_at(90, 50, unit));
    EXPECT_LT(off.head<3>().norm(), 0.004 * unit);
    EXPECT_LT(std::sqrt((*found.covariance)(2, 2)), 0.01 * unit);
    EXPECT_GT(std::sqrt((*found.covariance)(2, 2)), 0.00001 * unit);
  }
}

TEST(ImageLocator, IsMoreUncertainWhereLandmarksAre) {
  MapTables tables = wall_tables();
  tables.landmarks.covariances.assign(tables.landmarks.positions.size(),
                                      1e-4 * Eigen::Matrix3d::Identity());
  const LandmarkMap vague(std::move(tables));
  const GrayImage image = image_at(90, 50);
  const ImageLocation sure = ImageLocator(wall_map(), TexturedWall::camera()).locate(image);
  const ImageLocation unsure = ImageLocator(vague, TexturedWall::camera()).locate(image);
  EXPECT_GT((*unsure.covariance)(0, 0), 2.0 * (*sure.covariance)(0, 0));
}

// Landmarks that are known to within half a metre.
LandmarkMap uncertain_wall_map() {
  MapTables tables = wall_tables();
  tables.landmarks.covariances.assign(tables.landmarks.ids.size(),
                                      0.25 * Eigen::Matrix3d::Identity());
  return LandmarkMap(std::move(tables));
}

TEST(ImageLocator, DoesNotLocateByMatchesThatLeaveThePoseOpen) {
  const ImageLocation found =
      ImageLocator(uncertain_wall_map(), TexturedWall::camera()).locate(image_at(60, 40));
  EXPECT_FALSE(found.located);
  EXPECT_EQ(found.failure, LocationFailure::kUndetermined) << found.reason;
  ASSERT_TRUE(found.covariance);
  EXPECT_GT(std::sqrt((*found.covariance)(0, 0)), 0.02);
  EXPECT_THAT(found.reason, HasSubstr("the position has a standard deviation of"));
  EXPECT_TRUE(ImageLocator(wall_map(), TexturedWall::camera()).locate(image_at(60, 40)).located);
}

TEST(ImageLocator, GivesTheSameResultAgain) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const ImageLocation once = locator.locate(image_at(90, 50));
  const ImageLocation again = locator.locate(image_at(90, 50));
  EXPECT_EQ(once.world_from_camera->matrix(), again.world_from_camera->matrix());
  EXPECT_EQ(once.probability, again.probability);
  EXPECT_EQ(once.matches.size(), again.matches.size());
}

// A wall with edges, as photographs have: the bytes of SIFT depend on them.
cv::Mat whole_wall() {
  cv::RNG random(4);
  cv::Mat wall(640, 960, CV_8UC1, cv::Scalar(120));
  for (int i = 0; i < 900; ++i) {
    const cv::Rect poster(random.uniform(-30, 960), random.uniform(-30, 640), random.uniform(6, 60),
                          random.uniform(6, 60));
    cv::rectangle(wall, poster, cv::Scalar(random.uniform(0, 256)), cv::FILLED);
  }
  return wall;
}

cv::Mat posters(int right, int down) {
  return whole_wall()(cv::Rect(100 + right, 60 + down, 640, 480)).clone();
}

// SIFT features of that wall's middle as landmarks, at any depths along their lines of sight.
LandmarkMap sift_map(bool root, const std::function<double(std::size_t)>& depth_of) {
  const detail::SiftFeatures features = detail::sift_features(posters(60, 40), 2000, root);
  const Camera camera = TexturedWall::camera();
  MapTables tables;
  tables.cameras = {camera};
  DescriptorColumn descriptors{.kind = "SIFT", .bytes_each = 128, .known = {}, .bytes = {}};
  descriptors.bytes = features.descriptors;
  for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
    const cv::Point2f at = features.keypoints[i].pt;
    const Eigen::Vector3d ray = *unproject(camera, {at.x, at.y});
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(pose_at(60, 40) * (depth_of(i) / ray.z() * ray));
    descriptors.known.push_back(1);
  }
  tables.landmarks.descriptors = std::move(descriptors);
  return LandmarkMap(std::move(tables));
}

TEST(ImageLocator, ComparesSiftOfEitherNormalisation) {
  for (const bool root : {false, true}) {
    const LandmarkMap map = sift_map(root, [](std::size_t) { return TexturedWall::kDepthM; });
    EXPECT_EQ(detail::image_descriptor_of(*map.landmarks().descriptors),
              root ? detail::ImageDescriptor::kRootSift : detail::ImageDescriptor::kSift);
    const ImageLocation found =
        ImageLocator(map, TexturedWall::camera()).locate(image_of(posters(90, 70)));
    ASSERT_TRUE(found.located) << found.reason;
    const Vector6d off = found.world_from_camera->difference_to(pose_at(90, 70));
    EXPECT_LT(off.head<3>().norm(), 0.004);
    EXPECT_LT(off.tail<3>().norm(), 0.002);
  }
}

TEST(ImageLocator, FindsTheFocalLengthWithThePose) {
  const LandmarkMap map =
      sift_map(true, [](std::size_t i) { return 1.5 + 0.37 * static_cast<double>(i * 7 % 11); });
  const ImageLocator locator(map, TexturedWall::camera());
  Camera unknown = TexturedWall::camera();
  for (const double guess : {0.5, 3.0}) {
    unknown.parameters[0] = guess * TexturedWall::kFocal;
    unknown.parameters[1] = guess * TexturedWall::kFocal;
    const ImageLocation found =
        locator.with_camera(unknown, FocalLength::kUnknown).locate(image_of(posters(60, 40)));
    ASSERT_TRUE(found.located) << found.reason;
    EXPECT_NEAR(found.camera.parameters[0], TexturedWall::kFocal, 0.005 * TexturedWall::kFocal);
    ASSERT_TRUE(found.focal_length_sigma);
    EXPECT_LT(std::abs(found.camera.parameters[0] - TexturedWall::kFocal),
              5.0 * *found.focal_length_sigma + 0.1);
    EXPECT_LT(*found.focal_length_sigma, 0.01 * TexturedWall::kFocal);
    const Vector6d off = found.world_from_camera->difference_to(pose_at(60, 40));
    EXPECT_LT(off.head<3>().norm(), 0.02);
  }
  const ImageLocation known = locator.locate(image_of(posters(60, 40)));
  EXPECT_FALSE(known.focal_length_sigma);
  EXPECT_EQ(known.camera, TexturedWall::camera());
}

// Depths fit the pose through any lens, so that only the pixels show that it is the wrong one.
TEST(ImageLocator, RefusesAWrongLensHoweverManyDepthsFit) {
  const auto depth_of = [](std::size_t i) { return 2.0 + 0.1 * static_cast<double>(i * 7 % 11); };
  const LandmarkMap map = sift_map(true, depth_of);
  const cv::Mat image = posters(60, 40);
  DepthImage depth(640, 480, 0.0F);
  const auto keypoints = detail::sift_features(image, 2000, true).keypoints;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const cv::Rect around(cv::Point(keypoints[i].pt) - cv::Point(1, 1), cv::Size(4, 4));
    cv::Mat whole(480, 640, CV_32F, depth.values.data());
    whole(around & cv::Rect(0, 0, 640, 480)).setTo(depth_of(i));
  }
  const ImageLocator right(map, TexturedWall::camera());
  EXPECT_TRUE(right.locate(image_of(image), depth).located);
  for (const double factor : {1.05, 1.15}) {
    Camera wrong = TexturedWall::camera();
    wrong.parameters[0] *= factor;
    wrong.parameters[1] *= factor;
    const ImageLocation found = right.with_camera(wrong).locate(image_of(image), depth);
    EXPECT_FALSE(found.world_from_camera);
    EXPECT_EQ(found.failure, LocationFailure::kLens) << found.reason;
  }
}

// OpenCV's are a quarter of a pixel to the right and below.
TEST(SiftFeatures, AreWhereTheImageHasABlob) {
  const cv::Point2d centre(100.3, 80.7);
  for (const double sigma : {3.0, 4.0, 6.0}) {
    cv::Mat_<std::uint8_t> image(160, 200);
    image.forEach([&](std::uint8_t& value, const int* at) {
      const double x = (at[1] - centre.x) / sigma;
      const double y = (at[0] - centre.y) / sigma;
      value = static_cast<std::uint8_t>(60.0 + 150.0 * std::exp(-0.5 * (x * x + y * y)));
    });
    const auto found = detail::sift_features(image, 1, true).keypoints;
    ASSERT_FALSE(found.empty());
    EXPECT_NEAR(found.front().pt.x, centre.x, 0.07) << sigma;
    EXPECT_NEAR(found.front().pt.y, centre.y, 0.07) << sigma;
  }
}

Camera barrel_camera(double k) {
  return {{1}, "RADIAL", 640, 480, {TexturedWall::kFocal, 319.5, 239.5, k, 0.0}};
}

// That wall as this camera sees it.
cv::Mat posters_through(const Camera& camera) {
  cv::Mat_<cv::Point2f> from(480, 640);
  for (int v = 0; v < from.rows; ++v) {
    for (int u = 0; u < from.cols; ++u) {
      const auto ray = unproject(camera, {static_cast<double>(u), static_cast<double>(v)});
      const auto pixel = ray ? project(TexturedWall::camera(), *ray) : std::nullopt;
      from(v, u) = pixel ? cv::Point2f(static_cast<float>(pixel->u), static_cast<float>(pixel->v))
                         : cv::Point2f(-1.0F, -1.0F);
    }
  }
  cv::Mat distorted;
  cv::remap(posters(60, 40), distorted, from, cv::noArray(), cv::INTER_CUBIC);
  return distorted;
}

// A wide lens sees more of the wall than the rectangle of a pinhole image of its size.
TEST(ImageLocator, MatchesWhatAWideLensSeesOutsideTheRectangleOfItsImage) {
  const cv::Mat wall = whole_wall();
  const cv::Point offset(160, 100);  // of the middle, where posters(60, 40) looks
  const detail::SiftFeatures features = detail::sift_features(wall, 4000, true);
  const Camera flat = TexturedWall::camera();
  MapTables tables;
  DescriptorColumn descriptors{.kind = "SIFT", .bytes_each = 128, .known = {}, .bytes = {}};
  descriptors.bytes = features.descriptors;
  for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
    const cv::Point2f at = features.keypoints[i].pt - cv::Point2f(offset);
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.emplace_back(TexturedWall::kDepthM * *unproject(flat, {at.x, at.y}));
    descriptors.known.push_back(1);
  }
  tables.landmarks.descriptors = std::move(descriptors);
  const Camera wide = barrel_camera(-0.2);
  const auto place_on_wall = [&](double u, double v) {
    const Eigen::Vector3d ray = *unproject(wide, {u, v});
    return cv::Point2f(static_cast<float>(TexturedWall::kFocal * ray.x() / ray.z() + 319.5),
                       static_cast<float>(TexturedWall::kFocal * ray.y() / ray.z() + 239.5));
  };
  cv::Mat_<cv::Point2f> from(480, 640);
  from.forEach([&](cv::Point2f& place, const int* at) {
    place = place_on_wall(at[1], at[0]) + cv::Point2f(offset);
  });
  cv::Mat image;
  cv::remap(wall, image, from, cv::noArray(), cv::INTER_CUBIC);
  const ImageLocation found =
      ImageLocator(LandmarkMap(std::move(tables)), wide).locate(image_of(image));
  ASSERT_TRUE(found.located) << found.reason;
  const auto outside = std::ranges::count_if(found.matches, [&](const ImageMatch& match) {
    const cv::Point2f place = place_on_wall(match.pixel.u, match.pixel.v);
    return place.x < -20.0F || place.y < -20.0F || place.x > 660.0F || place.y > 500.0F;
  });
  EXPECT_GT(outside, 10);
}

TEST(ImageLocator, FindsTheDistortionWithTheFocalLength) {
  const LandmarkMap map =
      sift_map(true, [](std::size_t i) { return 1.5 + 0.37 * static_cast<double>(i * 7 % 11); });
  const Camera flat = TexturedWall::camera();
  const Camera barrel = barrel_camera(-0.12);
  const cv::Mat distorted = posters_through(barrel);
  const ImageLocation found =
      ImageLocator(map, flat).with_camera(flat, FocalLength::kUnknown).locate(image_of(distorted));
  ASSERT_TRUE(found.located) << found.reason;
  EXPECT_NEAR(found.camera.parameters[0], TexturedWall::kFocal, 0.01 * TexturedWall::kFocal);
  EXPECT_NEAR(found.camera.parameters[3], -0.12, 0.02);
  const Vector6d off = found.world_from_camera->difference_to(pose_at(60, 40));
  EXPECT_LT(off.head<3>().norm(), 0.02);
  // Without it, the pose would be wrong though its matches are right.
  const ImageLocation through_flat = ImageLocator(map, flat).locate(image_of(distorted));
  EXPECT_FALSE(through_flat.located);
  EXPECT_FALSE(through_flat.world_from_camera);
  EXPECT_EQ(through_flat.failure, LocationFailure::kLens) << through_flat.reason;
}

// Matches in one half of the image leave the lens open; what the other images tell closes it.
TEST(ImageLocator, FindsOneLensInSeveralImages) {
  const LandmarkMap map =
      sift_map(true, [](std::size_t i) { return 1.5 + 0.37 * static_cast<double>(i * 7 % 11); });
  const Camera flat = TexturedWall::camera();
  const cv::Mat whole = posters_through(barrel_camera(-0.12));
  cv::Mat part = whole.clone();
  part.colRange(0, 640).rowRange(0, 300).setTo(cv::Scalar(90));
  const std::array<GrayImage, 3> images = {image_of(part), image_of(whole), image_of(whole)};
  const ImageLocator locator = ImageLocator(map, flat).with_camera(flat, FocalLength::kUnknown);
  const auto image_of_k = [&](std::size_t k) { return images[k]; };
  const ImageLocation alone = locator.locate(images[0]);
  const auto found = locate_with_shared_lens(locator, images.size(), image_of_k);
  ASSERT_EQ(found.size(), images.size());
  ASSERT_TRUE(alone.focal_length_sigma && found[0].focal_length_sigma);
  EXPECT_LT(*found[0].focal_length_sigma, 0.7 * *alone.focal_length_sigma);
  for (const ImageLocation& image : found) {
    ASSERT_TRUE(image.located) << image.reason;
    EXPECT_NEAR(image.camera.parameters[0], TexturedWall::kFocal, 0.01 * TexturedWall::kFocal);
    EXPECT_LT(image.world_from_camera->difference_to(pose_at(60, 40)).head<3>().norm(), 0.02);
  }
  // An image without others has a lens of its own.
  const auto one = locate_with_shared_lens(locator, 1, image_of_k);
  EXPECT_EQ(one[0].estimate->matrix(), alone.estimate->matrix());
  EXPECT_EQ(one[0].covariance, alone.covariance);
  EXPECT_TRUE(locate_with_shared_lens(locator, 0, image_of_k).empty());
  const ImageLocation blank = locator.locate(image_of(cv::Mat(480, 640, CV_8UC1, cv::Scalar(0))));
  EXPECT_EQ(blank.failure, LocationFailure::kFewMatches);
  EXPECT_THROW(locate_with_shared_lens(ImageLocator(map, flat), 1, image_of_k), Error);
}

// Undistorted, the noise of corners at the edge is larger than in the image: no sign of another lens.
TEST(ImageLocator, TakesTheRightLensForRightHoweverItDistorts) {
  const LandmarkMap map =
      sift_map(true, [](std::size_t i) { return 1.5 + 0.37 * static_cast<double>(i * 7 % 11); });
  const ImageLocator locator(map, TexturedWall::camera());
  for (const double k : {-0.12, -0.28, 0.15}) {
    const Camera camera = barrel_camera(k);
    const ImageLocation found =
        locator.with_camera(camera).locate(image_of(posters_through(camera)));
    ASSERT_TRUE(found.located) << k << ": " << found.reason;
    EXPECT_LT(found.world_from_camera->difference_to(pose_at(60, 40)).head<3>().norm(), 0.02) << k;
  }
}

TEST(ImageLocator, DoesNotLocateByAPlaneThatLeavesTheFocalLengthOpen) {
  const LandmarkMap map = sift_map(true, [](std::size_t) { return TexturedWall::kDepthM; });
  const ImageLocation found = ImageLocator(map, TexturedWall::camera())
                                  .with_camera(TexturedWall::camera(), FocalLength::kUnknown)
                                  .locate(image_of(posters(60, 40)));
  EXPECT_FALSE(found.located);
  EXPECT_FALSE(found.world_from_camera);
  EXPECT_EQ(found.failure, LocationFailure::kFocalLength);
  EXPECT_THAT(found.reason, HasSubstr("do not determine the focal length"));
}

TEST(ImageLocator, SharesItsMapWithImagesOfOtherCameras) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  // Half the size, half the focal length: the same field of view.
  Camera small{{1}, "PINHOLE", 320, 240, {250.0, 250.0, 159.5, 119.5}};
  cv::Mat half;
  cv::resize(TexturedWall().gray(60, 40), half, {320, 240}, 0.0, 0.0, cv::INTER_AREA);
  const ImageLocation found = locator.with_camera(small).locate(image_of(half));
  ASSERT_TRUE(found.located) << found.reason;
  EXPECT_LT(found.world_from_camera->difference_to(pose_at(60, 40)).head<3>().norm(), 0.01);
}

TEST(ImageLocator, NeedsKnownDescriptorsAndImagesOfTheCamerasSize) {
  const auto message = [](const auto& call) {
    try {
      call();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  MapTables tables = wall_tables();
  tables.landmarks.descriptors.reset();
  const LandmarkMap bare(std::move(tables));
  EXPECT_THAT(message([&] { ImageLocator(bare, TexturedWall::camera()); }),
              HasSubstr("descriptors: none"));
  tables = wall_tables();
  tables.landmarks.descriptors->kind = "SIFT";
  const LandmarkMap sift(std::move(tables));
  EXPECT_THAT(message([&] { ImageLocator(sift, TexturedWall::camera()); }),
              HasSubstr("SIFT of 32 bytes"));
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  EXPECT_THAT(message([&] { locator.locate(GrayImage(320, 240, 90)); }),
              AllOf(HasSubstr("320 x 240 pixels"), HasSubstr("principal point by 0.5")));
  EXPECT_THAT(message([&] { locator.locate(GrayImage(320, 320, 90)); }),
              AllOf(HasSubstr("320 x 320 pixels"), Not(HasSubstr("resized"))));
  EXPECT_THAT(message([&] { locator.locate(image_at(0, 0), DepthImage(320, 240)); }),
              HasSubstr("depth image"));
  EXPECT_THAT(message([&] {
                ImageLocator(wall_map(), TexturedWall::camera(),
                             {.features = {}, .min_probability = 1.5});
              }),
              HasSubstr("LocateOptions.min_probability"));
}

// Images of the wall, each of a camera on one body, with where the body is when the image (60, 40) is its first.
struct Sequence {
  std::vector<GrayImage> images;
  std::vector<Rigid3> poses;

  void add(const GrayImage& image, const Rigid3& pose) {
    images.push_back(image);
    poses.push_back(pose);
  }
  std::vector<ImageLocation> located_by(const ImageLocator& locator) const {
    std::vector<BodyView> views;
    for (std::size_t i = 0; i < images.size(); ++i) {
      views.push_back({&locator, &images[i], poses[i]});
    }
    return locate_together(views);
  }
};

// An image at (right, down) that shows one part only.
GrayImage part_at(int right, int down, const cv::Rect& part) {
  cv::Mat image(480, 640, CV_8UC1, cv::Scalar(90));
  TexturedWall().gray(right, down)(part).copyTo(image(part));
  return image_of(image);
}

// Four parts of the wall, each too small to locate its image, in any frame of the odometry.
Sequence four_parts(const Rigid3& odometry_from_map) {
  Sequence parts;
  for (const auto& [right, down, part] : {std::tuple{60, 40, cv::Rect(80, 60, 130, 130)},
                                          {70, 50, cv::Rect(400, 60, 130, 130)},
                                          {80, 60, cv::Rect(80, 280, 130, 130)},
                                          {90, 70, cv::Rect(400, 280, 130, 130)}}) {
    parts.add(part_at(right, down, part), odometry_from_map * pose_at(right, down));
  }
  return parts;
}

TEST(LocateTogether, FindsWhatNoImageShowsAlone) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const Rigid3 odometry_from_map =
      Rigid3().perturbed((Vector6d() << 3, -1, 2, 1, -2, 0.5).finished());
  const Sequence parts = four_parts(odometry_from_map);
  std::size_t alone = 0;
  for (const GrayImage& image : parts.images) alone += locator.locate(image).located ? 1 : 0;
  EXPECT_EQ(alone, 0U);
  const std::vector<ImageLocation> found = parts.located_by(locator);
  ASSERT_EQ(found.size(), 4U);
  for (std::size_t i = 0; i < found.size(); ++i) {
    ASSERT_TRUE(found[i].located) << found[i].reason;
    EXPECT_FALSE(found[i].failure);
    EXPECT_EQ(found[i].probability, found[0].probability);
    EXPECT_GT(found[i].matches.size(), 20U) << "its own";
    const Vector6d off =
        found[i].world_from_camera->difference_to(odometry_from_map.inverse() * parts.poses[i]);
    EXPECT_LT(off.head<3>().norm(), 0.004);
    EXPECT_LT(off.tail<3>().norm(), 0.002);
    EXPECT_LT(off.dot(found[i].covariance->inverse() * off), 40.0);
  }
}

TEST(LocateTogether, IsTheSameInAnyFrameOfTheOdometry) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const auto here = four_parts(Rigid3()).located_by(locator);
  for (const double far : {1.0, 100000.0}) {  // as of UTM coordinates
    const Rigid3 moved =
        Rigid3().perturbed((Vector6d() << -30 * far, 7 * far, 2, -1, 0.3, 2).finished());
    const auto there = four_parts(moved).located_by(locator);
    for (std::size_t i = 0; i < here.size(); ++i) {
      EXPECT_EQ(here[i].reason, there[i].reason);
      EXPECT_LT(here[i].estimate->difference_to(*there[i].estimate).norm(), 1e-6);
      EXPECT_NEAR((*here[i].covariance / (*there[i].covariance)(0, 0))(0, 0), 1.0, 1e-4);
    }
  }
}

TEST(LocateTogether, LearnsNothingFromAnImageGivenAgain) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  for (const GrayImage& image : {image_at(90, 50), part_at(60, 40, {250, 170, 130, 130})}) {
    const ImageLocation alone = locator.locate(image);
    for (const std::size_t times : {1, 2, 5}) {
      Sequence same;
      for (std::size_t i = 0; i < times; ++i) same.add(image, pose_at(7, 3));
      for (const ImageLocation& found : same.located_by(locator)) {
        EXPECT_EQ(found.located, alone.located) << found.reason;
        EXPECT_NEAR(found.probability, alone.probability, 1e-9);
        EXPECT_LT(found.estimate->difference_to(*alone.estimate).norm(), 1e-6);
        EXPECT_TRUE(found.covariance->isApprox(*alone.covariance, 1e-4));
        EXPECT_EQ(found.matches.size(), alone.matches.size());
      }
    }
  }
}

TEST(LocateTogether, DoesNotLocateByMatchesThatLeaveThePoseOpen) {
  const ImageLocator locator(uncertain_wall_map(), TexturedWall::camera());
  Sequence images;
  images.add(image_at(60, 40), pose_at(60, 40));
  images.add(image_at(90, 50), pose_at(90, 50));
  for (const ImageLocation& found : images.located_by(locator)) {
    EXPECT_FALSE(found.located);
    EXPECT_FALSE(found.world_from_camera);
    EXPECT_EQ(found.failure, LocationFailure::kUndetermined) << found.reason;
    EXPECT_THAT(found.reason, HasSubstr("the position has a standard deviation of"));
  }
}

TEST(LocateTogether, DoesNotLocateAnImageThatShowsNothing) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  Sequence images;
  images.add(image_at(60, 40), pose_at(60, 40));
  images.add(GrayImage(640, 480, 90), pose_at(90, 40));
  const auto found = images.located_by(locator);
  EXPECT_TRUE(found[0].located) << found[0].reason;
  EXPECT_FALSE(found[1].located);
  EXPECT_EQ(found[1].failure, LocationFailure::kFewMatches);
  EXPECT_EQ(found[1].probability, 0.0);
  EXPECT_THAT(found[1].reason, HasSubstr("0 of its own matches"));
  EXPECT_LT(found[1].estimate->difference_to(pose_at(90, 40)).norm(), 0.006);
  Sequence nothing;
  nothing.add(GrayImage(640, 480, 90), Rigid3());
  const auto none = nothing.located_by(locator);
  EXPECT_EQ(none[0].failure, LocationFailure::kFewMatches);
  EXPECT_FALSE(none[0].estimate);
}

TEST(LocateTogether, RefusesPosesThatTheImagesContradict) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  Sequence images;
  images.add(image_at(60, 40), pose_at(60, 40));
  images.add(image_at(90, 40), pose_at(-60, 40));
  for (const ImageLocation& found : images.located_by(locator)) {
    EXPECT_FALSE(found.located);
    EXPECT_FALSE(found.world_from_camera);
    EXPECT_EQ(found.failure, LocationFailure::kGivenPoses) << found.reason;
    EXPECT_THAT(found.reason, HasSubstr("the given poses contradict 1 of the 2 images"));
  }
}

TEST(LocateTogether, ChecksTheLensOfEachCamera) {
  const LandmarkMap map =
      sift_map(true, [](std::size_t i) { return 1.5 + 0.37 * static_cast<double>(i * 7 % 11); });
  const Camera flat = TexturedWall::camera();
  const ImageLocator first(map, flat);
  const ImageLocator second = first.with_camera(flat);
  const GrayImage right = image_of(posters(60, 40));
  const GrayImage distorted = image_of(posters_through(barrel_camera(-0.12)));
  const auto found = locate_together(
      std::vector<BodyView>{{&first, &right, Rigid3()}, {&second, &distorted, Rigid3()}});
  EXPECT_EQ(found[0].failure, LocationFailure::kLens) << found[0].reason;
  const ImageLocator barrel = first.with_camera(barrel_camera(-0.12));
  for (const ImageLocation& one : locate_together(
           std::vector<BodyView>{{&first, &right, Rigid3()}, {&barrel, &distorted, Rigid3()}})) {
    EXPECT_TRUE(one.located) << one.reason;
  }
}

// The camera of a rig that sees what the other does not.
TEST(LocateTogether, TellsPlacesApartByWhatAnotherCameraSees) {
  // The left occurs twice; the right, once.
  MapTables tables = wall_tables();
  const std::size_t count = tables.landmarks.positions.size();
  DescriptorColumn& column = *tables.landmarks.descriptors;
  for (std::size_t i = 0; i < count; ++i) {
    if (tables.landmarks.positions[i].x() > -0.2) continue;
    tables.landmarks.ids.push_back(LandmarkId{tables.landmarks.ids.size()});
    tables.landmarks.positions.emplace_back(tables.landmarks.positions[i] +
                                            Eigen::Vector3d(10.0, 0.0, 0.0));
    column.known.push_back(1);
    const std::vector<std::uint8_t> bytes(column.bytes.begin() + 32 * static_cast<long>(i),
                                          column.bytes.begin() + 32 * static_cast<long>(i + 1));
    column.bytes.insert(column.bytes.end(), bytes.begin(), bytes.end());
  }
  const ImageLocator locator(LandmarkMap(std::move(tables)), TexturedWall::camera());
  const GrayImage left = part_at(60, 40, {0, 0, 200, 480});
  EXPECT_EQ(locator.locate(left).failure, LocationFailure::kAmbiguous);
  Sequence both;
  both.add(left, pose_at(60, 40));
  both.add(part_at(60, 40, {240, 0, 400, 480}), pose_at(60, 40));
  const auto found = both.located_by(locator);
  ASSERT_TRUE(found[0].located) << found[0].reason;
  EXPECT_LT(found[0].world_from_camera->difference_to(pose_at(60, 40)).head<3>().norm(), 0.004);
}

TEST(LocateTogether, NeedsOneMapAndKnownCameras) {
  const ImageLocator locator(wall_map(), TexturedWall::camera());
  const ImageLocator other(wall_map(), TexturedWall::camera());
  const ImageLocator unknown = locator.with_camera(TexturedWall::camera(), FocalLength::kUnknown);
  const GrayImage image = image_at(60, 40);
  EXPECT_THROW(locate_together({}), Error);
  EXPECT_THROW(locate_together(
                   std::vector<BodyView>{{&locator, &image, Rigid3()}, {&other, &image, Rigid3()}}),
               Error);
  EXPECT_THROW(locate_together(std::vector<BodyView>{{&unknown, &image, Rigid3()}}), Error);
}

}  // namespace
}  // namespace cairn

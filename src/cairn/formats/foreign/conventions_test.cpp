// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/formats/foreign/conventions.hpp"

#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/random.hpp"
#include "cairn/formats/map_file.hpp"
#include "cairn/map/synthetic.hpp"

#include "support/imported_maps.hpp"
#include "support/real_data.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using testing::reprojection;

// What a file of a format with camera_from_world states of a frame.
struct StoredPose {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d position;
};

// How a program gets a file wrong: poses, pixels and cameras as it writes them.
struct Mistake {
  std::string name;
  std::function<StoredPose(const StoredPose&)> pose = [](const StoredPose& p) { return p; };
  std::function<Pixel(const Camera&, const Pixel&)> pixel = [](const Camera&, const Pixel& p) {
    return p;
  };
  std::function<Camera(Camera)> camera = [](Camera c) { return c; };
  bool needs_distortion = false;
};

std::vector<Mistake> mistakes() {
  std::vector<Mistake> all;
  // In the order in which a program makes them: axes, what the pose says, how the rotation is stored.
  all.push_back({"cameras look along -z with y up", [](const StoredPose& p) {
                   const Eigen::Quaterniond turn(0.0, 1.0, 0.0, 0.0);
                   return StoredPose{turn * p.rotation, turn * p.position};
                 }});
  all.push_back({"the pose is world_from_camera", [](const StoredPose& p) {
                   const Eigen::Quaterniond q = p.rotation.conjugate();
                   return StoredPose{q, -(q * p.position)};
                 }});
  all.push_back({"the position is the centre", [](const StoredPose& p) {
                   return StoredPose{p.rotation, -(p.rotation.conjugate() * p.position)};
                 }});
  all.push_back({"rotation matrices are column by column", [](const StoredPose& p) {
                   return StoredPose{p.rotation.conjugate(), p.position};
                 }});
  all.push_back({"the scalar is last", [](const StoredPose& p) {
                   const auto& q = p.rotation;
                   return StoredPose{{q.x(), q.y(), q.z(), q.w()}, p.position};
                 }});
  Mistake upwards{"pixels are counted upwards"};
  upwards.pixel = [](const Camera& camera, const Pixel& p) {
    return Pixel{p.u, 2.0 * intrinsics(camera).cy - p.v};
  };
  all.push_back(upwards);
  Mistake half{"pixels are half a pixel off"};
  half.pixel = [](const Camera&, const Pixel& p) { return Pixel{p.u + 0.5, p.v + 0.5}; };
  all.push_back(half);
  Mistake undistorted{"observations are undistorted"};
  undistorted.pixel = [](const Camera& camera, const Pixel& p) {
    const Intrinsics k = intrinsics(camera);
    const auto ray = unproject(camera, p);
    return ray ? Pixel{k.fx * ray->x() / ray->z() + k.cx, k.fy * ray->y() / ray->z() + k.cy} : p;
  };
  undistorted.needs_distortion = true;
  all.push_back(undistorted);
  Mistake normalised{"focal lengths are divided by the longer side"};
  normalised.camera = [](Camera c) {
    const double side = std::max(c.width, c.height);
    c.parameters[0] /= side;
    if (intrinsics(c).fy > 10.0) c.parameters[1] /= side;
    return c;
  };
  all.push_back(normalised);
  return all;
}

// The map that an importer makes of the file: it takes the numbers as its format says.
LandmarkMap with_mistake(LandmarkMap map, const Mistake& mistake) {
  const std::vector<Camera> cameras(map.cameras().begin(), map.cameras().end());
  MapTables tables = std::move(map).tables();
  FrameTable& frames = tables.frames;
  for (std::size_t k = 0; k < tables.observations.pixels.size(); ++k) {
    const auto camera = frames.cameras[tables.observations.frames[k].value];
    if (!camera) continue;
    tables.observations.pixels[k] =
        mistake.pixel(cameras[camera->value], tables.observations.pixels[k]);
  }
  for (std::size_t i = 0; i < frames.ids.size(); ++i) {
    const auto& q = frames.quaternions[i];
    const Eigen::Quaterniond rotation =
        Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().conjugate();
    const StoredPose stored = mistake.pose({rotation, -(rotation * frames.translations[i])});
    const Eigen::Quaterniond r = stored.rotation.conjugate();
    frames.quaternions[i] = {r.w(), r.x(), r.y(), r.z()};
    frames.translations[i] = -(r * stored.position);
  }
  for (Camera& camera : tables.cameras) camera = mistake.camera(camera);
  return LandmarkMap(std::move(tables));
}

bool is_distorted(const LandmarkMap& map) {
  const Camera& camera = map.cameras()[0];
  const auto x = project(camera, {0.3, 0.2, 1.0});
  const Intrinsics k = intrinsics(camera);
  return x && std::hypot(x->u - k.fx * 0.3 - k.cx, x->v - k.fy * 0.2 - k.cy) > 3.0;
}

// Found, or said to be undecidable. A verdict for another reading must restore the error.
void expect_found(const LandmarkMap& map, const LandmarkMap& wrong, const std::string& name) {
  SCOPED_TRACE(name);
  const double truth = reprojection(map).median;
  const ConventionCheck check = check_conventions(wrong);
  if (check.verdict == ConventionVerdict::kUndecidable) {
    EXPECT_THAT(check.sentence, HasSubstr("explain them about as well"));
    return;
  }
  if (check.verdict == ConventionVerdict::kAsFormat) {
    // What leaves the error as it is cannot be told, as half a pixel beside the noise.
    EXPECT_LT(reprojection(wrong).median, truth + 0.8) << check.sentence;
    return;
  }
  ASSERT_EQ(check.verdict, ConventionVerdict::kOther) << check.sentence;
  EXPECT_LT(reprojection(reread(wrong, check.best.reading)).median, 1.2 * truth + 0.8)
      << check.sentence;
}

// A map whose observations are where its landmarks appear, but for noise of 0.3 pixels.
LandmarkMap noisy_map(const Camera& camera) {
  Random random(5);
  MapTables tables;
  tables.cameras = {camera};
  for (std::uint32_t i = 0; i < 12; ++i) {
    const Eigen::Quaterniond q =
        (Eigen::AngleAxisd(0.3 * i - 1.5, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(0.1 * std::sin(i), Eigen::Vector3d(1, 0, 0.5).normalized()));
    tables.frames.ids.push_back(FrameId{i});
    tables.frames.quaternions.push_back({q.w(), q.x(), q.y(), q.z()});
    tables.frames.translations.emplace_back(1.0 * i, 0.2 * std::cos(i), 0.3 * i);
    tables.frames.cameras.emplace_back(CameraIndex{0});
  }
  tables.observations.offsets = {0};
  for (std::uint32_t i = 0; i < 600; ++i) {
    const Eigen::Vector3d x(random.uniform() * 30.0 - 10.0, random.uniform() * 8.0 - 4.0,
                            random.uniform() * 30.0 - 5.0);
    tables.landmarks.ids.push_back(LandmarkId{i});
    tables.landmarks.positions.push_back(x);
    for (std::uint32_t frame = 0; frame < 12; ++frame) {
      const auto& q = tables.frames.quaternions[frame];
      const Eigen::Vector3d in_camera = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).conjugate() *
                                        (x - tables.frames.translations[frame]);
      const auto pixel = project(camera, in_camera);
      if (!pixel || in_camera.z() < 1.0 || pixel->u < 0 || pixel->v < 0 || pixel->u > 640 ||
          pixel->v > 480) {
        continue;
      }
      tables.observations.frames.push_back(FrameIndex{frame});
      tables.observations.pixels.push_back(
          {pixel->u + 0.6 * random.uniform() - 0.3, pixel->v + 0.6 * random.uniform() - 0.3});
    }
    tables.observations.offsets.push_back(tables.observations.frames.size());
  }
  return LandmarkMap(std::move(tables));
}

const Camera kRadial{CameraId{0}, "RADIAL", 640, 480, {500.0, 330.0, 235.0, -0.2, 0.05}};

TEST(Conventions, ARightMapObeysItsFormat) {
  const ConventionCheck check = check_conventions(noisy_map(kRadial));
  EXPECT_EQ(check.verdict, ConventionVerdict::kAsFormat) << check.sentence;
  EXPECT_LT(check.as_format_px, 0.4);
  ASSERT_TRUE(check.runner_up);
  EXPECT_GT(check.runner_up->median_px, 1.0);
  EXPECT_THAT(check.sentence, HasSubstr("the data obey the format's conventions: median 0."));
}

TEST(Conventions, EveryMistakeIsFound) {
  const LandmarkMap map = noisy_map(kRadial);
  for (const Mistake& mistake : mistakes()) {
    const LandmarkMap wrong = with_mistake(map, mistake);
    const ConventionCheck check = check_conventions(wrong);
    EXPECT_EQ(check.verdict, ConventionVerdict::kOther) << mistake.name << ": " << check.sentence;
    expect_found(map, wrong, mistake.name);
  }
}

TEST(Conventions, EveryPairOfMistakesIsFound) {
  const LandmarkMap map = noisy_map(kRadial);
  const std::vector<Mistake> all = mistakes();
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t j = i + 1; j < all.size(); ++j) {
      expect_found(map, with_mistake(with_mistake(map, all[i]), all[j]),
                   all[i].name + ", and " + all[j].name);
    }
  }
}

TEST(Conventions, AMapOfAnotherSceneObeysNone) {
  MapTables tables = LandmarkMap(noisy_map(kRadial)).tables();
  Random random(8);
  for (Eigen::Vector3d& x : tables.landmarks.positions) {
    x = {random.uniform() * 30.0 - 10.0, random.uniform() * 8.0 - 4.0, random.uniform() * 30.0};
  }
  const ConventionCheck check = check_conventions(LandmarkMap(std::move(tables)));
  EXPECT_EQ(check.verdict, ConventionVerdict::kNone);
  EXPECT_THAT(check.sentence, HasSubstr("no convention explains the observations"));
}

TEST(Conventions, WithoutObservationsNothingIsChecked) {
  EXPECT_EQ(check_conventions(LandmarkMap()).verdict, ConventionVerdict::kNotChecked);
  MapTables tables = LandmarkMap(noisy_map(kRadial)).tables();
  tables.frames.cameras.clear();
  EXPECT_EQ(check_conventions(LandmarkMap(std::move(tables))).verdict,
            ConventionVerdict::kNotChecked);
}

TEST(Conventions, ReadingAsReadChangesNothing) {
  const LandmarkMap map = noisy_map(kRadial);
  EXPECT_NEAR(reprojection(reread(map, {})).median, reprojection(map).median, 1e-9);
}

TEST(RealConventions, SingleMistakesInRealFilesAreFound) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  for (const char* name :
       {"colmap_binary", "colmap_text_and_binary", "opensfm/reconstruction.json",
        "openmvg/sfm_data.json", "stella/map.msg", "bundler/Balbianello.out", "nvm/model.nvm"}) {
    SCOPED_TRACE(name);
    const LandmarkMap map = all_formats().read(*data / "foreign" / name);
    const ConventionCheck right = check_conventions(map);
    EXPECT_EQ(right.verdict, ConventionVerdict::kAsFormat) << right.sentence;
    for (const Mistake& mistake : mistakes()) {
      if (mistake.needs_distortion && !is_distorted(map)) continue;
      expect_found(map, with_mistake(map, mistake), mistake.name);
    }
  }
}

TEST(RealConventions, PairsOfMistakesInRealFilesAreFound) {
  const auto data = testing::real_data();
  if (!data) GTEST_SKIP() << testing::kNoRealData;
  const std::vector<Mistake> all = mistakes();
  for (const char* name : {"colmap_text_and_binary", "opensfm/reconstruction.json"}) {
    SCOPED_TRACE(name);
    const LandmarkMap map = all_formats().read(*data / "foreign" / name);
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t j = i + 1; j < all.size(); ++j) {
        if ((all[i].needs_distortion || all[j].needs_distortion) && !is_distorted(map)) continue;
        expect_found(map, with_mistake(with_mistake(map, all[i]), all[j]),
                     all[i].name + ", and " + all[j].name);
      }
    }
  }
}

}  // namespace
}  // namespace cairn

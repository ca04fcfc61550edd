// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/environment.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/error.hpp"

namespace cairn {
namespace {

using ::testing::HasSubstr;

constexpr double kCoarse = 0.02;  // textures do not matter here

class EnvironmentTest : public ::testing::TestWithParam<std::string_view> {
 protected:
  static Environment make(std::uint64_t seed = 1, std::uint64_t session = 0, double changed = 0.0) {
    return make_environment({environment_kind(GetParam()), seed, session, changed, kCoarse});
  }
};
INSTANTIATE_TEST_SUITE_P(All, EnvironmentTest, ::testing::ValuesIn(environment_names()),
                         [](const auto& name) { return std::string(name.param); });

// Name and place, to the millimetre.
using Place = std::tuple<std::string, long, long, long, long>;
std::multiset<Place> places(const Scene& scene, bool movable) {
  std::multiset<Place> result;
  for (const SceneObject& object : scene.objects) {
    if (object.movable != movable) continue;
    const auto& t = object.world_from_object.translation();
    const double yaw = object.world_from_object.roll_pitch_yaw().z();
    result.insert({object.name, std::lround(1e3 * t.x()), std::lround(1e3 * t.y()),
                   std::lround(1e3 * t.z()), std::lround(1e3 * yaw)});
  }
  return result;
}

TEST_P(EnvironmentTest, IsAValidSceneWithThingsInIt) {
  const Environment place = make();
  place.scene.validate();
  EXPECT_GT(place.scene.surfaces.size(), 300U);
  EXPECT_GT(places(place.scene, true).size(), 10U);
  EXPECT_FALSE(place.scene.lights.empty());
}

TEST_P(EnvironmentTest, SameSeedSamePlace) {
  const Environment a = make(7);
  const Environment b =
      make_environment({environment_kind(GetParam()), 7, 0, 0.0, kCoarse}, Executor(2));
  ASSERT_EQ(a.scene.surfaces.size(), b.scene.surfaces.size());
  for (std::size_t i = 0; i < a.scene.surfaces.size(); ++i) {
    EXPECT_EQ(a.scene.surfaces[i].origin, b.scene.surfaces[i].origin);
  }
  ASSERT_EQ(a.scene.textures.size(), b.scene.textures.size());
  for (std::size_t i = 0; i < a.scene.textures.size(); ++i) {
    EXPECT_EQ(a.scene.textures[i].texels(), b.scene.textures[i].texels());
  }
}

TEST_P(EnvironmentTest, AnotherSeedIsAnotherPlace) {
  EXPECT_NE(places(make(1).scene, true), places(make(2).scene, true));
}

// What stands fast, by name and place.
std::multiset<Place> plan_of(std::string_view kind, std::uint64_t seed,
                             std::optional<std::uint64_t> layout) {
  return places(make_environment({.kind = environment_kind(kind),
                                  .seed = seed,
                                  .texture_scale = kCoarse,
                                  .layout = layout})
                    .scene,
                false);
}
// Floor, ceiling and lights have their own coordinates in the world frame.
bool at_origin(const Place& place) {
  return std::get<1>(place) == 0 && std::get<2>(place) == 0 && std::get<3>(place) == 0;
}
// Share of the things of `a` that stand in `b` at the same place.
double shared(const std::multiset<Place>& a, const std::multiset<Place>& b) {
  const auto common = std::count_if(a.begin(), a.end(), [&](const Place& place) {
    return !at_origin(place) && b.contains(place);
  });
  return static_cast<double>(common) / static_cast<double>(a.size());
}

TEST_P(EnvironmentTest, TheSeedHasItsOwnLayoutUnlessOneIsGiven) {
  EXPECT_EQ(plan_of(GetParam(), 5, {}), plan_of(GetParam(), 5, 5));
  EXPECT_LT(shared(plan_of(GetParam(), 5, {}), plan_of(GetParam(), 6, {})), 0.1);
  EXPECT_LT(shared(plan_of(GetParam(), 1, {}), plan_of(GetParam(), 6, {})), 0.1);
}

TEST_P(EnvironmentTest, TwinsShareThePlanAndNotTheThings) {
  EXPECT_GT(shared(plan_of(GetParam(), 5, 1), plan_of(GetParam(), 6, 1)), 0.15);
  const Scene a = make_environment({environment_kind(GetParam()), 5, 0, 0.0, kCoarse, 1}).scene;
  const Scene b = make_environment({environment_kind(GetParam()), 6, 0, 0.0, kCoarse, 1}).scene;
  EXPECT_NE(places(a, true), places(b, true));
}

// Things on a wall are within its ends, things on the floor within the room.
TEST_P(EnvironmentTest, LayoutsStayWithinTheirWalls) {
  for (const std::uint64_t layout : {1, 2, 3, 4, 5, 6, 7, 8}) {
    const Scene scene =
        make_environment({environment_kind(GetParam()), 1, 0, 0.0, kCoarse, layout}).scene;
    Eigen::AlignedBox3d room;
    for (const Surface& surface : scene.surfaces) {
      if (scene.objects[surface.object].name != "wall") continue;
      room.extend(surface.origin);
      room.extend(surface.origin + surface.edge_u + surface.edge_v);
    }
    for (const SceneObject& object : scene.objects) {
      const Eigen::Vector3d& at = object.world_from_object.translation();
      EXPECT_LT(room.squaredExteriorDistance(at), 1e-12) << object.name << ", layout " << layout;
    }
  }
}

TEST_P(EnvironmentTest, SessionsWithoutChangesAreOnePlace) {
  const Scene a = make(3, 0).scene;
  const Scene b = make(3, 9).scene;
  EXPECT_EQ(places(a, true), places(b, true));
  EXPECT_EQ(places(a, false), places(b, false));
}

TEST_P(EnvironmentTest, ChangesMoveTheShareAskedForAndNothingElse) {
  const Scene before = make(3).scene;
  const auto movable = places(before, true);
  for (const double share : {0.2, 0.5, 1.0}) {
    const Scene after = make(3, 1, share).scene;
    EXPECT_EQ(places(before, false), places(after, false));
    std::size_t stayed = 0;
    const auto now = places(after, true);
    for (const Place& place : movable) stayed += now.contains(place) ? 1 : 0;
    const auto count = static_cast<double>(movable.size());
    EXPECT_NEAR(count - static_cast<double>(stayed), share * count, 0.5001);
    // Most of what moved is still there.
    EXPECT_GT(static_cast<double>(now.size()), count - 0.5 * share * count - 1.0);
  }
}

TEST_P(EnvironmentTest, SessionsChangeDifferently) {
  EXPECT_NE(places(make(3, 1, 0.5).scene, true), places(make(3, 2, 0.5).scene, true));
}

TEST(Environment, UnmovedThingsKeepTheirTextures) {
  const Scene a = make_environment({.texture_scale = kCoarse}).scene;
  const Scene b =
      make_environment({.session = 1, .changed_fraction = 0.3, .texture_scale = kCoarse}).scene;
  std::size_t compared = 0;
  for (const Surface& surface : a.surfaces) {
    for (const Surface& other : b.surfaces) {
      if (surface.origin != other.origin || surface.edge_u != other.edge_u ||
          surface.edge_v != other.edge_v) {
        continue;
      }
      EXPECT_EQ(a.textures[surface.texture].texels(), b.textures[other.texture].texels());
      ++compared;
    }
  }
  EXPECT_GT(compared, 500U);
}

TEST(Environment, RefusesWhatIsWrongByName) {
  EXPECT_THROW(environment_kind("cellar"), Error);
  try {
    make_environment({.changed_fraction = 1.5});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("EnvironmentOptions.changed_fraction"));
  }
  EXPECT_THROW(make_environment({.texture_scale = 0.0}), Error);
}

}  // namespace
}  // namespace cairn

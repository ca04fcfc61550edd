// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/detail/furniture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "cairn/simulation/detail/paintings.hpp"

namespace cairn::detail {
namespace {

using Eigen::Vector3d;
using Skin = SceneBuilder::Skin;

// Texels per metre: of what is seen from near, from across a table, from across a room.
constexpr double kNear = 1000.0;
constexpr double kMiddle = 600.0;
constexpr double kFar = 300.0;

constexpr Paint kBlack{0.09F, 0.09F, 0.1F};
constexpr Paint kSteel{0.6F, 0.62F, 0.65F};
constexpr Paint kPaper{0.93F, 0.92F, 0.88F};

Rigid3 turned(const Vector3d& position, double yaw) {
  return Rigid3::from_roll_pitch_yaw(position, 0.0, 0.0, yaw);
}

std::uint32_t plain(SceneBuilder& builder, const Paint& paint, Random& random) {
  return builder.paint(0.3, 0.3, 200.0, paint, &Painter::metal, random.fork(1));
}

Random next(Random& random) {
  return Random(random.draw_seed());
}

Paint wood_paint(Random& random) {
  return Paint{0.66F, 0.48F, 0.31F}.scaled(random.uniform(0.7, 1.25));
}

// The pose at the left end of a wall, on the floor; x along the wall, y into the wall.
Rigid3 wall_pose(const RoomShape& room, Wall wall) {
  constexpr double kQuarter = 0.5 * std::numbers::pi;
  switch (wall) {
    case Wall::kNorth:
      return turned({room.x0, room.y1, 0.0}, 0.0);
    case Wall::kEast:
      return turned({room.x1, room.y1, 0.0}, -kQuarter);
    case Wall::kSouth:
      return turned({room.x1, room.y0, 0.0}, 2.0 * kQuarter);
    case Wall::kWest:
      break;
  }
  return turned({room.x0, room.y0, 0.0}, kQuarter);
}

}  // namespace

double wall_length(const RoomShape& room, Wall wall) {
  const bool along_x = wall == Wall::kNorth || wall == Wall::kSouth;
  return along_x ? room.x1 - room.x0 : room.y1 - room.y0;
}

void add_room(SceneBuilder& builder, const RoomShape& room, const RoomLook& look, int lights_x,
              int lights_y, double light_power, Random& random) {
  const double wide = room.x1 - room.x0;
  const double deep = room.y1 - room.y0;
  // Large rooms have coarser textures, as they are seen from farther away.
  const double fineness = std::clamp(50.0 / (wide * deep), 0.6, 1.0);
  for (const Wall wall : {Wall::kNorth, Wall::kEast, Wall::kSouth, Wall::kWest}) {
    const double length = wall_length(room, wall);
    builder.begin_object("wall", wall_pose(room, wall));
    builder.panel({0, 0, room.height}, {length, 0, 0}, {0, 0, -room.height},
                  builder.paint(length, room.height, kFar * fineness, look.wall_paint, look.wall,
                                next(random)));
  }
  builder.begin_object("floor", Rigid3());
  builder.panel({room.x0, room.y1, 0}, {wide, 0, 0}, {0, -deep, 0},
                builder.paint(wide / look.floor_pitch, deep / look.floor_pitch,
                              kFar * fineness * look.floor_pitch, look.floor_paint, look.floor,
                              next(random)));
  builder.begin_object("ceiling", Rigid3());
  builder.panel({room.x0, room.y0, room.height}, {wide, 0, 0}, {0, deep, 0},
                builder.paint(wide / look.ceiling_pitch, deep / look.ceiling_pitch,
                              150.0 * fineness * look.ceiling_pitch, {0.85F, 0.85F, 0.83F},
                              look.ceiling, next(random)));
  const std::uint32_t glow = builder.paint(0.1, 0.1, 40.0, {1.0F, 1.0F, 0.96F}, nullptr, random);
  for (int i = 0; i < lights_x; ++i) {
    for (int j = 0; j < lights_y; ++j) {
      const Vector3d centre(room.x0 + wide * (i + 0.5) / lights_x,
                            room.y0 + deep * (j + 0.5) / lights_y, room.height - 0.02);
      builder.begin_object("ceiling light", Rigid3());
      builder.panel(centre + Vector3d(-0.3, -0.6, 0), {0.6, 0, 0}, {0, 1.2, 0}, glow, true);
      builder.light({centre - Vector3d(0, 0, 0.02), 0.6, 1.2, light_power});
    }
  }
}

void hang(SceneBuilder& builder, const RoomShape& room, Wall wall, const std::string& name,
          double along, double bottom, double width, double height, double thickness,
          SceneBuilder::Painting painting, const Paint& paint, double texels_per_metre,
          Random& random) {
  const Rigid3 pose =
      wall_pose(room, wall) * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(along, 0.0, bottom));
  builder.begin_object(name, pose);
  const auto picture =
      builder.paint(width, height, texels_per_metre, paint, painting, next(random));
  Skin skin = Skin::all(plain(builder, paint.scaled(0.6), random));
  skin.front = picture;
  builder.box({-0.5 * width, -thickness, 0.0}, {width, thickness, height}, skin);
}

SupportSurface add_table(SceneBuilder& builder, const Rigid3& pose, double width, double depth,
                         double height, Random& random) {
  builder.begin_object("table", pose);
  const Paint paint = wood_paint(random);
  constexpr double kThick = 0.03;
  Skin skin = Skin::all(
      builder.paint(width, 0.1, kMiddle, paint.scaled(0.85), &Painter::wood, next(random)));
  skin.top = builder.paint(width, depth, kMiddle, paint, &Painter::wood, next(random));
  builder.box({-0.5 * width, 0, height - kThick}, {width, depth, kThick}, skin);
  const Skin leg = Skin::all(plain(builder, kSteel.scaled(0.6), random));
  for (const double x : {-0.5 * width + 0.03, 0.5 * width - 0.08}) {
    for (const double y : {0.03, depth - 0.08}) {
      builder.box({x, y, 0}, {0.05, 0.05, height - kThick}, leg);
    }
  }
  return {pose * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(0, 0.5 * depth, height)), width,
          depth};
}

void add_bookcase(SceneBuilder& builder, const Rigid3& pose, double width, double depth,
                  double height, int levels, Random& random) {
  builder.begin_object("bookcase", pose);
  const Paint paint = wood_paint(random);
  const Skin board =
      Skin::all(builder.paint(height, 0.3, kFar, paint, &Painter::wood, next(random)));
  constexpr double kThick = 0.025;
  const double left = -0.5 * width;
  builder.box({left, 0, 0}, {kThick, depth, height}, board);
  builder.box({-left - kThick, 0, 0}, {kThick, depth, height}, board);
  builder.box({left + kThick, depth - 0.01, 0}, {width - 2 * kThick, 0.01, height}, board);
  const double step = (height - kThick) / levels;
  for (int level = 0; level <= levels; ++level) {
    const double z = level * step;
    builder.box({left + kThick, 0, z}, {width - 2 * kThick, depth, kThick}, board);
    if (level == levels) continue;
    // Books over part of the board, something else over the rest.
    const double inner = width - 2 * kThick;
    const double books = inner * random.uniform(0.55, 1.0);
    const bool from_left = random.chance(0.5);
    const double x = from_left ? left + kThick : -left - kThick - books;
    const double high = (step - kThick) * random.uniform(0.8, 0.95);
    Skin row = Skin::all(plain(builder, kPaper.scaled(0.8), random));
    row.front = builder.paint(books, high, 700.0, kBlack, &Painter::book_spines, next(random));
    builder.box({x, 0.03 + random.uniform(0.0, 0.04), z + kThick}, {books, depth - 0.1, high}, row);
    const double rest = inner - books;
    if (rest > 0.15) {
      const double size = std::min({rest - 0.04, step - kThick - 0.05, depth - 0.05});
      Skin box =
          Skin::all(builder.paint(size, size, kMiddle, kPaper, &Painter::carton, next(random)));
      const double box_x = from_left ? x + books + 0.02 : left + kThick + 0.02;
      builder.box({box_x, 0.03, z + kThick}, {size, size, size}, box);
    }
  }
}

void add_cabinet(SceneBuilder& builder, const Rigid3& pose, double width, double depth,
                 double height, Random& random) {
  builder.begin_object("cabinet", pose);
  const Paint paint = random_paint(random, 0.15, random.uniform(0.55, 0.85));
  Skin skin = Skin::all(builder.paint(depth, height, kFar, paint, &Painter::metal, next(random)));
  skin.front = builder.paint(width, height, kMiddle, paint, &Painter::drawers, next(random));
  builder.box({-0.5 * width, 0, 0}, {width, depth, height}, skin);
}

void add_partition(SceneBuilder& builder, const Rigid3& pose, double width, double height,
                   Random& random) {
  builder.begin_object("partition", pose);
  const Paint paint = random_paint(random, 0.35, 0.55);
  Skin skin = Skin::all(plain(builder, kSteel, random));
  skin.front = builder.paint(width, height, kFar, paint, &Painter::fabric, next(random));
  skin.back = builder.paint(width, height, kFar, paint, &Painter::fabric, next(random));
  builder.box({-0.5 * width, -0.02, 0.05}, {width, 0.04, height - 0.05}, skin);
  for (const double side : {-1.0, 1.0}) {  // what people pin to it
    for (double x = -0.5 * width + 0.1; x < 0.5 * width - 0.35; x += random.uniform(0.3, 0.55)) {
      const double w = random.uniform(0.15, 0.3);
      const double h = w * random.uniform(0.8, 1.42);
      const double z = height - 0.06 - random.uniform(0.0, 0.12);
      const auto painting = random.chance(0.5) ? &Painter::paper : &Painter::poster;
      const auto sheet = builder.paint(w, h, kNear, kPaper, painting, next(random));
      builder.panel({side * -x, side * 0.022, z}, {-side * w, 0, 0}, {0, 0, -h}, sheet);
    }
  }
}

void add_sofa(SceneBuilder& builder, const Rigid3& pose, double width, Random& random) {
  builder.begin_object("sofa", pose);
  const Paint paint = random_paint(random, 0.5, 0.5);
  const auto cloth = [&](double w, double h, const Paint& color) {
    return Skin::all(builder.paint(w, h, 400.0, color, &Painter::fabric, next(random)));
  };
  builder.box({-0.5 * width, 0, 0.05}, {width, 0.85, 0.25}, cloth(width, 0.4, paint));
  builder.box({-0.5 * width, 0.62, 0.3}, {width, 0.23, 0.5}, cloth(width, 0.5, paint.scaled(0.9)));
  for (const double x : {-0.5 * width - 0.16, 0.5 * width}) {
    builder.box({x, 0, 0.05}, {0.16, 0.85, 0.55}, cloth(0.8, 0.5, paint.scaled(0.8)));
  }
  const int seats = std::max(2, static_cast<int>(width / 0.65));
  for (int i = 0; i < seats; ++i) {
    const double w = width / seats;
    builder.box({-0.5 * width + i * w + 0.01, 0.01, 0.3}, {w - 0.02, 0.6, 0.13},
                cloth(w, 0.6, paint.scaled(random.uniform(0.9, 1.2))));
    // A cushion with a pattern, leaning at the back.
    const auto pattern = builder.paint(0.42, 0.42, kMiddle, paint, &Painter::rug, next(random));
    builder.box({-0.5 * width + (i + 0.5) * w - 0.21, 0.5, 0.43}, {0.42, 0.12, 0.42},
                Skin::all(pattern));
  }
}

void add_bench(SceneBuilder& builder, const Rigid3& pose, double width, Random& random) {
  builder.begin_object("bench", pose);
  const Skin slat = Skin::all(
      builder.paint(width, 0.12, kMiddle, wood_paint(random), &Painter::wood, next(random)));
  for (int i = 0; i < 3; ++i) {
    builder.box({-0.5 * width, 0.02 + 0.14 * i, 0.43}, {width, 0.12, 0.03}, slat);
  }
  const Skin leg = Skin::all(plain(builder, kBlack.scaled(2.0), random));
  for (const double x : {-0.5 * width + 0.1, 0.5 * width - 0.15}) {
    builder.box({x, 0.04, 0}, {0.05, 0.36, 0.43}, leg);
  }
}

std::vector<SupportSurface> add_rack(SceneBuilder& builder, const Rigid3& pose, double width,
                                     double depth, double height, int levels, Random& random) {
  builder.begin_object("rack", pose);
  const Skin post = Skin::all(
      builder.paint(height, 0.1, kFar, {0.15F, 0.25F, 0.55F}, &Painter::metal, next(random)));
  const Skin beam = Skin::all(
      builder.paint(width, 0.1, kFar, {0.85F, 0.4F, 0.1F}, &Painter::metal, next(random)));
  for (const double x : {-0.5 * width, 0.5 * width - 0.08}) {
    for (const double y : {0.0, depth - 0.08}) builder.box({x, y, 0}, {0.08, 0.08, height}, post);
    for (double z = 0.3; z + 0.4 < height; z += 0.6) {  // bracing
      builder.box({x + 0.02, 0.08, z}, {0.03, depth - 0.16, 0.04}, post);
    }
  }
  std::vector<SupportSurface> supports;
  const double step = (height - 0.2) / levels;
  for (int level = 0; level < levels; ++level) {
    const double z = level * step;
    if (level > 0) {
      builder.box({-0.5 * width + 0.08, 0, z}, {width - 0.16, 0.05, 0.1}, beam);
      builder.box({-0.5 * width + 0.08, depth - 0.05, z}, {width - 0.16, 0.05, 0.1}, beam);
      const Skin deck = Skin::all(
          builder.paint(width, depth, 200.0, wood_paint(random), &Painter::wood, next(random)));
      builder.box({-0.5 * width + 0.08, 0.05, z + 0.07}, {width - 0.16, depth - 0.1, 0.025}, deck);
      // The label of the place.
      const auto label = builder.paint(0.25, 0.09, kMiddle, kPaper, &Painter::carton, next(random));
      builder.panel({random.uniform(-0.4, 0.2) * width, -0.002, z + 0.095}, {0.25, 0, 0},
                    {0, 0, -0.09}, label);
    }
    const double top = level == 0 ? 0.0 : z + 0.095;
    supports.push_back(
        {pose * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(0, 0.5 * depth, top)), width - 0.2,
         depth - 0.04});
  }
  return supports;
}

std::vector<SupportSurface> add_kitchen_front(SceneBuilder& builder, const Rigid3& pose, int units,
                                              double shade, Random& random) {
  constexpr double kWorktop = 0.9;
  constexpr double kWallUnits = 1.45;  // their lower edge
  constexpr double kHeight = 0.65;
  constexpr double kDepth = 0.58;
  constexpr double kShallow = 0.32;
  const double width = kKitchenUnit * units;
  const double left = -0.5 * width;
  builder.begin_object("kitchen front", pose);
  const Paint paint = random_paint(random, random.uniform(0.05, 0.4), shade);
  // One texture for all doors: they are equal.
  Skin base = Skin::all(plain(builder, paint.scaled(0.8), random));
  base.front = builder.paint(kKitchenUnit, kWorktop - 0.14, kMiddle, paint, &Painter::cupboard,
                             next(random));
  Skin hanging = Skin::all(plain(builder, paint.scaled(0.8), random));
  hanging.front =
      builder.paint(kKitchenUnit, kHeight, kMiddle, paint, &Painter::cupboard, next(random));
  Skin stove = base;
  stove.front =
      builder.paint(kKitchenUnit, kWorktop - 0.14, kMiddle, kSteel, &Painter::oven, next(random));
  const auto oven = static_cast<int>(random.index(static_cast<std::size_t>(units)));
  const auto open = static_cast<int>(random.index(static_cast<std::size_t>(units)));
  for (int i = 0; i < units; ++i) {
    const double x = left + kKitchenUnit * i;
    builder.box({x, 0.02, 0.1}, {kKitchenUnit, kDepth, kWorktop - 0.14}, i == oven ? stove : base);
    if (i == open) continue;
    builder.box({x, kDepth + 0.02 - kShallow, kWallUnits}, {kKitchenUnit, kShallow, kHeight},
                hanging);
  }
  Skin worktop = Skin::all(
      builder.paint(width, 0.04, kMiddle, wood_paint(random), &Painter::wood, next(random)));
  worktop.top = builder.paint(width, kDepth + 0.02, kFar, kSteel.scaled(0.65), &Painter::concrete,
                              next(random));
  builder.box({left, 0.0, kWorktop - 0.04}, {width, kDepth + 0.02, 0.04}, worktop);
  builder.panel({left, kDepth + 0.015, kWallUnits + kHeight}, {width, 0, 0},
                {0, 0, kWorktop - kWallUnits - kHeight},
                builder.paint(width, kWallUnits + kHeight - kWorktop, kMiddle, kPaper,
                              &Painter::wall_tiles, next(random)));
  const double shelf = left + kKitchenUnit * (open + 0.5);
  builder.box({shelf - 0.3, kDepth + 0.02 - kShallow, kWallUnits + 0.2}, {0.6, kShallow, 0.02},
              base);
  const auto above = [&](double x, double y, double z) {
    return pose * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(x, y, z));
  };
  return {{above(0.0, 0.5 * kDepth, kWorktop), width, kDepth},
          {above(shelf, kDepth + 0.02 - 0.5 * kShallow, kWallUnits + 0.22), 0.58, kShallow - 0.02}};
}

namespace {

void add_book(SceneBuilder& builder, const Vector3d& low, const Vector3d& size, Random& random) {
  Skin skin = Skin::all(builder.paint(0.2, 0.03, 400.0, kPaper, nullptr, random));
  skin.top = builder.paint(size.x(), size.y(), kNear, kPaper, &Painter::book_cover, next(random));
  skin.left = builder.paint(size.y(), size.z(), kNear, random_paint(random, 0.6, 0.5),
                            &Painter::cup, next(random));
  skin.bottom = skin.left;
  builder.box(low, size, skin);
}

void add_leaves(SceneBuilder& builder, double base, double reach, double leaf_size, int count,
                Random& random) {
  for (int i = 0; i < count; ++i) {
    const double yaw = random.uniform(0.0, 2.0 * std::numbers::pi);
    const double pitch = random.uniform(-0.2, 1.2);
    const double along = random.uniform(0.3, 0.7) * reach;
    const Vector3d out(std::cos(yaw) * std::cos(pitch), std::sin(yaw) * std::cos(pitch),
                       std::sin(pitch));
    const Vector3d across(-std::sin(yaw), std::cos(yaw), 0.0);
    const double length = leaf_size * random.uniform(0.7, 1.2);
    const double wide = 0.4 * length;
    const auto texture = builder.paint(length, wide, kMiddle, kPaper, &Painter::leaf, next(random));
    const Vector3d origin = Vector3d(0, 0, base) + along * out - 0.5 * wide * across;
    builder.panel(origin, length * out, wide * across, texture, false,
                  {{0.0, 0.5}, {0.25, 0.08}, {0.6, 0.0}, {1.0, 0.5}, {0.6, 1.0}, {0.25, 0.92}});
  }
}

void add_carton(SceneBuilder& builder, const Vector3d& low, const Vector3d& size, double fineness,
                Random& random) {
  Skin skin;
  const Paint paint = kPaper;
  skin.front = skin.back =
      builder.paint(size.x(), size.z(), fineness, paint, &Painter::carton, next(random));
  skin.left = skin.right =
      builder.paint(size.y(), size.z(), fineness, paint, &Painter::carton, next(random));
  skin.top = skin.bottom =
      builder.paint(size.x(), size.y(), fineness, paint, &Painter::carton, next(random));
  builder.box(low, size, skin);
}

// Adds the surfaces of an item of this size.
struct ItemMaker {
  SceneBuilder& builder;
  double w, d, h;
  Random random;
  Vector3d low = {-0.5 * w, -0.5 * d, 0.0};
  Vector3d size = {w, d, h};

  void monitor() {
    const double high = 0.3;
    const double foot = h - high;
    const auto black = plain(builder, kBlack.scaled(1.6), random);
    Skin skin = Skin::all(black);
    skin.back = builder.paint(w, high, 400.0, kBlack.scaled(2.2), &Painter::drawers, next(random));
    builder.box({-0.5 * w, -0.02, foot}, {w, 0.04, high}, skin);
    const auto picture =
        builder.paint(w - 0.03, high - 0.03, kNear, kBlack, &Painter::screen, next(random));
    builder.panel({-0.5 * w + 0.015, -0.0215, h - 0.015}, {w - 0.03, 0, 0}, {0, 0, -high + 0.03},
                  picture, true);
    builder.box({-0.03, 0.02, 0.012}, {0.06, 0.03, foot + 0.1}, Skin::all(black));
    builder.box({-0.12, -0.09, 0}, {0.24, 0.18, 0.012}, Skin::all(black));
  }

  void laptop() {
    Skin skin = Skin::all(plain(builder, kSteel, random));
    skin.top = builder.paint(w, 0.23, kNear, kSteel, &Painter::keyboard, next(random));
    builder.box({-0.5 * w, -0.15, 0.0}, {w, 0.23, 0.018}, skin);
    const auto picture = builder.paint(w, 0.22, kNear, kBlack, &Painter::screen, next(random));
    const Vector3d lean = Vector3d(0, 0.06, 0.21);
    builder.panel(Vector3d(-0.5 * w, 0.08, 0.018) + lean, {w, 0, 0}, -lean, picture, true);
    builder.panel(Vector3d(0.5 * w, 0.084, 0.018) + lean, {-w, 0, 0}, -lean, skin.front);
  }

  void keyboard() {
    Skin skin = Skin::all(plain(builder, kBlack.scaled(2.0), random));
    skin.top = builder.paint(w, d, kNear, kBlack, &Painter::keyboard, next(random));
    builder.box(low, size, skin);
  }

  void mouse() {
    Skin skin = Skin::all(plain(builder, random_paint(random, 0.3, 0.3), random));
    builder.box(low, {w, d, 0.6 * h}, skin);
    builder.box({-0.35 * w, -0.35 * d, 0.6 * h}, {0.7 * w, 0.7 * d, 0.4 * h}, skin);
  }

  void cup() {
    const auto side =
        builder.paint(std::numbers::pi * w, h, kNear, kPaper, &Painter::cup, next(random));
    const auto top = plain(builder, {0.25F, 0.15F, 0.1F}, random);
    builder.cylinder({0, 0, 0}, 0.42 * w, 0.5 * w, h, side, top);
    builder.box({0.45 * w, -0.006, 0.25 * h}, {0.03, 0.012, 0.5 * h}, Skin::all(side));
  }

  void bottle() {
    const auto side =
        builder.paint(std::numbers::pi * w, 0.7 * h, kNear, kPaper, &Painter::cup, next(random));
    const auto cap = plain(builder, random_paint(random, 0.8, 0.6), random);
    builder.cylinder({0, 0, 0}, 0.5 * w, 0.5 * w, 0.7 * h, side, cap);
    builder.cylinder({0, 0, 0.7 * h}, 0.5 * w, 0.18 * w, 0.2 * h, side, cap);
    builder.cylinder({0, 0, 0.9 * h}, 0.2 * w, 0.2 * w, 0.1 * h, cap, cap);
  }

  void book() { add_book(builder, low, size, random); }

  void book_stack() {
    for (double z = 0.0; z < h;) {
      const double bw = random.uniform(0.15, 0.2);
      const double bd = random.uniform(0.2, 0.26);
      const double bh = random.uniform(0.015, 0.045);
      add_book(
          builder,
          {-0.5 * bw + random.uniform(-0.02, 0.02), -0.5 * bd + random.uniform(-0.01, 0.01), z},
          {bw, bd, bh}, random);
      z += bh + 0.0005;
    }
  }

  void upright_books() {
    Skin skin = Skin::all(plain(builder, kPaper.scaled(0.9), random));
    skin.front = builder.paint(w, h, kNear, kBlack, &Painter::book_spines, next(random));
    skin.left = skin.right = builder.paint(d, h, kNear, kPaper, &Painter::book_cover, next(random));
    builder.box(low, size, skin);
  }

  void paper() {
    Skin skin = Skin::all(plain(builder, kPaper.scaled(0.9), random));
    skin.top = builder.paint(w, d, kNear, kPaper, &Painter::paper, next(random));
    builder.box(low, size, skin);
  }

  void carton() { add_carton(builder, low, size, 400.0, random); }

  void small_box() { add_carton(builder, low, size, kNear, random); }

  void pen_holder() {
    const auto side =
        builder.paint(std::numbers::pi * w, h, kNear, kPaper, &Painter::cup, next(random));
    builder.cylinder({0, 0, 0}, 0.5 * w, 0.5 * w, h, side, plain(builder, kBlack, random));
    for (int i = 0; i < 6; ++i) {
      const auto pen = plain(builder, random_paint(random, 0.9, 0.7), random);
      builder.box({random.uniform(-0.3, 0.2) * w, random.uniform(-0.3, 0.2) * w, h},
                  {0.008, 0.008, random.uniform(0.03, 0.07)}, Skin::all(pen));
    }
  }

  void lamp() {
    const auto metal = plain(builder, random_paint(random, 0.7, 0.5), random);
    const auto shade = builder.paint(0.6, 0.15, kMiddle, kPaper, &Painter::cup, next(random));
    builder.cylinder({0, 0, 0}, 0.08, 0.08, 0.02, metal, metal);
    builder.box({-0.01, -0.01, 0.02}, {0.02, 0.02, h - 0.16}, Skin::all(metal));
    builder.cylinder({0, 0, h - 0.15}, 0.5 * w, 0.3 * w, 0.15, shade, metal);
  }

  void plant() {
    const auto pot = builder.paint(0.4, 0.11, kMiddle, kPaper, &Painter::cup, next(random));
    builder.cylinder({0, 0, 0}, 0.05, 0.065, 0.11, pot,
                     plain(builder, {0.2F, 0.13F, 0.08F}, random));
    add_leaves(builder, 0.11, 0.1, 0.11, 26, random);
  }

  void big_plant() {
    const auto pot = builder.paint(1.0, 0.4, kFar, kPaper, &Painter::cup, next(random));
    builder.cylinder({0, 0, 0}, 0.14, 0.19, 0.38, pot,
                     plain(builder, {0.2F, 0.13F, 0.08F}, random));
    builder.box({-0.015, -0.015, 0.38}, {0.03, 0.03, 0.6},
                Skin::all(plain(builder, {0.3F, 0.2F, 0.1F}, random)));
    for (const double base : {0.5, 0.75, 1.0}) add_leaves(builder, base, 0.2, 0.24, 16, random);
  }

  void chair() {
    const Paint paint = random_paint(random, 0.6, 0.4);
    const auto cloth = [&](double wide, double high) {
      return Skin::all(builder.paint(wide, high, 400.0, paint, &Painter::fabric, next(random)));
    };
    builder.box({-0.23, -0.22, 0.44}, {0.46, 0.44, 0.07}, cloth(0.46, 0.44));
    builder.box({-0.21, 0.2, 0.58}, {0.42, 0.05, 0.36}, cloth(0.42, 0.36));
    const Skin metal = Skin::all(plain(builder, kBlack.scaled(2.5), random));
    builder.box({-0.02, 0.21, 0.45}, {0.04, 0.03, 0.2}, metal);
    builder.box({-0.025, -0.025, 0.08}, {0.05, 0.05, 0.36}, metal);
    builder.box({-0.26, -0.025, 0.03}, {0.52, 0.05, 0.05}, metal);
    builder.box({-0.025, -0.26, 0.03}, {0.05, 0.235, 0.05}, metal);
    builder.box({-0.025, 0.025, 0.03}, {0.05, 0.235, 0.05}, metal);
  }

  void bin() {
    const auto side = builder.paint(0.9, h, kMiddle, kSteel, &Painter::metal, next(random));
    builder.cylinder({0, 0, 0}, 0.12, 0.5 * w, h, side,
                     builder.paint(w, w, kMiddle, kPaper, &Painter::paper, next(random)));
  }

  void pallet() {
    const Skin timber =
        Skin::all(builder.paint(1.2, 0.1, kFar, wood_paint(random), &Painter::wood, next(random)));
    for (int i = 0; i < 5; ++i)
      builder.box({-0.6, -0.4 + 0.17 * i, 0.1}, {1.2, 0.12, 0.022}, timber);
    for (const double x : {-0.6, -0.05, 0.5}) builder.box({x, -0.4, 0}, {0.1, 0.8, 0.1}, timber);
    // Layers of cartons, each layer of its own size, the top one not full.
    double z = 0.122;
    while (z < h - 0.2) {
      const double high = random.uniform(0.22, 0.36);
      const int nx = random.chance(0.5) ? 2 : 3;
      const bool last = z + 2 * high > h;
      for (int i = 0; i < nx; ++i) {
        for (int j = 0; j < 2; ++j) {
          if (last && random.chance(0.4)) continue;
          const double gap = random.uniform(0.005, 0.02);
          add_carton(builder, {-0.58 + 1.16 * i / nx, -0.38 + 0.38 * j, z},
                     {1.16 / nx - gap, 0.38 - gap, high - 0.002}, kFar, random);
        }
      }
      z += high;
    }
  }
};

struct Range {
  double low;
  double high;
};

constexpr Range exactly(double value) {
  return {value, value};
}

struct ItemSpecies {
  std::string_view name;
  Range width, depth, height;  // metres
  void (ItemMaker::*make)();
};

// In the order of ItemKind.
constexpr std::array<ItemSpecies, 19> kSpecies = {{
    {"monitor", {0.46, 0.58}, exactly(0.2), exactly(0.39), &ItemMaker::monitor},
    {"laptop", exactly(0.34), exactly(0.3), exactly(0.23), &ItemMaker::laptop},
    {"keyboard", exactly(0.44), exactly(0.14), exactly(0.025), &ItemMaker::keyboard},
    {"mouse", exactly(0.06), exactly(0.1), exactly(0.035), &ItemMaker::mouse},
    {"cup", exactly(0.085), exactly(0.085), {0.085, 0.11}, &ItemMaker::cup},
    {"bottle", exactly(0.075), exactly(0.075), {0.2, 0.28}, &ItemMaker::bottle},
    {"book", {0.14, 0.2}, {0.2, 0.27}, {0.015, 0.05}, &ItemMaker::book},
    {"book stack", exactly(0.26), exactly(0.28), {0.08, 0.2}, &ItemMaker::book_stack},
    {"upright books", {0.2, 0.4}, exactly(0.18), exactly(0.24), &ItemMaker::upright_books},
    {"paper", exactly(0.21), exactly(0.297), exactly(0.001), &ItemMaker::paper},
    {"carton", {0.3, 0.6}, {0.3, 0.5}, {0.2, 0.5}, &ItemMaker::carton},
    {"small box", {0.07, 0.22}, {0.06, 0.18}, {0.05, 0.2}, &ItemMaker::small_box},
    {"pen holder", exactly(0.085), exactly(0.085), exactly(0.1), &ItemMaker::pen_holder},
    {"lamp", exactly(0.24), exactly(0.24), exactly(0.38), &ItemMaker::lamp},
    {"plant", exactly(0.2), exactly(0.2), exactly(0.3), &ItemMaker::plant},
    {"big plant", exactly(0.6), exactly(0.6), exactly(1.4), &ItemMaker::big_plant},
    {"chair", exactly(0.5), exactly(0.5), exactly(0.95), &ItemMaker::chair},
    {"bin", exactly(0.3), exactly(0.3), exactly(0.36), &ItemMaker::bin},
    {"pallet", exactly(1.2), exactly(0.8), exactly(1.1), &ItemMaker::pallet},
}};

}  // namespace

std::string item_name(ItemKind kind) {
  return std::string(kSpecies[static_cast<std::size_t>(kind)].name);
}

ItemShape item_shape(ItemKind kind, std::uint64_t seed) {
  ItemShape shape{0.1, 0.1, 0.1, Random(seed)};
  const auto draw = [&](const Range& range) {
    return range.low < range.high ? shape.random.uniform(range.low, range.high) : range.low;
  };
  const ItemSpecies& species = kSpecies[static_cast<std::size_t>(kind)];
  // What a seed gives depends on the order of the draws.
  shape.height = draw(species.height);
  shape.depth = draw(species.depth);
  shape.width = draw(species.width);
  if (kind == ItemKind::kPaper) {  // mostly thin
    shape.height += 0.012 * shape.random.uniform() * shape.random.uniform();
  }
  return shape;
}

void add_item(SceneBuilder& builder, ItemKind kind, ItemShape shape) {
  ItemMaker maker{builder, shape.width, shape.depth, shape.height, shape.random};
  (maker.*kSpecies[static_cast<std::size_t>(kind)].make)();
}

}  // namespace cairn::detail

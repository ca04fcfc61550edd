// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/simulation/environment.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/error.hpp"
#include "cairn/simulation/detail/furniture.hpp"
#include "cairn/simulation/detail/paintings.hpp"

namespace cairn {
namespace {

using detail::hang;
using detail::ItemKind;
using detail::ItemShape;
using detail::kKitchenUnit;
using detail::Paint;
using detail::RoomLook;
using detail::RoomShape;
using detail::SceneBuilder;
using detail::SupportSurface;
using detail::Wall;
using Eigen::Vector3d;
using enum detail::ItemKind;
using enum detail::Wall;
using detail::Painter;

constexpr double kPi = std::numbers::pi;

Rigid3 upright(const Vector3d& position, double yaw_deg) {
  return Rigid3::from_roll_pitch_yaw(position, 0.0, 0.0, yaw_deg * kPi / 180.0);
}
Rigid3 shifted(double x, double y, double z) {
  return Rigid3(Eigen::Quaterniond::Identity(), Vector3d(x, y, z));
}

// Variation of a place's plan: stretched along both axes, possibly mirrored, with other sizes of furniture
// and tiles. Otherwise, places of one kind would differ only in appearance.
class Layout {
 public:
  explicit Layout(std::uint64_t number, const Random& random)
      : as_drawn_(number == kPlanAsDrawn),
        random_(random),
        stretch_x_(factor(1.0, 1.3)),
        stretch_y_(factor(1.0, 1.3)),
        mirrored_(!as_drawn_ && random_.chance(0.5)) {}

  // For what is drawn anew in every layout.
  Random& random() { return random_; }
  // 1 for the plan as drawn.
  double factor(double low, double high) { return as_drawn_ ? 1.0 : random_.uniform(low, high); }
  // A number of equal things: as many as drawn, or one more or less.
  int count(int drawn) {
    if (as_drawn_) return drawn;
    return std::max(1, drawn - 1 + static_cast<int>(random_.index(3)));
  }

  Vector3d point(double x, double y, double z) const {
    return {(mirrored_ ? -x : x) * stretch_x_, y * stretch_y_, z};
  }
  Rigid3 at(double x, double y, double yaw_deg = 0.0) const {
    return upright(point(x, y, 0.0), mirrored_ ? -yaw_deg : yaw_deg);
  }
  RoomShape room(const RoomShape& drawn) const {
    const Vector3d a = point(drawn.x0, drawn.y0, 0.0);
    const Vector3d b = point(drawn.x1, drawn.y1, 0.0);
    return {std::min(a.x(), b.x()), a.y(), std::max(a.x(), b.x()), b.y(), drawn.height};
  }
  Wall wall(Wall drawn) const {
    if (!mirrored_) return drawn;
    return drawn == kEast ? kWest : drawn == kWest ? kEast : drawn;
  }
  // From what is drawn along a wall to metres from its left end.
  double along(const RoomShape& room, Wall drawn, double metres) const {
    const bool by_x = drawn == kNorth || drawn == kSouth;
    const double stretched = metres * (by_x ? stretch_x_ : stretch_y_);
    return mirrored_ ? wall_length(room, wall(drawn)) - stretched : stretched;
  }
  // A rectangle of the floor; sides along the axes.
  SupportSurface floor(double x, double y, double width, double depth) const {
    return {at(x, y), width * stretch_x_, depth * stretch_y_};
  }
  CameraStage stage(CameraStage drawn) const {
    for (Viewpoint& view : drawn.sweep) view = {point(view.position), point(view.target)};
    for (Vector3d& corner : drawn.walk) corner = point(corner);
    drawn.orbit_target = point(drawn.orbit_target);
    drawn.orbit_radius_m *= std::sqrt(stretch_x_ * stretch_y_);
    return drawn;
  }

 private:
  static constexpr std::uint64_t kPlanAsDrawn = 1;
  Vector3d point(const Vector3d& drawn) const { return point(drawn.x(), drawn.y(), drawn.z()); }

  bool as_drawn_;
  Random random_;
  double stretch_x_;
  double stretch_y_;
  bool mirrored_;
};

// An item and its position on its support.
struct Item {
  ItemKind kind;
  std::size_t support = 0;
  double x = 0.0;
  double y = 0.0;
  double yaw = 0.0;
  std::uint64_t seed = 0;
  bool movable = true;
  bool moved = false;
  bool gone = false;
  double width = 0.0;
  double depth = 0.0;
};

// Whether the rectangles of two items on one support overlap, by the separating axis theorem.
bool overlap(const Item& a, const Item& b) {
  if (a.support != b.support || a.gone || b.gone) return false;
  const auto reach = [](const Item& item, double axis) {
    const double turn = item.yaw - axis;
    return 0.5 * (item.width * std::abs(std::cos(turn)) + item.depth * std::abs(std::sin(turn)));
  };
  const auto meet_along = [&](double axis) {
    const double apart = std::abs((b.x - a.x) * std::cos(axis) + (b.y - a.y) * std::sin(axis));
    return apart <= reach(a, axis) + reach(b, axis);
  };
  return meet_along(a.yaw) && meet_along(a.yaw + 0.5 * kPi) && meet_along(b.yaw) &&
         meet_along(b.yaw + 0.5 * kPi);
}

// The plan of all items, made before building so that sessions can change it.
class Plan {
 public:
  explicit Plan(Random random) : random_(random) {}

  std::size_t add(const SupportSurface& support) {
    supports_.push_back(support);
    return supports_.size() - 1;
  }
  void place(ItemKind kind, std::size_t support, double x, double y, double yaw_deg = 0.0,
             bool movable = false) {
    Item item = shaped(kind, support);
    item.x = x;
    item.y = y;
    item.yaw = yaw_deg * kPi / 180.0;
    item.movable = movable;
    items_.push_back(item);
  }

  // As many of these kinds in turn as find room.
  void scatter(std::initializer_list<ItemKind> kinds, int each, std::size_t support,
               double tilt_deg = 180.0) {
    for (int i = 0; i < each; ++i) {
      for (const ItemKind kind : kinds) {
        Item item = shaped(kind, support);
        if (find_spot(item, random_, tilt_deg, items_.size())) items_.push_back(item);
      }
    }
  }

  // Moves the share of the movable items that EnvironmentOptions ask for.
  void change(double fraction, Random random) {
    std::vector<std::size_t> movable;
    for (std::size_t i = 0; i < items_.size(); ++i) {
      if (items_[i].movable) movable.push_back(i);
    }
    const auto count =
        static_cast<std::size_t>(std::round(fraction * static_cast<double>(movable.size())));
    for (std::size_t i = 0; i < count; ++i) {
      std::swap(movable[i], movable[i + random.index(movable.size() - i)]);
      Item& item = items_[movable[i]];
      const Item before = item;
      item.moved = true;
      item.gone = true;
      for (int attempt = 0; attempt < 20 && item.gone; ++attempt) {
        Item candidate = before;
        if (!find_spot(candidate, random, 180.0, movable[i])) break;
        // A shorter motion would not be a noticeable change.
        const double least = std::max(0.1, 0.5 * before.width);
        if (std::hypot(candidate.x - before.x, candidate.y - before.y) < least) continue;
        item = candidate;
        item.moved = true;
      }
    }
  }

  void build(SceneBuilder& builder) const {
    for (const Item& item : items_) {
      if (item.gone) continue;
      const Rigid3 pose = supports_[item.support].world_from_support *
                          Rigid3::from_roll_pitch_yaw({item.x, item.y, 0.0005}, 0, 0, item.yaw);
      builder.begin_object(item_name(item.kind), pose, item.movable, item.moved);
      add_item(builder, item.kind, item_shape(item.kind, item.seed));
    }
  }

 private:
  Item shaped(ItemKind kind, std::size_t support) {
    Item item;
    item.kind = kind;
    item.support = support;
    item.seed = random_.draw_seed();
    const ItemShape shape = item_shape(kind, item.seed);
    item.width = shape.width;
    item.depth = shape.depth;
    return item;
  }

  bool find_spot(Item& item, Random& random, double tilt_deg, std::size_t self) const {
    const SupportSurface& support = supports_[item.support];
    for (int attempt = 0; attempt < 60; ++attempt) {
      item.yaw = random.uniform(-tilt_deg, tilt_deg) * kPi / 180.0;
      const double c = std::abs(std::cos(item.yaw));
      const double s = std::abs(std::sin(item.yaw));
      const double room_x = 0.5 * (support.width - item.width * c - item.depth * s) - 0.01;
      const double room_y = 0.5 * (support.depth - item.width * s - item.depth * c) - 0.01;
      if (room_x < 0.0 || room_y < 0.0) continue;
      item.x = random.uniform(-room_x, room_x);
      item.y = random.uniform(-room_y, room_y);
      bool free = true;
      for (std::size_t i = 0; i < items_.size() && free; ++i) {
        free = i == self || !overlap(item, items_[i]);
      }
      if (free) return true;
    }
    return false;
  }

  Random random_;
  std::vector<SupportSurface> supports_;
  std::vector<Item> items_;
};

// One place under construction.
struct Site {
  SceneBuilder builder;
  Plan plan;
  Random random;
  Layout layout;
  CameraStage stage;

  Rigid3 at(double x, double y, double yaw_deg = 0.0) const { return layout.at(x, y, yaw_deg); }
  std::size_t floor(double x, double y, double width, double depth) {
    return plan.add(layout.floor(x, y, width, depth));
  }
  RoomShape room(const RoomShape& drawn, RoomLook look, int lights_x, int lights_y,
                 double light_power) {
    RoomShape shape = layout.room(drawn);
    shape.height *= layout.factor(0.95, 1.15);
    look.floor_pitch = layout.factor(0.7, 1.4);
    look.ceiling_pitch = layout.factor(0.7, 1.4);
    add_room(builder, shape, look, layout.count(lights_x), layout.count(lights_y), light_power,
             random);
    return shape;
  }
  std::size_t table(const Rigid3& pose, double width, double depth, double height) {
    return plan.add(add_table(builder, pose, width * layout.factor(0.9, 1.0), depth,
                              height * layout.factor(0.95, 1.03), random));
  }
  void bookcase(const Rigid3& pose, double width, double height, int levels) {
    add_bookcase(builder, pose, width * layout.factor(0.85, 1.0), 0.33,
                 height * layout.factor(0.85, 1.1), layout.count(levels), random);
  }
  // Returns its top without the edge; added to the plan only if an item stands there.
  SupportSurface cabinet(const Rigid3& pose, double width, double depth, double height) {
    const double w = width * layout.factor(0.85, 1.0);
    const double h = height * layout.factor(0.9, 1.1);
    add_cabinet(builder, pose, w, depth, h, random);
    return {pose * shifted(0.0, 0.5 * depth - 0.005, h), w - 0.1, depth - 0.05};
  }

  void workplace(const Rigid3& pose, double width, double depth, int monitors, bool tidy) {
    const std::size_t desk = table(pose, width, depth, 0.72);
    const double step = width / monitors;
    for (int i = 0; i < monitors; ++i) {
      const double x = -0.5 * width + (i + 0.5) * step + random.uniform(-0.06, 0.06);
      const double y = 0.5 * depth - 0.14;
      if (random.chance(0.75)) {
        plan.place(kMonitor, desk, x, y, random.uniform(-8.0, 8.0));
        plan.place(kKeyboard, desk, x, y - 0.33, random.uniform(-9.0, 9.0), true);
        plan.place(kMouse, desk, x + 0.3, y - 0.33, random.uniform(-20.0, 20.0), true);
      } else {
        plan.place(kLaptop, desk, x, y - 0.2, random.uniform(-15.0, 15.0), true);
      }
    }
    plan.scatter({kBook, kCup, kPaper}, 1, desk);
    plan.scatter({kBookStack, kSmallBox}, 1, desk);
    plan.scatter({kLamp}, random.chance(0.5) ? 1 : 0, desk);
    if (!tidy) {
      plan.scatter({kUprightBooks, kBottle, kPaper, kPenHolder, kSmallBox, kBook, kCup, kPlant,
                    kPaper, kBook},
                   1, desk);
    }
  }

  // Pictures side by side on a wall, between two distances from its left end.
  void decorate(const RoomShape& room, Wall drawn, double drawn_from, double drawn_to,
                double bottom) {
    const Wall wall = layout.wall(drawn);
    const auto [from, to] =
        std::minmax({layout.along(room, drawn, drawn_from), layout.along(room, drawn, drawn_to)});
    for (double x = from + 0.05; x < to - 0.4;) {
      const double w = std::min(random.uniform(0.4, 1.1), to - x);
      const double h = random.uniform(0.5, 0.95);
      const double z = bottom + random.uniform(0.0, 0.25);
      if (w > 0.8 && random.chance(0.4)) {
        hang(builder, room, wall, "notice board", x + 0.5 * w, z, w, h, 0.02,
             &Painter::notice_board, {0.5F, 0.4F, 0.3F}, 800.0, random);
      } else {
        hang(builder, room, wall, "poster", x + 0.5 * w, z, w, h, 0.004, &Painter::poster,
             {0.9F, 0.9F, 0.9F}, 600.0, random);
      }
      x += w + random.uniform(0.1, 0.5);
    }
  }

  void board(const RoomShape& room, Wall wall, double along, double width) {
    hang(builder, room, layout.wall(wall), "whiteboard", layout.along(room, wall, along), 0.95,
         width, 1.1, 0.02, &Painter::whiteboard, {0.93F, 0.93F, 0.93F}, 500.0, random);
  }
  void window(const RoomShape& room, Wall wall, double along, double width) {
    hang(builder, room, layout.wall(wall), "window", layout.along(room, wall, along), 0.9, width,
         1.3, 0.02, &Painter::window_view, {0.8F, 0.8F, 0.8F}, 300.0, random);
  }
  void door(const RoomShape& room, Wall wall, double along) {
    const Paint paint =
        detail::random_paint(random, random.uniform(0.2, 0.6), random.uniform(0.4, 0.75));
    hang(builder, room, layout.wall(wall), "door", layout.along(room, wall, along), 0.0, 0.95, 2.05,
         0.04, &Painter::door, paint, 400.0, random);
  }
};

void build_desk(Site& site) {
  const RoomShape drawn{-2.7, -2.3, 3.1, 3.5, 2.7};
  const RoomLook look{&Painter::plaster,
                      &Painter::carpet_tiles,
                      &Painter::ceiling_panels,
                      {0.82F, 0.8F, 0.75F},
                      {0.3F, 0.33F, 0.38F}};
  const RoomShape room = site.room(drawn, look, 2, 2, 2.7);
  site.workplace(site.at(0.15, -0.1), 1.9, 0.75, 2, false);
  site.workplace(site.at(0.15, 1.42, 180.0), 1.9, 0.75, 2, false);
  site.bookcase(site.at(-2.35, 1.0, 90.0), 1.6, 1.95, 5);
  site.cabinet(site.at(-2.25, -0.9, 90.0), 1.2, 0.45, 0.75);
  site.bookcase(site.at(-0.6, 3.15), 1.2, 1.9, 5);
  const SupportSurface east_cabinet = site.cabinet(site.at(1.4, 3.05), 1.5, 0.45, 1.1);
  site.bookcase(site.at(0.9, -1.95, 180.0), 1.4, 2.0, 5);
  const Wall walls[4] = {kNorth, kEast, kSouth, kWest};
  site.decorate(room, walls[0], 0.2, 1.4, 1.2);
  site.window(room, walls[0], 4.2, 1.6);
  site.door(room, walls[1], 5.0);
  site.decorate(room, walls[1], 0.3, 4.3, 1.1);
  site.decorate(room, walls[2], 3.2, 5.5, 1.1);
  site.board(room, walls[3], 1.2, 1.7);
  const auto floor_east = site.floor(2.4, 0.5, 0.9, 3.0);
  const auto floor_west = site.floor(-1.6, 0.6, 0.8, 2.6);
  const auto floor_north = site.floor(0.1, 2.2, 2.8, 0.9);
  const auto floor_south = site.floor(0.1, -0.85, 2.0, 0.8);
  site.plan.scatter({kChair}, 1, floor_north);
  site.plan.scatter({kChair}, 1, floor_south);
  site.plan.scatter({kCarton, kBin}, 1, floor_north);
  site.plan.scatter({kCarton, kBookStack}, 2, floor_east);
  site.plan.scatter({kBigPlant}, 1, floor_east);
  site.plan.scatter({kCarton, kPaper, kBin}, 1, floor_west);
  site.plan.scatter({kUprightBooks, kPlant, kSmallBox, kBookStack}, 1, site.plan.add(east_cabinet),
                    15.0);

  site.stage.sweep = {
      {{1.35, 0.15, 1.5}, {0.3, 0.4, 0.75}},   {{1.45, 0.75, 1.45}, {0.2, 0.8, 0.8}},
      {{1.5, 0.55, 1.5}, {0.9, 2.6, 0.9}},     {{1.4, 0.1, 1.45}, {0.1, 0.5, 0.8}},
      {{0.8, -0.35, 1.4}, {0.25, 0.45, 0.75}}, {{0.15, -0.5, 1.5}, {-0.1, 0.7, 0.8}},
      {{-0.5, -0.4, 1.4}, {-0.2, 0.5, 0.75}},  {{-0.95, 0.15, 1.45}, {-0.1, 0.7, 0.8}},
      {{-1.0, 0.35, 1.55}, {0.3, 2.6, 1.1}},   {{-0.9, 0.7, 1.45}, {0.1, 0.9, 0.75}}};
  site.stage.orbit_target = {0.15, 0.66, 0.8};
  site.stage.orbit_radius_m = 1.35;
  site.stage.orbit_height_m = 1.5;
  site.stage.walk = {{1.75, -0.9, 1.5}, {1.75, 2.2, 1.5}, {-1.3, 2.2, 1.5}, {-1.3, -0.9, 1.5}};
}

void build_office(Site& site) {
  const RoomShape drawn{-5.2, -3.8, 4.8, 3.8, 2.8};
  Random& random = site.random;
  const RoomLook look{&Painter::plaster,
                      &Painter::carpet_tiles,
                      &Painter::ceiling_panels,
                      {0.78F, 0.82F, 0.84F},
                      {0.36F, 0.3F, 0.3F}};
  const RoomShape room = site.room(drawn, look, 4, 3, 2.0);
  for (const double x : {-2.9, -0.9, 1.1}) {
    site.workplace(site.at(x, -0.83), 1.6, 0.8, 2, random.chance(0.3));
    site.workplace(site.at(x, 0.83, 180.0), 1.6, 0.8, 2, random.chance(0.3));
    add_partition(site.builder, site.at(x, 0.0), 1.7, 1.3, random);
    const auto south = site.floor(x, -1.25, 1.2, 0.7);
    const auto north = site.floor(x, 1.25, 1.2, 0.7);
    site.plan.scatter({kChair}, 1, south);
    site.plan.scatter({kChair}, 1, north);
  }
  const std::size_t meeting = site.table(site.at(3.2, 0.0, -90.0), 1.6, 0.9, 0.74);
  site.plan.scatter({kLaptop, kPaper, kCup, kBook}, 2, meeting);
  site.bookcase(site.at(-4.85, 1.5, 90.0), 1.8, 2.0, 5);
  site.cabinet(site.at(-4.75, -1.4, 90.0), 1.6, 0.45, 1.2);
  for (const double x : {-3.2, 0.2}) site.bookcase(site.at(x, 3.45), 1.6, 2.0, 5);
  for (const double x : {-2.4, 1.6}) site.cabinet(site.at(x, -3.35, 180.0), 1.5, 0.45, 1.1);
  site.decorate(room, kNorth, 3.0, 4.3, 1.1);
  site.window(room, kNorth, 7.6, 2.4);
  site.decorate(room, kEast, 0.3, 2.6, 1.1);
  site.board(room, kEast, 3.9, 2.2);
  site.door(room, kEast, 6.4);
  site.window(room, kSouth, 1.2, 1.6);
  site.decorate(room, kSouth, 4.4, 6.3, 1.2);
  site.decorate(room, kSouth, 8.4, 9.9, 1.1);
  site.decorate(room, kWest, 3.5, 4.2, 1.3);
  const auto corner_ne = site.floor(4.2, 3.1, 0.9, 1.0);
  const auto corner_sw = site.floor(-4.5, -3.2, 1.0, 0.9);
  const auto side = site.floor(4.45, -2.2, 0.6, 2.0);
  site.plan.scatter({kBigPlant}, 1, corner_ne);
  site.plan.scatter({kBigPlant, kBin}, 1, corner_sw);
  site.plan.scatter({kCarton, kBin, kCarton}, 1, side);

  site.stage.sweep = {
      {{-3.6, -1.9, 1.5}, {-2.9, -0.3, 0.9}}, {{-1.8, -1.8, 1.45}, {-1.5, 0.0, 0.9}},
      {{-0.2, -1.9, 1.55}, {-0.6, 0.0, 0.9}}, {{1.3, -1.8, 1.45}, {0.9, 0.0, 0.9}},
      {{2.3, -1.2, 1.5}, {0.8, 0.2, 0.9}},    {{2.4, 0.8, 1.5}, {1.2, 0.0, 0.9}},
      {{1.4, 1.8, 1.45}, {0.8, 0.2, 0.9}},    {{-0.4, 1.8, 1.5}, {-0.9, 0.0, 0.9}},
      {{-2.4, 1.8, 1.5}, {-2.8, 0.1, 0.9}}};
  site.stage.orbit_target = {-0.9, 0.0, 0.9};
  site.stage.orbit_radius_m = 1.95;
  site.stage.orbit_height_m = 1.65;
  site.stage.walk = {{-4.1, -2.4, 1.55}, {2.3, -2.4, 1.55}, {2.3, 2.4, 1.55}, {-4.1, 2.4, 1.55}};
}

void build_corridor(Site& site) {
  const RoomShape drawn{-9.0, -1.5, 9.0, 1.5, 2.6};
  Random& random = site.random;
  const RoomLook look{&Painter::plaster,
                      &Painter::vinyl_tiles,
                      &Painter::ceiling_panels,
                      {0.85F, 0.78F, 0.62F},
                      {0.5F, 0.5F, 0.5F}};
  const RoomShape room = site.room(drawn, look, 6, 1, 2.7);
  for (const Wall wall : {kNorth, kSouth}) {
    double x = 0.3;
    while (x < 16.3) {
      const double gap = random.uniform(0.9, 2.3);
      site.decorate(room, wall, x, x + gap, 1.05);
      x += gap + 0.6;
      if (x > 16.9) break;
      site.door(room, wall, x + 0.1);
      x += 0.75;
    }
  }
  site.window(room, kEast, 1.5, 1.8);
  site.board(room, kWest, 1.5, 1.6);
  for (const double x : {-6.0, 0.5}) {
    add_bench(site.builder, site.at(x, -1.0, 180.0), 1.5, random);
    const auto bench =
        site.plan.add({site.at(x, -1.0, 180.0) * shifted(0.0, 0.22, 0.46), 1.4, 0.38});
    site.plan.scatter({kBook, kPaper, kCup, kSmallBox}, 1, bench);
  }
  const auto cabinet = site.plan.add(site.cabinet(site.at(-2.6, 1.1), 1.0, 0.4, 0.9));
  site.plan.scatter({kPlant, kUprightBooks, kPaper}, 1, cabinet, 20.0);
  const std::size_t plinth = site.table(site.at(5.5, -0.3), 0.8, 0.6, 0.8);
  site.plan.scatter({kPlant, kBookStack, kSmallBox, kPaper, kCup, kBook}, 1, plinth);
  for (const double x : {-7.8, -4.3, -1.0, 2.6}) {
    const auto spot = site.floor(x, 1.25, 1.4, 0.44);
    const auto other = site.floor(x, -1.25, 0.9, 0.44);
    site.plan.scatter({random.chance(0.5) ? kCarton : kBin, kSmallBox}, 1, spot, 15.0);
    site.plan.scatter({kBin}, random.chance(0.5) ? 1 : 0, other);
  }

  site.stage.sweep = {{{-7.0, 0.2, 1.5}, {-6.0, 1.5, 1.3}},  {{-5.6, 0.0, 1.5}, {-5.0, -1.5, 1.2}},
                      {{-4.2, 0.2, 1.45}, {-3.0, 1.5, 1.3}}, {{-2.8, -0.1, 1.5}, {-1.6, -1.5, 1.3}},
                      {{-1.4, 0.1, 1.5}, {0.4, 1.4, 1.2}},   {{0.2, 0.2, 1.5}, {1.0, -1.5, 1.1}},
                      {{1.8, 0.0, 1.5}, {3.0, 1.5, 1.3}},    {{3.4, 0.1, 1.5}, {5.4, -0.3, 1.0}}};
  site.stage.orbit_target = {5.5, 0.0, 0.9};
  site.stage.orbit_radius_m = 1.05;
  site.stage.orbit_height_m = 1.45;
  site.stage.walk = {{-8.0, -0.5, 1.55}, {3.9, -0.5, 1.55}, {3.9, 0.5, 1.55}, {-8.0, 0.5, 1.55}};
}

void build_warehouse(Site& site) {
  const RoomShape drawn{-8.0, -6.0, 8.0, 7.0, 5.5};
  Random& random = site.random;
  const RoomLook look{&Painter::bricks,
                      &Painter::concrete,
                      &Painter::metal,
                      {0.6F, 0.6F, 0.58F},
                      {0.45F, 0.45F, 0.44F}};
  const RoomShape room = site.room(drawn, look, 4, 4, 6.5);
  site.builder.ambient(0.8);  // or it would be dark between the shelves
  for (int column = 0; column < 4; ++column) {
    const double x = -4.35 + 2.9 * column;
    for (const Rigid3& pose :
         {site.at(x, -1.12), site.at(x, 1.12, 180.0), site.at(x, 5.85), site.at(x, -4.85, 180.0)}) {
      for (const SupportSurface& level : add_rack(site.builder, pose, 2.85, 1.1, 4.2, 3, random)) {
        const std::size_t support = site.plan.add(level);
        if (random.chance(0.7)) {
          site.plan.place(kPallet, support, -0.65, 0.0, random.uniform(-3.0, 3.0));
        } else {
          site.plan.scatter({kCarton}, 2, support, 20.0);
        }
        if (random.chance(0.5)) {
          site.plan.place(kPallet, support, 0.65, 0.0, random.uniform(-3.0, 3.0));
        } else {
          site.plan.scatter({kCarton}, 3, support, 20.0);
        }
      }
    }
  }
  for (const Wall wall : {kEast, kWest}) site.decorate(room, wall, 1.5, 11.5, 1.3);
  const auto middle = site.floor(0.0, 3.6, 1.3, 1.3);
  site.plan.place(kPallet, middle, 0.0, 0.0, 20.0);
  for (const double x : {-4.0, 0.0, 4.0}) {
    const auto strip = site.floor(x, -4.1, 3.0, 1.1);
    site.plan.scatter({kPallet, kCarton, kCarton}, 1, strip);
  }
  const auto yard = site.floor(4.2, 4.6, 2.6, 1.6);
  site.plan.scatter({kPallet, kCarton, kBin}, 1, yard);

  site.stage.sweep = {{{-5.8, 2.6, 1.6}, {-4.5, 0.6, 1.3}}, {{-3.6, 2.3, 1.5}, {-3.0, 0.6, 1.4}},
                      {{-1.8, 2.2, 1.7}, {-0.5, 3.6, 0.9}}, {{0.0, 2.1, 1.6}, {0.6, 0.6, 1.3}},
                      {{2.0, 2.2, 1.6}, {3.4, 0.6, 1.6}},   {{3.8, 2.4, 1.6}, {5.0, 5.5, 1.3}},
                      {{5.6, 2.4, 1.6}, {4.5, 0.6, 1.2}}};
  site.stage.orbit_target = {0.0, 3.6, 0.8};
  site.stage.orbit_radius_m = 1.5;
  site.stage.orbit_height_m = 1.6;
  site.stage.walk = {{-6.8, -2.2, 1.6}, {6.8, -2.2, 1.6}, {6.8, 2.0, 1.6}, {-6.8, 2.0, 1.6}};
}

void build_room(Site& site) {
  const RoomShape drawn{-3.0, -2.5, 3.0, 2.5, 2.5};
  Random& random = site.random;
  const RoomLook look{&Painter::plaster,
                      &Painter::planks,
                      &Painter::plaster,
                      {0.74F, 0.66F, 0.58F},
                      {0.6F, 0.42F, 0.27F}};
  const RoomShape room = site.room(drawn, look, 2, 1, 4.6);
  site.builder.begin_object("rug", site.at(0.0, 0.2));
  const auto carpet =
      site.builder.paint(2.8, 2.0, 500.0, {0.5F, 0.3F, 0.25F}, &Painter::rug, random.fork(7));
  site.builder.box({-1.4, -1.0, 0.0}, {2.8, 2.0, 0.01}, SceneBuilder::Skin::all(carpet));
  add_sofa(site.builder, site.at(0.0, 1.6), 1.9, random);
  const std::size_t table = site.table(site.at(0.0, -0.1), 1.2, 0.65, 0.43);
  site.plan.scatter({kBook, kCup, kPaper, kBookStack, kPlant, kCup, kSmallBox, kBottle}, 1, table);
  const auto board = site.plan.add(site.cabinet(site.at(0.0, -2.05, 180.0), 1.8, 0.45, 0.55));
  site.plan.place(kMonitor, board, 0.0, 0.05, 0.0);
  site.plan.scatter({kUprightBooks, kPlant, kSmallBox, kLamp, kBook}, 1, board, 20.0);
  site.bookcase(site.at(-2.65, 0.9, 90.0), 1.5, 2.05, 6);
  site.bookcase(site.at(-2.65, -0.9, 90.0), 1.2, 1.6, 4);
  const std::size_t dining = site.table(site.at(2.1, -0.5, -90.0), 1.3, 0.8, 0.74);
  site.plan.scatter({kCup, kBottle, kPlant, kBook, kPaper, kSmallBox}, 1, dining);
  site.decorate(room, kNorth, 0.5, 5.5, 1.15);
  site.window(room, kEast, 1.3, 1.7);
  site.door(room, kEast, 4.3);
  site.decorate(room, kSouth, 0.3, 2.0, 1.1);
  site.decorate(room, kSouth, 4.1, 5.7, 1.1);
  const auto corner_ne = site.floor(2.5, 2.0, 0.9, 0.9);
  const auto corner_sw = site.floor(-2.5, -2.0, 0.9, 0.9);
  site.plan.scatter({kBigPlant}, 1, corner_ne);
  site.plan.scatter({kCarton, kBin}, 1, corner_sw);
  const auto by_table = site.floor(2.1, 0.9, 0.8, 1.0);
  site.plan.scatter({kChair}, 1, by_table);

  site.stage.sweep = {{{-1.5, -0.9, 1.4}, {-0.2, 0.4, 0.5}}, {{-1.6, 0.2, 1.45}, {-2.8, 0.9, 1.0}},
                      {{-1.2, -0.6, 1.5}, {0.0, 1.8, 0.8}},  {{-0.2, -1.1, 1.4}, {0.1, 0.3, 0.45}},
                      {{0.8, -0.9, 1.45}, {0.4, 1.5, 0.8}},  {{0.9, 0.2, 1.4}, {2.2, -0.4, 0.8}},
                      {{0.8, 0.9, 1.4}, {0.0, -2.2, 0.8}},   {{-0.4, 1.0, 1.5}, {-0.3, -0.5, 0.5}}};
  site.stage.orbit_target = {0.0, 0.2, 0.55};
  site.stage.orbit_radius_m = 1.2;
  site.stage.orbit_height_m = 1.4;
  site.stage.walk = {{-1.7, -1.3, 1.5}, {1.2, -1.3, 1.5}, {1.2, 1.1, 1.5}, {-1.7, 1.1, 1.5}};
}

void build_kitchen(Site& site) {
  Random& random = site.random;
  Random& plan = site.layout.random();
  const int units = 5 + static_cast<int>(plan.index(4));
  const double width = kKitchenUnit * units;
  const double spare = plan.uniform(0.7, 1.2);  // beside the front, for the fridge
  const bool fridge_left = plan.chance(0.5);
  const double half = 0.5 * (width + spare);
  const RoomShape room{-half, -1.9, half, 1.3, 2.5};
  const double shade = random.uniform(0.7, 0.85);
  const RoomLook look{&Painter::plaster,
                      random.chance(0.5) ? &Painter::planks : &Painter::vinyl_tiles,
                      &Painter::plaster,
                      {0.82F, 0.8F, 0.74F},
                      {0.55F, 0.42F, 0.3F}};
  add_room(site.builder, room, look, 3, 1, 2.6, random);
  const double middle = (fridge_left ? 0.5 : -0.5) * spare;
  for (const SupportSurface& support :
       add_kitchen_front(site.builder, upright({middle, 0.7, 0.0}, 0.0), units, shade, random)) {
    const std::size_t top = site.plan.add(support);
    site.plan.scatter({kBottle, kCup, kSmallBox, kCup, kPlant, kBook}, 2, top);
  }
  add_cabinet(site.builder, upright({fridge_left ? -half + 0.4 : half - 0.4, 0.65, 0.0}, 0.0), 0.62,
              0.6, plan.uniform(1.5, 2.0), random);
  const std::size_t table = site.plan.add(add_table(
      site.builder, upright({plan.uniform(-0.6, 0.6), -1.35, 0.0}, 180.0), 1.4, 0.5, 0.74, random));
  site.plan.scatter({kCup, kBottle, kPaper, kBook, kSmallBox}, 1, table);
  site.decorate(room, kSouth, 0.3, width, 1.15);
  site.door(room, fridge_left ? kEast : kWest, 1.0);

  // Along the front, which fills the picture.
  const int stops = 2 * units;
  for (int i = 0; i < stops; ++i) {
    const double x = middle - 0.5 * width + 0.4 + (width - 0.8) * i / (stops - 1);
    site.stage.sweep.push_back(
        {{x + plan.uniform(-0.15, 0.15), plan.uniform(-0.9, -0.6), plan.uniform(1.35, 1.6)},
         {x, 1.0, plan.uniform(0.95, 1.35)}});
  }
  site.stage.orbit_target = {middle, -0.35, 1.2};
  site.stage.orbit_radius_m = 0.55;
  site.stage.orbit_height_m = 1.5;
  site.stage.walk = {{-half + 1.0, -0.85, 1.5},
                     {half - 1.0, -0.85, 1.5},
                     {half - 1.0, 0.2, 1.5},
                     {-half + 1.0, 0.2, 1.5}};
}

struct Place {
  std::string_view name;
  void (*build)(Site& site);
};

// In the order of EnvironmentKind.
constexpr std::array<Place, 6> kPlaces = {{{"desk", build_desk},
                                           {"office", build_office},
                                           {"corridor", build_corridor},
                                           {"warehouse", build_warehouse},
                                           {"room", build_room},
                                           {"kitchen", build_kitchen}}};

}  // namespace

EnvironmentKind environment_kind(std::string_view name) {
  for (std::size_t i = 0; i < kPlaces.size(); ++i) {
    if (kPlaces[i].name == name) return static_cast<EnvironmentKind>(i);
  }
  throw Error(ErrorKind::kMisuse, "environment", printable(name) + " is none",
              fmt::format("{}", fmt::join(environment_names(), ", ")));
}

std::string_view environment_name(EnvironmentKind kind) {
  return kPlaces[static_cast<std::size_t>(kind)].name;
}

std::vector<std::string_view> environment_names() {
  std::vector<std::string_view> names;
  for (const Place& place : kPlaces) names.push_back(place.name);
  return names;
}

constexpr OptionField kEnvironmentFields[] = {
    {"session", option_at<&EnvironmentOptions::session>, kAny, "--session",
     "Session number: sessions with one seed share place and world frame; path, noise and "
     "changes differ"},
    {"changed_fraction", option_at<&EnvironmentOptions::changed_fraction>, within(0, 1),
     "--changed", "Share of the movable objects that are moved or removed in this session, 0 to 1"},
    {"texture_scale", option_at<&EnvironmentOptions::texture_scale>, within(0.01, 2)},
};
constinit const OptionTable EnvironmentOptions::table = {"EnvironmentOptions", kEnvironmentFields};

void EnvironmentOptions::validate() const {
  check_options(*this);
}

Environment make_environment(const EnvironmentOptions& options, const Executor& executor) {
  options.validate();
  const auto kind = static_cast<std::uint64_t>(options.kind);
  const Random random = Random(options.seed).fork(kind);
  const std::uint64_t layout = options.layout.value_or(options.seed);
  Site site{SceneBuilder(options.texture_scale),
            Plan(random.fork(1)),
            random.fork(2),
            Layout(layout, Random(layout).fork(kind).fork(4)),
            {}};
  kPlaces[kind].build(site);
  if (options.changed_fraction > 0.0) {
    site.plan.change(options.changed_fraction, random.fork(3).fork(options.session));
  }
  site.plan.build(site.builder);
  const bool drawn_anew = options.kind == EnvironmentKind::kKitchen;
  return {site.builder.build(executor), drawn_anew ? site.stage : site.layout.stage(site.stage)};
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cairn/core/random.hpp"
#include "cairn/simulation/detail/scene_builder.hpp"

namespace cairn::detail {

/// A rectangular room with its floor at z = 0.
struct RoomShape {
  double x0, y0, x1, y1, height;
};

/// Seen from inside: north is +y, east is +x.
enum class Wall { kNorth, kEast, kSouth, kWest };

/// Length of a wall.
double wall_length(const RoomShape& room, Wall wall);

/// Appearance of a room's surfaces.
struct RoomLook {
  SceneBuilder::Painting wall;
  SceneBuilder::Painting floor;
  SceneBuilder::Painting ceiling;
  Paint wall_paint;
  Paint floor_paint;
  double floor_pitch = 1.0;  ///< factor on the size of painted patterns, e.g. tiles
  double ceiling_pitch = 1.0;
};

/// Adds walls, floor, ceiling, and rows of ceiling lights.
void add_room(SceneBuilder& builder, const RoomShape& room, const RoomLook& look, int lights_x,
              int lights_y, double light_power, Random& random);

/// Adds a flat object on a wall. Lengths in metres.
/// @param along  distance from the wall's left end to the object's middle
/// @param bottom height of the object's lower edge above the floor
void hang(SceneBuilder& builder, const RoomShape& room, Wall wall, const std::string& name,
          double along, double bottom, double width, double height, double thickness,
          SceneBuilder::Painting painting, const Paint& paint, double texels_per_metre,
          Random& random);

/// A surface that items stand on: a rectangle `width` (x) by `depth` (y) about the frame's origin.
struct SupportSurface {
  Rigid3 world_from_support;
  double width = 1.0;
  double depth = 1.0;
};

/// @param pose pose of the middle of the table's front lower edge; the front faces -y
/// @return top of the table
SupportSurface add_table(SceneBuilder& builder, const Rigid3& pose, double width, double depth,
                         double height, Random& random);
/// Adds shelves with books and some other items. The back is at y = depth.
void add_bookcase(SceneBuilder& builder, const Rigid3& pose, double width, double depth,
                  double height, int levels, Random& random);
void add_cabinet(SceneBuilder& builder, const Rigid3& pose, double width, double depth,
                 double height, Random& random);
void add_partition(SceneBuilder& builder, const Rigid3& pose, double width, double height,
                   Random& random);
void add_sofa(SceneBuilder& builder, const Rigid3& pose, double width, Random& random);
void add_bench(SceneBuilder& builder, const Rigid3& pose, double width, Random& random);
/// @return one surface per level, the floor's first
std::vector<SupportSurface> add_rack(SceneBuilder& builder, const Rigid3& pose, double width,
                                     double depth, double height, int levels, Random& random);

/// Width of each unit of a kitchen's front.
inline constexpr double kKitchenUnit = 0.6;

/// Adds a row of base units and wall units, with tiles between them. All have the same doors except an oven.
/// @param shade brightness of the doors
/// @return the worktop and a shelf among the wall units
std::vector<SupportSurface> add_kitchen_front(SceneBuilder& builder, const Rigid3& pose, int units,
                                              double shade, Random& random);

/// Items that stand on support surfaces.
enum class ItemKind {
  kMonitor,
  kLaptop,
  kKeyboard,
  kMouse,
  kCup,
  kBottle,
  kBook,
  kBookStack,
  kUprightBooks,
  kPaper,
  kCarton,
  kSmallBox,
  kPenHolder,
  kLamp,
  kPlant,
  kBigPlant,
  kChair,
  kBin,
  kPallet,
};

/// Name of a kind, e.g. "book stack".
std::string item_name(ItemKind kind);

/// Size of an item, in metres, and the random numbers that determine its appearance.
struct ItemShape {
  double width = 0.1;
  double depth = 0.1;
  double height = 0.1;
  Random random;
};
/// Shape of an item; the same for the same seed.
ItemShape item_shape(ItemKind kind, std::uint64_t seed);

/// Adds the item's surfaces to the last object begun, about the object's origin.
void add_item(SceneBuilder& builder, ItemKind kind, ItemShape shape);

}  // namespace cairn::detail

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

// A derived map keeps what still holds and drops the UUID.

/// Landmarks with at least `count` observations; all if the map has no observations.
std::vector<LandmarkIndex> landmarks_observed(const LandmarkMap& map, std::size_t count);

/// Whether `a` comes before `b` where the order in which maps are given must not matter: the map with more landmarks,
/// or the one whose first different position is lower. False both ways for maps of equal positions.
bool precedes(const LandmarkMap& a, const LandmarkMap& b);

/// Whether landmarks are the same, in the same order, up to the rounding of single precision: one map is a copy of the
/// other. False without any.
bool are_one_map(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

/// Rows of a descriptor column, with their further descriptors, in the given order.
DescriptorColumn descriptor_rows(const DescriptorColumn& descriptors,
                                 std::span<const std::uint32_t> rows);

/// Drops landmarks whose position is not finite or beyond kLargestCoordinate, with their observations.
/// @param tables a map's, valid but for such positions
/// @return the rows that they had
std::vector<std::uint32_t> drop_far_landmarks(MapTables& tables);

/// Puts frames and landmarks in another order.
/// @param frames, landmarks all rows of the tables, each once
void reorder(MapTables& tables, std::span<const std::uint32_t> frames,
             std::span<const std::uint32_t> landmarks);

/// Only these landmarks, in the given order, with their observations and all frames.
/// @throws Error (misuse) for an index out of range, (input) for a duplicate one
LandmarkMap with_landmarks(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks);

/// The mini-map of the frames with ids in [begin, end): those frames, and the landmarks observed only
/// there.
/// @throws Error (misuse) if the map has no observations or no such frame
LandmarkMap cut_frames(const LandmarkMap& map, FrameId begin, FrameId end);

/// The map without some frames and their observations, and without landmarks that fewer than two of the other frames
/// observe.
/// @param frames any of the map's; no more than all but one
LandmarkMap without_frames(const LandmarkMap& map, std::span<const FrameIndex> frames);

/// The map in another world frame. Transforms positions, covariances, poses, normals, gravity and georeference; scales
/// all lengths, of depths and rigs too but not of named columns. Keeps the unit's name. @throws as ColumnMotion
LandmarkMap transformed(const LandmarkMap& map, const Similarity3& new_from_old);

/// The map with its length unit renamed.
LandmarkMap with_length_unit(const LandmarkMap& map, LengthUnit unit);

/// The map with another georeference, or none.
LandmarkMap with_georeference(const LandmarkMap& map,
                              const std::optional<GeoReference>& georeference);

/// The map transformed into the ENU frame of its georeference: metres to the east, north and up.
/// @throws Error (input) if it has none
LandmarkMap in_enu_frame(const LandmarkMap& map);

/// The map with an added named column; replaces one of that name.
/// @param values one per landmark
LandmarkMap with_column(const LandmarkMap& map, const std::string& name,
                        std::vector<double> values);

/// The map with this camera for all frames, instead of any others and their rigs.
LandmarkMap with_camera(const LandmarkMap& map, const Camera& camera);

/// Whether the file that a map comes from stated the sizes of its images. The provenance says if not.
bool states_image_sizes(const MapInfo& info);

/// Notes in the provenance that the file states no image sizes: those of the cameras follow from the observations.
void note_unstated_image_sizes(MapInfo& info);

// ---- rigs

/// Frames that move together: those that one rig took at one instant.
struct RigidFrames {
  /// Per frame: the first one that moves with it; itself if it moves alone.
  std::vector<std::uint32_t> lead;
  std::vector<Rigid3> camera_from_lead;  ///< per frame, as its rig states it

  bool leads(std::size_t frame) const { return lead[frame] == frame; }
};

RigidFrames rigid_frames(std::span<const Rig> rigs, const FrameTable& frames);

/// camera_from_rig of all cameras of rigs.
std::unordered_map<CameraIndex, Rigid3> cameras_from_rigs(std::span<const Rig> rigs);

/// Puts each frame where its rig has it relative to its lead, as after each frame was moved by itself.
void hold_rigs(MapTables& tables);

// ---- descriptors

/// Measure of the difference between two descriptors.
enum class DescriptorNorm {
  kHamming,  ///< bits that differ
  kSquared,  ///< sum of squared differences of bytes
};

/// Whether descriptors of a kind are compared by bits (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH); others are
/// compared by bytes.
bool is_binary(std::string_view kind);

std::uint64_t descriptor_difference(std::span<const std::uint8_t> a,
                                    std::span<const std::uint8_t> b, DescriptorNorm norm);

/// Bytes that stand for a descriptor of floating-point numbers, such as ALIKED's or SuperPoint's, which is compared by its
/// direction: the vector of length 1, in steps of 1/32 of the root mean square of its numbers, up to 4 times that.
/// Distances change by less than 1 %.
/// @param values finite, not all zero
std::vector<std::uint8_t> descriptor_bytes(std::span<const float> values);

/// Number of descriptors that Cairn gives a landmark with so many distinct ones: four views, because more
/// cost time and hardly match more.
inline constexpr std::size_t kDistinctViews = 4;

/// Chooses the descriptors of a landmark's most distinct views: greedily, each time the one that differs
/// most from its nearest among those chosen (farthest-first traversal, Gonzalez 1985); the first of equals.
/// Considers only the first 64, beside `first`, and stops where all others equal a chosen one.
/// @param descriptors all of one size
/// @param first index of the one to begin with
/// @param most largest number, at least 1
/// @return indices in the order of choice
std::vector<std::size_t> distinct_descriptors(
    std::span<const std::span<const std::uint8_t>> descriptors, std::size_t first, std::size_t most,
    DescriptorNorm norm);

/// Appends a row to a column: the descriptors of one more landmark.
/// @param descriptors the representative first, each of column.bytes_each bytes; empty: unknown
void append_descriptors(DescriptorColumn& column,
                        std::span<const std::span<const std::uint8_t>> descriptors);

/// Appends a row to a column: of the descriptors of one landmark's observations the medoid, which represents it, and those
/// of the most distinct views; unknown if there is none. Considers only the first 64 for the medoid.
void append_distinct(DescriptorColumn& column,
                     std::span<const std::span<const std::uint8_t>> descriptors,
                     DescriptorNorm norm);

}  // namespace cairn

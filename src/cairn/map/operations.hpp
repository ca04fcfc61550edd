// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

namespace cairn {

// A derived map keeps all data that remain valid and drops the UUID.

/// Landmarks with at least `count` observations; all if the map has no observations.
std::vector<LandmarkIndex> landmarks_observed(const LandmarkMap& map, std::size_t count);

/// Whether `a` comes before `b` in a canonical order, independent of the input order. The map with
/// more landmarks comes first; for equal numbers, the map whose first differing position is
/// lexicographically lower. False in both directions for equal positions.
bool precedes(const LandmarkMap& a, const LandmarkMap& b);

/// Whether landmark positions are equal, in the same order, up to single-precision rounding: one
/// map is a copy of the other. False if there are no landmarks.
bool are_one_map(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b);

/// Rows of a descriptor column, with their further descriptors, in the given order.
DescriptorColumn descriptor_rows(const DescriptorColumn& descriptors,
                                 std::span<const std::uint32_t> rows);

/// Drops landmarks whose position is not finite or beyond kLargestCoordinate, with their
/// observations.
/// @param tables valid except for such positions
/// @return the dropped rows
std::vector<std::uint32_t> drop_far_landmarks(MapTables& tables);

/// Reorders frames and landmarks.
/// @param frames, landmarks old rows in their new order, each once
void reorder(MapTables& tables, std::span<const std::uint32_t> frames,
             std::span<const std::uint32_t> landmarks);

/// The map with only these landmarks, in the given order, with their observations and all frames.
/// @throws Error (misuse) for an index out of range, (input) for a duplicate one
LandmarkMap with_landmarks(const LandmarkMap& map, std::span<const LandmarkIndex> landmarks);

/// The mini-map of the frames with ids in [begin, end): these frames and the landmarks that no
/// other frame observes.
/// @throws Error (misuse) if the map has no observations or no such frame
LandmarkMap cut_frames(const LandmarkMap& map, FrameId begin, FrameId end);

/// The map without some frames and their observations. Drops landmarks that lose observations and
/// keep fewer than two.
/// @param frames frames to drop; at least one frame must remain
LandmarkMap without_frames(const LandmarkMap& map, std::span<const FrameIndex> frames);

/// The map in another world frame. Transforms positions, covariances, poses, gravity, georeference
/// and the columns of ColumnMotion; scales depths and rig translations. Keeps other named columns
/// and the unit's name.
/// @throws Error as ColumnMotion
LandmarkMap transformed(const LandmarkMap& map, const Similarity3& new_from_old);

/// The map with its length unit renamed.
LandmarkMap with_length_unit(const LandmarkMap& map, LengthUnit unit);

/// The map with another georeference, or none.
LandmarkMap with_georeference(const LandmarkMap& map,
                              const std::optional<GeoReference>& georeference);

/// The map transformed into the ENU frame of its georeference: metres to the east, north and up.
/// @throws Error (input) if it has no georeference
LandmarkMap in_enu_frame(const LandmarkMap& map);

/// The map with an added named column; replaces a column of the same name.
/// @param values one per landmark
LandmarkMap with_column(const LandmarkMap& map, const std::string& name, ColumnValues values);

/// The map with this camera for all frames; drops other cameras and rigs.
LandmarkMap with_camera(const LandmarkMap& map, const Camera& camera);

/// Whether the source file of a map stated its image sizes, according to the provenance.
bool states_image_sizes(const MapInfo& info);

/// Notes in the provenance that the file states no image sizes: the camera sizes derive from the
/// observations.
void note_unstated_image_sizes(MapInfo& info);

/// An id above all of these.
template <class Id>
Id next_free_id(std::span<const Id> ids) {
  Id next;
  for (const Id id : ids) next.value = std::max(next.value, id.value + 1);
  return next;
}

// ---- rigs

/// Rigidly coupled frames: captured by one rig at one instant.
struct RigidFrames {
  /// Per frame: the first frame of its rigid group; itself if alone.
  std::vector<std::uint32_t> lead;
  std::vector<Rigid3> camera_from_lead;  ///< per frame, from its rig's mounts

  bool leads(std::size_t frame) const { return lead[frame] == frame; }
};

RigidFrames rigid_frames(std::span<const Rig> rigs, const FrameTable& frames);

/// camera_from_rig of every camera in a rig.
std::unordered_map<CameraIndex, Rigid3> cameras_from_rigs(std::span<const Rig> rigs);

/// Recomputes each frame's pose from its lead's pose and its rig, e.g. after independent motion.
void hold_rigs(MapTables& tables);

// ---- descriptors

/// Measure of the difference between two descriptors.
enum class DescriptorNorm {
  kHamming,  ///< number of different bits
  kSquared,  ///< sum of squared differences of bytes
};

/// Whether descriptors of a kind are compared by bits (ORB, BRIEF, BRISK, AKAZE, FREAK, LATCH); others are
/// compared by bytes.
bool is_binary(std::string_view kind);

/// The norm of a kind: kHamming if it is binary.
DescriptorNorm descriptor_norm(std::string_view kind);

/// Whether two views of a landmark are so alike that its descriptors match.
/// @param a, b       from the landmark to the cameras
/// @param cosine     least cosine of the angle between the lines of sight
/// @param most_ratio greatest ratio of the distances
bool are_alike(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double cosine,
               double most_ratio);

std::uint64_t descriptor_difference(std::span<const std::uint8_t> a,
                                    std::span<const std::uint8_t> b, DescriptorNorm norm);

/// Quantises a floating-point descriptor that is compared by direction, such as ALIKED or
/// SuperPoint, to bytes: steps of 1/32 of the values' root mean square, clipped at 4 times the root
/// mean square. Distances change by less than 1 %.
/// @param values finite, not all zero
std::vector<std::uint8_t> descriptor_bytes(std::span<const float> values);

/// Largest number of distinct descriptors that Cairn keeps per landmark. More of them would cost
/// time and hardly improve matching.
inline constexpr std::size_t kDistinctViews = 4;

/// Selects the descriptors of a landmark's most distinct views by farthest-first traversal
/// (Gonzalez 1985): repeatedly adds the descriptor farthest from its nearest selected one, the
/// first one in a tie. Considers only `first` and the first 64 descriptors; stops when all others
/// equal a selected one.
/// @param descriptors all of one size
/// @param first index of the initial descriptor
/// @param most largest number of selected descriptors, at least 1
/// @return indices in selection order
std::vector<std::size_t> distinct_descriptors(
    std::span<const std::span<const std::uint8_t>> descriptors, std::size_t first, std::size_t most,
    DescriptorNorm norm);

/// Appends a row to a column: the descriptors of one more landmark.
/// @param descriptors the representative first, each of column.bytes_each bytes; empty: unknown
void append_descriptors(DescriptorColumn& column,
                        std::span<const std::span<const std::uint8_t>> descriptors);

/// Appends a row to a column, from the descriptors of one landmark's observations: the medoid as
/// representative, then the descriptors of the most distinct views; unknown if `descriptors` is
/// empty. Considers only the first 64 for the medoid.
void append_distinct(DescriptorColumn& column,
                     std::span<const std::span<const std::uint8_t>> descriptors,
                     DescriptorNorm norm);

/// Collects the descriptors of a model's landmarks from the features of its images: those of each landmark's first eight
/// observations that state their keypoint.
class ModelDescriptors {
 public:
  /// An observation whose descriptor is wanted.
  struct Wanted {
    std::size_t rank;  ///< among all that are wanted
    std::uint32_t keypoint;
    Pixel pixel;
  };

  /// @param model must outlive this
  /// @param has_descriptor whether a landmark can have one; by default all can
  explicit ModelDescriptors(const LandmarkMap& model,
                            const std::function<bool(LandmarkIndex)>& has_descriptor = {});

  const LandmarkMap& model() const { return model_; }
  std::span<const Wanted> wanted(FrameIndex frame) const { return wanted_[frame.value]; }

  /// Whether at least half of the wanted observations of a frame are near keypoints of the frame's features. Undistorting
  /// an image moves its keypoints slightly, but they stay the same keypoints.
  /// @param pixel pixel of a keypoint; (0, 0) is the top-left pixel's centre; std::nullopt: unknown
  bool are_near(FrameIndex frame,
                const std::function<std::optional<Pixel>(std::uint32_t keypoint)>& pixel) const;

  /// @param descriptor of the same size as all others
  void set(const Wanted& wanted, std::span<const std::uint8_t> descriptor);
  /// Stores the descriptor_bytes(). Ignores a descriptor of zeros or with a number that is not finite.
  void set(const Wanted& wanted, std::span<const float> descriptor);

  /// The column. std::nullopt if no descriptor was set.
  std::optional<DescriptorColumn> column(std::string kind, std::size_t bytes_each) const;

 private:
  const LandmarkMap& model_;
  std::vector<std::vector<Wanted>> wanted_;  // of each frame
  std::vector<std::size_t> first_;   // rank of each landmark's first wanted one, and the end
  std::vector<std::size_t> places_;  // of each rank, the start of its descriptor in bytes_
  std::vector<std::uint8_t> bytes_;
};

}  // namespace cairn

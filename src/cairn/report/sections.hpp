// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/experiments/paper.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"
#include "cairn/report/report.hpp"

/// Results as sections of a report: one map, a pair of maps and its alignments, several maps and
/// their links, experiments.
namespace cairn::report {

/// One alignment of a pair of maps.
struct ShownAlignment {
  const Alignment* alignment = nullptr;
  std::string name = {};  ///< strategy_name(), or another
  std::size_t k = 1;      ///< candidates per match of its ICP
};

/// Two maps and their alignments.
struct ShownPair {
  std::string source_name = "source";  ///< display name
  std::string target_name = "target";
  const LandmarkMap* source = nullptr;  ///< both maps or neither; no scene without maps
  const LandmarkMap* target = nullptr;
  std::vector<FrameImage> source_images = {};  ///< images of its frames
  std::vector<FrameImage> target_images = {};
  LengthUnit unit = LengthUnit::kMetres;
  PointSetOptions points = {};  ///< selects the landmarks to align
  Rigid3 initial = {};
  std::optional<Similarity3> truth = {};  ///< target_from_source; adds errors
  std::optional<std::string> story = {};  ///< a paragraph above the scene
  bool answer = true;                     ///< whether to show the results before the scene
  bool marks_best = true;                 ///< whether the table marks the best values
  std::vector<ShownAlignment> alignments = {};
};

/// The runs of a pair, one per alignment, in order. Without maps there are no matches and no errors.
/// @throws Error (misuse) if a match names a missing landmark
std::vector<AlignmentRun> runs_of(const ShownPair& pair);

/// Adds the maps, the results, the scene, the table of results and the convergence curves.
/// @param runs from runs_of()
/// @param prefix prefix of the ids, e.g. "r2-", for several pairs in one report; may be empty
void add_pair(Report& report, const ShownPair& pair, std::vector<AlignmentRun> runs,
              const std::string& prefix = {});

/// Adds a scene with this map only.
/// @param images images of its frames
void add_map(Report& report, const LandmarkMap& map, const std::string& name,
             const std::string& prefix = {}, std::vector<FrameImage> images = {});

/// "Aligned: REASON." for a single alignment; for several, "base aligned, covariance ambiguous."
std::string verdict_sentence(std::span<const ShownAlignment> alignments);

/// Name of an alignment on a page: the values of `--method` and `--confidence`, without icp, and
/// without base after another method.
std::string strategy_name(AlignMethod method, const std::string& confidence);

/// A map and its pose.
struct NetworkMap {
  std::string name = {};
  const LandmarkMap* map = nullptr;  ///< null: its landmarks are not shown
  std::string session = {};          ///< empty: unknown
  std::string reason = {};           ///< why it has no pose, or which part of it is left out
  /// Index of the map that defines the pose's frame, itself at the identity; std::nullopt: no pose.
  std::optional<std::size_t> frame = {};
  Similarity3 frame_from_map = {};
  std::size_t landmarks = 0;
  std::size_t keyframes = 0;
  std::optional<std::size_t> fused = {};     ///< landmarks fused with those of other maps
  Eigen::Vector3d centre = {0.0, 0.0, 0.0};  ///< centre of its landmarks, in its own frame
  LengthUnit length_unit = LengthUnit::kMetres;
};

/// A link between two of the maps.
struct NetworkEdge {
  std::size_t target = 0;
  std::size_t source = 0;
  LinkUse use = LinkUse::kRejected;
  std::string kind = {};
  std::optional<double> probability = {};
  std::string reason = {};
  std::optional<Similarity3> target_from_source = {};
};

/// Largest number of landmarks on a page; more landmarks are subsampled regularly.
inline constexpr std::size_t kShownLandmarks = 400000;

/// Adds the maps' landmarks and the sections `network`, `residuals`, `sessions`, `maps` and
/// `links`, except empty ones. The network shows the poses in three stages: every map in its own
/// frame; each map placed by the most certain chain of used links from its group's frame; optimised
/// poses.
/// @throws Error (misuse) for an index out of range
void add_network(Report& report, std::span<const NetworkMap> maps,
                 std::span<const NetworkEdge> edges, std::size_t shown_landmarks = kShownLandmarks);

Section table_section(const ResultTable& source);

/// The paper's Figures 3 to 5 for these results and the published ones, score versus pose error if the
/// truth is known, and all tables.
std::vector<Section> paper_sections(const PaperResults& results, const PoseTolerance& tolerance);

/// Success by strategy, kind of place and pair, basins of convergence, score versus pose error, and
/// all tables.
/// @param runs the summarised runs
std::vector<Section> study_sections(const Study& study, const StudySummary& summary,
                                    std::span<const TrialResult> runs);

}  // namespace cairn::report

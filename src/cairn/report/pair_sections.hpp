// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cairn/alignment/align.hpp"
#include "cairn/map/landmark_map.hpp"
#include "cairn/registration/point_set.hpp"
#include "cairn/report/report.hpp"
#include "cairn/report/run_builder.hpp"

namespace cairn::report {

/// An alignment as a run of a scene: the result of make_run(), with the alignment's status and reason.
/// @throws Error as make_run()
AlignmentRun make_run(const Alignment& alignment, const ShownPoints& source,
                      const ShownPoints& target, RunOptions options);

/// One alignment of a pair of maps.
struct ShownAlignment {
  const Alignment* alignment = nullptr;
  std::string name = {};  ///< of the method, e.g. "robust"
  std::size_t k = 1;      ///< candidates per match of its ICP
};

/// Two maps and their alignments.
struct ShownPair {
  std::string source_name = "source";  ///< name for people
  std::string target_name = "target";
  const LandmarkMap* source = nullptr;  ///< with the target, or neither: then there is no scene
  const LandmarkMap* target = nullptr;
  std::vector<FrameImage> source_images = {};  ///< what its frames saw
  std::vector<FrameImage> target_images = {};
  LengthUnit unit = LengthUnit::kMetres;
  PointSetOptions points = {};  ///< landmarks that take part
  Rigid3 initial = {};
  std::optional<Similarity3> truth = {};  ///< target_from_source; adds errors
  std::optional<std::string> story = {};  ///< a paragraph above the scene
  bool answer = true;                     ///< whether to show the results before the scene
  std::vector<ShownAlignment> alignments = {};
};

/// The runs of a pair, one per alignment, in order. Without maps there are no matches and no errors.
/// @throws Error (misuse) if a match names a missing landmark
std::vector<AlignmentRun> runs_of(const ShownPair& pair);

/// Result of an alignment: verdict, pose with its uncertainty, candidates.
AlignmentAnswer answer_of(const Alignment& alignment, const std::string& name);

/// Adds the maps, the results, the scene, the table of results and the convergence curves.
/// @param runs from runs_of()
/// @param prefix of the ids, e.g. "r2-", for several pairs in one report; may be empty
void add_pair(Report& report, const ShownPair& pair, std::vector<AlignmentRun> runs,
              const std::string& prefix = {});

/// Adds a scene with this map only.
/// @param images what its frames saw
void add_map(Report& report, const LandmarkMap& map, const std::string& name,
             const std::string& prefix = {}, std::vector<FrameImage> images = {});

/// "Aligned: REASON."
std::string verdict_sentence(const Alignment& alignment);

}  // namespace cairn::report

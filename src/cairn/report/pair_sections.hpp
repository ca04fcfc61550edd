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

/// An alignment as a run of a scene: what make_run() gives, with the status and the reason that people read.
/// @throws Error as make_run()
AlignmentRun make_run(const Alignment& alignment, const ShownPoints& source,
                      const ShownPoints& target, RunOptions options);

/// One alignment of a pair of maps.
struct ShownAlignment {
  const Alignment* alignment = nullptr;
  std::string name = {};  ///< of the method, e.g. "robust"
  std::size_t k = 1;      ///< candidates that its ICP chose among
};

/// Two maps and how they were aligned.
struct ShownPair {
  std::string source_name = "source";  ///< for people
  std::string target_name = "target";
  const LandmarkMap* source = nullptr;  ///< with the target, or neither: then there is no scene
  const LandmarkMap* target = nullptr;
  LengthUnit unit = LengthUnit::kMetres;
  PointSetOptions points = {};  ///< which landmarks take part
  Rigid3 initial = {};
  std::optional<Similarity3> truth = {};  ///< target_from_source: adds errors
  std::optional<std::string> story = {};  ///< a paragraph above the scene
  bool answer = true;                     ///< whether what they came to stands before the scene
  std::vector<ShownAlignment> alignments = {};
};

/// The runs of a pair, one an alignment, in their order. Without maps there are neither matches nor errors.
/// @throws Error (misuse) if a match names a landmark that is not there
std::vector<AlignmentRun> runs_of(const ShownPair& pair);

/// What an alignment came to: verdict, pose and its uncertainty, candidates.
AlignmentAnswer answer_of(const Alignment& alignment, const std::string& name);

/// Adds the maps, what the alignments came to, the scene, the table of results and the curves of convergence.
/// @param runs from runs_of()
/// @param prefix of the ids, e.g. "r2-", for several pairs in one report; may be empty
void add_pair(Report& report, const ShownPair& pair, std::vector<AlignmentRun> runs,
              const std::string& prefix = {});

/// Adds a scene with this map alone.
void add_map(Report& report, const LandmarkMap& map, const std::string& name,
             const std::string& prefix = {});

/// "Aligned: the reason."
std::string verdict_sentence(const Alignment& alignment);

}  // namespace cairn::report

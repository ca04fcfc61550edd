// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "cairn/core/executor.hpp"
#include "cairn/core/progress.hpp"
#include "cairn/experiments/study.hpp"

namespace cairn {

/// Part `index` of `count` of a study, from 1: a contiguous stretch of its runs.
struct Shard {
  std::size_t index = 1;
  std::size_t count = 1;

  /// @throws Error (misuse) unless 1 <= index <= count
  void validate() const;
  std::size_t begin(std::size_t runs) const {
    return runs / count * (index - 1) + extra(runs, index - 1);
  }
  std::size_t end(std::size_t runs) const { return runs / count * index + extra(runs, index); }

 private:
  // The first shards take one run more where runs do not divide evenly.
  std::size_t extra(std::size_t runs, std::size_t shards) const {
    return shards < runs % count ? shards : runs % count;
  }
};

/// A folder with the runs of a study, or of a shard of it, that can be killed at any moment: every
/// complete row of its runs.csv and timings.csv is kept, none is written twice, a row that was cut is
/// dropped and run again. One process at a time has it.
class StudyFolder {
 public:
  /// Makes the folder, or takes up what is in it.
  /// @param inputs what else the runs depend on, one line each, e.g. the hashes of the maps
  /// @throws Error (storage) if another process has it or it cannot be written; (input) if it holds
  ///         the runs of another study or shard, naming what differs, or rows that are not the plan's
  StudyFolder(const std::filesystem::path& folder, const StudyPlan& plan, const Shard& shard,
              const std::vector<std::string>& inputs = {});
  ~StudyFolder();
  StudyFolder(const StudyFolder&) = delete;
  StudyFolder& operator=(const StudyFolder&) = delete;

  /// Rows that are there; run shard.begin() + done() is next.
  std::size_t done() const;
  /// Appends the next run's rows.
  /// @throws Error (storage), e.g. for a full disk; (misuse) if it is not the next
  void append(const TrialResult& run);
  /// Waits until all rows are on disk.
  void sync();

 private:
  struct Files;
  std::unique_ptr<Files> files_;
};

struct StudyOptions {
  Executor executor = Executor();
  std::stop_token stop = {};
  /// Told after each run: how many of the shard's are done, and of how many.
  std::function<void(std::size_t done, std::size_t all)> progress = {};
};

/// Makes the runs that the folder lacks, in their order, several at once; a pair's maps are asked for
/// only where one of its runs is still to be made. The rows do not depend on the number of threads.
/// @throws Error (cancelled); what `load_pair` and the folder throw
void run_study(const StudyPlan& plan, const Shard& shard, StudyFolder& folder,
               const std::function<MapPair(const StudyPair&)>& load_pair,
               const StudyOptions& options = {});

/// Joins the complete folders of all shards of one study, given in any order, to the folder that one
/// process would have written; runs.csv is the same byte for byte.
/// @throws Error (input) naming a folder that is of another study, incomplete, missing or given twice;
///         (storage) if `merged` exists or cannot be written
void merge_study(const std::vector<std::filesystem::path>& shards,
                 const std::filesystem::path& merged);

}  // namespace cairn

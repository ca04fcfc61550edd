// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/core/execution.hpp"
#include "cairn/core/executor.hpp"
#include "cairn/experiments/study.hpp"

namespace cairn {

/// Part `index` of `count` of a study, from 1: a contiguous range of its runs.
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
  // The first shards have one more run if runs do not divide evenly.
  std::size_t extra(std::size_t runs, std::size_t shards) const {
    return shards < runs % count ? shards : runs % count;
  }
};

/// A folder with the runs of a study or of a shard, safe against being killed at any time: complete rows of
/// runs.csv and timings.csv are kept, no row is written twice; from a truncated or damaged row on, all are
/// dropped and run again.
/// Used by one process at a time: a second is refused, before it reads or writes anything.
class StudyFolder {
 public:
  /// Creates the folder, or continues with its content.
  /// @param inputs other inputs of the runs, one line each, e.g. the hashes of the maps
  /// @throws Error (storage) if another process uses it or it cannot be written; (input) if it holds runs
  ///        of another study or shard, naming the difference, or rows that do not match the plan
  StudyFolder(const std::filesystem::path& folder, const StudyPlan& plan, const Shard& shard,
              const std::vector<std::string>& inputs = {});
  ~StudyFolder();
  StudyFolder(const StudyFolder&) = delete;
  StudyFolder& operator=(const StudyFolder&) = delete;

  /// Kinds of processor that wrote rows, this one included, in ascending order; see processor_kind(). Those of
  /// different kinds may differ in last digits.
  const std::vector<std::string>& processors() const;

  /// Rows in the folder; the next run is shard.begin() + done().
  std::size_t done() const;
  /// Appends the next run's rows.
  /// @throws Error (storage), e.g. for a full disk; (misuse) if it is not the next run
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
  /// Called after each run, with the number of finished runs of the shard and the number of all.
  std::function<void(std::size_t done, std::size_t all)> progress = {};
  /// Called with each run before that.
  std::function<void(const TrialResult& run)> each_run = {};
};

/// Makes the missing runs of the folder, in order, several at once; loads a pair's maps only if one of its
/// runs is missing. The rows do not depend on the number of threads.
/// @throws Error (cancelled); what `load_pair` and the folder throw
void run_study(const StudyPlan& plan, const Shard& shard, StudyFolder& folder,
               const std::function<MapPair(const StudyPair&)>& load_pair,
               const StudyOptions& options = {});

/// Whether the folder holds all runs of the shard, each row sound. Changes nothing.
/// @param inputs as of StudyFolder
/// @throws Error (input) as StudyFolder
bool is_complete(const std::filesystem::path& folder, const StudyPlan& plan, const Shard& shard,
                 const std::vector<std::string>& inputs = {});

/// @param name of the study's file, for messages
/// @throws Error (input) if the folder's runs are not of this study, naming the difference
void require_runs_of(const std::filesystem::path& folder, const Study& study,
                     std::string_view name);

/// Joins the complete folders of all shards of one study, in any order, to the folder that a single process
/// would have written; runs.csv is identical. The folder appears whole or not at all.
/// @param merged a new or empty folder
/// @return the kinds of processor that wrote the rows, as StudyFolder::processors()
/// @throws Error (input) naming a folder of another study, incomplete, missing or given twice; (storage) if
///        `merged` holds anything or cannot be written
std::vector<std::string> merge_study(const std::vector<std::filesystem::path>& shards,
                                     const std::filesystem::path& merged);

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include "align_pairs.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <list>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cairn/alignment/alignment.hpp"
#include "cairn/alignment/prepared_map.hpp"
#include "cairn/core/detail/csv.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"

#include "commands.hpp"
#include "support/alignments.hpp"
#include "support/console.hpp"
#include "support/interrupt.hpp"
#include "support/refusals.hpp"

namespace cairn::cli {
namespace {

struct PairOfPaths {
  std::string source;
  std::string target;
};

std::vector<PairOfPaths> read_list(const std::string& list) {
  std::string text = read_file(list == "-" ? "/dev/stdin" : list);
  if (!text.ends_with('\n')) text += '\n';
  const std::vector<detail::CsvRow> rows = detail::parse_csv(text, list);
  const auto column = [&](std::string_view name) {
    const auto& header = rows.front().cells;
    const auto found = std::find(header.begin(), header.end(), name);
    reject_if(found == header.end(), fmt::format("{}:1", list), fmt::format("no column {}", name),
              "a header with the columns source and target");
    return static_cast<std::size_t>(found - header.begin());
  };
  const std::size_t source = column("source");
  const std::size_t target = column("target");
  std::vector<PairOfPaths> pairs;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const std::vector<std::string>& cells = rows[i].cells;
    if (cells.size() == 1 && cells.front().empty()) continue;  // an empty line
    reject_if(
        cells.size() <= std::max(source, target) || cells[source].empty() || cells[target].empty(),
        fmt::format("{}:{}", list, rows[i].line), "a row without source or target",
        "the paths of two maps");
    pairs.push_back({cells[source], cells[target]});
  }
  reject_if(pairs.empty(), list, "lists no pair", "a row with the paths of two maps");
  return pairs;
}

// Maps that were used last, prepared.
class Maps {
 public:
  Maps(const AlignOptions& options, const CommonArguments& common)
      : common_(common), prepare_{.points = options.points, .seed = options.seed} {}

  struct One {
    PreparedMap map;
    LengthUnit unit = LengthUnit::kMetres;
  };
  One get(const std::string& path) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(maps_.begin(), maps_.end(),
                                    [&](const auto& one) { return one.first == path; });
    if (found != maps_.end()) {
      maps_.splice(maps_.begin(), maps_, found);
      return maps_.front().second;
    }
    const LoadedMap loaded = load_map(path, common_);
    maps_.emplace_front(path,
                        One{PreparedMap(loaded.map, prepare_), loaded.map.info().length_unit});
    if (maps_.size() > kKept) maps_.pop_back();
    return maps_.front().second;
  }

 private:
  static constexpr std::size_t kKept = 64;

  const CommonArguments& common_;
  PrepareOptions prepare_;
  std::mutex mutex_;
  std::list<std::pair<std::string, One>> maps_;  // last used first
};

// What came of a pair; of one whose maps cannot be aligned at all, why.
struct PairResult {
  std::optional<StrategyResult> result;
  std::string error;
};

PairResult aligned(const PairOfPaths& pair, AlignOptions options, bool gravity, Maps& maps) {
  PairResult result;
  try {
    const Maps::One source = maps.get(pair.source);
    const Maps::One target = maps.get(pair.target);
    reject_if(!scale_range(options, source.unit, target.unit) && source.unit != target.unit,
              pair.source, "one map is in metres, one of free scale",
              "maps of one unit with --no-scale");
    if (gravity) options.gravity = gravity_prior(source.map, target.map);
    StrategyResult one;
    one.alignment = align(source.map, target.map, options);
    if (one.alignment.registration.status == RegistrationStatus::kCancelled) {
      throw Error(ErrorKind::kCancelled, "align", "cancelled", "");
    }
    one.method = options.method;
    one.confidence = "none";
    one.length_unit = target.unit;
    one.matches = one.alignment.registration.matches.size();
    one.overlap_radius = options.overlap_radius.value_or(one.alignment.radius);
    result.result = std::move(one);
  } catch (const Error& error) {
    // Maps that cannot be aligned cost no other pair; a wrong command line does.
    if (error.kind() == ErrorKind::kCancelled || error.kind() == ErrorKind::kMisuse) throw;
    result.error = error.what();
  }
  return result;
}

}  // namespace

int align_pairs(const std::string& list, const AlignOptions& options, bool gravity,
                const Json& recorded, const CommonArguments& common) {
  const std::vector<PairOfPaths> pairs = read_list(list);
  const Console console = common.console();
  const auto progress = console.progress("aligning");
  const Executor executor = common.executor();
  AlignOptions each = options;
  each.execution.stop = interrupt_requests();
  // Many pairs are the better work to share out.
  each.execution.executor = pairs.size() >= executor.threads() ? Executor(1) : executor;
  Maps maps(options, common);
  std::mutex mutex;  // of the results
  Json results = Json::array();
  const auto write = [&](bool interrupted) {
    Json json = document("align_pairs", common, {{"pairs", {{"path", list}}}}, recorded);
    json["interrupted"] = interrupted;
    json["results"] = results;
    write_document(json, common);
  };
  std::size_t trusted = 0;
  try {
    // At once, and not when the pairs at work have stopped, which may come too late. A pipe may block for ever.
    const std::stop_callback on_interrupt(interrupt_requests(), [&]() noexcept {
      const std::lock_guard lock(mutex);
      if (common.json_path == "-") return;
      try {
        write(true);
      } catch (const std::exception&) {  // the program ends anyway
      }
    });
    executor.in_order(
        pairs.size(), 2 * std::size_t{executor.threads()},
        [&](std::size_t i) { return aligned(pairs[i], each, gravity, maps); },
        [&](std::size_t i, const PairResult& found) {
          const auto& [source, target] = pairs[i];
          Json json = found.result ? to_json(*found.result, HistoryDetail::kNone)
                                   : Json{{"status", "failed"}, {"reason", found.error}};
          json["source"] = source;
          json["target"] = target;
          {
            const std::lock_guard lock(mutex);
            results.push_back(std::move(json));
          }
          std::string line = fmt::format("{} -> {}: ", source, target);
          if (found.result) {
            const Alignment& alignment = found.result->alignment;
            trusted += has_answer(alignment) ? 1 : 0;
            line += status_of(alignment);
            if (alignment.probability) line += " " + probability_text(*alignment.probability);
            if (!has_answer(alignment)) line += ": " + alignment.reason;
          } else {
            line += "failed: " + found.error;
          }
          console.print(line + "\n");
          std::fflush(stdout);  // for who follows a file
          if (progress) {
            progress(static_cast<double>(i + 1) / static_cast<double>(pairs.size()));
          }
        });
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCancelled) throw;
    console.print("interrupted: {} of {} pairs were tried, {} aligned\n", results.size(),
                  pairs.size(), trusted);
    write(true);
    throw;
  }
  console.print("{} of {} pairs aligned\n", trusted, pairs.size());
  if (trusted < pairs.size()) {
    console.print("  hint: Align one of the others alone, which shows its candidates and hints.\n");
  }
  write(false);
  return trusted == pairs.size() ? kDone : kNoTrustworthyAlignment;
}

}  // namespace cairn::cli

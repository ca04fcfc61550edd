// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cerrno>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "cairn/core/detail/csv.hpp"
#include "cairn/core/detail/file_lock.hpp"
#include "cairn/core/detail/output_folder.hpp"
#include "cairn/core/detail/processor.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/file.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/experiments/detail/runs_file.hpp"
#include "cairn/experiments/study.hpp"
#include "cairn/geometry/detail/centroid.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kIdentity = "study.txt";
constexpr std::string_view kRuns = "runs.csv";
constexpr std::string_view kTimings = "timings.csv";
constexpr std::string_view kProcessors = "processors.txt";
constexpr std::string_view kLock = ".study.cairn-unfinished";

[[noreturn]] void fail(const fs::path& path, std::string_view what) {
  throw Error(ErrorKind::kStorage, path.string(),
              fmt::format("{}: {}", what, std::generic_category().message(errno)), "");
}

// Identifies the runs of a folder. The first lines differ between shards.
struct Identity {
  Shard shard;
  std::size_t runs = 0;  // of the shard
  std::string study;     // the same for all shards

  std::string text() const {
    return fmt::format("cairn study 1\nshard {} of {}\nruns {}\n{}", shard.index, shard.count, runs,
                       study);
  }
};

Identity identity_of(const StudyPlan& plan, const Shard& shard,
                     const std::vector<std::string>& inputs) {
  Identity identity{shard, shard.end(plan.size()) - shard.begin(plan.size()),
                    canonical_text(plan.study())};
  for (const std::string& input : inputs) identity.study += input + "\n";
  return identity;
}

Identity read_identity(const fs::path& folder) {
  const fs::path path = folder / kIdentity;
  const std::string text = read_file(path);
  std::vector<std::string> lines;
  std::size_t begin = 0;
  for (int i = 0; i < 3; ++i) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) break;
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  Identity identity;
  const auto number = [](std::string_view word) { return parse_unsigned(word).value_or(0); };
  if (lines.size() == 3 && lines[0] == "cairn study 1" && lines[1].starts_with("shard ") &&
      lines[2].starts_with("runs ")) {
    const std::size_t of = lines[1].find(" of ");
    if (of != std::string::npos) {
      identity.shard.index = number(std::string_view(lines[1]).substr(6, of - 6));
      identity.shard.count = number(std::string_view(lines[1]).substr(of + 4));
      identity.runs = number(std::string_view(lines[2]).substr(5));
      identity.study = text.substr(begin);
      if (identity.text() == text) return identity;
    }
  }
  throw Error(ErrorKind::kInput, path.string(), "is not what a study writes",
              "the folder of a study");
}

// The first line in which two texts differ, of each.
std::pair<std::string, std::string> first_difference(std::string_view a, std::string_view b) {
  for (;;) {
    const std::string_view line_a = a.substr(0, a.find('\n'));
    const std::string_view line_b = b.substr(0, b.find('\n'));
    if (line_a != line_b || a.empty() || b.empty())
      return {std::string(line_a), std::string(line_b)};
    a.remove_prefix(std::min(line_a.size() + 1, a.size()));
    b.remove_prefix(std::min(line_b.size() + 1, b.size()));
  }
}

void require_same(const fs::path& folder, const std::string& found, const std::string& expected) {
  if (found == expected) return;
  const auto [there, here] = first_difference(found, expected);
  throw Error(ErrorKind::kInput, (folder / kIdentity).string(),
              fmt::format("holds the runs of another study: {}", printable(there)),
              fmt::format("{}, or a new folder", printable(here)));
}

// What cannot be looked at is there: whoever opens it says why.
bool is_there(const fs::path& path) {
  std::error_code failure;
  return fs::exists(path, failure) || failure;
}

// The kinds of processor that a folder names, one a line.
std::set<std::string> read_processors(const fs::path& folder) {
  std::set<std::string> kinds;
  const fs::path path = folder / kProcessors;
  if (!is_there(path)) return kinds;
  std::istringstream lines(read_file(path));
  for (std::string line; std::getline(lines, line);) kinds.insert(line);
  return kinds;
}

void write_processors(const fs::path& folder, const std::set<std::string>& kinds) {
  write_file(folder / kProcessors, [&](const ByteSink& sink) {
    for (const std::string& kind : kinds) sink(kind + "\n");
  });
}

// The rows that both tables hold.
// @throws Error (input) if a row is not the study's run of its place
std::size_t matching_rows(const std::string& runs_text, const std::string& name,
                          std::size_t timings, const StudyPlan& plan, const Shard& shard) {
  const std::vector<TrialResult> runs = parse_runs(runs_text, name);
  const std::size_t rows = std::min(runs.size(), timings);
  const std::size_t begin = shard.begin(plan.size());
  const std::size_t most = shard.end(plan.size()) - begin;
  reject_if(rows > most, name, fmt::format("{} rows", rows), fmt::format("at most {}", most));
  for (std::size_t i = 0; i < rows; ++i) {
    if (runs[i].trial == plan.trial(begin + i)) continue;
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", name, i + 2),
                "is not the study's run of this place", "the rows as they were written");
  }
  return rows;
}

}  // namespace

// Parts of StudyFolder, which no unity build may see in an unnamed namespace.
namespace detail {

// Held by the process that writes a folder, from before it reads what is there.
class FolderLock {
 public:
  explicit FolderLock(const fs::path& folder) : file_(folder / kLock, true) { file_.require(); }
  ~FolderLock() {
    std::error_code ignored;
    fs::remove(file_.path(), ignored);
  }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  FileLock file_;
};

// A table as it was read, up to the first row that is not sound.
struct SoundTable {
  SoundTable(const fs::path& path, const std::string& header) : text(read_file(path)) {
    const std::size_t sound = sound_size(text, header, path.string());
    is_whole = sound == text.size();
    text.resize(sound);
    rows = detail::parse_csv(text, path.string());
  }

  std::size_t runs() const { return rows.empty() ? 0 : rows.size() - 1; }

  std::string text;
  std::vector<detail::CsvRow> rows = {};  // the header is the first
  bool is_whole = false;                  // nothing follows
};

// A table that is only ever appended to.
class RowFile {
 public:
  explicit RowFile(fs::path path)
      : path_(std::move(path)),
        descriptor_(::open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644)) {
    if (descriptor_ < 0) fail(path_, "cannot be written");
  }
  ~RowFile() { ::close(descriptor_); }
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;

  const fs::path& path() const { return path_; }

  // Reads what is there; begins with the header if that is not.
  SoundTable read(const std::string& header) const {
    SoundTable table(path_, header);
    if (!table.rows.empty()) return table;
    truncate(0);
    append(header);
    sync();  // a row is never without the header
    return {path_, header};
  }

  void append(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(path_, "cannot be written");
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }

  void sync() const {
    if (::fdatasync(descriptor_) != 0) fail(path_, "cannot be written");
  }

  void truncate(std::size_t size) const {
    if (::ftruncate(descriptor_, static_cast<off_t>(size)) != 0) fail(path_, "cannot be cut");
  }

 private:
  fs::path path_;
  int descriptor_;
};

}  // namespace detail

void Shard::validate() const {
  if (index >= 1 && index <= count) return;
  throw Error(ErrorKind::kMisuse, "Shard", fmt::format("{}/{}", index, count),
              "i/n with i from 1 to n");
}

struct StudyFolder::Files {
  std::unique_ptr<detail::FolderLock> lock;
  StudyPlan plan;
  Shard shard;
  detail::RowFile runs;
  detail::RowFile timings;
};

StudyFolder::StudyFolder(const fs::path& folder, const StudyPlan& plan, const Shard& shard,
                         const std::vector<std::string>& inputs) {
  shard.validate();
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw Error(ErrorKind::kStorage, folder.string(), error.message(), "");
  auto lock = std::make_unique<detail::FolderLock>(folder);
  const Identity identity = identity_of(plan, shard, inputs);
  const fs::path path = folder / kIdentity;
  if (is_there(path)) {
    require_same(folder, read_identity(folder).text(), identity.text());
  } else {
    for (const std::string_view name : {kRuns, kTimings}) {
      if (!is_there(folder / name)) continue;
      throw Error(ErrorKind::kInput, (folder / name).string(), "is there, but no study.txt",
                  "a new folder");
    }
    write_file(path, [&](const ByteSink& sink) { sink(identity.text()); });
  }
  files_.reset(new Files{std::move(lock), plan, shard, detail::RowFile(folder / kRuns),
                         detail::RowFile(folder / kTimings)});
  const detail::SoundTable runs = files_->runs.read(runs_header());
  const detail::SoundTable timings = files_->timings.read(timings_header());
  done_ = matching_rows(runs.text, files_->runs.path().string(), timings.runs(), plan, shard);
  files_->runs.truncate(runs.rows[done_].end);
  files_->timings.truncate(timings.rows[done_].end);

  std::set<std::string> processors = read_processors(folder);
  if (done_ == 0) processors.clear();
  if (processors.insert(detail::processor_kind()).second) write_processors(folder, processors);
  processors_.assign(processors.begin(), processors.end());
}

StudyFolder::~StudyFolder() = default;

void StudyFolder::append(const TrialResult& run) {
  const std::size_t next = files_->shard.begin(files_->plan.size()) + done_;
  refuse_if(next >= files_->shard.end(files_->plan.size()) || run.trial != files_->plan.trial(next),
            "StudyFolder.append", "not the next run", "runs in their order");
  files_->runs.append(runs_row(run));
  files_->timings.append(timings_row(run));
  ++done_;
}

void StudyFolder::sync() {
  files_->runs.sync();
  files_->timings.sync();
}

void run_study(const StudyPlan& plan, const Shard& shard, StudyFolder& folder,
               const std::function<MapPair(const StudyPair&)>& load_pair,
               const std::function<void(const TrialResult& run)>& each_run,
               const Execution& execution) {
  shard.validate();
  const Study& study = plan.study();
  const std::size_t first = shard.begin(plan.size());
  const std::size_t end = shard.end(plan.size());
  const bool with_clouds = std::any_of(study.methods.begin(), study.methods.end(), needs_clouds);
  for (std::size_t next = first + folder.done(); next < end;) {
    const std::size_t pair_number = plan.pair_of(next);
    const std::size_t pair_end = std::min(end, (pair_number + 1) * plan.runs_per_pair());
    const MapPair pair = load_pair(study.pairs[pair_number]);
    std::map<std::string, PairPoints> points;
    for (const std::string& name : study.strategies) {
      points.emplace(name, pair_points(pair, strategy_named(name), study.points, with_clouds));
    }
    const Eigen::Vector3d centre = centroid(points.at(study.strategies.front()).source.positions);
    constexpr std::size_t kAhead = 64;
    execution.executor.in_order(
        pair_end - next, kAhead,
        [&](std::size_t i) {
          Trial trial = plan.trial(next + i);
          const Rigid3 initial = displaced(trial.initial, pair.truth, centre);
          const PairPoints& strategy_points = points.at(trial.strategy);
          // On one thread, because the runs are spread over them.
          return run_trial(std::move(trial), strategy_points, initial, pair.truth, study.align,
                           {.stop = execution.stop, .seed = plan.seed_of(next + i)});
        },
        [&](std::size_t, const TrialResult& run) {
          folder.append(run);
          if (each_run) each_run(run);
          if (execution.progress) {
            execution.progress(static_cast<double>(folder.done()) /
                               static_cast<double>(end - first));
          }
        });
    next = pair_end;
    folder.sync();
  }
}

bool is_complete(const fs::path& folder, const StudyPlan& plan, const Shard& shard,
                 const std::vector<std::string>& inputs) {
  shard.validate();
  if (!is_there(folder / kIdentity)) return false;
  const Identity identity = identity_of(plan, shard, inputs);
  require_same(folder, read_identity(folder).text(), identity.text());
  if (!is_there(folder / kRuns) || !is_there(folder / kTimings)) return false;
  const detail::SoundTable runs(folder / kRuns, runs_header());
  const detail::SoundTable timings(folder / kTimings, timings_header());
  const bool is_whole = runs.is_whole && timings.is_whole && runs.runs() == identity.runs &&
                        timings.runs() == identity.runs;
  if (!is_whole) return false;
  matching_rows(runs.text, (folder / kRuns).string(), timings.runs(), plan, shard);
  return true;
}

void require_runs_of(const fs::path& folder, const Study& study, std::string_view name) {
  const std::string runs = read_identity(folder).study;
  const std::string given = canonical_text(study);
  // The inputs follow, of which a study knows only the paths.
  const std::string rest = runs.starts_with(given) ? runs.substr(given.size()) : runs;
  if (rest.empty() || (rest != runs && rest.starts_with("input "))) return;
  const auto [there, here] = first_difference(runs, given);
  throw Error(ErrorKind::kInput, std::string(name),
              fmt::format("is not the study of the runs beside it: {}", printable(here)),
              fmt::format("{}, as {} says", printable(there), kIdentity));
}

std::vector<std::string> merge_study(const std::vector<fs::path>& shards, const fs::path& merged) {
  if (shards.empty()) throw Error(ErrorKind::kMisuse, "merge", "no folder", "the shards' folders");
  std::map<std::size_t, std::pair<fs::path, Identity>> parts;
  std::optional<Identity> first;
  for (const fs::path& folder : shards) {
    Identity identity = read_identity(folder);
    if (!first) first = identity;
    require_same(folder, identity.study, first->study);
    reject_if(identity.shard.count != first->shard.count, folder.string(),
              fmt::format("is one of {} shards", identity.shard.count),
              fmt::format("one of {}", first->shard.count));
    const std::size_t index = identity.shard.index;
    const auto [place, added] = parts.emplace(index, std::pair(folder, std::move(identity)));
    reject_if(!added, folder.string(),
              fmt::format("is shard {} as {} is", place->first, place->second.first.string()),
              "each shard once");
  }
  std::size_t total = 0;
  for (std::size_t i = 1; i <= first->shard.count; ++i) {
    reject_if(!parts.contains(i), shards.front().parent_path().string(),
              fmt::format("shard {} of {} is missing", i, first->shard.count), "all shards");
    total += parts.at(i).second.runs;
  }

  std::map<std::string_view, std::string> tables = {{kRuns, runs_header()},
                                                    {kTimings, timings_header()}};
  for (auto& [name, text] : tables) {
    const std::string header = text;
    for (const auto& [index, part] : parts) {
      const fs::path path = part.first / name;
      const detail::SoundTable table(path, header);
      if (table.runs() != part.second.runs || !table.is_whole) {
        throw Error(ErrorKind::kInput, path.string(), fmt::format("{} sound rows", table.runs()),
                    fmt::format("{}; run the shard again to complete it", part.second.runs));
      }
      text += table.text.substr(header.size());
    }
  }
  std::error_code error;
  if (merged.has_parent_path()) fs::create_directories(merged.parent_path(), error);
  if (error) throw Error(ErrorKind::kStorage, merged.string(), error.message(), "");
  detail::OutputFolder output(merged);
  for (const auto& [name, text] : tables) {
    write_file(output.unfinished() / name, [&](const ByteSink& sink) { sink(text); });
  }
  const Identity whole{Shard{}, total, first->study};
  write_file(output.unfinished() / kIdentity, [&](const ByteSink& sink) { sink(whole.text()); });
  std::set<std::string> processors;
  for (const fs::path& folder : shards) processors.merge(read_processors(folder));
  write_processors(output.unfinished(), processors);
  output.commit();
  return {processors.begin(), processors.end()};
}

}  // namespace cairn

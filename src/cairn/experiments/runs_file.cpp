// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/experiments/detail/runs_file.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/core/detail/csv.hpp"
#include "cairn/core/detail/hash.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/experiments/run.hpp"
#include "cairn/geometry/angles.hpp"

namespace cairn {
namespace {

// Columns.
constexpr std::string_view kKeys =
    "pair,experiment,number,method,strategy,k,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg";
constexpr std::string_view kResults =
    "status,stop_reason,iterations,cycle_length,initial_score_m2,score_m2,tx,ty,tz,qw,qx,qy,qz,"
    "rotation_error_deg,translation_error_m";
constexpr std::string_view kChecksum = "checksum";
constexpr std::size_t kChecksumSize = 8;

constexpr std::array kStatuses = {RegistrationStatus::kConverged, RegistrationStatus::kStopped,
                                  RegistrationStatus::kFailed, RegistrationStatus::kCancelled};
constexpr std::array kStopReasons = {StopReason::kMseChange,      StopReason::kNoMotion,
                                     StopReason::kFixedPoint,     StopReason::kCycle,
                                     StopReason::kIterationLimit, StopReason::kTimeLimit,
                                     StopReason::kTooFewMatches,  StopReason::kCancelled};

void add_key(detail::Csv& row, const Trial& trial) {
  const Displacement& d = trial.initial;
  row << trial.pair << trial.experiment << std::uint64_t{trial.number} << to_string(trial.method)
      << trial.strategy << std::uint64_t{trial.k} << d.x_m << d.y_m << d.z_m << d.roll_deg
      << d.pitch_deg << d.yaw_deg;
}

// The row with its checksum and line end.
std::string sealed(const detail::Csv& row) {
  const std::string before = row.text() + ",";
  return before + detail::row_checksum(before) + "\n";
}

// Whether a text that ends with LF ends with the checksum of what is before.
bool is_sealed(std::string_view row) {
  if (row.size() < kChecksumSize + 1) return false;
  const std::size_t size = row.size() - kChecksumSize - 1;
  return row.substr(size, kChecksumSize) == detail::row_checksum(row.substr(0, size));
}

// The cells of one row, one after another.
class RowReader {
 public:
  RowReader(const detail::CsvRow& row, const std::vector<std::string>& columns,
            std::string_view name)
      : row_(row), columns_(columns), name_(name) {}

  const std::string& text() { return row_.cells[next_++]; }

  bool blank() const { return row_.cells[next_].empty(); }
  void skip(std::size_t cells) { next_ += cells; }

  double number() {
    const auto value = parse_number(text());
    if (!value) refuse("a number");
    return *value;
  }

  std::optional<double> number_or_nothing() {
    if (!blank()) return number();
    skip(1);
    return {};
  }

  std::uint64_t whole(std::uint64_t largest) {
    const auto value = parse_unsigned(text());
    if (!value || *value > largest) refuse(fmt::format("a whole number of at most {}", largest));
    return *value;
  }

  template <class Value, std::size_t size>
  Value named(const std::array<Value, size>& values) {
    const std::string& name = text();
    std::vector<std::string_view> names;
    for (const Value value : values) {
      if (to_string(value) == name) return value;
      names.push_back(to_string(value));
    }
    refuse(fmt::format("{}", fmt::join(names, ", ")));
  }

 private:
  [[noreturn]] void refuse(const std::string& expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}: {}", name_, row_.line, columns_[next_ - 1]),
                printable(row_.cells[next_ - 1]), expected);
  }

  const detail::CsvRow& row_;
  const std::vector<std::string>& columns_;
  std::string_view name_;
  std::size_t next_ = 0;
};

TrialResult parse_run(RowReader row) {
  constexpr std::uint64_t kMost = 1'000'000'000;
  TrialResult run;
  Trial& trial = run.trial;
  trial.pair = row.text();
  trial.experiment = row.text();
  trial.number = row.whole(kMost);
  trial.method = row.named(kMethods);
  trial.strategy = row.text();
  trial.k = row.whole(kMost);
  for (double Displacement::*const part :
       {&Displacement::x_m, &Displacement::y_m, &Displacement::z_m, &Displacement::roll_deg,
        &Displacement::pitch_deg, &Displacement::yaw_deg}) {
    trial.initial.*part = row.number();
  }
  run.status = row.named(kStatuses);
  run.stop_reason = row.named(kStopReasons);
  run.iterations = static_cast<int>(row.whole(kMost));
  if (!row.blank()) {
    run.cycle_length = static_cast<int>(row.whole(kMost));
  } else {
    row.skip(1);
  }
  run.initial_score = row.number_or_nothing();
  run.score = row.number_or_nothing();
  if (row.blank()) {
    row.skip(7);
  } else {
    std::array<double, 7> pose;
    for (double& number : pose) number = row.number();
    run.target_from_source = Rigid3(Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]),
                                    Eigen::Vector3d(pose[0], pose[1], pose[2]));
  }
  if (!row.blank()) {
    const double rotation = radians(row.number());
    run.error = PoseError{rotation, row.number()};
  }
  return run;
}

// Bytes that were not on the disk when the power failed are missing or zero.
bool is_lost(std::string_view start, std::string_view header) {
  return std::equal(start.begin(), start.end(), header.begin(),
                    [](char found, char written) { return found == written || found == '\0'; });
}

}  // namespace

std::string runs_header() {
  return fmt::format("{},{},{}\n", kKeys, kResults, kChecksum);
}

std::string runs_row(const TrialResult& run) {
  detail::Csv row;
  add_key(row, run.trial);
  row << to_string(run.status) << to_string(run.stop_reason)
      << static_cast<std::uint64_t>(run.iterations);
  if (run.cycle_length) {
    row << static_cast<std::uint64_t>(*run.cycle_length);
  } else {
    row << "";
  }
  row << run.initial_score << run.score;
  if (run.target_from_source) {
    const Eigen::Vector3d& t = run.target_from_source->translation();
    const Eigen::Quaterniond q = run.target_from_source->quaternion();
    row << t.x() << t.y() << t.z() << q.w() << q.x() << q.y() << q.z();
  } else {
    for (int i = 0; i < 7; ++i) row << "";
  }
  if (run.error) {
    row << degrees(run.error->rotation_rad) << run.error->translation;
  } else {
    row << ""
        << "";
  }
  return sealed(row);
}

std::string timings_header() {
  return fmt::format("{},duration_s,{}\n", kKeys, kChecksum);
}

std::string timings_row(const TrialResult& run) {
  detail::Csv row;
  add_key(row, run.trial);
  row << run.duration_s;
  return sealed(row);
}

std::string detail::row_checksum(std::string_view before) {
  return to_string(hash_of(before)).substr(0, kChecksumSize);
}

std::size_t detail::sound_size(std::string_view table, std::string_view header,
                               std::string_view name) {
  if (!table.starts_with(header)) {
    if (is_lost(table.substr(0, header.size()), header)) return 0;
    throw Error(ErrorKind::kInput, fmt::format("{}:1", name),
                printable(table.substr(0, table.find('\n'))),
                std::string(header.substr(0, header.size() - 1)));
  }
  std::size_t sound = header.size();
  // A row may span several lines, between quotes.
  for (std::size_t end = table.find('\n', sound); end != std::string_view::npos;
       end = table.find('\n', end + 1)) {
    const std::string_view row = table.substr(sound, end + 1 - sound);
    if (std::count(row.begin(), row.end(), '"') % 2 != 0) continue;
    if (!is_sealed(row)) break;
    sound = end + 1;
  }
  return sound;
}

std::vector<TrialResult> parse_runs(std::string_view text, std::string_view name) {
  const std::string header = runs_header();
  const std::vector<detail::CsvRow> rows = detail::parse_csv(text, name);
  const std::vector<std::string> columns = detail::parse_csv(header, name).front().cells;
  reject_if(rows.empty() || rows[0].cells != columns, fmt::format("{}:1", name),
            "no header of a table of runs", header.substr(0, header.size() - 1));
  std::vector<TrialResult> runs;
  runs.reserve(rows.size() - 1);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].cells.size() != columns.size()) {
      throw Error(ErrorKind::kInput, fmt::format("{}:{}", name, rows[i].line),
                  fmt::format("{} cells", rows[i].cells.size()), fmt::format("{}", columns.size()));
    }
    if (!is_sealed(text.substr(rows[i - 1].end, rows[i].end - rows[i - 1].end))) {
      throw Error(ErrorKind::kInput, fmt::format("{}:{}: {}", name, rows[i].line, kChecksum),
                  printable(rows[i].cells.back()), "the checksum of the row; the row is damaged");
    }
    runs.push_back(parse_run(RowReader(rows[i], columns, name)));
  }
  return runs;
}

}  // namespace cairn

// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <functional>
#include <limits>
#include <set>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#ifdef CAIRN_HAS_YAML
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>
#endif

#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/experiments/study.hpp"

namespace cairn {

#ifndef CAIRN_HAS_YAML

Study parse_study(const std::string& /*yaml*/, std::string_view name) {
  throw Error(ErrorKind::kInput, name, "this build cannot read studies", "a build with yaml-cpp");
}

#else

namespace {

constexpr std::size_t kMost = 1'000'000;  // of whatever a study counts
constexpr std::uint64_t kMostSeed = std::numeric_limits<std::uint64_t>::max();

// One value of the file, with what its messages have to name.
class Entry {
 public:
  Entry(const YAML::Node& node, std::string file, std::string key)
      : node_(node), file_(std::move(file)), key_(std::move(key)) {}

  [[noreturn]] void refuse(std::string_view what, std::string_view expected) const {
    const YAML::Mark mark = node_.Mark();
    throw Error(ErrorKind::kInput,
                mark.is_null() ? fmt::format("{}: {}", file_, key_)
                               : fmt::format("{}:{}: {}", file_, mark.line + 1, key_),
                what, expected);
  }

  std::string text() const {
    if (!node_.IsScalar() || node_.Scalar().empty()) refuse("no text", "text");
    return node_.Scalar();
  }

  double number(double low, double high) const {
    const auto value = node_.IsScalar() ? parse_number(node_.Scalar()) : std::nullopt;
    if (!value || *value < low || *value > high) {
      refuse(node_.IsScalar() ? printable(node_.Scalar()) : "no number",
             fmt::format("a number from {:g} to {:g}", low, high));
    }
    return *value;
  }

  std::uint64_t whole(std::uint64_t low, std::uint64_t high) const {
    const auto value = node_.IsScalar() ? parse_unsigned(node_.Scalar()) : std::nullopt;
    if (!value || *value < low || *value > high) {
      refuse(node_.IsScalar() ? printable(node_.Scalar()) : "no number",
             fmt::format("a whole number from {} to {}", low, high));
    }
    return *value;
  }

  std::vector<Entry> list() const {
    if (!node_.IsSequence() || node_.size() == 0) refuse("no list", "[one, or, more]");
    if (node_.size() > kMost) refuse("too long a list", fmt::format("at most {}", kMost));
    std::vector<Entry> entries;
    for (std::size_t i = 0; i < node_.size(); ++i) {
      entries.emplace_back(node_[i], file_, fmt::format("{}[{}]", key_, i));
    }
    return entries;
  }

  // Calls the handler of each key that is there.
  using Handlers = std::vector<std::pair<std::string_view, std::function<void(const Entry&)> > >;
  void read(const Handlers& handlers, std::initializer_list<std::string_view> required = {}) const {
    std::vector<std::string_view> names;
    for (const auto& [name, handler] : handlers) names.push_back(name);
    if (!node_.IsMap()) refuse("no keys", fmt::format("{}", fmt::join(names, ", ")));
    std::set<std::string> seen;
    for (const auto& item : node_) {
      if (!item.first.IsScalar()) refuse("a key that is no text", "text");
      const std::string name = item.first.Scalar();
      const Entry entry(item.second, file_, key_.empty() ? name : key_ + "." + name);
      const auto handler =
          std::find_if(handlers.begin(), handlers.end(),
                       [&](const auto& candidate) { return candidate.first == name; });
      if (handler == handlers.end()) {
        Entry(item.first, file_, key_.empty() ? "study" : key_)
            .refuse(printable(name) + " is no key", fmt::format("{}", fmt::join(names, ", ")));
      }
      if (!seen.insert(name).second) entry.refuse("given twice", "once");
      handler->second(entry);
    }
    for (const std::string_view name : required) {
      if (!seen.contains(std::string(name))) {
        refuse(fmt::format("{} is missing", name), fmt::format("{}: ...", name));
      }
    }
  }

 private:
  YAML::Node node_;
  std::string file_;
  std::string key_;
};

// Scans a file before it is converted to nodes. Refuses aliases, because each repeats all nodes of its
// anchor, so that the file's size would not bound their number.
class BoundsCheck final : public YAML::EventHandler {
 public:
  explicit BoundsCheck(std::string_view file) : file_(file) {}

  void OnDocumentStart(const YAML::Mark& /*mark*/) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t /*anchor*/) override { count(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t /*anchor*/) override {
    refuse(mark, "an alias", "values written out");
  }
  void OnScalar(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t /*anchor*/,
                const std::string& /*value*/) override {
    count(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& /*tag*/,
                       YAML::anchor_t /*anchor*/, YAML::EmitterStyle::value /*style*/) override {
    count(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark, const std::string& /*tag*/, YAML::anchor_t /*anchor*/,
                  YAML::EmitterStyle::value /*style*/) override {
    count(mark);
  }
  void OnMapEnd() override {}

 private:
  void count(const YAML::Mark& mark) {
    constexpr std::size_t kMostValues = 100'000;
    if (++values_ > kMostValues) {
      refuse(mark, "too many values", fmt::format("at most {} in a study", kMostValues));
    }
  }
  [[noreturn]] void refuse(const YAML::Mark& mark, std::string_view what,
                           std::string_view expected) const {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", file_, mark.line + 1), what, expected);
  }

  std::string_view file_;
  std::size_t values_ = 0;
};

// Handlers that set a field.
auto number_into(auto& field, double low, double high) {
  return [&field, low, high](const Entry& entry) { field = entry.number(low, high); };
}
template <class Whole>
auto whole_into(Whole& field, std::uint64_t low, std::uint64_t high) {
  return [&field, low, high](const Entry& entry) {
    field = static_cast<Whole>(entry.whole(low, high));
  };
}
auto text_into(auto& field) {
  return [&field](const Entry& entry) { field = entry.text(); };
}

std::string parse_name(const Entry& entry) {
  std::string name = entry.text();
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  });
  if (!plain || name.front() == '.' || name.size() > 100) {
    entry.refuse(printable(name), "at most 100 letters, digits, '-', '_' and '.', not first a '.'");
  }
  return name;
}

// A place with several seeds is as many pairs, "desk_1", "desk_2" and so on.
void parse_simulation(const Entry& entry, const std::string& name, std::vector<StudyPair>& pairs) {
  PairSimulation simulation;
  std::vector<std::uint64_t> seeds = {1};
  entry.read({{"environment", text_into(simulation.environment)},
              {"seeds",
               [&](const Entry& e) {
                 seeds.clear();
                 for (const Entry& seed : e.list()) seeds.push_back(seed.whole(0, kMostSeed));
               }},
              {"path", text_into(simulation.path)},
              {"frames", whole_into(simulation.frames, 10, kMost)},
              {"rate_hz", number_into(simulation.rate_hz, 0.1, 1000.0)},
              {"changed", number_into(simulation.changed, 0.0, 1.0)}},
             {"environment"});
  for (const std::uint64_t seed : seeds) {
    simulation.seed = seed;
    pairs.push_back({seeds.size() == 1 ? name : fmt::format("{}_{}", name, seed), simulation});
  }
}

void parse_pair(const Entry& entry, std::vector<StudyPair>& pairs) {
  std::string name;
  PairFiles files;
  std::optional<Entry> simulation;
  entry.read({{"name", [&](const Entry& e) { name = parse_name(e); }},
              {"source", text_into(files.source)},
              {"target", text_into(files.target)},
              {"truth", text_into(files.truth)},
              {"simulate", [&](const Entry& e) { simulation = e; }}},
             {"name"});
  const bool any_file = !files.source.empty() || !files.target.empty() || files.truth;
  if (simulation) {
    if (any_file) entry.refuse("both files and a simulation", "one of them");
    parse_simulation(*simulation, name, pairs);
    return;
  }
  if (files.source.empty() || files.target.empty()) {
    entry.refuse("no maps", "source and target, or simulate");
  }
  pairs.push_back({name, std::move(files)});
}

void parse_range(const Entry& entry, double Displacement::*part, double most,
                 DisplacementRange& range) {
  const std::vector<Entry> bounds = entry.list();
  if (bounds.size() != 2) entry.refuse(fmt::format("{} numbers", bounds.size()), "[low, high]");
  range.low.*part = bounds[0].number(-most, most);
  range.high.*part = bounds[1].number(-most, most);
  if (range.low.*part > range.high.*part)
    entry.refuse("the low end is above the high one", "[low, high]");
}

void parse_initial(const Entry& entry, Study& study) {
  const auto range = [&](double Displacement::*part, double most) {
    return [&study, part, most](const Entry& e) { parse_range(e, part, most, study.initial); };
  };
  constexpr double kFarthest = 1e6;
  entry.read({{"count", whole_into(study.initial_count, 1, kMost)},
              {"x_m", range(&Displacement::x_m, kFarthest)},
              {"y_m", range(&Displacement::y_m, kFarthest)},
              {"z_m", range(&Displacement::z_m, kFarthest)},
              {"roll_deg", range(&Displacement::roll_deg, 180.0)},
              {"pitch_deg", range(&Displacement::pitch_deg, 180.0)},
              {"yaw_deg", range(&Displacement::yaw_deg, 180.0)}});
}

// Values of which none may be given twice.
template <class Value, class Read>
void parse_distinct(const Entry& entry, std::string_view what, std::vector<Value>& values,
                    const Read& read) {
  values.clear();
  for (const Entry& e : entry.list()) {
    Value value = read(e);
    if (std::count(values.begin(), values.end(), value) > 0) {
      e.refuse(printable(e.text()) + " is given twice", fmt::format("each {} once", what));
    }
    values.push_back(std::move(value));
  }
}

Method parse_method(const Entry& entry) {
  const std::string name = entry.text();
  std::vector<std::string_view> names;
  for (const Method candidate : kMethods) {
    if (to_string(candidate) == name) return candidate;
    names.push_back(to_string(candidate));
  }
  entry.refuse(printable(name), fmt::format("{}", fmt::join(names, ", ")));
}

std::string parse_strategy(const Entry& entry) {
  std::string name = entry.text();
  try {
    strategy_named(name);
  } catch (const Error&) {
    entry.refuse(printable(name), fmt::format("base, {}", fmt::join(metric_names(), ", ")));
  }
  return name;
}

void parse_align(const Entry& entry, Study& study) {
  entry.read({{"max_iterations", whole_into(study.align.max_iterations, 1, kMost)},
              {"max_distance_m", number_into(study.align.max_distance, 1e-9, 1e9)},
              {"min_observations", whole_into(study.points.min_observations, 0, kMost)}});
}

void parse_success(const Entry& entry, Study& study) {
  entry.read({{"rotation_deg", number_into(study.success.rotation_deg, 1e-9, 180.0)},
              {"translation_m", number_into(study.success.translation_m, 1e-9, 1e9)},
              {"score_m2", number_into(study.success_score, 1e-12, 1e12)}});
}

void parse_statistics(const Entry& entry, Study& study) {
  entry.read({{"confidence_level", number_into(study.confidence_level, 0.5, 0.9999)},
              {"equivalence_margin", number_into(study.equivalence_margin, 1e-6, 1.0)}});
}

}  // namespace

Study parse_study(const std::string& yaml, std::string_view name) {
  YAML::Node root;
  try {
    std::istringstream text(yaml);
    BoundsCheck bounds(name);
    YAML::Parser(text).HandleNextDocument(bounds);
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    throw Error(ErrorKind::kInput, fmt::format("{}:{}", name, error.mark.line + 1), error.msg,
                "YAML");
  }
  Study study;
  const Entry entry(root, std::string(name), "");
  const Entry top(root, std::string(name), "study");
  if (!root.IsMap()) top.refuse("no keys", "name, pairs, initial_poses, ...");
  entry.read(
      {{"name", [&](const Entry& e) { study.name = parse_name(e); }},
       {"seed", whole_into(study.seed, 0, kMostSeed)},
       {"pairs",
        [&](const Entry& e) {
          for (const Entry& pair : e.list()) parse_pair(pair, study.pairs);
          std::set<std::string> names;
          for (const StudyPair& pair : study.pairs) {
            if (!names.insert(pair.name).second) {
              e.refuse(printable(pair.name) + " names two pairs", "a name each");
            }
          }
        }},
       {"initial_poses", [&](const Entry& e) { parse_initial(e, study); }},
       {"methods",
        [&](const Entry& e) { parse_distinct(e, "method", study.methods, parse_method); }},
       {"strategies",
        [&](const Entry& e) { parse_distinct(e, "strategy", study.strategies, parse_strategy); }},
       {"k",
        [&](const Entry& e) {
          parse_distinct(e, "k", study.k, [](const Entry& one) { return one.whole(1, 1000); });
        }},
       {"align", [&](const Entry& e) { parse_align(e, study); }},
       {"success", [&](const Entry& e) { parse_success(e, study); }},
       {"statistics", [&](const Entry& e) { parse_statistics(e, study); }}},
      {"name", "pairs", "initial_poses"});
  return study;
}

#endif

}  // namespace cairn

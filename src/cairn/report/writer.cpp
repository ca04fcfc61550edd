// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <deque>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cairn/core/detail/json_text.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/text.hpp"
#include "cairn/core/version_number.hpp"
#include "cairn/geometry/angles.hpp"
#include "cairn/report/detail/gzip_base64.hpp"
#include "cairn/report/report.hpp"

namespace cairn::report {
namespace {

static_assert(std::endian::native == std::endian::little, "buffers are written as they are");

using Json = nlohmann::ordered_json;

constexpr int kSchemaVersion = 1;
constexpr std::string_view kTitleMark = "<!--CAIRN:TITLE-->";
constexpr std::string_view kDataMark = "<!--CAIRN:DATA-->";

void require(bool valid, std::string_view where, std::string_view what, std::string_view expected) {
  if (!valid) throw Error(ErrorKind::kMisuse, where, what, expected);
}

void require_size(std::size_t size, std::size_t expected, std::string_view where,
                  std::string_view field) {
  require(size == expected, where, fmt::format("{} entries of {}", size, field),
          fmt::format("{}", expected));
}

template <class Item>
std::string_view type_name() {
  if constexpr (std::is_same_v<Item, float>) return "f32";
  if constexpr (std::is_same_v<Item, double>) return "f64";
  constexpr bool kSigned = std::is_signed_v<Item>;
  switch (sizeof(Item)) {
    case 1:
      return kSigned ? "i8" : "u8";
    case 2:
      return kSigned ? "i16" : "u16";
    default:
      return kSigned ? "i32" : "u32";
  }
}

std::size_t size_of(const Buffer& buffer) {
  return std::visit([](const auto& items) { return items.size(); }, buffer);
}

// The binary part of the document. Lists that are equal byte for byte are stored once.
class Buffers {
 public:
  /// @param buffer must live until write()
  Json add(const Buffer& buffer) {
    return std::visit([this](const auto& items) { return this->add_items(std::span(items)); },
                      buffer);
  }
  template <class Item>
  Json add(const std::vector<Item>& items) {
    return add_items(std::span<const Item>(items));
  }
  /// The same, of a list that was made for the report.
  template <class Item>
  Json keep(std::vector<Item> items) {
    kept_.emplace_back(std::move(items));
    return add(kept_.back());
  }

  void write(detail::GzipBase64& out) const {
    constexpr std::string_view kPadding("\0\0\0\0\0\0\0", 7);
    for (const std::string_view part : parts_) {
      out.write(part);
      out.write(kPadding.substr(0, padding(part.size())));
    }
  }

 private:
  static std::size_t padding(std::size_t size) { return (8 - size % 8) % 8; }

  template <class Item>
  Json add_items(std::span<const Item> items) {
    const std::string_view bytes(reinterpret_cast<const char*>(items.data()), items.size_bytes());
    std::size_t offset = 0;
    auto part = parts_.begin();
    for (; part != parts_.end() && *part != bytes; ++part)
      offset += part->size() + padding(part->size());
    if (part == parts_.end()) parts_.push_back(bytes);
    return {{"offset", offset}, {"count", items.size()}, {"type", type_name<Item>()}};
  }

  std::vector<std::string_view> parts_;
  std::deque<Buffer> kept_;
};

// Numbers that are not finite become null; counts are written as integers.
Json to_json(double number) {
  constexpr double kLargestWhole = 9007199254740992.0;
  if (!std::isfinite(number)) return nullptr;
  if (number == std::floor(number) && std::abs(number) <= kLargestWhole) {
    return static_cast<std::int64_t>(number);
  }
  return number;
}

template <std::integral Integer>
Json to_json(Integer number) {
  return number;
}

Json to_json(const std::string& text) {
  return text;
}

template <std::size_t kSize>
Json to_json(const std::array<double, kSize>& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(to_json(value));
  return list;
}

Json to_json(const Eigen::Vector3d& vector) {
  return {to_json(vector.x()), to_json(vector.y()), to_json(vector.z())};
}

Json to_json(const Similarity3& pose) {
  const Matrix4d matrix = pose.matrix();
  Json numbers = Json::array();
  for (int i = 0; i < 16; ++i) numbers.push_back(to_json(matrix(i / 4, i % 4)));
  return numbers;
}

Json to_json(const Scalar& value) {
  if (const auto* const number = std::get_if<double>(&value)) return to_json(*number);
  if (const auto* const text = std::get_if<std::string>(&value)) return *text;
  return nullptr;
}

Json to_json(AxisScale scale) {
  return scale == AxisScale::kLog ? "log" : "linear";
}

template <class Enum, std::size_t kSize>
Json name_of(Enum value, const std::array<const char*, kSize>& names) {
  return names[static_cast<std::size_t>(value)];
}

Json to_json(CellType type) {
  return name_of(type, std::array{"text", "number", "command", "probability"});
}

Json to_json(ImageType type) {
  return name_of(type, std::array{"image/png", "image/jpeg"});
}

Json to_json(LinkUse use) {
  return name_of(use, std::array{"used", "contradicted", "undecided", "ambiguous", "rejected"});
}

Json to_json(LengthUnit unit) {
  return unit == LengthUnit::kMetres ? "m" : "mapunits";
}

Json to_json(Best best) {
  if (best == Best::kNone) return nullptr;
  return best == Best::kLow ? "low" : "high";
}

template <class Value>
Json to_json(const std::optional<Value>& value);
template <class Value>
Json to_json(const std::vector<Value>& values);

// Labels of values, and the numbers of trials behind those of a heat map: null if unknown.
Json to_json(const std::vector<std::string>& labels) {
  return labels.empty() ? Json(nullptr) : Json(labels);
}

Json to_json(const std::vector<std::vector<double>>& rows) {
  if (rows.empty()) return nullptr;
  Json list = Json::array();
  for (const std::vector<double>& row : rows) list.push_back(to_json(row));
  return list;
}

// Of a struct whose members are written as they are, under their own names.
#define CAIRN_REPORT_MEMBER(member) json[#member] = to_json(one.member);
#define CAIRN_REPORT_STRUCT(Struct, ...)                                        \
  Json to_json(const Struct& one) {                                             \
    Json json = Json::object();                                                 \
    NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(CAIRN_REPORT_MEMBER, __VA_ARGS__)) \
    return json;                                                                \
  }

CAIRN_REPORT_STRUCT(Machine, system, processor, threads)
CAIRN_REPORT_STRUCT(Frustum, half_width, half_height)
CAIRN_REPORT_STRUCT(Threshold, value, label)
CAIRN_REPORT_STRUCT(Distribution, name, values, labels)
CAIRN_REPORT_STRUCT(DistributionChart, x_label, y_label, y_scale, threshold, groups)
CAIRN_REPORT_STRUCT(Line, name, x, y)
CAIRN_REPORT_STRUCT(LinesChart, x_label, y_label, y_scale, series)
CAIRN_REPORT_STRUCT(HeatmapPanel, name, values, counts)
CAIRN_REPORT_STRUCT(HeatmapChart, x_label, y_label, value_label, x, y, panels, range)
CAIRN_REPORT_STRUCT(IntervalItem, name, value, low, high)
CAIRN_REPORT_STRUCT(IntervalSeries, name, items)
CAIRN_REPORT_STRUCT(IntervalsChart, x_label, x_scale, series)
CAIRN_REPORT_STRUCT(ScatterSeries, name, x, y, labels)
CAIRN_REPORT_STRUCT(ScatterChart, x_label, y_label, x_scale, y_scale, x_threshold, y_threshold,
                    series)
CAIRN_REPORT_STRUCT(Span, name, start, end, marks)
CAIRN_REPORT_STRUCT(SpanSeries, name, spans)
CAIRN_REPORT_STRUCT(SpansChart, x_label, series)
CAIRN_REPORT_STRUCT(TableColumn, name, unit, type, digits)
CAIRN_REPORT_STRUCT(NetworkGroup, frame, up)
CAIRN_REPORT_STRUCT(NetworkLink, target, source, use, kind, probability, reason, residual,
                    residual_deg)
CAIRN_REPORT_STRUCT(LinkView, target_frame, source_frame, matches)
CAIRN_REPORT_STRUCT(AnswerDirection, translation, rotation, log_scale)

template <class Value>
Json to_json(const std::optional<Value>& value) {
  return value ? to_json(*value) : Json(nullptr);
}

template <class Value>
Json to_json(const std::vector<Value>& values) {
  Json list = Json::array();
  for (const Value& value : values) list.push_back(to_json(value));
  return list;
}

template <class Value>
Json list_or_null(const std::vector<Value>& values) {
  return values.empty() ? Json(nullptr) : to_json(values);
}

Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

Json parsed(const std::string& text, std::string_view where) {
  if (text.empty()) return nullptr;
  std::optional<Json> json = cairn::detail::parse_json<Json>(text, where);
  require(json.has_value(), where, "no JSON", "JSON in UTF-8");
  return std::move(*json);
}

Json to_json(const Provenance& provenance) {
  Json json = {{"command", list_or_null(provenance.command)},
               {"seed", to_json(provenance.seed)},
               {"machine", to_json(provenance.machine)}};
  json["inputs"] = Json::array();
  for (const Input& input : provenance.inputs) {
    json["inputs"].push_back({{"role", input.role},
                              {"path", to_json(input.path)},
                              {"hash", to_json(input.hash)},
                              {"details", parsed(input.details_json, "Input.details_json")}});
  }
  json["options"] = parsed(provenance.options_json, "Provenance.options_json");
  return json;
}

// Low and high word of each.
std::vector<std::uint32_t> words_of(const std::vector<std::uint64_t>& ids) {
  std::vector<std::uint32_t> words;
  words.reserve(2 * ids.size());
  for (const std::uint64_t id : ids) {
    words.push_back(static_cast<std::uint32_t>(id));
    words.push_back(static_cast<std::uint32_t>(id >> 32U));
  }
  return words;
}

// tx ty tz qw qx qy qz of each.
template <class Number>
std::vector<Number> numbers_of(const std::vector<Rigid3>& poses) {
  std::vector<Number> numbers;
  numbers.reserve(7 * poses.size());
  for (const Rigid3& pose : poses) {
    const Eigen::Vector3d& t = pose.translation();
    const Eigen::Quaterniond q = pose.quaternion();
    for (const double number : {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}) {
      numbers.push_back(static_cast<Number>(number));
    }
  }
  return numbers;
}

std::vector<Rigid3> rigid_parts(const std::vector<Similarity3>& poses) {
  std::vector<Rigid3> parts;
  parts.reserve(poses.size());
  for (const Similarity3& pose : poses) parts.push_back(pose.rigid());
  return parts;
}

// Empty if all are 1.
std::vector<double> scales_of(const std::vector<Similarity3>& poses) {
  std::vector<double> scales;
  for (const Similarity3& pose : poses) scales.push_back(pose.scale());
  const bool plain =
      std::all_of(scales.begin(), scales.end(), [](double scale) { return scale == 1.0; });
  return plain ? std::vector<double>() : scales;
}

bool is_id(std::string_view id) {
  return !id.empty() &&
         id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-") == std::string_view::npos;
}

void require_labels(const std::vector<std::string>& labels, std::size_t count,
                    const std::string& where) {
  if (!labels.empty()) require_size(labels.size(), count, where, "labels");
}

// Sizes of lists that belong together.
void check(const auto& /*chart*/, const std::string& /*where*/) {}

void check(const DistributionChart& chart, const std::string& where) {
  for (const Distribution& group : chart.groups) {
    require_labels(group.labels, group.values.size(), where);
  }
}

void check(const LinesChart& chart, const std::string& where) {
  for (const Line& line : chart.series) require_size(line.y.size(), line.x.size(), where, "Line.y");
}

void check(const ScatterChart& chart, const std::string& where) {
  for (const ScatterSeries& series : chart.series) {
    require_size(series.y.size(), series.x.size(), where, "ScatterSeries.y");
    require_labels(series.labels, series.x.size(), where);
  }
}

void check(const HeatmapChart& chart, const std::string& where) {
  require(chart.x.size() >= 2 && chart.y.size() >= 2, where, "no bins", "edges of at least one");
  const auto require_grid = [&](const std::vector<std::vector<double>>& rows) {
    require_size(rows.size(), chart.y.size() - 1, where, "rows of a heat map");
    for (const auto& row : rows) require_size(row.size(), chart.x.size() - 1, where, "a row");
  };
  for (const HeatmapPanel& panel : chart.panels) {
    require_grid(panel.values);
    if (!panel.counts.empty()) require_grid(panel.counts);
  }
}

// tx ty tz qw qx qy qz, and the scale beside it.
Json pose_json(const Similarity3& pose) {
  return {{"pose", to_json(numbers_of<double>({pose.rigid()}))}, {"scale", to_json(pose.scale())}};
}

Json candidate_json(const AnswerCandidate& candidate) {
  Json json = pose_json(candidate.target_from_source);
  json["probability"] = to_json(candidate.probability);
  json["matches"] = candidate.matches;
  json["share"] = to_json(candidate.share);
  json["contradicted"] = to_json(candidate.contradicted);
  json["evidence"] = Json::array();
  for (const auto& [name, value] : candidate.evidence) {
    json["evidence"].push_back({{"name", name}, {"value", to_json(value)}});
  }
  return json;
}

Json alignment_json(const AlignmentAnswer& alignment) {
  Json json = {{"name", alignment.name},     {"status", alignment.status},
               {"judged", alignment.judged}, {"probability", to_json(alignment.probability)},
               {"reason", alignment.reason}, {"radius", to_json(alignment.radius)},
               {"estimate", nullptr},        {"deviations", nullptr}};
  if (alignment.target_from_source) json["estimate"] = pose_json(*alignment.target_from_source);
  if (const auto& deviations = alignment.deviations) {
    json["deviations"] = {{"translation", to_json(deviations->translation)},
                          {"rotation_deg", to_json(deviations->rotation_rad * degrees(1.0))},
                          {"log_scale", to_json(deviations->log_scale)}};
  }
  json["open"] = to_json(alignment.open);
  json["candidates"] = Json::array();
  for (const AnswerCandidate& candidate : alignment.candidates) {
    json["candidates"].push_back(candidate_json(candidate));
  }
  return json;
}

class Document {
 public:
  explicit Document(const Report& report) : report_(report) {
    Json& json = json_;
    json["schema"] = {{"name", "cairn.report"}, {"version", kSchemaVersion}};
    json["cairn_version"] = kVersion;
    json["title"] = plain_text(report.title);
    json["subtitle"] = report.subtitle ? Json(plain_text(*report.subtitle)) : Json(nullptr);
    json["provenance"] = to_json(report.provenance);
    json["maps"] = Json::array();
    std::set<std::string> ids;
    for (const Map& map : report.maps) {
      require(is_id(map.id) && ids.insert(map.id).second, "Map.id", "'" + map.id + "'",
              "an id of [a-z0-9-]+ that no other map has");
      json["maps"].push_back(map_json(map));
    }
    json["sections"] = Json::array();
    ids.clear();
    for (const Section& section : report.sections) {
      require(is_id(section.id) && ids.insert(section.id).second, "Section.id",
              "'" + section.id + "'", "an id of [a-z0-9-]+ that no other section has");
      json["sections"].push_back(section_json(section));
    }
  }

  // Text from files may be any bytes; JSON must be UTF-8.
  std::string text() const { return json_.dump(-1, ' ', false, Json::error_handler_t::replace); }
  const Buffers& buffers() const { return buffers_; }

 private:
  Json map_json(const Map& map) {
    const std::string where = "map " + map.id;
    const bool is_quantised = std::holds_alternative<std::vector<std::uint16_t>>(map.positions) ||
                              std::holds_alternative<std::vector<std::uint32_t>>(map.positions);
    require(is_quantised, where, "positions of another type", "u16 or u32");
    require_size(size_of(map.positions), 3 * map.count, where, "positions");
    if (!map.ids.empty()) require_size(map.ids.size(), map.count, where, "ids");
    if (!map.colors.empty()) require_size(map.colors.size(), 3 * map.count, where, "colors");
    Json json = {{"id", map.id},
                 {"name", map.name},
                 {"length_unit", to_json(map.length_unit)},
                 {"count", map.count},
                 {"origin", to_json(map.origin)},
                 {"step", to_json(map.step)},
                 {"positions", buffers_.add(map.positions)},
                 {"ids", map.ids.empty() ? Json(nullptr) : buffers_.keep(words_of(map.ids))}};
    json["columns"] = Json::array();
    for (const Column& column : map.columns) {
      require_size(size_of(column.values), map.count, where, column.name);
      json["columns"].push_back({{"name", column.name},
                                 {"label", column.label},
                                 {"unit", to_json(column.unit)},
                                 {"values", buffers_.add(column.values)},
                                 {"scale", to_json(column.scale)},
                                 {"offset", to_json(column.offset)}});
    }
    json["colors"] = map.colors.empty() ? Json(nullptr) : buffers_.add(map.colors);
    json["ellipsoids"] = nullptr;
    if (map.ellipsoids) {
      const Ellipsoids& shapes = *map.ellipsoids;
      require_size(shapes.covariances.size(), 6 * map.count, where, "Ellipsoids.covariances");
      require_size(shapes.sigmas.size(), map.count, where, "Ellipsoids.sigmas");
      json["ellipsoids"] = {{"covariances", buffers_.add(shapes.covariances)},
                            {"sigmas", buffers_.add(shapes.sigmas)},
                            {"scale", to_json(shapes.scale)},
                            {"offset", to_json(shapes.offset)}};
    }
    json["frames"] = map.frames ? frames_json(*map.frames, where) : Json(nullptr);
    return json;
  }

  Json frames_json(const Frames& frames, const std::string& where) {
    const std::size_t count = frames.world_from_camera.size();
    if (!frames.ids.empty()) require_size(frames.ids.size(), count, where, "Frames.ids");
    if (!frames.timestamps_s.empty()) {
      require_size(frames.timestamps_s.size(), count, where, "Frames.timestamps_s");
    }
    Json json = {{"count", count},
                 {"poses", buffers_.keep(numbers_of<float>(frames.world_from_camera))},
                 {"ids", frames.ids.empty() ? Json(nullptr) : buffers_.keep(words_of(frames.ids))},
                 {"timestamps",
                  frames.timestamps_s.empty() ? Json(nullptr) : buffers_.add(frames.timestamps_s)}};
    json["frustum"] = to_json(frames.frustum);
    json["images"] = nullptr;
    std::set<std::size_t> seen;
    for (const FrameImage& image : frames.images) {
      require(image.frame < count && seen.insert(image.frame).second, where,
              fmt::format("an image of frame {}", image.frame),
              fmt::format("at most one for each of {} frames", count));
      require(!image.bytes.empty(), where,
              fmt::format("no bytes of the image of frame {}", image.frame), "those of its file");
      json["images"].push_back({{"frame", image.frame},
                                {"media_type", to_json(image.type)},
                                {"data", buffers_.add(image.bytes)}});
    }
    return json;
  }

  Json section_json(const Section& section) {
    static constexpr const char* kKinds[] = {"scene", "chart",   "table",
                                             "text",  "network", "answer"};
    static_assert(std::size(kKinds) == std::variant_size_v<decltype(section.content)>);
    Json json = {{"kind", kKinds[section.content.index()]},
                 {"id", section.id},
                 {"title", section.title},
                 {"text", to_json(section.text)}};
    std::visit([&](const auto& content) { this->add(json, content, "section " + section.id); },
               section.content);
    return json;
  }

  Json run_json(const AlignmentRun& run, std::size_t source_count, std::size_t target_count,
                const std::string& where) {
    const std::size_t count = run.target_from_source.size();
    require(count > 0, where, "no pose", "at least the initial one");
    Json json = {{"name", run.name}, {"summary", Json::object()}};
    for (const auto& [name, value] : run.summary) json["summary"][name] = to_json(value);
    json["poses"] = buffers_.keep(numbers_of<double>(rigid_parts(run.target_from_source)));
    std::vector<double> scales = scales_of(run.target_from_source);
    json["scales"] = scales.empty() ? Json(nullptr) : buffers_.keep(std::move(scales));
    json["mean_squared_distance"] =
        series_json(run.mean_squared_distance, count, where, "mean_squared_distance");
    json["scores"] = series_json(run.scores, count, where, "scores");
    json["rotation_error_deg"] =
        series_json(run.rotation_error_deg, count, where, "rotation_error_deg");
    json["translation_error_m"] =
        series_json(run.translation_error, count, where, "translation_error");
    json["matches"] = run.matches
                          ? matches_json(*run.matches, count - 1, source_count, target_count, where)
                          : Json(nullptr);
    return json;
  }

  Json matches_json(const Matches& matches, std::size_t iterations, std::size_t source_count,
                    std::size_t target_count, const std::string& where) {
    require(iterations > 0, where, "matches without an iteration", "no matches");
    require_size(matches.first.size(), source_count, where, "Matches.first");
    require_size(matches.change_counts.size(), iterations - 1, where, "Matches.change_counts");
    std::size_t changes = 0;
    for (const std::uint32_t count : matches.change_counts) changes += count;
    require_size(matches.changed.size(), changes, where, "Matches.changed");
    require_size(matches.targets.size(), changes, where, "Matches.targets");
    for (const auto* const list : {&matches.first, &matches.targets}) {
      for (const std::int32_t target : *list) {
        require(target >= -1 && target < static_cast<std::int64_t>(target_count), where,
                fmt::format("a match with landmark {}", target),
                fmt::format("-1 or one of {} landmarks", target_count));
      }
    }
    for (const std::uint32_t source : matches.changed) {
      require(source < source_count, where, fmt::format("a match of landmark {}", source),
              fmt::format("one of {} landmarks", source_count));
    }
    return {{"first", buffers_.add(matches.first)},
            {"change_counts", buffers_.add(matches.change_counts)},
            {"changed", buffers_.add(matches.changed)},
            {"targets", buffers_.add(matches.targets)}};
  }

  Json series_json(const std::vector<double>& values, std::size_t count, const std::string& where,
                   std::string_view field) {
    if (values.empty()) return nullptr;
    require_size(values.size(), count, where, field);
    return buffers_.add(values);
  }

  // Fields of a section in addition to the common ones.
  void add(Json& json, const Scene& scene, const std::string& where) {
    const Map* const target = find_map(scene.target);
    const Map* const source = scene.source ? find_map(*scene.source) : nullptr;
    require(target != nullptr, where, "no map '" + scene.target + "'", "one of the report's maps");
    require(!scene.source || source != nullptr, where, "no map '" + scene.source.value_or("") + "'",
            "one of the report's maps");
    require(source != nullptr || scene.runs.empty(), where, "runs without a source",
            "a source map");
    json["source"] = to_json(scene.source);
    json["target"] = scene.target;
    json["truth"] = to_json(scene.truth);
    json["up"] = to_json(scene.up);
    json["runs"] = Json::array();
    for (const AlignmentRun& run : scene.runs) {
      json["runs"].push_back(
          run_json(run, source->count, target->count, where + ", run " + run.name));
    }
  }

  static void add(Json& json, const Chart& chart, const std::string& where) {
    static constexpr const char* kKinds[] = {"violin",    "lines",   "heatmap",
                                             "intervals", "scatter", "spans"};
    static_assert(std::size(kKinds) == std::variant_size_v<Chart>);
    json["chart"] = kKinds[chart.index()];
    std::visit(
        [&](const auto& one) {
          check(one, where);
          json.update(to_json(one));
        },
        chart);
  }

  static void add(Json& json, const Table& table, const std::string& where) {
    for (const auto& row : table.rows) {
      require_size(row.size(), table.columns.size(), where, "a row");
    }
    if (!table.best.empty()) {
      require_size(table.best.size(), table.columns.size(), where, "Table.best");
    }
    json["columns"] = to_json(table.columns);
    json["rows"] = to_json(table.rows);
    json["best"] = list_or_null(table.best);
  }

  static void add(Json& json, const Text& /*text*/, const std::string& where) {
    require(!json["text"].is_null(), where, "no text", "text, which is all that it shows");
  }

  void add(Json& json, const Network& network, const std::string& where) {
    require(!network.stages.empty(), where, "no stage", "at least one");
    json["length_unit"] = to_json(network.length_unit);
    json["stages"] = to_json(network.stages);
    json["groups"] = to_json(network.groups);
    json["nodes"] = Json::array();
    for (const NetworkNode& node : network.nodes) {
      json["nodes"].push_back(node_json(node, network, where + ", map " + node.name));
    }
    json["links"] = Json::array();
    for (const NetworkLink& link : network.links) {
      json["links"].push_back(link_json(link, network, where));
    }
  }

  void add(Json& json, const Answer& answer, const std::string& where) const {
    const bool known =
        !answer.scene ||
        std::any_of(report_.sections.begin(), report_.sections.end(), [&](const Section& section) {
          return section.id == *answer.scene && std::holds_alternative<Scene>(section.content);
        });
    require(known, where, "no scene '" + answer.scene.value_or("") + "'", "one of the report's");
    json["length_unit"] = to_json(answer.length_unit);
    json["scene"] = to_json(answer.scene);
    json["alignments"] = Json::array();
    for (const AlignmentAnswer& alignment : answer.alignments) {
      json["alignments"].push_back(alignment_json(alignment));
    }
  }

  Json link_json(const NetworkLink& link, const Network& network, const std::string& where) const {
    require(link.target < network.nodes.size() && link.source < network.nodes.size(), where,
            "a link of a map that is not there", "one of the maps");
    Json json = to_json(link);
    json["kind"] = text_or_null(link.kind);
    json["reason"] = text_or_null(link.reason);
    if (const auto& view = link.view) {
      require(has_image(network.nodes[link.target], view->target_frame) &&
                  has_image(network.nodes[link.source], view->source_frame),
              where, "a link with a keyframe without an image", "keyframes with images");
      json["view"] = to_json(*view);
    }
    return json;
  }

  Json node_json(const NetworkNode& node, const Network& network, const std::string& where) {
    require(!node.map || find_map(*node.map) != nullptr, where,
            "no map '" + node.map.value_or("") + "'", "one of the report's maps");
    require(!node.group || *node.group < network.groups.size(), where, "a group that is not there",
            "one of the groups");
    require_size(node.group_from_node.size(), node.group ? network.stages.size() : 0, where,
                 "group_from_node");
    Json json = {{"name", node.name},
                 {"map", to_json(node.map)},
                 {"session", text_or_null(node.session)},
                 {"reason", text_or_null(node.reason)},
                 {"group", to_json(node.group)},
                 {"landmarks", node.landmarks},
                 {"keyframes", node.keyframes},
                 {"fused", to_json(node.fused)},
                 {"centre", to_json(node.centre)},
                 {"poses", nullptr},
                 {"scales", nullptr}};
    if (!node.group) return json;
    json["poses"] = buffers_.keep(numbers_of<double>(rigid_parts(node.group_from_node)));
    std::vector<double> scales = scales_of(node.group_from_node);
    if (!scales.empty()) json["scales"] = buffers_.keep(std::move(scales));
    return json;
  }

  const Map* find_map(const std::string& id) const {
    const auto found = std::find_if(report_.maps.begin(), report_.maps.end(),
                                    [&](const Map& map) { return map.id == id; });
    return found == report_.maps.end() ? nullptr : &*found;
  }

  bool has_image(const NetworkNode& node, std::size_t frame) const {
    const Map* const map = node.map ? find_map(*node.map) : nullptr;
    if (map == nullptr || !map->frames) return false;
    const std::vector<FrameImage>& images = map->frames->images;
    return std::any_of(images.begin(), images.end(),
                       [&](const FrameImage& image) { return image.frame == frame; });
  }

  const Report& report_;
  Json json_;
  Buffers buffers_;
};

std::size_t position_of(std::string_view page, std::string_view mark) {
  const std::size_t position = page.find(mark);
  const bool once = position != std::string_view::npos &&
                    page.find(mark, position + mark.size()) == std::string_view::npos;
  reject_if(!once, "viewer page",
            fmt::format("{} stands there {}", mark,
                        position == std::string_view::npos ? "nowhere" : "more than once"),
            "the mark once, where the report goes");
  return position;
}

// Without characters that mark up HTML. plain_text() has replaced what is no text.
std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else if (c == '\'') {
      result += "&#39;";
    } else {
      result += c;
    }
  }
  return result;
}

template <class Produce>
void write_element(std::string_view name, const ByteSink& sink, const Produce& produce) {
  sink(fmt::format(
      R"(<script type="application/x-cairn-{0}" id="cairn-{0}" data-encoding="gzip-base64">)",
      name));
  detail::GzipBase64 encoder(sink);
  produce(encoder);
  encoder.finish();
  sink("</script>\n");
}

}  // namespace

void write_report(const Report& report, std::string_view page, const ByteSink& sink) {
  const std::size_t title = position_of(page, kTitleMark);
  const std::size_t data = position_of(page, kDataMark);
  reject_if(title > data, "viewer page", "its data come before its title", "the reverse");
  const Document document(report);
  sink(page.substr(0, title));
  sink(escaped(plain_text(report.title)));
  const std::size_t title_end = title + kTitleMark.size();
  sink(page.substr(title_end, data - title_end));
  write_element("report", sink, [&](detail::GzipBase64& out) { out.write(document.text()); });
  write_element("buffers", sink, [&](detail::GzipBase64& out) { document.buffers().write(out); });
  sink(page.substr(data + kDataMark.size()));
}

void save_report(const Report& report, const std::filesystem::path& path) {
  const std::string_view page = viewer_page();
  write_file(path, [&](const ByteSink& sink) { write_report(report, page, sink); });
}

}  // namespace cairn::report

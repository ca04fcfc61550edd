// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "cairn/alignment/align.hpp"
#include "cairn/core/file.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

/// Content of a report, and functions that write it as a page. The types mirror
/// docs/report_format.md, which defines each field. A null there is an empty optional, text or list
/// here. Invalid UTF-8 in texts is shown as U+FFFD.
namespace cairn::report {

/// A list of numbers that is too long for JSON, with its storage type.
using Buffer =
    std::variant<std::vector<std::uint8_t>, std::vector<std::int8_t>, std::vector<std::uint16_t>,
                 std::vector<std::int16_t>, std::vector<std::uint32_t>, std::vector<std::int32_t>,
                 std::vector<float>, std::vector<double>>;

/// A value in a table or summary: unknown, a number or text.
using Scalar = std::variant<std::monostate, double, std::string>;

struct Machine {
  std::string system = {};
  std::string processor = {};
  unsigned threads = 0;  ///< threads available to the work
};

struct Input {
  std::string role = {};  ///< e.g. "source"
  std::optional<std::string> path = {};
  std::optional<std::string> hash = {};
  std::string details_json = {};  ///< any JSON; empty: none
};

/// Origin of the results.
struct Provenance {
  std::vector<std::string> command = {};
  std::optional<std::uint64_t> seed = {};
  std::optional<Machine> machine = {};
  std::vector<Input> inputs = {};
  std::string options_json = {};  ///< any JSON; empty: none
};

/// A number per landmark: offset + scale * stored; NaN if unknown.
struct Column {
  std::string name = {};
  std::string label = {};  ///< for display
  std::optional<std::string> unit = {};
  Buffer values = {};
  double scale = 1.0;
  double offset = 0.0;
};

/// Field of view of a camera, as tangents of its half-angles.
struct Frustum {
  double half_width = 0.0;
  double half_height = 0.0;
};

enum class ImageType { kPng, kJpeg };

/// Image of a frame, resampled for a pinhole camera with the map's frustum: the image fills the
/// frustum and has no lens distortion.
struct FrameImage {
  std::size_t frame = 0;  ///< position in Frames::world_from_camera
  ImageType type = ImageType::kJpeg;
  std::vector<std::uint8_t> bytes = {};  ///< bytes of the image file
};

struct Frames {
  std::vector<Rigid3> world_from_camera = {};
  std::vector<std::uint64_t> ids = {};    ///< empty: 0, 1, ...
  std::vector<double> timestamps_s = {};  ///< empty: all unknown; NaN: this one unknown
  std::optional<Frustum> frustum = {};
  std::vector<FrameImage> images = {};  ///< at most one per frame
};

/// Ellipsoids of landmarks: their covariances, each divided by its largest variance.
struct Ellipsoids {
  /// xx, yy, zz, xy, xz, yz of each covariance, times 127; zeros: unknown
  std::vector<std::int8_t> covariances = {};
  std::vector<std::uint8_t> sigmas = {};  ///< largest deviation = 2^(offset + scale * stored)
  double scale = 0.0;
  double offset = 0.0;
};

/// Landmarks to show.
struct Map {
  std::string id = {};  ///< unique among the report's maps; lower-case letters, digits and '-'
  std::string name = {};
  LengthUnit length_unit = LengthUnit::kMetres;
  std::size_t count = 0;
  std::array<double, 3> origin = {};                ///< position = origin + step * quantised
  std::array<double, 3> step = {1.0, 1.0, 1.0};     ///< in the map's unit of length
  Buffer positions = std::vector<std::uint32_t>();  ///< u16 or u32, 3 per landmark
  std::vector<std::uint64_t> ids = {};              ///< empty: 0, 1, ...
  std::vector<Column> columns = {};
  std::vector<std::uint8_t> colors = {};      ///< sRGB, 3 per landmark; empty: unknown
  std::optional<Ellipsoids> ellipsoids = {};  ///< of Gaussian splats
  std::optional<Frames> frames = {};
};

/// Target landmark matched with each source landmark, per iteration: the first iteration in full, then the
/// changes.
struct Matches {
  std::vector<std::int32_t> first = {};           ///< one per source landmark; -1: no match
  std::vector<std::uint32_t> change_counts = {};  ///< one for each iteration from the second
  std::vector<std::uint32_t> changed = {};        ///< source landmarks
  std::vector<std::int32_t> targets = {};         ///< their new matches, or -1
};

/// One alignment; runs_of() builds it from a result. A list of numbers is empty if none of its
/// values is known; otherwise it has one entry per pose, NaN where the value is unknown.
struct AlignmentRun {
  std::string name = {};
  std::vector<std::pair<std::string, Scalar>> summary = {};
  std::vector<Similarity3> target_from_source =
      {};  ///< the initial pose, the pose after each iteration, and the result if none ended there
  std::vector<double> mean_squared_distance = {};
  std::vector<double> scores = {};
  std::vector<double> rotation_error_deg = {};
  std::vector<double> translation_error = {};  ///< in the maps' unit of length
  std::optional<Matches> matches = {};
};

/// 3D view of one map, or of a source that is aligned to a target.
struct Scene {
  std::optional<std::string> source = {};  ///< id of a map
  std::string target = {};                 ///< id of a map
  std::optional<Similarity3> truth = {};   ///< true target_from_source
  std::optional<Eigen::Vector3d> up = {};  ///< unit vector in the target's frame
  std::vector<AlignmentRun> runs = {};
};

enum class AxisScale { kLinear, kLog };

/// A line across a chart, e.g. the success limit.
struct Threshold {
  double value = 0.0;
  std::string label = {};
};

struct Distribution {
  std::string name = {};
  std::vector<double> values = {};
  std::vector<std::string> labels = {};  ///< one per value, or empty
};

/// Distributions side by side, as in the paper's Figures 3 to 5.
struct DistributionChart {
  std::string x_label = {};
  std::string y_label = {};
  AxisScale y_scale = AxisScale::kLinear;
  std::optional<Threshold> threshold = {};
  std::vector<Distribution> groups = {};
};

struct Line {
  std::string name = {};
  std::vector<double> x = {};
  std::vector<double> y = {};
};

struct LinesChart {
  std::string x_label = {};
  std::string y_label = {};
  AxisScale y_scale = AxisScale::kLinear;
  std::vector<Line> series = {};
};

struct HeatmapPanel {
  std::string name = {};
  std::vector<std::vector<double>> values = {};  ///< by row, from the first y bin; NaN: no value
  std::vector<std::vector<double>> counts =
      {};  ///< number of trials behind each value; empty: unknown
};

struct HeatmapChart {
  std::string x_label = {};
  std::string y_label = {};
  std::string value_label = {};
  std::vector<double> x = {};  ///< ascending bin edges, one more than bins
  std::vector<double> y = {};
  std::vector<HeatmapPanel> panels = {};
  std::optional<std::array<double, 2>> range =
      {};  ///< range of the colours; std::nullopt: range of the values
};

struct IntervalItem {
  std::string name = {};
  double value = 0.0;
  double low = 0.0;
  double high = 0.0;
};

struct IntervalSeries {
  std::string name = {};
  std::vector<IntervalItem> items = {};
};

/// Dots with intervals, e.g. success rates.
struct IntervalsChart {
  std::string x_label = {};
  std::vector<IntervalSeries> series = {};
  AxisScale x_scale = AxisScale::kLinear;
};

struct ScatterSeries {
  std::string name = {};
  std::vector<double> x = {};
  std::vector<double> y = {};
  std::vector<std::string> labels = {};  ///< one per point, or empty
};

struct ScatterChart {
  std::string x_label = {};
  std::string y_label = {};
  AxisScale x_scale = AxisScale::kLinear;
  AxisScale y_scale = AxisScale::kLinear;
  std::optional<Threshold> x_threshold = {};
  std::optional<Threshold> y_threshold = {};
  std::vector<ScatterSeries> series = {};
};

struct Span {
  std::string name = {};  ///< spans with the same name share a row
  double start = 0.0;
  double end = 0.0;
  std::vector<double> marks = {};  ///< e.g. times of keyframes
};

struct SpanSeries {
  std::string name = {};
  std::vector<Span> spans = {};
};

/// Bars over time, in seconds since 1970 or any other start.
struct SpansChart {
  std::string x_label = {};
  std::vector<SpanSeries> series = {};
};

using Chart = std::variant<DistributionChart, LinesChart, HeatmapChart, IntervalsChart,
                           ScatterChart, SpansChart>;

/// A command is text to copy into a shell, a probability a number from 0 to 1.
enum class CellType { kText, kNumber, kCommand, kProbability };

struct TableColumn {
  std::string name = {};
  std::optional<std::string> unit = {};
  CellType type = CellType::kText;
  std::optional<int> digits = {};  ///< after the decimal point
};

/// Which value of a column to mark.
enum class Best { kNone, kLow, kHigh };

struct Table {
  std::vector<TableColumn> columns = {};
  std::vector<std::vector<Scalar>> rows = {};  ///< one value per column each
  std::vector<Best> best = {};                 ///< one per column, or empty
};

/// A map of the network.
struct NetworkNode {
  std::string name = {};
  std::optional<std::string> map = {};    ///< id of a map of the report, whose landmarks are shown
  std::string session = {};               ///< empty: unknown
  std::string reason = {};                ///< why it has no pose
  std::optional<std::size_t> group = {};  ///< index of a NetworkGroup; std::nullopt: no pose
  std::size_t landmarks = 0;
  std::size_t keyframes = 0;
  std::optional<std::size_t> fused = {};          ///< landmarks shared with other maps
  Eigen::Vector3d centre = {0.0, 0.0, 0.0};       ///< centre of its landmarks, in its own frame
  std::vector<Similarity3> group_from_node = {};  ///< one per stage if it has a group, else empty
};

/// Maps with poses in one frame.
struct NetworkGroup {
  std::string frame = {};                  ///< name of the map with that frame
  std::optional<Eigen::Vector3d> up = {};  ///< unit vector in that frame
};

enum class LinkUse {
  kUsed,
  kContradicted,  ///< aligned, but other links contradict it
  kUndecided,     ///< aligned, but not yet part of an optimisation
  kAmbiguous,
  kRejected,
};

/// Two keyframes of a link, whose images are shown side by side.
struct LinkView {
  std::size_t target_frame = 0;  ///< position in Frames::world_from_camera of the target's map
  std::size_t source_frame = 0;
  std::size_t matches = 0;  ///< landmarks that both keyframes see
};

struct NetworkLink {
  std::size_t target = 0;  ///< index of a node
  std::size_t source = 0;
  LinkUse use = LinkUse::kRejected;
  std::string kind = {};  ///< e.g. "placement"
  std::optional<double> probability = {};
  std::string reason = {};
  /// Residual of the link against the optimised poses: distance between the two positions of the
  /// source's centre, in the target's unit, and angle.
  std::optional<double> residual = {};
  std::optional<double> residual_deg = {};
  std::optional<LinkView> view = {};  ///< both keyframes have an image
};

/// Maps, their poses and links, shown as a graph, as a matrix and in 3D.
struct Network {
  LengthUnit length_unit = LengthUnit::kMetres;
  std::vector<std::string> stages = {};  ///< at least one; names of the poses, the final ones last
  std::vector<NetworkGroup> groups = {};
  std::vector<NetworkNode> nodes = {};
  std::vector<NetworkLink> links = {};
};

/// A candidate pose and its evidence.
struct AnswerCandidate {
  Similarity3 target_from_source = {};
  double probability = 0.0;                 ///< probability that the pose is correct
  std::size_t matches = 0;                  ///< landmarks matched within AlignmentAnswer::radius
  double share = 0.0;                       ///< matched share of the smaller map's landmarks
  std::optional<double> contradicted = {};  ///< contradicted share of compared lines of sight
  /// Log-likelihood ratios versus a wrong pose, by source of evidence.
  std::vector<std::pair<std::string, double>> evidence = {};
};

/// A small motion that the matches do not determine; see OpenDirection.
struct AnswerDirection {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  double log_scale = 0.0;
};

/// Result of one alignment.
struct AlignmentAnswer {
  std::string name = {};    ///< name of its run
  std::string status = {};  ///< name of the verdict or, if not judged, of the method's status
  bool judged = false;      ///< whether there is a verdict
  std::optional<double> probability{};  ///< probability that the pose is correct
  std::string reason = {};
  std::optional<Similarity3> target_from_source = {};  ///< the best pose, whatever the verdict
  std::optional<PoseDeviations> deviations = {};
  std::vector<AnswerDirection> open = {};
  std::vector<AnswerCandidate> candidates = {};  ///< likeliest first
  std::optional<double> radius = {};  ///< landmarks within this distance count as matched
};

/// Results of a pair's alignments, shown before the details.
struct Answer {
  LengthUnit length_unit = LengthUnit::kMetres;
  std::optional<std::string> scene = {};  ///< id of the section with the poses in 3D
  std::vector<AlignmentAnswer> alignments = {};
};

/// Only the section's text.
struct Text {};

struct Section {
  std::string id = {};  ///< unique among the report's sections; lower-case letters, digits and '-'
  std::string title = {};
  std::optional<std::string> text = {};  ///< a paragraph; in Text, blank lines separate paragraphs
  std::variant<Scene, Chart, Table, Text, Network, Answer> content = Text();
};

struct Report {
  std::string title = {};
  std::optional<std::string> subtitle = {};  ///< one sentence with the result
  Provenance provenance = {};
  std::vector<Map> maps = {};
  std::vector<Section> sections = {};
};

/// Writes a report as one self-contained HTML page (docs/report_format.md). The same report and page give
/// the same bytes.
/// @param page the viewer: HTML that contains `<!--CAIRN:TITLE-->` and `<!--CAIRN:DATA-->` once each
/// @throws Error (input) if the page lacks a marker; (misuse) naming the invalid part of the
///        report: ids, sizes, maps referenced by scenes
void write_report(const Report& report, std::string_view page, const ByteSink& sink);

/// Writes a report with this build's viewer to a file, atomically.
/// @throws Error (misuse) if this build has no viewer; also as write_report and write_file
void save_report(const Report& report, const std::filesystem::path& path);

/// Whether this build contains the viewer (CMake option CAIRN_WITH_VIEWER), which reports need.
bool has_viewer();

/// The viewer's page, for write_report().
/// @throws Error (misuse) if this build has none
std::string_view viewer_page();

/// The machine that runs this program; texts are empty if the system does not provide them.
/// @param threads number of threads available to the work
Machine this_machine(unsigned threads);

}  // namespace cairn::report

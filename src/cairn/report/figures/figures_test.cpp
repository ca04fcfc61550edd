// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/report/figures/figures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/core/file.hpp"
#include "cairn/core/random.hpp"
#include "cairn/map/synthetic.hpp"
#include "cairn/report/detail/axis.hpp"
#include "cairn/report/detail/svg.hpp"

namespace cairn::report {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// CAIRN_FIGURES names a folder to look at the figures in.
void keep(const std::string& name, const std::string& svg) {
  if (const char* const folder = std::getenv("CAIRN_FIGURES")) {
    write_file(std::filesystem::path(folder) / (name + ".svg"),
               [&](const ByteSink& sink) { sink(svg); });
  }
}

std::size_t count_of(const std::string& text, std::string_view part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

// A plain Gaussian kernel, as a stand-in for a proper estimate.
std::vector<DensityPoint> density(std::span<const double> values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const double width = std::max(0.12 * (*high - *low), 1e-9);
  std::vector<DensityPoint> points;
  for (int i = 0; i <= 60; ++i) {
    DensityPoint point{*low - 2 * width + i / 60.0 * (*high - *low + 4 * width), 0.0};
    for (const double value : values) {
      point.density += std::exp(-0.5 * std::pow((point.value - value) / width, 2));
    }
    points.push_back(point);
  }
  return points;
}

// The published scores of Figure 3 have this shape: most runs converge, some do not.
DistributionChart scores() {
  DistributionChart chart;
  chart.x_label = "Strategy";
  chart.y_label = "Score (m²)";
  chart.threshold = Threshold{0.0037, "success below 0.0037"};
  chart.groups = {
      {"base", {0.0034, 0.0034, 0.0035, 0.0041, 0.0072, 0.0124, 0.0147, 0.0167}, {}},
      {"covariance", {0.0033, 0.0033, 0.0033, 0.0034, 0.0033, 0.0033, 0.0034, 0.0141}, {}},
      {"observations", {0.0033, 0.0033, 0.0033, 0.0033, 0.0034, 0.0033, 0.0033, 0.0128}, {}},
      {"distance", {0.0036, 0.0035, 0.0036, 0.0036, 0.0036, 0.0035, 0.0036, 0.0037}, {}}};
  return chart;
}

LinesChart lines() {
  LinesChart chart;
  chart.x_label = "Iteration";
  chart.y_label = "Score (m²)";
  chart.y_scale = AxisScale::kLog;
  double rate = 0.80;
  for (const char* const name : {"base", "covariance", "observations", "distance"}) {
    Line line;
    line.name = name;
    for (int i = 0; i <= 60; ++i) {
      line.x.push_back(i);
      line.y.push_back(0.003 * (1.0 + rate) + 0.09 * std::pow(rate, i));
      line.low.push_back(line.y.back() * 0.85);
      line.high.push_back(line.y.back() * 1.2);
    }
    rate += 0.04;
    chart.series.push_back(std::move(line));
  }
  return chart;
}

HeatmapChart heatmap() {
  HeatmapChart chart;
  chart.x_label = "Rotation (deg)";
  chart.y_label = "Offset (m)";
  chart.value_label = "Success rate";
  for (int i = 0; i <= 6; ++i) chart.x.push_back(10.0 * i);
  for (int i = 0; i <= 5; ++i) chart.y.push_back(0.2 * i);
  chart.range = std::array{0.0, 1.0};
  for (const char* const name : {"base", "observations"}) {
    HeatmapPanel panel{name, {}, {}};
    for (int r = 0; r < 5; ++r) {
      std::vector<double> row;
      for (int c = 0; c < 6; ++c) {
        row.push_back(1.0 / (1.0 + std::exp(1.2 * (c + r) - (name[0] == 'b' ? 4.0 : 6.5))));
      }
      panel.values.push_back(row);
    }
    panel.values[4][5] = kNan;
    chart.panels.push_back(std::move(panel));
  }
  return chart;
}

IntervalsChart intervals() {
  IntervalsChart chart;
  chart.x_label = "Success rate (95 % Wilson interval)";
  double shift = 0.0;
  for (const char* const name : {"base", "covariance", "observations", "distance"}) {
    chart.series.push_back({name,
                            {{"desk", 0.52 + shift, 0.45 + shift, 0.59 + shift},
                             {"office", 0.61 + shift, 0.54 + shift, 0.67 + shift},
                             {"corridor", 0.22 + shift, 0.17 + shift, 0.29 + shift}}});
    shift += 0.08;
  }
  return chart;
}

ScatterChart scatter() {
  ScatterChart chart;
  chart.x_label = "Score (m²)";
  chart.y_label = "Translation error (m)";
  chart.x_scale = chart.y_scale = AxisScale::kLog;
  chart.x_threshold = Threshold{0.0037, "score 0.0037"};
  chart.y_threshold = Threshold{0.05, "5 cm"};
  Random random(4);
  for (const char* const name : {"base", "observations"}) {
    ScatterSeries series{name, {}, {}, {}};
    for (int i = 0; i < 60; ++i) {
      const double score = 0.003 * std::exp(1.2 * std::abs(random.normal()));
      series.x.push_back(score);
      series.y.push_back(2.0 * score * std::exp(random.normal()));
    }
    chart.series.push_back(std::move(series));
  }
  return chart;
}

CloudsFigure clouds() {
  const SyntheticPair pair = synthetic_pair({.seed = 2, .landmarks = 3000});
  CloudsFigure figure;
  const auto& source = pair.source.landmarks().positions;
  const Rigid3 off = Rigid3::from_roll_pitch_yaw({0.2, 0.1, 0.05}, 0.05, 0.1, 0.5);
  figure.panels = {{"(a) converged", pair.target.landmarks().positions,
                    moved_positions(source, pair.target_from_source)},
                   {"(b) did not converge", pair.target.landmarks().positions,
                    moved_positions(source, off * pair.target_from_source)}};
  return figure;
}

TEST(Axis, TicksAreAtOneTwoOrFiveTimesAPowerOfTen) {
  const Axis axis = Axis::between(0.0, 0.0167, AxisScale::kLinear);
  std::vector<double> values;
  std::vector<std::string> labels;
  for (const Tick& tick : axis.ticks()) {
    values.push_back(tick.value);
    labels.push_back(tick.label);
  }
  EXPECT_THAT(labels, ElementsAre("0.000", "0.005", "0.010", "0.015"));
  EXPECT_DOUBLE_EQ(values[3], 0.015);
  EXPECT_DOUBLE_EQ(axis.share(0.0167), 1.0);
  EXPECT_DOUBLE_EQ(axis.share(0.00835), 0.5);
}

TEST(Axis, LogarithmicTicksAreNamedAtPowersOfTen) {
  const Axis axis = Axis::between(1e-5, 1.0, AxisScale::kLog);
  std::vector<std::string> labels;
  for (const Tick& tick : axis.ticks()) {
    if (!tick.label.empty()) labels.push_back(tick.label);
  }
  EXPECT_THAT(labels, ElementsAre("10⁻⁵", "10⁻⁴", "0.001", "0.01", "0.1", "1"));
  EXPECT_NEAR(axis.share(1e-3), 0.4, 1e-12);
  EXPECT_FALSE(axis.shows(0.0));
  EXPECT_FALSE(axis.shows(-1.0));
}

TEST(Axis, NarrowLogarithmicAxisHasNumbersAllTheSame) {
  for (const double high : {1.3, 2.5, 8.0, 40.0}) {
    const Axis axis = Axis::between(1.2, high, AxisScale::kLog);
    EXPECT_GE(std::count_if(axis.ticks().begin(), axis.ticks().end(),
                            [](const Tick& tick) { return !tick.label.empty(); }),
              2)
        << high;
  }
}

TEST(Axis, HasRoomForItsValuesAndIgnoresWhatItCannotShow) {
  const std::vector<double> values = {1.0, kNan, 3.0, std::numeric_limits<double>::infinity()};
  const Axis axis(values, AxisScale::kLinear);
  EXPECT_LT(axis.low(), 1.0);
  EXPECT_GT(axis.high(), 3.0);
  EXPECT_LT(axis.high(), 4.0);
  for (const AxisScale scale : {AxisScale::kLinear, AxisScale::kLog}) {
    for (const std::vector<double>& few :
         {std::vector<double>{}, {0.0}, {5.0}, {5.0, 5.0}, {-3.0}, {1e-300}, {1e300, 1e-300}}) {
      const Axis lone(few, scale);
      EXPECT_LT(lone.low(), lone.high());
      EXPECT_TRUE(std::isfinite(lone.share(1.0)));
      EXPECT_LT(lone.ticks().size(), 200U);
    }
  }
}

TEST(NumberLabels, HaveAsManyDecimalsAsTheyNeed) {
  EXPECT_THAT(number_labels(std::vector{0.0, 0.05, 0.1}), ElementsAre("0.00", "0.05", "0.10"));
  EXPECT_THAT(number_labels(std::vector{-20.0, -0.0, 20.0}), ElementsAre("−20", "0", "20"));
  EXPECT_THAT(number_labels(std::vector{0.0, 2e-5}), ElementsAre("0", "2e-05"));
}

TEST(Svg, TextIsEscapedAndNumbersAreShort) {
  Svg svg(100, 50);
  svg.text({1.04, 2.06}, "<script>&", {});
  svg.circle({1.0 / 3.0, -0.04}, 5.0, {.fill = "#000000"});
  const std::string document = svg.document("a\"<b");
  EXPECT_THAT(document, HasSubstr("x=\"1\" y=\"2.1\""));
  EXPECT_THAT(document, HasSubstr(">&lt;script&gt;&amp;</text>"));
  EXPECT_THAT(document, HasSubstr("<title>a&quot;&lt;b</title>"));
  EXPECT_THAT(document, HasSubstr("cx=\"0.3\" cy=\"0\""));
}

TEST(Svg, DotsAreOnePath) {
  Svg svg(100, 50);
  svg.dots(std::vector<SvgPoint>{{1.0, 2.0}, {3.25, 4.0}}, 2.0, "#000000", 1.0);
  EXPECT_THAT(svg.document(""), HasSubstr("<path d=\"M1 2h0M3.3 4h0\""));
}

TEST(Figures, DistributionShowsEachValueMedianAndMean) {
  const std::string svg = distribution_svg(scores(), {.title = "Yaw"}, density);
  keep("violin", svg);
  EXPECT_EQ(count_of(svg, "h0"), 32U);
  EXPECT_EQ(count_of(svg, "stroke-dasharray=\"3 2\""), 4U);  // means
  EXPECT_EQ(count_of(svg, "Z\""), 4U);                       // outlines
  EXPECT_THAT(svg, HasSubstr("success below 0.0037"));
  EXPECT_THAT(svg, HasSubstr("n = 8"));
  DistributionChart chart = scores();
  chart.y_scale = AxisScale::kLog;
  chart.style = DistributionStyle::kBox;
  chart.groups[1].values.push_back(-1.0);
  const std::string boxes = distribution_svg(chart, {}, density);
  keep("box", boxes);
  EXPECT_EQ(count_of(boxes, "Z\""), 0U);
  EXPECT_THAT(boxes, HasSubstr("1 value that the axes cannot show is left out"));
  chart.style = DistributionStyle::kViolin;
  keep("violin_log", distribution_svg(chart, {}, density));
}

TEST(Figures, DensityOfALogarithmicAxisIsOfLogarithms) {
  DistributionChart chart;
  chart.y_scale = AxisScale::kLog;
  chart.groups = {{"base", {0.01, 0.1, 1.0}, {}}};
  std::vector<double> given;
  distribution_svg(chart, {}, [&](std::span<const double> values) {
    given.assign(values.begin(), values.end());
    return std::vector<DensityPoint>();
  });
  EXPECT_THAT(given, ElementsAre(-2.0, -1.0, 0.0));
}

TEST(Figures, LinesHaveBandsAndGaps) {
  LinesChart chart = lines();
  const std::string svg = lines_svg(chart, {.title = "Convergence"});
  keep("lines", svg);
  EXPECT_EQ(count_of(svg, "Z\""), 4U);
  chart.series[0].y[30] = kNan;
  EXPECT_EQ(count_of(lines_svg(chart), "Z\""), 5U);
}

TEST(Figures, HeatmapMarksCellsWithoutValue) {
  const std::string svg = heatmap_svg(heatmap(), {.title = "Basins of convergence", .width = 760});
  keep("heatmap", svg);
  EXPECT_EQ(count_of(svg, "#dcdcdc"), 2U);
  EXPECT_THAT(svg, HasSubstr("Success rate"));
}

TEST(Figures, IntervalsHaveARowForEachItem) {
  const std::string svg = intervals_svg(intervals(), {.title = "Who succeeds where"});
  keep("intervals", svg);
  EXPECT_EQ(count_of(svg, "stroke=\"#ffffff\""), 12U);
  EXPECT_EQ(count_of(svg, ">corridor<"), 1U);
}

TEST(Figures, ScatterHasAPointForEachPair) {
  ScatterChart chart = scatter();
  const std::string svg = scatter_svg(chart, {.title = "Is the score a judge of the pose?"});
  keep("scatter", svg);
  EXPECT_EQ(count_of(svg, "h0"), 120U);
  chart.series[0].x[0] = 0.0;
  EXPECT_THAT(scatter_svg(chart), HasSubstr("1 value that the axes"));
}

TEST(Figures, CloudsAreSmallAndHaveAScale) {
  const std::string svg = clouds_svg(clouds(), {.title = "Aligned", .width = 860, .height = 420});
  keep("clouds", svg);
  EXPECT_THAT(svg, HasSubstr("(b) did not converge"));
  EXPECT_THAT(svg, HasSubstr(" cm<"));
  EXPECT_EQ(count_of(svg, "<path"), 4U);
  EXPECT_LT(svg.size(), 250000U) << "12,000 points";
}

TEST(Figures, SameInputSameBytes) {
  EXPECT_EQ(clouds_svg(clouds()), clouds_svg(clouds()));
  EXPECT_EQ(distribution_svg(scores(), {}, density), distribution_svg(scores(), {}, density));
}

TEST(Figures, HostileTextIsTextAndEmptyChartsAreDrawn) {
  const std::string hostile = "</svg><script>alert(1)</script>";
  DistributionChart distributions = scores();
  distributions.x_label = distributions.y_label = distributions.groups[0].name = hostile;
  distributions.threshold->label = hostile;
  LinesChart curves = lines();
  curves.series[0].name = curves.x_label = hostile;
  HeatmapChart map = heatmap();
  map.panels[0].name = map.value_label = hostile;
  IntervalsChart rates = intervals();
  rates.series[0].items[0].name = hostile;
  ScatterChart points = scatter();
  points.series[0].name = points.x_threshold->label = hostile;
  for (const Chart& chart :
       {Chart(distributions), Chart(curves), Chart(map), Chart(rates), Chart(points)}) {
    const std::string svg = chart_svg(chart, {.title = hostile}, density);
    EXPECT_THAT(svg, Not(HasSubstr("<script")));
    EXPECT_EQ(count_of(svg, "</svg>"), 1U);
  }
  for (const Chart& chart : {Chart(DistributionChart()), Chart(LinesChart()), Chart(HeatmapChart()),
                             Chart(IntervalsChart()), Chart(ScatterChart())}) {
    EXPECT_THAT(chart_svg(chart), HasSubstr("</svg>"));
    EXPECT_THAT(chart_svg(chart), Not(HasSubstr("nan")));
  }
  EXPECT_THAT(clouds_svg({}), HasSubstr("</svg>"));
}

}  // namespace
}  // namespace cairn::report

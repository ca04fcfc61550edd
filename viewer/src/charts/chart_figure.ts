// SPDX-License-Identifier: BSD-3-Clause
import { button, chooser, download, h } from "../dom";
import { messageOf } from "../document/errors";
import type { Chart, ChartSection, LinesChart } from "../document/report";
import { csvBlob, svgText, svgToPng } from "../export";
import { isPrinting, kPaperWidth, onPaper } from "../paper";
import { exportPalette, onThemeChange, palette } from "../theme";
import { chartRows } from "./chart_data";
import { drawHeatmap } from "./heatmap";
import { drawIntervals } from "./intervals";
import { drawLines, drawScatter } from "./lines";
import type { DrawOptions } from "./shared";
import { drawSpans } from "./spans";
import { describeViolin, drawViolin } from "./violin";

const kExportWidth = 960;
const kMinWidth = 280;

export function drawChart(chart: Chart, options: DrawOptions): SVGSVGElement {
  switch (chart.chart) {
    case "violin":
      return drawViolin(chart, options);
    case "lines":
      return drawLines(chart, options);
    case "heatmap":
      return drawHeatmap(chart, options);
    case "intervals":
      return drawIntervals(chart, options);
    case "scatter":
      return drawScatter(chart, options);
    case "spans":
      return drawSpans(chart, options);
  }
}

const kKinds: Record<Chart["chart"], string> = {
  violin: "Violin chart",
  lines: "Line chart",
  heatmap: "Heat map",
  intervals: "Chart of values with intervals",
  scatter: "Scatter chart",
  spans: "Timeline",
};

function describe(section: ChartSection): string {
  const { chart, title } = section;
  const head = `${kKinds[chart.chart]}: ${title}.`;
  if ("groups" in chart) {
    return `${head} ${describeViolin(chart)}.`;
  }
  const names = chart.chart === "heatmap" ? chart.panels : chart.series;
  return `${head} Shows ${names.map(({ name }) => name).join(", ")}. The data is in the CSV export.`;
}

/** How many values a logarithmic axis cannot show; said rather than dropped silently. */
function hiddenOnLogAxis(chart: Chart): number {
  if (chart.chart === "violin" && chart.yScale === "log") {
    return chart.groups.flatMap((group) => group.values).filter((value) => value <= 0).length;
  }
  if (chart.chart === "lines" || chart.chart === "scatter") {
    const xScale = chart.chart === "scatter" ? chart.xScale : "linear";
    return chart.series
      .flatMap((series) => series.x.map((x, i) => [x, series.y[i]]))
      .filter(([x, y]) => (xScale === "log" && x <= 0) || (chart.yScale === "log" && y <= 0)).length;
  }
  if (chart.chart === "intervals" && chart.xScale === "log") {
    return chart.series.flatMap((series) => series.items).filter((item) => item.value <= 0).length;
  }
  return 0;
}

type CurveAxis = "zero" | "values" | "log";

const kCurveAxes: [CurveAxis, string][] = [
  ["zero", "From zero"],
  ["values", "Fitted to the values"],
  ["log", "Logarithmic"],
];

/** Values over more than a decade need the logarithm that the document asks for; others start at zero. */
export function firstCurveAxis(chart: LinesChart): CurveAxis {
  const positive = chart.series.flatMap(({ y }) => y).filter((value) => value > 0);
  const [low, high] = [Math.min(...positive), Math.max(...positive)];
  return chart.yScale === "log" && high > 10 * low ? "log" : "zero";
}

/** A chart with its exports. It is drawn when it comes near the view, and again for another width or theme. */
export function chartFigure(section: ChartSection): HTMLElement {
  const stage = h("div", { class: "chart-stage" });
  const figure = h("figure", { class: "card chart", "data-chart": section.chart.chart }, stage);
  const given = section.chart;
  let axis: CurveAxis = given.chart === "lines" ? firstCurveAxis(given) : "values";
  let drawnWidth = 0;
  let visible = false;

  const chart = (): Chart =>
    given.chart === "lines" ? { ...given, yScale: axis === "log" ? "log" : "linear" } : given;
  const options = (): Pick<DrawOptions, "yFrom"> => ({ yFrom: axis === "zero" ? "zero" : "values" });

  const draw = (paper = 0) => {
    const width = paper || Math.max(kMinWidth, Math.floor(stage.clientWidth));
    drawnWidth = width;
    try {
      const svg = drawChart(chart(), { width, colors: palette(), interactive: paper === 0, ...options() });
      svg.setAttribute("aria-label", describe(section));
      stage.replaceChildren(svg);
    } catch (error) {
      stage.replaceChildren(h("p", { class: "notice" }, `This chart cannot be drawn: ${messageOf(error)}`));
    }
  };
  const exported = () => {
    const svg = drawChart(chart(), { width: kExportWidth, colors: exportPalette(), interactive: false, ...options() });
    return {
      text: svgText(svg, exportPalette().background),
      width: Number(svg.getAttribute("width")),
      height: Number(svg.getAttribute("height")),
    };
  };
  const save = (ending: string, content: Blob) => download(`${section.id}.${ending}`, content);

  const exports = h(
    "div",
    { class: "exports", role: "group", "aria-label": `Export “${section.title}”` },
    button("SVG", () => save("svg", new Blob([exported().text], { type: "image/svg+xml" }))),
    button("PNG", async () => {
      const { text, width, height } = exported();
      save("png", await svgToPng(text, width, height));
    }),
    button("CSV", () => save("csv", csvBlob(chartRows(section.chart)))),
  );
  const remark = h("p", { class: "muted" });
  const say = () => {
    const hidden = hiddenOnLogAxis(chart());
    remark.textContent = hidden > 0 ? `${hidden} values are not positive and so not on the logarithmic axis.` : "";
  };
  say();
  const foot = h("div", { class: "figure-foot" });
  if (given.chart === "lines") {
    const axes = chooser(`Vertical axis of “${section.title}”`, kCurveAxes, axis, (chosen) => {
      axis = chosen;
      say();
      draw();
    });
    foot.append(h("label", { class: "check axis-choice" }, "Vertical axis", axes));
  }
  foot.append(remark, exports);
  figure.append(foot);

  const observer = new IntersectionObserver(
    (entries) => {
      visible = entries.some((entry) => entry.isIntersecting);
      if (visible && !isPrinting() && drawnWidth !== Math.max(kMinWidth, Math.floor(stage.clientWidth))) {
        draw();
      }
    },
    { rootMargin: "600px" },
  );
  observer.observe(figure);
  new ResizeObserver(() => {
    if (visible && !isPrinting() && Math.abs(stage.clientWidth - drawnWidth) > 1) {
      draw();
    }
  }).observe(stage);
  onThemeChange(() => (visible ? draw() : (drawnWidth = 0)));
  onPaper(
    () => draw(kPaperWidth),
    () => (visible ? draw() : (drawnWidth = 0)),
  );
  return figure;
}

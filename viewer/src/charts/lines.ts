// SPDX-License-Identifier: BSD-3-Clause
import * as Plot from "@observablehq/plot";
import type { LinesChart, ScatterChart } from "../document/report";
import { formatNumber } from "../math/format";
import { seriesColor, seriesDash, seriesSymbol } from "../series_style";
import type { Palette } from "../theme";
import {
  compose,
  drawable,
  extent,
  extentFromZero,
  plotStyle,
  pointerTip,
  quietAxis,
  seriesKeys,
  thresholdMarks,
  tickFormat,
  type DrawOptions,
} from "./shared";

const kMarkersUpTo = 30;
const kMarginLeft = 72;
const kMarginRight = 20;

interface LinePoint {
  name: string;
  x: number;
  y: number;
}

function xScaleOf(chart: LinesChart | ScatterChart): "linear" | "log" {
  return chart.chart === "scatter" ? chart.xScale : "linear";
}

/** Margins, scales and symbols of both kinds of chart. */
function frame(
  chart: LinesChart | ScatterChart,
  xDomain: [number, number],
  yDomain: [number, number],
  colors: Palette,
): Plot.PlotOptions {
  const names = chart.series.map((series) => series.name);
  return {
    marginLeft: kMarginLeft,
    marginRight: kMarginRight,
    marginBottom: 48,
    marginTop: 16,
    style: plotStyle(colors),
    x: { type: xScaleOf(chart), domain: xDomain, label: null },
    y: { type: chart.yScale, domain: yDomain, label: null },
    symbol: { domain: names, range: names.map(seriesSymbol) },
  };
}

function axes(
  chart: LinesChart | ScatterChart,
  xDomain: [number, number],
  yDomain: [number, number],
  colors: Palette,
  { xTicks, xTickSize = 6 }: { xTicks: number; xTickSize?: number },
): Plot.Markish[] {
  const style = quietAxis(colors);
  return [
    Plot.axisY({ ...style, label: chart.yLabel, ticks: 7, tickFormat: tickFormat(chart.yScale, yDomain) }),
    Plot.axisX({
      ...style,
      label: chart.xLabel,
      ticks: xTicks,
      tickSize: xTickSize,
      tickFormat: tickFormat(xScaleOf(chart), xDomain),
    }),
  ];
}

/** As many ticks as fit; between whole numbers, such as iterations, there are none. */
function tickCount(points: LinePoint[], width: number): number {
  const fit = Math.max(4, Math.round(width / 90));
  const xs = points.map(({ x }) => x);
  return xs.length > 0 && xs.every(Number.isInteger)
    ? Math.max(1, Math.min(fit, Math.max(...xs) - Math.min(...xs)))
    : fit;
}

export function drawLines(chart: LinesChart, options: DrawOptions): SVGSVGElement {
  const { colors } = options;
  const points: LinePoint[] = chart.series.flatMap((series) =>
    series.x.map((x, i) => ({ name: series.name, x, y: drawable(series.y[i], chart.yScale) ? series.y[i] : NaN })),
  );
  const inX = points.filter((point) => Number.isFinite(point.x));
  const xs = inX.map((point) => point.x);
  const [first, last] = [Math.min(...xs), Math.max(...xs)];
  // Curves end where their axis does.
  const xDomain: [number, number] = first < last ? [first, last] : extent(xs, "linear", false);
  const shown = inX.map((point) => point.y);
  const fromZero = options.yFrom === "zero" && chart.yScale === "linear";
  const yDomain = fromZero ? extentFromZero(shown) : extent(shown, chart.yScale, false);
  const marked = inX.filter(
    (point) =>
      Number.isFinite(point.y) &&
      (chart.series.find((series) => series.name === point.name)?.x.length ?? 0) <= kMarkersUpTo,
  );
  const color = (point: LinePoint) => seriesColor(point.name, colors);
  const plot = Plot.plot({
    width: options.width,
    height: Math.round(Math.min(420, Math.max(280, options.width * 0.42))),
    ...frame(chart, xDomain, yDomain, colors),
    marks: [
      Plot.gridY({ stroke: colors.rule, strokeOpacity: 1 }),
      ...axes(chart, xDomain, yDomain, colors, { xTicks: tickCount(inX, options.width) }),
      ...chart.series.map((series) =>
        Plot.line(
          inX.filter((point) => point.name === series.name),
          {
            x: "x",
            y: "y",
            stroke: seriesColor(series.name, colors),
            strokeWidth: 2,
            strokeDasharray: seriesDash(series.name) || "none",
          },
        ),
      ),
      Plot.dot(marked, { x: "x", y: "y", fill: color, symbol: "name", r: 3.5 }),
      ...pointerTip(
        inX.filter((point) => Number.isFinite(point.y)),
        options,
        (point) => `${point.name}\n${formatNumber(point.x)}: ${formatNumber(point.y, 5)}`,
      ),
    ],
  });
  return compose(
    plot,
    chart.series.map((series) => ({
      label: series.name,
      color: seriesColor(series.name, colors),
      mark: "line" as const,
      dash: seriesDash(series.name),
      ...(series.x.length <= kMarkersUpTo ? { symbol: seriesSymbol(series.name) } : {}),
    })),
    options,
  );
}

export function drawScatter(chart: ScatterChart, options: DrawOptions): SVGSVGElement {
  const { colors } = options;
  const points = chart.series.flatMap((series) =>
    series.x.flatMap((x, i) =>
      drawable(x, chart.xScale) && drawable(series.y[i], chart.yScale)
        ? [{ name: series.name, x, y: series.y[i], label: series.labels?.[i] ?? null }]
        : [],
    ),
  );
  const xDomain = extent([...points.map((p) => p.x), chart.xThreshold?.value ?? NaN], chart.xScale);
  const yDomain = extent([...points.map((p) => p.y), chart.yThreshold?.value ?? NaN], chart.yScale);
  const xTicks = Math.max(4, Math.round(options.width / 110));
  const along = (x: number) => (chart.xScale === "log" ? Math.log(x) : x);
  const shareOf = (x: number) => (along(x) - along(xDomain[0])) / (along(xDomain[1]) - along(xDomain[0]));
  const roomLeft = chart.xThreshold
    ? shareOf(chart.xThreshold.value) * (options.width - kMarginLeft - kMarginRight)
    : 0;
  const plot = Plot.plot({
    width: options.width,
    height: Math.round(Math.min(460, Math.max(300, options.width * 0.5))),
    ...frame(chart, xDomain, yDomain, colors),
    marks: [
      Plot.gridY({ stroke: colors.rule, strokeOpacity: 1 }),
      Plot.gridX({ stroke: colors.rule, strokeOpacity: 1, ticks: xTicks }),
      ...axes(chart, xDomain, yDomain, colors, { xTicks, xTickSize: 0 }),
      ...thresholdMarks(chart.xThreshold, "x", colors, roomLeft),
      ...thresholdMarks(chart.yThreshold, "y", colors),
      Plot.dot(points, {
        x: "x",
        y: "y",
        symbol: "name",
        r: 3.4,
        fillOpacity: 0.75,
        fill: (d) => seriesColor(d.name, colors),
      }),
      ...pointerTip(
        points,
        options,
        (d) => `${d.name}${d.label ? ` · ${d.label}` : ""}\n${formatNumber(d.x, 5)}, ${formatNumber(d.y, 5)}`,
      ),
    ],
  });
  const names = chart.series.map(({ name }) => name);
  return compose(plot, seriesKeys(names, colors, "dot"), options);
}

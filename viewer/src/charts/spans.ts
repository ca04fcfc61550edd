// SPDX-License-Identifier: BSD-3-Clause
import * as Plot from "@observablehq/plot";
import type { SpansChart } from "../document/report";
import { durationText, formatCount } from "../math/format";
import { seriesColor } from "../series_style";
import { compose, fitText, plotStyle, quietAxis, textWidth, type DrawOptions } from "./shared";

const kRow = 26;
/** Seconds since any start are below this, those since 1970 above: 1980. */
const kCalendarFrom = 315_532_800;
const kShortestBar = 3;

/** Bars over time, a row for each name; marks are ticks within a bar. */
export function drawSpans(chart: SpansChart, options: DrawOptions): SVGSVGElement {
  const { colors } = options;
  const spans = chart.series.flatMap((series) => series.spans.map((span) => ({ ...span, series: series.name })));
  const low = Math.min(...spans.map((span) => span.start));
  const high = Math.max(...spans.map((span) => span.end));
  const calendar = low >= kCalendarFrom;
  const at = (seconds: number) => (calendar ? new Date(1000 * seconds) : seconds);
  const rows = [...new Set(spans.map((span) => span.name))];
  const nameWidth = Math.min(options.width < 560 ? 110 : 240, Math.max(40, ...rows.map((row) => textWidth(row))) + 8);
  const inner = options.width - nameWidth - 14 - 16;
  const air = 0.01 * (high - low || 1);
  const perPixel = (high - low + 2 * air) / Math.max(1, inner);
  const bars = spans.map((span) => ({
    series: span.series,
    row: span.name,
    x1: at(span.start),
    x2: at(Math.max(span.end, span.start + kShortestBar * perPixel)),
    marks: span.marks.length,
    seconds: span.end - span.start,
  }));
  type Bar = (typeof bars)[number];
  const ticks = spans.flatMap((span) =>
    (span.end - span.start) / perPixel > 2 * span.marks.length
      ? span.marks.map((mark) => ({ row: span.name, x: at(mark) }))
      : [],
  );
  const color = (bar: Bar) => seriesColor(bar.series, colors);
  const title = (bar: Bar) => `${bar.series}\n${durationText(bar.seconds)}, ${formatCount(bar.marks)} keyframes`;
  const plot = Plot.plot({
    width: options.width,
    height: rows.length * kRow + 64,
    marginLeft: nameWidth + 14,
    marginRight: 16,
    marginTop: 8,
    marginBottom: 56,
    style: plotStyle(colors),
    x: { type: calendar ? "utc" : "linear", domain: [at(low - air), at(high + air)], label: null },
    y: { type: "band", domain: rows, axis: null, padding: 0.35 },
    marks: [
      Plot.gridX({ stroke: colors.rule, strokeOpacity: 1 }),
      Plot.axisX({
        ...quietAxis(colors),
        label: calendar ? `${chart.xLabel ?? "Time"} (UTC)` : `${chart.xLabel ?? "Time"} (s)`,
        ticks: options.width < 560 ? 3 : 7,
        labelOffset: 46,
      }),
      Plot.text(rows, {
        y: (row: string) => row,
        frameAnchor: "left",
        dx: -14,
        textAnchor: "end",
        fill: colors.ink,
        text: (row: string) => fitText(row, nameWidth),
      }),
      Plot.barX(bars, { x1: "x1", x2: "x2", y: "row", fill: color, rx: 2, ...(options.interactive ? { title } : {}) }),
      Plot.tickX(ticks, { x: "x", y: "row", stroke: colors.background, strokeOpacity: 0.55, pointerEvents: "none" }),
    ],
  });
  return compose(plot, [], options);
}

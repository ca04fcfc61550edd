// SPDX-License-Identifier: BSD-3-Clause
import * as Plot from "@observablehq/plot";
import type { IntervalsChart } from "../document/report";
import { formatNumber } from "../math/format";
import { seriesColor, seriesSymbol } from "../series_style";
import {
  compose,
  drawable,
  extent,
  fitText,
  plotStyle,
  quietAxis,
  seriesKeys,
  textWidth,
  tickFormat,
  type DrawOptions,
} from "./shared";

const kRow = 19;
const kGap = 16;

type IntervalRow = IntervalsChart["series"][number]["items"][number] & { key: string; y: number };

/** Dots with intervals; rows of one item stand together, one row per series. */
export function drawIntervals(chart: IntervalsChart, options: DrawOptions): SVGSVGElement {
  const { colors } = options;
  const items = [...new Set(chart.series.flatMap((series) => series.items.map((item) => item.name)))];
  const single = chart.series.length === 1;
  const rows: IntervalRow[] = [];
  const labels: { name: string; y: number }[] = [];
  let y = kGap / 2;
  for (const name of items) {
    const start = y;
    for (const series of chart.series) {
      for (const item of series.items.filter((candidate) => candidate.name === name)) {
        rows.push({ ...item, key: single ? name : series.name, y: y + kRow / 2 });
        y += kRow;
      }
    }
    labels.push({ name, y: (start + y) / 2 });
    y += single ? 6 : kGap;
  }
  const narrow = options.width < 560;
  const nameWidth = Math.min(narrow ? 110 : 220, Math.max(40, ...labels.map((label) => textWidth(label.name))) + 8);
  const numbersWidth = narrow ? 8 : 150;
  const all = rows.flatMap((row) => [row.value, row.low, row.high]);
  const isShare =
    chart.xScale === "linear" && all.every((value) => !Number.isFinite(value) || (value >= 0 && value <= 1));
  const domain: [number, number] = isShare ? [0, 1] : extent(all, chart.xScale);
  const shown = rows.filter((row) => drawable(row.value, chart.xScale));
  const hasIntervals = rows.some((row) => row.low !== row.high);
  const text = (row: IntervalRow) =>
    !hasIntervals
      ? formatNumber(row.value, 3)
      : `${formatNumber(row.value, 3)} [${formatNumber(row.low, 3)}, ${formatNumber(row.high, 3)}]`;
  const color = (row: IntervalRow) => seriesColor(row.key, colors);
  const keys = [...new Set(rows.map((row) => row.key))];
  const plot = Plot.plot({
    width: options.width,
    height: Math.round(y + 56),
    marginLeft: nameWidth + 14,
    marginRight: numbersWidth + 12,
    marginTop: 8,
    marginBottom: 48,
    style: plotStyle(colors),
    x: { domain, label: null, type: chart.xScale },
    y: { domain: [0, y], range: [8, y + 8], axis: null },
    symbol: { domain: keys, range: keys.map(seriesSymbol) },
    marks: [
      Plot.gridX({ stroke: colors.rule, strokeOpacity: 1 }),
      Plot.axisX({
        ...quietAxis(colors),
        label: chart.xLabel,
        tickFormat: tickFormat(chart.xScale, domain),
        ticks: narrow ? 4 : 7,
      }),
      Plot.text(labels, {
        y: "y",
        frameAnchor: "left",
        dx: -14,
        textAnchor: "end",
        fill: colors.ink,
        text: (d) => fitText(d.name, nameWidth),
      }),
      Plot.ruleY(shown, { y: "y", x1: "low", x2: "high", stroke: color, strokeWidth: 2 }),
      Plot.dot(shown, {
        x: "value",
        y: "y",
        fill: color,
        symbol: "key",
        r: 4.5,
        ...(options.interactive ? { title: (row: IntervalRow) => `${row.key}\n${text(row)}` } : {}),
      }),
      ...(narrow
        ? []
        : [
            Plot.text(rows, {
              y: "y",
              frameAnchor: "right",
              dx: 12,
              textAnchor: "start",
              text,
              fill: colors.muted,
              fontVariant: "tabular-nums",
            }),
          ]),
    ],
  });
  return compose(plot, single ? [] : seriesKeys(keys, colors, "line"), options);
}

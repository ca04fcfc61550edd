// SPDX-License-Identifier: BSD-3-Clause
import * as Plot from "@observablehq/plot";
import { interpolateViridis } from "d3-scale-chromatic";
import { s } from "../dom";
import type { HeatmapChart } from "../document/report";
import { formatNumber } from "../math/format";
import { compose, fitText, kFont, kFontSize, plotStyle, quietAxis, textWidth, type DrawOptions } from "./shared";

const kPanelWidth = 250;
/** Tips say what a cell is of by its own channels. */
const kNoPlaces = Object.fromEntries(
  ["x", "y", "fx", "fy", "x1", "y1", "x2", "y2", "fill"].map((name) => [name, false]),
);
let gradients = 0;

export function heatmapRange(chart: HeatmapChart): [number, number] {
  if (chart.range) {
    return chart.range;
  }
  const values = chart.panels.flatMap((panel) => panel.values.flat()).filter(Number.isFinite);
  const low = values.reduce((a, b) => Math.min(a, b), Infinity);
  const high = values.reduce((a, b) => Math.max(a, b), -Infinity);
  return low < high ? [low, high] : [Number.isFinite(low) ? low : 0, (Number.isFinite(low) ? low : 0) + 1];
}

/** One grid per panel in a common colour scale; cells without a value are crossed out, never coloured. */
export function drawHeatmap(chart: HeatmapChart, options: DrawOptions): SVGSVGElement {
  const { colors } = options;
  const columns = Math.max(1, Math.min(chart.panels.length, Math.floor(options.width / kPanelWidth)));
  const rows = Math.ceil(chart.panels.length / columns);
  const cells = chart.panels.flatMap((panel, p) =>
    panel.values.flatMap((line, j) =>
      line.map((value, i) => ({
        column: p % columns,
        row: Math.floor(p / columns),
        panel: panel.name,
        x1: chart.x[i],
        x2: chart.x[i + 1],
        y1: chart.y[j],
        y2: chart.y[j + 1],
        value,
        count: panel.counts?.[j]?.[i] ?? null,
      })),
    ),
  );
  type HeatCell = (typeof cells)[number];
  const [low, high] = heatmapRange(chart);
  const shade = (value: number) => interpolateViridis(Math.min(1, Math.max(0, (value - low) / (high - low || 1))));
  const marginLeft = 64;
  const panelWidth = (options.width - marginLeft - 12) / columns;
  const panelHeight = Math.min(260, Math.max(150, panelWidth * 0.8));
  const cellWidth = (panelWidth * 0.92) / Math.max(1, chart.x.length - 1);
  const cellHeight = (panelHeight * 0.85) / Math.max(1, chart.y.length - 1);
  const withNumbers = cellWidth >= 34 && cellHeight >= 15;
  const present = cells.filter((cell) => Number.isFinite(cell.value));
  const titles = chart.panels.map((panel, p) => ({
    name: panel.name,
    column: p % columns,
    row: Math.floor(p / columns),
  }));
  const facets = { fx: "column", fy: "row" } as const;
  const box = { x1: "x1", x2: "x2", y1: "y1", y2: "y2", inset: 0.5 } as const;
  const plot = Plot.plot({
    width: options.width,
    height: Math.round(rows * (panelHeight + 26) + 56),
    marginLeft,
    marginRight: 12,
    marginTop: 26,
    marginBottom: 46,
    style: plotStyle(colors),
    fx: { axis: null, padding: 0.06 },
    fy: { axis: null, padding: 0.14 },
    x: { domain: [chart.x[0], chart.x[chart.x.length - 1]], label: null },
    y: { domain: [chart.y[0], chart.y[chart.y.length - 1]], label: null },
    marks: [
      Plot.axisY({ ...quietAxis(colors), label: chart.yLabel, ticks: 5 }),
      Plot.axisX({ ...quietAxis(colors), label: chart.xLabel, ticks: 5 }),
      Plot.rect(cells, { ...facets, ...box, fill: colors.fill }),
      Plot.text(
        cells.filter((cell) => !Number.isFinite(cell.value)),
        {
          ...facets,
          x: (d: HeatCell) => (d.x1 + d.x2) / 2,
          y: (d: HeatCell) => (d.y1 + d.y2) / 2,
          text: () => "×",
          fill: colors.muted,
        },
      ),
      Plot.rect(present, {
        ...facets,
        ...box,
        fill: (d: HeatCell) => shade(d.value),
        ...(options.interactive
          ? {
              tip: { format: kNoPlaces },
              channels: {
                Panel: { value: "panel" },
                X: { value: (d: HeatCell) => `${formatNumber(d.x1)} to ${formatNumber(d.x2)}` },
                Y: { value: (d: HeatCell) => `${formatNumber(d.y1)} to ${formatNumber(d.y2)}` },
                Value: { value: (d: HeatCell) => formatNumber(d.value) },
                Cases: { value: (d: HeatCell) => (d.count === null ? "–" : String(d.count)) },
              },
            }
          : {}),
      }),
      ...(withNumbers
        ? [
            Plot.text(present, {
              ...facets,
              x: (d: HeatCell) => (d.x1 + d.x2) / 2,
              y: (d: HeatCell) => (d.y1 + d.y2) / 2,
              text: (d: HeatCell) => formatNumber(d.value, 2),
              fontSize: 11,
              pointerEvents: "none",
              fill: (d: HeatCell) => ((d.value - low) / (high - low || 1) > 0.55 ? "#10151a" : "#ffffff"),
            }),
          ]
        : []),
      Plot.text(titles, {
        fx: "column",
        fy: "row",
        frameAnchor: "top-left",
        dy: -16,
        textAnchor: "start",
        fontWeight: 600,
        text: (d) => fitText(d.name, panelWidth - 20),
        fill: colors.ink,
      }),
    ],
  });
  return compose(plot, [], options, colorBar(chart.valueLabel ?? "Value", [low, high], options));
}

function colorBar(
  label: string,
  [low, high]: [number, number],
  options: DrawOptions,
): { node: SVGElement; height: number } {
  const { colors } = options;
  const id = `cairn-gradient-${++gradients}`;
  const gradient = s("linearGradient", { id });
  for (let i = 0; i <= 16; ++i) {
    gradient.append(s("stop", { offset: i / 16, "stop-color": interpolateViridis(i / 16) }));
  }
  const barWidth = Math.min(220, options.width * 0.4);
  const shown = fitText(label, options.width - barWidth - 120);
  const x = textWidth(shown) + textWidth(formatNumber(low, 3)) + 20;
  const text = (at: number, content: string, anchor: string) =>
    s("text", { x: at, y: 12, fill: colors.ink, "text-anchor": anchor }, content);
  const node = s(
    "g",
    { "font-family": kFont, "font-size": kFontSize },
    s("defs", null, gradient),
    text(0, shown, "start"),
    text(x - 6, formatNumber(low, 3), "end"),
    s("rect", { x, y: 2, width: barWidth, height: 12, rx: 2, fill: `url(#${id})` }),
    text(x + barWidth + 6, formatNumber(high, 3), "start"),
  );
  return { node, height: 26 };
}

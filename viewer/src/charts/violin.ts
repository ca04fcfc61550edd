// SPDX-License-Identifier: BSD-3-Clause
import * as Plot from "@observablehq/plot";
import type { ViolinChart } from "../document/report";
import { formatNumber } from "../math/format";
import { bandwidth, kernelDensity, sortedFinite, summarise } from "../math/statistics";
import { seriesColor } from "../series_style";
import {
  compose,
  drawable,
  extent,
  fitText,
  plainThreshold,
  plotStyle,
  quietAxis,
  textWidth,
  thresholdKey,
  tickFormat,
  type DrawOptions,
} from "./shared";

const kSteps = 96;
const kCentre = 0.08;
const kHalfWidth = 0.34;
const kBoxHalfWidth = 0.07;
const kPointsLeft = -0.42;
const kPointsSpread = 0.1;
const kMinBand = 58;

/** The outline of a group's density, scaled to the widest half of 1; empty if the values do not vary. */
export function violinOutline(
  values: number[],
  scale: "linear" | "log",
  most = Infinity,
): { y: number; half: number }[] {
  const transformed = sortedFinite(scale === "log" ? values.map(Math.log10) : values);
  const width = bandwidth(transformed);
  if (transformed.length < 3 || width === 0) {
    return [];
  }
  const first = transformed[0];
  const last = transformed[transformed.length - 1];
  // Quantities that are never negative, or never above the most, keep a density that is not either.
  const low = scale === "linear" && first >= 0 ? Math.max(0, first - 2 * width) : first - 2 * width;
  const high = Math.max(last, Math.min(most, last + 2 * width));
  const points = Float64Array.from({ length: kSteps + 1 }, (_, i) => low + ((high - low) * i) / kSteps);
  const density = kernelDensity(transformed, width, points);
  const peak = Math.max(...density);
  return [...points].map((point, i) => ({ y: scale === "log" ? 10 ** point : point, half: density[i] / peak }));
}

/** A spread from 0 to 1 that looks random and is the same every time. */
function jitter(index: number): number {
  return (index * 0.6180339887 + 0.5) % 1;
}

export function drawViolin(chart: ViolinChart, options: DrawOptions): SVGSVGElement {
  const { colors } = options;
  const scale = chart.yScale;
  const most = chart.yLabel?.endsWith("(%)") ? 100 : Infinity;
  const groups = chart.groups.map((group, index) => ({
    ...group,
    index,
    color: seriesColor(group.name, colors),
    shown: group.values.filter((value) => drawable(value, scale)),
  }));
  const summaries = groups.map((group) => summarise(group.shown));
  const outline = groups.flatMap((group) =>
    violinOutline(group.shown, scale, most).map((point) => ({ group: group.index, ...point })),
  );
  type OutlinePoint = (typeof outline)[number];
  const points = groups.flatMap((group) =>
    group.values.flatMap((value, i) =>
      drawable(value, scale)
        ? [
            {
              x: group.index + kPointsLeft + kPointsSpread * (jitter(i) - 0.5),
              y: value,
              group,
              label: group.labels?.[i] ?? null,
            },
          ]
        : [],
    ),
  );
  const domain = extent([...points.map((p) => p.y), ...outline.map((p) => p.y), chart.threshold?.value ?? NaN], scale);
  const boxes = groups.flatMap((group) => {
    const summary = summaries[group.index];
    return summary ? [{ ...summary, centre: group.index + kCentre, color: group.color }] : [];
  });
  const marginLeft = options.width < 480 ? 60 : 72;
  const width = Math.max(options.width, marginLeft + 20 + kMinBand * groups.length);
  const band = (width - marginLeft - 20) / Math.max(1, groups.length);
  const slanted = groups.some((group) => textWidth(group.name) > band - 8);
  const colorOf = (index: number) => groups[index].color;
  const plot = Plot.plot({
    width,
    height: Math.round(Math.min(440, Math.max(320, width * 0.45))),
    marginLeft,
    marginRight: 20,
    marginBottom: slanted ? 96 : 58,
    marginTop: 16,
    style: plotStyle(colors),
    x: { domain: [-0.55, groups.length - 0.45], label: null },
    y: { type: scale, domain, label: null, grid: true },
    marks: [
      Plot.gridY({ stroke: colors.rule, strokeOpacity: 1 }),
      Plot.axisY({ ...quietAxis(colors), label: chart.yLabel, tickFormat: tickFormat(scale, domain), ticks: 7 }),
      Plot.axisX(
        groups.map((group) => group.index),
        {
          ...quietAxis(colors),
          color: colors.ink,
          tickFormat: (i: number) => fitText(groups[i]?.name ?? "", slanted ? 96 : band - 8),
          tickRotate: slanted ? -32 : 0,
          label: chart.xLabel,
          labelOffset: slanted ? 86 : 46,
        },
      ),
      Plot.areaX(outline, {
        y: "y",
        x1: (d: OutlinePoint) => d.group + kCentre - kHalfWidth * d.half,
        x2: (d: OutlinePoint) => d.group + kCentre + kHalfWidth * d.half,
        z: "group",
        fill: (d: OutlinePoint) => colorOf(d.group),
        fillOpacity: 0.22,
        stroke: (d: OutlinePoint) => colorOf(d.group),
        strokeWidth: 1.25,
        curve: "natural",
      }),
      Plot.ruleX(boxes, { x: "centre", y1: "whiskerLow", y2: "whiskerHigh", stroke: "color" }),
      Plot.rect(boxes, {
        x1: (d) => d.centre - kBoxHalfWidth,
        x2: (d) => d.centre + kBoxHalfWidth,
        y1: "q1",
        y2: "q3",
        fill: colors.background,
        fillOpacity: 0.85,
        stroke: "color",
        strokeWidth: 1.5,
      }),
      Plot.ruleY(boxes, {
        y: "mean",
        x1: (d) => d.centre - 0.2,
        x2: (d) => d.centre + 0.2,
        stroke: colors.ink,
        strokeWidth: 1.5,
        strokeDasharray: "3 3",
      }),
      Plot.ruleY(boxes, {
        y: "median",
        x1: (d) => d.centre - kBoxHalfWidth,
        x2: (d) => d.centre + kBoxHalfWidth,
        stroke: colors.ink,
        strokeWidth: 2.5,
      }),
      Plot.dot(points, {
        x: "x",
        y: "y",
        r: 2.4,
        fill: (d) => d.group.color,
        fillOpacity: 0.7,
        ...(options.interactive
          ? {
              tip: { format: { x: false, y: false, fill: false } },
              channels: {
                Group: { value: (d) => d.group.name },
                Value: { value: (d) => formatNumber(d.y, 5) },
                Case: { value: (d) => d.label ?? "" },
              },
            }
          : {}),
      }),
      ...plainThreshold(chart.threshold, colors),
    ],
  });
  return compose(
    plot,
    [
      { label: "Density", color: colors.muted, mark: "area" },
      { label: "Median", color: colors.ink, mark: "line" },
      { label: "Mean", color: colors.ink, mark: "line", dash: "3 3" },
      { label: "One value", color: colors.muted, mark: "dot", symbol: "circle" },
      ...thresholdKey(chart.threshold, colors),
    ],
    options,
  );
}

export function describeViolin(chart: ViolinChart): string {
  const parts = chart.groups.map((group) => {
    const summary = summarise(group.values);
    return summary
      ? `${group.name}: median ${formatNumber(summary.median)}, mean ${formatNumber(summary.mean)}, ${summary.count} values`
      : `${group.name}: no values`;
  });
  return parts.join("; ");
}

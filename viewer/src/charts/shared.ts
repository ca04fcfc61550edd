// SPDX-License-Identifier: BSD-3-Clause
import * as Plot from "@observablehq/plot";
import { s } from "../dom";
import { formatNumber } from "../math/format";
import type { Scale, Threshold } from "../document/report";
import { seriesColor, seriesSymbol } from "../series_style";
import type { Palette } from "../theme";

export const kFont = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif';
export const kFontSize = 12;

export interface DrawOptions {
  width: number;
  colors: Palette;
  /** Tips under the pointer; off in exports. */
  interactive: boolean;
  /** Where the y axis of curves starts. */
  yFrom?: "zero" | "values";
}

export interface LegendItem {
  label: string;
  color: string;
  mark: "line" | "dot" | "area";
  dash?: string;
  symbol?: string;
}

export function plotStyle(colors: Palette): Partial<CSSStyleDeclaration> {
  return { background: "none", color: colors.ink, fontFamily: kFont, fontSize: `${kFontSize}px`, overflow: "visible" };
}

/** An axis whose label stands at its middle, without marks at its ticks. */
export function quietAxis(colors: Palette) {
  return { tickSize: 0, color: colors.muted, labelArrow: "none", labelAnchor: "center" } as const;
}

let measuring: CanvasRenderingContext2D | null = null;

export function textWidth(text: string, size = kFontSize, weight = 400): number {
  measuring ??= document.createElement("canvas").getContext("2d");
  if (!measuring) {
    return text.length * size * 0.6;
  }
  measuring.font = `${weight} ${size}px ${kFont}`;
  return measuring.measureText(text).width;
}

/** `text`, or as much of it as fits into `width` pixels. */
export function fitText(text: string, width: number, size = kFontSize): string {
  if (textWidth(text, size) <= width) {
    return text;
  }
  let fits = 0;
  for (let low = 0, high = Math.min(text.length, 400); low <= high; ) {
    const middle = (low + high) >> 1;
    if (textWidth(`${text.slice(0, middle)}…`, size) <= width) {
      fits = middle;
      low = middle + 1;
    } else {
      high = middle - 1;
    }
  }
  return `${text.slice(0, fits)}…`;
}

/** Ticks as people write them; on a log axis only the powers of ten once there are several. */
export function tickFormat(scale: Scale, domain: [number, number]): (value: number) => string {
  const decades = scale === "log" ? Math.log10(domain[1] / domain[0]) : 0;
  return (value) => {
    if (decades > 1.5) {
      const lead = value / 10 ** Math.floor(Math.log10(value) + 1e-9);
      const shown = Math.abs(lead - 1) < 1e-6 || (decades < 3 && Math.abs(lead - 3) < 0.5);
      if (!shown) {
        return "";
      }
    }
    return formatNumber(value, 3);
  };
}

/** The values' extent with zero in it: differences look as large as they are. */
export function extentFromZero(values: number[]): [number, number] {
  const [low, high] = extent([0, ...values], "linear");
  if (values.some((value) => value < 0)) {
    return [low, high];
  }
  return [0, values.some((value) => value > 0) ? high : 1];
}

/** The values' extent with some air; on a log scale only what is positive counts. */
export function extent(values: Iterable<number>, scale: Scale, includeZeroNear = true): [number, number] {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (Number.isFinite(value) && (scale === "linear" || value > 0)) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) {
    return scale === "log" ? [0.1, 1] : [0, 1];
  }
  if (scale === "log") {
    const air = Math.max(1.1, (high / low) ** 0.04);
    return [low / air, high * air];
  }
  const air = (high - low || Math.abs(high) || 1) * 0.05;
  const fromZero = includeZeroNear && low >= 0 && low < 0.6 * high;
  return [fromZero ? 0 : low - air, high + air];
}

/** A tip at the point nearest to the pointer; none in exports. */
export function pointerTip<Point extends { name: string; x: number; y: number }>(
  points: Point[],
  { colors, interactive }: DrawOptions,
  title: (point: Point) => string,
): Plot.Markish[] {
  const stroke = (point: Point) => seriesColor(point.name, colors);
  return interactive
    ? [Plot.tip(points, Plot.pointer({ x: "x", y: "y", stroke, fill: colors.background, title }))]
    : [];
}

/** Keys of series by their names. */
export function seriesKeys(names: string[], colors: Palette, mark: LegendItem["mark"]): LegendItem[] {
  return names.map((name) => ({ label: name, color: seriesColor(name, colors), mark, symbol: seriesSymbol(name) }));
}

export function drawable(value: number, scale: Scale): boolean {
  return Number.isFinite(value) && (scale === "linear" || value > 0);
}

const kThresholdDash = "6 4";

function thresholdLine(axis: "x" | "y", threshold: Threshold, colors: Palette): Plot.Markish {
  const stroke = { stroke: colors.threshold, strokeWidth: 1.25, strokeDasharray: kThresholdDash };
  return axis === "y" ? Plot.ruleY([threshold.value], stroke) : Plot.ruleX([threshold.value], stroke);
}

/** A threshold without its label, which the legend has: for a chart whose marks leave no room on the line. */
export function plainThreshold(threshold: Threshold | null, colors: Palette): Plot.Markish[] {
  return threshold ? [thresholdLine("y", threshold, colors)] : [];
}

export function thresholdKey(threshold: Threshold | null, colors: Palette): LegendItem[] {
  return threshold ? [{ label: threshold.label, color: colors.threshold, mark: "line", dash: kThresholdDash }] : [];
}

/** @param roomLeft of a vertical line, pixels: its label is on the side of what does not exceed it, if there is room */
export function thresholdMarks(
  threshold: Threshold | null,
  axis: "x" | "y",
  colors: Palette,
  roomLeft = 0,
): Plot.Markish[] {
  if (!threshold) {
    return [];
  }
  const isLeft = textWidth(threshold.label) + 10 < roomLeft;
  const text = { text: () => threshold.label, fill: colors.threshold, stroke: colors.background, strokeWidth: 4 };
  return axis === "y"
    ? [
        thresholdLine(axis, threshold, colors),
        Plot.text([threshold.value], { ...text, y: (d: number) => d, frameAnchor: "right", dy: -8, textAnchor: "end" }),
      ]
    : [
        thresholdLine(axis, threshold, colors),
        Plot.text([threshold.value], {
          ...text,
          x: (d: number) => d,
          frameAnchor: "top",
          dx: isLeft ? -5 : 5,
          dy: 8,
          textAnchor: isLeft ? "end" : "start",
        }),
      ];
}

const kSymbolPaths: Record<string, string> = {
  circle: "M4,0A4,4 0 1 1 -4,0A4,4 0 1 1 4,0Z",
  square: "M-3.6,-3.6H3.6V3.6H-3.6Z",
  triangle: "M0,-4.6L4.2,3.2H-4.2Z",
  diamond: "M0,-5L4,0L0,5L-4,0Z",
  cross: "M-1.4,-4.4H1.4V-1.4H4.4V1.4H1.4V4.4H-1.4V1.4H-4.4V-1.4H-1.4Z",
  star: "M0,-5L1.3,-1.7L4.8,-1.5L2.1,0.7L3,4.1L0,2.2L-3,4.1L-2.1,0.7L-4.8,-1.5L-1.3,-1.7Z",
  wye: "M0,0.9L3.9,3.2L4.9,1.5L1.1,-0.8V-5H-1.1V-0.8L-4.9,1.5L-3.9,3.2Z",
  times: "M-4.2,-2.6L-2.6,-4.2L0,-1.6L2.6,-4.2L4.2,-2.6L1.6,0L4.2,2.6L2.6,4.2L0,1.6L-2.6,4.2L-4.2,2.6L-1.6,0Z",
};

export function symbolPath(symbol: string): string {
  return kSymbolPaths[symbol] ?? kSymbolPaths.circle;
}

/** A row of keys, wrapped to `width`; returns its group and height. */
function legendGroup(items: LegendItem[], width: number, colors: Palette): [SVGGElement, number] {
  const group = s("g", { "font-family": kFont, "font-size": kFontSize });
  const kRow = 20;
  let x = 0;
  let row = 0;
  for (const item of items) {
    const label = fitText(item.label, Math.max(60, width - 40));
    const size = 30 + textWidth(label) + 18;
    if (x > 0 && x + size > width) {
      x = 0;
      ++row;
    }
    const key = s("g", { transform: `translate(${x},${row * kRow + 10})` });
    if (item.mark === "area") {
      key.append(
        s("rect", { x: 2, y: -5, width: 20, height: 10, fill: item.color, "fill-opacity": 0.3, stroke: item.color }),
      );
    } else {
      if (item.mark === "line") {
        key.append(
          s("line", {
            x1: 0,
            x2: 24,
            y1: 0,
            y2: 0,
            stroke: item.color,
            "stroke-width": 2,
            "stroke-dasharray": item.dash || null,
          }),
        );
      }
      if (item.symbol) {
        key.append(s("path", { d: symbolPath(item.symbol), transform: "translate(12,0)", fill: item.color }));
      }
    }
    key.append(s("text", { x: 30, y: 4, fill: colors.ink }, label));
    group.append(key);
    x += size;
  }
  return [group, items.length === 0 ? 0 : (row + 1) * kRow + 8];
}

/** Puts a legend above a plot, in one SVG that can be exported as it is. */
export function compose(
  plot: SVGElement | HTMLElement,
  legend: LegendItem[],
  options: DrawOptions,
  extra: { node: SVGElement; height: number } | null = null,
): SVGSVGElement {
  const inner = plot as unknown as SVGSVGElement;
  const width = Number(inner.getAttribute("width"));
  const height = Number(inner.getAttribute("height"));
  const [keys, keysHeight] = legendGroup(legend, Math.min(width, options.width), options.colors);
  const top = keysHeight + (extra?.height ?? 0);
  const outer = s("svg", {
    xmlns: "http://www.w3.org/2000/svg",
    width,
    height: height + top,
    viewBox: `0 0 ${width} ${height + top}`,
    role: "img",
    class: "chart-svg",
  });
  if (keysHeight > 0) {
    outer.append(keys);
  }
  if (extra) {
    extra.node.setAttribute("transform", `translate(0,${keysHeight})`);
    outer.append(extra.node);
  }
  inner.setAttribute("y", String(top));
  Object.assign(inner.style, { height: `${height}px`, width: `${width}px`, maxWidth: "none", overflow: "visible" });
  outer.append(inner);
  return outer;
}

// SPDX-License-Identifier: BSD-3-Clause
import type { Cell, Chart } from "../document/report";

/** A chart's data as rows for CSV, the first of them the header. */
export function chartRows(chart: Chart): Cell[][] {
  switch (chart.chart) {
    case "violin":
      return [
        ["group", "label", chart.yLabel ?? "value"],
        ...chart.groups.flatMap((group) =>
          group.values.map((value, i): Cell[] => [group.name, group.labels?.[i] ?? null, value]),
        ),
      ];
    case "lines":
      return [
        ["series", chart.xLabel ?? "x", chart.yLabel ?? "y"],
        ...chart.series.flatMap((series) => series.x.map((x, i): Cell[] => [series.name, x, series.y[i]])),
      ];
    case "heatmap":
      return [
        ["panel", "x_low", "x_high", "y_low", "y_high", chart.valueLabel ?? "value", "count"],
        ...chart.panels.flatMap((panel) =>
          panel.values.flatMap((row, j) =>
            row.map((value, i): Cell[] => [
              panel.name,
              chart.x[i],
              chart.x[i + 1],
              chart.y[j],
              chart.y[j + 1],
              value,
              panel.counts?.[j]?.[i] ?? null,
            ]),
          ),
        ),
      ];
    case "intervals":
      return [
        ["series", "item", chart.xLabel ?? "value", "low", "high"],
        ...chart.series.flatMap((series) =>
          series.items.map((item): Cell[] => [series.name, item.name, item.value, item.low, item.high]),
        ),
      ];
    case "spans":
      return [
        ["series", "row", "start", "end", "marks"],
        ...chart.series.flatMap((series) =>
          series.spans.map((span): Cell[] => [series.name, span.name, span.start, span.end, span.marks.length]),
        ),
      ];
    case "scatter":
      return [
        ["series", "label", chart.xLabel ?? "x", chart.yLabel ?? "y"],
        ...chart.series.flatMap((series) =>
          series.x.map((x, i): Cell[] => [series.name, series.labels?.[i] ?? null, x, series.y[i]]),
        ),
      ];
  }
}

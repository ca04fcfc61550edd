// SPDX-License-Identifier: BSD-3-Clause
import { facts, h } from "../dom";
import { formatLength, formatNumber, idText, positionText } from "../math/format";
import { positionOf } from "../math/pose";
import { columnValue } from "./coloring";
import type { Pane } from "./pane";
import type { Pick } from "./picking";
import type { SceneModel } from "./scene_model";

/** One strategy's match, residual and position of a source landmark. */
function runRows(model: SceneModel, pane: Pane, pick: Pick): HTMLElement {
  const match = pane.matchOf(pick);
  const matched = !pane.run?.matches ? "–" : match === null ? "none" : idText(model.target.ids, match);
  const residual = match === null ? "–" : formatLength(model.residual(pane.pose, pick.index, match), model.lengthUnit);
  return h(
    "tbody",
    null,
    h(
      "tr",
      null,
      h("th", { scope: "row" }, pane.run?.name ?? ""),
      h("td", { "data-record": "match" }, matched),
      h("td", { "data-record": "residual" }, residual),
    ),
    h(
      "tr",
      null,
      h(
        "td",
        { colspan: 3, class: "muted", "data-record": "in-target" },
        `in target’s frame ${positionText(pane.positionInTarget(pick))}`,
      ),
    ),
  );
}

/** Everything the report knows about one landmark, at the current iteration. */
export function recordContent(model: SceneModel, panes: Pane[], pick: Pick): HTMLElement[] {
  const cloud = pick.role === "source" ? model.source : model.target;
  if (!cloud) {
    return [];
  }
  const unit = cloud.lengthUnit === "m" ? "m" : "map units";
  const content: HTMLElement[] = [
    h("h3", null, `${pick.role === "source" ? "Source" : "Target"} landmark ${idText(cloud.ids, pick.index)}`),
    facts("record-facts", [
      ["Map", cloud.name, { "data-record": "map" }],
      [`Position (${unit})`, positionText(positionOf(cloud, pick.index), 5), { "data-record": "position" }],
      ...cloud.columns.map((column): [string, string, { "data-record": string }] => {
        const value = formatNumber(columnValue(column, pick.index), 5);
        return [column.label, column.unit ? `${value} ${column.unit}` : value, { "data-record": "column" }];
      }),
    ]),
  ];
  const runs = panes.filter((pane) => pane.run);
  if (pick.role === "source" && runs.length > 0) {
    content.push(
      h("h4", null, "At this iteration"),
      h(
        "table",
        { class: "record-runs" },
        h(
          "thead",
          null,
          h("tr", null, ...["Strategy", "Match", "Residual"].map((name) => h("th", { scope: "col" }, name))),
        ),
        ...runs.map((pane) => runRows(model, pane, pick)),
      ),
    );
  }
  if (pick.role === "target" && runs.some((pane) => pane.run?.matches)) {
    content.push(
      h("h4", null, "Source landmarks matched with it"),
      facts(
        "record-facts",
        runs.map((pane) => [
          pane.run?.name ?? "",
          String(pane.countMatchedWith(pick.index)),
          { "data-record": "matched-by" },
        ]),
      ),
    );
  }
  return content;
}

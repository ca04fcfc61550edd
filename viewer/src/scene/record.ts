// SPDX-License-Identifier: BSD-3-Clause
import { h } from "../dom";
import type { LandmarkCloud } from "../document/report";
import { formatLength, formatNumber, idText } from "../math/format";
import { positionOf } from "../math/pose";
import { columnValue } from "./coloring";
import type { Pane } from "./pane";
import type { Pick } from "./picking";
import type { SceneModel } from "./scene_model";

function positionText(p: readonly number[], digits = 5): string {
  return p.map((value) => formatNumber(value, digits)).join(", ");
}

function unitText(cloud: LandmarkCloud): string {
  return cloud.lengthUnit === "m" ? "m" : "map units";
}

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
        `in target’s frame ${positionText(pane.positionInTarget(pick), 4)}`,
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
  const facts = h("dl", { class: "record-facts" });
  const fact = (name: string, value: string, key: string) =>
    facts.append(h("div", { "data-record": key }, h("dt", null, name), h("dd", null, value)));
  fact("Map", cloud.name, "map");
  fact(`Position (${unitText(cloud)})`, positionText(positionOf(cloud, pick.index)), "position");
  for (const column of cloud.columns) {
    const value = formatNumber(columnValue(column, pick.index), 5);
    fact(column.label, column.unit ? `${value} ${column.unit}` : value, "column");
  }
  const content: HTMLElement[] = [
    h("h3", null, `${pick.role === "source" ? "Source" : "Target"} landmark ${idText(cloud.ids, pick.index)}`),
    facts,
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
      h(
        "dl",
        { class: "record-facts" },
        ...runs.map((pane) =>
          h(
            "div",
            { "data-record": "matched-by" },
            h("dt", null, pane.run?.name ?? ""),
            h("dd", null, String(pane.countMatchedWith(pick.index))),
          ),
        ),
      ),
    );
  }
  return content;
}

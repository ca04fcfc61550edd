// SPDX-License-Identifier: BSD-3-Clause
import { fitText } from "../charts/shared";
import { h, pressable, redrawn, s } from "../dom";
import { formatProbability } from "../math/format";
import type { Palette } from "../theme";
import { fromAbove, spread, type Place } from "./graph_layout";
import { counts, kUseTexts, linkColor, type NetworkModel, type Selection } from "./network_model";

/** Links beyond this are no stops of the Tab key; the table below has them all. */
const kTabStops = 80;
const kBand = 64;
const kEdge = 46;
const kLabelFrom = 44;

/** The maps as dots where they are seen from above, and the links between them. */
export class GraphView {
  readonly element = h("div", { class: "network-graph" });
  readonly #model: NetworkModel;
  readonly #onSelect: (selection: Selection | null) => void;

  constructor(model: NetworkModel, onSelect: (selection: Selection | null) => void) {
    this.#model = model;
    this.#onSelect = onSelect;
  }

  /** Places of all nodes: groups side by side, maps without a pose in a row below. */
  #places(width: number, height: number, gap: number): Place[] {
    const model = this.#model;
    const places: Place[] = model.nodes.map(() => ({ x: 0, y: 0 }));
    const groups = model.section.groups.map((group, g) => ({
      group,
      members: model.nodes.flatMap((node, index) => (node.group === g ? [index] : [])),
    }));
    const total = groups.reduce((sum, { members }) => sum + Math.sqrt(members.length), 0);
    const loose = model.nodes.flatMap((node, index) => (node.group === null ? [index] : []));
    const rows = Math.ceil((loose.length * gap) / Math.max(gap, width - 2 * kEdge)) || 0;
    const band = Math.min(height / 2, rows * kBand);
    let left = 0;
    for (const { group, members } of groups) {
      const share = (width * Math.sqrt(members.length)) / total;
      const above = fromAbove(
        members.map((index) => model.centreOf(index, model.lastStage)),
        group.up ?? model.extent.orbit.up,
      );
      const edge = Math.min(kEdge, share / 4);
      const inside = spread(above, share - 2 * edge, height - band - 2 * kEdge, gap);
      members.forEach((index, i) => (places[index] = { x: left + edge + inside[i].x, y: kEdge + inside[i].y }));
      left += share;
    }
    const perRow = Math.ceil(loose.length / Math.max(1, rows));
    loose.forEach((index, i) => {
      const row = Math.floor(i / perRow);
      const inRow = Math.min(perRow, loose.length - row * perRow);
      places[index] = { x: (width * ((i % perRow) + 0.5)) / inRow, y: height - band + (band * (row + 0.5)) / rows };
    });
    return places;
  }

  draw(colors: Palette, selected: Selection | null, rejected: boolean, paperWidth?: number): void {
    const model = this.#model;
    const width = Math.max(240, paperWidth ?? this.element.clientWidth);
    const count = model.nodes.length;
    const height = Math.round(Math.min(520, Math.max(250, 0.62 * width)));
    const gap = Math.min(96, Math.max(14, 0.75 * Math.sqrt((width * height) / Math.max(1, count))));
    const places = this.#places(width, height, gap);
    const most = Math.max(...model.nodes.map((node) => node.landmarks), 1);
    const radius = (index: number) =>
      Math.min(0.36 * gap, 5 + 9 * Math.sqrt(model.nodes[index].landmarks / most)) * (gap < 30 ? 0.8 : 1);
    const svg = s("svg", {
      width,
      height,
      viewBox: `0 0 ${width} ${height}`,
      role: "group",
      "aria-label": `Graph of ${count} maps and ${model.links.length} links`,
    });
    const shown = model.links
      .map((link, index) => ({ link, index }))
      .filter(({ link }) => counts(link) || rejected)
      .sort((a, b) => Number(counts(a.link)) - Number(counts(b.link)));
    const stops = shown.length <= kTabStops;
    for (const { link, index } of shown) {
      const [a, b] = [places[link.target], places[link.source]];
      const isSelected = selected?.kind === "link" && selected.index === index;
      const ends = { x1: a.x, y1: a.y, x2: b.x, y2: b.y };
      const group = pressable(
        linkLabel(model, index),
        isSelected,
        () => this.#onSelect(isSelected ? null : { kind: "link", index }),
        { class: "graph-link", tabindex: stops ? 0 : -1, "data-use": link.use },
        s("title", null, linkLabel(model, index)),
        s("line", {
          ...ends,
          stroke: isSelected ? colors.selection : linkColor(link, colors),
          "stroke-width": isSelected ? 4.5 : counts(link) ? (count > 60 ? 1.6 : 3) : 1.6,
          "stroke-dasharray": counts(link) ? null : "5 5",
          "stroke-linecap": "round",
        }),
        s("line", { ...ends, stroke: "transparent", "stroke-width": count > 60 ? 6 : 16 }),
      );
      svg.append(group);
    }
    model.nodes.forEach((node, index) => {
      const { x, y } = places[index];
      const isSelected = selected?.kind === "node" && selected.index === index;
      const r = radius(index);
      const color = model.nodeColor(index, colors);
      const group = pressable(
        `${node.name}${node.group === null ? ", left out" : ""}`,
        isSelected,
        () => this.#onSelect(isSelected ? null : { kind: "node", index }),
        { class: "graph-node" },
        s("title", null, node.name),
        s("circle", {
          cx: x,
          cy: y,
          r,
          fill: node.group === null ? colors.background : color,
          stroke: isSelected ? colors.selection : node.group === null ? color : colors.background,
          "stroke-width": isSelected ? 4 : 2,
          "stroke-dasharray": node.group === null && !isSelected ? "3 2.5" : null,
        }),
      );
      if (gap >= kLabelFrom) {
        const text = fitText(node.name, Math.max(gap + 24, 60));
        group.append(
          s(
            "text",
            {
              x,
              y: y + r + 15,
              "text-anchor": "middle",
              fill: colors.ink,
              stroke: colors.background,
              "stroke-width": 4,
              "stroke-linejoin": "round",
              "paint-order": "stroke",
            },
            text,
          ),
        );
      }
      svg.append(group);
    });
    redrawn(this.element, svg);
  }
}

export function linkLabel(model: NetworkModel, index: number): string {
  const link = model.links[index];
  const probability = link.probability === null ? "" : `, ${formatProbability(link.probability)}`;
  return `${model.linkName(index)}: ${kUseTexts[link.use]}${probability}`;
}

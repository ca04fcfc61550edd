// SPDX-License-Identifier: BSD-3-Clause
import { fitText, textWidth } from "../charts/shared";
import { h, pressable, redrawn, s } from "../dom";
import { formatProbability } from "../math/format";
import type { Palette } from "../theme";
import { linkLabel } from "./graph_view";
import { counts, linkColor, type NetworkModel, type Selection } from "./network_model";

const kTabStops = 80;
const kNamesFrom = 13;
const kNumbersFrom = 36;

/** Every pair of maps as a cell: its colour is the probability, a hatched one is not used, an empty one was not tried. */
export class MatrixView {
  readonly element = h("div", { class: "network-matrix" });
  readonly #model: NetworkModel;
  readonly #onSelect: (selection: Selection | null) => void;

  constructor(model: NetworkModel, onSelect: (selection: Selection | null) => void) {
    this.#model = model;
    this.#onSelect = onSelect;
  }

  draw(colors: Palette, selected: Selection | null, paperWidth?: number): void {
    const model = this.#model;
    const count = model.nodes.length;
    const width = Math.max(240, paperWidth ?? this.element.clientWidth);
    const longest = Math.max(...model.nodes.map((node) => textWidth(node.name)), 0) + 10;
    const plain = Math.max(2, width / Math.max(1, count));
    const named = plain >= kNamesFrom;
    const names = named ? Math.min(longest, 0.32 * width) : 0;
    const cell = Math.max(2, Math.min(56, (width - names - 2) / Math.max(1, count)));
    const side = cell * count;
    // Names of columns slant, so that they need no room beside the matrix.
    const top = named ? Math.min(110, names * 0.72 + 14) : 2;
    const overhang = named ? 0.72 * names : 0;
    const total = Math.min(width, names + side + overhang);
    const scale = total < names + side + overhang ? (width - names - overhang) / side : 1;
    const size = Math.max(2, cell * scale);
    const svg = s("svg", {
      width,
      height: top + size * count + 4,
      viewBox: `0 0 ${width} ${top + size * count + 4}`,
      role: "group",
      "aria-label": `Matrix of ${model.links.length} pairs of ${count} maps`,
    });
    const pattern = "cairn-hatch";
    svg.append(
      s(
        "defs",
        null,
        s(
          "pattern",
          { id: pattern, width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
          s("rect", { width: 2.2, height: 6, fill: colors.background, "fill-opacity": 0.75 }),
        ),
      ),
    );
    for (let i = 0; i < count; ++i) {
      for (let j = 0; j < i && count <= 60; ++j) {
        svg.append(this.#rect(names + j * size, top + i * size, size, colors.fill));
      }
      svg.append(this.#rect(names + i * size, top + i * size, size, model.nodeColor(i, colors)));
      if (named) {
        const isSelected = selected?.kind === "node" && selected.index === i;
        const look = { fill: isSelected ? colors.selection : colors.ink, "font-size": Math.min(12, size - 1) };
        const text = fitText(model.nodes[i].name, names - 8);
        svg.append(
          s("text", { ...look, x: names - 6, y: top + (i + 0.5) * size + 4, "text-anchor": "end" }, text),
          s(
            "text",
            { ...look, transform: `translate(${names + (i + 0.5) * size},${top - 7}) rotate(-45)` },
            fitText(model.nodes[i].name, Math.min(names, (top - 10) / 0.72)),
          ),
        );
      }
    }
    const stops = model.links.length <= kTabStops;
    model.links.forEach((link, index) => {
      const [i, j] = [Math.max(link.target, link.source), Math.min(link.target, link.source)];
      const isSelected = selected?.kind === "link" && selected.index === index;
      const [x, y] = [names + j * size, top + i * size];
      const color = linkColor(link, colors);
      const group = pressable(
        linkLabel(model, index),
        isSelected,
        () => this.#onSelect(isSelected ? null : { kind: "link", index }),
        { class: "matrix-cell", tabindex: stops ? 0 : -1 },
        s("title", null, linkLabel(model, index)),
        this.#rect(x, y, size, color),
        counts(link) ? null : this.#rect(x, y, size, `url(#${pattern})`),
      );
      if (size >= kNumbersFrom && link.probability !== null) {
        const text = formatProbability(link.probability).replace(" %", "");
        const fontSize = Math.min(11, (11 * (size - 4)) / textWidth(text, 11));
        const half = textWidth(text, fontSize) / 2 + 3;
        if (!counts(link)) {
          group.append(
            s("rect", { x: x + size / 2 - half, y: y + size / 2 - 8, width: 2 * half, height: 16, rx: 3, fill: color }),
          );
        }
        group.append(
          s(
            "text",
            {
              x: x + size / 2,
              y: y + size / 2 + 4,
              "text-anchor": "middle",
              "font-size": fontSize,
              fill: readableOn(color),
            },
            text,
          ),
        );
      }
      if (isSelected) {
        group.append(
          s("rect", {
            x: x + 1,
            y: y + 1,
            width: size - 2,
            height: size - 2,
            fill: "none",
            stroke: colors.selection,
            "stroke-width": Math.min(3, size / 3),
          }),
        );
      }
      svg.append(group);
    });
    redrawn(this.element, svg);
  }

  #rect(x: number, y: number, size: number, fill: string): SVGElement {
    const inset = size > 8 ? 1 : 0;
    return s("rect", {
      x: x + inset,
      y: y + inset,
      width: size - 2 * inset,
      height: size - 2 * inset,
      fill,
      rx: inset,
    });
  }
}

/** Black or white, whichever is read more easily on a colour. */
function readableOn(hex: string): string {
  const value = parseInt(hex.slice(1), 16);
  const luminance = 0.299 * (value >> 16) + 0.587 * ((value >> 8) & 255) + 0.114 * (value & 255);
  return luminance > 140 ? "#10151a" : "#ffffff";
}

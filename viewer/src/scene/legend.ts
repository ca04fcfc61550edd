// SPDX-License-Identifier: BSD-3-Clause
import { glyph, h, s } from "../dom";
import { formatCount, formatNumber } from "../math/format";
import type { Palette } from "../theme";
import { rampColor, scaleTicks, type ColorScale } from "./coloring";
import type { SceneModel } from "./scene_model";
import type { ViewState } from "./view_state";

const kRampWidth = 216;

function key(draw: SVGElement, label: string, detail: string | null = null): HTMLElement {
  return h(
    "li",
    null,
    glyph(22, 14, draw),
    h("span", null, label),
    detail ? h("span", { class: "muted" }, ` ${detail}`) : null,
  );
}

export function paintRamp(canvas: HTMLCanvasElement, colors: Palette): void {
  const context = canvas.getContext("2d");
  for (let x = 0; context && x < canvas.width; ++x) {
    context.fillStyle = rampColor(x / (canvas.width - 1), colors.name);
    context.fillRect(x, 0, 1, canvas.height);
  }
}

function ramp(scale: ColorScale, colors: Palette): HTMLElement {
  const canvas = h("canvas", { width: kRampWidth, height: 12, class: "ramp", "aria-hidden": "true" });
  paintRamp(canvas, colors);
  const ticks = h("div", { class: "ramp-ticks" });
  for (const { value, t } of scaleTicks(scale)) {
    const tick = h("span", null, formatNumber(value, 3));
    tick.style.left = `${100 * t}%`;
    ticks.append(tick);
  }
  const title = `${scale.label}${scale.unit ? ` (${scale.unit})` : ""}${scale.log ? ", logarithmic" : ""}`;
  return h("div", { class: "legend-ramp" }, h("div", { class: "legend-title" }, title), canvas, ticks);
}

/** What colours and shapes mean right now. */
export function legendContent(
  model: SceneModel,
  state: ViewState,
  colors: Palette,
  matchNote: string | null,
): HTMLElement[] {
  const { layers, color, scale } = state;
  const byRole = color.kind === "role";
  const source = byRole ? colors.source : colors.muted;
  const target = byRole ? colors.target : colors.muted;
  const keys = h("ul", { class: "legend-keys" });
  const count = (n: number) => `${formatCount(n)} landmarks`;
  if (model.source && layers.source) {
    keys.append(
      key(
        s("circle", { cx: 11, cy: 7, r: 4.5, fill: source }),
        `Source: ${model.source.name}`,
        count(model.source.count),
      ),
    );
  }
  if (layers.target) {
    keys.append(
      key(
        s("rect", { x: 7, y: 3, width: 8, height: 8, fill: target }),
        model.source ? `Target: ${model.target.name}` : model.target.name,
        count(model.target.count),
      ),
    );
  }
  if (model.hasResiduals && layers.matches) {
    keys.append(
      key(
        s("line", {
          x1: 1,
          x2: 21,
          y1: 7,
          y2: 7,
          stroke: color.kind === "residual" ? colors.muted : colors.match,
          "stroke-width": 2,
        }),
        "Match",
        matchNote,
      ),
    );
  }
  if (model.truth && model.source && layers.truth) {
    keys.append(
      key(
        s("circle", { cx: 11, cy: 7, r: 4, fill: "none", stroke: colors.truth, "stroke-width": 2 }),
        "Source at its true pose",
      ),
    );
  }
  if (layers.cameras) {
    const path = (stroke: string) =>
      s("path", { d: "M2,11L11,7L2,3ZM11,7H21", fill: "none", stroke, "stroke-width": 1.5 });
    if (model.source?.frames && layers.source) {
      keys.append(key(path(colors.sourceCamera), "Source’s cameras"));
    }
    if (model.target.frames && layers.target) {
      keys.append(key(path(colors.targetCamera), model.source ? "Target’s cameras" : "Cameras"));
    }
  }
  const content: HTMLElement[] = [keys];
  if (scale) {
    content.push(ramp(scale, colors));
    if (color.kind === "residual") {
      content.push(h("p", { class: "muted small" }, "Distance between matched landmarks at the pose shown."));
    }
  }
  return content;
}

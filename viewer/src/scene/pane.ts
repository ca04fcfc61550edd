// SPDX-License-Identifier: BSD-3-Clause
import { Color } from "three";
import { badge, button, glyph, h, s, type Status } from "../dom";
import type { LandmarkCloud, Run, SummaryValue } from "../document/report";
import { formatLength, formatNumber, idText } from "../math/format";
import { apply, kIdentity, positionOf, scaleOf, type Affine } from "../math/pose";
import { symbolPath } from "../charts/shared";
import { seriesColor, seriesSymbol } from "../series_style";
import type { Palette } from "../theme";
import { columnOf, columnValue, kNoLevel, levelOf, levelsOf, rampColor } from "./coloring";
import { keyframeText, type Keyframe } from "./keyframes";
import { CameraLayer, GridLayer, MatchLayer } from "./line_layers";
import { pickLandmark, type Pick } from "./picking";
import { PointLayer } from "./point_layer";
import type { ShownPose } from "../shown_pose";
import type { Role, SceneModel } from "./scene_model";
import { View3d, type Quality } from "./view3d";
import type { ViewState } from "./view_state";

const kClickSlack = 9;
const kTouchSlack = 18;
const kResidualsUpTo = 300_000;

/** What can be under the pointer. */
export type PanePick = Pick | Keyframe;

/** One strategy's view: its landmarks at the current iteration, its numbers, its canvases. */
export class Pane extends View3d<Role, PanePick> {
  readonly run: Run | null;
  readonly element: HTMLElement;
  readonly maximise: HTMLButtonElement;
  /** Whether the view is through the keyframe that is entered. */
  inside = false;
  readonly #model: SceneModel;
  readonly #numbers = h("dl", { class: "pane-numbers" });
  readonly #iteration = h("span", { class: "pane-iteration", "data-number": "iteration", title: "Iteration" });
  /** The verdict on the alignment's own pose. */
  readonly #badge: HTMLElement | null;
  readonly #mark: SVGPathElement | null = null;
  readonly #points: { role: Role | "truth"; layer: PointLayer }[] = [];
  readonly #matches: MatchLayer | null = null;
  protected grid: GridLayer;
  readonly #residuals: Float32Array | null = null;
  readonly #residualLevels: Uint8Array | null = null;
  #pose: Affine = kIdentity;
  #state: ViewState;

  constructor(
    model: SceneModel,
    run: Run | null,
    state: ViewState,
    colors: Palette,
    previewStride: number,
    onMaximise: (pane: Pane) => void,
  ) {
    super(model, state, colors);
    this.#model = model;
    this.run = run;
    this.#state = state;
    const { source, target } = model;
    if (source && model.truth) {
      this.#addPoints("truth", source, "ring", 0.45, previewStride);
    }
    this.#addPoints("target", target, "square", 1, previewStride);
    if (source) {
      this.#addPoints("source", source, "disc", 1, previewStride);
    }
    for (const [role, cloud] of [
      ["target", target],
      ["source", source],
    ] as const) {
      if (cloud?.frames && cloud.frames.count > 0) {
        // In the map's own unit, of a size with the scene.
        const scale = role === "source" ? scaleOf(model.restingPose) : 1;
        const layer = new CameraLayer(cloud, cloud.frames, model.extent.reach / scale);
        this.cameras.set(role, layer);
        this.scene.add(layer.object);
      }
    }
    if (source && run?.matches) {
      this.#matches = new MatchLayer(model);
      this.scene.add(this.#matches.object);
      this.#residuals = new Float32Array(source.count);
      this.#residualLevels = new Uint8Array(source.count);
    }
    this.grid = new GridLayer(model.extent);
    this.scene.add(this.grid.object);

    const name = run?.name ?? target.name;
    const heading = h("h3", { class: "pane-name" });
    if (run) {
      this.#mark = s("path", { d: symbolPath(seriesSymbol(run.name)), transform: "translate(7,7) scale(1.15)" });
      heading.append(glyph(14, 14, this.#mark));
    }
    heading.append(h("span", { title: name }, name));
    this.#badge = statusBadge(run);
    this.maximise = button("", () => onMaximise(this), {
      class: "quiet enlarge",
      "aria-pressed": "false",
      "aria-label": `Enlarge ${name}`,
      title: "Enlarge",
    });
    const arrows = "M8.5,1.5H12.5V5.5M5.5,12.5H1.5V8.5M12.5,1.5L8,6M1.5,12.5L6,8";
    const look = { fill: "none", stroke: "currentColor", "stroke-width": 1.5 };
    this.maximise.append(glyph(14, 14, s("path", { d: arrows, ...look })));
    this.element = h(
      "div",
      { class: "pane", role: "group", "aria-label": run ? `Strategy ${name}` : name },
      h("div", { class: "pane-head" }, heading, this.#iteration, this.#badge, this.maximise),
      this.surface,
      this.#numbers,
    );
    this.setColors(colors);
  }

  #addPoints(
    role: Role | "truth",
    cloud: LandmarkCloud,
    shape: "disc" | "square" | "ring",
    opacity: number,
    stride: number,
  ): void {
    const layer = new PointLayer(cloud, shape, opacity, stride);
    this.#points.push({ role, layer });
    this.scene.add(layer.object);
  }

  get matchStride(): number {
    return this.#matches?.stride ?? 1;
  }

  /** Takes over colours and the current state; call before drawing whenever either changed. */
  setColors(colors: Palette): void {
    this.colors = colors;
    this.grid.setColors(colors);
    if (this.run) {
      this.#mark?.setAttribute("fill", seriesColor(this.run.name, colors));
    }
    for (const [role, layer] of this.cameras) {
      layer.setColor(role === "source" ? colors.sourceCamera : colors.targetCamera);
    }
    this.recolour();
  }

  recolour(): void {
    const { color, scale } = this.#state;
    for (const { role, layer } of this.#points) {
      const roleColor = role === "truth" ? this.colors.truth : this.colors[role];
      const column = color.kind === "column" ? columnOf(layer.cloud, color.name) : null;
      if (role === "truth" || color.kind === "role") {
        layer.showRole(roleColor);
      } else if (color.kind === "own") {
        layer.showOwnColors(this.colors.noValue, this.colors);
      } else if (color.kind === "column") {
        if (column && scale) {
          layer.showLevels(cachedLevels(layer.cloud, color.name, scale), this.colors);
        } else {
          layer.showRole(this.colors.noValue);
        }
      } else if (role === "target") {
        layer.showRole(this.colors.noValue);
      }
    }
    this.moveTo();
  }

  /** The pose chosen in place of the iteration's, if it is of this pane's run. */
  get shownPose(): ShownPose | null {
    const { shown } = this.#state;
    return shown && shown.run === this.run?.name ? shown : null;
  }

  /** Matches belong to iterations; a pose chosen in their place has none. */
  #matchesNow(): Int32Array | null {
    return this.shownPose ? null : this.#model.matches(this.run, this.#state.iteration);
  }

  /** Puts everything where it is at the state's iteration. */
  moveTo(): void {
    const { iteration, layers, color, scale } = this.#state;
    const model = this.#model;
    const shown = this.shownPose;
    this.#pose = shown?.pose ?? model.pose(this.run, iteration);
    for (const { role, layer } of this.#points) {
      const pose = role === "target" ? kIdentity : role === "truth" ? (model.truth ?? kIdentity) : this.#pose;
      layer.place(pose, model.extent.centre);
      layer.object.visible = layers[role];
      layer.showEllipses(layers.ellipses && role !== "truth");
    }
    for (const [role, layer] of this.cameras) {
      layer.place(this.poseOf(role), model.extent.centre);
      layer.object.visible = layers.cameras && layers[role];
    }
    this.grid.object.visible = layers.grid;
    const matches = this.#matchesNow();
    let rms = NaN;
    if (shown && this.#matches && this.#residualLevels) {
      this.#matches.object.visible = false;
      if (color.kind === "residual") {
        this.#residualLevels.fill(kNoLevel);
        this.#points.find(({ role }) => role === "source")?.layer.showLevels(this.#residualLevels, this.colors);
      }
    }
    if (matches && this.#residuals && this.#residualLevels && this.#matches) {
      const byResidual = color.kind === "residual" && scale !== null;
      if (byResidual || this.#residuals.length <= kResidualsUpTo) {
        rms = rootMeanSquare(model.residuals(this.#pose, matches, this.#residuals));
      }
      if (byResidual && scale) {
        for (let i = 0; i < this.#residuals.length; ++i) {
          this.#residualLevels[i] = levelOf(this.#residuals[i], scale);
        }
        this.#points.find(({ role }) => role === "source")?.layer.showLevels(this.#residualLevels, this.colors);
      }
      this.#matches.object.visible = layers.matches;
      if (layers.matches) {
        const levels = this.#residualLevels;
        const ramp = byResidual ? linearRamp(this.colors) : null;
        this.#matches.update(this.#pose, matches, this.colors.match, ramp && ((i) => ramp[levels[i]]));
      }
    }
    this.#showNumbers(rms);
  }

  #showNumbers(rms: number): void {
    const { run } = this;
    const entries: [string, string, string][] = [];
    const shown = this.shownPose;
    this.#badge?.toggleAttribute("hidden", shown !== null);
    if (shown) {
      this.#iteration.textContent = shown.label;
    } else if (run) {
      const i = Math.min(this.#state.iteration, run.iterations);
      const unit = this.#model.lengthUnit;
      const square = unit === "m" ? "m²" : "map units²";
      const at = (values: Float64Array | null) => values?.[i] ?? NaN;
      const stopped = this.#state.iteration > run.iterations;
      this.#iteration.textContent = stopped ? `stopped at ${run.iterations}` : `${i} of ${run.iterations}`;
      if (run.scores) {
        entries.push(["Score", `${formatNumber(at(run.scores))} ${square}`, "score"]);
      }
      if (run.meanSquaredDistance) {
        entries.push(["Mean square", i === 0 ? "–" : `${formatNumber(at(run.meanSquaredDistance))} ${square}`, "msd"]);
      }
      if (Number.isFinite(rms)) {
        entries.push(["Match RMS", formatLength(rms, unit), "rms"]);
      }
      if (run.rotationErrorDeg) {
        entries.push(["Rotation err.", `${formatNumber(at(run.rotationErrorDeg), 3)}°`, "rotation"]);
      }
      if (run.translationErrorM) {
        entries.push(["Translation err.", formatLength(at(run.translationErrorM), unit), "translation"]);
      }
    }
    this.#numbers.replaceChildren(
      ...entries.map(([name, value, key]) =>
        h("div", { "data-number": key }, h("dt", null, name), h("dd", null, value)),
      ),
    );
    const numbers = [["Iteration", this.#iteration.textContent], ...entries]
      .map(([name, value]) => `${name} ${value}`)
      .join(", ");
    this.overlay.setAttribute("aria-label", `3D view of ${this.run?.name ?? this.#model.target.name}. ${numbers}`);
  }

  get pose(): Affine {
    return this.#pose;
  }

  protected get through(): Keyframe | null {
    return this.inside ? this.#state.entered : null;
  }

  /** target_from_map as shown. */
  protected poseOf(role: Role): Affine {
    return role === "source" ? this.#pose : kIdentity;
  }

  protected prepare({ resolution, preview }: Quality): void {
    for (const { role, layer } of this.#points) {
      layer.usePreview(preview);
      const size =
        role === "truth"
          ? this.#state.pointSize * 1.5
          : role === "target"
            ? this.#state.pointSize * 0.85
            : this.#state.pointSize;
      layer.setSize(Math.max(1, size * resolution));
    }
  }

  /** A landmark's position in the target's frame. */
  positionInTarget(pick: Pick): [number, number, number] {
    const { source, target } = this.#model;
    return pick.role === "source" && source
      ? apply(this.#pose, positionOf(source, pick.index))
      : positionOf(target, pick.index);
  }

  protected annotate(context: CanvasRenderingContext2D): void {
    const { selected, entered } = this.#state;
    if (entered && !this.inside) {
      this.outline(context, entered, 2.25);
    }
    if (selected) {
      this.#markPick(context, selected, true);
    }
    if (this.hovered && "frame" in this.hovered) {
      this.outline(context, this.hovered, 1.5);
    } else if (this.hovered) {
      this.#markPick(context, this.hovered, false);
    }
  }

  protected keyframeName({ role, frame }: Keyframe): string {
    const frames = this.#model.frames(role);
    const map = !this.#model.source ? "Keyframe" : role === "source" ? "Source keyframe" : "Target keyframe";
    return frames ? `${map} ${keyframeText(frames, frame)}` : map;
  }

  protected keyframeOf(pick: PanePick): Keyframe | null {
    return "frame" in pick ? pick : null;
  }

  #markPick(context: CanvasRenderingContext2D, pick: Pick, strong: boolean): void {
    const at = this.onScreen(this.positionInTarget(pick));
    if (!at) {
      return;
    }
    const matched = this.matchOf(pick);
    const partner = matched === null ? null : this.onScreen(positionOf(this.#model.target, matched));
    context.strokeStyle = this.colors.selection;
    context.lineWidth = strong ? 2.25 : 1.5;
    if (partner) {
      context.setLineDash([4, 3]);
      context.beginPath();
      context.moveTo(...at);
      context.lineTo(...partner);
      context.stroke();
      context.setLineDash([]);
      context.strokeRect(partner[0] - 6, partner[1] - 6, 12, 12);
    }
    context.beginPath();
    if (pick.role === "source") {
      context.arc(at[0], at[1], strong ? 9 : 7, 0, 2 * Math.PI);
    } else {
      context.rect(at[0] - 8, at[1] - 8, 16, 16);
    }
    context.stroke();
  }

  /** The target landmark that a source landmark is matched with at this iteration. */
  matchOf(pick: Pick): number | null {
    if (pick.role !== "source") {
      return null;
    }
    const match = this.#matchesNow()?.[pick.index] ?? -1;
    return match >= 0 ? match : null;
  }

  /** How many source landmarks are matched with a target landmark at this iteration. */
  countMatchedWith(targetIndex: number): number {
    const matches = this.#matchesNow();
    return matches ? matches.reduce((count, target) => count + Number(target === targetIndex), 0) : 0;
  }

  /** The landmark or the keyframe that is closer; a landmark whose drawn point is there always is. */
  protected pickHere(
    [x, y]: [number, number],
    touch: boolean,
    { width, height }: { width: number; height: number },
  ): PanePick | null {
    const { layers, pointSize } = this.#state;
    const { source, target } = this.#model;
    const candidates = [
      ...(source && layers.source ? [this.pickLayer<Role>("source", source, this.#pose)] : []),
      ...(layers.target ? [this.pickLayer<Role>("target", target, kIdentity)] : []),
    ];
    const slack = touch ? kTouchSlack : kClickSlack;
    const landmark = pickLandmark(candidates, x, y, width, height, pointSize / 2 + 1, slack);
    const keyframe = this.pickKeyframe([x, y], landmark?.distance ?? slack);
    if (keyframe) {
      return { role: keyframe.role, frame: keyframe.frame };
    }
    return landmark && { role: landmark.role, index: landmark.index };
  }

  protected tipText(pick: PanePick): string {
    if ("frame" in pick) {
      return this.keyframeName(pick);
    }
    const cloud = pick.role === "source" ? this.#model.source : this.#model.target;
    if (!cloud) {
      return "";
    }
    const parts = [`${pick.role === "source" ? "Source" : "Target"} ${idText(cloud.ids, pick.index)}`];
    const { color } = this.#state;
    const column = color.kind === "column" ? columnOf(cloud, color.name) : null;
    if (column) {
      parts.push(
        `${column.label} ${formatNumber(columnValue(column, pick.index))}${column.unit ? ` ${column.unit}` : ""}`,
      );
    }
    const match = this.matchOf(pick);
    if (match !== null) {
      parts.push(
        `residual ${formatLength(this.#model.residual(this.#pose, pick.index, match), this.#model.lengthUnit)}`,
      );
    }
    return parts.join(" · ");
  }

  get caption(): string {
    const numbers = [...this.#numbers.querySelectorAll("div")].map((entry) =>
      [...entry.children].map((child) => child.textContent).join(" "),
    );
    return [this.#iteration.textContent ? `Iteration ${this.#iteration.textContent}` : "", ...numbers]
      .join("   ")
      .trim();
  }
}

function rootMeanSquare(values: Float32Array): number {
  let sum = 0;
  let count = 0;
  for (const value of values) {
    if (value === value) {
      sum += value * value;
      ++count;
    }
  }
  return count ? Math.sqrt(sum / count) : NaN;
}

function statusBadge(run: Run | null): HTMLElement | null {
  const value: SummaryValue = run?.summary.find(([key]) => key === "status")?.[1] ?? null;
  if (typeof value !== "string" || value === "") {
    return null;
  }
  const kinds: Record<string, Status> = {
    aligned: "good",
    ok: "good",
    success: "good",
    failed: "bad",
    rejected: "bad",
    ambiguous: "doubt",
  };
  return badge(Object.prototype.hasOwnProperty.call(kinds, value) ? kinds[value] : "plain", value);
}

const levelCache = new WeakMap<LandmarkCloud, { key: string; levels: Uint8Array }>();

/** Levels of the column shown last; all panes share them. */
function cachedLevels(cloud: LandmarkCloud, name: string, scale: NonNullable<ViewState["scale"]>): Uint8Array {
  const key = JSON.stringify([name, scale.low, scale.high, scale.log]);
  const cached = levelCache.get(cloud);
  if (cached?.key === key) {
    return cached.levels;
  }
  const column = columnOf(cloud, name);
  const levels = column ? levelsOf(column, scale) : new Uint8Array(cloud.count).fill(kNoLevel);
  levelCache.set(cloud, { key, levels });
  return levels;
}

const linearRamps = new Map<string, number[][]>();

/** The ramp as linear channels, which line materials take. */
function linearRamp(colors: Palette): number[][] {
  let ramp = linearRamps.get(colors.name);
  if (!ramp) {
    ramp = Array.from({ length: 256 }, (_, level) => {
      const css = level === kNoLevel ? colors.noValue : rampColor(level / 254, colors.name);
      const { r, g, b } = new Color(css);
      return [r, g, b].map((channel) => Math.round(255 * channel));
    });
    linearRamps.set(colors.name, ramp);
  }
  return ramp;
}

// SPDX-License-Identifier: BSD-3-Clause
import { Color, Matrix4, PerspectiveCamera, Scene, Vector4 } from "three";
import { button, h, s } from "../dom";
import type { LandmarkCloud, Run, SummaryValue, Vector3 } from "../document/report";
import { formatLength, formatNumber, idText } from "../math/format";
import {
  apply,
  compose,
  dequantise,
  kIdentity,
  poseAt,
  positionOf,
  scaleOf,
  subtract,
  type Affine,
} from "../math/pose";
import { symbolPath } from "../charts/shared";
import { seriesColor, seriesSymbol } from "../series_style";
import type { Palette } from "../theme";
import { drawAxes, fitCanvas, label } from "./annotations";
import { columnOf, columnValue, kNoLevel, levelOf, levelsOf, rampColor } from "./coloring";
import {
  depthOfMiddle,
  drawKeyframe,
  frustumOf,
  imageRectangle,
  keyframeText,
  lookThrough,
  nearestKeyframe,
  type Keyframe,
} from "./keyframes";
import { CameraLayer, GridLayer, kFrustumEdges, MatchLayer } from "./line_layers";
import type { OrbitState } from "./orbit";
import { pickLandmark, type Pick, type PickLayer } from "./picking";
import { PointLayer, setMatrix } from "./point_layer";
import type { RenderService } from "./render_service";
import type { ShownPose } from "../shown_pose";
import type { Role, SceneModel } from "./scene_model";
import type { ViewState } from "./view_state";

const kClickSlack = 9;
const kTouchSlack = 18;
const kResidualsUpTo = 300_000;

/** What can be under the pointer. */
export type PanePick = Pick | Keyframe;

export interface Quality {
  /** Picture pixels per CSS pixel. */
  resolution: number;
  preview: boolean;
}

/** One strategy's view: its landmarks at the current iteration, its numbers, its canvases. */
export class Pane {
  readonly run: Run | null;
  readonly element: HTMLElement;
  readonly surface: HTMLElement;
  readonly canvas = h("canvas", { class: "pane-canvas" });
  readonly overlay = h("canvas", { class: "pane-overlay", tabindex: 0, role: "img" });
  readonly tooltip = h("div", { class: "pane-tip", hidden: true });
  readonly maximise: HTMLButtonElement;
  orbit: OrbitState;
  /** Whether the view is through the keyframe that is entered. */
  inside = false;
  readonly #model: SceneModel;
  readonly #numbers = h("dl", { class: "pane-numbers" });
  readonly #iteration = h("span", { class: "pane-iteration", "data-number": "iteration", title: "Iteration" });
  /** The verdict on the alignment's own pose. */
  readonly #badge: HTMLElement | null;
  readonly #paper = h("img", { class: "pane-paper", alt: "", decoding: "sync" });
  readonly #hint = h("div", { class: "pane-hint", hidden: true, "aria-hidden": "true" });
  readonly #mark: SVGPathElement | null = null;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera();
  readonly #points: { role: Role | "truth"; layer: PointLayer }[] = [];
  readonly #cameras: { role: Role; layer: CameraLayer }[] = [];
  readonly #matches: MatchLayer | null = null;
  readonly #grid: GridLayer;
  readonly #residuals: Float32Array | null = null;
  readonly #residualLevels: Uint8Array | null = null;
  #pose: Affine = kIdentity;
  #hovered: PanePick | null = null;
  #hintTimer = 0;
  #state: ViewState;
  #colors: Palette;

  constructor(
    model: SceneModel,
    run: Run | null,
    state: ViewState,
    colors: Palette,
    previewStride: number,
    onMaximise: (pane: Pane) => void,
  ) {
    this.#model = model;
    this.run = run;
    this.#state = state;
    this.#colors = colors;
    this.orbit = model.orbit.view("home", model.half, 1.5);
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
        const layer = new CameraLayer(cloud, cloud.frames, model.reach / scale);
        this.#cameras.push({ role, layer });
        this.#scene.add(layer.object);
      }
    }
    if (source && run?.matches) {
      this.#matches = new MatchLayer(model);
      this.#scene.add(this.#matches.object);
      this.#residuals = new Float32Array(source.count);
      this.#residualLevels = new Uint8Array(source.count);
    }
    this.#grid = new GridLayer(model);
    this.#scene.add(this.#grid.object);

    const name = run?.name ?? target.name;
    const heading = h("h3", { class: "pane-name" });
    if (run) {
      this.#mark = s("path", { d: symbolPath(seriesSymbol(run.name)), transform: "translate(7,7) scale(1.15)" });
      heading.append(s("svg", { width: 14, height: 14, "aria-hidden": "true" }, this.#mark));
    }
    heading.append(h("span", { title: name }, name));
    const status = statusOf(run);
    this.#badge = status && h("span", { class: "badge", "data-status": status.kind }, status.text);
    this.maximise = button("", () => onMaximise(this), {
      class: "quiet enlarge",
      "aria-pressed": "false",
      "aria-label": `Enlarge ${name}`,
      title: "Enlarge",
    });
    this.maximise.append(
      s(
        "svg",
        { width: 14, height: 14, viewBox: "0 0 14 14", "aria-hidden": "true" },
        s("path", {
          d: "M8.5,1.5H12.5V5.5M5.5,12.5H1.5V8.5M12.5,1.5L8,6M1.5,12.5L6,8",
          fill: "none",
          stroke: "currentColor",
          "stroke-width": 1.5,
        }),
      ),
    );
    this.surface = h(
      "div",
      { class: "pane-surface" },
      this.canvas,
      this.#paper,
      this.overlay,
      this.tooltip,
      this.#hint,
    );
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
    this.#scene.add(layer.object);
  }

  get grid(): GridLayer {
    return this.#grid;
  }

  get matchStride(): number {
    return this.#matches?.stride ?? 1;
  }

  /** Takes over colours and the current state; call before drawing whenever either changed. */
  setColors(colors: Palette): void {
    this.#colors = colors;
    this.#grid.setColors(colors);
    if (this.run) {
      this.#mark?.setAttribute("fill", seriesColor(this.run.name, colors));
    }
    for (const { role, layer } of this.#cameras) {
      layer.setColor(role === "source" ? colors.sourceCamera : colors.targetCamera);
    }
    this.recolour();
  }

  recolour(): void {
    const { color, scale } = this.#state;
    for (const { role, layer } of this.#points) {
      const roleColor = role === "truth" ? this.#colors.truth : this.#colors[role];
      const column = color.kind === "column" ? columnOf(layer.cloud, color.name) : null;
      if (role === "truth" || color.kind === "role") {
        layer.showRole(roleColor);
      } else if (color.kind === "own") {
        layer.showOwnColors(this.#colors.noValue, this.#colors);
      } else if (color.kind === "column") {
        if (column && scale) {
          layer.showLevels(cachedLevels(layer.cloud, color.name, scale), this.#colors);
        } else {
          layer.showRole(this.#colors.noValue);
        }
      } else if (role === "target") {
        layer.showRole(this.#colors.noValue);
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
      layer.place(pose, model.centre);
      layer.object.visible = layers[role];
    }
    for (const { role, layer } of this.#cameras) {
      layer.place(this.#poseOf(role), model.centre);
      layer.object.visible = layers.cameras && layers[role];
    }
    this.#grid.object.visible = layers.grid;
    const matches = this.#matchesNow();
    let rms = NaN;
    if (shown && this.#matches && this.#residualLevels) {
      this.#matches.object.visible = false;
      if (color.kind === "residual") {
        this.#residualLevels.fill(kNoLevel);
        this.#points.find(({ role }) => role === "source")?.layer.showLevels(this.#residualLevels, this.#colors);
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
        this.#points.find(({ role }) => role === "source")?.layer.showLevels(this.#residualLevels, this.#colors);
      }
      this.#matches.object.visible = layers.matches;
      if (layers.matches) {
        const levels = this.#residualLevels;
        const ramp = byResidual ? linearRamp(this.#colors) : null;
        this.#matches.update(this.#pose, matches, this.#colors.match, ramp && ((i) => ramp[levels[i]]));
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

  #placeCamera(): { width: number; height: number } {
    const width = Math.max(1, this.surface.clientWidth);
    const height = Math.max(1, this.surface.clientHeight);
    const { centre, reach } = this.#model;
    const entered = this.inside ? this.#state.entered : null;
    const frames = entered && this.#model.frames(entered.role);
    if (entered && frames) {
      const pose = compose(this.#poseOf(entered.role), poseAt(frames.poses, entered.frame));
      lookThrough(this.#camera, pose, centre, frustumOf(frames), width / height, reach);
    } else {
      this.#model.orbit.place(this.#camera, this.orbit, width / height, reach);
    }
    return { width, height };
  }

  /** target_from_map as shown. */
  #poseOf(role: Role): Affine {
    return role === "source" ? this.#pose : kIdentity;
  }

  /** The keyframe whose eye is nearest to that of the view, of these maps. */
  nearestKeyframe(roles: readonly Role[]): Keyframe | null {
    this.#placeCamera();
    const placed = roles.flatMap((role) => {
      const frames = this.#model.frames(role);
      return frames ? [{ role, frames, pose: this.#poseOf(role) }] : [];
    });
    return nearestKeyframe(placed, this.#camera, this.#model.centre);
  }

  /** An orbit that continues the view through a keyframe. */
  orbitFromHere(): OrbitState {
    this.#placeCamera();
    const { orbit, reach } = this.#model;
    const continuing = orbit.continuing(this.#camera, depthOfMiddle(this.#camera, reach));
    return continuing.target.every(Number.isFinite) ? continuing : this.orbit;
  }

  draw(service: RenderService, quality: Quality): void {
    const { width, height } = this.#placeCamera();
    const shown = window.devicePixelRatio || 1;
    fitCanvas(this.canvas, width, height, Math.min(shown, 2));
    const context = this.canvas.getContext("2d");
    if (context) {
      this.#render(service, context, width, height, quality);
    }
    this.drawOverlay();
  }

  #render(
    service: RenderService,
    context: CanvasRenderingContext2D,
    width: number,
    height: number,
    quality: Quality,
  ): void {
    const limit = service.maxSize / Math.max(width, height);
    const resolution = Math.min(quality.resolution, limit);
    for (const { role, layer } of this.#points) {
      layer.usePreview(quality.preview);
      const size =
        role === "truth"
          ? this.#state.pointSize * 1.5
          : role === "target"
            ? this.#state.pointSize * 0.85
            : this.#state.pointSize;
      layer.setSize(Math.max(1, size * resolution));
    }
    service.draw(
      this.#scene,
      this.#camera,
      context,
      Math.round(width * resolution),
      Math.round(height * resolution),
      this.#colors.background,
    );
  }

  /** As one picture for paper, where a canvas that was cleared would cover what lies below it. */
  drawForPaper(service: RenderService): void {
    this.#paper.src = this.picture(service, 2).toDataURL();
  }

  /** Where a point of the scene's frame is on the screen, or null behind the camera. */
  #project(p: readonly number[], width: number, height: number): [number, number] | null {
    const v = new Vector4(p[0], p[1], p[2], 1)
      .applyMatrix4(this.#camera.matrixWorldInverse)
      .applyMatrix4(this.#camera.projectionMatrix);
    return v.w > 0 ? [(v.x / v.w + 1) * 0.5 * width, (1 - v.y / v.w) * 0.5 * height] : null;
  }

  /** A landmark's position in the target's frame. */
  positionInTarget(pick: Pick): [number, number, number] {
    const { source, target } = this.#model;
    return pick.role === "source" && source
      ? apply(this.#pose, positionOf(source, pick.index))
      : positionOf(target, pick.index);
  }

  #inScene(p: Vector3): [number, number, number] {
    return subtract(p, this.#model.centre);
  }

  #onScreen(pick: Pick, width: number, height: number): [number, number] | null {
    return this.#project(this.#inScene(this.positionInTarget(pick)), width, height);
  }

  drawOverlay(): void {
    const { width, height } = this.#placeCamera();
    fitCanvas(this.overlay, width, height, Math.min(window.devicePixelRatio || 1, 2));
    const context = this.overlay.getContext("2d");
    if (context) {
      this.#annotate(context, width, height, this.overlay.width / width);
    }
  }

  #annotate(context: CanvasRenderingContext2D, width: number, height: number, ratio: number): void {
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const { selected, entered } = this.#state;
    if (entered && this.inside) {
      this.#frameView(context, entered, width, height);
    } else if (entered) {
      this.#markKeyframe(context, entered, width, height, true);
    }
    if (this.#state.layers.grid) {
      drawAxes(context, this.#camera.matrixWorldInverse.elements, height, this.#colors);
      context.font = "12px system-ui, sans-serif";
      context.fillStyle = this.#colors.muted;
      const cell = formatLength(this.#grid.cell, this.#model.lengthUnit);
      label(context, `Grid ${cell}`, 84, height - 14, this.#colors);
    }
    if (selected) {
      this.#markPick(context, selected, width, height, true);
    }
    if (this.#hovered && "frame" in this.#hovered) {
      this.#markKeyframe(context, this.#hovered, width, height, false);
    } else if (this.#hovered) {
      this.#markPick(context, this.#hovered, width, height, false);
    }
  }

  /** What the keyframe that is looked through saw, and what lies outside of its view. */
  #frameView(context: CanvasRenderingContext2D, { role, frame }: Keyframe, width: number, height: number): void {
    const frames = this.#model.frames(role);
    if (!frames) {
      return;
    }
    drawKeyframe(
      context,
      imageRectangle(this.#camera, frustumOf(frames), width, height),
      { width, height },
      { image: this.#state.images ? frames.images.get(frame) : undefined, name: this.#keyframeName({ role, frame }) },
      this.#colors,
      () => this.drawOverlay(),
    );
  }

  #markKeyframe(
    context: CanvasRenderingContext2D,
    { role, frame }: Keyframe,
    width: number,
    height: number,
    strong: boolean,
  ): void {
    const layer = this.#cameras.find((cameras) => cameras.role === role)?.layer;
    const corners = layer?.corners(frame).map((corner) => this.#mapOnScreen(role, corner, width, height)) ?? [];
    context.strokeStyle = this.#colors.selection;
    context.lineWidth = strong ? 2.25 : 1.5;
    context.beginPath();
    for (const [a, b] of kFrustumEdges) {
      const [from, to] = [corners[a], corners[b]];
      if (from && to) {
        context.moveTo(...from);
        context.lineTo(...to);
      }
    }
    context.stroke();
  }

  /** Where a point of a map's frame is on the screen. */
  #mapOnScreen(role: Role, p: Vector3, width: number, height: number): [number, number] | null {
    return this.#project(this.#inScene(apply(this.#poseOf(role), p)), width, height);
  }

  #keyframeName({ role, frame }: Keyframe): string {
    const frames = this.#model.frames(role);
    const map = !this.#model.source ? "Keyframe" : role === "source" ? "Source keyframe" : "Target keyframe";
    return frames ? `${map} ${keyframeText(frames, frame)}` : map;
  }

  #markPick(context: CanvasRenderingContext2D, pick: Pick, width: number, height: number, strong: boolean): void {
    const at = this.#onScreen(pick, width, height);
    if (!at) {
      return;
    }
    const matched = this.matchOf(pick);
    const partner = matched === null ? null : this.#onScreen({ role: "target", index: matched }, width, height);
    context.strokeStyle = this.#colors.selection;
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
  pick(x: number, y: number, touch: boolean): PanePick | null {
    const { width, height } = this.#placeCamera();
    const { layers, pointSize } = this.#state;
    const clip = new Matrix4().multiplyMatrices(this.#camera.projectionMatrix, this.#camera.matrixWorldInverse);
    const candidates: PickLayer[] = [];
    const add = (role: Role, cloud: LandmarkCloud, pose: Affine) =>
      candidates.push({
        role,
        cloud,
        clipFromStored: new Matrix4().multiplyMatrices(
          clip,
          setMatrix(new Matrix4(), compose(pose, dequantise(cloud)), this.#model.centre),
        ),
      });
    if (this.#model.source && layers.source) {
      add("source", this.#model.source, this.#pose);
    }
    if (layers.target) {
      add("target", this.#model.target, kIdentity);
    }
    const slack = touch ? kTouchSlack : kClickSlack;
    const landmark = pickLandmark(candidates, x, y, width, height, pointSize / 2 + 1, slack);
    let picked: PanePick | null = landmark && { role: landmark.role, index: landmark.index };
    let least = landmark?.distance ?? Infinity;
    for (const { role, layer } of this.#cameras.filter((cameras) => cameras.layer.object.visible)) {
      const found = layer.pick((p) => this.#mapOnScreen(role, p, width, height), [x, y], slack);
      const { entered } = this.#state;
      const lookedThrough = this.inside && entered?.role === role && entered.frame === found?.frame;
      if (found && !lookedThrough && found.distance < least) {
        least = found.distance;
        picked = { role, frame: found.frame };
      }
    }
    return picked;
  }

  hover(pick: PanePick | null, x: number, y: number): void {
    const same = JSON.stringify(pick) === JSON.stringify(this.#hovered);
    this.#hovered = pick;
    this.overlay.style.cursor = pick && "frame" in pick ? "pointer" : "";
    if (!same) {
      this.drawOverlay();
      this.tooltip.textContent = pick ? this.#tipText(pick) : "";
    }
    this.tooltip.hidden = pick === null;
    const room = this.surface.clientWidth - this.tooltip.offsetWidth - 8;
    this.tooltip.style.left = `${Math.max(4, Math.min(x + 14, room))}px`;
    this.tooltip.style.top = `${Math.max(4, y - 34)}px`;
  }

  #tipText(pick: PanePick): string {
    if ("frame" in pick) {
      return this.#keyframeName(pick);
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

  hint(text: string): void {
    this.#hint.textContent = text;
    this.#hint.hidden = false;
    clearTimeout(this.#hintTimer);
    this.#hintTimer = window.setTimeout(() => (this.#hint.hidden = true), 1200);
  }

  /** The current picture with its annotations at `ratio` pixels per CSS pixel. */
  picture(service: RenderService, ratio: number): HTMLCanvasElement {
    const { width, height } = this.#placeCamera();
    const canvas = document.createElement("canvas");
    fitCanvas(canvas, width, height, ratio);
    const context = canvas.getContext("2d");
    if (context) {
      this.#render(service, context, width, height, { resolution: ratio, preview: false });
      const layer = document.createElement("canvas");
      fitCanvas(layer, width, height, ratio);
      const onTop = layer.getContext("2d");
      if (onTop) {
        this.#annotate(onTop, width, height, ratio);
        context.drawImage(layer, 0, 0);
      }
    }
    return canvas;
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

function statusOf(run: Run | null): { text: string; kind: string } | null {
  const value: SummaryValue = run?.summary.find(([key]) => key === "status")?.[1] ?? null;
  if (typeof value !== "string" || value === "") {
    return null;
  }
  const kinds: Record<string, string> = {
    aligned: "good",
    ok: "good",
    success: "good",
    failed: "bad",
    rejected: "bad",
    ambiguous: "doubt",
  };
  const kind = Object.prototype.hasOwnProperty.call(kinds, value) ? kinds[value] : "plain";
  const sign = kind === "good" ? "✓ " : kind === "bad" ? "✕ " : kind === "doubt" ? "? " : "";
  return { text: sign + value, kind };
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

// SPDX-License-Identifier: BSD-3-Clause
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  LineBasicMaterial,
  LineDashedMaterial,
  LineSegments,
  Matrix4,
  PerspectiveCamera,
  Scene,
  Vector4,
} from "three";
import { h } from "../dom";
import type { Box, NetworkThing, Vector3 } from "../document/report";
import { formatLength, idText } from "../math/format";
import { apply, compose, dequantise, poseAt, positionOf } from "../math/pose";
import {
  depthOfMiddle,
  drawKeyframe,
  frustumOf,
  imageRectangle,
  keyframeText,
  lookThrough,
  nearestKeyframe,
  type Keyframe,
} from "../scene/keyframes";
import { CameraLayer, GridLayer, kFrustumEdges } from "../scene/line_layers";
import type { OrbitState } from "../scene/orbit";
import { drawAxes, fitCanvas, label } from "../scene/annotations";
import { distanceToSegment, pickLandmark, type PickLayer } from "../scene/picking";
import { PointLayer, setMatrix } from "../scene/point_layer";
import type { RenderService } from "../scene/render_service";
import type { Palette } from "../theme";
import { counts, linkColor, type NetworkModel, type Selection } from "./network_model";

export type NetworkLayer = "landmarks" | "cameras" | "links" | "rejected" | "changes" | "grid";

/** What the reader has chosen for the 3D view. */
export interface NetworkView {
  stage: number;
  layers: Record<NetworkLayer, boolean>;
  hidden: Set<number>;
  pointSize: number;
  selected: Selection | null;
  /** The keyframe, of the map with index `role`, that the view is through. */
  entered: Keyframe<number> | null;
  /** Whether to show what it saw. */
  images: boolean;
}

export const kThingColors: Record<NetworkThing["kind"], [string, string]> = {
  appeared: ["#00805c", "#24c795"],
  vanished: ["#b8480a", "#ff7a2e"],
  moved: ["#8a4fa0", "#d98fe0"],
};

export function thingColor(kind: NetworkThing["kind"], colors: Palette): string {
  return kThingColors[kind][colors.name === "light" ? 0 : 1];
}

const kSlack = { mouse: 8, touch: 18 };
const kLinkSlack = { mouse: 5, touch: 12 };

/** The 3D view of all maps of a group: their landmarks, cameras, links and changes. */
export class NetworkStage {
  readonly canvas = h("canvas", { class: "pane-canvas" });
  readonly overlay = h("canvas", { class: "pane-overlay", tabindex: 0, role: "img", "aria-label": "3D view" });
  readonly tooltip = h("div", { class: "pane-tip", hidden: true });
  readonly hintBox = h("div", { class: "pane-hint", hidden: true, "aria-hidden": "true" });
  readonly #paper = h("img", { class: "pane-paper", alt: "", decoding: "sync" });
  readonly surface = h(
    "div",
    { class: "pane-surface" },
    this.canvas,
    this.#paper,
    this.overlay,
    this.tooltip,
    this.hintBox,
  );
  orbit: OrbitState;
  readonly #model: NetworkModel;
  readonly #view: NetworkView;
  readonly #previewStride: number;
  readonly #camera = new PerspectiveCamera();
  #scene = new Scene();
  #points = new Map<number, PointLayer>();
  #cameras = new Map<number, CameraLayer>();
  #links = new Map<number, LineSegments>();
  #things = new Map<number, LineSegments>();
  #grid: GridLayer;
  #colors: Palette;
  #hovered: Keyframe<number> | null = null;
  #hintTimer = 0;

  constructor(model: NetworkModel, view: NetworkView, colors: Palette, previewStride: number) {
    this.#model = model;
    this.#view = view;
    this.#colors = colors;
    this.#previewStride = previewStride;
    this.orbit = model.orbit.view("home", model.half, 1.5);
    this.#grid = new GridLayer(model);
    this.showGroup();
  }

  /** Takes over the group that the model shows. */
  showGroup(): void {
    const model = this.#model;
    this.#scene = new Scene();
    this.#points.clear();
    this.#cameras.clear();
    this.#links.clear();
    this.#things.clear();
    this.#hovered = null;
    for (const index of model.shownNodes()) {
      const { cloud } = model.nodes[index];
      if (!cloud) {
        continue;
      }
      const layer = new PointLayer(cloud, "disc", 1, this.#previewStride);
      this.#points.set(index, layer);
      this.#scene.add(layer.object);
      if (cloud.frames && cloud.frames.count > 0) {
        const cameras = new CameraLayer(cloud, cloud.frames, 0.6 * model.reach);
        this.#cameras.set(index, cameras);
        this.#scene.add(cameras.object);
      }
    }
    model.links.forEach((link, index) => {
      if (model.isShown(link.target) && model.isShown(link.source)) {
        const line = segments(6, counts(link) ? null : 0.02 * model.reach);
        this.#links.set(index, line);
        this.#scene.add(line);
      }
    });
    model.section.things.forEach((thing, index) => {
      if (thing.group === model.group) {
        const lines = boxLines(thing.boxes, model.centre);
        this.#things.set(index, lines);
        this.#scene.add(lines);
      }
    });
    this.#grid = new GridLayer(model);
    this.#scene.add(this.#grid.object);
    this.orbit = model.orbit.view("home", model.half, this.#aspect());
    this.setColors(this.#colors);
  }

  #aspect(): number {
    return (this.surface.clientWidth || 3) / (this.surface.clientHeight || 2);
  }

  setColors(colors: Palette): void {
    const model = this.#model;
    this.#colors = colors;
    this.#grid.setColors(colors);
    for (const [index, layer] of this.#points) {
      layer.showRole(model.nodeColor(index, colors));
    }
    for (const [index, layer] of this.#cameras) {
      layer.setColor(model.nodeColor(index, colors));
    }
    for (const [index, line] of this.#links) {
      (line.material as LineBasicMaterial).color = new Color(linkColor(model.links[index], colors));
    }
    for (const [index, lines] of this.#things) {
      (lines.material as LineBasicMaterial).color = new Color(thingColor(model.section.things[index].kind, colors));
    }
    this.moveTo();
  }

  /** Puts everything where it is at the view's stage. */
  moveTo(): void {
    const model = this.#model;
    const { stage, layers, hidden } = this.#view;
    for (const [index, layer] of this.#points) {
      layer.place(model.pose(index, stage), model.centre);
      layer.object.visible = layers.landmarks && !hidden.has(index);
    }
    for (const [index, layer] of this.#cameras) {
      layer.place(model.pose(index, stage), model.centre);
      layer.object.visible = layers.cameras && !hidden.has(index);
    }
    for (const [index, line] of this.#links) {
      const link = model.links[index];
      line.visible = this.#showsPlan() && this.#showsLink(index);
      setEnds(
        line,
        this.#inScene(model.centreOf(link.target, stage)),
        this.#inScene(model.centreOf(link.source, stage)),
      );
    }
    for (const lines of this.#things.values()) {
      lines.visible = this.#showsThings();
    }
    this.#grid.object.visible = layers.grid;
    const name = model.section.stages[Math.round(stage)] ?? "";
    this.overlay.setAttribute("aria-label", `3D view of ${this.#points.size} maps. ${name}.`);
  }

  /** Links and centres say how maps hang together; over what a keyframe saw they would hide it. */
  #showsPlan(): boolean {
    return this.#view.entered === null;
  }

  #showsLink(index: number): boolean {
    const link = this.#model.links[index];
    const { layers, hidden } = this.#view;
    return (counts(link) ? layers.links : layers.rejected) && !hidden.has(link.target) && !hidden.has(link.source);
  }

  /** Changes are places in the result: before it they would lie beside the landmarks. */
  #showsThings(): boolean {
    return this.#view.layers.changes && this.#view.stage > this.#model.lastStage - 0.02;
  }

  #inScene(p: readonly number[]): [number, number, number] {
    const { centre } = this.#model;
    return [p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]];
  }

  #placeCamera(): { width: number; height: number } {
    const width = Math.max(1, this.surface.clientWidth);
    const height = Math.max(1, this.surface.clientHeight);
    const { entered, stage } = this.#view;
    const { centre, reach } = this.#model;
    const frames = entered && this.#model.frames(entered.role);
    if (entered && frames) {
      const pose = compose(this.#model.pose(entered.role, stage), poseAt(frames.poses, entered.frame));
      lookThrough(this.#camera, pose, centre, frustumOf(frames), width / height, reach);
    } else {
      this.#model.orbit.place(this.#camera, this.orbit, width / height, reach);
    }
    return { width, height };
  }

  /** The keyframe whose eye is nearest to that of the view, of these maps. */
  nearestKeyframe(nodes: readonly number[]): Keyframe<number> | null {
    this.#placeCamera();
    const placed = nodes.flatMap((role) => {
      const frames = this.#model.frames(role);
      return frames ? [{ role, frames, pose: this.#model.pose(role, this.#view.stage) }] : [];
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

  draw(service: RenderService, resolution: number, preview: boolean): void {
    const { width, height } = this.#placeCamera();
    fitCanvas(this.canvas, width, height, Math.min(window.devicePixelRatio || 1, 2));
    const context = this.canvas.getContext("2d");
    const pixels = Math.min(resolution, service.maxSize / Math.max(width, height));
    for (const layer of this.#points.values()) {
      layer.usePreview(preview);
      layer.setSize(Math.max(1, this.#view.pointSize * pixels));
    }
    if (context) {
      const size = [Math.round(width * pixels), Math.round(height * pixels)];
      service.draw(this.#scene, this.#camera, context, size[0], size[1], this.#colors.background);
    }
    this.drawOverlay();
  }

  /** Where a point of the scene's frame is on the screen, or null behind the camera. */
  #project(p: readonly number[], width: number, height: number): [number, number] | null {
    const v = new Vector4(p[0], p[1], p[2], 1)
      .applyMatrix4(this.#camera.matrixWorldInverse)
      .applyMatrix4(this.#camera.projectionMatrix);
    return v.w > 0 ? [(v.x / v.w + 1) * 0.5 * width, (1 - v.y / v.w) * 0.5 * height] : null;
  }

  #linkOnScreen(index: number, width: number, height: number): [[number, number], [number, number]] | null {
    const { target, source } = this.#model.links[index];
    const { stage } = this.#view;
    const ends = [target, source].map((node) =>
      this.#project(this.#inScene(this.#model.centreOf(node, stage)), width, height),
    );
    return ends[0] && ends[1] ? [ends[0], ends[1]] : null;
  }

  #frameOnScreen(node: number, frame: number, width: number, height: number): [number, number] | null {
    const frames = this.#model.nodes[node].cloud?.frames;
    if (!frames) {
      return null;
    }
    const eye: [number, number, number] = [
      frames.poses[7 * frame],
      frames.poses[7 * frame + 1],
      frames.poses[7 * frame + 2],
    ];
    return this.#project(this.#inScene(apply(this.#model.pose(node, this.#view.stage), eye)), width, height);
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
    const { layers, selected, stage, hidden } = this.#view;
    const model = this.#model;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    this.#annotateKeyframe(context, width, height);
    if (layers.grid) {
      drawAxes(context, this.#camera.matrixWorldInverse.elements, height, this.#colors);
      const text = `Grid ${formatLength(this.#grid.cell, model.lengthUnit)}`;
      context.font = "12px system-ui, sans-serif";
      context.fillStyle = this.#colors.muted;
      label(context, text, 84, height - 14, this.#colors);
    }
    if (this.#showsPlan() && (layers.links || layers.rejected)) {
      for (const index of model.shownNodes()) {
        const at = hidden.has(index) ? null : this.#project(this.#inScene(model.centreOf(index, stage)), width, height);
        if (at) {
          context.beginPath();
          context.arc(at[0], at[1], 6, 0, 2 * Math.PI);
          context.fillStyle = model.nodeColor(index, this.#colors);
          context.strokeStyle = this.#colors.background;
          context.lineWidth = 2;
          context.fill();
          context.stroke();
        }
      }
    }
    if (this.#showsThings()) {
      context.font = "600 11px system-ui, sans-serif";
      for (const index of this.#things.keys()) {
        const thing = model.section.things[index];
        const { low, high } = thing.boxes[0];
        const top = [0, 1, 2].map((i) => (low[i] + high[i]) / 2);
        const at = this.#project(this.#inScene(top), width, height);
        if (at) {
          context.textAlign = "center";
          context.textBaseline = "middle";
          context.fillStyle = thingColor(thing.kind, this.#colors);
          label(context, thing.name, at[0], at[1], this.#colors);
        }
      }
      context.textAlign = "left";
      context.textBaseline = "alphabetic";
    }
    context.strokeStyle = this.#colors.selection;
    context.lineWidth = 2.5;
    if (this.#hovered) {
      this.#outline(context, this.#hovered, width, height);
    }
    if (selected?.kind === "link" && this.#links.has(selected.index) && this.#showsPlan()) {
      const ends = this.#linkOnScreen(selected.index, width, height);
      if (ends) {
        context.setLineDash(counts(model.links[selected.index]) ? [] : [7, 5]);
        context.lineWidth = 3.5;
        context.beginPath();
        context.moveTo(...ends[0]);
        context.lineTo(...ends[1]);
        context.stroke();
        context.setLineDash([]);
      }
    } else if (selected?.kind === "node" && model.isShown(selected.index)) {
      const { cloud } = model.nodes[selected.index];
      const pose = model.pose(selected.index, stage);
      const at =
        selected.frame !== undefined
          ? this.#frameOnScreen(selected.index, selected.frame, width, height)
          : selected.landmark !== undefined && cloud
            ? this.#project(this.#inScene(apply(pose, positionOf(cloud, selected.landmark))), width, height)
            : this.#showsPlan() && this.#project(this.#inScene(model.centreOf(selected.index, stage)), width, height);
      if (at) {
        context.beginPath();
        context.arc(at[0], at[1], 10, 0, 2 * Math.PI);
        context.stroke();
      }
    } else if (selected?.kind === "thing" && this.#things.has(selected.index)) {
      const { low, high } = model.section.things[selected.index].boxes[0];
      const at = this.#project(this.#inScene([0, 1, 2].map((i) => (low[i] + high[i]) / 2)), width, height);
      if (at) {
        context.strokeRect(at[0] - 30, at[1] - 12, 60, 24);
      }
    }
  }

  /** What the keyframe that is looked through saw. */
  #annotateKeyframe(context: CanvasRenderingContext2D, width: number, height: number): void {
    const { entered, images } = this.#view;
    const frames = entered && this.#model.frames(entered.role);
    if (!entered || !frames) {
      return;
    }
    drawKeyframe(
      context,
      imageRectangle(this.#camera, frustumOf(frames), width, height),
      { width, height },
      {
        image: images ? frames.images.get(entered.frame) : undefined,
        name: `${this.#model.nodes[entered.role].name} ${keyframeText(frames, entered.frame)}`,
      },
      this.#colors,
      () => this.drawOverlay(),
    );
  }

  /** Draws the edges of a keyframe's frustum. */
  #outline(context: CanvasRenderingContext2D, { role, frame }: Keyframe<number>, width: number, height: number): void {
    const pose = this.#model.pose(role, this.#view.stage);
    const corners = this.#cameras.get(role)?.corners(frame) ?? [];
    const places = corners.map((corner) => this.#project(this.#inScene(apply(pose, corner)), width, height));
    context.lineWidth = 1.5;
    context.beginPath();
    for (const [a, b] of kFrustumEdges) {
      const [from, to] = [places[a], places[b]];
      if (from && to) {
        context.moveTo(...from);
        context.lineTo(...to);
      }
    }
    context.stroke();
  }

  /** What is at a place of the view: a camera, a change, a link, or a landmark. */
  pick(x: number, y: number, touch: boolean): Selection | null {
    const { width, height } = this.#placeCamera();
    const model = this.#model;
    const { layers, hidden, stage, pointSize } = this.#view;
    const way = touch ? "touch" : "mouse";
    let best: Selection | null = null;
    let nearest = kSlack[way];
    const offer = (at: [number, number] | null, selection: Selection) => {
      const distance = at ? Math.hypot(at[0] - x, at[1] - y) : Infinity;
      if (distance < nearest) {
        nearest = distance;
        best = selection;
      }
    };
    if (this.#showsThings()) {
      for (const index of this.#things.keys()) {
        const { low, high } = model.section.things[index].boxes[0];
        const middle = [0, 1, 2].map((i) => (low[i] + high[i]) / 2);
        offer(this.#project(this.#inScene(middle), width, height), { kind: "thing", index });
      }
    }
    if (this.#showsPlan() && (layers.links || layers.rejected)) {
      for (const index of model.shownNodes().filter((node) => !hidden.has(node))) {
        offer(this.#project(this.#inScene(model.centreOf(index, stage)), width, height), { kind: "node", index });
      }
    }
    if (layers.cameras) {
      const { entered } = this.#view;
      for (const [index, layer] of this.#cameras) {
        if (hidden.has(index)) {
          continue;
        }
        const pose = model.pose(index, stage);
        const onScreen = (p: Vector3) => this.#project(this.#inScene(apply(pose, p)), width, height);
        const found = layer.pick(onScreen, [x, y], nearest);
        const lookedThrough = entered?.role === index && entered.frame === found?.frame;
        if (found && !lookedThrough && found.distance < nearest) {
          nearest = found.distance;
          best = { kind: "node", index, frame: found.frame };
        }
      }
    }
    if (best) {
      return best;
    }
    nearest = kLinkSlack[way];
    for (const index of this.#links.keys()) {
      const ends = this.#showsPlan() && this.#showsLink(index) ? this.#linkOnScreen(index, width, height) : null;
      const distance = ends ? distanceToSegment([x, y], ends[0], ends[1]) : Infinity;
      if (distance < nearest) {
        nearest = distance;
        best = { kind: "link", index };
      }
    }
    if (best || !layers.landmarks) {
      return best;
    }
    const clip = new Matrix4().multiplyMatrices(this.#camera.projectionMatrix, this.#camera.matrixWorldInverse);
    const candidates = [...this.#points.keys()].flatMap((index): PickLayer<number>[] => {
      const { cloud } = model.nodes[index];
      if (hidden.has(index) || !cloud) {
        return [];
      }
      const matrix = setMatrix(new Matrix4(), compose(model.pose(index, stage), dequantise(cloud)), model.centre);
      return [{ role: index, cloud, clipFromStored: new Matrix4().multiplyMatrices(clip, matrix) }];
    });
    const found = pickLandmark(candidates, x, y, width, height, pointSize / 2 + 1, kSlack[way]);
    return found && { kind: "node", index: found.role, landmark: found.index };
  }

  hover(selection: Selection | null, x: number, y: number): void {
    const frame = selection?.kind === "node" ? selection.frame : undefined;
    const hovered = selection && frame !== undefined ? { role: selection.index, frame } : null;
    if (JSON.stringify(hovered) !== JSON.stringify(this.#hovered)) {
      this.#hovered = hovered;
      this.overlay.style.cursor = hovered ? "pointer" : "";
      this.drawOverlay();
    }
    this.tooltip.textContent = selection ? this.#tipText(selection) : "";
    this.tooltip.hidden = selection === null;
    const room = this.surface.clientWidth - this.tooltip.offsetWidth - 8;
    this.tooltip.style.left = `${Math.max(4, Math.min(x + 14, room))}px`;
    this.tooltip.style.top = `${Math.max(4, y - 34)}px`;
  }

  #tipText(selection: Selection): string {
    const model = this.#model;
    if (selection.kind === "link") {
      return model.linkName(selection.index);
    }
    if (selection.kind === "thing") {
      return model.section.things[selection.index].name;
    }
    const { name, cloud } = model.nodes[selection.index];
    if (selection.frame !== undefined && cloud?.frames) {
      return `${name} · keyframe ${keyframeText(cloud.frames, selection.frame)}`;
    }
    return selection.landmark === undefined
      ? name
      : `${name} · landmark ${idText(cloud?.ids ?? null, selection.landmark)}`;
  }

  hint(text: string): void {
    this.hintBox.textContent = text;
    this.hintBox.hidden = false;
    clearTimeout(this.#hintTimer);
    this.#hintTimer = window.setTimeout(() => (this.hintBox.hidden = true), 1200);
  }

  /** The current picture with its annotations at `ratio` pixels per CSS pixel. */
  /** As one picture for paper; see Pane. */
  drawForPaper(service: RenderService): void {
    this.#paper.src = this.picture(service, 2).toDataURL();
  }

  picture(service: RenderService, ratio: number): HTMLCanvasElement {
    this.draw(service, ratio, false);
    const canvas = document.createElement("canvas");
    canvas.width = this.canvas.width;
    canvas.height = this.canvas.height;
    const context = canvas.getContext("2d");
    context?.drawImage(this.canvas, 0, 0);
    context?.drawImage(this.overlay, 0, 0, canvas.width, canvas.height);
    return canvas;
  }
}

/** Lines whose ends are set later; dashed if `dash` is the length of one. */
function segments(count: number, dash: number | null): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(count), 3));
  const material =
    dash === null
      ? new LineBasicMaterial({ depthTest: false, transparent: true })
      : new LineDashedMaterial({ dashSize: dash, gapSize: dash, depthTest: false, transparent: true });
  const lines = new LineSegments(geometry, material);
  lines.frustumCulled = false;
  lines.renderOrder = 2;
  return lines;
}

function setEnds(line: LineSegments, a: readonly number[], b: readonly number[]): void {
  const position = line.geometry.getAttribute("position") as BufferAttribute;
  position.setXYZ(0, a[0], a[1], a[2]);
  position.setXYZ(1, b[0], b[1], b[2]);
  position.needsUpdate = true;
  if (line.material instanceof LineDashedMaterial) {
    line.computeLineDistances();
  }
}

function boxLines(boxes: Box[], centre: readonly number[]): LineSegments {
  const points: number[] = [];
  const middle = (box: Box) => [0, 1, 2].map((i) => (box.low[i] + box.high[i]) / 2 - centre[i]);
  for (const { low, high } of boxes) {
    const corner = (bits: number) => [0, 1, 2].map((i) => (bits & (1 << i) ? high[i] : low[i]) - centre[i]);
    for (let bits = 0; bits < 8; ++bits) {
      for (const axis of [1, 2, 4]) {
        if (!(bits & axis)) {
          points.push(...corner(bits), ...corner(bits | axis));
        }
      }
    }
  }
  if (boxes.length === 2) {
    points.push(...middle(boxes[0]), ...middle(boxes[1]));
  }
  const lines = segments(points.length, null);
  (lines.geometry.getAttribute("position") as BufferAttribute).set(points);
  return lines;
}

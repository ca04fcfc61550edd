// SPDX-License-Identifier: BSD-3-Clause
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  LineBasicMaterial,
  LineDashedMaterial,
  LineSegments,
  Scene,
} from "three";
import { idText } from "../math/format";
import { apply, positionOf, subtract, type Affine } from "../math/pose";
import { keyframeText, type Keyframe } from "../scene/keyframes";
import { CameraLayer, GridLayer } from "../scene/line_layers";
import { distanceToSegment, pickLandmark } from "../scene/picking";
import { PointLayer } from "../scene/point_layer";
import { View3d, type Quality } from "../scene/view3d";
import type { Palette } from "../theme";
import { counts, linkColor, type NetworkModel, type Selection } from "./network_model";

export type NetworkLayer = "landmarks" | "cameras" | "links" | "rejected" | "grid";

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

const kSlack = { mouse: 8, touch: 18 };
const kLinkSlack = { mouse: 5, touch: 12 };

/** The 3D view of all maps of a group: their landmarks, cameras and links. */
export class NetworkStage extends View3d<number, Selection> {
  readonly #model: NetworkModel;
  readonly #view: NetworkView;
  readonly #previewStride: number;
  #points = new Map<number, PointLayer>();
  #links = new Map<number, LineSegments>();
  protected grid: GridLayer;

  constructor(model: NetworkModel, view: NetworkView, colors: Palette, previewStride: number) {
    super(model, view, colors);
    this.#model = model;
    this.#view = view;
    this.#previewStride = previewStride;
    this.grid = new GridLayer(model.extent);
    this.showGroup();
  }

  /** Takes over the group that the model shows. */
  showGroup(): void {
    const model = this.#model;
    this.scene = new Scene();
    this.#points.clear();
    this.cameras.clear();
    this.#links.clear();
    this.hovered = null;
    for (const index of model.shownNodes()) {
      const { cloud } = model.nodes[index];
      if (!cloud) {
        continue;
      }
      const layer = new PointLayer(cloud, "disc", 1, this.#previewStride);
      this.#points.set(index, layer);
      this.scene.add(layer.object);
      if (cloud.frames && cloud.frames.count > 0) {
        const cameras = new CameraLayer(cloud, cloud.frames, 0.6 * model.extent.reach);
        this.cameras.set(index, cameras);
        this.scene.add(cameras.object);
      }
    }
    model.links.forEach((link, index) => {
      if (model.isShown(link.target) && model.isShown(link.source)) {
        const line = segments(6, counts(link) ? null : 0.02 * model.extent.reach);
        this.#links.set(index, line);
        this.scene.add(line);
      }
    });
    this.grid = new GridLayer(model.extent);
    this.scene.add(this.grid.object);
    this.orbit = this.standardOrbit("home");
    this.setColors(this.colors);
  }

  setColors(colors: Palette): void {
    const model = this.#model;
    this.colors = colors;
    this.grid.setColors(colors);
    for (const [index, layer] of this.#points) {
      layer.showRole(model.nodeColor(index, colors));
    }
    for (const [index, layer] of this.cameras) {
      layer.setColor(model.nodeColor(index, colors));
    }
    for (const [index, line] of this.#links) {
      (line.material as LineBasicMaterial).color = new Color(linkColor(model.links[index], colors));
    }
    this.moveTo();
  }

  /** Puts everything where it is at the view's stage. */
  moveTo(): void {
    const model = this.#model;
    const { stage, layers, hidden } = this.#view;
    for (const [index, layer] of this.#points) {
      layer.place(model.pose(index, stage), model.extent.centre);
      layer.object.visible = layers.landmarks && !hidden.has(index);
    }
    for (const [index, layer] of this.cameras) {
      layer.place(model.pose(index, stage), model.extent.centre);
      layer.object.visible = layers.cameras && !hidden.has(index);
    }
    for (const [index, line] of this.#links) {
      const link = model.links[index];
      line.visible = this.#showsPlan() && this.#showsLink(index);
      setEnds(
        line,
        subtract(model.centreOf(link.target, stage), model.extent.centre),
        subtract(model.centreOf(link.source, stage), model.extent.centre),
      );
    }
    this.grid.object.visible = layers.grid;
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

  protected get through(): Keyframe<number> | null {
    return this.#view.entered;
  }

  protected poseOf(role: number): Affine {
    return this.#model.pose(role, this.#view.stage);
  }

  protected prepare({ resolution, preview }: Quality): void {
    for (const layer of this.#points.values()) {
      layer.usePreview(preview);
      layer.setSize(Math.max(1, this.#view.pointSize * resolution));
    }
  }

  #linkOnScreen(index: number): [[number, number], [number, number]] | null {
    const { target, source } = this.#model.links[index];
    const ends = [target, source].map((node) => this.#centreOnScreen(node));
    return ends[0] && ends[1] ? [ends[0], ends[1]] : null;
  }

  #centreOnScreen(node: number): [number, number] | null {
    return this.onScreen(this.#model.centreOf(node, this.#view.stage));
  }

  #frameOnScreen(node: number, frame: number): [number, number] | null {
    const { poses } = this.#model.nodes[node].cloud?.frames ?? {};
    return poses
      ? this.onScreen(apply(this.poseOf(node), [poses[7 * frame], poses[7 * frame + 1], poses[7 * frame + 2]]))
      : null;
  }

  protected annotate(context: CanvasRenderingContext2D): void {
    const { layers, selected, hidden } = this.#view;
    const model = this.#model;
    if (this.#showsPlan() && (layers.links || layers.rejected)) {
      for (const index of model.shownNodes()) {
        const at = hidden.has(index) ? null : this.#centreOnScreen(index);
        if (at) {
          context.beginPath();
          context.arc(at[0], at[1], 6, 0, 2 * Math.PI);
          context.fillStyle = model.nodeColor(index, this.colors);
          context.strokeStyle = this.colors.background;
          context.lineWidth = 2;
          context.fill();
          context.stroke();
        }
      }
    }
    const hovered = this.hovered && this.keyframeOf(this.hovered);
    if (hovered) {
      this.outline(context, hovered, 1.5);
    }
    context.strokeStyle = this.colors.selection;
    context.lineWidth = hovered ? 1.5 : 2.5;
    if (selected?.kind === "link" && this.#links.has(selected.index) && this.#showsPlan()) {
      const ends = this.#linkOnScreen(selected.index);
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
      const at =
        selected.frame !== undefined
          ? this.#frameOnScreen(selected.index, selected.frame)
          : selected.landmark !== undefined && cloud
            ? this.onScreen(apply(this.poseOf(selected.index), positionOf(cloud, selected.landmark)))
            : this.#showsPlan() && this.#centreOnScreen(selected.index);
      if (at) {
        context.beginPath();
        context.arc(at[0], at[1], 10, 0, 2 * Math.PI);
        context.stroke();
      }
    }
  }

  protected keyframeName({ role, frame }: Keyframe<number>): string {
    const { name, cloud } = this.#model.nodes[role];
    return cloud?.frames ? `${name} ${keyframeText(cloud.frames, frame)}` : name;
  }

  protected keyframeOf(selection: Selection): Keyframe<number> | null {
    return selection.kind === "node" && selection.frame !== undefined
      ? { role: selection.index, frame: selection.frame }
      : null;
  }

  /** What is at a place of the view: a camera, a link, or a landmark. */
  protected pickHere(
    [x, y]: [number, number],
    touch: boolean,
    { width, height }: { width: number; height: number },
  ): Selection | null {
    const model = this.#model;
    const { layers, hidden, pointSize } = this.#view;
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
    if (this.#showsPlan() && (layers.links || layers.rejected)) {
      for (const index of model.shownNodes().filter((node) => !hidden.has(node))) {
        offer(this.#centreOnScreen(index), { kind: "node", index });
      }
    }
    const keyframe = this.pickKeyframe([x, y], nearest);
    if (keyframe) {
      best = { kind: "node", index: keyframe.role, frame: keyframe.frame };
    }
    if (best) {
      return best;
    }
    nearest = kLinkSlack[way];
    for (const index of this.#links.keys()) {
      const ends = this.#showsPlan() && this.#showsLink(index) ? this.#linkOnScreen(index) : null;
      const distance = ends ? distanceToSegment([x, y], ends[0], ends[1]) : Infinity;
      if (distance < nearest) {
        nearest = distance;
        best = { kind: "link", index };
      }
    }
    if (best || !layers.landmarks) {
      return best;
    }
    const candidates = [...this.#points.keys()].flatMap((index) => {
      const { cloud } = model.nodes[index];
      return hidden.has(index) || !cloud ? [] : [this.pickLayer(index, cloud, this.poseOf(index))];
    });
    const found = pickLandmark(candidates, x, y, width, height, pointSize / 2 + 1, kSlack[way]);
    return found && { kind: "node", index: found.role, landmark: found.index };
  }

  protected tipText(selection: Selection): string {
    const model = this.#model;
    if (selection.kind === "link") {
      return model.linkName(selection.index);
    }
    const { name, cloud } = model.nodes[selection.index];
    if (selection.frame !== undefined && cloud?.frames) {
      return `${name} · keyframe ${keyframeText(cloud.frames, selection.frame)}`;
    }
    return selection.landmark === undefined
      ? name
      : `${name} · landmark ${idText(cloud?.ids ?? null, selection.landmark)}`;
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

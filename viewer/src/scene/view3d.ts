// SPDX-License-Identifier: BSD-3-Clause
import { Matrix4, PerspectiveCamera, Scene, Vector4 } from "three";
import { h } from "../dom";
import type { Frames, LandmarkCloud, Vector3 } from "../document/report";
import { formatLength } from "../math/format";
import { apply, compose, dequantise, poseAt, subtract, type Affine } from "../math/pose";
import type { Palette } from "../theme";
import { drawAxes, fitCanvas, label } from "./annotations";
import type { Extent } from "./extent";
import { depthOfMiddle, drawKeyframe, frustumOf, imageRectangle, lookThrough, nearestKeyframe } from "./keyframes";
import type { Keyframe } from "./keyframes";
import { kFrustumEdges, type CameraLayer, type GridLayer } from "./line_layers";
import type { Orbit, OrbitState } from "./orbit";
import type { PickLayer } from "./picking";
import { setMatrix } from "./point_layer";
import type { RenderService } from "./render_service";

export interface Quality {
  /** Picture pixels per CSS pixel. */
  resolution: number;
  preview: boolean;
}

/** What is seen: landmarks, and the keyframes of the maps that `R` names. */
interface ViewedModel<R> {
  readonly extent: Extent;
  readonly lengthUnit: "m" | "mapunits";
  frames(role: R): Frames | null;
}

/** What the reader has chosen for every kind of view. */
interface ViewChoices<R> {
  layers: { grid: boolean };
  entered: Keyframe<R> | null;
  images: boolean;
}

type Place = [x: number, y: number];

/** A 3D view: its canvases, its camera, and the keyframe that it may be through. `Picked` can be under the pointer. */
export abstract class View3d<R, Picked> {
  readonly canvas = h("canvas", { class: "pane-canvas" });
  readonly overlay = h("canvas", { class: "pane-overlay", tabindex: 0, role: "img", "aria-label": "3D view" });
  readonly #tooltip = h("div", { class: "pane-tip", hidden: true });
  readonly #hint = h("div", { class: "pane-hint", hidden: true, "aria-hidden": "true" });
  readonly #paper = h("img", { class: "pane-paper", alt: "", decoding: "sync" });
  readonly surface = h(
    "div",
    { class: "pane-surface" },
    this.canvas,
    this.#paper,
    this.overlay,
    this.#tooltip,
    this.#hint,
  );
  orbit: OrbitState;
  protected hovered: Picked | null = null;
  protected scene = new Scene();
  protected readonly cameras = new Map<R, CameraLayer>();
  protected abstract grid: GridLayer;
  readonly #model: ViewedModel<R>;
  readonly #choices: ViewChoices<R>;
  readonly #camera = new PerspectiveCamera();
  /** Of the view, in CSS pixels. */
  #width = 1;
  #height = 1;
  #hintTimer = 0;

  protected constructor(
    model: ViewedModel<R>,
    choices: ViewChoices<R>,
    protected colors: Palette,
  ) {
    this.#model = model;
    this.#choices = choices;
    this.orbit = model.extent.orbit.view("home", model.extent.half, 1.5);
  }

  /** The keyframe that the view is through. */
  protected abstract get through(): Keyframe<R> | null;
  /** Of a map, in the frame of the scene before it is moved to its centre, as shown. */
  protected abstract poseOf(role: R): Affine;
  protected abstract keyframeName(keyframe: Keyframe<R>): string;
  protected abstract keyframeOf(picked: Picked): Keyframe<R> | null;
  protected abstract tipText(picked: Picked): string;
  /** Of the points, in picture pixels per CSS pixel. */
  protected abstract prepare(quality: Quality): void;
  /** What this view draws over its picture, above the grid's label. */
  protected abstract annotate(context: CanvasRenderingContext2D): void;

  protected get aspect(): number {
    return (this.surface.clientWidth || 3) / (this.surface.clientHeight || 2);
  }

  /** Looks from a standard view at the whole scene. */
  standardOrbit(name: Parameters<Orbit["view"]>[0]): OrbitState {
    return this.#model.extent.orbit.view(name, this.#model.extent.half, this.aspect);
  }

  #placeCamera(): void {
    this.#width = Math.max(1, this.surface.clientWidth);
    this.#height = Math.max(1, this.surface.clientHeight);
    const { centre, reach, orbit } = this.#model.extent;
    const aspect = this.#width / this.#height;
    const { through } = this;
    const frames = through && this.#model.frames(through.role);
    if (through && frames) {
      const pose = compose(this.poseOf(through.role), poseAt(frames.poses, through.frame));
      lookThrough(this.#camera, pose, centre, frustumOf(frames), aspect, reach);
    } else {
      orbit.place(this.#camera, this.orbit, aspect, reach);
    }
  }

  /** The keyframe whose eye is nearest to that of the view, of these maps. */
  nearestKeyframe(roles: readonly R[]): Keyframe<R> | null {
    this.#placeCamera();
    const placed = roles.flatMap((role) => {
      const frames = this.#model.frames(role);
      return frames ? [{ role, frames, pose: this.poseOf(role) }] : [];
    });
    return nearestKeyframe(placed, this.#camera, this.#model.extent.centre);
  }

  /** An orbit that continues the view through a keyframe. */
  orbitFromHere(): OrbitState {
    this.#placeCamera();
    const { orbit, reach } = this.#model.extent;
    const continuing = orbit.continuing(this.#camera, depthOfMiddle(this.#camera, reach));
    return continuing.target.every(Number.isFinite) ? continuing : this.orbit;
  }

  draw(service: RenderService, quality: Quality): void {
    this.#placeCamera();
    this.#render(service, this.canvas, Math.min(window.devicePixelRatio || 1, 2), quality);
    this.drawOverlay();
  }

  #render(service: RenderService, canvas: HTMLCanvasElement, ratio: number, { resolution, preview }: Quality): void {
    fitCanvas(canvas, this.#width, this.#height, ratio);
    const context = canvas.getContext("2d");
    const pixels = Math.min(resolution, service.maxSize / Math.max(this.#width, this.#height));
    this.prepare({ resolution: pixels, preview });
    if (context) {
      const size = [Math.round(this.#width * pixels), Math.round(this.#height * pixels)];
      service.draw(this.scene, this.#camera, context, size[0], size[1], this.colors.background);
    }
  }

  drawOverlay(): void {
    this.#placeCamera();
    this.#drawAnnotations(this.overlay, Math.min(window.devicePixelRatio || 1, 2));
  }

  #drawAnnotations(canvas: HTMLCanvasElement, ratio: number): void {
    fitCanvas(canvas, this.#width, this.#height, ratio);
    const context = canvas.getContext("2d");
    if (!context) {
      return;
    }
    const scale = canvas.width / this.#width;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, this.#width, this.#height);
    if (this.through) {
      this.#annotateKeyframe(context, this.through);
    }
    if (this.#choices.layers.grid) {
      drawAxes(context, this.#camera.matrixWorldInverse.elements, this.#height, this.colors);
      context.font = "12px system-ui, sans-serif";
      context.fillStyle = this.colors.muted;
      const cell = formatLength(this.grid.cell, this.#model.lengthUnit);
      label(context, `Grid ${cell}`, 84, this.#height - 14, this.colors);
    }
    this.annotate(context);
  }

  /** What the keyframe that is looked through saw, and what lies outside of its view. */
  #annotateKeyframe(context: CanvasRenderingContext2D, keyframe: Keyframe<R>): void {
    const frames = this.#model.frames(keyframe.role);
    if (!frames) {
      return;
    }
    const image = this.#choices.images ? frames.images.get(keyframe.frame) : undefined;
    drawKeyframe(
      context,
      imageRectangle(this.#camera, frustumOf(frames), this.#width, this.#height),
      { width: this.#width, height: this.#height },
      { image, name: this.keyframeName(keyframe) },
      this.colors,
      () => this.drawOverlay(),
    );
  }

  /** Draws the edges of a keyframe's frustum. */
  protected outline(context: CanvasRenderingContext2D, { role, frame }: Keyframe<R>, lineWidth: number): void {
    const corners = this.cameras.get(role)?.corners(frame) ?? [];
    const places = corners.map((corner) => this.onScreen(apply(this.poseOf(role), corner)));
    context.strokeStyle = this.colors.selection;
    context.lineWidth = lineWidth;
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

  /** As one picture for paper, where a canvas that was cleared would cover what lies below it. */
  drawForPaper(service: RenderService): void {
    this.#paper.src = this.picture(service, 2).toDataURL();
  }

  /** The current picture with its annotations at `ratio` pixels per CSS pixel. */
  picture(service: RenderService, ratio: number): HTMLCanvasElement {
    this.#placeCamera();
    const canvas = document.createElement("canvas");
    this.#render(service, canvas, ratio, { resolution: ratio, preview: false });
    const annotations = document.createElement("canvas");
    this.#drawAnnotations(annotations, ratio);
    canvas.getContext("2d")?.drawImage(annotations, 0, 0);
    return canvas;
  }

  /** Where a point is on the screen, or null behind the camera. */
  protected onScreen(p: Vector3): Place | null {
    const v = new Vector4(...subtract(p, this.#model.extent.centre), 1)
      .applyMatrix4(this.#camera.matrixWorldInverse)
      .applyMatrix4(this.#camera.projectionMatrix);
    return v.w > 0 ? [(v.x / v.w + 1) * 0.5 * this.#width, (1 - v.y / v.w) * 0.5 * this.#height] : null;
  }

  /** What is at a place of the view. */
  pick(x: number, y: number, touch: boolean): Picked | null {
    this.#placeCamera();
    return this.pickHere([x, y], touch, { width: this.#width, height: this.#height });
  }

  protected abstract pickHere(place: Place, touch: boolean, size: { width: number; height: number }): Picked | null;

  /** The visible keyframe that is closest to a place, nearer than `within` pixels; not the one looked through. */
  protected pickKeyframe(place: Place, within: number): (Keyframe<R> & { distance: number }) | null {
    let nearest: (Keyframe<R> & { distance: number }) | null = null;
    for (const [role, layer] of this.cameras) {
      if (!layer.object.visible) {
        continue;
      }
      const least = nearest?.distance ?? within;
      const found = layer.pick((p) => this.onScreen(apply(this.poseOf(role), p)), place, least);
      const lookedThrough = this.through?.role === role && this.through.frame === found?.frame;
      if (found && !lookedThrough && found.distance < least) {
        nearest = { role, ...found };
      }
    }
    return nearest;
  }

  /** A map's landmarks, to be picked. */
  protected pickLayer<Name>(role: Name, cloud: LandmarkCloud, pose: Affine): PickLayer<Name> {
    const clip = new Matrix4().multiplyMatrices(this.#camera.projectionMatrix, this.#camera.matrixWorldInverse);
    const stored = setMatrix(new Matrix4(), compose(pose, dequantise(cloud)), this.#model.extent.centre);
    return { role, cloud, clipFromStored: new Matrix4().multiplyMatrices(clip, stored) };
  }

  hover(picked: Picked | null, x: number, y: number): void {
    if (JSON.stringify(picked) !== JSON.stringify(this.hovered)) {
      this.hovered = picked;
      this.overlay.style.cursor = picked && this.keyframeOf(picked) ? "pointer" : "";
      this.#tooltip.textContent = picked ? this.tipText(picked) : "";
      this.drawOverlay();
    }
    this.#tooltip.hidden = picked === null;
    const room = this.surface.clientWidth - this.#tooltip.offsetWidth - 8;
    this.#tooltip.style.left = `${Math.max(4, Math.min(x + 14, room))}px`;
    this.#tooltip.style.top = `${Math.max(4, y - 34)}px`;
  }

  hint(text: string): void {
    this.#hint.textContent = text;
    this.#hint.hidden = false;
    clearTimeout(this.#hintTimer);
    this.#hintTimer = window.setTimeout(() => (this.#hint.hidden = true), 1200);
  }
}

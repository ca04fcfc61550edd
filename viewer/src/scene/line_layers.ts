// SPDX-License-Identifier: BSD-3-Clause
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DynamicDrawUsage,
  Group,
  Line,
  LineBasicMaterial,
  LineSegments,
} from "three";
import type { Frames, LandmarkCloud, Vector3 } from "../document/report";
import { apply, compose, cross, poseAt, subtract, unit, type Affine } from "../math/pose";
import { niceBelow } from "../math/format";
import type { Palette } from "../theme";
import type { Extent } from "./extent";
import { frustumOf } from "./keyframes";
import { distanceToSegment } from "./picking";
import { setMatrix } from "./point_layer";
import type { SceneModel } from "./scene_model";

const kMaxMatchLines = 20000;
const kMaxFrusta = 16;
/** Edges of a frustum, as pairs of CameraLayer.corners(). */
export const kFrustumEdges = [0, 1, 2, 3].flatMap((i) => [
  [0, 1 + i],
  [1 + i, 1 + ((i + 1) % 4)],
]);

/** Lines between matched landmarks; of very many, every so manieth is drawn. */
export class MatchLayer {
  readonly object: LineSegments;
  readonly stride: number;
  readonly #positions: BufferAttribute;
  readonly #colors: BufferAttribute;
  readonly #material: LineBasicMaterial;
  readonly #model: SceneModel;

  constructor(model: SceneModel) {
    this.#model = model;
    const count = model.source?.count ?? 0;
    this.stride = Math.max(1, Math.ceil(count / kMaxMatchLines));
    const lines = Math.ceil(count / this.stride);
    this.#positions = new BufferAttribute(new Float32Array(6 * lines), 3).setUsage(DynamicDrawUsage);
    this.#colors = new BufferAttribute(new Uint8Array(6 * lines), 3, true).setUsage(DynamicDrawUsage);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", this.#positions);
    geometry.setAttribute("color", this.#colors);
    this.#material = new LineBasicMaterial({
      transparent: true,
      // Many lines together must not hide the landmarks.
      opacity: Math.min(0.6, Math.max(0.14, 0.6 * Math.sqrt(1000 / Math.max(1, lines)))),
      depthWrite: false,
    });
    this.object = new LineSegments(geometry, this.#material);
    this.object.frustumCulled = false;
    this.object.matrixAutoUpdate = false;
  }

  /** `rgbOf` gives a source landmark's line colour as linear channels, or null for `color` throughout. */
  update(
    pose: Affine,
    matches: Int32Array,
    color: string,
    rgbOf: ((source: number) => readonly number[]) | null,
  ): void {
    const { source, target } = this.#model;
    const { centre } = this.#model.extent;
    if (!source) {
      return;
    }
    const out = this.#positions.array as Float32Array;
    const colors = this.#colors.array as Uint8Array;
    let vertex = 0;
    for (let i = 0; i < source.count; i += this.stride) {
      const j = matches[i];
      if (j < 0) {
        continue;
      }
      const from = apply(pose, [
        source.origin[0] + source.step[0] * source.positions[3 * i],
        source.origin[1] + source.step[1] * source.positions[3 * i + 1],
        source.origin[2] + source.step[2] * source.positions[3 * i + 2],
      ]);
      for (let axis = 0; axis < 3; ++axis) {
        out[3 * vertex + axis] = from[axis] - centre[axis];
        out[3 * vertex + 3 + axis] =
          target.origin[axis] + target.step[axis] * target.positions[3 * j + axis] - centre[axis];
      }
      if (rgbOf) {
        const rgb = rgbOf(i);
        colors.set(rgb, 3 * vertex);
        colors.set(rgb, 3 * vertex + 3);
      }
      vertex += 2;
    }
    this.object.geometry.setDrawRange(0, vertex);
    this.#positions.needsUpdate = true;
    this.#colors.needsUpdate = rgbOf !== null;
    if (this.#material.vertexColors !== (rgbOf !== null)) {
      this.#material.vertexColors = rgbOf !== null;
      this.#material.needsUpdate = true;
    }
    this.#material.color = new Color(rgbOf ? "#ffffff" : color);
  }
}

/** A map's camera path and some of its frusta. */
export class CameraLayer {
  readonly object = new Group();
  readonly #cloud: LandmarkCloud;
  readonly #frames: Frames;
  readonly #depth: number;
  readonly #path: LineBasicMaterial;
  readonly #frusta: LineBasicMaterial;

  constructor(cloud: LandmarkCloud, frames: Frames, reach: number) {
    this.#cloud = cloud;
    this.#frames = frames;
    this.#depth = 0.07 * reach;
    this.#path = new LineBasicMaterial();
    this.#frusta = new LineBasicMaterial({ transparent: true, opacity: 0.6 });
    this.object.matrixAutoUpdate = false;
    const path = new Line(geometryOf(pathPoints(frames, cloud.origin)), this.#path);
    const frusta = new LineSegments(geometryOf(this.#frustumLines()), this.#frusta);
    path.frustumCulled = false;
    frusta.frustumCulled = false;
    this.object.add(path, frusta);
  }

  place(targetFromCloud: Affine, centre: readonly number[]): void {
    const { origin } = this.#cloud;
    const shift = Float64Array.of(1, 0, 0, origin[0], 0, 1, 0, origin[1], 0, 0, 1, origin[2]);
    setMatrix(this.object.matrix, compose(targetFromCloud, shift), centre);
    this.object.matrixWorldNeedsUpdate = true;
  }

  setColor(color: string): void {
    this.#path.color = new Color(color);
    this.#frusta.color = new Color(color);
  }

  /** A frame's eye and the far corners of its frustum, in the map's frame. */
  corners(frame: number): Vector3[] {
    const pose = poseAt(this.#frames.poses, frame);
    const { halfWidth, halfHeight } = frustumOf(this.#frames);
    const far = [-1, 1, 1, -1].map((x, i): Vector3 => [x * halfWidth, (i < 2 ? -1 : 1) * halfHeight, 1]);
    return [[0, 0, 0] as const, ...far].map((p) => apply(pose, p.map((v) => v * this.#depth) as unknown as Vector3));
  }

  /** The frame whose eye or drawn frustum is closest to a place on the screen, within `slack` pixels. */
  pick(
    onScreen: (p: Vector3) => [number, number] | null,
    place: [number, number],
    slack: number,
  ): { frame: number; distance: number } | null {
    let best: { frame: number; distance: number } | null = null;
    const consider = (frame: number, a: [number, number] | null, b = a) => {
      const distance = a && b ? distanceToSegment(place, a, b) : Infinity;
      if (distance <= (best ? best.distance : slack)) {
        best = { frame, distance };
      }
    };
    const { count, poses } = this.#frames;
    for (let frame = 0; frame < count; ++frame) {
      consider(frame, onScreen([poses[7 * frame], poses[7 * frame + 1], poses[7 * frame + 2]]));
    }
    for (let frame = 0; frame < count; frame += this.#stride) {
      const corners = this.corners(frame).map(onScreen);
      kFrustumEdges.forEach(([a, b]) => consider(frame, corners[a], corners[b]));
    }
    return best;
  }

  get #stride(): number {
    return Math.max(1, Math.ceil(this.#frames.count / kMaxFrusta));
  }

  #frustumLines(): number[] {
    const lines: number[] = [];
    for (let frame = 0; frame < this.#frames.count; frame += this.#stride) {
      const corners = this.corners(frame).map((corner) => subtract(corner, this.#cloud.origin));
      kFrustumEdges.forEach(([a, b]) => lines.push(...corners[a], ...corners[b]));
    }
    return lines;
  }
}

function geometryOf(points: number[]): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(points), 3));
  return geometry;
}

function pathPoints(frames: Frames, origin: readonly number[]): number[] {
  const points: number[] = [];
  for (let i = 0; i < frames.count; ++i) {
    for (let axis = 0; axis < 3; ++axis) {
      points.push(frames.poses[7 * i + axis] - origin[axis]);
    }
  }
  return points;
}

/** A grid on the landmarks' floor, its cells of a round size. */
export class GridLayer {
  readonly object: LineSegments;
  readonly cell: number;
  readonly #material = new LineBasicMaterial({ transparent: true, opacity: 0.9, depthWrite: false });

  constructor(extent: Extent) {
    this.cell = niceBelow(extent.reach / 2.2);
    const { up } = extent.orbit;
    const side = unit(cross(up, Math.abs(up[0]) < 0.8 ? [1, 0, 0] : [0, 1, 0])) ?? [1, 0, 0];
    const other = cross(up, side);
    const cells = Math.ceil((1.1 * extent.reach) / this.cell);
    const at = (a: number, b: number) =>
      [0, 1, 2].map((i) => a * this.cell * side[i] + b * this.cell * other[i] + extent.floor * up[i]);
    const lines: number[] = [];
    for (let i = -cells; i <= cells; ++i) {
      lines.push(...at(i, -cells), ...at(i, cells), ...at(-cells, i), ...at(cells, i));
    }
    this.object = new LineSegments(geometryOf(lines), this.#material);
    this.object.frustumCulled = false;
    this.object.renderOrder = -1;
  }

  setColors(colors: Palette): void {
    this.#material.color = new Color(colors.rule);
  }
}

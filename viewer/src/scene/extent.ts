// SPDX-License-Identifier: BSD-3-Clause
import type { Frames, LandmarkCloud, Vector3 } from "../document/report";
import { apply, dot, meanViews, positionOf, subtract, type Affine } from "../math/pose";
import { robustRange } from "../math/statistics";
import { Orbit } from "./orbit";

/** Clouds with their poses in one frame. */
export type Placed = [LandmarkCloud, Affine][];

/** Where nearly all landmarks lie along an axis. */
function rangeAlong(placed: Placed, axis: number): [number, number] {
  const ranges = placed.flatMap(([cloud, pose]) => {
    const range = robustRange((i) => apply(pose, positionOf(cloud, i))[axis], cloud.count);
    return range ? [range] : [];
  });
  return ranges.length ? [Math.min(...ranges.map((r) => r[0])), Math.max(...ranges.map((r) => r[1]))] : [-1, 1];
}

/** Height of the landmarks' floor over `centre`, along `up`; null without landmarks. */
function lowest(placed: Placed, up: Vector3, centre: Vector3): number | null {
  const heights = placed.flatMap(([cloud, pose]) => {
    const range = robustRange((i) => dot(subtract(apply(pose, positionOf(cloud, i)), centre), up), cloud.count);
    return range ? [range[0]] : [];
  });
  return heights.length ? Math.min(...heights) : null;
}

/** The box that views of landmarks are about. */
export interface Extent {
  /** Its middle: the scene's frame is moved to this point, so that single precision suffices. */
  readonly centre: [number, number, number];
  /** Half the sizes of the box, which holds nearly all landmarks, and half its diagonal. */
  readonly half: [number, number, number];
  readonly reach: number;
  /** Height of the landmarks' floor over the centre, along up. */
  readonly floor: number;
  readonly orbit: Orbit;
}

/** @param up known, else what is up for the cameras of `frames` on average */
export function extentOf(placed: Placed, up: Vector3 | null, frames: Frames | null): Extent {
  const ranges = [0, 1, 2].map((axis) => rangeAlong(placed, axis));
  const centre = ranges.map(([low, high]) => (low + high) / 2) as [number, number, number];
  const half = ranges.map(([low, high]) => Math.max(1e-6, (high - low) / 2)) as [number, number, number];
  const reach = Math.hypot(...half);
  const views = frames ? meanViews(frames) : null;
  const orbit = new Orbit(up ?? views?.up ?? [0, 0, 1], views?.forward ?? null);
  return { centre, half, reach, orbit, floor: lowest(placed, orbit.up, centre) ?? -reach };
}

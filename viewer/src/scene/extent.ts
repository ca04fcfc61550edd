// SPDX-License-Identifier: BSD-3-Clause
import type { LandmarkCloud, Vector3 } from "../document/report";
import { apply, dot, positionOf, subtract, type Affine } from "../math/pose";
import { robustRange } from "../math/statistics";

/** Clouds with their poses in one frame. */
export type Placed = [LandmarkCloud, Affine][];

/** Where nearly all landmarks lie along an axis. */
export function rangeAlong(placed: Placed, axis: number): [number, number] {
  const ranges = placed.flatMap(([cloud, pose]) => {
    const range = robustRange((i) => apply(pose, positionOf(cloud, i))[axis], cloud.count);
    return range ? [range] : [];
  });
  return ranges.length ? [Math.min(...ranges.map((r) => r[0])), Math.max(...ranges.map((r) => r[1]))] : [-1, 1];
}

/** Height of the landmarks' floor over `centre`, along `up`; null without landmarks. */
export function lowest(placed: Placed, up: Vector3, centre: Vector3): number | null {
  const heights = placed.flatMap(([cloud, pose]) => {
    const range = robustRange((i) => dot(subtract(apply(pose, positionOf(cloud, i)), centre), up), cloud.count);
    return range ? [range[0]] : [];
  });
  return heights.length ? Math.min(...heights) : null;
}

// SPDX-License-Identifier: BSD-3-Clause
import type { Frames, LandmarkCloud, Vector3 } from "../document/report";

/** A rigid or similarity transform, rows of [R | t]: twelve numbers. */
export type Affine = Float64Array;

export const kIdentity: Affine = Float64Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0);

export type Quaternion = readonly [number, number, number, number];

/** x to scale * R * x + t. */
export function poseOf(t: readonly number[], q: Quaternion, scale = 1): Affine {
  const pose = poseAt([...t, ...q], 0);
  return pose.map((value, i) => (i % 4 === 3 ? value : scale * value));
}

/** The transform stored as tx ty tz qw qx qy qz at `index`. */
export function poseAt(poses: ArrayLike<number>, index: number): Affine {
  const o = 7 * index;
  const [w0, x0, y0, z0] = [poses[o + 3], poses[o + 4], poses[o + 5], poses[o + 6]];
  const norm = Math.hypot(w0, x0, y0, z0) || 1;
  const [w, x, y, z] = [w0 / norm, x0 / norm, y0 / norm, z0 / norm];
  return Float64Array.of(
    1 - 2 * (y * y + z * z),
    2 * (x * y - w * z),
    2 * (x * z + w * y),
    poses[o],
    2 * (x * y + w * z),
    1 - 2 * (x * x + z * z),
    2 * (y * z - w * x),
    poses[o + 1],
    2 * (x * z - w * y),
    2 * (y * z + w * x),
    1 - 2 * (x * x + y * y),
    poses[o + 2],
  );
}

/** The same of a transform that scales before it rotates; of rigid ones there are no scales. */
export function similarityAt(poses: ArrayLike<number>, scales: ArrayLike<number> | null, index: number): Affine {
  const pose = poseAt(poses, index);
  const scale = scales ? scales[index] : 1;
  return pose.map((value, i) => (i % 4 === 3 ? value : scale * value));
}

/** Roll, pitch and yaw in degrees of the rotation Rz(yaw)·Ry(pitch)·Rx(roll). */
export function rollPitchYaw(transform: Affine): [number, number, number] {
  const scale = scaleOf(transform) || 1;
  const r = (row: number, column: number) => transform[4 * row + column] / scale;
  const degrees = 180 / Math.PI;
  return [
    Math.atan2(r(2, 1), r(2, 2)) * degrees,
    Math.asin(Math.min(1, Math.max(-1, -r(2, 0)))) * degrees,
    Math.atan2(r(1, 0), r(0, 0)) * degrees,
  ];
}

/** The angle in degrees of the rotation between two transforms, and the distance of their translations. */
export function differenceOf(a: Affine, b: Affine): { rotationDeg: number; translation: number } {
  const scale = scaleOf(a) * scaleOf(b) || 1;
  let trace = 0;
  for (let row = 0; row < 3; ++row) {
    for (let column = 0; column < 3; ++column) {
      trace += (a[4 * row + column] * b[4 * row + column]) / scale;
    }
  }
  const cosine = Math.min(1, Math.max(-1, (trace - 1) / 2));
  return {
    rotationDeg: (Math.acos(cosine) * 180) / Math.PI,
    translation: Math.hypot(a[3] - b[3], a[7] - b[7], a[11] - b[11]),
  };
}

export function scaleOf(transform: Affine): number {
  return Math.hypot(transform[0], transform[4], transform[8]);
}

export function fromRowMajor(matrix: readonly number[]): Affine {
  return Float64Array.from(matrix.slice(0, 12));
}

export function apply(transform: Affine, p: Vector3): [number, number, number] {
  return [
    transform[0] * p[0] + transform[1] * p[1] + transform[2] * p[2] + transform[3],
    transform[4] * p[0] + transform[5] * p[1] + transform[6] * p[2] + transform[7],
    transform[8] * p[0] + transform[9] * p[1] + transform[10] * p[2] + transform[11],
  ];
}

export function compose(a: Affine, b: Affine): Affine {
  const out = new Float64Array(12);
  for (let row = 0; row < 3; ++row) {
    for (let column = 0; column < 4; ++column) {
      let sum = column === 3 ? a[4 * row + 3] : 0;
      for (let k = 0; k < 3; ++k) {
        sum += a[4 * row + k] * b[4 * k + column];
      }
      out[4 * row + column] = sum;
    }
  }
  return out;
}

/** Maps a cloud's stored integers to its own frame. */
export function dequantise(cloud: LandmarkCloud): Affine {
  const { origin: o, step: s } = cloud;
  return Float64Array.of(s[0], 0, 0, o[0], 0, s[1], 0, o[1], 0, 0, s[2], o[2]);
}

export function positionOf(cloud: LandmarkCloud, index: number): [number, number, number] {
  const { origin, step, positions } = cloud;
  return [
    origin[0] + step[0] * positions[3 * index],
    origin[1] + step[1] * positions[3 * index + 1],
    origin[2] + step[2] * positions[3 * index + 2],
  ];
}

export function subtract(a: Vector3, b: Vector3): [number, number, number] {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function cross(a: Vector3, b: Vector3): [number, number, number] {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function dot(a: Vector3, b: Vector3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** The unit vector along `v`, or null if it has no direction. */
export function unit(v: Vector3): [number, number, number] | null {
  const length = Math.hypot(v[0], v[1], v[2]);
  return length > 1e-12 && Number.isFinite(length) ? [v[0] / length, v[1] / length, v[2] / length] : null;
}

/** Where the cameras look on average and what is up for them; cameras look along z, y points down. */
export function meanViews(frames: Frames): {
  forward: [number, number, number] | null;
  up: [number, number, number] | null;
} {
  const forward: [number, number, number] = [0, 0, 0];
  const up: [number, number, number] = [0, 0, 0];
  const stride = Math.max(1, Math.floor(frames.count / 500));
  for (let i = 0; i < frames.count; i += stride) {
    const pose = poseAt(frames.poses, i);
    for (let axis = 0; axis < 3; ++axis) {
      forward[axis] += pose[4 * axis + 2];
      up[axis] -= pose[4 * axis + 1];
    }
  }
  return { forward: unit(forward), up: unit(up) };
}

// SPDX-License-Identifier: BSD-3-Clause
import type { Vector3 } from "../document/report";
import { cross, dot, unit } from "../math/pose";

export interface Place {
  x: number;
  y: number;
}

/** Points seen from above: right and away, with `up` towards the reader. */
export function fromAbove(points: Vector3[], up: Vector3): Place[] {
  const side = unit(cross(up, Math.abs(up[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0])) ?? [1, 0, 0];
  const right: Vector3 = [-side[0], -side[1], -side[2]];
  const away = cross(up, right);
  return points.map((p) => ({ x: dot(p, right), y: -dot(p, away) }));
}

/**
 * Fits places into a box, keeping their proportions, and pushes apart those nearer than `gap`. Where all are
 * nearly at one place they come to stand on a circle. Same places, same result.
 */
export function spread(places: Place[], width: number, height: number, gap: number): Place[] {
  const count = places.length;
  if (count === 0) {
    return [];
  }
  if (count === 1) {
    return [{ x: width / 2, y: height / 2 }];
  }
  const xs = places.map((p) => p.x);
  const ys = places.map((p) => p.y);
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const [top, bottom] = [Math.min(...ys), Math.max(...ys)];
  const scale = Math.min(width / (right - left || 1e-9), height / (bottom - top || 1e-9));
  const closest = Math.min(
    ...places.flatMap((a, i) => places.slice(i + 1).map((b) => scale * Math.hypot(a.x - b.x, a.y - b.y))),
  );
  const crowded = !(closest > 0.02 * gap);
  const result = places.map((p, i) => {
    // Nudged off one another, so that a push has a direction.
    const angle = (2 * Math.PI * i) / count;
    const nudge = crowded ? 0.25 * gap : 0;
    return {
      x: width / 2 + scale * (p.x - (left + right) / 2) + nudge * Math.cos(angle),
      y: height / 2 + scale * (p.y - (top + bottom) / 2) + nudge * Math.sin(angle),
    };
  });
  const rounds = count > 300 ? 30 : 200;
  for (let round = 0; round < rounds; ++round) {
    let pushed = false;
    for (let i = 0; i < count; ++i) {
      for (let j = i + 1; j < count; ++j) {
        const dx = result[j].x - result[i].x;
        const dy = result[j].y - result[i].y;
        const distance = Math.hypot(dx, dy) || 1e-9;
        if (distance < gap) {
          const push = (0.5 * (gap - distance)) / distance;
          result[i].x -= push * dx;
          result[i].y -= push * dy;
          result[j].x += push * dx;
          result[j].y += push * dy;
          pushed = true;
        }
      }
    }
    for (const p of result) {
      p.x = Math.min(width, Math.max(0, p.x));
      p.y = Math.min(height, Math.max(0, p.y));
    }
    if (!pushed) {
      break;
    }
  }
  return result;
}

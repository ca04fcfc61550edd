// SPDX-License-Identifier: BSD-3-Clause
import { PerspectiveCamera, Vector3 as Vector } from "three";
import { cross, dot, unit } from "../math/pose";
import type { Vector3 } from "../document/report";

export const kFieldOfView = 40;
const kMaxElevation = (89.9 * Math.PI) / 180;

export interface OrbitState {
  /** What is looked at, in the scene's frame. */
  target: [number, number, number];
  distance: number;
  azimuth: number;
  elevation: number;
  /** By which the view is turned about its direction, as after a keyframe; 0: up is up. */
  roll: number;
}

export type StandardView = "home" | "top" | "front" | "side";

function clampedElevation(elevation: number): number {
  return Math.min(kMaxElevation, Math.max(-kMaxElevation, elevation));
}

/** Turns an orbit about `up` into cameras, and gestures into changes of the orbit. */
export class Orbit {
  readonly up: [number, number, number];
  readonly #forward: [number, number, number];
  readonly #right: [number, number, number];

  /** `towards` is where the standard view looks; null: anywhere. */
  constructor(up: Vector3, towards: Vector3 | null) {
    this.up = unit(up) ?? [0, 0, 1];
    const wanted = towards ?? (Math.abs(this.up[1]) < 0.9 ? [0, 1, 0] : [0, 0, 1]);
    const flat = (v: Vector3) => {
      const height = dot(v, this.up);
      return unit([v[0] - height * this.up[0], v[1] - height * this.up[1], v[2] - height * this.up[2]]);
    };
    this.#forward = flat(wanted) ?? flat([1, 0, 0]) ?? flat([0, 1, 0]) ?? [1, 0, 0];
    this.#right = cross(this.#forward, this.up);
  }

  /** A standard view of a box about the origin, given by half its sizes. */
  view(name: StandardView, half: Vector3, aspect: number): OrbitState {
    const degrees = Math.PI / 180;
    const angles = {
      home: [-28 * degrees, 24 * degrees],
      top: [0, kMaxElevation],
      front: [0, 0],
      side: [-90 * degrees, 0],
    }[name];
    const state: OrbitState = { target: [0, 0, 0], distance: 1, azimuth: angles[0], elevation: angles[1], roll: 0 };
    state.distance = this.fittingDistance(state, half, aspect);
    return state;
  }

  /** From the target to the eye, of length 1. */
  #eyeDirection(state: OrbitState): [number, number, number] {
    const { azimuth, elevation } = state;
    const flat = Math.cos(elevation);
    const a = -Math.cos(azimuth) * flat;
    const b = Math.sin(azimuth) * flat;
    const c = Math.sin(elevation);
    return [0, 1, 2].map((i) => a * this.#forward[i] + b * this.#right[i] + c * this.up[i]) as [number, number, number];
  }

  /** Where the view's right and top point. */
  #screenAxes(state: OrbitState): { right: Vector3; above: Vector3 } {
    const eye = this.#eyeDirection(state);
    const level = unit(cross(this.up, eye)) ?? this.#right;
    const upright = cross(eye, level);
    const [cosine, sine] = [Math.cos(state.roll), Math.sin(state.roll)];
    const mix = (a: number, b: number) => level.map((value, i) => a * value + b * upright[i]) as unknown as Vector3;
    return { right: mix(cosine, sine), above: mix(-sine, cosine) };
  }

  /** The distance from which a box about the target, given by half its sizes, just fills the view. */
  fittingDistance(state: OrbitState, half: Vector3, aspect: number): number {
    const eye = this.#eyeDirection(state);
    const { right: side, above } = this.#screenAxes(state);
    const slope = Math.tan((kFieldOfView * Math.PI) / 360);
    let distance = 0;
    for (let corner = 0; corner < 8; ++corner) {
      const p = half.map((size, axis) => (corner & (1 << axis) ? size : -size)) as unknown as Vector3;
      const reach = Math.max(Math.abs(dot(p, side)) / (slope * aspect), Math.abs(dot(p, above)) / slope);
      distance = Math.max(distance, dot(p, eye) + reach);
    }
    return 1.03 * distance;
  }

  /**
   * An orbit that continues the view of `camera`, about the point at distance `ahead` in front of it. What is there
   * keeps its size.
   */
  continuing(camera: PerspectiveCamera, ahead: number): OrbitState {
    const forward = camera.getWorldDirection(new Vector()).toArray();
    const side = (axis: readonly number[]) => -dot(forward, axis as Vector3);
    const slope = Math.tan((camera.fov * Math.PI) / 360) / Math.tan((kFieldOfView * Math.PI) / 360);
    const state: OrbitState = {
      target: camera.position.toArray().map((v, i) => v + ahead * forward[i]) as [number, number, number],
      distance: ahead * slope,
      azimuth: Math.atan2(side(this.#right), -side(this.#forward)),
      elevation: clampedElevation(Math.asin(Math.min(1, Math.max(-1, side(this.up))))),
      roll: 0,
    };
    const across = new Vector(1, 0, 0).applyQuaternion(camera.quaternion).toArray() as Vector3;
    const axes = this.#screenAxes(state);
    state.roll = Math.atan2(dot(across, axes.above), dot(across, axes.right));
    return state;
  }

  place(camera: PerspectiveCamera, state: OrbitState, aspect: number, reach: number): void {
    const eye = this.#eyeDirection(state);
    camera.fov = kFieldOfView;
    camera.aspect = aspect;
    camera.near = Math.max(state.distance / 200, 1e-6);
    camera.far = state.distance + 20 * reach;
    camera.up.set(...this.up);
    camera.position.set(
      state.target[0] + eye[0] * state.distance,
      state.target[1] + eye[1] * state.distance,
      state.target[2] + eye[2] * state.distance,
    );
    camera.lookAt(...state.target);
    camera.rotateZ(state.roll);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  /** Turns about the vertical and up or down, so that what is dragged follows the pointer in a rolled view, too. */
  rotate(state: OrbitState, right: number, down: number): void {
    const [cosine, sine] = [Math.cos(state.roll), Math.sin(state.roll)];
    state.azimuth += right * cosine - down * sine;
    state.elevation = clampedElevation(state.elevation + right * sine + down * cosine);
  }

  /** Moves the target so that the picture follows the pointer; distances in pane heights. */
  pan(state: OrbitState, right: number, down: number): void {
    const { right: side, above } = this.#screenAxes(state);
    const scale = 2 * state.distance * Math.tan((kFieldOfView * Math.PI) / 360);
    for (let i = 0; i < 3; ++i) {
      state.target[i] += scale * (-right * side[i] + down * above[i]);
    }
  }

  zoom(state: OrbitState, factor: number, reach: number): void {
    state.distance = Math.min(50 * reach, Math.max(1e-3 * reach, state.distance * factor));
  }
}

interface GestureTarget {
  rotate(right: number, down: number): void;
  pan(right: number, down: number): void;
  zoom(factor: number): void;
  /** A click or tap that was no drag; in CSS pixels of the element. */
  press(x: number, y: number, touch: boolean): void;
  hover(x: number, y: number): void;
  leave(): void;
  /** May a plain wheel zoom here, or should it scroll the page? */
  wheelZooms(): boolean;
  wheelIgnored(): void;
}

const kClickSlack = 5;

/** Pointer, touch and wheel gestures: drag turns, right or shift drag and two fingers move, wheel and pinch zoom. */
export function listenForGestures(element: HTMLElement, target: GestureTarget): void {
  const pointers = new Map<number, { x: number; y: number }>();
  let travelled = 0;
  let panning = false;
  const at = (event: PointerEvent) => {
    const box = element.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, at(event));
    if (pointers.size === 1) {
      travelled = 0;
      panning = event.button === 2 || event.button === 1 || event.shiftKey;
    } else {
      travelled = Infinity;
    }
    target.leave();
  });
  element.addEventListener("pointermove", (event) => {
    const now = at(event);
    const before = pointers.get(event.pointerId);
    if (!before) {
      if (event.pointerType !== "touch") {
        target.hover(now.x, now.y);
      }
      return;
    }
    const height = element.clientHeight || 1;
    const dx = now.x - before.x;
    const dy = now.y - before.y;
    if (pointers.size === 1) {
      travelled += Math.hypot(dx, dy);
      if (travelled > kClickSlack) {
        if (panning) {
          target.pan(dx / height, dy / height);
        } else {
          target.rotate((-Math.PI * dx) / height, (Math.PI * dy) / height);
        }
      }
    } else if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {
        const was = Math.hypot(before.x - other.x, before.y - other.y);
        const is = Math.hypot(now.x - other.x, now.y - other.y);
        if (was > 0 && is > 0) {
          target.zoom(was / is);
        }
        target.pan(dx / 2 / height, dy / 2 / height);
      }
    }
    pointers.set(event.pointerId, now);
  });
  const release = (event: PointerEvent, pressed: boolean) => {
    if (pointers.delete(event.pointerId) && pressed && travelled <= kClickSlack) {
      const { x, y } = at(event);
      target.press(x, y, event.pointerType === "touch");
    }
  };
  element.addEventListener("pointerup", (event) => release(event, true));
  element.addEventListener("pointercancel", (event) => release(event, false));
  element.addEventListener("pointerleave", () => target.leave());
  element.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && !target.wheelZooms()) {
        target.wheelIgnored();
        return;
      }
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 400 : 1);
      target.zoom(Math.exp(Math.max(-200, Math.min(200, pixels)) * (event.ctrlKey ? 0.008 : 0.0016)));
    },
    { passive: false },
  );
}

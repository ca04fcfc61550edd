// SPDX-License-Identifier: BSD-3-Clause
// Keyframes that can be entered: the view through their cameras, and what they saw.
import { Matrix4, PerspectiveCamera, Vector3 } from "three";
import type { FrameImage, Frames } from "../document/report";
import { idText } from "../math/format";
import { compose, poseAt, scaleOf, type Affine } from "../math/pose";
import type { Palette } from "../theme";
import { label } from "./annotations";
import type { Role } from "./scene_model";

/** A keyframe of the map that `role` names. */
export interface Keyframe<R = Role> {
  role: R;
  frame: number;
}

/** A map's keyframes where they are in the view's frame. */
export interface PlacedFrames<R> {
  role: R;
  frames: Frames;
  pose: Affine;
}

type Frustum = NonNullable<Frames["frustum"]>;

const kUsualFrustum: Frustum = { halfWidth: 0.55, halfHeight: 0.41 };
/** Of the view around the keyframe's image. */
const kMargin = 1.08;

/** The cameras' field of view, or a usual one if it is unknown or none. */
export function frustumOf({ frustum }: Frames): Frustum {
  const usable = (half: number) => half > 1e-3 && half < 1e3;
  return frustum && usable(frustum.halfWidth) && usable(frustum.halfHeight) ? frustum : kUsualFrustum;
}

/** "12 · 1305031453.360 s": a frame's id and time. */
export function keyframeText({ ids, timestamps }: Frames, frame: number): string {
  const time = timestamps?.[frame] ?? NaN;
  return Number.isFinite(time) ? `${idText(ids, frame)} · ${time.toFixed(3)} s` : idText(ids, frame);
}

/** Puts `camera` where a keyframe's is, so that what the keyframe saw fits the view. */
export function lookThrough(
  camera: PerspectiveCamera,
  targetFromCamera: Affine,
  centre: readonly number[],
  { halfWidth, halfHeight }: Frustum,
  aspect: number,
  reach: number,
): void {
  const m = targetFromCamera;
  const scale = scaleOf(m) || 1;
  // Keyframes look along z with y down, three.js along -z with y up.
  const row = (i: number) => [m[i] / scale, -m[i + 1] / scale, -m[i + 2] / scale, 0] as const;
  camera.quaternion.setFromRotationMatrix(new Matrix4().set(...row(0), ...row(4), ...row(8), 0, 0, 0, 1));
  camera.position.set(m[3] - centre[0], m[7] - centre[1], m[11] - centre[2]);
  camera.fov = (360 / Math.PI) * Math.atan(kMargin * Math.max(halfHeight, halfWidth / aspect));
  camera.aspect = aspect;
  camera.near = 1e-3 * reach;
  camera.far = camera.position.length() + 20 * reach;
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
}

/** Where the keyframe's image lies in a view of `width` x `height` through its camera. */
export function imageRectangle(
  camera: PerspectiveCamera,
  { halfWidth, halfHeight }: Frustum,
  width: number,
  height: number,
): [x: number, y: number, width: number, height: number] {
  const unit = height / Math.tan((camera.fov * Math.PI) / 360);
  const [w, h] = [halfWidth * unit, halfHeight * unit];
  return [(width - w) / 2, (height - h) / 2, w, h];
}

/** The keyframe whose eye is nearest to that of `camera`. */
export function nearestKeyframe<R>(
  maps: readonly PlacedFrames<R>[],
  camera: PerspectiveCamera,
  centre: readonly number[],
): Keyframe<R> | null {
  const eye = camera.position.toArray().map((value, axis) => value + centre[axis]);
  let nearest: Keyframe<R> | null = null;
  let least = Infinity;
  for (const { role, frames, pose } of maps) {
    for (let frame = 0; frame < frames.count; ++frame) {
      const at = compose(pose, poseAt(frames.poses, frame));
      const distance = Math.hypot(at[3] - eye[0], at[7] - eye[1], at[11] - eye[2]);
      if (distance < least) {
        least = distance;
        nearest = { role, frame };
      }
    }
  }
  return nearest;
}

/** How far in front of `camera` the view turns once a keyframe is left: at the scene's middle, if that is in front. */
export function depthOfMiddle(camera: PerspectiveCamera, reach: number): number {
  const ahead = -camera.position.dot(camera.getWorldDirection(new Vector3()));
  return Math.min(2 * reach, Math.max(0.2 * reach, ahead));
}

/**
 * Draws over a view through a keyframe's camera what the keyframe saw, if there is an image, and dims what lies outside of
 * its view; `decoded` is called once an image that is not yet decoded can be drawn.
 */
export function drawKeyframe(
  context: CanvasRenderingContext2D,
  [x, y, width, height]: [number, number, number, number],
  view: { width: number; height: number },
  { image, name }: { image: FrameImage | undefined; name: string },
  colors: Palette,
  decoded: () => void,
): void {
  const picture = image && pictureOf(image, decoded);
  context.save();
  if (picture) {
    context.globalAlpha = 0.5;
    context.drawImage(picture, x, y, width, height);
  }
  context.globalAlpha = 0.6;
  context.fillStyle = colors.background;
  context.beginPath();
  context.rect(0, 0, view.width, view.height);
  context.rect(x, y, width, height);
  context.fill("evenodd");
  context.restore();
  context.strokeStyle = colors.selection;
  context.lineWidth = 1.5;
  context.strokeRect(x, y, width, height);
  context.font = "600 12px system-ui, sans-serif";
  context.fillStyle = colors.ink;
  const fits = context.measureText(name).width < width - 16;
  label(context, fits ? name : name.split(" · ")[0], x + 8, y + 18, colors);
}

/** What decoding came to: null if the bytes are no image after all. */
const pictures = new WeakMap<FrameImage, ImageBitmap | null | Promise<void>>();

/** The decoded image, or null as long as there is none; `decoded` is called once there is. */
function pictureOf(image: FrameImage, decoded: () => void): ImageBitmap | null {
  let picture = pictures.get(image);
  if (picture === undefined) {
    const blob = new Blob([image.data as Uint8Array<ArrayBuffer>], { type: image.mediaType });
    picture = createImageBitmap(blob).then(
      (bitmap) => void pictures.set(image, bitmap),
      () => void pictures.set(image, null),
    );
    pictures.set(image, picture);
  }
  if (picture instanceof Promise) {
    void picture.then(decoded);
    return null;
  }
  return picture;
}

// SPDX-License-Identifier: BSD-3-Clause
// Keyframes that can be entered: the view through their cameras, and what they saw.
import { Matrix4, PerspectiveCamera } from "three";
import type { FrameImage, Frames } from "../document/report";
import { idText } from "../math/format";
import { scaleOf, type Affine } from "../math/pose";
import type { Role } from "./scene_model";

export interface Keyframe {
  role: Role;
  frame: number;
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

/** What decoding came to: null if the bytes are no image after all. */
const pictures = new WeakMap<FrameImage, ImageBitmap | null | Promise<void>>();

/** The decoded image, or null as long as there is none; `decoded` is called once there is. */
export function pictureOf(image: FrameImage, decoded: () => void): ImageBitmap | null {
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

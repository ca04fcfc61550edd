// SPDX-License-Identifier: BSD-3-Clause
import {
  BufferAttribute,
  BufferGeometry,
  DataTexture,
  Matrix4,
  NearestFilter,
  Points,
  RGBAFormat,
  ShaderMaterial,
  Vector3,
} from "three";
import type { LandmarkCloud } from "../document/report";
import { compose, dequantise, type Affine } from "../math/pose";
import type { Palette } from "../theme";
import { kNoLevel, rampColor } from "./coloring";

const kVertexShader = `
attribute float level;
attribute vec3 tint;
uniform float size;
uniform int mode;
uniform vec3 color;
uniform sampler2D ramp;
varying vec3 shade;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_PointSize = size;
  shade = mode == 0 ? color : mode == 1 ? texture2D(ramp, vec2((level + 0.5) / 256.0, 0.5)).rgb : tint;
}`;

const kFragmentShader = `
uniform int shape;
uniform float opacity;
varying vec3 shade;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  float r = dot(p, p);
  if ((shape == 0 && r > 1.0) || (shape == 2 && (r > 1.0 || r < 0.42))) discard;
  gl_FragColor = vec4(shade, opacity);
}`;

export type PointShape = "disc" | "square" | "ring";
const kShapes: PointShape[] = ["disc", "square", "ring"];

/** sRGB channels from 0 to 1; the shader writes them as they are. */
function channels(hex: string): Vector3 {
  const value = parseInt(hex.slice(1), 16);
  return new Vector3((value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255);
}

function cssChannels(css: string): [number, number, number] {
  if (css.startsWith("#")) {
    const { x, y, z } = channels(css);
    return [x * 255, y * 255, z * 255];
  }
  const found = css.match(/[\d.]+/g) ?? [];
  return [Number(found[0]), Number(found[1]), Number(found[2])];
}

const ramps = new Map<string, DataTexture>();

function rampTexture(colors: Palette): DataTexture {
  const known = ramps.get(colors.name);
  if (known) {
    return known;
  }
  const data = new Uint8Array(256 * 4);
  for (let level = 0; level < 256; ++level) {
    const css = level === kNoLevel ? colors.noValue : rampColor(level / 254, colors.name);
    data.set([...cssChannels(css).map(Math.round), 255], 4 * level);
  }
  const texture = new DataTexture(data, 256, 1, RGBAFormat);
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.needsUpdate = true;
  ramps.set(colors.name, texture);
  return texture;
}

const positionAttributes = new WeakMap<LandmarkCloud, BufferAttribute>();
const tintAttributes = new WeakMap<LandmarkCloud, BufferAttribute>();
const previewIndices = new WeakMap<LandmarkCloud, Map<number, BufferAttribute>>();

/** Positions stay the 16 bit numbers of the document; matrices scale them. One copy serves all panes. */
function positionsOf(cloud: LandmarkCloud): BufferAttribute {
  let attribute = positionAttributes.get(cloud);
  if (!attribute) {
    const { positions } = cloud;
    const array = positions instanceof Uint16Array ? positions : Float32Array.from(positions);
    attribute = new BufferAttribute(array, 3, false);
    positionAttributes.set(cloud, attribute);
  }
  return attribute;
}

function tintsOf(cloud: LandmarkCloud): BufferAttribute | null {
  let attribute = tintAttributes.get(cloud);
  if (!attribute && cloud.colors) {
    attribute = new BufferAttribute(cloud.colors, 3, true);
    tintAttributes.set(cloud, attribute);
  }
  return attribute ?? null;
}

function previewIndex(cloud: LandmarkCloud, stride: number): BufferAttribute {
  const known = previewIndices.get(cloud) ?? new Map<number, BufferAttribute>();
  previewIndices.set(cloud, known);
  let index = known.get(stride);
  if (!index) {
    index = new BufferAttribute(
      Uint32Array.from({ length: Math.ceil(cloud.count / stride) }, (_, i) => i * stride),
      1,
    );
    known.set(stride, index);
  }
  return index;
}

export function setMatrix(matrix: Matrix4, a: Affine, centre: readonly number[]): Matrix4 {
  const row = (i: number) => [a[4 * i], a[4 * i + 1], a[4 * i + 2], a[4 * i + 3] - centre[i]] as const;
  return matrix.set(...row(0), ...row(1), ...row(2), 0, 0, 0, 1);
}

/** A cloud's landmarks as points of constant size on the screen. */
export class PointLayer {
  readonly object: Points;
  readonly cloud: LandmarkCloud;
  readonly #full = new BufferGeometry();
  readonly #preview: BufferGeometry | null = null;
  readonly #material: ShaderMaterial;
  #levels: BufferAttribute | null = null;

  /** While things move, every `previewStride`-th landmark is drawn. */
  constructor(cloud: LandmarkCloud, shape: PointShape, opacity: number, previewStride: number) {
    this.cloud = cloud;
    this.#full.setAttribute("position", positionsOf(cloud));
    if (previewStride > 1) {
      this.#preview = new BufferGeometry();
      this.#preview.setAttribute("position", positionsOf(cloud));
      this.#preview.setIndex(previewIndex(cloud, previewStride));
    }
    this.#material = new ShaderMaterial({
      vertexShader: kVertexShader,
      fragmentShader: kFragmentShader,
      transparent: opacity < 1,
      depthWrite: opacity >= 1,
      uniforms: {
        size: { value: 4 },
        mode: { value: 0 },
        color: { value: new Vector3() },
        ramp: { value: null },
        shape: { value: kShapes.indexOf(shape) },
        opacity: { value: opacity },
      },
    });
    this.object = new Points(this.#full, this.#material);
    this.object.frustumCulled = false;
    this.object.matrixAutoUpdate = false;
  }

  place(targetFromCloud: Affine, centre: readonly number[]): void {
    setMatrix(this.object.matrix, compose(targetFromCloud, dequantise(this.cloud)), centre);
    this.object.matrixWorldNeedsUpdate = true;
  }

  usePreview(preview: boolean): void {
    this.object.geometry = preview && this.#preview ? this.#preview : this.#full;
  }

  setSize(pixels: number): void {
    this.#material.uniforms.size.value = pixels;
  }

  #setAttribute(name: string, attribute: BufferAttribute): void {
    this.#full.setAttribute(name, attribute);
    this.#preview?.setAttribute(name, attribute);
  }

  showRole(color: string): void {
    this.#material.uniforms.mode.value = 0;
    this.#material.uniforms.color.value = channels(color);
  }

  showOwnColors(fallback: string, colors: Palette): void {
    const tints = tintsOf(this.cloud);
    if (!tints) {
      this.showRole(fallback || colors.noValue);
      return;
    }
    this.#setAttribute("tint", tints);
    this.#material.uniforms.mode.value = 2;
  }

  /** Colours by ramp levels; the array is copied to the card now and may be reused by the caller. */
  showLevels(levels: Uint8Array, colors: Palette): void {
    if (this.#levels) {
      if (this.#levels.array !== levels) {
        (this.#levels.array as Uint8Array).set(levels);
      }
      this.#levels.needsUpdate = true;
    } else {
      this.#levels = new BufferAttribute(levels.slice(), 1, false);
      this.#setAttribute("level", this.#levels);
    }
    this.#material.uniforms.mode.value = 1;
    this.#material.uniforms.ramp.value = rampTexture(colors);
  }
}

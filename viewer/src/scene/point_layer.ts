// SPDX-License-Identifier: BSD-3-Clause
import {
  BufferAttribute,
  BufferGeometry,
  DataTexture,
  InterleavedBuffer,
  InterleavedBufferAttribute,
  Matrix3,
  Matrix4,
  NearestFilter,
  Points,
  RGBAFormat,
  ShaderMaterial,
  Vector2,
  Vector3,
  Vector4,
} from "three";
import type { Ellipsoids, LandmarkCloud } from "../document/report";
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
varying float pixels;
#ifdef ELLIPSES
attribute vec3 variances;
attribute vec3 correlations;
attribute float sigma;
uniform bool ellipses;
uniform vec2 sigmaScale;
uniform mat3 sceneFromMap;
uniform vec2 viewport;
varying vec3 conic;
/** The covariance of the projection in pixels, which the perspective is linear for (Zwicker et al. 2001). */
void project(vec3 x) {
  mat3 c = mat3(variances.x, correlations.x, correlations.y,
                correlations.x, variances.y, correlations.z,
                correlations.y, correlations.z, variances.z);
  mat3 turn = mat3(viewMatrix) * sceneFromMap;
  float s = exp2(sigmaScale.x + sigmaScale.y * sigma);
  mat3 seen = s * s * turn * c * transpose(turn);
  vec2 focal = 0.5 * viewport * vec2(projectionMatrix[0][0], projectionMatrix[1][1]);
  float z = max(-x.z, 1e-6);
  vec3 u = vec3(focal.x / z, 0.0, focal.x * x.x / (z * z));
  vec3 v = vec3(0.0, focal.y / z, focal.y * x.y / (z * z));
  float a = dot(u, seen * u) + 0.3;
  float b = dot(u, seen * v);
  float d = dot(v, seen * v) + 0.3;
  float det = max(a * d - b * b, 1e-6);
  conic = vec3(d, -b, a) / det;
  float largest = 0.5 * (a + d) + sqrt(max(0.25 * (a - d) * (a - d) + b * b, 0.0));
  pixels = clamp(4.0 * sqrt(largest), 1.0, 1000.0);
  gl_PointSize = pixels;
}
#endif
void main() {
  vec4 x = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * x;
  gl_PointSize = size;
  pixels = size;
#ifdef ELLIPSES
  if (ellipses) project(x.xyz);
#endif
  shade = mode == 0 ? color : mode == 1 ? texture2D(ramp, vec2((level + 0.5) / 256.0, 0.5)).rgb : tint;
}`;

const kFragmentShader = `
uniform int shape;
uniform float opacity;
varying vec3 shade;
varying float pixels;
#ifdef ELLIPSES
uniform bool ellipses;
varying vec3 conic;
#endif
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
#ifdef ELLIPSES
  if (ellipses) {
    vec2 d = 0.5 * pixels * vec2(p.x, -p.y);
    float r2 = conic.x * d.x * d.x + 2.0 * conic.y * d.x * d.y + conic.z * d.y * d.y;
    if (r2 > 4.0) discard;
    gl_FragColor = vec4(shade * (1.0 - 0.06 * r2), opacity);
    return;
  }
#endif
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

const shapeAttributes = new WeakMap<LandmarkCloud, Record<string, BufferAttribute | InterleavedBufferAttribute>>();

/** Of a cloud that has ellipsoids. */
function shapesOf(cloud: LandmarkCloud, { covariances, sigmas }: Ellipsoids) {
  let attributes = shapeAttributes.get(cloud);
  if (!attributes) {
    const six = new InterleavedBuffer(covariances, 6);
    attributes = {
      variances: new InterleavedBufferAttribute(six, 3, 0, true),
      correlations: new InterleavedBufferAttribute(six, 3, 3, true),
      sigma: new BufferAttribute(sigmas, 1, false),
    };
    shapeAttributes.set(cloud, attributes);
  }
  return attributes;
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

/** A cloud's landmarks as points of constant size on the screen, or as ellipses of two standard deviations. */
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
    if (cloud.ellipsoids) {
      this.#addShapes(cloud.ellipsoids);
    }
  }

  #addShapes(shapes: Ellipsoids): void {
    for (const [name, attribute] of Object.entries(shapesOf(this.cloud, shapes))) {
      this.#setAttribute(name, attribute);
    }
    const viewport = new Vector4();
    Object.assign(this.#material.uniforms, {
      ellipses: { value: false },
      sigmaScale: { value: new Vector2(shapes.offset, shapes.scale) },
      sceneFromMap: { value: new Matrix3() },
      viewport: { value: new Vector2() },
    });
    this.#material.defines = { ELLIPSES: "" };
    this.object.onBeforeRender = (renderer) => {
      renderer.getCurrentViewport(viewport);
      this.#material.uniforms.viewport.value.set(viewport.z, viewport.w);
      this.#material.uniformsNeedUpdate = true;
    };
  }

  /** Has an effect on a cloud with ellipsoids only. */
  showEllipses(shown: boolean): void {
    if (this.cloud.ellipsoids) {
      this.#material.uniforms.ellipses.value = shown;
    }
  }

  place(targetFromCloud: Affine, centre: readonly number[]): void {
    setMatrix(this.object.matrix, compose(targetFromCloud, dequantise(this.cloud)), centre);
    this.object.matrixWorldNeedsUpdate = true;
    const a = targetFromCloud;
    this.#material.uniforms.sceneFromMap?.value.set(a[0], a[1], a[2], a[4], a[5], a[6], a[8], a[9], a[10]);
  }

  usePreview(preview: boolean): void {
    this.object.geometry = preview && this.#preview ? this.#preview : this.#full;
  }

  setSize(pixels: number): void {
    this.#material.uniforms.size.value = pixels;
  }

  #setAttribute(name: string, attribute: BufferAttribute | InterleavedBufferAttribute): void {
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

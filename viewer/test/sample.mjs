// SPDX-License-Identifier: BSD-3-Clause
// Sample documents for tests and for looking at the page: node test/sample.mjs NAME OUT.html, where NAME is
// small, answer, paper, million, splats, network or hostile. Seeded: the same every time.
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { deflateSync, gzipSync } from "node:zlib";

const here = dirname(fileURLToPath(import.meta.url));
export const kTemplate = process.env.CAIRN_TEMPLATE ?? join(here, "../dist/report_template.html");

export function random(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

export function normal(rng) {
  return Math.sqrt(-2 * Math.log(rng() + 1e-300)) * Math.cos(2 * Math.PI * rng());
}

/** Collects arrays into one block, each at a multiple of 8. */
export class BufferWriter {
  #parts = [];
  #size = 0;

  add(array) {
    const names = new Map([
      [Uint8Array, "u8"], [Int8Array, "i8"], [Uint16Array, "u16"], [Int16Array, "i16"],
      [Uint32Array, "u32"], [Int32Array, "i32"], [Float32Array, "f32"], [Float64Array, "f64"],
    ]);
    const offset = this.#size;
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    this.#parts.push(bytes, new Uint8Array((8 - (bytes.length % 8)) % 8));
    this.#size += Math.ceil(bytes.length / 8) * 8;
    return { offset, count: array.length, type: names.get(array.constructor) };
  }

  bytes() {
    return Buffer.concat(this.#parts);
  }
}

/** The page that the C++ side would write. */
export function writePage({ document, buffers }, template = readFileSync(kTemplate, "utf8")) {
  const element = (type, id, data) =>
    `<script type="application/x-cairn-${type}" id="${id}" data-encoding="gzip-base64">${gzipSync(data).toString("base64")}</script>`;
  const title = document.title.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
  const data = `${element("report", "cairn-report", JSON.stringify(document))}\n${element("buffers", "cairn-buffers", buffers)}`;
  return template.replace("<!--CAIRN:TITLE-->", () => title).replace("<!--CAIRN:DATA-->", () => data);
}

// Rigid transforms as 3 x 4 rows, quaternions as w x y z

function rotation(axis, angle) {
  const n = Math.hypot(...axis);
  const s = Math.sin(angle / 2) / n;
  return [Math.cos(angle / 2), axis[0] * s, axis[1] * s, axis[2] * s];
}

function multiply(a, b) {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

function rotate([w, x, y, z], v) {
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [
    v[0] + w * t[0] + y * t[2] - z * t[1],
    v[1] + w * t[1] + z * t[0] - x * t[2],
    v[2] + w * t[2] + x * t[1] - y * t[0],
  ];
}

const move = ({ t, q }, p) => rotate(q, p).map((value, i) => value + t[i]);
const conjugate = ([w, x, y, z]) => [w, -x, -y, -z];
const inverse = ({ t, q }) => ({ q: conjugate(q), t: rotate(conjugate(q), t).map((value) => -value) });
const numbers = ({ t, q }) => [...t, ...q];

/** Landmarks of an office: a desk with things on it, a shelf, two walls. z is up, metres. */
function office(count, rng) {
  const points = [];
  const things = Array.from({ length: 14 }, () => ({
    at: [-0.9 + 1.8 * rng(), 0.9 + 0.9 * rng(), 0.74],
    size: [0.06 + 0.2 * rng(), 0.06 + 0.15 * rng(), 0.05 + 0.4 * rng()],
  }));
  while (points.length < count) {
    const kind = rng();
    let p;
    if (kind < 0.5) {
      const { at, size } = things[Math.floor(rng() * things.length)];
      const side = Math.floor(rng() * 3);
      p = [0, 1, 2].map((i) => at[i] + size[i] * (i === side ? Math.round(rng()) : rng()));
    } else if (kind < 0.62) {
      p = [-1.1 + 2.2 * rng(), 0.8 + 1.1 * rng(), 0.74];
    } else if (kind < 0.8) {
      const shelf = Math.floor(rng() * 4);
      p = [1.6 + 0.3 * rng(), 0.4 + 1.8 * rng(), 0.3 + 0.4 * shelf + 0.22 * rng()];
    } else if (kind < 0.95) {
      p = [-1.6 + 3.4 * rng(), 2.35, 0.2 + 2.1 * rng() ** 1.5];
    } else {
      p = [-1.7 + 0.03 * rng(), 0.2 + 2 * rng(), 0.2 + 1.8 * rng()];
    }
    points.push(p.map((value) => value + 0.004 * normal(rng)));
  }
  return points;
}

/** Poses world_from_camera along an arc before the desk, looking at it. */
function cameraPath(count, shift, rng) {
  const poses = new Float32Array(7 * count);
  for (let i = 0; i < count; ++i) {
    const u = i / (count - 1);
    const yaw = -0.7 + 1.4 * u + shift;
    const eye = [1.7 * Math.sin(yaw) - 0.1, -0.6 + 0.25 * Math.cos(3 * u), 1.35 + 0.12 * Math.sin(7 * u)];
    // Camera z forward (world y), x right, y down; then turned to the desk.
    const base = rotation([1, 0, 0], -Math.PI / 2 - 0.22);
    const q = multiply(rotation([0, 0, 1], yaw * 0.75), base);
    poses.set([...eye.map((value) => value + 0.004 * normal(rng)), ...q], 7 * i);
  }
  return poses;
}

function quantise(points, Type = Uint16Array) {
  const top = Type === Uint16Array ? 65535 : 4294967295;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const p of points) {
    for (let axis = 0; axis < 3; ++axis) {
      low[axis] = Math.min(low[axis], p[axis]);
      high[axis] = Math.max(high[axis], p[axis]);
    }
  }
  const step = low.map((value, axis) => (high[axis] - value) / top || 1e-9);
  const positions = new Type(3 * points.length);
  points.forEach((p, i) => p.forEach((value, axis) => (positions[3 * i + axis] = Math.round((value - low[axis]) / step[axis]))));
  return { origin: low, step, positions };
}

function mapOf(id, name, points, writer, rng, options = {}) {
  const count = points.length;
  const { origin, step, positions } = quantise(points, options.type);
  const observations = Uint8Array.from({ length: count }, () => Math.min(255, 2 + Math.floor(-9 * Math.log(rng() + 1e-9))));
  const sigma = Float32Array.from({ length: count }, (_, i) => (0.004 + 0.05 * rng() ** 3) / Math.sqrt(observations[i] / 4));
  const distance = Uint16Array.from({ length: count }, (_, i) => Math.round(1000 * Math.hypot(points[i][0], points[i][1] + 0.6, points[i][2] - 1.3)));
  const column = (key, label, unit, values, scale = 1, offset = 0) => ({ name: key, label, unit, values: writer.add(values), scale, offset });
  const frames = options.frames ?? 60;
  return {
    id,
    name,
    length_unit: options.unit ?? "m",
    count,
    origin,
    step,
    positions: writer.add(positions),
    ids: options.ids === false ? null : writer.add(Uint32Array.from({ length: 2 * count }, (_, i) => (i % 2 ? 0 : 1000 + (i / 2) * 3))),
    columns: [
      column("observations", "Observations", null, observations),
      column("sigma", "Standard deviation", "m", sigma),
      column("distance", "Mean distance", "m", distance, 0.001),
      column("covariance_confidence", "Covariance confidence", null, Float32Array.from(sigma, (s) => 1 / (1 + 400 * s * s))),
      column("distance_confidence", "Distance confidence", null, Float32Array.from(distance, (d) => 1 / (1 + d / 1000))),
    ],
    colors:
      options.colors === false
        ? null
        : writer.add(Uint8Array.from({ length: 3 * count }, (_, i) => {
            const p = points[Math.floor(i / 3)];
            return Math.max(0, Math.min(255, 128 + 70 * Math.sin(3 * p[i % 3] + (i % 3)) + 20 * rng()));
          })),
    frames:
      frames > 0
        ? {
            count: frames,
            poses: writer.add(cameraPath(frames, options.shift ?? 0, rng)),
            ids: null,
            timestamps: writer.add(Float64Array.from({ length: frames }, (_, i) => 1305031450 + 0.3 * i)),
            frustum: { half_width: 0.62, half_height: 0.46 },
            // Reports of earlier versions have no images.
            ...(options.images && { images: options.images }),
          }
        : null,
  };
}

// ICP, as the paper has it, for a sample that moves like the real thing

function umeyama(from, to) {
  // Horn's closed form: the rotation is the eigenvector of a 4 x 4 matrix, by power iteration.
  const mean = (points) => [0, 1, 2].map((i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);
  const [a, b] = [mean(from), mean(to)];
  const s = Array.from({ length: 3 }, () => [0, 0, 0]);
  from.forEach((p, n) => {
    for (let i = 0; i < 3; ++i) {
      for (let j = 0; j < 3; ++j) {
        s[i][j] += (p[i] - a[i]) * (to[n][j] - b[j]);
      }
    }
  });
  const m = [
    [s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]],
    [s[1][2] - s[2][1], s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]],
    [s[2][0] - s[0][2], s[0][1] + s[1][0], s[1][1] - s[0][0] - s[2][2], s[1][2] + s[2][1]],
    [s[0][1] - s[1][0], s[2][0] + s[0][2], s[1][2] + s[2][1], s[2][2] - s[0][0] - s[1][1]],
  ];
  const shift = m.flat().reduce((sum, value) => sum + Math.abs(value), 0);
  let q = [1, 0, 0, 0];
  for (let i = 0; i < 300; ++i) {
    const next = q.map((value, r) => shift * value + m[r].reduce((sum, entry, c) => sum + entry * q[c], 0));
    const n = Math.hypot(...next);
    q = next.map((value) => value / n);
  }
  return { q, t: rotate(q, a).map((value, i) => b[i] - value) };
}

function icp(source, target, weights, k, initial, maxIterations) {
  const poses = [initial];
  const scores = [];
  const squares = [NaN];
  const history = [];
  const flat = Float64Array.from(target.flat());
  for (let iteration = 0; ; ++iteration) {
    const pose = poses[poses.length - 1];
    const moved = source.map((p) => move(pose, p));
    const matched = new Int32Array(source.length);
    let score = 0;
    let square = 0;
    moved.forEach((p, i) => {
      const best = [];
      for (let j = 0; j < target.length; ++j) {
        const d = (flat[3 * j] - p[0]) ** 2 + (flat[3 * j + 1] - p[1]) ** 2 + (flat[3 * j + 2] - p[2]) ** 2;
        if (best.length < k || d < best[best.length - 1].d) {
          best.push({ j, d });
          best.sort((x, y) => x.d - y.d);
          best.length = Math.min(best.length, k);
        }
      }
      score += best[0].d / source.length;
      const choice = weights ? best.reduce((x, y) => (weights[y.j] > weights[x.j] ? y : x)) : best[0];
      matched[i] = choice.d < 1 ? choice.j : -1;
      square += choice.d / source.length;
    });
    scores.push(score);
    if (iteration >= maxIterations) {
      break;
    }
    history.push(matched);
    const pairs = [...matched].flatMap((j, i) => (j < 0 ? [] : [[moved[i], target[j]]]));
    const step = umeyama(pairs.map(([p]) => p), pairs.map(([, p]) => p));
    squares.push(square);
    poses.push({ q: multiply(step.q, pose.q), t: rotate(step.q, pose.t).map((value, i) => value + step.t[i]) });
    if (squares.length > 2 && Math.abs(square - squares[squares.length - 2]) < 1e-7) {
      maxIterations = iteration + 1;
    }
  }
  return { poses, scores, squares, history };
}

export function encodeMatches(history, writer) {
  const counts = [];
  const changed = [];
  const targets = [];
  for (let i = 1; i < history.length; ++i) {
    let count = 0;
    for (let n = 0; n < history[i].length; ++n) {
      if (history[i][n] !== history[i - 1][n]) {
        changed.push(n);
        targets.push(history[i][n]);
        ++count;
      }
    }
    counts.push(count);
  }
  return {
    first: writer.add(Int32Array.from(history[0])),
    change_counts: writer.add(Uint32Array.from(counts)),
    changed: writer.add(Uint32Array.from(changed)),
    targets: writer.add(Int32Array.from(targets)),
  };
}

function runOf(name, { poses, scores, squares, matches }, truth, centroid, writer, extra = {}) {
  const errors = poses.map((pose) => {
    const q = multiply(pose.q, conjugate(truth.q));
    const moved = move(pose, centroid);
    const wanted = move(truth, centroid);
    return {
      rotation: (2 * Math.atan2(Math.hypot(q[1], q[2], q[3]), Math.abs(q[0])) * 180) / Math.PI,
      translation: Math.hypot(...moved.map((value, i) => value - wanted[i])),
    };
  });
  const last = errors[errors.length - 1];
  return {
    name,
    summary: {
      status: scores.at(-1) < 0.0037 ? "aligned" : "rejected",
      stop_reason: "mean squared distance",
      iterations: poses.length - 1,
      initial_score: scores[0],
      score: scores.at(-1),
      rotation_error_deg: last.rotation,
      translation_error_m: last.translation,
      k: name === "base" ? 1 : 5,
      ...extra,
    },
    poses: writer.add(Float64Array.from(poses.flatMap(numbers))),
    mean_squared_distance: writer.add(Float64Array.from(squares)),
    scores: writer.add(Float64Array.from(scores)),
    rotation_error_deg: writer.add(Float64Array.from(errors, (e) => e.rotation)),
    translation_error_m: writer.add(Float64Array.from(errors, (e) => e.translation)),
    matches,
  };
}

function matrixOf({ t, q }) {
  const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(q, axis));
  return [0, 1, 2].flatMap((r) => [columns[0][r], columns[1][r], columns[2][r], t[r]]).concat([0, 0, 0, 1]);
}

const kProvenance = {
  command: ["cairn", "align", "maps/later.map", "maps/earlier.map", "--confidence", "all", "--initial", "0.4 0.1 0 0 0 35", "--report", "align.html"],
  seed: 42,
  machine: { system: "Linux 6.1 x86_64", processor: "Example CPU 3.0 GHz", threads: 2 },
  inputs: [
    { role: "source", path: "maps/later.map", hash: "xxh3:8f1c0e7a55d2b3904cc1f0e2a7b6d915", details: { landmarks: 900, frames: 60, dropped: 12 } },
    { role: "target", path: "maps/earlier.map", hash: "xxh3:17aa90be4f02c1d8730e5b6cd2f8a344", details: { landmarks: 1000, frames: 60, dropped: 9 } },
  ],
  options: { k: 5, max_iterations: 150, max_distance_m: null, min_observations: 2, initial: { x: 0.4, y: 0.1, z: 0, yaw_deg: 35 } },
};

function pair(sourceCount, targetCount, seed) {
  const rng = random(seed);
  const truth = { q: rotation([0.02, -0.03, 1], 0.31), t: [0.12, -0.08, 0.03] };
  const initial = { q: multiply(rotation([0, 0, 1], 0.5), truth.q), t: [0.42, -0.16, 0.06] };
  const seen = office(Math.max(sourceCount, targetCount), rng);
  const back = inverse(truth);
  const target = seen.slice(0, targetCount).map((p) => p.map((value) => value + 0.008 * normal(rng)));
  const source = seen.slice(-sourceCount).map((p) => move(back, p.map((value) => value + 0.008 * normal(rng))));
  const centroid = [0, 1, 2].map((i) => source.reduce((sum, p) => sum + p[i], 0) / source.length);
  return { rng, truth, initial, target, source, centroid };
}

function scene(id, title, text, runs, truth) {
  return { kind: "scene", id, title, text, source: "later", target: "earlier", truth: matrixOf(truth), up: [0, 0, 1], runs };
}

function violinGroups(rng) {
  const levels = { base: [0.0034, 0.0166, 0.55], covariance: [0.0033, 0.014, 0.08], observations: [0.0033, 0.012, 0.04], distance: [0.0036, 0.011, 0.03] };
  return Object.entries(levels).map(([name, [good, bad, share]]) => {
    const values = Array.from({ length: 24 }, () => Math.max(0.0031, (rng() < share ? bad : good) + (rng() < share ? 8e-4 : 9e-5) * normal(rng)));
    return { name, values, labels: values.map((_, i) => `yaw ${-60 + 5 * i}°`) };
  });
}

/** A png of one gradient, made by hand. */
function png(width, height) {
  const crcTable = Array.from({ length: 256 }, (_, n) => {
    let c = n;
    for (let k = 0; k < 8; ++k) {
      c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
    }
    return c >>> 0;
  });
  const chunk = (type, data) => {
    const body = Buffer.concat([Buffer.from(type), data]);
    let crc = 0xffffffff;
    for (const byte of body) {
      crc = crcTable[(crc ^ byte) & 255] ^ (crc >>> 8);
    }
    const size = Buffer.alloc(4);
    size.writeUInt32BE(data.length);
    const sum = Buffer.alloc(4);
    sum.writeUInt32BE((crc ^ 0xffffffff) >>> 0);
    return Buffer.concat([size, body, sum]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 2, 0, 0, 0], 8);
  const rows = Buffer.alloc(height * (1 + 3 * width));
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) {
      rows.set([60 + (120 * x) / width, 90 + (100 * y) / height, 140], y * (1 + 3 * width) + 1 + 3 * x);
    }
  }
  return Buffer.concat([Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]), chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}

/** Every kind of section and of chart. */
export function smallSample() {
  const writer = new BufferWriter();
  const { rng, truth, initial, target, source, centroid } = pair(900, 1000, 7);
  const images = [0, 10, 20, 30, 40, 50].map((frame) => ({ frame, media_type: "image/png", data: writer.add(new Uint8Array(png(64, 48))) }));
  const later = mapOf("later", "later.map", source, writer, rng, { shift: 0.1, images });
  const earlier = mapOf("earlier", "earlier.map", target, writer, rng);
  const weights = { base: null, covariance: target.map(() => rng()), observations: target.map(() => rng()), distance: target.map((p) => 1 / (1 + Math.hypot(...p))) };
  const runs = Object.entries(weights).map(([name, weight]) => {
    const result = icp(source, target, weight, weight ? 5 : 1, initial, 60);
    return runOf(name, { ...result, matches: encodeMatches(result.history, writer) }, truth, centroid, writer);
  });
  const groups = violinGroups(rng);
  const names = groups.map(({ name }) => name);
  const iterations = Array.from({ length: 9 }, (_, i) => 10 * i);
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: "0.4.0",
    title: "later.map to earlier.map",
    subtitle: "Three of four strategies align the maps; base ICP stops 9 cm off. The best score is 0.000183 m², by observations.",
    provenance: kProvenance,
    maps: [later, earlier],
    sections: [
      scene("alignment", "Alignment", "Each pane shows one strategy. Move the slider to see the source map find its place on the target.", runs, truth),
      { kind: "chart", id: "yaw", title: "Score by initial yaw", text: "Scores of 24 starts between −60° and 60°. Below the line the authors call it a success.", chart: "violin", x_label: "Strategy", y_label: "Score (m²)", y_scale: "log", threshold: { value: 0.0037, label: "success below 0.0037 m²" }, groups },
      { kind: "chart", id: "xy", title: "Score by initial translation", text: null, chart: "violin", x_label: "Strategy", y_label: "Score (m²)", y_scale: "linear", threshold: null, groups },
      { kind: "chart", id: "convergence", title: "Convergence", text: "Median of all starts.", chart: "lines", x_label: "Iteration", y_label: "Rotation error (°)", y_scale: "log",
        series: names.map((name, s) => {
          const y = iterations.map((i) => 35 * Math.exp(-i / (14 + 6 * s)) + 0.2 + 0.1 * s);
          return { name, x: iterations, y };
        }) },
      { kind: "chart", id: "basin", title: "Basin of convergence", text: "Share of starts that end at the truth.", chart: "heatmap", x_label: "Initial yaw (°)", y_label: "Initial translation (m)", value_label: "Success rate",
        x: [-70, -50, -30, -10, 10, 30, 50, 70], y: [0, 0.25, 0.5, 0.75, 1], range: [0, 1],
        panels: names.map((name, s) => ({
          name,
          values: [0, 1, 2, 3].map((j) => [-60, -40, -20, 0, 20, 40, 60].map((x) => (j === 3 && Math.abs(x) === 60 && s === 1 ? null : Math.max(0, Math.min(1, Math.round(20 * (1.3 + 0.1 * s - Math.abs(x) / (45 + 8 * s) - 0.22 * j)) / 20))))),
          counts: [0, 1, 2, 3].map(() => [20, 20, 20, 20, 20, 20, 20]),
        })) },
      { kind: "chart", id: "success", title: "Success rates", text: "Wilson intervals, 95 %.", chart: "intervals", x_label: "Success rate",
        series: names.map((name, s) => ({ name, items: ["Yaw", "XY", "XY and yaw"].map((item, i) => { const value = Math.min(0.98, 0.42 + 0.17 * s + 0.05 * i); return { name: item, value, low: value - 0.13, high: Math.min(1, value + 0.1) }; }) })) },
      { kind: "chart", id: "errors", title: "Errors", text: null, chart: "scatter", x_label: "Rotation error (°)", y_label: "Translation error (m)", x_scale: "log", y_scale: "log", x_threshold: { value: 2, label: "2°" }, y_threshold: { value: 0.05, label: "5 cm" },
        series: names.map((name, s) => ({ name, x: Array.from({ length: 30 }, () => 0.4 * Math.exp(normal(rng) + 0.3 * (3 - s))), y: Array.from({ length: 30 }, () => 0.012 * Math.exp(normal(rng) + 0.3 * (3 - s))), labels: null })) },
      { kind: "table", id: "k", title: "Neighbourhood size k", text: "Score in thousandths of a square metre, as in the paper's table 1.",
        columns: [{ name: "k", unit: null, type: "number", digits: 0 }, ...["Base", "Cov.", "# Obs.", "Mean dist."].map((name) => ({ name, unit: "10⁻³ m²", type: "number", digits: 5 })), { name: "Note", unit: null, type: "text", digits: null }],
        rows: [[1, 5.34268, 5.34268, 5.34268, 5.34268, "k = 1 is base ICP"], [3, 5.34268, 4.58499, 3.3126, 3.31155, null], [5, 5.34268, 3.28737, 3.29407, 3.54915, null], [7, 5.34268, 3.28614, 3.30512, 3.6283, null], [10, 5.34268, 14.0339, 3.33651, 4.00365, "covariance diverges"], [15, 5.34268, 14.0491, 3.39744, 5.54156, null], [20, 5.34268, 14.0212, 3.42316, null, "not run"]],
        best: [null, "low", "low", "low", "low", null] },
      { kind: "scene", id: "target-map", title: "The earlier map", text: "One map on its own.", source: null, target: "earlier", truth: null, up: null, runs: [] },
      { kind: "text", id: "notes", title: "Notes", text: "The maps were recorded ten minutes apart.\n\nLandmarks with fewer than two observations are left out, as the paper's authors do." },
      { kind: "hologram", id: "future", title: "From the future", text: null },
    ],
  };
  return { document, buffers: writer.bytes() };
}

/** What alignments came to, of every verdict, before their scene; a table of one row, and curves that hardly fall. */
export function answerSample() {
  const writer = new BufferWriter();
  const { rng, truth, initial, target, source, centroid } = pair(700, 800, 19);
  const later = mapOf("later", "later.map", source, writer, rng, { shift: 0.1 });
  const earlier = mapOf("earlier", "earlier.map", target, writer, rng);
  const names = ["robust", "observations", "distance", "icp"];
  const result = icp(source, target, null, 1, initial, 25);
  const runs = names.map((name) => runOf(name, { ...result, matches: encodeMatches(result.history, writer) }, truth, centroid, writer));
  const estimate = { pose: numbers(result.poses.at(-1)), scale: 1 };
  const turned = (angle, shift) => ({ pose: numbers({ q: multiply(rotation([0, 0, 1], angle), truth.q), t: truth.t.map((value, i) => value + shift[i]) }), scale: 1 });
  const candidate = (pose, probability, share, evidence, contradicted) => ({
    ...pose, probability, matches: Math.round(700 * share), share, contradicted,
    evidence: [{ name: "Match distances", value: 0.6 * evidence }, { name: "Descriptors of the matches", value: 0.4 * evidence }],
  });
  const others = Array.from({ length: 11 }, (_, i) => candidate(turned(0.5 + 0.45 * i, [0.2 * i, 0.1, 0]), 1e-6 / (i + 1), 0.31 - 0.02 * i, 60 - 5 * i, 0.2 + 0.05 * i));
  const deviations = { translation: [0.0012, 0.0034, 0.0008], rotation_deg: [0.05, 0.02, 0.11], log_scale: null };
  const judged = (name, status, probability, reason, more) => ({ name, status, judged: true, probability, reason, radius: 0.05, estimate, deviations, open: [], candidates: [], ...more });
  const answer = {
    kind: "answer", id: "answer", title: "Answer", text: null, length_unit: "m", scene: "scene",
    alignments: [
      judged("robust", "aligned", 0.99996, "412 of 700 landmarks match, 40 times as likely as at any other pose", { candidates: [candidate(estimate, 0.99996, 0.588, 812, 0.004), ...others] }),
      judged("observations", "ambiguous", 0.52, "two poses fit nearly as well", {
        deviations: null, open: [{ translation: [0, 1, 0], rotation: [0, 0, 0], log_scale: 0 }, { translation: [0.1, 0.2, 0], rotation: [0, 0.7, 0.7], log_scale: 0 }],
        candidates: [candidate(estimate, 0.52, 0.4, 300, null), candidate(turned(3.1, [0.4, 0, 0]), 0.47, 0.39, 290, null)],
      }),
      judged("distance", "rejected", 0.0004, "too few landmarks agree", { candidates: [candidate(estimate, 0.0004, 0.08, 3, 0.41)] }),
      { name: "icp", status: "converged", judged: false, probability: null, reason: "the mean squared distance settled", radius: null, estimate, deviations: null, open: [], candidates: [] },
    ],
  };
  const columns = [["Strategy", null, "text", null], ["k", null, "number", 0], ["Status", null, "text", null], ["Iterations", null, "number", 0], ["Score before", "m²", "number", 6], ["Score after", "m²", "number", 6], ["Rotation error", "deg", "number", 4], ["Translation error", "m", "number", 5], ["Overlap of source", null, "number", 3], ["Overlap of target", null, "number", 3], ["Time", "s", "number", 3]].map(([name, unit, type, digits]) => ({ name, unit, type, digits }));
  const row = (name) => [name, 5, "ambiguous", 25, 0.034521, 0.018612, 0.0331, 0.00049, 0.871, 0.852, 0.412];
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: "0.4.0",
    title: "later.map to earlier.map",
    subtitle: "Four methods, four answers.",
    provenance: kProvenance,
    maps: [later, earlier],
    sections: [
      answer,
      scene("scene", "Alignment", null, runs, truth),
      { kind: "table", id: "numbers", title: "Numbers", text: null, columns: [...columns, { name: "Reason", unit: null, type: "text", digits: null }], rows: [[...row("robust"), "the best pose matches 78.4 % of 3171 landmarks one to one, no other pose was found"]], best: null },
      { kind: "table", id: "strategies", title: "Strategies", text: null, columns, rows: names.map(row), best: [null, null, null, null, null, "low", "low", "low", "high", "high", null] },
      { kind: "table", id: "files", title: "Files", text: null, columns: [{ name: "File", unit: null, type: "text", digits: null }, { name: "Content hash", unit: null, type: "text", digits: null }, { name: "Observations", unit: null, type: "number", digits: 0 }],
        rows: [["/srv/robots/2026-11-26/warehouse-north/session-0042/maps/later.map", "xxh3:8f1c0e7a55d2b3904cc1f0e2a7b6d915", 123456], ["earlier.map", "xxh3:17aa90be4f02c1d8730e5b6cd2f8a344", 98765]], best: null },
      { kind: "chart", id: "flat", title: "Convergence", text: null, chart: "lines", x_label: "Iteration", y_label: "Score (m²)", x_scale: "linear", y_scale: "log", threshold: null,
        series: [{ name: "robust", x: [0, 1, 2, 3], y: [0.01862, 0.01861, 0.0186, 0.0186] }] },
    ],
  };
  return { document, buffers: writer.bytes() };
}

/** 6,000 landmarks, 150 iterations, 4 strategies; a tenth of the matches changes in each iteration. */
export function paperSample() {
  const writer = new BufferWriter();
  const { rng, truth, initial, target, source, centroid } = pair(6000, 6000, 11);
  const later = mapOf("later", "fr1_desk2.map", source, writer, rng, { shift: 0.1, frames: 340 });
  const earlier = mapOf("earlier", "fr1_desk.map", target, writer, rng, { frames: 560 });
  const runs = ["base", "covariance", "observations", "distance"].map((name, s) => {
    const poses = [];
    const scores = [];
    const squares = [];
    const history = [];
    const current = Int32Array.from({ length: 6000 }, () => Math.floor(6000 * rng()));
    for (let i = 0; i <= 150; ++i) {
      const rest = Math.exp(-i / (12 + 8 * s)) + (s === 0 ? 0.12 : 0.004);
      const q = multiply(rotation([0, 0, 1], 0.5 * rest), truth.q);
      poses.push({ q, t: truth.t.map((value, axis) => value + rest * (initial.t[axis] - value)) });
      scores.push(0.0033 + 0.03 * rest * rest);
      squares.push(i === 0 ? NaN : 0.0036 + 0.034 * rest * rest);
      if (i > 0) {
        for (let n = 0; n < 600; ++n) {
          const landmark = Math.floor(6000 * rng());
          current[landmark] = rng() < 0.08 ? -1 : rng() < 0.8 ? landmark : Math.floor(6000 * rng());
        }
        history.push(current.slice());
      }
    }
    return runOf(name, { poses, scores, squares, matches: encodeMatches(history, writer) }, truth, centroid, writer);
  });
  const groups = violinGroups(rng);
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: "0.4.0",
    title: "fr1_desk2.map to fr1_desk.map",
    subtitle: "All weighted strategies align the maps; base ICP stops short.",
    provenance: kProvenance,
    maps: [later, earlier],
    sections: [
      scene("alignment", "Alignment", null, runs, truth),
      { kind: "chart", id: "yaw", title: "Score by initial yaw", text: null, chart: "violin", x_label: "Strategy", y_label: "Score (m²)", y_scale: "linear", threshold: null, groups },
    ],
  };
  return { document, buffers: writer.bytes() };
}

/** One map of a million landmarks: a street of houses. */
export function millionSample(count = 1_000_000) {
  const rng = random(3);
  const writer = new BufferWriter();
  const positions = new Uint16Array(3 * count);
  const observations = new Uint8Array(count);
  const colors = new Uint8Array(3 * count);
  for (let i = 0; i < count; ++i) {
    const side = rng() < 0.5 ? -1 : 1;
    const along = rng();
    const house = Math.floor(along * 24);
    const height = 0.25 + 0.5 * random(house * 2 + (side > 0 ? 1 : 0))();
    const kind = rng();
    const p = kind < 0.6 ? [along, 0.5 + side * (0.16 + 0.03 * (house % 3)), height * rng()] : kind < 0.85 ? [along, 0.5 + side * 0.15 * rng(), 0.004 * rng()] : [(house + (rng() < 0.5 ? 0.08 : 0.92)) / 24, 0.5 + side * (0.18 + 0.12 * rng()), height * rng()];
    p.forEach((value, axis) => (positions[3 * i + axis] = Math.round(65535 * Math.min(1, Math.max(0, value + 0.0008 * normal(rng))))));
    observations[i] = Math.min(255, 2 + Math.floor(-7 * Math.log(rng() + 1e-9)));
    colors.set([90 + 5 * (house % 7) + 40 * rng(), 90 + 60 * p[2], 100 + 30 * rng()], 3 * i);
  }
  const frames = 2000;
  const poses = new Float32Array(7 * frames);
  for (let i = 0; i < frames; ++i) {
    poses.set([(400 * i) / frames, 100, 1.6, ...multiply(rotation([0, 0, 1], -Math.PI / 2), rotation([1, 0, 0], -Math.PI / 2))], 7 * i);
  }
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: "0.4.0",
    title: "street.map",
    subtitle: "A million landmarks.",
    provenance: null,
    maps: [{
      id: "street", name: "street.map", length_unit: "m", count, origin: [0, 0, 0], step: [400 / 65535, 200 / 65535, 40 / 65535],
      positions: writer.add(positions), ids: null,
      columns: [{ name: "observations", label: "Observations", unit: null, values: writer.add(observations), scale: 1, offset: 0 }],
      colors: writer.add(colors),
      frames: { count: frames, poses: writer.add(poses), ids: null, timestamps: null, frustum: null },
    }],
    sections: [{ kind: "scene", id: "map", title: "Map", text: null, source: null, target: "street", truth: null, up: [0, 0, 1], runs: [] }],
  };
  return { document, buffers: writer.bytes() };
}

/** Three Gaussian splats: a red one of standard deviations 0.3, 0.03 and 0.03 along the axes, between two small grey ones. */
export function splatSample() {
  const writer = new BufferWriter();
  const points = [[-1, -1, -1], [0, 0, 0], [1, 1, 1]];
  const map = mapOf("splats", "splats.ply", points, writer, random(11), { unit: "mapunits", frames: 0, colors: false });
  const round = [127, 127, 127, 0, 0, 0];
  map.columns = [];
  map.colors = writer.add(Uint8Array.from([128, 128, 128, 255, 0, 0, 128, 128, 128]));
  map.ellipsoids = {
    covariances: writer.add(Int8Array.from([...round, 127, 1, 1, 0, 0, 0, ...round])),
    sigmas: writer.add(Uint8Array.from([0, 255, 0])),
    scale: (Math.log2(0.3) - Math.log2(0.01)) / 255,
    offset: Math.log2(0.01),
  };
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: "0.4.0",
    title: "splats.ply",
    subtitle: null,
    provenance: null,
    maps: [map],
    sections: [{ kind: "scene", id: "map", title: "Map", text: null, source: null, target: "splats", truth: null, up: [0, 0, 1], runs: [] }],
  };
  return { document, buffers: writer.bytes() };
}

/** Five sessions of an office, one of them elsewhere: links of every use, changes, times and a log. */
export function networkSample() {
  const writer = new BufferWriter();
  const rng = random(23);
  const names = ["monday", "tuesday", "wednesday", "robot2", "cellar"];
  const seen = office(2400, rng);
  const shown = [[0, 1400], [500, 1900], [900, 2400], [200, 1500], [0, 600]];
  const optimised = [
    { q: [1, 0, 0, 0], t: [0, 0, 0] },
    { q: rotation([0, 0.02, 1], 0.7), t: [2.4, 0.4, 0.02] },
    { q: rotation([0.03, 0, 1], -0.5), t: [-1.8, 1.1, -0.04] },
    { q: rotation([0, 0, 1], 2.4), t: [0.6, 3.1, 0.1] },
  ];
  const maps = names.map((name, i) => {
    const points = seen.slice(...shown[i]).map((p) => p.map((value) => value + 0.006 * normal(rng)));
    const back = optimised[i] ? inverse(optimised[i]) : { q: [1, 0, 0, 0], t: [0, 0, 0] };
    const images = i < 4 ? [0, 5].map((frame) => ({ frame, media_type: "image/png", data: writer.add(new Uint8Array(png(64, 48))) })) : undefined;
    const map = mapOf(`map-${i}`, name, points.map((p) => move(back, p)), writer, rng, { frames: 14, colors: false, images });
    const poses = cameraPath(14, 0.15 * i - 0.2, rng);
    for (let k = 0; k < 14; ++k) {
      const one = { t: [...poses.slice(7 * k, 7 * k + 3)], q: [...poses.slice(7 * k + 3, 7 * k + 7)] };
      poses.set([...move(back, one.t), ...multiply(back.q, one.q)], 7 * k);
    }
    map.columns = [];
    map.frames.poses = writer.add(poses);
    const start = 1790000000 + 86400 * i;
    map.frames.timestamps = writer.add(Float64Array.from({ length: 14 }, (_, k) => start + 2 * k));
    const middle = [0, 1, 2].map((axis) => points.reduce((sum, p) => sum + p[axis], 0) / points.length);
    return { map, centre: move(back, middle) };
  });
  const off = (pose) => ({ q: multiply(rotation([0, 0, 1], 0.02), pose.q), t: pose.t.map((value) => value + 0.02) });
  const section = {
    kind: "network", id: "network", title: "Maps and links", text: null, length_unit: "m",
    stages: ["Own frames", "Along the links", "Optimised"],
    groups: [{ frame: "monday", up: [0, 0, 1] }],
    nodes: names.map((name, i) => ({
      name, map: `map-${i}`, session: null, reason: i === 4 ? "aligned with no other map; likeliest with robot2 (rejected, 2.31 %)" : null,
      group: i < 4 ? 0 : null, landmarks: maps[i].map.count, keyframes: 14, fused: i < 4 ? 300 * i : null, centre: maps[i].centre,
      poses: i < 4 ? writer.add(Float64Array.from([[1, 0, 0, 0], 1, 2].flatMap((_, stage) => numbers(stage === 0 ? { t: [0, 0, 0], q: [1, 0, 0, 0] } : stage === 1 && i > 0 ? off(optimised[i]) : optimised[i])))) : null,
      scales: null,
    })),
    links: [[0, 1, "used", 0.9999], [0, 2, "used", 0.9987], [1, 2, "used", 0.9999], [0, 3, "contradicted", 0.9921], [1, 3, "used", 0.9975], [2, 3, "ambiguous", 0.62], [0, 4, "rejected", 0.004], [1, 4, "rejected", 0.01], [2, 4, "rejected", 0], [3, 4, "rejected", 0.0231]].map(([target, source, use, probability]) => ({
      target, source, use, kind: "placement", probability,
      reason: use === "used" ? "412 landmarks agree, and nothing stands where keyframes saw through" : use === "ambiguous" ? "two poses fit nearly as well" : use === "contradicted" ? "388 landmarks agree" : "too few landmarks agree",
      residual: target < 4 && source < 4 && use !== "ambiguous" ? (use === "contradicted" ? 0.41 : 0.002 + 0.002 * target) : null,
      residual_deg: target < 4 && source < 4 && use !== "ambiguous" ? (use === "contradicted" ? 9 : 0.04) : null,
      ...(target !== 1 && source < 4 && { view: { target_frame: 5, source_frame: 0, matches: target === 0 && source === 3 ? 1 : 112 } }),
    })),
  };
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: "0.4.0",
    title: "building.map",
    subtitle: "Placed 4 of 5 maps in the frame of monday: 5 900 landmarks became 3 100. Left out: cellar.",
    provenance: kProvenance,
    maps: maps.map(({ map }) => map),
    sections: [
      section,
      { kind: "chart", id: "residuals", title: "Residual per link", text: null, chart: "intervals", x_label: "Distance from the poses (m)", x_scale: "log",
        series: ["used", "contradicted"].map((use) => ({ name: use, items: section.links.filter((link) => link.use === use).map((link) => ({ name: `${names[link.target]} ← ${names[link.source]}`, value: link.residual, low: link.residual, high: link.residual })) })) },
      { kind: "chart", id: "sessions", title: "Sessions", text: "When the keyframes of each map were taken.", chart: "spans", x_label: "Time",
        series: names.map((name, i) => ({ name, spans: [{ name, start: 1790000000 + 30000 * i, end: 1790000000 + 30000 * i + 6000 + 5000 * i, marks: [0, 1, 2, 3].map((k) => 1790000000 + 30000 * i + 1500 * k) }] })) },
      { kind: "table", id: "log", title: "Log", text: null,
        columns: [{ name: "Commit", unit: null, type: "number", digits: 0 }, { name: "What", unit: null, type: "text", digits: null }, { name: "To undo it", unit: null, type: "command", digits: null }],
        rows: [[2, "linked tuesday", "cairn atlas undo --commit 2 --atlas town.atlas"], [1, "added monday", null]], best: null },
    ],
  };
  return { document, buffers: writer.bytes() };
}

/** Names that would be markup, script or trouble if anything took them for more than text. */
export function hostileSample() {
  const writer = new BufferWriter();
  const rng = random(5);
  const evil = '<script>window.pwned=1</script><img src=x onerror="window.pwned=2">"><svg onload=window.pwned=3>';
  const close = "</script></title><!--CAIRN:DATA--><!-- ${window.pwned=4} {{7*7}} &lt;b&gt; javascript:alert(1)";
  const long = "sehr-langer-name-ohne-leerzeichen-".repeat(40);
  const unicode = "Ünïcödé 地図 🗺️ \u202Eright-to-left\u202C \u0000 \u2028 'quotes\" \\ back";
  const cloud = (id, name) => {
    // Begins like an image, and is none.
    const images = [{ frame: 0, media_type: "image/jpeg", data: writer.add(Uint8Array.of(0xff, 0xd8, 0xff, 1, 2, 3)) }];
    const one = mapOf(id, name, office(300, rng), writer, rng, { frames: 8, type: Uint32Array, unit: "mapunits", images });
    one.columns[0] = { ...one.columns[0], name: "__proto__", label: evil, unit: close };
    one.columns[1] = { ...one.columns[1], name: long, label: long };
    return one;
  };
  const maps = [cloud("a", evil), cloud("b", close)];
  const matches = encodeMatches([Int32Array.from({ length: 300 }, (_, i) => i), Int32Array.from({ length: 300 }, (_, i) => (i % 5 ? i : -1))], writer);
  const run = (name) => ({
    name, summary: { [evil]: evil, __proto__x: close, status: evil, [long]: long, constructor: "c" },
    poses: writer.add(Float64Array.from([0.3, 0, 0, 1, 0, 0, 0, 0.1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0])),
    mean_squared_distance: null, scores: null, rotation_error_deg: null, translation_error_m: null, matches,
  });
  const names = [evil, close, long, unicode, "__proto__", "constructor"];
  const some = () => [1, 2, 3, 4, null];
  const groups = names.map((name) => ({ name, values: [1, 2, 3, 2.5, null], labels: [evil, close, long, unicode, ""] }));
  const chart = (id, rest) => ({ kind: "chart", id, title: evil, text: close, ...rest });
  const axes = { x_label: evil, y_label: close };
  const document = {
    schema: { name: "cairn.report", version: 1 },
    cairn_version: evil,
    title: `${close}${evil}${unicode}`,
    subtitle: long,
    provenance: {
      command: [evil, close, unicode, "a b"], seed: null, machine: { [evil]: close },
      inputs: [{ role: evil, path: long, hash: close, details: { [evil]: { [close]: [evil, 1, null] } } }],
      options: { [long]: evil, deep: { a: { b: { c: { d: unicode } } } } },
    },
    maps,
    sections: [
      { kind: "scene", id: "scene", title: evil, text: close, source: "a", target: "b", truth: null, up: null, runs: [run(evil), run(long), run(unicode)] },
      chart("violin", { chart: "violin", ...axes, y_scale: "linear", threshold: { value: 2, label: evil }, groups }),
      chart("lines", { chart: "lines", ...axes, y_scale: "linear", series: names.map((name) => ({ name, x: [1, 2, 3, 4, 5], y: some() })) }),
      chart("heat", { chart: "heatmap", ...axes, value_label: evil, x: [0, 1, 2], y: [0, 1], panels: names.map((name) => ({ name, values: [[1, null]], counts: null })), range: null }),
      chart("dots", { chart: "intervals", x_label: evil, series: names.map((name) => ({ name, items: [{ name: close, value: 0.5, low: null, high: 0.7 }] })) }),
      chart("cloud", { chart: "scatter", ...axes, x_scale: "linear", y_scale: "linear", x_threshold: null, y_threshold: null, series: names.map((name) => ({ name, x: some(), y: some(), labels: [evil, close, long, "", ""] })) }),
      {
        kind: "network", id: "network", title: evil, text: close, length_unit: "mapunits", stages: [evil, long], groups: [{ frame: long, up: null }],
        nodes: names.map((name, i) => ({ name, map: i < 2 ? "ab"[i] : null, session: evil, reason: close, group: i < 2 ? 0 : null, landmarks: 300, keyframes: 8, fused: null, centre: [0, 0, 0], poses: i < 2 ? writer.add(Float64Array.from([0, 0, 0, 1, 0, 0, 0, 0.1 * i, 0, 0, 1, 0, 0, 0])) : null, scales: null })),
        links: [{ target: 0, source: 1, use: "used", kind: evil, probability: null, reason: close, residual: null, residual_deg: null, view: { target_frame: 0, source_frame: 0, matches: 1 } }, { target: 2, source: 1, use: "rejected", kind: null, probability: 0.2, reason: long, residual: null, residual_deg: null }],
      },
      chart("spans", { chart: "spans", x_label: evil, series: names.map((name) => ({ name, spans: [{ name: close, start: 1, end: 1, marks: [] }] })) }),
      { kind: "table", id: "commands", title: evil, text: null, columns: [{ name: evil, unit: null, type: "command", digits: null }], rows: [[evil], [long]], best: null },
      { kind: "table", id: "table", title: evil, text: long, columns: [{ name: evil, unit: close, type: "text", digits: null }, { name: long, unit: null, type: "number", digits: 2 }], rows: [[evil, 1], [close, null], [unicode, 3], ["=HYPERLINK(\"x\")", 4]], best: [null, "low"] },
      { kind: "text", id: "text", title: unicode, text: `${evil}\n\n${close}` },
      { kind: evil, id: "unknown", title: evil, text: null },
      { kind: "scene", id: "broken", title: "Broken", text: null, source: null, target: evil, truth: null, up: null, runs: [] },
    ],
  };
  return { document, buffers: writer.bytes() };
}

export const kSamples = { small: smallSample, answer: answerSample, paper: paperSample, million: millionSample, splats: splatSample, network: networkSample, hostile: hostileSample };

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [name, path] = process.argv.slice(2);
  if (!kSamples[name] || !path) {
    console.error(`usage: node test/sample.mjs ${Object.keys(kSamples).join("|")} OUT.html`);
    process.exit(2);
  }
  const page = writePage(kSamples[name]());
  writeFileSync(path, page);
  console.log(`${path}: ${(page.length / 1e6).toFixed(2)} MB`);
}

// SPDX-License-Identifier: BSD-3-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { PerspectiveCamera, Vector3 } from "three";
import { loadModule } from "./support/load_module.mjs";

const { bandwidth, kernelDensity, quantileSorted, sortedFinite, summarise } = await loadModule("src/math/statistics.ts");
const { formatNumber, formatFixed, formatLength, idText, labelOf, niceBelow } = await loadModule("src/math/format.ts");
const { apply, compose, dequantise, poseAt, positionOf, scaleOf, similarityAt } = await loadModule("src/math/pose.ts");
const { compareCells, bestValues } = await loadModule("src/table.ts");
const { toCsv } = await loadModule("src/export.ts");
const { shellCommand } = await loadModule("src/provenance.ts");
const { columnScale, levelOf, scaleTicks } = await loadModule("src/scene/coloring.ts");
const { pickLandmark } = await loadModule("src/scene/picking.ts");
const { frustumOf, imageRectangle, keyframeText, lookThrough } = await loadModule("src/scene/keyframes.ts");
const { Orbit } = await loadModule("src/scene/orbit.ts");
const { fromAbove, spread } = await loadModule("src/network/graph_layout.ts");
const { durationText, formatProbability, formatShare } = await loadModule("src/math/format.ts");
const { differenceOf, poseOf, rollPitchYaw } = await loadModule("src/math/pose.ts");
const { unitText } = await loadModule("src/table.ts");
const { extentFromZero } = await loadModule("src/charts/shared.ts");

const near = (actual, expected, tolerance = 1e-12) => assert.ok(Math.abs(actual - expected) <= tolerance, `${actual} is not ${expected}`);

test("quantiles interpolate between order statistics", () => {
  const values = [1, 2, 4, 8];
  near(quantileSorted(values, 0), 1);
  near(quantileSorted(values, 0.25), 1.75);
  near(quantileSorted(values, 0.5), 3);
  near(quantileSorted(values, 0.75), 5);
  near(quantileSorted(values, 1), 8);
  near(quantileSorted([5], 0.3), 5);
  assert.ok(Number.isNaN(quantileSorted([], 0.5)));
});

test("a box summary matches values worked out by hand", () => {
  const summary = summarise([1, 2, 3, 4, 5, 6, 7, 8, 9, 100, NaN]);
  assert.equal(summary.count, 10);
  near(summary.q1, 3.25);
  near(summary.median, 5.5);
  near(summary.q3, 7.75);
  near(summary.mean, 14.5);
  near(summary.whiskerLow, 1);
  near(summary.whiskerHigh, 9);
  assert.equal(summarise([NaN]), null);
});

test("kernel density matches values worked out by hand and has area one", () => {
  // Two kernels at -1 and 1, width 1: at 0 both give phi(1).
  const phi = (z) => Math.exp(-z * z / 2) / Math.sqrt(2 * Math.PI);
  const values = Float64Array.of(-1, 1);
  near(kernelDensity(values, 1, [0])[0], phi(1));
  near(kernelDensity(values, 1, [1])[0], (phi(2) + phi(0)) / 2);
  const step = 0.01;
  const points = Array.from({ length: 1601 }, (_, i) => -8 + i * step);
  near(kernelDensity(values, 1, points).reduce((sum, d) => sum + d * step, 0), 1, 1e-9);
});

test("Silverman's bandwidth: 0.9 min(sd, IQR / 1.34) n^(-1/5)", () => {
  const values = sortedFinite([1, 2, 3, 4, 5]);
  near(bandwidth(values), 0.9 * Math.min(Math.sqrt(2.5), 2 / 1.34) * 5 ** -0.2);
  assert.equal(bandwidth(sortedFinite([2, 2, 2])), 0);
});

test("poses follow the quaternion convention qw qx qy qz", () => {
  const half = Math.SQRT1_2;
  const quarterTurn = poseAt([1, 2, 3, half, 0, 0, half], 0);
  apply(quarterTurn, [1, 0, 0]).forEach((value, i) => near(value, [1, 3, 3][i]));
  const twice = compose(quarterTurn, quarterTurn);
  apply(twice, [1, 0, 0]).forEach((value, i) => near(value, apply(quarterTurn, apply(quarterTurn, [1, 0, 0]))[i]));
  const cloud = { origin: [10, 20, 30], step: [0.1, 0.2, 0.3], positions: Uint16Array.of(1, 2, 3, 4, 5, 6) };
  apply(dequantise(cloud), [4, 5, 6]).forEach((value, i) => near(value, positionOf(cloud, 1)[i], 1e-9));
});

test("a similarity scales before it rotates and translates", () => {
  const half = Math.SQRT1_2;
  const poses = [0, 0, 0, 1, 0, 0, 0, 1, 2, 3, half, 0, 0, half];
  const turned = apply(similarityAt(poses, [1, 2], 1), [1, 0, 0]);
  [1, 4, 3].forEach((value, axis) => near(turned[axis], value));
  assert.deepEqual(similarityAt(poses, null, 1), poseAt(poses, 1));
  near(scaleOf(similarityAt(poses, [1, 2], 1)), 2);
});

test("numbers are short and honest", () => {
  assert.equal(formatNumber(0.0034319), "0.003432");
  assert.equal(formatNumber(-2.5), "\u22122.5");
  assert.equal(formatNumber(1234567), "1\u202f234\u202f567");
  assert.equal(formatNumber(0.0000123), "1.23×10⁻⁵");
  assert.equal(formatNumber(null), "–");
  assert.equal(formatNumber(NaN), "–");
  assert.equal(formatNumber(0), "0");
  assert.equal(formatFixed(5.34268, 2), "5.34");
  assert.equal(formatFixed(-0.001, 2), "0.00");
  assert.equal(formatLength(0.0123, "m"), "1.23 cm");
  assert.equal(formatLength(0.0023, "m"), "2.3 mm");
  assert.equal(formatLength(2, "mapunits"), "2 map units");
  assert.equal(niceBelow(0.73), 0.5);
  assert.deepEqual(labelOf("translation_error_m"), { label: "Translation error", unit: "m" });
  assert.equal(idText(Uint32Array.of(1, 0, 5, 1), 1), "4294967301");
});

test("cells sort as numbers and words, missing ones last either way", () => {
  const sorted = (cells, direction) => [...cells].sort((a, b) => compareCells(a, b, direction));
  assert.deepEqual(sorted([10, null, 9, 2.5], "ascending"), [2.5, 9, 10, null]);
  assert.deepEqual(sorted([10, null, 9, 2.5], "descending"), [10, 9, 2.5, null]);
  assert.deepEqual(sorted(["k10", "k9", null], "ascending"), ["k9", "k10", null]);
  const table = { columns: [{}, {}, {}], rows: [["a", 2, 5], ["b", 1, null], ["c", 3, 7]], best: [null, "low", "high"] };
  assert.deepEqual(bestValues(table), [null, 1, 7]);
});

test("CSV quotes, keeps precision and defuses formulas", () => {
  assert.equal(toCsv([["a", 'say "x"', "1,2"], [0.1 + 0.2, null, NaN], ["=1+1", "-2", -2]]), 'a,"say ""x""","1,2"\r\n0.30000000000000004,,\r\n\'=1+1,\'-2,-2\r\n');
});

test("commands are quoted for a shell", () => {
  assert.equal(shellCommand(["cairn", "a b", "it's"]), "cairn 'a b' 'it'\\''s'");
});

test("colour scales cover both maps and give round ticks", () => {
  const cloud = (values) => ({ columns: [{ name: "n", label: "N", unit: null, scale: 2, offset: 1, values: Uint8Array.from(values) }] });
  const scale = columnScale([cloud([0, 1, 2]), null, cloud([10, 20])], "n", null);
  near(scale.low, 1.08, 1e-9);
  near(scale.high, 40.6, 1e-9);
  assert.equal(scale.log, true);
  assert.equal(columnScale([cloud([0])], "absent", null), null);
  const linear = { ...scale, low: 0, high: 10, log: false };
  assert.deepEqual(scaleTicks(linear).map(({ value }) => value), [0, 2, 4, 6, 8, 10]);
  assert.equal(levelOf(5, linear), 127);
  assert.equal(levelOf(NaN, linear), 255);
  assert.equal(levelOf(99, linear), 254);
});

test("picking prefers the point drawn in front, then the closest", () => {
  // Clip space that shows x and y from 0 to 100 as they are, with depth z.
  const elements = [2 / 100, 0, 0, 0, 0, -2 / 100, 0, 0, 0, 0, 0, 0.001, -1, 1, 0, 1];
  const positions = Uint16Array.of(50, 50, 900, 51, 50, 100, 70, 70, 0);
  const layers = [{ role: "target", cloud: { count: 3, positions }, clipFromStored: { elements } }];
  const at = (x, y) => pickLandmark(layers, x, y, 100, 100, 0, 6);
  assert.deepEqual(at(70, 70), { role: "target", index: 2, distance: 0 });
  near(at(73, 74).distance, 5, 1e-6);
  assert.equal(at(5, 95), null);
  const depth = elements.map((entry, i) => (i === 11 ? 1e-9 : entry));
  assert.equal(pickLandmark([{ ...layers[0], clipFromStored: { elements: depth } }], 50.4, 50, 100, 100, 3, 6).index, 1);
});

test("through a keyframe a landmark is seen where its image has it, at any scale of the map and shape of the view", () => {
  const targetFromMap = poseOf([1, -2, 0.5], [0.6, 0, 0.8, 0], 2.5);
  const mapFromCamera = poseOf([0.2, 0.1, -3], [0.5, -0.5, 0.5, 0.5]);
  const pose = compose(targetFromMap, mapFromCamera);
  const frustum = { halfWidth: 0.6, halfHeight: 0.45 };
  const centre = [4, 5, 6];
  for (const [width, height] of [[800, 400], [300, 700]]) {
    const camera = new PerspectiveCamera();
    lookThrough(camera, pose, centre, frustum, width / height, 10);
    const [x, y, w, h] = imageRectangle(camera, frustum, width, height);
    near(w / h, 0.6 / 0.45, 1e-9);
    assert.ok(x > 0 && y > 0 && x + w < width && y + h < height && Math.min(x / width, y / height) < 0.05, `${[x, y, w, h]}`);
    for (const [u, v, depth] of [[0, 0, 1], [0.6, 0.45, 2], [-0.6, 0.45, 0.3], [0.3, -0.2, 5]]) {
      const p = apply(pose, [u * depth, v * depth, depth]).map((value, axis) => value - centre[axis]);
      const seen = new Vector3(...p).project(camera);
      near((seen.x + 1) * 0.5 * width, x + w * (0.5 + u / 1.2), 1e-6);
      near((1 - seen.y) * 0.5 * height, y + h * (0.5 + v / 0.9), 1e-6);
    }
  }
});

test("a field of view that is none is replaced by a usual one", () => {
  const usual = frustumOf({ frustum: null });
  for (const halfWidth of [0, -1, NaN, Infinity, 1e9]) {
    assert.equal(frustumOf({ frustum: { halfWidth, halfHeight: 0.4 } }), usual);
  }
  assert.equal(frustumOf({ frustum: { halfWidth: 2, halfHeight: 0.4 } }).halfWidth, 2);
});

test("a keyframe is named by its id, and its time if that is known", () => {
  assert.equal(keyframeText({ ids: Uint32Array.of(7, 0, 9, 0), timestamps: Float64Array.of(NaN, 12.3456) }, 1), "9 · 12.346 s");
  assert.equal(keyframeText({ ids: null, timestamps: Float64Array.of(NaN) }, 0), "0");
  assert.equal(keyframeText({ ids: null, timestamps: null }, 3), "3");
});

test("an orbit continues the view through a keyframe, with what is ahead at its size", () => {
  const orbit = new Orbit([0, 0, 1], [1, 0, 0]);
  const camera = new PerspectiveCamera();
  lookThrough(camera, poseOf([1, 2, 3], [0.6, 0.2, -0.7, 0.1]), [0, 0, 0], { halfWidth: 0.6, halfHeight: 0.45 }, 1.5, 10);
  const forward = camera.getWorldDirection(new Vector3());
  const ahead = camera.position.clone().addScaledVector(forward, 4);
  const size = (by) => 1 / (by.position.distanceTo(ahead) * Math.tan((by.fov * Math.PI) / 360));
  const before = size(camera);
  const right = new Vector3(1, 0, 0).applyQuaternion(camera.quaternion);
  const state = orbit.continuing(camera, 4);
  orbit.place(camera, state, 1.5, 10);
  const after = camera.getWorldDirection(new Vector3());
  near(after.distanceTo(forward), 0, 1e-9);
  near(new Vector3(1, 0, 0).applyQuaternion(camera.quaternion).distanceTo(right), 0, 1e-9);
  near(new Vector3(...state.target).distanceTo(ahead), 0, 1e-9);
  near(size(camera), before, 1e-9);
});

test("in a rolled view too, what is dragged follows the pointer", () => {
  const orbit = new Orbit([0, 0, 1], [1, 0, 0]);
  for (const roll of [0, 0.7, Math.PI / 2, -2.5]) {
    const screen = (state, p) => {
      const camera = new PerspectiveCamera();
      orbit.place(camera, state, 1, 10);
      return new Vector3(...p).project(camera);
    };
    for (const [gesture, sign] of [["rotate", [-1, 1]], ["pan", [1, 1]]]) {
      for (const [dx, dy] of [[1e-4, 0], [0, 1e-4]]) {
        const state = { target: [0, 0, 0], distance: 5, azimuth: 0.4, elevation: 0, roll };
        // In front of what is looked at, so that turning moves it with the pointer.
        const eye = new PerspectiveCamera();
        orbit.place(eye, state, 1, 10);
        const point = eye.position.clone().multiplyScalar(0.2).toArray();
        const before = screen(state, point);
        orbit[gesture](state, sign[0] * dx, sign[1] * dy);
        const moved = screen(state, point).sub(before);
        const along = (moved.x * dx - moved.y * dy) / Math.hypot(dx, dy);
        const across = Math.abs(moved.x * dy + moved.y * dx) / Math.hypot(dx, dy);
        assert.ok(along > 0 && across < 1e-3 * along, `${gesture} at ${roll}: ${along} along, ${across} across`);
      }
    }
  }
});

test("places in a graph keep their proportions and stand apart", () => {
  const far = spread([{ x: 0, y: 0 }, { x: 4, y: 0 }, { x: 4, y: 2 }], 400, 300, 50);
  assert.deepEqual(far.map(({ x, y }) => [Math.round(x), Math.round(y)]), [[0, 50], [400, 50], [400, 250]]);
  const near = spread(Array.from({ length: 9 }, () => ({ x: 1, y: 1 })), 400, 300, 50);
  for (const [i, a] of near.entries()) {
    assert.ok(a.x >= 0 && a.x <= 400 && a.y >= 0 && a.y <= 300);
    for (const b of near.slice(i + 1)) {
      assert.ok(Math.hypot(a.x - b.x, a.y - b.y) > 40);
    }
  }
  assert.deepEqual(spread([], 10, 10, 1), []);
});

test("seen from above, x points right and y away", () => {
  const [east, north] = fromAbove([[1, 0, 5], [0, 1, -2]], [0, 0, 1]);
  assert.ok(Math.abs(east.x - 1) < 1e-12 && Math.abs(east.y) < 1e-12, JSON.stringify(east));
  assert.ok(Math.abs(north.x) < 1e-12 && Math.abs(north.y + 1) < 1e-12, JSON.stringify(north));
});

test("durations are read at a glance", () => {
  assert.deepEqual([0.25, 59.94, 60, 200, 3600, 90061].map(durationText), ["0.25 s", "59.9 s", "1 min", "3 min 20 s", "1 h", "1 d 1 h"]);
});

test("a probability below 1 never reads 100 %", () => {
  assert.equal(formatProbability(0.00102), "0.10 %");
  assert.equal(formatProbability(0.9983), "99.83 %");
  assert.equal(formatProbability(0.99996), "99.9960 %");
  assert.equal(formatProbability(1 - 1e-12), ">99.9999 %");
  assert.equal(formatProbability(1e-9), "<0.01 %");
  assert.equal(formatProbability(0), "<0.01 %");
  assert.equal(formatShare(0.5), "50 %");
  assert.equal(formatShare(0.3364), "33.6 %");
});

test("angles are those of Rz(yaw) Ry(pitch) Rx(roll), and poses differ by an angle and a length", () => {
  const quarter = Math.SQRT1_2;
  const turned = poseOf([1, 2, 2], [quarter, 0, 0, quarter], 2);
  const [roll, pitch, yaw] = rollPitchYaw(turned);
  near(roll, 0, 1e-9);
  near(pitch, 0, 1e-9);
  near(yaw, 90, 1e-9);
  const difference = differenceOf(turned, poseOf([0, 0, 0], [1, 0, 0, 0]));
  near(difference.rotationDeg, 90, 1e-9);
  near(difference.translation, 3);
});

test("units of plain text read as people write them", () => {
  assert.equal(unitText("10^-3 m^2"), "10⁻³ m²");
  assert.equal(unitText("%"), "%");
});

test("an axis from zero holds zero and all values", () => {
  const [low, high] = extentFromZero([0.0186, 0.01862, NaN]);
  assert.equal(low, 0);
  assert.ok(high > 0.01862 && high < 0.02);
  assert.deepEqual(extentFromZero([0, 0]), [0, 1]);
  assert.ok(extentFromZero([-3, -1])[0] < -3 && extentFromZero([-3, -1])[1] >= 0);
});

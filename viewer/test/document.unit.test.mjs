// SPDX-License-Identifier: BSD-3-Clause
import assert from "node:assert/strict";
import { test } from "node:test";
import { gzipSync } from "node:zlib";
import { answerSample, BufferWriter, encodeMatches, hostileSample, networkSample, random, smallSample } from "./sample.mjs";
import { loadModule } from "./support/load_module.mjs";

const { parseReport } = await loadModule("src/document/report.ts");
const { Buffers } = await loadModule("src/document/buffers.ts");
const { Field } = await loadModule("src/document/field.ts");
const { MatchTimeline } = await loadModule("src/document/matches.ts");
const { decodeBase64, gunzip } = await loadModule("src/document/embedded.ts");

const kMinimal = { schema: { name: "cairn.report", version: 1 }, title: "t", sections: [] };
const toArrayBuffer = (buffer) => buffer.buffer.slice(buffer.byteOffset, buffer.byteOffset + buffer.byteLength);
const parse = (document, bytes = new ArrayBuffer(0)) => parseReport(JSON.stringify(document), bytes);
const sample = smallSample();

test("every buffer type reads back what was written", () => {
  const arrays = [
    Uint8Array.of(0, 255, 3), Int8Array.of(-128, 127), Uint16Array.of(0, 65535, 7), Int16Array.of(-32768, 32767, 1),
    Uint32Array.of(0, 4294967295), Int32Array.of(-2147483648, 2147483647), Float32Array.of(1.5, -0.25, Infinity), Float64Array.of(Math.PI, NaN, -1e300),
  ];
  const writer = new BufferWriter();
  const references = arrays.map((array) => writer.add(array));
  const buffers = new Buffers(toArrayBuffer(writer.bytes()));
  references.forEach((reference, i) => {
    const read = buffers.read(new Field(reference, "b"), [reference.type], arrays[i].length);
    assert.deepEqual([...read], [...arrays[i]]);
    assert.equal(read.constructor, arrays[i].constructor);
  });
});

test("a buffer that ends outside the report is refused by name", () => {
  const buffers = new Buffers(new ArrayBuffer(16));
  const read = (reference, types = ["u16"], count = undefined) => () => buffers.read(new Field(reference, "maps[0].positions"), types, count);
  assert.throws(read({ offset: 8, count: 5, type: "u16" }), /maps\[0\]\.positions: the buffer ends at byte 18.*16 bytes.*complete/s);
  assert.throws(read({ offset: 1e15, count: 1, type: "u16" }), /ends at byte/);
  assert.throws(read({ offset: 4, count: 1, type: "u16" }), /not a multiple of 8/);
  assert.throws(read({ offset: -8, count: 1, type: "u16" }), /offset: expected a count/);
  assert.throws(read({ offset: 0, count: 1.5, type: "u16" }), /count: expected a count/);
  assert.throws(read({ offset: 0, count: 1, type: "f16" }), /type: expected "u16", found "f16"/);
  assert.throws(read({ offset: 0, count: 2, type: "u16" }, ["u16"], 3), /expected 3 elements, found 2/);
  assert.throws(read(null), /expected an object, found null/);
});

test("another schema and a newer version are refused by name", () => {
  assert.throws(() => parse({ ...kMinimal, schema: { name: "cairn.align", version: 1 } }), /not "cairn\.align"/);
  assert.throws(() => parse({ ...kMinimal, schema: { name: "cairn.report", version: 2 } }), /up to version 1.*is version 2/);
  assert.throws(() => parse({ title: "x" }), /schema: expected an object, found nothing/);
  assert.throws(() => parseReport("{", new ArrayBuffer(0)), /not JSON/);
});

test("a minimal document is a report", () => {
  const report = parse(kMinimal);
  assert.equal(report.title, "t");
  assert.equal(report.subtitle, null);
  assert.equal(report.provenance, null);
});

test("the small sample decodes, unknown kinds become notices", () => {
  const report = parseReport(JSON.stringify(sample.document), toArrayBuffer(sample.buffers));
  const kinds = report.sections.map(({ kind }) => kind);
  assert.deepEqual([...new Set(kinds)].sort(), ["chart", "notice", "scene", "table", "text"]);
  const notices = report.sections.filter(({ kind }) => kind === "notice");
  assert.equal(notices.length, 1);
  assert.match(notices[0].message, /hologram/);
  assert.equal(notices[0].severity, "unknown");
  const scene = report.sections[0];
  assert.equal(scene.runs.length, 4);
  assert.equal(scene.source.count, 900);
  assert.equal(scene.runs[0].poses.length, 7 * (scene.runs[0].iterations + 1));
});

test("an answer reads back, and what is wrong with one is said by name", () => {
  const { document, buffers } = answerSample();
  const [answer] = parseReport(JSON.stringify(document), toArrayBuffer(buffers)).sections;
  assert.equal(answer.kind, "answer");
  assert.equal(answer.scene, "scene");
  assert.deepEqual(answer.alignments.map(({ status, judged }) => [status, judged]), [["aligned", true], ["ambiguous", true], ["rejected", true], ["converged", false]]);
  assert.deepEqual(answer.alignments[1].open[0], { translation: [0, 1, 0], rotation: [0, 0, 0], logScale: 0 });
  assert.deepEqual(answer.alignments[0].deviations.rotationDeg, [0.05, 0.02, 0.11]);
  assert.equal(answer.alignments[0].candidates[0].evidence.length, 2);
  assert.equal(answer.alignments[3].candidates.length, 0);
  const broken = (change) => {
    const copy = structuredClone(document);
    change(copy.sections[0].alignments[0]);
    return parseReport(JSON.stringify(copy), toArrayBuffer(buffers)).sections[0].message;
  };
  assert.match(broken((one) => one.estimate.pose.pop()), /alignments\[0\]\.estimate\.pose: expected 7 entries, found 6/);
  assert.match(broken((one) => (one.judged = "yes")), /judged: expected true or false/);
  assert.match(broken((one) => (one.candidates[1].probability = null)), /candidates\[1\]\.probability: expected a number/);
});

test("images of keyframes read back, and what is none is refused by name", () => {
  const maps = parseReport(JSON.stringify(sample.document), toArrayBuffer(sample.buffers)).sections[0];
  assert.deepEqual([...maps.source.frames.images.keys()], [0, 10, 20, 30, 40, 50]);
  assert.equal(maps.source.frames.images.get(10).mediaType, "image/png");
  assert.equal(maps.target.frames.images.size, 0, "a map of an earlier version has none");
  const broken = (change) => {
    const copy = structuredClone(sample.document);
    change(copy.maps[0].frames.images);
    return parseReport(JSON.stringify(copy), toArrayBuffer(sample.buffers)).sections[0].message;
  };
  assert.match(broken((images) => (images[1].frame = 60)), /frames\.images\[1\]\.frame: expected one of 60 frames.*found 60/);
  assert.match(broken((images) => (images[1].frame = 0)), /images\[1\]\.frame: expected one of 60 frames that has no other image, found 0/);
  assert.match(broken((images) => (images[1].frame = -1)), /frame: expected a count/);
  assert.match(broken((images) => (images[0].media_type = "image/svg+xml")), /media_type: expected "image\/png" or "image\/jpeg"/);
  assert.match(broken((images) => (images[0].media_type = "image/jpeg")), /images\[0\]\.data: the bytes are not an image\/jpeg/);
  assert.match(broken((images) => (images[0].data.count = 3)), /not an image\/png/);
  assert.match(broken((images) => (images[0].data.offset = 1e9)), /Is the file complete\?/);
  assert.match(broken((images) => (images[0] = "x")), /expected an object/);
});

test("a broken section says what is wrong and leaves the others alone", () => {
  const broken = structuredClone(sample.document);
  broken.sections[0].runs[1].poses.count = 15;
  broken.sections[1].groups = 3;
  const report = parseReport(JSON.stringify(broken), toArrayBuffer(sample.buffers));
  assert.match(report.sections[0].message, /runs\[1\]\.poses: expected seven numbers/);
  assert.match(report.sections[1].message, /groups: expected a list, found 3/);
  assert.equal(report.sections[2].kind, "chart");
});

test("truncated buffers break the scenes that need them, with a reason", () => {
  const report = parseReport(JSON.stringify(sample.document), toArrayBuffer(sample.buffers.subarray(0, 1000)));
  assert.match(report.sections[0].message, /Is the file complete\?/);
  assert.equal(report.sections[1].kind, "chart");
});

test("section ids must be plain and unique", () => {
  const text = (id) => ({ kind: "text", id, title: "x", text: null });
  assert.throws(() => parse({ ...kMinimal, sections: [text("a"), text("a")] }), /taken/);
  assert.throws(() => parse({ ...kMinimal, sections: [text("a b")] }), /an id of/);
});

test("hostile names decode as text", () => {
  const hostile = hostileSample();
  const report = parseReport(JSON.stringify(hostile.document), toArrayBuffer(hostile.buffers));
  assert.equal(report.sections[0].kind, "scene");
  assert.equal(report.sections[0].target.columns[0].name, "__proto__");
  assert.match(report.sections.at(-1).message, /there is no map/);
});

test("delta-coded matches equal a plain history, in any order of visits", () => {
  const rng = random(99);
  const [count, targets, iterations] = [57, 40, 43];
  const history = [Int32Array.from({ length: count }, () => Math.floor(rng() * (targets + 1)) - 1)];
  while (history.length < iterations) {
    const next = history.at(-1).slice();
    for (let i = 0; i < 9; ++i) {
      next[Math.floor(rng() * count)] = Math.floor(rng() * (targets + 1)) - 1;
    }
    history.push(next);
  }
  const writer = new BufferWriter();
  const coded = encodeMatches(history, writer);
  const buffers = new Buffers(toArrayBuffer(writer.bytes()));
  const read = (name, type) => buffers.read(new Field(coded[name], name), [type]);
  const timeline = new MatchTimeline({ first: read("first", "i32"), changeCounts: read("change_counts", "u32"), changed: read("changed", "u32"), targets: read("targets", "i32") });
  assert.equal(timeline.iterations, iterations);
  const visits = [1, iterations, 1, ...Array.from({ length: 200 }, () => 1 + Math.floor(rng() * iterations)), iterations, iterations - 1];
  for (const iteration of visits) {
    assert.deepEqual([...timeline.at(iteration)], [...history[iteration - 1]], `iteration ${iteration}`);
  }
  assert.deepEqual([...timeline.at(iterations + 5)], [...history.at(-1)]);
  assert.deepEqual([...timeline.at(-3)], [...history[0]]);
});

test("matches that cannot be are refused", () => {
  const breakIt = (change) => {
    const broken = structuredClone(sample.document);
    const bytes = Buffer.from(sample.buffers);
    change(broken.sections[0].runs[0], bytes);
    return parseReport(JSON.stringify(broken), toArrayBuffer(bytes)).sections[0].message;
  };
  assert.match(breakIt((run) => (run.matches.change_counts.count -= 1)), /change_counts: expected \d+ elements/);
  assert.match(breakIt((run) => (run.matches.changed.count -= 1)), /add up to/);
  assert.match(breakIt((run, bytes) => bytes.writeInt32LE(5000, run.matches.first.offset)), /no target landmark 5000/);
  assert.match(breakIt((run, bytes) => bytes.writeUInt32LE(900, run.matches.changed.offset)), /no source landmark 900/);
  assert.match(breakIt((run, bytes) => bytes.writeInt32LE(-2, run.matches.targets.offset)), /no target landmark -2/);
});

test("base64 and gzip decode, and damage is reported", async () => {
  const bytes = Buffer.from(Array.from({ length: 1000 }, (_, i) => (i * 37) & 255));
  for (const size of [0, 1, 2, 3, 1000]) {
    const text = bytes.subarray(0, size).toString("base64");
    assert.deepEqual([...decodeBase64(text)], [...bytes.subarray(0, size)]);
    assert.deepEqual([...decodeBase64(text.replace(/(.{76})/g, "$1\n"))], [...bytes.subarray(0, size)]);
  }
  assert.throws(() => decodeBase64("AAA<AAA"), /character 3 is not base64/);
  const packed = new Uint8Array(gzipSync(bytes));
  assert.deepEqual(Buffer.from(await gunzip(packed, "It")), bytes);
  await assert.rejects(gunzip(packed.slice(0, 40), "The report's buffers"), /The report's buffers cannot be decompressed.*complete/);
});

test("a network reads back, and what is wrong with one is said by name", () => {
  const { document, buffers } = networkSample();
  const bytes = toArrayBuffer(buffers);
  const report = parse(document, bytes);
  const network = report.sections[0];
  assert.equal(network.kind, "network");
  assert.equal(network.nodes[1].cloud.name, "tuesday");
  assert.equal(network.nodes[1].poses.length, 7 * network.stages.length);
  assert.equal(network.nodes[4].group, null);
  assert.equal(network.nodes[4].poses, null);
  assert.equal(network.links[3].use, "contradicted");
  assert.deepEqual(network.links[3].view, { targetFrame: 5, sourceFrame: 0, matches: 1 });
  assert.equal(network.links[2].view, null);
  assert.equal(report.sections[1].chart.xScale, "log");
  assert.equal(report.sections[3].table.columns[2].type, "command");
  const broken = (change) => {
    const copy = structuredClone(document);
    change(copy.sections[0]);
    const section = parse(copy, bytes).sections[0];
    return section.kind === "notice" ? section.message : null;
  };
  assert.match(broken((one) => (one.links[0].target = 5)), /links\[0\]\.target: expected one of 5 maps, found 5/);
  assert.match(broken((one) => (one.nodes[0].group = 1)), /nodes\[0\]\.group: expected one of 1 groups/);
  assert.match(broken((one) => one.stages.pop()), /poses: expected 14 elements, found 21/);
  assert.match(broken((one) => (one.stages = [])), /at least one stage/);
  assert.match(broken((one) => (one.nodes[0].map = "nowhere")), /there is no map "nowhere"/);
  assert.match(broken((one) => (one.links[0].view.matches = -1)), /links\[0\]\.view\.matches: expected a count/);
  assert.match(broken((one) => (one.links[0].use = "maybe")), /use: expected "used" or/);
});

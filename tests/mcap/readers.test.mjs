// SPDX-License-Identifier: BSD-3-Clause
// Reads what `cairn` writes as MCAP with the two readers of @mcap/core, decodes it by the descriptors in the file,
// and holds it against the public JSON schemas of Foxglove.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { test } from "node:test";

const require = createRequire(import.meta.url);
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { crc32 } = require("@foxglove/crc");
const foxglove = require("@foxglove/schemas/jsonschema.js");
const protobuf = require("protobufjs");
const { FileDescriptorSet } = require("protobufjs/ext/descriptor.js");

const cairn = (...words) =>
  execFileSync(process.env.CAIRN_TOOL, words, { encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });

/** All records of a file, front to back; the reader checks the checksums of the chunks. */
function recordsOf(bytes) {
  const reader = new McapStreamReader({ validateCrcs: true });
  const records = [];
  // In pieces, as from a network.
  for (let at = 0; at < bytes.length; at += 50_000) {
    reader.append(bytes.subarray(at, at + 50_000));
    for (let record; (record = reader.nextRecord()); ) {
      records.push(record);
    }
  }
  assert.ok(reader.done(), "the file ends with its footer");
  assert.equal(reader.bytesRemaining(), 0);
  return records;
}

/** Opens a file by its summary, whose checksum the reader checks. */
function indexed(bytes) {
  return McapIndexedReader.Initialize({
    readable: {
      size: async () => BigInt(bytes.length),
      read: async (offset, size) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + size))),
    },
  });
}

/** The value of a message as the JSON schema has it: refuses names and types that the schema does not know. */
function expectSchema(value, schema, path) {
  if (schema.title === "time") {
    assert.deepEqual(Object.keys(value).sort(), ["nanos", "seconds"], path);
    assert.ok(value.seconds >= 0 && value.nanos >= 0 && value.nanos <= 999_999_999, path);
  } else if (schema.oneOf) {
    assert.ok(
      schema.oneOf.some((one) => one.const === value),
      `${path}: ${value} is no value of the enum`,
    );
  } else if (schema.type === "object") {
    for (const [key, one] of Object.entries(value)) {
      assert.ok(key in schema.properties, `${path}.${key} is in no schema`);
      expectSchema(one, schema.properties[key], `${path}.${key}`);
    }
  } else if (schema.type === "array") {
    value.forEach((one, i) => expectSchema(one, schema.items, `${path}[${i}]`));
  } else if (schema.type === "integer") {
    assert.ok(Number.isInteger(value), path);
  } else {
    assert.equal(typeof value, schema.type, path);
    if (schema.contentEncoding === "base64") {
      assert.equal(Buffer.from(value, "base64").toString("base64"), value, path);
    }
  }
}

/** A recording: its messages decoded, with topic, schema and time, in the order of time. */
async function read(path) {
  const bytes = readFileSync(path);
  const records = recordsOf(bytes);
  const reader = await indexed(bytes);
  const dataEnd = records.find(({ type }) => type === "DataEnd");
  assert.equal(dataEnd.dataSectionCrc, crc32(bytes.subarray(0, Number(reader.dataEndOffset))));
  assert.notEqual(dataEnd.dataSectionCrc, 0);
  assert.notEqual(reader.footer.summaryCrc, 0);

  const streamed = records.filter(({ type }) => type === "Message");
  const messages = [];
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    messages.push(message);
  }
  const identity = ({ channelId, sequence, logTime, data }) => `${channelId} ${sequence} ${logTime} ${crc32(data)}`;
  assert.deepEqual(messages.map(identity).sort(), streamed.map(identity).sort());
  messages.forEach(({ logTime }, i) => assert.ok(i === 0 || messages[i - 1].logTime <= logTime));

  const { statistics } = reader;
  assert.equal(statistics.messageCount, BigInt(messages.length));
  assert.equal(statistics.channelCount, reader.channelsById.size);
  assert.equal(statistics.schemaCount, reader.schemasById.size);
  assert.equal(statistics.chunkCount, reader.chunkIndexes.length);
  assert.equal(statistics.messageStartTime, messages[0].logTime);
  assert.equal(statistics.messageEndTime, messages.at(-1).logTime);
  for (const [id, count] of statistics.channelMessageCounts) {
    assert.equal(count, BigInt(messages.filter(({ channelId }) => channelId === id).length));
  }

  const types = new Map();
  for (const [id, schema] of reader.schemasById) {
    assert.equal(schema.encoding, "protobuf");
    const root = protobuf.Root.fromDescriptor(FileDescriptorSet.decode(schema.data));
    root.resolveAll();
    types.set(id, root.lookupType(schema.name));
  }
  return messages.map(({ channelId, logTime, publishTime, data }) => {
    const channel = reader.channelsById.get(channelId);
    assert.equal(channel.messageEncoding, "protobuf");
    assert.equal(publishTime, logTime);
    const { name } = reader.schemasById.get(channel.schemaId);
    const type = types.get(channel.schemaId);
    const message = type.toObject(type.decode(data), { longs: Number, bytes: String, defaults: true });
    const schema = foxglove[name.replace("foxglove.", "")];
    assert.equal(schema.title, name);
    expectSchema(message, schema, name);
    return { topic: channel.topic, schema: name, time: logTime, message };
  });
}

const timeOf = ({ seconds, nanos }) => BigInt(seconds) * 1_000_000_000n + BigInt(nanos);

/** The points of a cloud as objects, by its own description of its fields. */
function pointsOf(cloud) {
  const bytes = Buffer.from(cloud.data, "base64");
  const readers = { 1: "readUInt8", 5: "readUInt32LE", 7: "readFloatLE", 8: "readDoubleLE" };
  const points = [];
  for (let at = 0; at < bytes.length; at += cloud.point_stride) {
    points.push(
      Object.fromEntries(cloud.fields.map(({ name, offset, type }) => [name, bytes[readers[type]](at + offset)])),
    );
  }
  return points;
}

// Numbers that look like noise and are the same each time.
function* noise(seed) {
  for (let state = seed; ; ) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    yield state / 2 ** 32;
  }
}

/** Writes a map in Cairn's text. @return what it holds */
function writeMap(path, { seed, count, frames }) {
  const random = noise(seed);
  const next = () => random.next().value;
  const lines = ["CAIRN 2", "CAMERA 1 PINHOLE 640 480 500 500 320 240", "COLUMN confidence"];
  const poses = Array.from({ length: frames }, (_, i) => ({ time: 1000 + 0.125 * i, at: [0.5 * i, next(), next()] }));
  poses.forEach(({ time, at }, i) =>
    lines.push(`FRAME ${i} ${at.join(" ")} 1 0 0 0`, `TIME ${i} ${time}`, `VIEW ${i} 1`),
  );
  const landmarks = Array.from({ length: count }, (_, id) => ({
    id,
    at: [10 * next(), 10 * next() - 5, 3 + next()],
    color: [next(), next(), next()].map((share) => Math.floor(256 * share)),
    confidence: next(),
  }));
  for (const { id, at, color, confidence } of landmarks) {
    lines.push(`LANDMARK ${id} ${at.join(" ")} 1e-4 0 0 0 2e-4 0 0 0 3e-4 1 0 100 100`);
    lines.push(`COLOR ${id} ${color.join(" ")}`, `VALUE ${id} confidence ${confidence}`);
  }
  writeFileSync(path, lines.join("\n") + "\n");
  return { poses, landmarks };
}

test("a map is read as it is", async () => {
  const { poses, landmarks } = writeMap("desk.map", { seed: 1, count: 30_000, frames: 200 });
  cairn("convert", "desk.map", "desk.mcap");
  const messages = await read("desk.mcap");
  const of = (topic) => messages.filter((message) => message.topic === topic);
  assert.equal(messages.length, 3 + poses.length);

  const [cloud] = of("/landmarks");
  assert.equal(cloud.schema, "foxglove.PointCloud");
  assert.equal(cloud.message.frame_id, "world");
  const points = pointsOf(cloud.message);
  assert.equal(points.length, landmarks.length);
  landmarks.forEach(({ id, at, color, confidence }, i) => {
    const point = points[i];
    assert.deepEqual([point.x, point.y, point.z], at.map(Math.fround));
    assert.deepEqual([point.red, point.green, point.blue, point.alpha], [...color, 255]);
    assert.deepEqual([point.id, point.observations, point.confidence], [id, 1, confidence]);
    assert.deepEqual([point.cov_xx, point.cov_xy, point.cov_yy, point.cov_zz], [1e-4, 0, 2e-4, 3e-4]);
  });

  const transforms = of("/tf");
  assert.equal(transforms.length, poses.length);
  transforms.forEach(({ schema, time, message }, i) => {
    assert.equal(schema, "foxglove.FrameTransform");
    assert.equal(time, BigInt(1e9 * poses[i].time));
    assert.equal(timeOf(message.timestamp), time);
    assert.deepEqual([message.parent_frame_id, message.child_frame_id], ["world", "camera"]);
    assert.deepEqual(Object.values(message.translation), poses[i].at);
    assert.deepEqual(message.rotation, { x: 0, y: 0, z: 0, w: 1 });
  });

  const [trajectory] = of("/trajectory");
  const [line] = trajectory.message.entities[0].lines;
  assert.equal(line.type, 0);
  assert.deepEqual(
    line.points.map((point) => Object.values(point)),
    poses.map(({ at }) => at),
  );
  const [keyframes] = of("/keyframes");
  const [frusta] = keyframes.message.entities[0].lines;
  assert.equal(frusta.type, 2);
  assert.equal(frusta.points.length, 5 * poses.length);
  assert.equal(frusta.indices.length, 16 * poses.length);
  assert.ok(frusta.indices.every((index) => index < frusta.points.length));
  for (const { time } of [cloud, trajectory, keyframes]) {
    assert.equal(time, 1000n * 1_000_000_000n);
  }
});

test("damage is seen", async () => {
  writeMap("small.map", { seed: 2, count: 100, frames: 3 });
  cairn("convert", "small.map", "small.mcap");
  const bytes = readFileSync("small.mcap");
  const reader = await indexed(bytes);
  const middle = Number(reader.chunkIndexes[0].chunkStartOffset + reader.chunkIndexes[0].chunkLength / 2n);
  const damaged = Buffer.from(bytes);
  damaged[middle] ^= 1;
  assert.throws(() => recordsOf(damaged), /Incorrect chunk CRC/);
  const lost = Buffer.from(bytes);
  lost[Number(reader.footer.summaryStart) + 12] ^= 1;
  await assert.rejects(indexed(lost), /Incorrect summary CRC/);
});

test(
  "an atlas is read as it is",
  { skip: process.env.CAIRN_HAS_ATLAS !== "1" && "built without atlases" },
  async () => {
    const maps = ["monday", "tuesday"].map((name, i) => ({
      name,
      ...writeMap(`${name}.map`, { seed: 3 + i, count: 50, frames: 4 }),
    }));
    writeFileSync("pose.txt", "0 -1 0 5\n1 0 0 6\n0 0 1 7\n0 0 0 1\n");
    const atlas = ["--atlas", "town.atlas"];
    cairn("atlas", "init", ...atlas);
    cairn("atlas", "add", "monday.map", "tuesday.map", ...atlas);
    cairn("atlas", "link", "--manual", "monday", "tuesday", "--pose", "pose.txt", ...atlas);
    cairn("atlas", "optimize", ...atlas);
    cairn("atlas", "export", "-o", "town.mcap", ...atlas);
    const messages = await read("town.mcap");
    const of = (topic) => messages.filter((message) => message.topic === topic);
    for (const { name, landmarks } of maps) {
      const [cloud] = of(`/map/${name}/landmarks`);
      assert.equal(cloud.message.frame_id, `map/${name}`);
      assert.deepEqual(
        pointsOf(cloud.message).map(({ x, y, z }) => [x, y, z]),
        landmarks.map(({ at }) => at.map(Math.fround)),
      );
      assert.equal(of(`/map/${name}/trajectory`).length, 1);
    }
    const [first, second] = of("/tf").map(({ message }) => message);
    assert.deepEqual([first.child_frame_id, second.child_frame_id], ["map/monday", "map/tuesday"]);
    [5, 6, 7].forEach((expected, i) => assert.ok(Math.abs(Object.values(second.translation)[i] - expected) < 1e-9));
    assert.ok(Math.abs(second.rotation.z - Math.SQRT1_2) < 1e-9);
    const [links] = of("/links");
    assert.equal(links.message.entities.length, 1);
    const words = Object.fromEntries(links.message.entities[0].metadata.map(({ key, value }) => [key, value]));
    assert.deepEqual([words.target, words.source, words.kind], ["monday", "tuesday", "manual"]);
  },
);

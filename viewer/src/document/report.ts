// SPDX-License-Identifier: BSD-3-Clause
// Reads what docs/report_format.md specifies. Numbers that were null are NaN where only numbers make sense.
import { Buffers } from "./buffers";
import { ReportError, messageOf } from "./errors";
import { Field, anything, count, list, listOrEmpty, number, numbers, object, oneOf, orElse, orNull } from "./field";
import { text, truth, type Reader } from "./field";
import { validateMatches, type Matches } from "./matches";

const kSchema = "cairn.report";
const kVersion = 1;

export type Vector3 = readonly [number, number, number];
const vector: Reader<Vector3> = (field) => list(number, 3)(field) as unknown as Vector3;
const lengthUnit = oneOf("m", "mapunits");

export type Report = ReturnType<typeof parseReport>;

/**
 * Decodes a whole document. Another schema, a newer version or a document that is no document throws; a section
 * that is broken or unknown becomes a notice in its place, so that the rest of the report stays readable.
 */
export function parseReport(json: string, bytes: ArrayBuffer) {
  let value: unknown;
  try {
    value = JSON.parse(json);
  } catch (error) {
    throw new ReportError(`The report's document is not JSON: ${messageOf(error)}.`);
  }
  const document = new Field(value, "");
  checkSchema(document.get("schema"));
  const buffers = new Buffers(bytes);
  const readers = sectionReaders(buffers, mapLookup(document.get("maps"), buffers));
  const taken = new Set<string>();
  return object({
    cairnVersion: orNull(text),
    title: text,
    subtitle: orNull(text),
    provenance: orNull(provenance),
    sections: list((section) => parseSection(section, readers, taken)),
  })(document);
}

function checkSchema(schema: Field): void {
  const name = text(schema.get("name"));
  if (name !== kSchema) {
    throw new ReportError(`This page shows "${kSchema}" documents, not "${name}".`);
  }
  const version = count(schema.get("version"));
  if (version < 1 || version > kVersion) {
    throw new ReportError(
      `This page reads ${kSchema} up to version ${kVersion}; the document is version ${version}. ` +
        "Two different versions of Cairn produced it.",
    );
  }
}

export type Provenance = ReturnType<typeof provenance>;
const provenance = object({
  command: orNull(list(text)),
  seed: orNull(number),
  machine: anything,
  inputs: listOrEmpty(object({ role: orNull(text), path: orNull(text), hash: orNull(text), details: anything })),
  options: anything,
});

/** A map by its id, decoded once. */
function mapLookup(maps: Field, buffers: Buffers): Reader<LandmarkCloud> {
  const byId = new Map(listOrEmpty((field) => [text(field.get("id")), field] as const)(maps));
  const decoded = new Map<string, LandmarkCloud>();
  return (reference) => {
    const id = text(reference);
    const known = decoded.get(id);
    if (known) {
      return known;
    }
    const field = byId.get(id);
    if (!field) {
      throw new ReportError(`${reference.path}: there is no map "${id}" in this report.`);
    }
    const cloud = parseCloud(field, buffers);
    decoded.set(id, cloud);
    return cloud;
  };
}

export type LandmarkCloud = ReturnType<typeof parseCloud>;
function parseCloud(field: Field, buffers: Buffers) {
  const size = count(field.get("count"));
  return object({
    id: text,
    name: text,
    lengthUnit,
    count,
    origin: vector,
    step: vector,
    positions: buffers.reader(["u16", "u32"], 3 * size),
    /** Low and high word of each landmark's id, or null: ids are 0, 1, … */
    ids: orNull(buffers.reader(["u32"], 2 * size)),
    columns: listOrEmpty((column) => parseColumn(column, buffers, size)),
    colors: orNull(buffers.reader(["u8"], 3 * size)),
    ellipsoids: orNull((shapes) => parseEllipsoids(shapes, buffers, size)),
    frames: orNull((frames) => parseFrames(frames, buffers)),
  })(field);
}

export type Ellipsoids = ReturnType<typeof parseEllipsoids>;
function parseEllipsoids(field: Field, buffers: Buffers, size: number) {
  return object({
    /** xx yy zz xy xz yz, times 127, of the covariance divided by its largest variance. */
    covariances: buffers.reader(["i8"], 6 * size),
    /** The largest standard deviation is 2^(offset + scale · stored). */
    sigmas: buffers.reader(["u8"], size),
    scale: number,
    offset: number,
  })(field);
}

export type Column = ReturnType<typeof parseColumn>;
function parseColumn(field: Field, buffers: Buffers, size: number) {
  return object({
    name: text,
    label: orElse(text, text(field.get("name"))),
    unit: orNull(text),
    values: buffers.reader(["f32", "u8", "u16"], size),
    scale: orElse(number, 1),
    offset: orElse(number, 0),
  })(field);
}

export type Frames = ReturnType<typeof parseFrames>;
function parseFrames(field: Field, buffers: Buffers) {
  const size = count(field.get("count"));
  return object({
    count,
    /** tx ty tz qw qx qy qz, world_from_camera. */
    poses: buffers.reader(["f32"], 7 * size),
    ids: orNull(buffers.reader(["u32"], 2 * size)),
    timestamps: orNull(buffers.reader(["f64"], size)),
    /** Tangents of half the views; null if the camera is unknown. */
    frustum: orNull(object({ halfWidth: number, halfHeight: number })),
    /** By frame; those that have one. */
    images: (images) => parseFrameImages(images, buffers, size),
  })(field);
}

/** How a file of a media type begins. */
const kSignatures = { "image/png": [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a], "image/jpeg": [0xff, 0xd8, 0xff] };

/** What a frame's camera saw: it fills the frustum. */
export type FrameImage = ReturnType<typeof parseFrameImage>;
function parseFrameImage(field: Field, buffers: Buffers) {
  const image = object({ mediaType: oneOf("image/png", "image/jpeg"), data: buffers.reader(["u8"]) })(field);
  if (!kSignatures[image.mediaType].every((byte, i) => image.data[i] === byte)) {
    throw new ReportError(`${field.path}.data: the bytes are not an ${image.mediaType}.`);
  }
  return image;
}

function parseFrameImages(field: Field, buffers: Buffers, size: number): Map<number, FrameImage> {
  const images = new Map<number, FrameImage>();
  for (const image of listOrEmpty((one) => one)(field)) {
    const frame = count(image.get("frame"));
    if (frame >= size || images.has(frame)) {
      image.get("frame").fail(`one of ${size} frames that has no other image`);
    }
    images.set(frame, parseFrameImage(image, buffers));
  }
  return images;
}

type SectionReaders = ReturnType<typeof sectionReaders>;
type Kind = keyof SectionReaders;
type SectionHead = { id: string; title: string; text: string | null };
type SectionOf<K extends Kind> = SectionHead & { kind: K } & ReturnType<SectionReaders[K]>;
export type SceneSection = SectionOf<"scene">;
export type ChartSection = SectionOf<"chart">;
export type NetworkSection = SectionOf<"network">;
export type AnswerSection = SectionOf<"answer">;
/** A section that this viewer cannot show; the reason stands in its place. */
type NoticeSection = SectionHead & { kind: "notice"; severity: "unknown" | "broken"; message: string };
export type Section = { [K in Kind]: SectionOf<K> }[Kind] | NoticeSection;

/** By the kind of a section, what it has in addition to its head. */
function sectionReaders(buffers: Buffers, lookUp: Reader<LandmarkCloud>) {
  return {
    scene: (field: Field) => parseScene(field, buffers, lookUp),
    chart: (field: Field) => ({ chart: parseChart(field) }),
    table: (field: Field) => ({ table: parseTable(field) }),
    network: (field: Field) => parseNetwork(field, buffers, lookUp),
    answer: object({
      lengthUnit,
      /** Id of the scene that shows the poses. */
      scene: orNull(text),
      alignments: list(alignment),
    }),
    text: () => ({}),
  };
}

function parseSection(field: Field, readers: SectionReaders, taken: Set<string>): Section {
  const id = text(field.get("id"));
  if (!/^[a-z0-9-]+$/.test(id)) {
    field.get("id").fail("an id of a-z, 0-9 and -");
  }
  if (taken.has(id)) {
    throw new ReportError(`${field.path}.id: "${id}" is taken by another section.`);
  }
  taken.add(id);
  const head = object({ title: orElse(text, id), text: orNull(text), kind: text })(field);
  const notice = (severity: NoticeSection["severity"], message: string) =>
    ({ ...head, id, kind: "notice", severity, message }) as const;
  if (!Object.keys(readers).includes(head.kind)) {
    return notice("unknown", `This page does not support sections of this kind: "${head.kind}".`);
  }
  try {
    return { ...head, id, ...readers[head.kind as Kind](field) } as Section;
  } catch (error) {
    return notice("broken", messageOf(error));
  }
}

function parseScene(field: Field, buffers: Buffers, lookUp: Reader<LandmarkCloud>) {
  const target = lookUp(field.get("target"));
  const source = orNull(lookUp)(field.get("source"));
  const scene = object({
    /** target_from_source, row-major 4 x 4. */
    truth: orNull(list(number, 16)),
    up: orNull(vector),
    runs: listOrEmpty((run) => parseRun(run, buffers, source, target)),
  })(field);
  return { source, target, ...scene };
}

export type SummaryValue = string | number | null;
const summaryValue = (value: unknown): SummaryValue =>
  value === null || typeof value === "number" || typeof value === "string" ? value : (JSON.stringify(value) ?? null);

export type Run = ReturnType<typeof parseRun>;
function parseRun(field: Field, buffers: Buffers, source: LandmarkCloud | null, target: LandmarkCloud) {
  if (!source) {
    throw new ReportError(`${field.path}: an alignment needs a source map.`);
  }
  const { length } = buffers.read(field.get("poses"), ["f64"]);
  if (length === 0 || length % 7 !== 0) {
    throw new ReportError(`${field.path}.poses: expected seven numbers for every pose, found ${length}.`);
  }
  const iterations = length / 7 - 1;
  const perStep = orNull(buffers.reader(["f64"], length / 7));
  const run = object({
    name: text,
    summary: orElse(
      (summary) =>
        Object.entries(summary.object()).map(([key, value]): [string, SummaryValue] => [key, summaryValue(value)]),
      [],
    ),
    /** (iterations + 1) times tx ty tz qw qx qy qz of target_from_source. */
    poses: buffers.reader(["f64"]),
    /** Of the source at each pose; null where all are 1. */
    scales: perStep,
    meanSquaredDistance: perStep,
    scores: perStep,
    rotationErrorDeg: perStep,
    translationErrorM: perStep,
    matches: (matches) =>
      matches.isNull || iterations < 1 ? null : parseMatches(matches, buffers, iterations, source, target),
  })(field);
  return { ...run, iterations };
}

function parseMatches(
  field: Field,
  buffers: Buffers,
  iterations: number,
  source: LandmarkCloud,
  target: LandmarkCloud,
): Matches {
  const matches = object({
    first: buffers.reader(["i32"], source.count),
    changeCounts: buffers.reader(["u32"]),
    changed: buffers.reader(["u32"]),
    targets: buffers.reader(["i32"]),
  })(field);
  validateMatches(matches, iterations, source.count, target.count, field.path);
  return matches;
}

export type Threshold = NonNullable<ReturnType<typeof threshold>>;
const threshold = orNull(object({ value: number, label: orElse(text, "") }));
export type Scale = "linear" | "log";
const scale = orElse(oneOf("linear", "log"), "linear" as const);
const label = orNull(text);

/** As many `y` as `x`. */
function points(field: Field) {
  const x = numbers()(field.get("x"));
  return { name: text(field.get("name")), x, y: numbers(x.length)(field.get("y")) };
}

function labelledPoints(field: Field) {
  const series = points(field);
  return { ...series, labels: orNull(list(text, series.x.length))(field.get("labels")) };
}

function distribution(field: Field) {
  const values = numbers()(field.get("values"));
  return { name: text(field.get("name")), values, labels: orNull(list(text, values.length))(field.get("labels")) };
}

const edges: Reader<number[]> = (field) => {
  const values = numbers()(field);
  if (values.length < 2 || values.some((value, i) => !(i === 0 || value > values[i - 1]))) {
    field.fail("at least two increasing bin edges");
  }
  return values;
};

function heatmap(field: Field) {
  const [columns, rows] = [edges(field.get("x")).length - 1, edges(field.get("y")).length - 1];
  const grid = list(numbers(columns), rows);
  return object({
    xLabel: label,
    yLabel: label,
    valueLabel: label,
    /** Bin edges. */
    x: edges,
    y: edges,
    panels: list(object({ name: text, values: grid, counts: orNull(grid) })),
    range: orNull((range) => list(number, 2)(range) as [number, number]),
  })(field);
}

const interval = object({
  name: text,
  value: orElse(number, NaN),
  low: orElse(number, NaN),
  high: orElse(number, NaN),
});
const span = object({ name: text, start: number, end: number, marks: numbers() });

const kCharts = {
  violin: object({ xLabel: label, yLabel: label, yScale: scale, threshold, groups: list(distribution) }),
  lines: object({ xLabel: label, yLabel: label, yScale: scale, series: list(points) }),
  heatmap,
  intervals: object({ xLabel: label, xScale: scale, series: list(object({ name: text, items: list(interval) })) }),
  scatter: object({
    xLabel: label,
    yLabel: label,
    xScale: scale,
    yScale: scale,
    xThreshold: threshold,
    yThreshold: threshold,
    series: list(labelledPoints),
  }),
  /** Seconds since 1970, or since any start. */
  spans: object({ xLabel: label, series: list(object({ name: text, spans: list(span) })) }),
};

type Charts = { [K in keyof typeof kCharts]: { chart: K } & ReturnType<(typeof kCharts)[K]> };
export type Chart = Charts[keyof Charts];
export type ViolinChart = Charts["violin"];
export type LinesChart = Charts["lines"];
export type HeatmapChart = Charts["heatmap"];
export type IntervalsChart = Charts["intervals"];
export type ScatterChart = Charts["scatter"];
export type SpansChart = Charts["spans"];

function parseChart(field: Field): Chart {
  const chart = oneOf(...(Object.keys(kCharts) as (keyof Charts)[]))(field.get("chart"));
  return { chart, ...kCharts[chart](field) } as Chart;
}

export type Cell = string | number | null;
const cell: Reader<Cell> = (field) =>
  field.value === null || typeof field.value === "string" || typeof field.value === "number"
    ? field.value
    : field.fail("text, a number or null");

export type Table = ReturnType<typeof parseTable>;
function parseTable(field: Field) {
  const size = field.get("columns").list().length;
  return object({
    columns: list(
      object({
        name: text,
        unit: orNull(text),
        /** A command is text to copy into a shell, a probability a number from 0 to 1. */
        type: oneOf("text", "number", "command", "probability"),
        digits: orNull(count),
      }),
    ),
    rows: list(list(cell, size)),
    best: orNull(list(orNull(oneOf("low", "high")), size)),
  })(field);
}

/** An index into a list of `size` things. */
function below(size: number, things: string): Reader<number> {
  return (field) => (count(field) < size ? count(field) : field.fail(`one of ${size} ${things}`));
}

export type NetworkNode = NetworkSection["nodes"][number];
export type NetworkLink = NetworkSection["links"][number];
export type LinkUse = NetworkLink["use"];

function parseNetwork(field: Field, buffers: Buffers, lookUp: Reader<LandmarkCloud>) {
  const stages = field.get("stages").list().length;
  if (stages === 0) {
    field.get("stages").fail("at least one stage");
  }
  const group = below(field.get("groups").list().length, "groups");
  const node = below(field.get("nodes").list().length, "maps");
  return object({
    lengthUnit,
    stages: list(text),
    groups: list(object({ frame: text, up: orNull(vector) })),
    nodes: list((one) => parseNode(one, buffers, lookUp, group, stages)),
    links: list(
      object({
        target: node,
        source: node,
        use: oneOf("used", "contradicted", "undecided", "ambiguous", "rejected"),
        kind: orNull(text),
        probability: orNull(number),
        reason: orNull(text),
        residual: orNull(number),
        residualDeg: orNull(number),
        /** Two keyframes with images, and how many common landmarks both see. */
        view: orNull(object({ targetFrame: count, sourceFrame: count, matches: count })),
      }),
    ),
  })(field);
}

function parseNode(
  field: Field,
  buffers: Buffers,
  lookUp: Reader<LandmarkCloud>,
  group: Reader<number>,
  stages: number,
) {
  const placed = !field.get("group").isNull;
  const node = object({
    name: text,
    session: orNull(text),
    /** Why it has no pose. */
    reason: orNull(text),
    /** Index of a group; null: no pose. */
    group: orNull(group),
    landmarks: count,
    keyframes: count,
    fused: orNull(count),
    centre: vector,
    /** Of group_from_node, one a stage; null without a group. */
    poses: (poses) => (placed ? buffers.read(poses, ["f64"], 7 * stages) : null),
    scales: (scales) => (placed ? orNull(buffers.reader(["f64"], stages))(scales) : null),
  })(field);
  return { ...node, cloud: orNull(lookUp)(field.get("map")) };
}

/** x_in_target = scale * R * x_in_source + t. */
export type SimilarityPose = ReturnType<typeof similarity>;
const kPose = {
  /** tx ty tz qw qx qy qz. */
  pose: list(number, 7),
  scale: orElse(number, 1),
};
const similarity = object(kPose);

export type AnswerCandidate = ReturnType<typeof candidate>;
const candidate = object({
  ...kPose,
  probability: number,
  /** Landmarks that are matched, and their share of the smaller map. */
  matches: count,
  share: number,
  /** Share of the lines of sight; null: too few were compared. */
  contradicted: orNull(number),
  /** Log-likelihood ratios. */
  evidence: listOrEmpty(object({ name: text, value: number })),
});

export type OpenDirection = ReturnType<typeof openDirection>;
const openDirection = object({ translation: vector, rotation: vector, logScale: orElse(number, 0) });

export type AlignmentAnswer = ReturnType<typeof alignment>;
const alignment = object({
  name: text,
  status: text,
  judged: truth,
  probability: orNull(number),
  reason: orElse(text, ""),
  radius: orNull(number),
  estimate: orNull(similarity),
  deviations: orNull(object({ translation: vector, rotationDeg: vector, logScale: orNull(number) })),
  open: listOrEmpty(openDirection),
  candidates: listOrEmpty(candidate),
});

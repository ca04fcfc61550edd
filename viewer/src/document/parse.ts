// SPDX-License-Identifier: BSD-3-Clause
import { Buffers } from "./buffers";
import { ReportError, messageOf } from "./errors";
import { Field } from "./field";
import { validateMatches, type Matches } from "./matches";
import type {
  AlignmentAnswer,
  AnswerSection,
  Chart,
  Column,
  FrameImage,
  Frames,
  LandmarkCloud,
  NetworkLink,
  NetworkNode,
  NetworkSection,
  NetworkThing,
  Provenance,
  Report,
  Run,
  SceneSection,
  Section,
  SimilarityPose,
  SummaryValue,
  Table,
  Threshold,
  Vector3,
} from "./report";

const kSchema = "cairn.report";
const kVersion = 1;

type MapLookup = (id: Field) => LandmarkCloud;

/**
 * Decodes a whole document. Another schema, a newer version or a document that is no document throws; a section
 * that is broken or unknown becomes a notice in its place, so that the rest of the report stays readable.
 */
export function parseReport(json: string, bytes: ArrayBuffer): Report {
  let value: unknown;
  try {
    value = JSON.parse(json);
  } catch (error) {
    throw new ReportError(`The report's document is not JSON: ${messageOf(error)}.`);
  }
  const document = new Field(value, "");
  checkSchema(document.get("schema"));
  const buffers = new Buffers(bytes);
  const lookUp = mapLookup(document.get("maps").listOrEmpty(), buffers);
  const taken = new Set<string>();
  return {
    cairnVersion: document.get("cairn_version").textOrNull(),
    title: document.get("title").text(),
    subtitle: document.get("subtitle").textOrNull(),
    provenance: document.get("provenance").isNull ? null : parseProvenance(document.get("provenance")),
    sections: document
      .get("sections")
      .list()
      .map((section) => parseSection(section, buffers, lookUp, taken)),
  };
}

function checkSchema(schema: Field): void {
  const name = schema.get("name").text();
  if (name !== kSchema) {
    throw new ReportError(`This page shows "${kSchema}" documents, not "${name}".`);
  }
  const version = schema.get("version").count();
  if (version < 1 || version > kVersion) {
    throw new ReportError(
      `This page reads ${kSchema} up to version ${kVersion}; the document is version ${version}. ` +
        "Two different versions of Cairn produced it.",
    );
  }
}

function mapLookup(fields: Field[], buffers: Buffers): MapLookup {
  const byId = new Map(fields.map((field) => [field.get("id").text(), field]));
  const decoded = new Map<string, LandmarkCloud>();
  return (reference) => {
    const id = reference.text();
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

function parseCloud(field: Field, buffers: Buffers): LandmarkCloud {
  const count = field.get("count").count();
  return {
    id: field.get("id").text(),
    name: field.get("name").text(),
    lengthUnit: field.get("length_unit").oneOf("m", "mapunits"),
    count,
    origin: field.get("origin").finiteNumbers(3) as unknown as Vector3,
    step: field.get("step").finiteNumbers(3) as unknown as Vector3,
    positions: buffers.read(field.get("positions"), ["u16", "u32"], 3 * count),
    ids: buffers.readOrNull(field.get("ids"), ["u32"], 2 * count),
    columns: field
      .get("columns")
      .listOrEmpty()
      .map((column) => parseColumn(column, buffers, count)),
    colors: buffers.readOrNull(field.get("colors"), ["u8"], 3 * count),
    frames: field.get("frames").isNull ? null : parseFrames(field.get("frames"), buffers),
  };
}

function parseColumn(field: Field, buffers: Buffers, count: number): Column {
  const name = field.get("name").text();
  return {
    name,
    label: field.get("label").textOrNull() ?? name,
    unit: field.get("unit").textOrNull(),
    values: buffers.read(field.get("values"), ["f32", "u8", "u16"], count),
    scale: field.get("scale").numberOrNull() ?? 1,
    offset: field.get("offset").numberOrNull() ?? 0,
  };
}

function parseFrames(field: Field, buffers: Buffers): Frames {
  const count = field.get("count").count();
  const frustum = field.get("frustum");
  return {
    count,
    poses: buffers.read(field.get("poses"), ["f32"], 7 * count),
    ids: buffers.readOrNull(field.get("ids"), ["u32"], 2 * count),
    timestamps: buffers.readOrNull(field.get("timestamps"), ["f64"], count),
    frustum: frustum.isNull
      ? null
      : { halfWidth: frustum.get("half_width").number(), halfHeight: frustum.get("half_height").number() },
    images: parseFrameImages(field.get("images"), buffers, count),
  };
}

/** How a file of a media type begins. */
const kSignatures = { "image/png": [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a], "image/jpeg": [0xff, 0xd8, 0xff] };

function parseFrameImages(field: Field, buffers: Buffers, count: number): Frames["images"] {
  const images = new Map<number, FrameImage>();
  for (const image of field.listOrEmpty()) {
    const frame = image.get("frame").count();
    if (frame >= count || images.has(frame)) {
      image.get("frame").fail(`one of ${count} frames that has no other image`);
    }
    const mediaType = image.get("media_type").oneOf("image/png", "image/jpeg");
    const data = buffers.read(image.get("data"), ["u8"]);
    if (!kSignatures[mediaType].every((byte, i) => data[i] === byte)) {
      throw new ReportError(`${image.get("data").path}: the bytes are not an ${mediaType}.`);
    }
    images.set(frame, { mediaType, data });
  }
  return images;
}

function parseProvenance(field: Field): Provenance {
  return {
    command: field.get("command").isNull ? null : field.get("command").texts(),
    seed: field.get("seed").numberOrNull(),
    machine: field.get("machine").value ?? null,
    inputs: field
      .get("inputs")
      .listOrEmpty()
      .map((input) => ({
        role: input.get("role").textOrNull(),
        path: input.get("path").textOrNull(),
        hash: input.get("hash").textOrNull(),
        details: input.get("details").value ?? null,
      })),
    options: field.get("options").value ?? null,
  };
}

function parseSection(field: Field, buffers: Buffers, lookUp: MapLookup, taken: Set<string>): Section {
  let id = field.get("id").text();
  if (!/^[a-z0-9-]+$/.test(id)) {
    field.get("id").fail("an id of a-z, 0-9 and -");
  }
  if (taken.has(id)) {
    throw new ReportError(`${field.path}.id: "${id}" is taken by another section.`);
  }
  taken.add(id);
  const head = { id, title: field.get("title").textOrNull() ?? id, text: field.get("text").textOrNull() };
  const kind = field.get("kind").text();
  try {
    switch (kind) {
      case "scene":
        return { ...head, ...parseScene(field, buffers, lookUp) };
      case "chart":
        return { ...head, kind, chart: parseChart(field) };
      case "table":
        return { ...head, kind, table: parseTable(field) };
      case "network":
        return { ...head, ...parseNetwork(field, buffers, lookUp) };
      case "answer":
        return { ...head, ...parseAnswer(field) };
      case "text":
        return { ...head, kind };
      default:
        return {
          ...head,
          kind: "notice",
          severity: "unknown",
          message: `This page does not support sections of this kind: "${kind}".`,
        };
    }
  } catch (error) {
    return { ...head, kind: "notice", severity: "broken", message: messageOf(error) };
  }
}

function parseScene(
  field: Field,
  buffers: Buffers,
  lookUp: MapLookup,
): Pick<SceneSection, "kind" | "source" | "target" | "truth" | "up" | "runs"> {
  const target = lookUp(field.get("target"));
  const source = field.get("source").isNull ? null : lookUp(field.get("source"));
  const up = field.get("up");
  return {
    kind: "scene",
    source,
    target,
    truth: field.get("truth").isNull ? null : field.get("truth").finiteNumbers(16),
    up: up.isNull ? null : (up.finiteNumbers(3) as unknown as Vector3),
    runs: field
      .get("runs")
      .listOrEmpty()
      .map((run) => parseRun(run, buffers, source, target)),
  };
}

function parseNetwork(
  field: Field,
  buffers: Buffers,
  lookUp: MapLookup,
): Omit<NetworkSection, "id" | "title" | "text"> {
  const stages = field.get("stages").texts();
  if (stages.length === 0) {
    field.get("stages").fail("at least one stage");
  }
  const groups = field
    .get("groups")
    .list()
    .map((group) => ({
      frame: group.get("frame").text(),
      up: group.get("up").isNull ? null : (group.get("up").finiteNumbers(3) as unknown as Vector3),
    }));
  const groupOf = (index: Field) => {
    const value = index.count();
    return value < groups.length ? value : index.fail(`one of ${groups.length} groups`);
  };
  const nodes = field
    .get("nodes")
    .list()
    .map((node): NetworkNode => {
      const group = node.get("group").isNull ? null : groupOf(node.get("group"));
      return {
        name: node.get("name").text(),
        cloud: node.get("map").isNull ? null : lookUp(node.get("map")),
        session: node.get("session").textOrNull(),
        reason: node.get("reason").textOrNull(),
        group,
        landmarks: node.get("landmarks").count(),
        keyframes: node.get("keyframes").count(),
        fused: node.get("fused").isNull ? null : node.get("fused").count(),
        centre: node.get("centre").finiteNumbers(3) as unknown as Vector3,
        poses: group === null ? null : buffers.read(node.get("poses"), ["f64"], 7 * stages.length),
        scales: group === null ? null : buffers.readOrNull(node.get("scales"), ["f64"], stages.length),
      };
    });
  const nodeAt = (index: Field) => {
    const value = index.count();
    return value < nodes.length ? value : index.fail(`one of ${nodes.length} maps`);
  };
  const links = field
    .get("links")
    .list()
    .map(
      (link): NetworkLink => ({
        target: nodeAt(link.get("target")),
        source: nodeAt(link.get("source")),
        use: link.get("use").oneOf("used", "contradicted", "undecided", "ambiguous", "rejected"),
        kind: link.get("kind").textOrNull(),
        probability: link.get("probability").numberOrNull(),
        reason: link.get("reason").textOrNull(),
        residual: link.get("residual").numberOrNull(),
        residualDeg: link.get("residual_deg").numberOrNull(),
      }),
    );
  const things = field
    .get("things")
    .listOrEmpty()
    .map(
      (thing): NetworkThing => ({
        name: thing.get("name").text(),
        kind: thing.get("kind").oneOf("appeared", "vanished", "moved"),
        group: groupOf(thing.get("group")),
        boxes: thing
          .get("boxes")
          .list()
          .map((box) => ({
            low: box.get("low").finiteNumbers(3) as unknown as Vector3,
            high: box.get("high").finiteNumbers(3) as unknown as Vector3,
          })),
      }),
    );
  return {
    kind: "network",
    lengthUnit: field.get("length_unit").oneOf("m", "mapunits"),
    stages,
    groups,
    nodes,
    links,
    things,
  };
}

function parseAnswer(field: Field): Omit<AnswerSection, "id" | "title" | "text"> {
  return {
    kind: "answer",
    lengthUnit: field.get("length_unit").oneOf("m", "mapunits"),
    scene: field.get("scene").textOrNull(),
    alignments: field.get("alignments").list().map(parseAlignment),
  };
}

function parseSimilarity(field: Field): SimilarityPose {
  return { pose: field.get("pose").finiteNumbers(7), scale: field.get("scale").numberOrNull() ?? 1 };
}

function vector(field: Field): Vector3 {
  return field.finiteNumbers(3) as unknown as Vector3;
}

function parseAlignment(field: Field): AlignmentAnswer {
  const deviations = field.get("deviations");
  const estimate = field.get("estimate");
  return {
    name: field.get("name").text(),
    status: field.get("status").text(),
    judged: field.get("judged").truth(),
    probability: field.get("probability").numberOrNull(),
    reason: field.get("reason").textOrNull() ?? "",
    radius: field.get("radius").numberOrNull(),
    estimate: estimate.isNull ? null : parseSimilarity(estimate),
    deviations: deviations.isNull
      ? null
      : {
          translation: vector(deviations.get("translation")),
          rotationDeg: vector(deviations.get("rotation_deg")),
          logScale: deviations.get("log_scale").numberOrNull(),
        },
    open: field
      .get("open")
      .listOrEmpty()
      .map((open) => ({
        translation: vector(open.get("translation")),
        rotation: vector(open.get("rotation")),
        logScale: open.get("log_scale").numberOrNull() ?? 0,
      })),
    candidates: field
      .get("candidates")
      .listOrEmpty()
      .map((candidate) => ({
        ...parseSimilarity(candidate),
        probability: candidate.get("probability").number(),
        matches: candidate.get("matches").count(),
        share: candidate.get("share").number(),
        contradicted: candidate.get("contradicted").numberOrNull(),
        evidence: candidate
          .get("evidence")
          .listOrEmpty()
          .map((one) => ({ name: one.get("name").text(), value: one.get("value").number() })),
      })),
  };
}

function parseRun(field: Field, buffers: Buffers, source: LandmarkCloud | null, target: LandmarkCloud): Run {
  if (!source) {
    throw new ReportError(`${field.path}: an alignment needs a source map.`);
  }
  const poses = buffers.read(field.get("poses"), ["f64"]);
  if (poses.length === 0 || poses.length % 7 !== 0) {
    throw new ReportError(`${field.path}.poses: expected seven numbers for every pose, found ${poses.length}.`);
  }
  const steps = poses.length / 7;
  const perStep = (key: string) => buffers.readOrNull(field.get(key), ["f64"], steps);
  const summary = field.get("summary");
  return {
    name: field.get("name").text(),
    summary: summary.isNull ? [] : Object.entries(summary.object()).map(([key, value]) => [key, summaryValue(value)]),
    iterations: steps - 1,
    poses,
    scales: perStep("scales"),
    meanSquaredDistance: perStep("mean_squared_distance"),
    scores: perStep("scores"),
    rotationErrorDeg: perStep("rotation_error_deg"),
    translationErrorM: perStep("translation_error_m"),
    matches:
      field.get("matches").isNull || steps < 2
        ? null
        : parseMatches(field.get("matches"), buffers, steps - 1, source, target),
  };
}

function summaryValue(value: unknown): SummaryValue {
  if (value === null || typeof value === "number" || typeof value === "string") {
    return value;
  }
  return JSON.stringify(value) ?? null;
}

function parseMatches(
  field: Field,
  buffers: Buffers,
  iterations: number,
  source: LandmarkCloud,
  target: LandmarkCloud,
): Matches {
  const matches = {
    first: buffers.read(field.get("first"), ["i32"], source.count),
    changeCounts: buffers.read(field.get("change_counts"), ["u32"]),
    changed: buffers.read(field.get("changed"), ["u32"]),
    targets: buffers.read(field.get("targets"), ["i32"]),
  };
  validateMatches(matches, iterations, source.count, target.count, field.path);
  return matches;
}

function parseThreshold(field: Field): Threshold | null {
  if (field.isNull) {
    return null;
  }
  return { value: field.get("value").number(), label: field.get("label").textOrNull() ?? "" };
}

function parseScale(field: Field): "linear" | "log" {
  return field.isNull ? "linear" : field.oneOf("linear", "log");
}

function parseChart(field: Field): Chart {
  const chart = field.get("chart").oneOf("violin", "lines", "heatmap", "intervals", "scatter", "spans");
  const xLabel = field.get("x_label").textOrNull();
  const yLabel = field.get("y_label").textOrNull();
  switch (chart) {
    case "violin":
      return {
        chart,
        xLabel,
        yLabel,
        yScale: parseScale(field.get("y_scale")),
        threshold: parseThreshold(field.get("threshold")),
        groups: field
          .get("groups")
          .list()
          .map((group) => {
            const values = group.get("values").numbers();
            return { name: group.get("name").text(), values, labels: group.get("labels").textsOrNull(values.length) };
          }),
      };
    case "lines":
      return {
        chart,
        xLabel,
        yLabel,
        yScale: parseScale(field.get("y_scale")),
        series: field
          .get("series")
          .list()
          .map((series) => {
            const x = series.get("x").numbers();
            return { name: series.get("name").text(), x, y: series.get("y").numbers(x.length) };
          }),
      };
    case "heatmap": {
      const x = edges(field.get("x"));
      const y = edges(field.get("y"));
      const grid = (rows: Field) => rows.list(y.length - 1).map((row) => row.numbers(x.length - 1));
      const range = field.get("range");
      return {
        chart,
        xLabel,
        yLabel,
        valueLabel: field.get("value_label").textOrNull(),
        x,
        y,
        panels: field
          .get("panels")
          .list()
          .map((panel) => ({
            name: panel.get("name").text(),
            values: grid(panel.get("values")),
            counts: panel.get("counts").isNull ? null : grid(panel.get("counts")),
          })),
        range: range.isNull ? null : (range.finiteNumbers(2) as [number, number]),
      };
    }
    case "intervals":
      return {
        chart,
        xLabel,
        xScale: parseScale(field.get("x_scale")),
        series: field
          .get("series")
          .list()
          .map((series) => ({
            name: series.get("name").text(),
            items: series
              .get("items")
              .list()
              .map((item) => ({
                name: item.get("name").text(),
                value: item.get("value").numberOrNull() ?? NaN,
                low: item.get("low").numberOrNull() ?? NaN,
                high: item.get("high").numberOrNull() ?? NaN,
              })),
          })),
      };
    case "spans":
      return {
        chart,
        xLabel,
        series: field
          .get("series")
          .list()
          .map((series) => ({
            name: series.get("name").text(),
            spans: series
              .get("spans")
              .list()
              .map((span) => ({
                name: span.get("name").text(),
                start: span.get("start").number(),
                end: span.get("end").number(),
                marks: span.get("marks").numbers(),
              })),
          })),
      };
    case "scatter":
      return {
        chart,
        xLabel,
        yLabel,
        xScale: parseScale(field.get("x_scale")),
        yScale: parseScale(field.get("y_scale")),
        xThreshold: parseThreshold(field.get("x_threshold")),
        yThreshold: parseThreshold(field.get("y_threshold")),
        series: field
          .get("series")
          .list()
          .map((series) => {
            const x = series.get("x").numbers();
            return {
              name: series.get("name").text(),
              x,
              y: series.get("y").numbers(x.length),
              labels: series.get("labels").textsOrNull(x.length),
            };
          }),
      };
  }
}

function edges(field: Field): number[] {
  const values = field.numbers();
  if (values.length < 2 || values.some((value, i) => !(i === 0 || value > values[i - 1]))) {
    field.fail("at least two increasing bin edges");
  }
  return values;
}

function parseTable(field: Field): Table {
  const columns = field
    .get("columns")
    .list()
    .map((column) => ({
      name: column.get("name").text(),
      unit: column.get("unit").textOrNull(),
      type: column.get("type").oneOf("text", "number", "command"),
      digits: column.get("digits").isNull ? null : column.get("digits").count(),
    }));
  const best = field.get("best");
  return {
    columns,
    rows: field
      .get("rows")
      .list()
      .map((row) =>
        row.list(columns.length).map((cell) => {
          const value = cell.value;
          return value === null || typeof value === "string" || typeof value === "number"
            ? value
            : cell.fail("text, a number or null");
        }),
      ),
    best: best.isNull
      ? null
      : best.list(columns.length).map((item) => (item.isNull ? null : item.oneOf("low", "high"))),
  };
}

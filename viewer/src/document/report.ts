// SPDX-License-Identifier: BSD-3-Clause
// What docs/report_format.md specifies, decoded. Numbers that were null are NaN where only numbers make sense.
import type { Matches } from "./matches";

export type Scale = "linear" | "log";
export type Vector3 = readonly [number, number, number];

export interface Report {
  cairnVersion: string | null;
  title: string;
  subtitle: string | null;
  provenance: Provenance | null;
  sections: Section[];
}

export interface Provenance {
  command: string[] | null;
  seed: number | null;
  machine: unknown;
  inputs: { role: string | null; path: string | null; hash: string | null; details: unknown }[];
  options: unknown;
}

export interface Column {
  name: string;
  label: string;
  unit: string | null;
  values: Float32Array | Uint8Array | Uint16Array;
  scale: number;
  offset: number;
}

/** What a frame's camera saw: it fills the frustum. */
export interface FrameImage {
  mediaType: "image/png" | "image/jpeg";
  data: Uint8Array;
}

export interface Frames {
  count: number;
  /** tx ty tz qw qx qy qz, world_from_camera. */
  poses: Float32Array;
  ids: Uint32Array | null;
  timestamps: Float64Array | null;
  /** Tangents of half the views; null if the camera is unknown. */
  frustum: { halfWidth: number; halfHeight: number } | null;
  /** By frame; those that have one. */
  images: Map<number, FrameImage>;
}

export interface LandmarkCloud {
  id: string;
  name: string;
  lengthUnit: "m" | "mapunits";
  count: number;
  origin: Vector3;
  step: Vector3;
  positions: Uint16Array | Uint32Array;
  /** Low and high word of each landmark's id, or null: ids are 0, 1, … */
  ids: Uint32Array | null;
  columns: Column[];
  colors: Uint8Array | null;
  frames: Frames | null;
}

export type SummaryValue = string | number | null;

export interface Run {
  name: string;
  summary: [string, SummaryValue][];
  iterations: number;
  /** (iterations + 1) times tx ty tz qw qx qy qz of target_from_source. */
  poses: Float64Array;
  /** Of the source at each pose; null where all are 1. */
  scales: Float64Array | null;
  meanSquaredDistance: Float64Array | null;
  scores: Float64Array | null;
  rotationErrorDeg: Float64Array | null;
  translationErrorM: Float64Array | null;
  matches: Matches | null;
}

interface SectionHead {
  id: string;
  title: string;
  text: string | null;
}

export interface SceneSection extends SectionHead {
  kind: "scene";
  source: LandmarkCloud | null;
  target: LandmarkCloud;
  /** target_from_source, row-major 4 x 4. */
  truth: number[] | null;
  up: Vector3 | null;
  runs: Run[];
}

export interface Threshold {
  value: number;
  label: string;
}

export interface ViolinChart {
  chart: "violin";
  xLabel: string | null;
  yLabel: string | null;
  yScale: Scale;
  threshold: Threshold | null;
  groups: { name: string; values: number[]; labels: string[] | null }[];
}

export interface LinesChart {
  chart: "lines";
  xLabel: string | null;
  yLabel: string | null;
  yScale: Scale;
  series: { name: string; x: number[]; y: number[] }[];
}

export interface HeatmapChart {
  chart: "heatmap";
  xLabel: string | null;
  yLabel: string | null;
  valueLabel: string | null;
  /** Bin edges. */
  x: number[];
  y: number[];
  panels: { name: string; values: number[][]; counts: number[][] | null }[];
  range: [number, number] | null;
}

export interface IntervalsChart {
  chart: "intervals";
  xLabel: string | null;
  xScale: Scale;
  series: { name: string; items: { name: string; value: number; low: number; high: number }[] }[];
}

export interface ScatterChart {
  chart: "scatter";
  xLabel: string | null;
  yLabel: string | null;
  xScale: Scale;
  yScale: Scale;
  xThreshold: Threshold | null;
  yThreshold: Threshold | null;
  series: { name: string; x: number[]; y: number[]; labels: string[] | null }[];
}

export interface SpansChart {
  chart: "spans";
  xLabel: string | null;
  /** Seconds since 1970, or since any start. */
  series: { name: string; spans: { name: string; start: number; end: number; marks: number[] }[] }[];
}

export type Chart = ViolinChart | LinesChart | HeatmapChart | IntervalsChart | ScatterChart | SpansChart;

export interface ChartSection extends SectionHead {
  kind: "chart";
  chart: Chart;
}

export interface TableColumn {
  name: string;
  unit: string | null;
  /** A command is text to copy into a shell. */
  type: "text" | "number" | "command";
  digits: number | null;
}

export type Cell = string | number | null;

export interface Table {
  columns: TableColumn[];
  rows: Cell[][];
  best: ("low" | "high" | null)[] | null;
}

export interface TableSection extends SectionHead {
  kind: "table";
  table: Table;
}

export interface TextSection extends SectionHead {
  kind: "text";
}

export interface NetworkNode {
  name: string;
  cloud: LandmarkCloud | null;
  session: string | null;
  /** Why it has no pose. */
  reason: string | null;
  /** Index of a group; null: no pose. */
  group: number | null;
  landmarks: number;
  keyframes: number;
  fused: number | null;
  centre: Vector3;
  /** Of group_from_node, one a stage; null without a group. */
  poses: Float64Array | null;
  scales: Float64Array | null;
}

export type LinkUse = "used" | "contradicted" | "undecided" | "ambiguous" | "rejected";

export interface NetworkLink {
  target: number;
  source: number;
  use: LinkUse;
  kind: string | null;
  probability: number | null;
  reason: string | null;
  residual: number | null;
  residualDeg: number | null;
}

export interface Box {
  low: Vector3;
  high: Vector3;
}

export interface NetworkThing {
  name: string;
  kind: "appeared" | "vanished" | "moved";
  group: number;
  /** One box, or of a moved thing the one it left and the one it went to. */
  boxes: Box[];
}

export interface NetworkSection extends SectionHead {
  kind: "network";
  lengthUnit: "m" | "mapunits";
  stages: string[];
  groups: { frame: string; up: Vector3 | null }[];
  nodes: NetworkNode[];
  links: NetworkLink[];
  things: NetworkThing[];
}

/** x_in_target = scale * R * x_in_source + t. */
export interface SimilarityPose {
  /** tx ty tz qw qx qy qz. */
  pose: number[];
  scale: number;
}

export interface AnswerCandidate extends SimilarityPose {
  probability: number;
  /** Landmarks that are matched, and their share of the smaller map. */
  matches: number;
  share: number;
  /** Share of the lines of sight; null: too few were compared. */
  contradicted: number | null;
  /** Log-likelihood ratios. */
  evidence: { name: string; value: number }[];
}

export interface OpenDirection {
  translation: Vector3;
  rotation: Vector3;
  logScale: number;
}

export interface AlignmentAnswer {
  name: string;
  status: string;
  judged: boolean;
  probability: number | null;
  reason: string;
  radius: number | null;
  estimate: SimilarityPose | null;
  deviations: { translation: Vector3; rotationDeg: Vector3; logScale: number | null } | null;
  open: OpenDirection[];
  candidates: AnswerCandidate[];
}

export interface AnswerSection extends SectionHead {
  kind: "answer";
  lengthUnit: "m" | "mapunits";
  /** Id of the scene that shows the poses. */
  scene: string | null;
  alignments: AlignmentAnswer[];
}

/** A section that this viewer cannot show; the reason stands in its place. */
export interface NoticeSection extends SectionHead {
  kind: "notice";
  severity: "unknown" | "broken";
  message: string;
}

export type Section =
  | SceneSection
  | ChartSection
  | TableSection
  | TextSection
  | NetworkSection
  | AnswerSection
  | NoticeSection;

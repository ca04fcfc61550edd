// SPDX-License-Identifier: BSD-3-Clause
import type { Frames, LandmarkCloud, Run, SceneSection } from "../document/report";
import { MatchTimeline } from "../document/matches";
import { apply, fromRowMajor, kIdentity, positionOf, similarityAt, type Affine } from "../math/pose";
import { quantileSorted } from "../math/statistics";
import { extentOf, type Extent } from "./extent";
import { columnScale, type ColorMode, type ColorScale } from "./coloring";

export type Role = "source" | "target";

const kResidualSamples = 4000;

/** Everything about a scene that does not change while it is looked at. */
export class SceneModel {
  readonly section: SceneSection;
  readonly source: LandmarkCloud | null;
  readonly target: LandmarkCloud;
  readonly truth: Affine | null;
  /** In the target's frame. */
  readonly extent: Extent;
  readonly maxIterations: number;
  readonly #timelines = new Map<Run, MatchTimeline>();
  #residualScale: ColorScale | null | undefined;

  constructor(section: SceneSection) {
    this.section = section;
    this.source = section.source;
    this.target = section.target;
    this.truth = section.truth ? fromRowMajor(section.truth) : null;
    this.maxIterations = Math.max(0, ...section.runs.map((run) => run.iterations));

    const placed: [LandmarkCloud, Affine][] = [[this.target, kIdentity]];
    if (this.source) {
      placed.push([this.source, this.restingPose]);
    }
    this.extent = extentOf(placed, section.up, this.target.frames);
  }

  get lengthUnit(): "m" | "mapunits" {
    return this.target.lengthUnit;
  }

  /** Of a map that has keyframes. */
  frames(role: Role): Frames | null {
    const frames = (role === "source" ? this.source : this.target)?.frames;
    return frames && frames.count > 0 ? frames : null;
  }

  /** Where the source stands when no run says so: at the truth if that is known. */
  get restingPose(): Affine {
    const run = this.section.runs[0];
    return run ? similarityAt(run.poses, run.scales, run.iterations) : (this.truth ?? kIdentity);
  }

  get landmarkCount(): number {
    return this.target.count + (this.source?.count ?? 0);
  }

  /** The pose of `run` at iteration `iteration`, held at its last one. */
  pose(run: Run | null, iteration: number): Affine {
    return run ? similarityAt(run.poses, run.scales, Math.min(iteration, run.iterations)) : this.restingPose;
  }

  /** The matches found at the pose of `iteration`; at the last pose, those that led to it. */
  matches(run: Run | null, iteration: number): Int32Array | null {
    if (!run?.matches) {
      return null;
    }
    let timeline = this.#timelines.get(run);
    if (!timeline) {
      timeline = new MatchTimeline(run.matches);
      this.#timelines.set(run, timeline);
    }
    return timeline.at(Math.min(iteration + 1, run.iterations));
  }

  /** Distances between matched landmarks at a pose; NaN without a match. */
  residuals(pose: Affine, matches: Int32Array, into: Float32Array): Float32Array {
    const { source, target } = this;
    if (!source) {
      return into;
    }
    const p = source.positions;
    const q = target.positions;
    const [so, ss, to, ts] = [source.origin, source.step, target.origin, target.step];
    for (let i = 0; i < source.count; ++i) {
      const j = matches[i];
      if (j < 0) {
        into[i] = NaN;
        continue;
      }
      const x = so[0] + ss[0] * p[3 * i];
      const y = so[1] + ss[1] * p[3 * i + 1];
      const z = so[2] + ss[2] * p[3 * i + 2];
      const dx = pose[0] * x + pose[1] * y + pose[2] * z + pose[3] - to[0] - ts[0] * q[3 * j];
      const dy = pose[4] * x + pose[5] * y + pose[6] * z + pose[7] - to[1] - ts[1] * q[3 * j + 1];
      const dz = pose[8] * x + pose[9] * y + pose[10] * z + pose[11] - to[2] - ts[2] * q[3 * j + 2];
      into[i] = Math.sqrt(dx * dx + dy * dy + dz * dz);
    }
    return into;
  }

  residual(pose: Affine, sourceIndex: number, targetIndex: number): number {
    if (!this.source || targetIndex < 0) {
      return NaN;
    }
    const a = apply(pose, positionOf(this.source, sourceIndex));
    const b = positionOf(this.target, targetIndex);
    return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  }

  get hasResiduals(): boolean {
    return this.section.runs.some((run) => run.matches !== null);
  }

  /** One scale for all strategies and iterations, so that colours can be compared as the slider moves. */
  residualScale(log: boolean | null): ColorScale | null {
    if (this.#residualScale === undefined) {
      const seen: number[] = [];
      const buffer = new Float32Array(this.source?.count ?? 0);
      const stride = Math.max(1, Math.floor(buffer.length / kResidualSamples));
      for (const run of this.section.runs) {
        for (const iteration of [0, run.iterations]) {
          const matches = this.matches(run, iteration);
          if (matches) {
            this.residuals(this.pose(run, iteration), matches, buffer);
            for (let i = 0; i < buffer.length; i += stride) {
              if (buffer[i] > 0) {
                seen.push(buffer[i]);
              }
            }
          }
        }
      }
      const sorted = Float64Array.from(seen).sort();
      const high = quantileSorted(sorted, 0.98);
      const low = Math.max(quantileSorted(sorted, 0.05), high / 1000);
      this.#residualScale =
        high > low
          ? { label: "Residual", unit: this.lengthUnit === "m" ? "m" : "map units", low, high, log: true }
          : null;
    }
    const scale = this.#residualScale;
    return scale && log === false ? { ...scale, low: 0, log: false } : scale;
  }

  colorScale(mode: ColorMode, log: boolean | null): ColorScale | null {
    switch (mode.kind) {
      case "column":
        return columnScale([this.source, this.target], mode.name, log);
      case "residual":
        return this.residualScale(log);
      default:
        return null;
    }
  }

  /** Columns of either cloud, by name. */
  get columns(): { name: string; label: string }[] {
    const found = new Map<string, string>();
    for (const column of [...this.target.columns, ...(this.source?.columns ?? [])]) {
      if (!found.has(column.name)) {
        found.set(column.name, column.label);
      }
    }
    return [...found].map(([name, label]) => ({ name, label }));
  }
}

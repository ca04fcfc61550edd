// SPDX-License-Identifier: BSD-3-Clause
import { ReportError } from "./errors";

/** Delta-coded matches as they are in the document. */
export interface Matches {
  /** Per source landmark: its target landmark in iteration 1, or -1. */
  first: Int32Array;
  changeCounts: Uint32Array;
  changed: Uint32Array;
  targets: Int32Array;
}

export function validateMatches(
  matches: Matches,
  iterations: number,
  sourceCount: number,
  targetCount: number,
  path: string,
): void {
  const { first, changeCounts, changed, targets } = matches;
  const expected = Math.max(0, iterations - 1);
  if (changeCounts.length !== expected) {
    throw new ReportError(
      `${path}.change_counts: expected ${expected} elements for ${iterations} iterations, ` +
        `found ${changeCounts.length}.`,
    );
  }
  let total = 0;
  for (const count of changeCounts) {
    total += count;
  }
  if (changed.length !== total || targets.length !== total) {
    throw new ReportError(
      `${path}: change_counts add up to ${total}, but there are ${changed.length} changed ` +
        `landmarks and ${targets.length} targets.`,
    );
  }
  for (const target of first) {
    if (target < -1 || target >= targetCount) {
      throw new ReportError(`${path}.first: there is no target landmark ${target}.`);
    }
  }
  for (let i = 0; i < total; ++i) {
    if (changed[i] >= sourceCount) {
      throw new ReportError(`${path}.changed: there is no source landmark ${changed[i]}.`);
    }
    if (targets[i] < -1 || targets[i] >= targetCount) {
      throw new ReportError(`${path}.targets: there is no target landmark ${targets[i]}.`);
    }
  }
}

const kCheckpointBytes = 32e6;

/** The matches of any iteration; going forward costs the changes, going back a checkpoint's copy. */
export class MatchTimeline {
  readonly iterations: number;
  readonly #matches: Matches;
  readonly #starts: Float64Array;
  readonly #current: Int32Array;
  readonly #checkpoints = new Map<number, Int32Array>();
  readonly #interval: number;
  #iteration = 1;

  constructor(matches: Matches) {
    this.#matches = matches;
    this.iterations = matches.changeCounts.length + 1;
    this.#starts = new Float64Array(this.iterations);
    for (let i = 1; i < this.iterations; ++i) {
      this.#starts[i] = this.#starts[i - 1] + matches.changeCounts[i - 1];
    }
    this.#current = matches.first.slice();
    const affordable = Math.max(1, Math.floor(kCheckpointBytes / (4 * matches.first.length + 1)));
    this.#interval = Math.max(8, Math.ceil(this.iterations / affordable));
  }

  /** The target of each source landmark in `iteration` (from 1), or -1; valid until the next call. */
  at(iteration: number): Int32Array {
    const wanted = Math.min(Math.max(1, Math.round(iteration)), this.iterations);
    if (wanted < this.#iteration) {
      const checkpoint = Math.floor((wanted - 1) / this.#interval) * this.#interval + 1;
      this.#current.set(this.#checkpoints.get(checkpoint) ?? this.#matches.first);
      this.#iteration = this.#checkpoints.has(checkpoint) ? checkpoint : 1;
    }
    while (this.#iteration < wanted) {
      this.#step();
    }
    return this.#current;
  }

  #step(): void {
    const { changeCounts, changed, targets } = this.#matches;
    const start = this.#starts[this.#iteration - 1];
    const end = start + changeCounts[this.#iteration - 1];
    for (let i = start; i < end; ++i) {
      this.#current[changed[i]] = targets[i];
    }
    ++this.#iteration;
    const due = (this.#iteration - 1) % this.#interval === 0;
    if (due && !this.#checkpoints.has(this.#iteration)) {
      this.#checkpoints.set(this.#iteration, this.#current.slice());
    }
  }
}

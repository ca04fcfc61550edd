// SPDX-License-Identifier: BSD-3-Clause

export interface BoxSummary {
  count: number;
  min: number;
  q1: number;
  median: number;
  q3: number;
  max: number;
  mean: number;
  /** Whiskers reach the last value within 1.5 interquartile ranges of the box. */
  whiskerLow: number;
  whiskerHigh: number;
}

/** Quantile of ascending values, linear between order statistics (Hyndman and Fan's type 7). */
export function quantileSorted(sorted: ArrayLike<number>, p: number): number {
  if (sorted.length === 0) {
    return NaN;
  }
  const position = (sorted.length - 1) * Math.min(1, Math.max(0, p));
  const below = Math.floor(position);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (sorted[above] - sorted[below]) * (position - below);
}

export function sortedFinite(values: Iterable<number>): Float64Array {
  return Float64Array.from(values).filter(Number.isFinite).sort();
}

export function summarise(values: Iterable<number>): BoxSummary | null {
  const sorted = sortedFinite(values);
  if (sorted.length === 0) {
    return null;
  }
  const q1 = quantileSorted(sorted, 0.25);
  const q3 = quantileSorted(sorted, 0.75);
  const reach = 1.5 * (q3 - q1);
  let mean = 0;
  for (const value of sorted) {
    mean += value / sorted.length;
  }
  return {
    count: sorted.length,
    min: sorted[0],
    q1,
    median: quantileSorted(sorted, 0.5),
    q3,
    max: sorted[sorted.length - 1],
    mean,
    whiskerLow: sorted.find((value) => value >= q1 - reach) ?? sorted[0],
    whiskerHigh: sorted.findLast((value) => value <= q3 + reach) ?? sorted[sorted.length - 1],
  };
}

/** Silverman's rule of thumb; 0 if the values do not vary. */
export function bandwidth(sorted: Float64Array): number {
  const n = sorted.length;
  if (n < 2) {
    return 0;
  }
  const mean = sorted.reduce((sum, value) => sum + value, 0) / n;
  const variance = sorted.reduce((sum, value) => sum + (value - mean) ** 2, 0) / (n - 1);
  const spread = quantileSorted(sorted, 0.75) - quantileSorted(sorted, 0.25);
  const deviation = Math.sqrt(variance);
  const scale = spread > 0 ? Math.min(deviation, spread / 1.34) : deviation;
  return 0.9 * scale * n ** -0.2;
}

/** Gaussian kernel density of `values` at `points`. */
export function kernelDensity(values: Float64Array, width: number, points: ArrayLike<number>): Float64Array {
  const density = new Float64Array(points.length);
  const norm = 1 / (values.length * width * Math.sqrt(2 * Math.PI));
  for (let i = 0; i < points.length; ++i) {
    let sum = 0;
    for (const value of values) {
      const z = (points[i] - value) / width;
      sum += Math.exp(-0.5 * z * z);
    }
    density[i] = sum * norm;
  }
  return density;
}

/** The 2nd to 98th percentile of a large array, from a regular sample of it. */
export function robustRange(at: (index: number) => number, count: number): [number, number] | null {
  const stride = Math.max(1, Math.floor(count / 20000));
  const sample = new Float64Array(Math.ceil(count / stride));
  let size = 0;
  for (let i = 0; i < count; i += stride) {
    const value = at(i);
    if (Number.isFinite(value)) {
      sample[size++] = value;
    }
  }
  if (size === 0) {
    return null;
  }
  const sorted = sample.subarray(0, size).sort();
  return [quantileSorted(sorted, 0.02), quantileSorted(sorted, 0.98)];
}

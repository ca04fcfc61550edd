// SPDX-License-Identifier: BSD-3-Clause
import { interpolateViridis } from "d3-scale-chromatic";
import type { Column, LandmarkCloud } from "../document/report";
import { robustRange } from "../math/statistics";
import type { ThemeName } from "../theme";

export type ColorMode = { kind: "role" } | { kind: "column"; name: string } | { kind: "residual" } | { kind: "own" };

/** How a number becomes a place on the colour ramp. */
export interface ColorScale {
  label: string;
  unit: string | null;
  low: number;
  high: number;
  log: boolean;
}

/** The last level stands for landmarks without a value. */
export const kNoLevel = 255;
const kTopLevel = 254;

/** Viridis, less its end that would vanish in the background. */
export function rampColor(t: number, theme: ThemeName): string {
  return interpolateViridis(theme === "light" ? 0.93 * t : 0.16 + 0.84 * t);
}

export function levelOf(value: number, scale: ColorScale): number {
  if (!Number.isFinite(value)) {
    return kNoLevel;
  }
  const { low, high, log } = scale;
  const t = log ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.round(kTopLevel * Math.min(1, Math.max(0, t)));
}

export function levelsOf(column: Column, scale: ColorScale): Uint8Array {
  const levels = new Uint8Array(column.values.length);
  if (column.values instanceof Uint8Array) {
    // Few distinct values: map each once.
    const table = Uint8Array.from({ length: 256 }, (_, stored) =>
      levelOf(column.offset + column.scale * stored, scale),
    );
    for (let i = 0; i < levels.length; ++i) {
      levels[i] = table[column.values[i]];
    }
    return levels;
  }
  for (let i = 0; i < levels.length; ++i) {
    levels[i] = levelOf(column.offset + column.scale * column.values[i], scale);
  }
  return levels;
}

export function columnOf(cloud: LandmarkCloud | null, name: string): Column | null {
  return cloud?.columns.find((column) => column.name === name) ?? null;
}

export function columnValue(column: Column, index: number): number {
  return column.offset + column.scale * column.values[index];
}

/** One scale for all clouds that have the column, from their 2nd to 98th percentiles. */
export function columnScale(clouds: (LandmarkCloud | null)[], name: string, log: boolean | null): ColorScale | null {
  const columns = clouds.flatMap((cloud) => columnOf(cloud, name) ?? []);
  const ranges = columns.flatMap((column) => {
    const range = robustRange((i) => columnValue(column, i), column.values.length);
    return range ? [range] : [];
  });
  if (ranges.length === 0) {
    return null;
  }
  let low = Math.min(...ranges.map((range) => range[0]));
  let high = Math.max(...ranges.map((range) => range[1]));
  if (!(high > low)) {
    const air = Math.abs(low) * 0.05 || 0.5;
    low -= low > 0 ? Math.min(air, low / 2) : air;
    high += air;
  }
  return { label: columns[0].label, unit: columns[0].unit, low, high, log: low > 0 && (log ?? high / low > 30) };
}

/** Round values on a scale, with their places from 0 to 1. */
export function scaleTicks(scale: ColorScale): { value: number; t: number }[] {
  const { low, high, log } = scale;
  if (!log) {
    const raw = (high - low) / 4;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * power).find((candidate) => candidate >= raw * 0.8) ?? raw;
    const ticks = [];
    for (let i = Math.ceil(low / step - 1e-9) + 0; i * step <= high * (1 + 1e-9); ++i) {
      ticks.push({ value: i * step, t: (i * step - low) / (high - low) });
    }
    return ticks;
  }
  const decades = Math.log10(high / low);
  const mantissas = decades > 2.5 ? [1] : decades > 1.2 ? [1, 3] : [1, 2, 5];
  const ticks = [];
  for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); ++e) {
    for (const mantissa of mantissas) {
      const value = mantissa * 10 ** e;
      if (value >= low * 0.999 && value <= high * 1.001) {
        ticks.push({ value, t: Math.log(value / low) / Math.log(high / low) });
      }
    }
  }
  return ticks;
}

// SPDX-License-Identifier: BSD-3-Clause
import type { Palette } from "./theme";

export const kSymbols = ["circle", "square", "triangle", "diamond", "cross", "star", "wye", "times"] as const;
export const kDashes = ["", "7 3", "2 3", "8 3 2 3", "12 3", "4 2", "1 4", "10 2 2 2 2 2"];

const order: string[] = ["base", "covariance", "observations", "distance"];

/** A name's place among all names of the page: the same strategy looks the same everywhere. */
export function seriesIndex(name: string): number {
  const known = order.indexOf(name);
  return known >= 0 ? known : order.push(name) - 1;
}

const given = new Map<string, (colors: Palette) => string>();

/** Has series of this name drawn in a colour that something else on the page has given it. */
export function giveSeriesColor(name: string, color: (colors: Palette) => string): void {
  given.set(name, color);
}

export function seriesColor(name: string, colors: Palette): string {
  const own = given.get(name);
  if (own) {
    return own(colors);
  }
  return colors.series[seriesIndex(name) % colors.series.length];
}

export function seriesSymbol(name: string): (typeof kSymbols)[number] {
  return kSymbols[seriesIndex(name) % kSymbols.length];
}

export function seriesDash(name: string): string {
  return kDashes[seriesIndex(name) % kDashes.length];
}

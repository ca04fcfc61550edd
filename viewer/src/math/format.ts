// SPDX-License-Identifier: BSD-3-Clause

const kMinus = "\u2212";

export function superscript(value: number): string {
  return String(value).replace(/[-0-9]/g, (digit) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(digit)]);
}

/** A number for people: `digits` significant ones, powers of ten only where zeros would mislead. */
export function formatNumber(value: number | null | undefined, digits = 4): string {
  if (value === null || value === undefined || Number.isNaN(value)) {
    return "–";
  }
  if (!Number.isFinite(value)) {
    return value > 0 ? "∞" : `${kMinus}∞`;
  }
  if (value === 0) {
    return "0";
  }
  const size = Math.abs(value);
  if (Number.isInteger(value) && size < 1e15) {
    return groupDigits(String(size), value < 0);
  }
  if (size < 1e-4 || size >= 1e9) {
    const [mantissa, exponent] = size.toExponential(digits - 1).split("e");
    const sign = value < 0 ? kMinus : "";
    return `${sign}${trimZeros(mantissa)}×10${superscript(Number(exponent))}`;
  }
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return groupDigits(trimZeros(size.toFixed(Math.min(decimals, 12))), value < 0);
}

/** A number with a fixed count of decimals, as a table's column asks for. */
export function formatFixed(value: number, decimals: number): string {
  if (!Number.isFinite(value)) {
    return formatNumber(value);
  }
  const text = Math.abs(value).toFixed(Math.min(decimals, 20));
  return groupDigits(text, value < 0 && Number(text) !== 0);
}

export function formatCount(value: number): string {
  return groupDigits(String(Math.round(value)), false);
}

function trimZeros(text: string): string {
  return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
}

/** Thin spaces between thousands from five digits on. */
function groupDigits(text: string, negative: boolean): string {
  const [whole, fraction] = text.split(".");
  const grouped = whole.length > 4 ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole;
  return `${negative ? kMinus : ""}${grouped}${fraction ? `.${fraction}` : ""}`;
}

/** A probability in percent, as probability_text() in C++ writes it: rounded down, never 0 % or 100 %. */
export function formatProbability(probability: number): string {
  if (probability < 0.0001) {
    return "<0.01 %";
  }
  if (probability > 0.999999) {
    return ">99.9999 %";
  }
  const digits = probability < 0.9999 ? 2 : 4;
  const units = 10 ** digits;
  // 0.9983 is stored as a little less.
  return `${(Math.floor(100 * units * probability + 1e-6) / units).toFixed(digits)} %`;
}

/** A share in percent. */
export function formatShare(share: number): string {
  return `${trimZeros((100 * share).toFixed(1))} %`;
}

/** A length for people, in the unit that keeps it short. */
export function formatLength(value: number, unit: "m" | "mapunits"): string {
  if (!Number.isFinite(value)) {
    return "–";
  }
  if (unit === "mapunits") {
    return `${formatNumber(value, 3)} map units`;
  }
  const size = Math.abs(value);
  if (size > 0 && size < 0.01) {
    return `${formatNumber(value * 1000, 3)} mm`;
  }
  if (size > 0 && size < 1) {
    return `${formatNumber(value * 100, 3)} cm`;
  }
  return `${formatNumber(value, 4)} m`;
}

const kUnits: [RegExp, string][] = [
  [/_deg$/, "°"],
  [/_rad$/, "rad"],
  [/_m2$/, "m²"],
  [/_m$/, "m"],
  [/_s$/, "s"],
  [/_ms$/, "ms"],
  [/_mapunits2$/, "map units²"],
  [/_mapunits$/, "map units"],
  [/_percent$/, "%"],
  [/_px$/, "px"],
];

/** `translation_error_m` to "Translation error" and "m". */
export function labelOf(name: string): { label: string; unit: string | null } {
  let rest = name;
  let unit: string | null = null;
  for (const [pattern, text] of kUnits) {
    if (pattern.test(rest)) {
      rest = rest.replace(pattern, "");
      unit = text;
      break;
    }
  }
  const words = rest.replace(/_/g, " ").trim();
  return { label: words ? words[0].toUpperCase() + words.slice(1) : name, unit };
}

/** "1.5, 2, 3": a position, or any few numbers. */
export function positionText(p: readonly number[], digits = 4): string {
  return p.map((value) => formatNumber(value, digits)).join(", ");
}

export function idText(ids: Uint32Array | null, index: number): string {
  if (!ids) {
    return String(index);
  }
  const high = ids[2 * index + 1];
  const low = ids[2 * index];
  return high === 0 ? String(low) : String((BigInt(high) << 32n) | BigInt(low));
}

/** A round number (1, 2 or 5 times a power of ten) that is at most `value`. */
export function niceBelow(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const mantissa = value / power;
  return (mantissa >= 5 ? 5 : mantissa >= 2 ? 2 : 1) * power;
}

/** "3 min 20 s": the two largest parts. */
export function durationText(seconds: number): string {
  if (seconds < 60) {
    return `${Number(seconds.toPrecision(3))} s`;
  }
  const whole = Math.round(seconds);
  const parts: [number, string][] = [
    [Math.floor(whole / 86400), "d"],
    [Math.floor(whole / 3600) % 24, "h"],
    [Math.floor(whole / 60) % 60, "min"],
    [whole % 60, "s"],
  ];
  const first = parts.findIndex(([count]) => count > 0);
  return parts
    .slice(first, first + 2)
    .filter(([count]) => count > 0)
    .map(([count, unit]) => `${count} ${unit}`)
    .join(" ");
}

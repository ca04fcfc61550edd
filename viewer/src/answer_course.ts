// SPDX-License-Identifier: BSD-3-Clause
// How the candidates of an alignment fall behind from measure to measure until one is left, or none.
import type { AlignmentAnswer, AnswerCandidate } from "./document/report";
import { s } from "./dom";
import { formatNumber, formatProbability, formatShare } from "./math/format";

const kWidth = 340;
const kHeight = 190;
const kLeft = 34;
const kRight = 34;
const kTop = 22;
const kBottom = 34;
const kMostDrawn = 40;

interface Measure {
  name: string;
  value: (candidate: AnswerCandidate) => number;
  text: (value: number) => string;
}

const kMeasures: Measure[] = [
  { name: "Matched", value: ({ share }) => share, text: (value) => formatShare(value) },
  {
    name: "Evidence",
    value: ({ evidence }) => evidence.reduce((sum, one) => sum + Math.max(0, one.value), 0),
    text: (value) => formatNumber(value, 3),
  },
  {
    name: "Probability",
    value: ({ probability }) => probability,
    text: (value) => (value === 1 ? "100 %" : formatProbability(value)),
  },
];

/** A line a candidate over the measures in the order in which they judge it; each axis starts at zero. */
export function drawCourse({ candidates }: AlignmentAnswer): SVGElement {
  const drawn = candidates.slice(0, kMostDrawn);
  const tops = kMeasures.map((measure) => Math.max(...drawn.map(measure.value), 0));
  // A probability is of 1, whatever the likeliest has.
  tops[kMeasures.length - 1] = 1;
  const x = (i: number) => kLeft + ((kWidth - kLeft - kRight) * i) / (kMeasures.length - 1);
  const floor = kHeight - kBottom;
  const y = (i: number, value: number) => floor - (floor - kTop) * (tops[i] > 0 ? value / tops[i] : 0);
  const svg = s("svg", {
    class: "course-svg",
    viewBox: `0 0 ${kWidth} ${kHeight}`,
    role: "img",
    "aria-label": describe(drawn, candidates.length),
  });
  kMeasures.forEach((measure, i) => {
    svg.append(
      s("line", { class: "course-axis", x1: x(i), x2: x(i), y1: kTop, y2: floor }),
      s("text", { class: "course-text", x: x(i), y: kTop - 8, "text-anchor": "middle" }, measure.text(tops[i])),
      s("text", { class: "course-text", x: x(i), y: floor + 14, "text-anchor": "middle" }, "0"),
      s("text", { class: "course-name", x: x(i), y: floor + 29, "text-anchor": "middle" }, measure.name),
    );
  });
  // The likeliest last, on top of the others.
  [...drawn.keys()].reverse().forEach((index) => {
    const points = kMeasures.map((measure, i) => [x(i), y(i, measure.value(drawn[index]))]);
    const line = s("g", { class: index === 0 ? "course-line is-first" : "course-line" });
    line.append(
      s("polyline", {
        points: points.map((point) => point.map((v) => v.toFixed(1)).join(",")).join(" "),
        fill: "none",
      }),
      ...points.map(([cx, cy]) => s("circle", { cx, cy, r: index === 0 ? 3.5 : 2.2 })),
    );
    svg.append(line);
  });
  return svg;
}

function describe(drawn: AnswerCandidate[], count: number): string {
  const texts = drawn
    .slice(0, 3)
    .map((candidate, index) =>
      [`candidate ${index + 1}`, ...kMeasures.map((one) => `${one.name} ${one.text(one.value(candidate))}`)].join(", "),
    );
  return `The course of ${count} candidates: ${texts.join("; ")}.`;
}

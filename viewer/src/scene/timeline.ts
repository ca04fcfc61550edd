// SPDX-License-Identifier: BSD-3-Clause
import { button, chooser, h, s, toggleChip } from "../dom";
import type { Run } from "../document/report";
import { formatNumber } from "../math/format";
import { seriesColor, seriesDash } from "../series_style";
import { palette } from "../theme";

const kStepMs = 70;
const kCurveHeight = 56;
/** Half a slider thumb: the curve's ends stand where the thumb's middle can be. */
const kInset = 8;

type MetricKey = "scores" | "meanSquaredDistance" | "rotationErrorDeg" | "translationErrorM";

const kMetrics: { key: MetricKey; label: string; unit: string }[] = [
  { key: "scores", label: "Score", unit: "²" },
  { key: "meanSquaredDistance", label: "Mean squared distance", unit: "²" },
  { key: "rotationErrorDeg", label: "Rotation error", unit: "°" },
  { key: "translationErrorM", label: "Translation error", unit: "" },
];

/** Slider, play button and a small convergence curve whose cursor is the slider. */
export class Timeline {
  readonly element: HTMLElement;
  readonly #slider: HTMLInputElement;
  readonly #output = h("output", { class: "iteration" });
  readonly #play: HTMLButtonElement;
  readonly #curve = s("svg", { class: "curve", height: kCurveHeight, role: "img" });
  readonly #cursor = s("line", { class: "curve-cursor", y1: 0, y2: kCurveHeight });
  readonly #dots = s("g");
  readonly #range = h("span", { class: "curve-range muted" });
  readonly #runs: Run[];
  readonly #max: number;
  readonly #lengthUnit: string;
  readonly #onMove: (iteration: number) => void;
  #fromZero = true;
  #visible: (run: Run) => boolean = () => true;
  #metric: (typeof kMetrics)[number] | null;
  #timer = 0;
  #iteration = 0;
  #points: { run: Run; x: number[]; y: number[] }[] = [];

  constructor(runs: Run[], max: number, lengthUnit: "m" | "mapunits", onMove: (iteration: number) => void) {
    this.#runs = runs;
    this.#max = max;
    this.#lengthUnit = lengthUnit === "m" ? "m" : "map units";
    this.#onMove = onMove;
    const metrics = kMetrics.filter(({ key }) => runs.some((run) => run[key] !== null));
    this.#metric = metrics[0] ?? null;
    this.#slider = h("input", {
      type: "range",
      min: 0,
      max,
      step: 1,
      value: max,
      class: "slider",
      "aria-label": "Iteration",
    });
    this.#slider.addEventListener("input", () => {
      this.pause();
      this.#moved(Number(this.#slider.value));
    });
    this.#play = button("Play", () => this.toggle(), { class: "play", "aria-label": "Play the iterations" });
    const curve = chooser(
      "Curve",
      metrics.map(({ label }, index) => [index, label]),
      0,
      (index) => {
        this.#metric = metrics[index];
        this.redraw();
      },
    );
    const startAtZero = (fromZero: boolean) => {
      this.#fromZero = fromZero;
      this.redraw();
    };
    const zero = toggleChip("From zero", true, startAtZero, {
      title: "Whether the curve’s axis starts at zero or fits the values",
    });
    this.element = h(
      "div",
      { class: "timeline" },
      h(
        "div",
        { class: "timeline-controls" },
        button("Initial", () => this.jump(0), { class: "quiet", title: "Home" }),
        this.#play,
        button("Final", () => this.jump(max), { class: "quiet", title: "End" }),
        this.#output,
      ),
      h("div", { class: "timeline-track" }, metrics.length > 0 && this.#curve, this.#slider),
      h(
        "div",
        { class: "timeline-metric" },
        metrics.length > 1 ? curve : h("span", { class: "metric-name" }, metrics[0]?.label ?? ""),
        metrics.length > 0 && zero,
        this.#range,
      ),
    );
    new ResizeObserver(() => this.redraw()).observe(this.#slider);
  }

  get iteration(): number {
    return this.#iteration;
  }

  showRuns(visible: (run: Run) => boolean): void {
    this.#visible = visible;
    this.redraw();
  }

  jump(iteration: number): void {
    this.pause();
    this.#moved(iteration);
  }

  step(by: number): void {
    this.jump(this.#iteration + by);
  }

  toggle(): void {
    if (this.#timer) {
      this.pause();
      return;
    }
    if (this.#iteration >= this.#max) {
      this.#moved(0);
    }
    this.#play.textContent = "Pause";
    this.#play.setAttribute("aria-label", "Pause");
    const tick = () => {
      this.#moved(this.#iteration + 1);
      if (this.#iteration >= this.#max) {
        this.pause();
      } else {
        this.#timer = window.setTimeout(tick, kStepMs);
      }
    };
    this.#timer = window.setTimeout(tick, kStepMs);
  }

  pause(): void {
    clearTimeout(this.#timer);
    this.#timer = 0;
    this.#play.textContent = "Play";
    this.#play.setAttribute("aria-label", "Play the iterations");
  }

  #moved(iteration: number): void {
    this.#iteration = Math.min(this.#max, Math.max(0, iteration));
    this.#slider.value = String(this.#iteration);
    this.#slider.setAttribute("aria-valuetext", `Iteration ${this.#iteration} of ${this.#max}`);
    this.#output.textContent = `${this.#iteration} / ${this.#max}`;
    this.#placeCursor();
    this.#onMove(this.#iteration);
  }

  #x(iteration: number, width: number): number {
    return kInset + ((width - 2 * kInset) * iteration) / Math.max(1, this.#max);
  }

  #placeCursor(): void {
    const x = this.#x(this.#iteration, this.#slider.clientWidth);
    this.#cursor.setAttribute("x1", String(x));
    this.#cursor.setAttribute("x2", String(x));
    this.#dots.replaceChildren(
      ...this.#points.flatMap(({ run, x: xs, y }) => {
        const i = Math.min(this.#iteration, y.length - 1);
        return Number.isFinite(y[i])
          ? [s("circle", { cx: xs[i], cy: y[i], r: 3.5, fill: seriesColor(run.name, palette()) })]
          : [];
      }),
    );
  }

  redraw(): void {
    const width = this.#slider.clientWidth;
    this.#points = [];
    this.#curve.setAttribute("width", String(width));
    this.#curve.setAttribute("viewBox", `0 0 ${width} ${kCurveHeight}`);
    const metric = this.#metric;
    if (!metric || width === 0) {
      return;
    }
    const shown = this.#runs.filter((run) => run[metric.key] && this.#visible(run));
    const all = this.#runs.flatMap((run) => [...(run[metric.key] ?? [])]).filter((v) => Number.isFinite(v));
    const positive = all.filter((v) => v > 0);
    const logarithmic = !this.#fromZero && positive.length > all.length * 0.9;
    const values = logarithmic ? positive : all;
    const low = values.reduce((a, b) => Math.min(a, b), this.#fromZero ? 0 : Infinity);
    const high = values.reduce((a, b) => Math.max(a, b), -Infinity);
    const place = (v: number) => {
      const t = logarithmic ? Math.log(v / low) / Math.log(high / low) : (v - low) / (high - low);
      return kCurveHeight - 5 - (kCurveHeight - 10) * (Number.isFinite(t) ? t : high > low ? NaN : 0.5);
    };
    this.#curve.replaceChildren();
    for (const run of shown) {
      const series = run[metric.key] ?? new Float64Array();
      const y = [...series].map((v) => (Number.isFinite(v) && (!logarithmic || v > 0) ? place(v) : NaN));
      const x = y.map((_, i) => this.#x(i, width));
      let path = "";
      let pen = false;
      y.forEach((value, i) => {
        if (Number.isFinite(value)) {
          path += `${pen ? "L" : "M"}${x[i].toFixed(1)},${value.toFixed(1)}`;
        }
        pen = Number.isFinite(value);
      });
      this.#curve.append(
        s("path", {
          d: path,
          fill: "none",
          stroke: seriesColor(run.name, palette()),
          "stroke-width": 1.75,
          "stroke-dasharray": seriesDash(run.name) || null,
          "stroke-linejoin": "round",
        }),
      );
      this.#points.push({ run, x, y });
    }
    this.#curve.append(this.#cursor, this.#dots);
    const unit = metric.unit === "²" ? ` ${this.#lengthUnit}²` : metric.unit || ` ${this.#lengthUnit}`;
    this.#range.textContent = values.length ? `${formatNumber(low, 3)} – ${formatNumber(high, 3)}${unit}` : "";
    this.#curve.setAttribute(
      "aria-label",
      `${metric.label} over the iterations, ${this.#range.textContent}${logarithmic ? ", logarithmic" : ""}`,
    );
    this.#placeCursor();
  }
}

// SPDX-License-Identifier: BSD-3-Clause
import { isPrinting } from "../paper";
import { kSmoothUpTo } from "./controls";
import { RenderService } from "./render_service";
import type { Quality } from "./view3d";

/** How long a view rests before it is drawn in full. */
const kSettleMs = 180;

interface DrawnFigure {
  readonly element: HTMLElement;
  /** How many landmarks a picture shows. */
  drawnLandmarks(): number;
  /** Draws what changed, or a part of it. @return whether something is left to draw */
  drawFrame(quality: Quality): boolean;
  redraw(): void;
}

/** Draws a figure only when something changed and it is near the window: cheaply while it changes, in full once it rests. */
export class Drawing {
  readonly service = RenderService.shared();
  readonly #figure: DrawnFigure;
  #settled: (() => void) | null;
  #frame = 0;
  #settleTimer = 0;
  #moving = false;
  #near = false;
  #pending = true;

  /** `settled` is called once the first picture is drawn, or the figure is far from the window. */
  constructor(figure: DrawnFigure, settled: () => void) {
    this.#figure = figure;
    this.#settled = settled;
    this.service.onRestored(() => figure.redraw());
    new IntersectionObserver(
      (entries) => {
        this.#near = entries.some((entry) => entry.isIntersecting);
        if (!this.#near) {
          this.#settle();
        } else if (this.#pending) {
          this.schedule(false);
        }
      },
      { rootMargin: "400px" },
    ).observe(figure.element);
  }

  schedule(moving: boolean): void {
    this.#figure.element.dataset.drawn = "pending";
    this.#pending = true;
    if (moving && (this.service.software || this.#figure.drawnLandmarks() > kSmoothUpTo)) {
      this.#moving = true;
      clearTimeout(this.#settleTimer);
      this.#settleTimer = window.setTimeout(() => {
        this.#moving = false;
        this.#figure.redraw();
      }, kSettleMs);
    }
    if (!this.service.available) {
      this.report();
    } else if (this.#near && !this.#frame) {
      this.#frame = requestAnimationFrame(() => this.#drawFrame());
    }
  }

  #drawFrame(): void {
    this.#frame = 0;
    if (isPrinting()) {
      return;
    }
    if (this.#figure.drawFrame(this.#quality())) {
      this.schedule(false);
    } else {
      this.report();
    }
  }

  #quality(): Quality {
    const smooth = this.#figure.drawnLandmarks() <= kSmoothUpTo && !this.#moving ? 2 : 1;
    const ratio = this.service.software ? 1 : Math.min(window.devicePixelRatio || 1, 2);
    return { resolution: Math.max(smooth, ratio), preview: this.#moving };
  }

  /** Tells the page that the figure is up, and tests that the picture is the final one. */
  report(): void {
    this.#pending = false;
    this.#figure.element.dataset.drawn = this.#moving ? "preview" : "full";
    this.#settle();
  }

  #settle(): void {
    this.#settled?.();
    this.#settled = null;
  }
}

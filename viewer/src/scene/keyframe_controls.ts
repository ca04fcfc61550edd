// SPDX-License-Identifier: BSD-3-Clause
import type { Frames } from "../document/report";
import { button, h, toggleChip } from "../dom";
import { formatCount } from "../math/format";
import { toolGroup } from "./controls";
import { keyframeText, type Keyframe } from "./keyframes";

/** A map whose keyframes can be entered. */
export interface EnterableMap<R> {
  role: R;
  name: string;
  frames: Frames;
}

interface KeyframeActions<R> {
  enter(keyframe: Keyframe<R>): void;
  /** Enters the keyframe nearest to the eye, of any map if `role` is null. */
  enterNearest(role: R | null): void;
  leave(): void;
  showImages(shown: boolean): void;
}

/** Chooses the keyframe to look through, and leaves it. */
export class KeyframeControls<R> {
  readonly element: HTMLElement;
  readonly #actions: KeyframeActions<R>;
  readonly #maps = h("select", { "aria-label": "Map of the keyframe" });
  readonly #slider = h("input", { type: "range", class: "frame-slider", min: 0, value: 0, "aria-label": "Keyframe" });
  readonly #output = h("output", { class: "frame-output" });
  readonly #toggle = button("Enter", () => this.toggle(), { title: "Key C" });
  readonly #image: HTMLButtonElement;
  #offered: readonly EnterableMap<R>[] = [];
  /** Which of them the slider is of. */
  #shown = 0;
  #entered: Keyframe<R> | null = null;

  constructor(maps: readonly EnterableMap<R>[], actions: KeyframeActions<R>) {
    this.#actions = actions;
    this.#maps.addEventListener("change", () => {
      this.#shown = this.#maps.selectedIndex;
      if (this.#entered) {
        actions.enterNearest(this.#offered[this.#shown].role);
      } else {
        this.show(null);
      }
    });
    this.#slider.addEventListener("input", () => this.#enter(Number(this.#slider.value)));
    const showImages = (shown: boolean) => actions.showImages(shown);
    this.#image = toggleChip("Image", true, showImages, { title: "Show what the keyframe saw" });
    this.element = toolGroup(
      "Keyframe",
      this.#maps,
      button("‹", () => this.step(-1), {
        class: "quiet frame-step",
        "aria-label": "Previous keyframe",
        title: "Key [",
      }),
      this.#slider,
      button("›", () => this.step(1), { class: "quiet frame-step", "aria-label": "Next keyframe", title: "Key ]" }),
      this.#output,
      this.#image,
      this.#toggle,
    );
    this.element.classList.add("frame-tools");
    this.offer(maps);
  }

  /** Offers the keyframes of these maps, none of which is entered. */
  offer(maps: readonly EnterableMap<R>[]): void {
    this.#offered = maps;
    this.#shown = 0;
    this.#maps.replaceChildren(...maps.map(({ name }, index) => h("option", { value: index }, name)));
    this.#maps.hidden = maps.length < 2;
    this.#image.hidden = maps.every(({ frames }) => frames.images.size === 0);
    this.element.hidden = maps.length === 0;
    this.show(null);
  }

  /** Shows which keyframe is entered, if any. */
  show(entered: Keyframe<R> | null): void {
    this.#entered = entered;
    const index = entered ? this.#offered.findIndex(({ role }) => role === entered.role) : -1;
    this.#shown = index < 0 ? this.#shown : index;
    const frames = this.#offered[this.#shown]?.frames;
    if (!frames) {
      return;
    }
    this.#maps.selectedIndex = this.#shown;
    this.#slider.max = String(frames.count - 1);
    if (entered) {
      this.#slider.value = String(entered.frame);
    }
    const text = entered ? keyframeText(frames, entered.frame) : `${formatCount(frames.count)} keyframes`;
    this.#output.textContent = text;
    this.#slider.setAttribute("aria-valuetext", keyframeText(frames, Number(this.#slider.value)));
    this.#toggle.textContent = entered ? "Leave" : "Enter";
    this.#image.disabled = entered !== null && !frames.images.has(entered.frame);
    this.element.classList.toggle("is-entered", entered !== null);
  }

  toggle(): void {
    if (this.#offered.length === 0) {
      return;
    }
    if (this.#entered) {
      this.#actions.leave();
    } else {
      this.#actions.enterNearest(null);
    }
  }

  /** To a neighbour of the keyframe entered, else into that of the slider. */
  step(by: number): void {
    this.#enter(Number(this.#slider.value) + (this.#entered ? by : 0));
  }

  #enter(frame: number): void {
    const map = this.#offered[this.#shown];
    if (map) {
      this.#actions.enter({ role: map.role, frame: Math.min(map.frames.count - 1, Math.max(0, frame)) });
    }
  }
}

// SPDX-License-Identifier: BSD-3-Clause
import { button, h } from "../dom";
import { formatCount } from "../math/format";
import { toolGroup } from "./controls";
import { keyframeText, type Keyframe } from "./keyframes";
import type { Role, SceneModel } from "./scene_model";

interface KeyframeActions {
  enter(keyframe: Keyframe): void;
  /** Enters the keyframe nearest to the eye, of any map if `role` is null. */
  enterNearest(role: Role | null): void;
  leave(): void;
  showImages(shown: boolean): void;
}

/** Chooses the keyframe to look through, and leaves it. */
export class KeyframeControls {
  readonly element: HTMLElement;
  readonly #model: SceneModel;
  readonly #actions: KeyframeActions;
  readonly #maps = h("select", { "aria-label": "Map of the keyframe" });
  readonly #slider = h("input", { type: "range", class: "frame-slider", min: 0, value: 0, "aria-label": "Keyframe" });
  readonly #output = h("output", { class: "frame-output" });
  readonly #toggle = button("Enter", () => this.toggle(), { title: "Key C" });
  readonly #image: HTMLButtonElement;
  #role: Role;
  #entered: Keyframe | null = null;

  constructor(model: SceneModel, roles: readonly Role[], actions: KeyframeActions) {
    this.#model = model;
    this.#actions = actions;
    this.#role = roles[0];
    this.#maps.append(...roles.map((role) => h("option", { value: role }, role === "source" ? "Source" : "Target")));
    this.#maps.addEventListener("change", () => {
      this.#role = this.#maps.value as Role;
      if (this.#entered) {
        actions.enterNearest(this.#role);
      } else {
        this.show(null);
      }
    });
    this.#slider.addEventListener("input", () => this.#enter(Number(this.#slider.value)));
    this.#image = button(
      "Image",
      () => {
        const shown = this.#image.getAttribute("aria-pressed") !== "true";
        this.#image.setAttribute("aria-pressed", String(shown));
        actions.showImages(shown);
      },
      { class: "chip", "aria-pressed": "true", title: "Show what the keyframe saw" },
    );
    const hasImages = roles.some((role) => (model.frames(role)?.images.size ?? 0) > 0);
    this.element = toolGroup(
      "Keyframe",
      roles.length > 1 ? this.#maps : null,
      button("‹", () => this.step(-1), {
        class: "quiet frame-step",
        "aria-label": "Previous keyframe",
        title: "Key [",
      }),
      this.#slider,
      button("›", () => this.step(1), { class: "quiet frame-step", "aria-label": "Next keyframe", title: "Key ]" }),
      this.#output,
      hasImages ? this.#image : null,
      this.#toggle,
    );
    this.element.classList.add("frame-tools");
    this.show(null);
  }

  /** Shows which keyframe is entered, if any. */
  show(entered: Keyframe | null): void {
    this.#entered = entered;
    this.#role = entered?.role ?? this.#role;
    const frames = this.#model.frames(this.#role);
    if (!frames) {
      return;
    }
    this.#maps.value = this.#role;
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
    this.#actions.enter({ role: this.#role, frame: Math.min(Number(this.#slider.max), Math.max(0, frame)) });
  }
}

// SPDX-License-Identifier: BSD-3-Clause
import { button, h, toggleChip } from "../dom";
import { showHelp } from "./keyboard";
import type { Extent } from "./extent";
import { listenForGestures, type OrbitState, type StandardView } from "./orbit";

/** Landmarks that can be drawn while things move, without and with a graphics card. */
export const kSoftwareBudget = 120_000;
export const kHardwareBudget = 4_000_000;
/** Up to so many landmarks a picture is drawn with twice the resolution and shrunk, which smooths it. */
export const kSmoothUpTo = 60_000;
/** Of more landmarks, the one below the pointer is looked for only once the pointer rests. */
export const kHoverUpTo = 200_000;
const kHoverRestMs = 140;

export function toolGroup(label: string, ...children: (Node | null)[]): HTMLElement {
  return h(
    "div",
    { class: "tool-group", role: "group", "aria-label": label },
    h("span", { class: "tool-label", "aria-hidden": "true" }, label),
    ...children,
  );
}

/** On a phone the rest of the tools waits behind a button; elsewhere the button is not there. */
export function moreTools(): { toggle: HTMLButtonElement; more: HTMLElement } {
  const more = h("div", { class: "tool-more" });
  const toggle = button(
    "View options",
    () => toggle.setAttribute("aria-expanded", String(more.classList.toggle("is-open"))),
    { class: "tool-toggle", "aria-expanded": "false" },
  );
  return { toggle, more };
}

/** A chip that shows and hides a layer; `changed` is called afterwards. */
export function layerChip<Name extends string>(
  label: string,
  name: Name,
  layers: Record<Name, boolean>,
  changed: () => void,
): HTMLButtonElement {
  const toggle = (shown: boolean) => {
    layers[name] = shown;
    changed();
  };
  return toggleChip(label, layers[name], toggle, { "data-layer": name });
}

export function pointSizes(
  range: { min: number; max: number; step: number },
  value: number,
  changed: (size: number) => void,
): HTMLElement {
  const size = h("input", { type: "range", ...range, value, "aria-label": "Point size", class: "size" });
  size.addEventListener("input", () => changed(Number(size.value)));
  return toolGroup("Points", size);
}

export function standardViews(look: (name: StandardView) => void): HTMLElement {
  const views: [StandardView, string][] = [
    ["home", "Reset"],
    ["top", "Top"],
    ["front", "Front"],
    ["side", "Side"],
  ];
  return toolGroup(
    "View",
    ...views.map(([name, label]) => button(label, () => look(name), { class: "quiet", "data-view": name })),
  );
}

export function pictureAndHelp(savePicture: () => Promise<void>): HTMLElement {
  return h(
    "div",
    { class: "tool-group tool-end" },
    button("PNG", () => void savePicture(), { class: "quiet", "aria-label": "Save the view as PNG" }),
    button("?", showHelp, { class: "quiet", "aria-label": "Keys and gestures", title: "Keys and gestures" }),
  );
}

/** A 3D view that can be turned, and in which things can be picked. */
interface PickedView<Pick> {
  readonly overlay: HTMLElement;
  pick(x: number, y: number, touch: boolean): Pick | null;
  hover(pick: Pick | null, x: number, y: number): void;
  hint(text: string): void;
}

/** Turns, zooms and picks by pointer. */
export function listenToView<Pick>(
  view: PickedView<Pick>,
  model: { readonly extent: Extent; readonly landmarkCount: number },
  actions: { turn(change: (orbit: OrbitState) => void): void; select(pick: Pick | null): void; wheelZooms(): boolean },
): void {
  let hoverTimer = 0;
  listenForGestures(view.overlay, {
    rotate: (right, down) => actions.turn((orbit) => model.extent.orbit.rotate(orbit, right, down)),
    pan: (right, down) => actions.turn((orbit) => model.extent.orbit.pan(orbit, right, down)),
    zoom: (factor) => actions.turn((orbit) => model.extent.orbit.zoom(orbit, factor, model.extent.reach)),
    press: (x, y, touch) => {
      view.overlay.focus({ preventScroll: true });
      actions.select(view.pick(x, y, touch));
    },
    hover: (x, y) => {
      clearTimeout(hoverTimer);
      const rest = model.landmarkCount > kHoverUpTo ? kHoverRestMs : 0;
      hoverTimer = window.setTimeout(() => view.hover(view.pick(x, y, false), x, y), rest);
    },
    leave: () => {
      clearTimeout(hoverTimer);
      view.hover(null, 0, 0);
    },
    wheelZooms: actions.wheelZooms,
    wheelIgnored: () => view.hint("Click the view to zoom with the wheel"),
  });
}

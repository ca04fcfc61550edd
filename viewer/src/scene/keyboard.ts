// SPDX-License-Identifier: BSD-3-Clause
import { button, h } from "../dom";

export interface KeyTarget {
  element: HTMLElement;
  step(by: number): void;
  jump(to: "first" | "last"): void;
  playPause(): void;
  resetView(): void;
  toggleRun(index: number): void;
  turn(right: number, down: number): void;
  zoom(factor: number): void;
  /** Of scenes whose keyframes can be entered. */
  keyframes?: { toggle(): void; step(by: number): void };
  escape(): boolean;
}

const scenes: KeyTarget[] = [];
let help: HTMLDialogElement | null = null;

const kHelp: [string, string][] = [
  ["← →", "one iteration back or on"],
  ["Home, End", "initial or final pose"],
  ["Space", "play or pause"],
  ["1 … 9", "show or hide a strategy"],
  ["R", "reset the view"],
  ["Shift + arrows", "turn the view"],
  ["+  −", "zoom"],
  ["C", "look through the nearest keyframe’s camera, or leave it"],
  ["[  ]", "one keyframe back or on"],
  ["Esc", "leave a keyframe or an enlarged view, or close the record"],
  ["?", "this help"],
  ["Drag", "turn; right or Shift drag moves; two fingers move and zoom"],
  ["Wheel", "zoom, once the view is clicked (or with Ctrl)"],
  ["Click or tap", "a landmark’s record; a camera’s view"],
];

/** The scene that keys act on: the one with the focus, else the one most in view. */
function activeScene(): KeyTarget | null {
  const focused = scenes.find((scene) => scene.element.contains(document.activeElement));
  if (focused) {
    return focused;
  }
  const shown = (scene: KeyTarget) => {
    const box = scene.element.getBoundingClientRect();
    return Math.min(box.bottom, innerHeight) - Math.max(box.top, 0);
  };
  const best = [...scenes].sort((a, b) => shown(b) - shown(a))[0];
  return best && shown(best) > 80 ? best : null;
}

export function showHelp(): void {
  if (!help) {
    help = h(
      "dialog",
      { class: "help", "aria-label": "Keys and gestures" },
      h("h2", null, "Keys and gestures"),
      h(
        "dl",
        null,
        ...kHelp.map(([keys, text]) => h("div", null, h("dt", null, h("kbd", null, keys)), h("dd", null, text))),
      ),
      button("Close", () => help?.close()),
    );
    document.body.append(help);
  }
  if (!help.open) {
    help.showModal();
  }
}

function takesKeys(element: Element | null, key: string): boolean {
  if (!(element instanceof HTMLElement)) {
    return false;
  }
  if (element.matches("textarea, select, [contenteditable]")) {
    return true;
  }
  if (element instanceof HTMLInputElement) {
    return element.type === "range" || element.type === "checkbox"
      ? element.type === "range"
        ? /^(Arrow|Home|End|Page)/.test(key)
        : key === " "
      : true;
  }
  return (
    (key === " " && element.matches("button, a, summary")) ||
    (element.matches(".table-scroll, pre") && /^(Arrow|Home|End)/.test(key))
  );
}

function onKey(event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || help?.open) {
    return;
  }
  if (takesKeys(document.activeElement, event.key)) {
    return;
  }
  if (event.key === "?") {
    event.preventDefault();
    showHelp();
    return;
  }
  const scene = activeScene();
  if (!scene) {
    return;
  }
  const turn = Math.PI / 24;
  const shift = event.shiftKey;
  const actions: Record<string, () => void> = {
    ArrowLeft: () => (shift ? scene.turn(-turn, 0) : scene.step(-1)),
    ArrowRight: () => (shift ? scene.turn(turn, 0) : scene.step(1)),
    ...(shift ? { ArrowUp: () => scene.turn(0, turn), ArrowDown: () => scene.turn(0, -turn) } : {}),
    Home: () => scene.jump("first"),
    End: () => scene.jump("last"),
    " ": () => scene.playPause(),
    r: () => scene.resetView(),
    "+": () => scene.zoom(1 / 1.2),
    "=": () => scene.zoom(1 / 1.2),
    "-": () => scene.zoom(1.2),
    ...(scene.keyframes && {
      c: () => scene.keyframes?.toggle(),
      "[": () => scene.keyframes?.step(-1),
      "]": () => scene.keyframes?.step(1),
    }),
  };
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const own = Object.prototype.hasOwnProperty.call(actions, key) ? actions[key] : undefined;
  if (own) {
    event.preventDefault();
    own();
  } else if (event.key === "Escape") {
    if (scene.escape()) {
      event.preventDefault();
    }
  } else if (/^[1-9]$/.test(event.key)) {
    event.preventDefault();
    scene.toggleRun(Number(event.key) - 1);
  }
}

export function listenForKeys(scene: KeyTarget): void {
  if (scenes.length === 0) {
    document.addEventListener("keydown", onKey);
  }
  scenes.push(scene);
}

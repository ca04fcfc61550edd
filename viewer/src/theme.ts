// SPDX-License-Identifier: BSD-3-Clause
import { chooser } from "./dom";
import { isPrinting, onPaper } from "./paper";

export type ThemeName = "light" | "dark";
type Choice = "auto" | ThemeName;

/** Colours that canvases and charts need as values; the rest of the page takes its own from the style sheet. */
export interface Palette {
  name: ThemeName;
  background: string;
  ink: string;
  muted: string;
  rule: string;
  fill: string;
  /** Roles of a scene. Shapes tell them apart too: the source is discs, the target squares. */
  source: string;
  target: string;
  truth: string;
  match: string;
  sourceCamera: string;
  targetCamera: string;
  selection: string;
  noValue: string;
  /** Okabe and Ito's colours for series, in an order that keeps neighbours apart. */
  series: string[];
  threshold: string;
}

const kLight: Palette = {
  name: "light",
  background: "#ffffff",
  ink: "#1d2125",
  muted: "#5c6670",
  rule: "#e2e0db",
  fill: "#f4f3ef",
  source: "#009e73",
  target: "#23282d",
  truth: "#56b4e9",
  match: "#d98a00",
  sourceCamera: "#00704f",
  targetCamera: "#7a828a",
  selection: "#d55e00",
  noValue: "#c2c6ca",
  series: ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#4d4d4d", "#b8a800"],
  threshold: "#a3450a",
};

const kDark: Palette = {
  name: "dark",
  background: "#15191d",
  ink: "#e9e7e2",
  muted: "#9ba5ae",
  rule: "#30363c",
  fill: "#1e2328",
  source: "#24c795",
  target: "#dcdfe2",
  truth: "#56b4e9",
  match: "#e69f00",
  sourceCamera: "#6fdcb9",
  targetCamera: "#8d969e",
  selection: "#ff7a2e",
  noValue: "#4a5157",
  series: ["#4aa3df", "#e69f00", "#1fb98a", "#d98fb8", "#f07f3c", "#8accf2", "#b5b5b5", "#f0e442"],
  threshold: "#ff9a5c",
};

const kStorageKey = "cairn-theme";
const listeners = new Set<(palette: Palette) => void>();
const systemDark = window.matchMedia("(prefers-color-scheme: dark)");
let choice: Choice = "auto";

export function palette(): Palette {
  // Paper is white, whatever the reader's theme is.
  const dark = !isPrinting() && (choice === "dark" || (choice === "auto" && systemDark.matches));
  return dark ? kDark : kLight;
}

/** Exports look the same whatever the reader's theme is. */
export function exportPalette(): Palette {
  return kLight;
}

export function onThemeChange(listener: (palette: Palette) => void): void {
  listeners.add(listener);
}

function applyTheme(): void {
  document.documentElement.dataset.theme = palette().name;
  for (const listener of listeners) {
    listener(palette());
  }
}

function remembered(): Choice {
  try {
    const value = localStorage.getItem(kStorageKey);
    return value === "light" || value === "dark" ? value : "auto";
  } catch {
    return "auto"; // Pages from file:// may be refused storage.
  }
}

function remember(): void {
  try {
    localStorage.setItem(kStorageKey, choice);
  } catch {
    // As above; the choice then holds for this visit.
  }
}

export function startTheme(): void {
  choice = remembered();
  applyTheme();
  systemDark.addEventListener("change", applyTheme);
  onPaper(applyTheme, applyTheme);
}

/** The control: follow the system, light or dark. */
export function themeControl(): HTMLElement {
  const names: [Choice, string][] = [
    ["auto", "System theme"],
    ["light", "Light"],
    ["dark", "Dark"],
  ];
  const choose = (chosen: Choice) => {
    choice = chosen;
    remember();
    applyTheme();
  };
  return chooser("Colour theme", names, choice, choose, { class: "theme-select" });
}

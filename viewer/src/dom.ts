// SPDX-License-Identifier: BSD-3-Clause
// Elements are built here and text only ever becomes text nodes; nothing in the viewer writes markup.

type Child = Node | string | null | undefined | false;
type Attributes = Record<string, string | number | boolean | null | undefined>;

function fill(element: Element, attributes: Attributes | null, children: Child[]): void {
  for (const [name, value] of Object.entries(attributes ?? {})) {
    if (value === true) {
      element.setAttribute(name, "");
    } else if (value !== false && value !== null && value !== undefined) {
      element.setAttribute(name, String(value));
    }
  }
  element.append(...children.filter((child): child is Node | string => typeof child === "string" || !!child));
}

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes | null = null,
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  fill(element, attributes, children);
  return element;
}

export function s<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Attributes | null = null,
  ...children: Child[]
): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  fill(element, attributes, children);
  return element;
}

/** A small drawing beside a text that says the same. */
export function glyph(width: number, height: number, shape: SVGElement): SVGSVGElement {
  return s("svg", { width, height, viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" }, shape);
}

export function button(
  label: string,
  onPress: (event: MouseEvent) => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  const element = h("button", { type: "button", ...attributes }, label);
  element.addEventListener("click", onPress);
  return element;
}

/** A button that is on or off. */
export function toggleChip(
  label: string,
  pressed: boolean,
  onToggle: (pressed: boolean) => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  const chip = button(
    label,
    () => {
      const now = chip.getAttribute("aria-pressed") !== "true";
      chip.setAttribute("aria-pressed", String(now));
      onToggle(now);
    },
    { class: "chip", "aria-pressed": String(pressed), ...attributes },
  );
  return chip;
}

/** A list to choose one of `options` from, each a value and its text. */
export function chooser<Value extends string | number>(
  label: string,
  options: readonly (readonly [Value, string])[],
  chosen: Value | null,
  onChoose: (value: Value) => void,
  attributes: Attributes = {},
): HTMLSelectElement {
  const select = h(
    "select",
    { "aria-label": label, ...attributes },
    ...options.map(([value, text]) => h("option", { value, selected: value === chosen }, text)),
  );
  select.addEventListener("change", () => onChoose(options[select.selectedIndex][0]));
  return select;
}

/** Names and values; those without a value are left out. */
export function facts(
  className: string,
  entries: [name: string, value: Child, attributes?: Attributes][],
): HTMLElement {
  return h(
    "dl",
    { class: className },
    ...entries
      .filter(([, value]) => value !== null)
      .map(([name, value, attributes]) => h("div", attributes ?? null, h("dt", null, name), h("dd", null, value))),
  );
}

export type Status = "good" | "doubt" | "bad" | "plain";

export const kSigns: Record<Status, string> = { good: "✓", doubt: "?", bad: "✕", plain: "–" };

/** A word that says how good something is. */
export function badge(status: Status, text: string): HTMLElement {
  const sign = status === "plain" ? "" : `${kSigns[status]} `;
  return h("span", { class: "badge", "data-status": status }, sign + text);
}

/** A part of a drawing that is chosen by pointer and keyboard, as a button is. */
export function pressable(
  label: string,
  pressed: boolean,
  choose: () => void,
  attributes: Attributes,
  ...children: Child[]
): SVGGElement {
  const all = { role: "button", tabindex: 0, "aria-pressed": String(pressed), "aria-label": label, ...attributes };
  const group = s("g", all, ...children);
  group.addEventListener("click", choose);
  group.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      choose();
    }
  });
  return group;
}

/** Puts a new drawing in place of the old; what had the focus has it again, by its label. */
export function redrawn(place: HTMLElement, drawing: SVGElement): void {
  const active = document.activeElement;
  const focus = active && place.contains(active) ? active.getAttribute("aria-label") : null;
  place.replaceChildren(drawing);
  if (focus) {
    [...drawing.querySelectorAll<SVGElement>("[role=button]")]
      .find((item) => item.getAttribute("aria-label") === focus)
      ?.focus({ preventScroll: true });
  }
}

/** Paragraphs of plain text; blank lines separate them. */
export function paragraphs(text: string, className: string): HTMLElement[] {
  return text
    .split(/\n\s*\n/)
    .map((part) => part.trim())
    .filter(Boolean)
    .map((part) => h("p", { class: className }, part));
}

/** Hands a file to the reader, and says so. */
export function download(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  const link = h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
  announce(`${name} saved.`);
}

/** Text announced to screen readers without being shown. */
export function announce(text: string): void {
  const region = document.getElementById("announcer");
  if (region) {
    region.textContent = text;
  }
}

interface CopyOptions {
  caption?: string;
  /** For screen readers; the caption if it is not given. */
  label?: string;
  text?: () => string;
}

/** A button that copies the text of `shown`, or `text` in its stead; where the browser refuses, it selects `shown`. */
export function copyButton(shown: HTMLElement, options: CopyOptions = {}): HTMLButtonElement {
  const caption = options.caption ?? "Copy";
  const copy = button(
    caption,
    async () => {
      try {
        await navigator.clipboard.writeText(options.text?.() ?? shown.textContent ?? "");
        announce("Copied.");
        copy.textContent = "Copied";
        setTimeout(() => (copy.textContent = caption), 2000);
      } catch {
        getSelection()?.selectAllChildren(shown);
        announce("Selected, to be copied.");
      }
    },
    { "aria-label": options.label ?? caption, class: "copy" },
  );
  return copy;
}

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

export function button(
  label: string,
  onPress: (event: MouseEvent) => void,
  attributes: Attributes = {},
): HTMLButtonElement {
  const element = h("button", { type: "button", ...attributes }, label);
  element.addEventListener("click", onPress);
  return element;
}

/** Paragraphs of plain text; blank lines separate them. */
export function paragraphs(text: string, className: string): HTMLElement[] {
  return text
    .split(/\n\s*\n/)
    .map((part) => part.trim())
    .filter(Boolean)
    .map((part) => h("p", { class: className }, part));
}

/** Hands a file to the reader. */
export function download(name: string, content: Blob): void {
  const url = URL.createObjectURL(content);
  const link = h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
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

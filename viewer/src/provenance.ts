// SPDX-License-Identifier: BSD-3-Clause
import { copyButton, facts, h } from "./dom";
import type { Provenance } from "./document/report";
import { formatNumber } from "./math/format";

const kMaxDepth = 12;

/** Any JSON as nested name and value lists. */
function valueTree(value: unknown, depth = 0): Node {
  if (value === null || value === undefined) {
    return h("span", { class: "muted" }, "–");
  }
  if (typeof value !== "object") {
    return document.createTextNode(typeof value === "number" ? plainNumber(value) : String(value));
  }
  if (depth >= kMaxDepth) {
    return h("code", null, JSON.stringify(value));
  }
  if (Array.isArray(value) && value.every((item) => typeof item !== "object" || item === null)) {
    return document.createTextNode(value.length ? value.map((item) => String(item)).join(", ") : "–");
  }
  if (isMatrix(value)) {
    return h("div", null, ...value.map((row) => h("div", null, row.map(entryText).join(", "))));
  }
  const entries = Object.entries(value);
  return entries.length === 0
    ? h("span", { class: "muted" }, "none")
    : facts(
        "tree",
        entries.map(([name, item]) => [name, valueTree(item, depth + 1)]),
      );
}

function isMatrix(value: unknown): value is unknown[][] {
  const isRow = (row: unknown) => Array.isArray(row) && row.every((item) => typeof item !== "object" || item === null);
  return Array.isArray(value) && value.every(isRow);
}

/** An entry of a matrix, with the digits that a pose on the page has. */
function entryText(value: unknown): string {
  return typeof value === "number" ? String(Number(value.toPrecision(9))) : String(value);
}

/** Options are shown as they were given: no grouping, no rounding. */
function plainNumber(value: number): string {
  return Number.isFinite(value) ? String(value) : formatNumber(value);
}

/** A command line that a POSIX shell reads back as the same words. */
export function shellCommand(words: string[]): string {
  return words.map((word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replace(/'/g, "'\\''")}'`)).join(" ");
}

export function provenanceSection(provenance: Provenance | null, version: string | null): HTMLElement {
  const card = h("div", { class: "card provenance" });
  const section = h(
    "section",
    { id: "provenance", class: "section", "aria-labelledby": "provenance-title" },
    h("h2", { id: "provenance-title" }, "Provenance"),
    h("p", { class: "section-text" }, "Inputs of this report, and the command that reproduces it."),
  );
  section.append(card);
  if (provenance?.command) {
    const text = shellCommand(provenance.command);
    const code = h("code", null, text);
    card.append(
      h("div", { class: "command" }, h("pre", { tabindex: 0 }, code), copyButton(code, { label: "Copy the command" })),
    );
  }
  card.append(
    facts("facts", [
      ["Cairn", version ?? "unknown version"],
      ["Seed", provenance && valueTree(provenance.seed)],
      ["Machine", provenance && valueTree(provenance.machine)],
    ]),
  );
  if (!provenance) {
    return section;
  }
  if (provenance.inputs.length > 0) {
    card.append(
      h("h3", null, "Inputs"),
      h(
        "div",
        { class: "table-scroll", tabindex: 0, role: "region", "aria-label": "Inputs" },
        h(
          "table",
          { class: "inputs" },
          h(
            "thead",
            null,
            h("tr", null, ...["Role", "File", "Hash", "Details"].map((name) => h("th", { scope: "col" }, name))),
          ),
          h(
            "tbody",
            null,
            ...provenance.inputs.map((input) =>
              h(
                "tr",
                null,
                h("td", { "data-label": "Role" }, input.role ?? "–"),
                h("td", { class: "path", "data-label": "File" }, input.path ?? "–"),
                h("td", { class: "hash", "data-label": "Hash" }, h("code", null, input.hash ?? "–")),
                h("td", { "data-label": "Details" }, valueTree(input.details)),
              ),
            ),
          ),
        ),
      ),
    );
  }
  if (Object.keys(provenance.options ?? {}).length > 0) {
    card.append(h("h3", null, "Options"), h("div", { class: "options" }, valueTree(provenance.options)));
  }
  return section;
}

/** The licences of the packages inside this page, shown on demand. */
export function licencesDisclosure(): HTMLElement {
  const text = h("pre", { tabindex: 0 });
  const details = h("details", { class: "licences" }, h("summary", null, "Third-party licences of this page"), text);
  details.addEventListener("toggle", () => {
    text.textContent = document.getElementById("licences")?.textContent ?? "";
  });
  return details;
}

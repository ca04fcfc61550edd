// SPDX-License-Identifier: BSD-3-Clause
import { announce, button, copyButton, download, h } from "./dom";
import type { Cell, Table } from "./document/report";
import { csvBlob } from "./export";
import { formatFixed, formatNumber, formatProbability, superscript } from "./math/format";
import { isPrinting, kLandscapeWidth, kPaperWidth, onPaper } from "./paper";

const kFirstRows = 200;
/** Rows below each other as lists are long: of those first so many. */
const kFirstStacked = 5;
const kFilterFrom = 25;
/** A single row of more columns than these reads better as a list of names and values. */
const kWideRow = 5;
/** Longer words may be broken: paths, hashes. */
const kLongWord = 28;
/** Longer texts are sentences, which go on in the next line. */
const kLongestEntry = 40;
/** Below this share of its size on paper, a table's print is too small to read. */
const kLeastPaperScale = 0.55;
/** Below this share, a table is on a page turned to landscape. */
const kLeastPortraitScale = 0.7;

type Direction = "ascending" | "descending";

const collator = new Intl.Collator(undefined, { numeric: true });

/** Order of two cells; missing values and NaN come last, whatever the direction is. */
export function compareCells(a: Cell, b: Cell, direction: Direction): number {
  const missing = (cell: Cell) => cell === null || (typeof cell === "number" && Number.isNaN(cell));
  if (missing(a) || missing(b)) {
    return Number(missing(a)) - Number(missing(b));
  }
  const sign = direction === "ascending" ? 1 : -1;
  return typeof a === "number" && typeof b === "number"
    ? sign * (a - b)
    : sign * collator.compare(String(a), String(b));
}

/** Per column the value to mark as best, or null; where all are equal none is best. */
export function bestValues(table: Table): (number | null)[] {
  return table.columns.map((_, column) => {
    const wanted = table.best?.[column] ?? null;
    const values = table.rows
      .map((row) => row[column])
      .filter((cell): cell is number => typeof cell === "number" && Number.isFinite(cell));
    if (!wanted || values.length < 2) {
      return null;
    }
    const best = values.reduce((a, b) => (wanted === "low" ? Math.min(a, b) : Math.max(a, b)));
    return values.every((value) => value === best) ? null : best;
  });
}

type Column = Table["columns"][number];

function isNumeric({ type }: Column): boolean {
  return type === "number" || type === "probability";
}

function cellText(cell: Cell, { type, digits }: Column): string {
  if (cell === null) {
    return "–";
  }
  if (typeof cell === "string") {
    return cell;
  }
  if (type === "probability") {
    return formatProbability(cell);
  }
  return digits === null ? formatNumber(cell, 5) : formatFixed(cell, digits);
}

/** A command with a button that copies it. */
function copyCell(command: string): HTMLElement {
  const code = h("code", null, command);
  return h("div", { class: "copy-cell" }, code, copyButton(code, { label: `Copy ${command}` }));
}

export function csvRows(table: Table): Cell[][] {
  return [table.columns.map(({ name, unit }) => (unit ? `${name} [${unit}]` : name)), ...table.rows];
}

/** "10^-3 m^2" as people write it. */
export function unitText(unit: string): string {
  return unit.replace(/\^(-?\d+)/g, (_, exponent: string) => superscript(Number(exponent)));
}

function hasLongWord(text: string): boolean {
  return text.split(/\s+/).some((word) => word.length > kLongWord);
}

function csvButton(table: Table, title: string, fileName: string): HTMLElement {
  return h(
    "div",
    { class: "exports", role: "group", "aria-label": `Export “${title}”` },
    button("CSV", () => download(`${fileName}.csv`, csvBlob(csvRows(table)))),
  );
}

/** One row as names and values. */
function rowFigure(table: Table, title: string, fileName: string): HTMLElement {
  const [row] = table.rows;
  return h(
    "figure",
    { class: "card table-figure" },
    h(
      "dl",
      { class: "row-facts", "aria-label": title },
      ...table.columns.map((column, index) => {
        const { name, unit } = column;
        const text = cellText(row[index], column);
        return h(
          "div",
          { class: text.length > kLongestEntry ? "wide" : null },
          h("dt", null, name),
          h(
            "dd",
            { class: hasLongWord(text) ? "long" : null },
            text,
            unit && h("span", { class: "unit" }, ` ${unitText(unit)}`),
          ),
        );
      }),
    ),
    h("div", { class: "figure-foot" }, csvButton(table, title, fileName)),
  );
}

/** No table gets narrower than its longest words. */
function leastWidth(table: HTMLElement): number {
  table.style.width = "0";
  const needed = table.offsetWidth;
  table.style.width = "";
  return needed;
}

/**
 * A wide table is printed smaller, on a page turned to landscape; with words below each other if it must be; as a list of
 * rows if even that is too small.
 */
function fitOnPaper(figure: HTMLElement, table: HTMLElement): void {
  const scaled = (): boolean => {
    table.style.setProperty("--paper-scale", "1");
    const width = leastWidth(table);
    const isWide = kPaperWidth / width < kLeastPortraitScale;
    const scale = Math.min(1, (isWide ? kLandscapeWidth : kPaperWidth) / width);
    const isReadable = scale >= kLeastPaperScale;
    figure.classList.toggle("on-landscape", isWide && isReadable);
    table.style.setProperty("--paper-scale", String(isReadable ? scale : 1));
    return isReadable;
  };
  figure.classList.add("on-paper", "on-one-line");
  if (!scaled()) {
    figure.classList.remove("on-one-line");
    figure.classList.toggle("is-stacked", !scaled());
  }
}

/**
 * A table that is wider than its place becomes a list of rows, each cell with its column's name: nothing is cut off, and
 * nothing has to be scrolled sideways.
 */
function stackWhereNarrow(
  figure: HTMLElement,
  scroll: HTMLElement,
  table: HTMLElement,
  onStacked: (isStacked: boolean) => void,
): void {
  // Of all rows: a list of the first few must not become a table again because these are narrow.
  let needed = 0;
  const fit = () => {
    figure.classList.remove("is-stacked", "on-paper", "on-one-line", "on-landscape");
    if (isPrinting()) {
      fitOnPaper(figure, table);
      return;
    }
    needed = Math.max(needed, leastWidth(table));
    const isStacked = scroll.clientWidth > 0 && needed > scroll.clientWidth;
    figure.classList.toggle("is-stacked", isStacked);
    onStacked(isStacked);
  };
  new ResizeObserver(fit).observe(figure);
  onPaper(fit, fit);
}

/** A table whose headers sort it, with a filter once it is long. */
export function tableFigure(table: Table, title: string, fileName: string): HTMLElement {
  if (table.rows.length === 1 && table.columns.length > kWideRow) {
    return rowFigure(table, title, fileName);
  }
  const best = bestValues(table);
  let order = table.rows.map((_, index) => index);
  let sorted: { column: number; direction: Direction } | null = null;
  let limit = kFirstRows;
  let wanted = "";

  const labels = table.columns.map(({ name, unit }) => (unit ? `${name} (${unitText(unit)})` : name));
  const body = h("tbody");
  const more = h("div", { class: "more-rows" });
  const count = h("span", { class: "muted", role: "status" });
  const headers = table.columns.map((column, index) => {
    const sortButton = button(column.name, () => sortBy(index), { class: "sort" });
    sortButton.append(
      ...(column.unit ? [h("span", { class: "unit" }, ` ${unitText(column.unit)}`)] : []),
      h("span", { class: "sort-mark", "aria-hidden": "true" }),
    );
    return h("th", { scope: "col", class: isNumeric(column) ? "number" : null, "aria-sort": "none" }, sortButton);
  });

  function sortBy(column: number): void {
    const again = sorted?.column === column;
    const direction: Direction = again && sorted?.direction === "ascending" ? "descending" : "ascending";
    sorted = { column, direction };
    order = table.rows
      .map((_, index) => index)
      .sort((a, b) => compareCells(table.rows[a][column], table.rows[b][column], direction) || a - b);
    headers.forEach((header, index) => header.setAttribute("aria-sort", index === column ? direction : "none"));
    announce(`Sorted by ${table.columns[column].name}, ${direction}.`);
    fill();
  }

  function matches(row: Cell[]): boolean {
    return row.some((cell) => cell !== null && String(cell).toLowerCase().includes(wanted));
  }

  function rowElement(row: Cell[]): HTMLElement {
    return h(
      "tr",
      null,
      ...row.map((cell, index) => {
        const column = table.columns[index];
        const text = cellText(cell, column);
        const isBest = best[index] !== null && cell === best[index];
        const data = h("td", { class: isNumeric(column) ? "number" : null, "data-label": labels[index] });
        data.classList.toggle("long", hasLongWord(text));
        data.classList.toggle("sentence", text.length > kLongestEntry);
        if (isBest) {
          data.classList.add("best");
          data.append(h("span", { class: "best-mark", title: "best in this column" }, "★"), h("strong", null, text));
          data.append(h("span", { class: "visually-hidden" }, " (best)"));
        } else if (column.type === "command" && typeof cell === "string") {
          data.append(copyCell(cell));
        } else {
          data.append(text);
        }
        return data;
      }),
    );
  }

  function fill(): void {
    const shown = wanted ? order.filter((index) => matches(table.rows[index])) : order;
    body.replaceChildren(...shown.slice(0, limit).map((index) => rowElement(table.rows[index])));
    more.replaceChildren();
    if (shown.length > limit) {
      more.append(
        button(`Show all ${shown.length} rows`, () => {
          limit = Infinity;
          fill();
        }),
      );
    }
    count.textContent = wanted ? `${shown.length} of ${table.rows.length} rows` : "";
  }

  const filter = h("input", { type: "search", placeholder: "Filter rows", "aria-label": `Filter “${title}”` });
  filter.addEventListener("input", () => {
    wanted = filter.value.trim().toLowerCase();
    fill();
  });
  fill();
  // In place of the headers, where rows are lists.
  const sorts = h(
    "select",
    { "aria-label": `Sort “${title}” by` },
    h("option", { value: "" }, "as they are"),
    ...labels.map((label, index) => h("option", { value: index }, label)),
  );
  sorts.addEventListener("change", () => sorts.value !== "" && sortBy(Number(sorts.value)));
  const whole = h(
    "table",
    null,
    h("caption", { class: "visually-hidden" }, title),
    h("thead", null, h("tr", null, ...headers)),
    body,
  );
  const scroll = h(
    "div",
    {
      class: table.rows.length >= kFilterFrom ? "table-scroll is-long" : "table-scroll",
      tabindex: 0,
      role: "region",
      "aria-label": title,
    },
    whole,
  );
  const figure = h(
    "figure",
    { class: "card table-figure" },
    table.rows.length > 1 && h("label", { class: "check stacked-sort" }, "Sort by", sorts),
    scroll,
    more,
    h(
      "div",
      { class: "figure-foot" },
      table.rows.length >= kFilterFrom && filter,
      count,
      csvButton(table, title, fileName),
    ),
  );
  onPaper(() => {
    if (limit !== Infinity) {
      limit = Infinity; // paper has no button for the rest
      fill();
    }
  });
  stackWhereNarrow(figure, scroll, whole, (isStacked) => {
    const first = isStacked ? kFirstStacked : kFirstRows;
    if (limit !== Infinity && limit !== first) {
      limit = first;
      fill();
    }
  });
  return figure;
}

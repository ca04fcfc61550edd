// SPDX-License-Identifier: BSD-3-Clause
import type { Cell } from "./document/report";

function csvField(cell: Cell): string {
  if (cell === null || (typeof cell === "number" && !Number.isFinite(cell))) {
    return "";
  }
  if (typeof cell === "number") {
    return String(cell);
  }
  // A text that a spreadsheet would run as a formula gets an apostrophe in front.
  const text = /^[=+\-@\t\r]/.test(cell) ? `'${cell}` : cell;
  return /[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

/** RFC 4180, with numbers in full precision. */
export function toCsv(rows: Cell[][]): string {
  return rows.map((row) => `${row.map(csvField).join(",")}\r\n`).join("");
}

export function csvBlob(rows: Cell[][]): Blob {
  return new Blob([toCsv(rows)], { type: "text/csv;charset=utf-8" });
}

export function svgText(svg: SVGSVGElement, background: string): string {
  const copy = svg.cloneNode(true) as SVGSVGElement;
  const paper = document.createElementNS("http://www.w3.org/2000/svg", "rect");
  paper.setAttribute("width", "100%");
  paper.setAttribute("height", "100%");
  paper.setAttribute("fill", background);
  copy.prepend(paper);
  // XML has no way to write these, and the serialiser does not mind.
  return new XMLSerializer()
    .serializeToString(copy)
    .replace(/[\u0000-\u0008\u000b\u000c\u000e-\u001f\ufffe\uffff]/g, "\ufffd");
}

/** The picture that an SVG draws, at twice its size. */
export async function svgToPng(text: string, width: number, height: number): Promise<Blob> {
  const url = URL.createObjectURL(new Blob([text], { type: "image/svg+xml;charset=utf-8" }));
  try {
    const image = new Image(width, height);
    image.src = url;
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = 2 * width;
    canvas.height = 2 * height;
    canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
    return await canvasToPng(canvas);
  } finally {
    URL.revokeObjectURL(url);
  }
}

export function canvasToPng(canvas: HTMLCanvasElement): Promise<Blob> {
  return new Promise((resolve, reject) =>
    canvas.toBlob(
      (blob) => (blob ? resolve(blob) : reject(new Error("The picture is too large for this browser."))),
      "image/png",
    ),
  );
}

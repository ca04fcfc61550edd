// SPDX-License-Identifier: BSD-3-Clause
// What is drawn over a 3D view, in CSS pixels.
import type { Palette } from "../theme";

export function fitCanvas(canvas: HTMLCanvasElement, width: number, height: number, ratio: number): void {
  const columns = Math.max(1, Math.round(width * ratio));
  const rows = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== columns || canvas.height !== rows) {
    canvas.width = columns;
    canvas.height = rows;
  }
}

/** Text that stays readable over landmarks. */
export function label(context: CanvasRenderingContext2D, text: string, x: number, y: number, colors: Palette): void {
  context.save();
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = colors.background;
  context.strokeText(text, x, y);
  context.restore();
  context.fillText(text, x, y);
}

/** The frame's axes, always in the corner; `view` is the camera's matrix, column by column. */
export function drawAxes(
  context: CanvasRenderingContext2D,
  view: readonly number[],
  height: number,
  colors: Palette,
): void {
  const centre = [40, height - 40];
  const axes = [
    ["x", "#d55e00", 0],
    ["y", "#009e73", 4],
    ["z", colors.name === "light" ? "#0072b2" : "#56a9e6", 8],
  ] as const;
  context.lineWidth = 1.75;
  context.font = "600 11px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const [name, color, column] of [...axes].sort((a, b) => view[a[2] + 2] - view[b[2] + 2])) {
    const dx = view[column] * 22;
    const dy = -view[column + 1] * 22;
    context.strokeStyle = color;
    context.fillStyle = color;
    context.beginPath();
    context.moveTo(centre[0], centre[1]);
    context.lineTo(centre[0] + dx, centre[1] + dy);
    context.stroke();
    label(context, name, centre[0] + dx * 1.42, centre[1] + dy * 1.42, colors);
  }
  context.textAlign = "left";
  context.textBaseline = "alphabetic";
}

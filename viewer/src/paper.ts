// SPDX-License-Identifier: BSD-3-Clause
// Printing: browsers do not wait, so whatever looks different on paper is drawn in full at once.

/** Of a card on A4 with a browser's margins, in CSS pixels. */
export const kPaperWidth = 680;
/** The same on a page turned to landscape. */
export const kLandscapeWidth = 1000;

const listeners = new Set<{ before: () => void; after: () => void }>();
let printing = false;

/** While this holds, what was drawn for paper must stay. */
export function isPrinting(): boolean {
  return printing;
}

/** Calls `before` when the page is about to be printed and `after` once it was, in the order of these calls. */
export function onPaper(before: () => void, after: () => void = () => {}): void {
  listeners.add({ before, after });
}

export function startPaper(): void {
  window.addEventListener("beforeprint", () => {
    printing = true;
    listeners.forEach(({ before }) => before());
  });
  window.addEventListener("afterprint", () => {
    printing = false;
    listeners.forEach(({ after }) => after());
  });
}

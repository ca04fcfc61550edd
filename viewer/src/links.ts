// SPDX-License-Identifier: BSD-3-Clause

/**
 * Follows links to parts of the page in a notebook, which shows the page as an iframe's srcdoc. The URL of such links is
 * that of the notebook, which the browser would load in place of the report.
 */
export function startLinks(): void {
  if (location.href !== "about:srcdoc") {
    return;
  }
  document.addEventListener("click", (event) => {
    const link = event.target instanceof Element ? event.target.closest('a[href^="#"]') : null;
    const part = document.getElementById(link?.getAttribute("href")?.slice(1) ?? "");
    if (part) {
      event.preventDefault();
      part.tabIndex = -1; // so that it takes the focus
      part.scrollIntoView();
      part.focus({ preventScroll: true });
    }
  });
}

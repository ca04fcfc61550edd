// SPDX-License-Identifier: BSD-3-Clause
import { chromium } from "playwright-core";
import { pathToFileURL } from "node:url";

const kArguments = [
  "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
  "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader",
];

export function launch(more = []) {
  return chromium.launch({ executablePath: process.env.CAIRN_CHROMIUM ?? "/usr/bin/chromium", args: [...kArguments, ...more] });
}

/** Chromium's remark on software drawing; it says nothing about the page. */
const isDriverRemark = (text) => text.includes("GL Driver Message") && text.includes("Performance");

/** Opens a report from its file and notes everything a clean page must not do. */
export async function openReport(browser, path, options = {}) {
  const context = await browser.newContext({
    viewport: { width: 1400, height: 900 },
    acceptDownloads: true,
    permissions: ["clipboard-read", "clipboard-write"],
    ...options,
  });
  context.setDefaultTimeout(180_000); // a busy machine draws in software, and not at once
  const page = await context.newPage();
  const complaints = [];
  const requests = [];
  page.on("console", (message) => isDriverRemark(message.text()) || complaints.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => complaints.push(`error: ${error.message}`));
  page.on("dialog", (dialog) => {
    complaints.push(`dialog: ${dialog.message()}`);
    void dialog.dismiss();
  });
  const url = pathToFileURL(path).href;
  page.on("request", (request) => {
    if (!/^(data|blob):/.test(request.url()) && request.url() !== url) {
      requests.push(request.url());
    }
  });
  const start = Date.now();
  await page.goto(url);
  await up(page);
  return { page, context, complaints, requests, viewport: page.viewportSize(), openMs: Date.now() - start };
}

function up(page) {
  return page.waitForSelector("html[data-state=ready], html[data-state=error]", { state: "attached", timeout: 180_000 });
}

/** Loads an open report anew, as it was when it was opened. */
export async function reload({ page, viewport }) {
  await page.emulateMedia({ media: null });
  await page.setViewportSize(viewport);
  await page.evaluate(() => {
    localStorage.clear();
    scrollTo({ top: 0, behavior: "instant" });
  });
  await page.reload();
  await up(page);
}

/** Waits until the first scene has drawn its final picture and rests. */
export async function settled(page) {
  // A scene far from the window is not drawn.
  await page.evaluate(() => {
    const scene = document.querySelector("[data-scene]");
    const { top, bottom } = scene.getBoundingClientRect();
    if (top > innerHeight || bottom < 0) {
      scene.scrollIntoView({ behavior: "instant" });
    }
  });
  await page.waitForTimeout(260);
  // On a busy machine, what happened last may wait for the next frame.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  await page.waitForFunction(() => document.querySelector("[data-scene]").dataset.drawn === "full", null, { timeout: 180_000 });
}

/** Pixels of a pane that differ from its background, and a number that changes when the picture does. */
export function drawing(page, pane = 0) {
  return page.evaluate((index) => {
    const canvas = document.querySelectorAll(".pane-canvas")[index];
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let inked = 0;
    let sum = 0;
    for (let i = 0; i < data.length; i += 4) {
      const same = data[i] === data[0] && data[i + 1] === data[1] && data[i + 2] === data[2];
      inked += same ? 0 : 1;
      sum = (sum * 31 + data[i] + 3 * data[i + 1] + 7 * data[i + 2]) % 1000000007;
    }
    return { inked, sum, total: data.length / 4, width: canvas.width, height: canvas.height };
  }, pane);
}

/** A place, relative to the pane, whose pixel has nearly the colour wanted. */
export function findColor(page, pane, rgb) {
  return page.evaluate(([index, wanted]) => {
    const canvas = document.querySelectorAll(".pane-canvas")[index];
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    const ratio = canvas.width / canvas.clientWidth;
    for (let i = 0; i < data.length; i += 4) {
      if (wanted.every((value, channel) => Math.abs(data[i + channel] - value) < 6)) {
        const at = i / 4;
        return { x: (at % canvas.width) / ratio, y: Math.floor(at / canvas.width) / ratio };
      }
    }
    return null;
  }, [pane, rgb]);
}

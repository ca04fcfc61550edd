// SPDX-License-Identifier: BSD-3-Clause
// The page in a real browser: sample reports, and the report that CAIRN_REPORT names, if any.
import assert from "node:assert/strict";
import { mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { drawing, findColor, launch, openReport, reload, settled } from "./support/browser.mjs";
import { kSamples, writePage } from "./sample.mjs";

const kSourceLight = [0, 158, 115];
const kPhone = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 };
const folder = mkdtempSync(join(tmpdir(), "cairn-viewer-"));
let browser;

before(async () => {
  browser = await launch();
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

const samples = new Map();

/** A sample and the file that holds its page; both are made once. */
function sampleOf(name) {
  let made = samples.get(name);
  if (!made) {
    const sample = kSamples[name]();
    made = { sample, path: join(folder, `${name}.html`) };
    writeFileSync(made.path, writePage(sample));
    samples.set(name, made);
  }
  return made;
}

const sampleFile = (name) => sampleOf(name).path;

const reportPath = () => sampleFile("small");
/** A test that takes seconds and looks at details, or at much at once: it waits for scripts/test --full. */
const thorough = (name, check) => test(name, { skip: !process.env.CAIRN_TEST_FULL && "takes long: of scripts/test --full" }, check);
/** What must hold of any report. */
const kAnyReport = [
  ["sample", reportPath],
  ...(process.env.CAIRN_REPORT ? [["given", () => process.env.CAIRN_REPORT]] : []),
];

/** What a check returns if it leaves the page as it found it. */
const kAsItWas = "as it was";
/** Pages by report and options, the last used last, and whether each is as it was when it was opened. */
const pages = new Map();
/** Even pages that rest take some time each. */
const kMostPages = 3;

/**
 * A page of a report, opened once: that takes seconds. It is loaded again after a check that changed it, or if it must
 * be `fresh`.
 */
async function withReport(path, options, check, fresh = false) {
  const key = JSON.stringify([path, options]);
  let kept = pages.get(key);
  pages.delete(key);
  if (!kept) {
    for (const [other, { opened }] of [...pages].slice(0, -(kMostPages - 1))) {
      pages.delete(other);
      await opened.context.close();
    }
    kept = { opened: await openReport(browser, path, options) };
  } else if (fresh || !kept.asItWas) {
    await reload(kept.opened);
  }
  pages.set(key, kept);
  const { page, complaints, requests } = kept.opened;
  await page.mouse.move(1, 1);
  await page.evaluate(() => scrollTo({ top: 0, behavior: "instant" }));
  kept.asItWas = false;
  kept.asItWas = (await check(kept.opened)) === kAsItWas;
  assert.deepEqual(complaints.splice(0), [], "the console is clean");
  assert.deepEqual(requests.splice(0), [], "nothing is fetched");
}

async function saved(page, press) {
  const [download] = await Promise.all([page.waitForEvent("download"), press()]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
}

async function moveSlider(page, value) {
  await page.locator(".slider").first().evaluate((slider, wanted) => {
    slider.value = wanted;
    slider.dispatchEvent(new Event("input"));
  }, String(value));
  await settled(page);
}

const iterationOf = (page) => page.locator(".iteration").first().textContent();

/** Makes the page draw all that waits until it is near the view. */
async function scrollThrough(page) {
  if (await page.evaluate(() => window.scrolledThrough_)) {
    return;
  }
  const height = await page.evaluate(() => document.documentElement.scrollHeight);
  for (let y = 0; y < height; y += 500) {
    await page.evaluate((top) => scrollTo({ top, behavior: "instant" }), y);
    await page.waitForTimeout(60);
  }
  await page.waitForTimeout(200);
  await page.evaluate(() => (window.scrolledThrough_ = true));
}

for (const [kind, path] of kAnyReport) {
  test(`a report opens from its file, shows its parts and draws its charts (${kind})`, async () => {
    await withReport(path(), {}, async ({ page, openMs }) => {
      assert.equal(await page.getAttribute("html", "data-state"), "ready");
      assert.ok((await page.textContent("h1")).length > 0);
      assert.equal(await page.title(), await page.textContent("h1"));
      await scrollThrough(page);
      const charts = await page.locator(".chart").count();
      assert.equal(await page.locator(".chart .chart-svg[aria-label]").count(), charts);
      assert.equal(await page.locator(".notice[data-status=bad]").count(), 0);
      assert.equal(await page.locator("#provenance").count(), 1);
      console.log(`  opened in ${openMs} ms, ${(statSync(path()).size / 1e6).toFixed(2)} MB`);
      return kAsItWas;
    });
  });
}

for (const [kind, path] of kAnyReport) {
  test(`the slider changes the picture and the numbers (${kind})`, async (t) => {
    await withReport(path(), {}, async ({ page }) => {
      if ((await page.locator(".slider").count()) === 0) {
        return t.skip("the report has no iterations");
      }
      await settled(page);
      const last = await drawing(page);
      assert.ok(last.inked > 200, `something is drawn (${last.inked} pixels)`);
      const numbers = await page.locator(".pane").first().innerText();
      await moveSlider(page, 0);
      const first = await drawing(page);
      assert.notEqual(first.sum, last.sum);
      assert.notEqual(await page.locator(".pane").first().innerText(), numbers);
      assert.match(await iterationOf(page), /^0 \/ \d+$/);
      await page.getByRole("button", { name: "Final" }).first().click();
      await settled(page);
      assert.equal(await page.locator(".pane").first().innerText(), numbers);
      const again = await drawing(page);
      assert.notEqual(again.sum, first.sum);
      await moveSlider(page, 0);
      assert.equal((await drawing(page)).sum, first.sum, "the same iteration is the same picture");
      await page.getByRole("button", { name: "Final" }).first().click();
      return kAsItWas;
    });
  });
}

for (const [kind, path] of kAnyReport) {
  test(`in any report strategies toggle, landmarks can be picked, tables sort and charts export (${kind})`, async () => {
    await withReport(path(), {}, async ({ page }) => {
      const scene = page.locator("[data-scene]").first();
      if (await scene.count()) {
        await settled(page);
        assert.ok((await drawing(page)).inked > 100);
        const panes = () => scene.locator(".pane:visible").count();
        const all = await panes();
        const chips = scene.getByRole("group", { name: "Strategies" }).getByRole("button");
        if (all > 1) {
          assert.equal(await chips.count(), all);
          await chips.first().click();
          assert.equal(await panes(), all - 1);
          assert.equal(await chips.first().getAttribute("aria-pressed"), "false");
          await chips.first().click();
          assert.equal(await panes(), all);
          await settled(page);
        }
        const surface = scene.locator(".pane-overlay").first();
        await surface.scrollIntoViewIfNeeded();
        const box = await surface.boundingBox();
        // The middle of the view may be empty; somewhere on a grid over it there is a landmark.
        for (let i = 0; i < 120 && (await scene.locator(".record h3").count()) === 0; ++i) {
          const [u, v] = [(i * 0.618034) % 1, (i * 0.754878) % 1];
          await surface.click({ position: { x: box.width * (0.2 + 0.6 * u), y: box.height * (0.2 + 0.6 * v) }, force: true });
        }
        assert.match(await scene.locator(".record h3").textContent(), /landmark \d+/);
      }
      for (const closed of await page.locator(".scene-summary:not([open]) > summary").all()) {
        await closed.click();
      }
      for (const sort of (await page.locator("th .sort").all()).slice(0, 3)) {
        await sort.click();
        assert.equal(await sort.locator("xpath=..").getAttribute("aria-sort"), "ascending");
      }
      for (const chart of (await page.locator(".chart .exports").all()).slice(0, 3)) {
        const svg = await saved(page, () => chart.getByRole("button", { name: "SVG" }).click());
        assert.match(svg.bytes.toString("utf8"), /^<svg[^>]*>.*<\/svg>$/s);
      }
    });
  });
}

thorough("strategies can be hidden and shown, by chip and by digit", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    const first = page.locator("[data-scene]").first();
    const panes = () => first.locator(".pane:visible").count();
    assert.equal(await panes(), 4);
    await first.getByRole("button", { name: "covariance", exact: false }).first().click();
    assert.equal(await panes(), 3);
    await first.evaluate((element) => element.focus());
    await page.keyboard.press("1");
    assert.equal(await panes(), 2);
    await page.keyboard.press("2");
    assert.equal(await panes(), 3);
    await page.keyboard.press("1");
    assert.equal(await panes(), 4);
    return kAsItWas;
  });
});

test("keys step, jump, play, reset and help", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    await page.locator("[data-scene]").first().evaluate((element) => element.focus());
    await page.keyboard.press("Home");
    assert.equal(await iterationOf(page), "0 / 60");
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("ArrowRight");
    await page.keyboard.press("ArrowLeft");
    assert.equal(await iterationOf(page), "1 / 60");
    await page.keyboard.press("Space");
    await page.waitForFunction(() => parseInt(document.querySelector(".iteration").textContent, 10) > 2);
    await page.keyboard.press("Space");
    const paused = await iterationOf(page);
    await page.waitForTimeout(300);
    assert.equal(await iterationOf(page), paused);
    await page.keyboard.press("End");
    assert.equal(await iterationOf(page), "60 / 60");
    await settled(page);
    const home = await drawing(page);
    await page.keyboard.press("Shift+ArrowRight");
    await settled(page);
    assert.notEqual((await drawing(page)).sum, home.sum);
    await page.keyboard.press("r");
    await settled(page);
    assert.equal((await drawing(page)).sum, home.sum);
    await page.keyboard.press("?");
    assert.ok(await page.locator("dialog.help").isVisible());
    await page.keyboard.press("Escape");
    assert.ok(!(await page.locator("dialog.help").isVisible()));
    return kAsItWas;
  });
});

test("a drag turns all linked views, or one once they are not", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await settled(page);
    const drag = async () => {
      const box = await page.locator(".pane-overlay").first().boundingBox();
      await page.mouse.move(box.x + 150, box.y + 60);
      await page.mouse.down();
      await page.mouse.move(box.x + 220, box.y + 80, { steps: 4 });
      await page.mouse.up();
      await settled(page);
    };
    const before = [await drawing(page, 0), await drawing(page, 1)];
    await drag();
    const linked = [await drawing(page, 0), await drawing(page, 1)];
    assert.notEqual(linked[0].sum, before[0].sum);
    assert.notEqual(linked[1].sum, before[1].sum);
    await page.getByRole("button", { name: "Linked" }).first().click();
    await drag();
    const apart = [await drawing(page, 0), await drawing(page, 1)];
    assert.notEqual(apart[0].sum, linked[0].sum);
    assert.equal(apart[1].sum, linked[1].sum);
    await page.getByRole("button", { name: "Linked" }).first().click();
    await page.keyboard.press("r");
    return kAsItWas;
  });
});

thorough("layers, colours and point size change what is drawn", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    await moveSlider(page, 3);
    const seen = new Set([(await drawing(page)).sum]);
    const changed = async (what) => {
      await settled(page);
      const { sum } = await drawing(page);
      assert.ok(!seen.has(sum), what);
      seen.add(sum);
    };
    for (const layer of ["matches", "cameras", "truth", "grid", "source"]) {
      await page.locator(`[data-layer=${layer}]`).first().click();
      await changed(layer);
    }
    await page.locator("[data-layer=source]").first().click();
    const chooser = page.getByRole("combobox", { name: "Colour by" }).first();
    for (const value of ["residual", "column:observations", "own"]) {
      await chooser.selectOption(value);
      await changed(value);
      assert.equal(await page.locator(".legend-ramp").count(), value === "own" ? 0 : 1);
    }
    await page.getByLabel("Point size").first().fill("8");
    await changed("point size");
  });
});

test("picking a landmark shows its record; Escape closes it", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    await moveSlider(page, 0);
    await page.locator(".pane-surface").first().scrollIntoViewIfNeeded();
    const at = await findColor(page, 0, kSourceLight);
    assert.ok(at, "a source landmark is drawn");
    await page.locator(".pane-overlay").first().hover({ position: at, force: true });
    await page.waitForTimeout(100);
    assert.match(await page.locator(".pane-tip").first().textContent(), /^(Source|Target) \d+/);
    await page.locator(".pane-overlay").first().click({ position: at, force: true });
    const record = page.locator(".record").first();
    assert.match(await record.locator("h3").textContent(), /^Source landmark \d+$/);
    const text = await record.innerText();
    for (const expected of ["Position (m)", "Observations", "Standard deviation", "in target’s frame", "Match", "Residual", "base", "distance"]) {
      assert.ok(text.includes(expected), `${expected} in ${text}`);
    }
    const residual = () => record.locator("[data-record=residual]").first().innerText();
    const initially = await residual();
    await moveSlider(page, 60);
    assert.notEqual(await residual(), initially);
    await page.locator(".pane-overlay").first().focus();
    await page.keyboard.press("Escape");
    assert.equal(await record.locator("h3").count(), 0);
    return kAsItWas;
  });
});

/** Width and height of what is red, in CSS pixels. */
const redExtent = (page) =>
  page.evaluate(() => {
    const canvas = document.querySelector(".pane-canvas");
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
    for (let i = 0; i < data.length; i += 4) {
      if (data[i] < 150 || data[i + 1] > 80) continue;
      [(i / 4) % canvas.width, Math.floor(i / 4 / canvas.width)].forEach((value, axis) => {
        low[axis] = Math.min(low[axis], value);
        high[axis] = Math.max(high[axis], value);
      });
    }
    return high.map((value, axis) => ((value - low[axis]) * canvas.clientWidth) / canvas.width);
  });

test("splats are ellipses of their shape, and points if that is wanted", async () => {
  await withReport(sampleFile("splats"), {}, async ({ page }) => {
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await page.getByRole("button", { name: "Front" }).click();
    await settled(page);
    const [wide, low] = await redExtent(page);
    // The perspective enlarges what is nearer: the splat's deviations are as 10 to 1.
    assert.ok(wide > 60 && Math.abs(wide / low - 10) < 2, `${wide} x ${low}`);
    await page.getByRole("button", { name: "Side" }).click();
    await settled(page);
    const [across, high] = await redExtent(page);
    assert.ok(Math.abs(across / high - 1) < 0.3 && high < 0.25 * wide, `${across} x ${high} along the axis`);
    await page.locator("[data-layer=ellipses]").click();
    await page.getByRole("button", { name: "Front" }).click();
    await settled(page);
    const point = await redExtent(page);
    assert.ok(point[0] < 12 && Math.abs(point[0] - point[1]) < 3, `${point}`);
  });
});

/** The overlay's opacity, 0 to 255, at a place given as shares of the view, and how much has nearly the colour of what is selected. */
const overlay = (page, pane, u = 0.55, v = 0.5) =>
  page.evaluate(([index, x, y]) => {
    const canvas = document.querySelectorAll(".pane-overlay")[index];
    const { width, height } = canvas;
    const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, width, height);
    let marked = 0;
    for (let i = 0; i < data.length; i += 4) {
      marked += data[i + 3] > 200 && Math.abs(data[i] - 213) < 12 && Math.abs(data[i + 1] - 94) < 12 && data[i + 2] < 12 ? 1 : 0;
    }
    return { opacity: data[4 * (Math.round(y * height) * width + Math.round(x * width)) + 3], marked };
  }, [pane, u, v]);

/** Waits until the image of the keyframe is drawn. */
async function imageShown(page) {
  for (let i = 0; i < 100 && (await overlay(page, 0)).opacity === 0; ++i) {
    await page.waitForTimeout(50);
  }
}

const keyframeTools = (page) => page.getByRole("group", { name: "Keyframe" }).first();

async function chooseKeyframe(page, frame) {
  await page.getByRole("slider", { name: "Keyframe" }).first().fill(String(frame));
  await settled(page);
}

test("a keyframe is entered and left by key, and its image can be switched off", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    const tools = keyframeTools(page);
    const output = tools.locator("output");
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await settled(page);
    const outside = await drawing(page);
    const { marked } = await overlay(page, 0); // an axis
    assert.equal(await output.textContent(), "60 keyframes");
    await page.locator("[data-scene]").first().evaluate((element) => element.focus());
    await page.keyboard.press("c");
    await settled(page);
    assert.match(await output.textContent(), /^\d+ · \d+\.\d{3} s$/);
    assert.notEqual((await drawing(page)).sum, outside.sum);
    assert.ok((await overlay(page, 0)).marked > marked + 400, "the image's border is drawn");

    await tools.getByRole("combobox").selectOption({ label: "Source" });
    await chooseKeyframe(page, 10);
    assert.equal(await output.textContent(), "10 · 1305031453.000 s");
    const image = tools.getByRole("button", { name: "Image" });
    assert.ok(await image.isEnabled());
    await imageShown(page);
    const { opacity } = await overlay(page, 0);
    assert.ok(opacity > 120 && opacity < 136, `the image is drawn at half opacity (${opacity})`);
    assert.ok((await overlay(page, 0, 0.5, 0.01)).opacity > 140, "what is outside of it is dimmed");
    await image.click();
    await settled(page);
    assert.equal((await overlay(page, 0)).opacity, 0);
    await image.click();

    const inside = await drawing(page);
    await page.keyboard.press("]");
    await settled(page);
    assert.match(await output.textContent(), /^11 · /);
    assert.ok(await image.isDisabled(), "this keyframe has no image");
    assert.notEqual((await drawing(page)).sum, inside.sum);
    await page.keyboard.press("[");
    await settled(page);
    assert.equal((await drawing(page)).sum, inside.sum);
    // The map moves with the iteration, and the view with the map.
    await moveSlider(page, 0);
    assert.notEqual((await drawing(page)).sum, inside.sum);
    await moveSlider(page, 60);
    assert.equal((await drawing(page)).sum, inside.sum);
    await page.locator(".pane-overlay").first().focus();
    await page.keyboard.press("Escape");
    await settled(page);
    assert.equal((await drawing(page)).sum, outside.sum, "the view is what it was before");
    assert.equal((await overlay(page, 0)).marked, marked);
    assert.equal(await output.textContent(), "60 keyframes");
    return kAsItWas;
  });
});

test("landmarks can be picked inside a keyframe; a drag leaves it", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    const tools = keyframeTools(page);
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await settled(page);
    const home = await drawing(page);
    await chooseKeyframe(page, 30);
    const view = page.locator(".pane-overlay").first();
    const at = await findColor(page, 0, kSourceLight);
    await view.click({ position: at, force: true });
    assert.match(await page.locator(".record h3").first().textContent(), /landmark \d+/);
    assert.ok(await tools.getByRole("button", { name: "Leave" }).isVisible());

    const box = await view.boundingBox();
    const inside = await drawing(page);
    await page.mouse.move(box.x + 150, box.y + 60);
    await page.mouse.down();
    await page.mouse.move(box.x + 150 + 0.12 * box.height, box.y + 60 + 0.04 * box.height, { steps: 4 });
    await page.mouse.up();
    await settled(page);
    assert.ok(await tools.getByRole("button", { name: "Enter" }).isVisible());
    const left = await drawing(page);
    assert.ok(left.sum !== inside.sum && left.sum !== home.sum);
    assert.ok(left.inked > 0.3 * inside.inked, "the landmarks stay in view");
    await page.getByRole("button", { name: "Close the record" }).click();
    await page.keyboard.press("r");
    return kAsItWas;
  });
});

test("a camera in the view is entered by a click, in one view once they are not linked", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await settled(page);
    await page.getByRole("button", { name: "Linked" }).first().click();
    const tip = page.locator(".pane-tip").nth(1);
    const box = await page.locator(".pane-overlay").nth(1).boundingBox();
    let found = false;
    for (let i = 0; i < 400 && !found; ++i) {
      await page.mouse.move(box.x + box.width * ((i * 0.618034) % 1), box.y + box.height * ((i * 0.754878) % 1));
      await page.waitForTimeout(15);
      found = (await tip.isVisible()) && /^(Source|Target) keyframe \d+ · /.test(await tip.textContent());
    }
    assert.ok(found, "a camera is named below the pointer");
    const name = (await tip.textContent()).replace(/^\w+ keyframe /, "");
    const others = [await drawing(page, 0), await drawing(page, 1)];
    const { marked } = await overlay(page, 0);
    await page.mouse.down();
    await page.mouse.up();
    await settled(page);
    assert.equal(await keyframeTools(page).locator("output").textContent(), name);
    assert.equal((await drawing(page, 0)).sum, others[0].sum, "other views stay");
    assert.notEqual((await drawing(page, 1)).sum, others[1].sum);
    assert.ok((await overlay(page, 0)).marked > marked + 10, "and mark the camera");
    await page.getByRole("button", { name: "Linked" }).first().click();
    await settled(page);
    assert.notEqual((await drawing(page, 0)).sum, others[0].sum, "linked views look through it together");
    await page.keyboard.press("Escape");
    return kAsItWas;
  });
});

thorough("a keyframe on paper is as it is on the screen", async () => {
  await withReport(reportPath(), { colorScheme: "dark" }, async ({ page }) => {
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await settled(page);
    await chooseKeyframe(page, 20);
    await imageShown(page);
    await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
    await page.emulateMedia({ media: "print" });
    await page.waitForFunction(() => [...document.querySelectorAll(".pane-paper")].every((image) => image.complete && image.naturalWidth > 0));
    const shares = await page.evaluate(() => [...document.querySelectorAll("#section-alignment .pane-paper")].map((image) => {
      const copy = new OffscreenCanvas(image.naturalWidth, image.naturalHeight).getContext("2d");
      copy.drawImage(image, 0, 0);
      const { data } = copy.getImageData(0, 0, image.naturalWidth, image.naturalHeight);
      let [border, shaded] = [0, 0];
      for (let i = 0; i < data.length; i += 4) {
        border += Math.abs(data[i] - 213) < 12 && Math.abs(data[i + 1] - 94) < 12 && data[i + 2] < 12 ? 1 : 0;
        shaded += data[i] < 230 && data[i + 2] > 150 ? 1 : 0;
      }
      return [border, shaded / (data.length / 4)];
    }));
    assert.equal(shares.length, 4);
    for (const [border, shaded] of shares) {
      assert.ok(border > 800 && shaded > 0.2, `${border} pixels of the border, ${shaded} of the image`);
    }
    await page.evaluate(() => dispatchEvent(new Event("afterprint")));
  });
});

thorough("on a phone a keyframe is entered and left without opening the options", async () => {
  await withReport(reportPath(), kPhone, async ({ page }) => {
    const tools = keyframeTools(page);
    await tools.scrollIntoViewIfNeeded();
    await settled(page);
    assert.ok(!(await tools.getByRole("slider").isVisible()));
    await tools.getByRole("button", { name: "Enter" }).tap();
    await settled(page);
    assert.ok(await tools.getByRole("slider").isVisible());
    assert.deepEqual(await cutOff(page), []);
    assert.ok((await page.evaluate(() => document.documentElement.scrollWidth)) <= 390);
    await tools.getByRole("button", { name: "Leave" }).tap();
    assert.ok(!(await tools.getByRole("slider").isVisible()));
    return kAsItWas;
  });
});

thorough("an image of a keyframe that cannot be decoded is not shown, and nothing else fails", async () => {
  await withReport(sampleFile("hostile"), {}, async ({ page }) => {
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await chooseKeyframe(page, 0);
    await page.waitForTimeout(200);
    assert.equal((await overlay(page, 0)).opacity, 0);
    await page.keyboard.press("Escape");
    assert.equal(await keyframeTools(page).locator("output").textContent(), "8 keyframes");
  });
});

test("tables sort by a click or the keyboard and say so", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    const table = page.locator("#section-k table");
    const column = () => table.locator("tbody tr td:nth-child(3)").allInnerTexts();
    const header = table.locator("th").nth(2);
    await header.getByRole("button").focus();
    await page.keyboard.press("Enter");
    assert.equal(await header.getAttribute("aria-sort"), "ascending");
    const ascending = (await column()).map((text) => parseFloat(text.replace("★", "")));
    assert.deepEqual(ascending, [...ascending].sort((a, b) => a - b));
    await header.getByRole("button").click();
    assert.equal(await header.getAttribute("aria-sort"), "descending");
    assert.deepEqual((await column()).map((text) => parseFloat(text.replace("★", ""))), [...ascending].reverse());
    assert.equal(await table.locator("td.best").count(), 3, "one best value in each column that varies");
  });
});

thorough("exports are valid SVG, PNG and CSV", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    for (const id of ["yaw", "xy", "convergence", "basin", "success", "errors"]) {
      const group = page.locator(`#section-${id} .exports`);
      const svg = await saved(page, () => group.getByRole("button", { name: "SVG" }).click());
      assert.equal(svg.name, `${id}.svg`);
      const problem = await page.evaluate((text) => {
        const parsed = new DOMParser().parseFromString(text, "image/svg+xml");
        return parsed.querySelector("parsererror")?.textContent ?? (parsed.querySelectorAll("path, rect").length > 3 ? null : "empty");
      }, svg.bytes.toString("utf8"));
      assert.equal(problem, null);
      assert.ok(!/var\(--/.test(svg.bytes.toString("utf8")), "no variables of the page");
      const png = await saved(page, () => group.getByRole("button", { name: "PNG" }).click());
      assert.deepEqual([...png.bytes.subarray(0, 4)], [137, 80, 78, 71]);
      const csv = await saved(page, () => group.getByRole("button", { name: "CSV" }).click());
      const lines = csv.bytes.toString("utf8").trim().split("\r\n");
      assert.ok(lines.length > 4 && lines.every((line) => line.includes(",")), lines[0]);
    }
    const csv = await saved(page, () => page.locator("#section-k .exports button").click());
    assert.match(csv.bytes.toString("utf8"), /^k,Base \[10⁻³ m²\],.*\r\n1,5\.34268,/);
    const png = await saved(page, () => page.getByRole("button", { name: "Save the view as PNG" }).first().click());
    assert.match(png.name, /^alignment-\d+\.png$/);
    assert.ok(png.bytes.length > 20_000);
    return kAsItWas;
  });
});

for (const [kind, path] of kAnyReport) {
  thorough(`dark follows the system, and the choice overrules it (${kind})`, async () => {
    await withReport(path(), { colorScheme: "dark" }, async ({ page }) => {
      const background = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
      const dark = await background();
      await page.getByLabel("Colour theme").selectOption("light");
      const light = await background();
      assert.notEqual(dark, light);
      assert.equal(await page.getAttribute("html", "data-theme"), "light");
    });
  });
}

for (const [kind, path] of kAnyReport) {
  thorough(`on a phone nothing is wider than the screen (${kind})`, async () => {
    await withReport(path(), kPhone, async ({ page }) => {
      await scrollThrough(page);
      const [page_, screen] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
      assert.ok(page_ <= screen && screen === 390, `${page_} of ${screen}`);
      const options = page.getByRole("button", { name: "View options" }).first();
      if (await options.count()) {
        await options.click();
        assert.ok(await page.getByLabel("Point size").first().isVisible());
      }
    });
  });
}

/** What is cut off: cells and labels whose content is wider than they are, and boxes that scroll sideways. */
const cutOff = (page) =>
  page.evaluate(() => {
    const visible = (element) => element.clientWidth > 0 && !element.closest(".visually-hidden, .kind-answer > h2");
    const name = (element) => `${element.tagName} ${element.className}: ${element.textContent.slice(0, 60)}`;
    const narrow = [...document.querySelectorAll("th, td, dt, dd, .chip, .choice, .badge, .verdict p, .answer-part")];
    const boxes = [...document.querySelectorAll(".table-scroll, .chart-stage, .scene, .card")];
    return [...narrow, ...boxes].filter((element) => visible(element) && element.scrollWidth > element.clientWidth + 1).map(name);
  });

for (const [name, width] of [["answer", 1400], ["answer", 390], ["small", 1400], ["small", 390], ["network", 1400], ["network", 390]]) {
  thorough(`nothing of the ${name} sample is cut off at ${width} pixels`, async () => {
    await withReport(sampleFile(name), width < 500 ? kPhone : {}, async ({ page }) => {
      await scrollThrough(page);
      assert.deepEqual(await cutOff(page), []);
      // Words are not broken where they could stand on a line of their own.
      const broken = await page.evaluate(() =>
        [...document.querySelectorAll(".table-figure th, .table-figure td:not(.long)")]
          .filter((cell) => cell.clientWidth > 0 && !cell.closest(".is-stacked"))
          .flatMap((cell) => {
            const range = document.createRange();
            const walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
            const words = [];
            while (walker.nextNode()) {
              for (const { index, 0: word } of walker.currentNode.data.matchAll(/[\p{L}\d.]+/gu)) {
                range.setStart(walker.currentNode, index);
                range.setEnd(walker.currentNode, index + word.length);
                if (new Set([...range.getClientRects()].map(({ top }) => Math.round(top))).size > 1) {
                  words.push(word);
                }
              }
            }
            return words;
          }));
      assert.deepEqual(broken, []);
      return kAsItWas;
    });
  });
}

thorough("the whole figure fits the window, and the slider covers no view", async () => {
  for (const name of ["answer", "network"]) {
    await withReport(sampleFile(name), {}, async ({ page }) => {
      await page.locator("[data-scene]").first().scrollIntoViewIfNeeded();
      await settled(page);
      const places = await page.evaluate(() => {
        const scene = document.querySelector("[data-scene]");
        const bar = document.querySelector(".bar").offsetHeight;
        const parts = [...scene.children].filter((part) => part.matches(".toolbar, .scene-body, .timeline, .legend"));
        const rect = (element) => element.getBoundingClientRect();
        return { tall: rect(parts.at(-1)).bottom - rect(parts[0]).top, room: innerHeight - bar,
          stage: rect(scene.querySelector(".scene-body")).bottom, slider: rect(scene.querySelector(".timeline")).top,
          position: getComputedStyle(scene.querySelector(".timeline")).position };
      });
      assert.equal(places.position, "static");
      assert.ok(places.slider >= places.stage - 1, `${name}: the slider at ${places.slider}, the views down to ${places.stage}`);
      if (name === "answer") {
        assert.ok(places.tall <= places.room + 1, `${places.tall} of ${places.room}`);
      }
      return kAsItWas;
    });
  }
});

test("without a record there is no empty panel beside the views", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    const widths = () => page.evaluate(() => [document.querySelector(".stage").clientWidth, document.querySelector(".scene").clientWidth]);
    const [stage, scene] = await widths();
    assert.ok(stage >= scene - 2, `${stage} of ${scene}`);
    assert.ok(!(await page.locator(".scene-side").first().isVisible()));
    return kAsItWas;
  });
});

test("what is switched off looks off, not disabled", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    const chip = page.locator("[data-layer=matches]").first();
    const looks = () => chip.evaluate((element) => {
      const style = getComputedStyle(element);
      return { color: style.color, line: style.textDecorationLine, border: style.borderStyle, tick: getComputedStyle(element, "::before").backgroundImage };
    });
    const on = await looks();
    await chip.click();
    const off = await looks();
    assert.equal(off.color, on.color);
    assert.equal(off.line, "none");
    assert.equal(off.border, "solid");
    assert.notEqual(off.tick, on.tick);
    await chip.click();
    return kAsItWas;
  });
});

test("a sentence of a single row has the width of the whole list", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    const widths = await page.locator(".row-facts").evaluate((list) => [...list.children].map((item) => item.clientWidth / list.clientWidth));
    assert.equal(widths.filter((width) => width > 0.9).length, 1);
    assert.ok(widths.filter((width) => width < 0.3).length > 5);
  });
});

test("the answer comes first: verdict in words, probability, reason, pose, deviations", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    const answer = page.locator(".answer");
    const verdict = answer.locator(".verdict");
    assert.match(await verdict.innerText(), /Aligned[^]*99\.9960 %[^]*412 of 700 landmarks match/);
    assert.ok(await verdict.evaluate((element) => element.getBoundingClientRect().bottom < innerHeight));
    assert.ok(await answer.locator(".answer-pose").evaluate((element) => element.getBoundingClientRect().bottom < innerHeight));
    assert.equal(await answer.locator(".matrix td").count(), 16);
    assert.equal(await answer.locator(".deviations .bar-mark").count(), 6);
    assert.match(await answer.locator("[data-deviation=translation-y]").innerText(), /3\.4 mm/);
    // Bars start at zero: they are as long as their values.
    const widths = await answer.locator(".deviations.translation .bar-fill").evaluateAll((bars) => bars.map((bar) => Number(bar.getAttribute("width"))));
    assert.deepEqual(widths.map((w) => Math.round(100 * w) / 100), [35.29, 100, 23.53]);

    await answer.getByRole("button", { name: "observations" }).click();
    assert.match(await verdict.innerText(), /Ambiguous/);
    assert.match(await answer.locator(".answer-uncertainty").innerText(), /2 open directions[^]*moving along y[^]*turning about \(0\.00 0\.71 0\.71\)/);
    await answer.getByRole("button", { name: "distance" }).click();
    assert.match(await verdict.innerText(), /Rejected[^]*No pose can be trusted/);
    assert.match(await answer.locator(".answer-pose h3").textContent(), /not trusted/);
    await answer.getByRole("button", { name: "icp" }).click();
    assert.match(await verdict.innerText(), /Not judged/);
    assert.equal(await answer.locator(".answer-candidates").count(), 0);
    await answer.getByRole("button", { name: "robust" }).click();
    return kAsItWas;
  });
});

test("the pose is copied with all its digits, and the page reads it as given", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    const copied = async (name) => {
      await page.locator(".answer").getByRole("button", { name }).click();
      return (await page.evaluate(() => navigator.clipboard.readText())).trim().split(/\s+/).map(Number);
    };
    const [tx, ty, tz, w, x, y, z] = await copied("Copy translation and quaternion");
    const matrix = await copied("Copy matrix");
    assert.equal(matrix.length, 16);
    assert.deepEqual([matrix[3], matrix[7], matrix[11]], [tx, ty, tz]);
    const expected = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)];
    expected.forEach((value, i) => assert.ok(Math.abs(matrix[i] - value) < 1e-12));
    assert.deepEqual(matrix.slice(12), [0, 0, 0, 1]);
    return kAsItWas;
  });
});

thorough("a candidate is chosen by the keyboard, in the answer or over the view, and both follow", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    await scrollThrough(page);
    await page.locator("[data-scene]").first().scrollIntoViewIfNeeded();
    await settled(page);
    const own = (await drawing(page)).sum;
    const title = page.locator(".answer-pose h3");
    const first = page.locator("[data-candidate='0']");
    assert.ok(await first.isChecked());
    await first.focus();
    await page.keyboard.press("ArrowDown");
    assert.ok(await page.locator("[data-candidate='1']").isChecked());
    assert.equal(await page.evaluate(() => document.activeElement.dataset.candidate), "1", "the focus stays");
    assert.equal(await title.textContent(), "Pose of candidate 2");
    await settled(page);
    assert.notEqual((await drawing(page)).sum, own);
    assert.equal(await page.locator(".pane-iteration").first().textContent(), "Candidate 2");
    assert.ok(!(await page.locator(".pane .badge").first().isVisible()), "the verdict is not the candidate's");
    assert.equal(await page.locator(".pane-iteration").nth(1).textContent(), "20 of 20", "other strategies stay");

    await page.getByRole("combobox", { name: "Pose shown" }).selectOption({ label: "robust: Candidate 3" });
    assert.ok(await page.locator("[data-candidate='2']").isChecked());
    await moveSlider(page, 20);
    assert.ok(await first.isChecked(), "the slider goes back to the alignment's own pose");
    assert.equal((await drawing(page)).sum, own);
    await page.getByRole("button", { name: "Show all 12" }).click();
    assert.equal(await page.locator("[data-candidate]").count(), 12);
    assert.match(await page.locator(".course-svg").getAttribute("aria-label"), /12 candidates: candidate 1, Matched 58\.8 %, Evidence 812, Probability 99\.9960 %/);
  });
});

thorough("curves start at zero unless another axis is chosen", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    await scrollThrough(page);
    const ticks = () => page.locator("#section-flat .chart-svg g[aria-label='y-axis tick label'] text").allTextContents();
    assert.ok((await ticks()).includes("0"), (await ticks()).join());
    const range = page.locator(".curve-range").first();
    assert.match(await range.textContent(), /^0 – /);
    await page.getByRole("combobox", { name: "Vertical axis of “Convergence”" }).selectOption("values");
    assert.ok(!(await ticks()).includes("0"));
    await page.getByRole("button", { name: "From zero" }).first().click();
    assert.doesNotMatch(await range.textContent(), /^0 – /);
  });
});

thorough("paper has every chart and view within its width, in light colours, and nothing folded away", async () => {
  for (const scheme of [{}, { colorScheme: "dark" }]) {
    await withReport(sampleFile("answer"), scheme, async ({ page }) => {
      const theme = await page.getAttribute("html", "data-theme");
      // Neither scrolled to nor drawn before.
      await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
      await page.emulateMedia({ media: "print" });
      await page.setViewportSize({ width: 718, height: 1000 });
      await page.waitForFunction(() => [...document.querySelectorAll(".pane-paper")].every((image) => image.complete && image.naturalWidth > 0));
      assert.equal(await page.getAttribute("html", "data-theme"), "light");
      const views = await page.evaluate(() => [...document.querySelectorAll(".pane-paper")].map((image) => {
        const copy = new OffscreenCanvas(image.naturalWidth, image.naturalHeight).getContext("2d");
        copy.drawImage(image, 0, 0);
        const { data } = copy.getImageData(0, 0, image.naturalWidth, image.naturalHeight);
        let inked = 0;
        for (let i = 0; i < data.length; i += 4) {
          inked += data[i] === 255 && data[i + 1] === 255 && data[i + 2] === 255 ? 0 : 1;
        }
        return { corner: [...data.slice(0, 3)], share: inked / (data.length / 4) };
      }));
      assert.equal(views.length, 4);
      for (const { corner, share } of views) {
        assert.deepEqual(corner, [255, 255, 255]);
        assert.ok(share > 0.005 && share < 0.5, `${share} of the picture`);
      }
      assert.ok(await page.locator(".scene-summary").first().evaluate((details) => details.open));
      assert.equal(await page.locator("[data-candidate]").count(), 12);
      const right = await page.evaluate(() => innerWidth);
      const wide = await page.evaluate((edge) => [...document.querySelectorAll(".card, .chart-svg, table, td, .pane-paper, .curve")]
        .filter((element) => element.getBoundingClientRect().right > edge + 1).map((element) => element.outerHTML.slice(0, 80)), right);
      assert.deepEqual(wide, []);
      assert.deepEqual(await cutOff(page), []);
      for (const gone of [".bar", ".toolbar", ".slider", ".exports", "button.copy"]) {
        assert.ok(!(await page.locator(gone).first().isVisible()), gone);
      }
      await page.evaluate(() => dispatchEvent(new Event("afterprint")));
      assert.equal(await page.getAttribute("html", "data-theme"), theme);
    }, true);
  }
});

thorough("a wide table is printed smaller and in landscape, with its header; one that would be too small as a list of rows", async () => {
  const { document, buffers } = kSamples.answer();
  const table = (id, columns, rows) => ({
    kind: "table", id, title: id, text: null, best: null,
    columns: Array.from({ length: columns }, (_, i) => ({ name: `published observations ${i}`, unit: "10^-3 m^2", type: "number", digits: 3 })),
    rows: Array.from({ length: rows }, (_, row) => Array.from({ length: columns }, (_, i) => row + i / 8)),
  });
  const path = join(folder, "wide.html");
  writeFileSync(path, writePage({ document: { ...document, sections: [table("wide", 11, 45), table("wider", 40, 2)] }, buffers }));
  await withReport(path, {}, async ({ page }) => {
    const pdf = (await page.pdf({ preferCSSPageSize: true })).toString("latin1");
    const boxes = [...pdf.matchAll(/\/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]/g)].map(([, width, height]) => Number(width) > Number(height));
    assert.ok(boxes.length <= 6, `${boxes.length} pages`);
    assert.ok(boxes.includes(true) && boxes.includes(false), "both ways up");
    await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
    await page.emulateMedia({ media: "print" });
    await page.setViewportSize({ width: 1038, height: 718 });
    const shown = await page.evaluate(() => ["wide", "wider"].map((id) => {
      const figure = document.querySelector(`#section-${id} .table-figure`);
      const card = figure.getBoundingClientRect();
      return {
        stacked: figure.classList.contains("is-stacked"),
        landscape: figure.classList.contains("on-landscape"),
        inside: [...figure.querySelectorAll("table, th, td")].every((cell) => cell.getBoundingClientRect().right <= card.right + 1),
        // Chromium leaves buttons out of a header that it repeats.
        buttons: figure.querySelectorAll("thead button").length - [...figure.querySelectorAll("thead button")].filter((one) => getComputedStyle(one).display === "contents").length,
        unbroken: [...figure.querySelectorAll("td")].filter((cell) => getComputedStyle(cell).whiteSpace === "nowrap").length,
      };
    }));
    assert.deepEqual(shown[0], { stacked: false, landscape: true, inside: true, buttons: 0, unbroken: 11 * 45 });
    assert.deepEqual([shown[1].stacked, shown[1].landscape, shown[1].inside, shown[1].unbroken], [true, false, true, 0]);
    await page.evaluate(() => dispatchEvent(new Event("afterprint")));
    assert.equal(await page.locator(".on-paper").count(), 0);
  });
});

test("probabilities read alike and sort by value; sentences wrap on paper; lists of rows begin with a few", async () => {
  const { document, buffers } = kSamples.answer();
  const probabilities = [0.5, 0.00001, 0.9999999, 0.99996, ...Array.from({ length: 10 }, (_, i) => 0.1 + i / 100)];
  const reason = "the best pose matches 4.4 % of 3050 landmarks one to one, and the next pose 4.8 % of them";
  const number = (name) => ({ name, unit: null, type: "number", digits: 3 });
  const table = {
    kind: "table", id: "links", title: "Links", text: null, best: null,
    columns: [{ name: "Probability", unit: null, type: "probability", digits: null }, ...["Residual", "Angle", "Landmarks"].map(number), { name: "Reason", unit: null, type: "text", digits: null }],
    rows: probabilities.map((probability) => [probability, 1, 2, 3, reason]),
  };
  const path = join(folder, "links.html");
  writeFileSync(path, writePage({ document: { ...document, sections: [table] }, buffers }));
  const texts = (page) => page.locator("#section-links tbody td:first-child").allTextContents();
  await withReport(path, {}, async ({ page }) => {
    assert.deepEqual((await texts(page)).slice(0, 4), ["50.00 %", "<0.01 %", ">99.9999 %", "99.9960 %"]);
    await page.locator("#section-links thead button").first().click();
    const sorted = await texts(page);
    assert.deepEqual([sorted[0], ...sorted.slice(-3)], ["<0.01 %", "50.00 %", "99.9960 %", ">99.9999 %"]);
    await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
    await page.emulateMedia({ media: "print" });
    await page.setViewportSize({ width: 718, height: 1000 });
    assert.deepEqual(await cutOff(page), []);
    await page.evaluate(() => dispatchEvent(new Event("afterprint")));
  });
  await withReport(path, kPhone, async ({ page }) => {
    assert.equal((await texts(page)).length, 5);
    await page.getByRole("button", { name: "Show all 14 rows" }).click();
    assert.equal((await texts(page)).length, 14);
  });
});

thorough("colours of text stand out from what is behind them, in light and dark", async () => {
  for (const scheme of [{}, { colorScheme: "dark" }]) {
    await withReport(sampleFile("answer"), scheme, async ({ page }) => {
      const low = await page.evaluate(() => {
        const numbers = (color) => color.match(/[\d.]+/g).map(Number);
        const luminance = (color) => numbers(color).slice(0, 3).map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
          .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
        const behind = (element) => {
          for (let at = element; at; at = at.parentElement) {
            const { backgroundColor } = getComputedStyle(at);
            if ((numbers(backgroundColor)[3] ?? 1) === 1) {
              return backgroundColor;
            }
          }
          return "rgb(255, 255, 255)";
        };
        return [...document.querySelectorAll(".verdict *, .answer-part p, .answer-part td, .answer-part th, .answer-part dt, .choice *, .chip, .legend *, .muted, .badge")]
          .filter((element) => element.clientWidth > 0 && element.textContent.trim() && !(element instanceof SVGElement))
          .map((element) => {
            const [a, b] = [luminance(getComputedStyle(element).color), luminance(behind(element))].sort((x, y) => y - x);
            return [(a + 0.05) / (b + 0.05), `${element.tagName}.${element.className}`];
          })
          .filter(([contrast]) => contrast < 4.5);
      });
      assert.deepEqual(low, []);
      return kAsItWas;
    });
  }
});

thorough("every control can be reached and pressed without a mouse", async () => {
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    const wanted = await page.evaluate(() => [...document.querySelectorAll("button, select, input:not([type=radio]), a[href], summary")]
      .filter((element) => element.offsetParent !== null && !element.disabled).length);
    const seen = await page.evaluate(() => window.reached_ = new Set());
    assert.ok(seen);
    let invisible = [];
    for (let i = 0; i < wanted + 60; ++i) {
      await page.keyboard.press("Tab");
      const at = await page.evaluate(() => {
        const element = document.activeElement;
        const again = window.reached_.has(element);
        window.reached_.add(element);
        const style = getComputedStyle(element);
        return { again, body: element === document.body, name: element.outerHTML.slice(0, 60), outline: style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 1 };
      });
      if (at.body || at.again) {
        break;
      }
      if (!at.outline) {
        invisible.push(at.name);
      }
    }
    assert.deepEqual(invisible, [], "focus is visible");
    const missed = await page.evaluate(() => [...document.querySelectorAll("button, select, input:not([type=radio]), a[href], summary")]
      .filter((element) => element.offsetParent !== null && !element.disabled && !window.reached_.has(element)).map((element) => element.outerHTML.slice(0, 80)));
    assert.deepEqual(missed, []);
  }, true);
});

thorough("every control has a name and focus is visible", async () => {
  await withReport(reportPath(), {}, async ({ page }) => {
    const nameless = await page.evaluate(() =>
      [...document.querySelectorAll("button, select, input, a, canvas[role], svg[role]")]
        .filter((element) => !(element.getAttribute("aria-label") || element.textContent.trim() || element.closest("label")?.textContent.trim()))
        .map((element) => element.outerHTML.slice(0, 80)));
    assert.deepEqual(nameless, []);
    await page.keyboard.press("Tab");
    await page.keyboard.press("Tab");
    const outline = await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle);
    assert.notEqual(outline, "none");
    return kAsItWas;
  });
});

thorough("without WebGL the page says so and the rest works", async () => {
  const blind = await launch(["--disable-3d-apis"]);
  const opened = await openReport(blind, reportPath());
  try {
    assert.match(await opened.page.locator(".stage [role=alert]").first().textContent(), /needs WebGL 2/);
    const numbers = await opened.page.locator(".pane").first().innerText();
    await opened.page.getByRole("button", { name: "Initial" }).first().click();
    assert.notEqual(await opened.page.locator(".pane").first().innerText(), numbers);
    await scrollThrough(opened.page);
    assert.ok((await opened.page.locator(".chart-svg").count()) > 4);
    assert.deepEqual(opened.complaints, []);
  } finally {
    await blind.close();
  }
});

test("a network: the slider moves maps, and one selection shows in graph, matrix and record", async () => {
  await withReport(sampleFile("network"), {}, async ({ page }) => {
    await scrollThrough(page);
    await page.evaluate(() => scrollTo({ top: 0, behavior: "instant" }));
    await settled(page);
    const after = await drawing(page);
    assert.ok(after.inked > 1000, `something is drawn (${after.inked} pixels)`);
    assert.equal(await page.locator(".stage-name").textContent(), "Optimised");
    await page.getByRole("button", { name: "Own frames" }).click();
    await settled(page);
    assert.equal(await page.locator(".stage-name").textContent(), "Own frames");
    assert.notEqual((await drawing(page)).sum, after.sum);
    await page.keyboard.press("End");
    await settled(page);
    assert.equal((await drawing(page)).sum, after.sum, "the same stage is the same picture");

    const link = page.locator(".graph-link[data-use=contradicted]");
    await link.focus();
    await page.keyboard.press("Enter");
    const record = page.locator(".record");
    assert.match(await record.innerText(), /monday ← robot2[^]*contradicted[^]*99\.21 %[^]*388 landmarks agree/);
    assert.equal(await page.locator(".matrix-cell[aria-pressed=true]").count(), 1);
    assert.equal(await page.evaluate(() => document.activeElement.getAttribute("aria-pressed")), "true", "the focus stays");
    await page.keyboard.press("Escape");
    assert.ok(!(await record.isVisible()));
    await page.locator(".matrix-cell").first().click();
    assert.match(await record.innerText(), /monday ← tuesday/);
    await record.getByRole("button", { name: "tuesday" }).click();
    assert.match(await record.innerText(), /Its links/);
    await page.locator(".map-list").getByRole("button", { name: "cellar" }).click();
    assert.match(await record.innerText(), /Left out: aligned with no other map/);

    const dashed = await page.locator(".graph-link line[stroke-dasharray]").count();
    assert.equal(dashed, 6, "what is not used is dashed");
    await page.locator("[data-layer=rejected]").click();
    assert.equal(await page.locator(".graph-link").count(), 4);
    await settled(page);
    const withAll = (await drawing(page)).sum;
    await page.getByLabel("Show tuesday").uncheck();
    await settled(page);
    assert.notEqual((await drawing(page)).sum, withAll);
    const command = page.locator("#section-log .copy-cell");
    assert.equal(await command.locator("code").textContent(), "cairn atlas undo --commit 2 --atlas town.atlas");
    assert.equal(await command.getByRole("button").count(), 1);
    assert.equal(await page.locator("#section-sessions .chart-svg rect[fill]").count() >= 5, true);
  });
});

test("a network shows two keyframes of each link side by side, the least certain link first", async () => {
  for (const [width, options] of [[1400, {}], [390, kPhone]]) {
    await withReport(sampleFile("network"), options, async ({ page }) => {
      const links = page.locator(".link-gallery li");
      assert.deepEqual(await links.getByRole("button").allTextContents(), ["monday ← robot2", "monday ← wednesday", "monday ← tuesday", "wednesday ← robot2"]);
      assert.match(await links.first().innerText(), /contradicted[^]*99\.21 %[^]*1 common landmark in both images/);
      assert.match(await links.last().innerText(), /ambiguous[^]*common landmarks in both images, at the poses of the maps/);
      const used = links.nth(2);
      assert.match(await used.innerText(), /used[^]*monday 5 · 1790000010\.000 s[^]*tuesday 0 · [^]*112 common landmarks/);
      const pictures = used.getByRole("img");
      assert.equal(await pictures.last().getAttribute("alt"), "Keyframe 0 · 1790086400.000 s of tuesday");
      await pictures.first().scrollIntoViewIfNeeded();
      const [left, right] = await pictures.evaluateAll((all) =>
        Promise.all(all.map((one) => one.decode().then(() => ({ ...one.getBoundingClientRect().toJSON(), wide: one.naturalWidth })))));
      assert.equal(left.wide, 64);
      assert.equal(left.top, right.top, `side by side at ${width} pixels`);
      assert.ok(right.left >= left.right && right.right <= width);
      assert.ok(left.width > 100 && left.width <= 320, `${left.width} pixels wide`);
      await used.getByRole("button").click();
      assert.equal(await page.locator(".record").getByRole("img").count(), 2);
      assert.match(await page.locator(".record").innerText(), /monday ← tuesday[^]*112 common landmarks/);
    });
  }
  await withReport(sampleFile("answer"), {}, async ({ page }) => {
    assert.equal(await page.locator(".link-gallery").count(), 0);
    return kAsItWas;
  });
});

test("a click in the 3D view of a network picks a map or a link", async () => {
  await withReport(sampleFile("network"), {}, async ({ page }) => {
    await page.locator(".pane-surface").first().scrollIntoViewIfNeeded();
    await settled(page);
    const surface = page.locator(".pane-overlay").first();
    const box = await surface.boundingBox();
    for (let i = 0; i < 120 && !(await page.locator(".record h4").count()); ++i) {
      const [u, v] = [(i * 0.618034) % 1, (i * 0.754878) % 1];
      await surface.click({ position: { x: box.width * (0.2 + 0.6 * u), y: box.height * (0.2 + 0.6 * v) }, force: true });
    }
    assert.match(await page.locator(".record").innerText(), /(Landmark|Keyframe|Its links|Reason)/);
  });
});

thorough("a keyframe of a network is entered, shows what it saw, moves with its map and is left", async () => {
  await withReport(sampleFile("network"), {}, async ({ page }) => {
    await page.locator(".stage").first().scrollIntoViewIfNeeded();
    await settled(page);
    const outside = await drawing(page);
    const tools = keyframeTools(page);
    const output = tools.locator("output");
    const record = page.locator(".record");
    assert.equal(await output.textContent(), "14 keyframes");
    await page.locator("[data-scene]").first().evaluate((element) => element.focus());
    await page.keyboard.press("c");
    await settled(page);
    assert.notEqual((await drawing(page)).sum, outside.sum);
    await tools.getByRole("combobox").selectOption({ label: "monday" });
    await chooseKeyframe(page, 5);
    assert.equal(await output.textContent(), "5 · 1790000010.000 s");
    assert.match(await record.innerText(), /monday[^]*Keyframe 5[^]*1790000010\.000 s/);
    await imageShown(page);
    const { opacity } = await overlay(page, 0, 0.3, 0.6);
    assert.ok(opacity > 100 && opacity < 160, `the image is drawn at half opacity (${opacity})`);
    const inside = await drawing(page);
    await page.keyboard.press("]");
    await settled(page);
    assert.match(await output.textContent(), /^6 · /);
    assert.match(await record.innerText(), /Keyframe 6/);
    assert.ok(await tools.getByRole("button", { name: "Image" }).isDisabled(), "this keyframe has no image");
    await page.keyboard.press("[");
    await settled(page);
    assert.equal((await drawing(page)).sum, inside.sum);
    await page.keyboard.press("Home");
    await settled(page);
    assert.notEqual((await drawing(page)).sum, inside.sum, "the maps are in frames of their own");
    await page.keyboard.press("End");
    await settled(page);
    await page.keyboard.press("Escape");
    await settled(page);
    assert.equal((await drawing(page)).sum, outside.sum, "the view is what it was before");
    await page.keyboard.press("Escape");
    assert.ok(!(await record.isVisible()));

    const box = await page.locator(".pane-overlay").first().boundingBox();
    const tip = page.locator(".pane-tip").first();
    let named = "";
    for (let i = 0; i < 400 && !named; ++i) {
      await page.mouse.move(box.x + box.width * ((i * 0.618034) % 1), box.y + box.height * ((i * 0.754878) % 1));
      await page.waitForTimeout(15);
      named = (await tip.isVisible()) ? (/^(\w+) · keyframe (\d+ · .*)$/.exec(await tip.textContent()) ?? [""])[0] : "";
    }
    const [, map, frame] = /^(\w+) · keyframe (.*)$/.exec(named) ?? [];
    assert.ok(map, "a camera is named below the pointer");
    await page.mouse.down();
    await page.mouse.up();
    await settled(page);
    assert.equal(await output.textContent(), frame);
    assert.equal(await tools.getByRole("combobox").locator("option:checked").textContent(), map);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2, { steps: 4 });
    await page.mouse.up();
    assert.equal(await output.textContent(), "14 keyframes", "a drag leaves it");
  });
});

test("in a notebook a link to a part of the report leads there", async () => {
  const path = join(folder, "notebook.html");
  const srcdoc = readFileSync(reportPath(), "utf8").replaceAll("&", "&amp;").replaceAll('"', "&quot;");
  const style = "width:100%;height:720px;border:0";
  writeFileSync(path, `<!doctype html><html data-state="ready"><iframe srcdoc="${srcdoc}" style="${style}"></iframe></html>`);
  const { page, context, complaints } = await openReport(browser, path);
  const [, report] = page.frames();
  await report.waitForSelector("html[data-state=ready]", { state: "attached" });
  // What is drawn above meanwhile may move the part again.
  const arrivesAt = (id) =>
    report.waitForFunction((wanted) => document.activeElement?.id === wanted && scrollY > 0, id);
  await report.getByRole("link", { name: "Provenance" }).click();
  await arrivesAt("provenance");
  await report.locator(".skip").focus();
  await page.keyboard.press("Enter");
  await report.waitForFunction(() => document.activeElement?.id === "content");
  assert.equal(report.url(), "about:srcdoc");
  assert.deepEqual(complaints, []);
  await context.close();
});

test("names that hold markup or script are shown and do nothing", async () => {
  await withReport(sampleFile("hostile"), {}, async ({ page }) => {
    await scrollThrough(page);
    assert.equal(await page.getAttribute("html", "data-state"), "ready");
    assert.equal(await page.evaluate(() => window.pwned), undefined);
    assert.equal(await page.evaluate(() => ({}).polluted ?? Object.keys(Object.prototype).length), 0);
    assert.equal(await page.locator("#page script, #page img[src=x], #page [onerror], #page [onload]").count(), 0);
    assert.ok((await page.textContent("h1")).includes("</script>"));
    const before = await page.locator("#page script").count();
    await page.locator(".slider").first().fill("0");
    await page.getByRole("combobox", { name: "Colour by" }).first().selectOption({ index: 2 });
    await settled(page);
    assert.equal(await page.locator("#page script").count(), before);
    const [width, screen] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
    assert.ok(width <= screen, `${width} of ${screen}`);
    for (const id of ["violin", "lines", "heat", "dots", "cloud", "spans"]) {
      const svg = await saved(page, () => page.locator(`#section-${id} .exports button`).first().click());
      const parsed = await page.evaluate((text) => {
        const document_ = new DOMParser().parseFromString(text, "image/svg+xml");
        return [document_.querySelectorAll("parsererror").length, document_.querySelectorAll("script, img, foreignObject").length];
      }, svg.bytes.toString("utf8"));
      assert.deepEqual(parsed, [0, 0], id);
    }
  });
});

test("a page without data, of a newer version or damaged says what is wrong", async () => {
  const { sample } = sampleOf("small");
  const template = readFileSync(process.env.CAIRN_TEMPLATE ?? new URL("../dist/report_template.html", import.meta.url), "utf8");
  const newer = { ...sample, document: { ...sample.document, schema: { name: "cairn.report", version: 9 } } };
  const cases = [
    ["empty", template, /holds no report/],
    ["newer", writePage(newer), /version 9/],
    ["cut", writePage(sample).replace(/(id="cairn-report" data-encoding="gzip-base64">.{400})[^<]*/, "$1"), /cannot be decompressed/],
  ];
  for (const [name, html, expected] of cases) {
    const path = join(folder, `${name}.html`);
    writeFileSync(path, html);
    await withReport(path, {}, async ({ page }) => {
      assert.equal(await page.getAttribute("html", "data-state"), "error");
      assert.match(await page.locator("[role=alert]").textContent(), expected);
      return kAsItWas;
    });
  }
});

test("a script that is not the page's own cannot run", async () => {
  const path = join(folder, "injected.html");
  writeFileSync(path, readFileSync(sampleFile("hostile"), "utf8").replace("</body>", "<script>window.pwned = 5</script></body>"));
  const { page, context, complaints } = await openReport(browser, path);
  assert.equal(await page.evaluate(() => window.pwned), undefined);
  assert.match(complaints.join(), /Content Security Policy/);
  await context.close();
});

// What it takes is printed, not tested: a busy machine is no defect.
for (const [name, limitMb] of [["paper", 15], ["million", Infinity]]) {
  thorough(`the ${name} sample opens and redraws on a drag`, async () => {
    const path = sampleFile(name);
    const megabytes = statSync(path).size / 1e6;
    await withReport(path, {}, async ({ page, openMs }) => {
      const ready = await page.evaluate(() => performance.getEntriesByName("cairn-ready")[0].startTime);
      await page.locator(".stage").first().scrollIntoViewIfNeeded();
      await settled(page);
      const before = await drawing(page);
      assert.ok(before.inked > 2000);
      const box = await page.locator(".pane-overlay").first().boundingBox();
      await page.mouse.move(box.x + 200, box.y + 120);
      await page.mouse.down();
      const start = Date.now();
      const frames = await page.evaluate(() => {
        window.frames_ = [];
        const tick = (now) => {
          window.frames_.push(now);
          requestAnimationFrame(tick);
        };
        requestAnimationFrame(tick);
      });
      assert.equal(frames, undefined);
      for (let i = 1; i <= 10; ++i) {
        await page.mouse.move(box.x + 200 + 12 * i, box.y + 120 + 3 * i);
      }
      const dragMs = (Date.now() - start) / 10;
      await page.mouse.up();
      await settled(page);
      assert.notEqual((await drawing(page)).sum, before.sum);
      const pickMs = await page.evaluate(([x, y]) => {
        const overlay = document.querySelector(".pane-overlay");
        const start_ = performance.now();
        for (const type of ["pointerdown", "pointerup"]) {
          overlay.dispatchEvent(new PointerEvent(type, { clientX: x, clientY: y, pointerId: 1, bubbles: true, button: 0 }));
        }
        return performance.now() - start_;
      }, [box.x + box.width / 2, box.y + box.height / 2]).catch(() => NaN);
      console.log(`  ${name}: ${megabytes.toFixed(2)} MB, ready after ${Math.round(ready)} ms (navigation and wait ${openMs} ms), a step of a drag ${Math.round(dragMs)} ms, a pick ${Math.round(pickMs)} ms`);
      assert.ok(megabytes < limitMb, `${megabytes} MB`);
    });
  });
}

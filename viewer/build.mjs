// SPDX-License-Identifier: BSD-3-Clause
// Builds the page template: node build.mjs [--outfile PATH]. Writes PATH (default dist/report_template.html)
// and, beside it, THIRD_PARTY_VIEWER.txt with the licences of the packages inside.
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const kTitleMarker = "<!--CAIRN:TITLE-->";
const kDataMarker = "<!--CAIRN:DATA-->";
const kTargets = ["chrome109", "firefox115", "safari16.4"];

function outfile() {
  const flag = process.argv.indexOf("--outfile");
  if (flag >= 0 && !process.argv[flag + 1]) {
    throw new Error("--outfile needs a path");
  }
  const given = flag >= 0 ? process.argv[flag + 1] : process.env.CAIRN_VIEWER_OUTFILE;
  return given ? resolve(given) : join(here, "dist", "report_template.html");
}

async function bundle(entry, options) {
  const result = await build({
    absWorkingDir: here,
    entryPoints: [entry],
    bundle: true,
    write: false,
    minify: true,
    charset: "ascii",
    legalComments: "none",
    metafile: true,
    target: kTargets,
    logLevel: "warning",
    ...options,
  });
  const used = Object.entries(Object.values(result.metafile.outputs)[0].inputs)
    .filter(([, { bytesInOutput }]) => bytesInOutput > 0)
    .map(([input]) => input);
  return { text: result.outputFiles[0].text.trim(), inputs: used };
}

/** Name, version and licence text of each npm package that `inputs` come from. */
function packagesOf(inputs) {
  const folders = new Set();
  for (const input of inputs) {
    const match = /^(.*node_modules\/(?:@[^/]+\/)?[^/]+)\//.exec(input);
    if (match) {
      folders.add(match[1]);
    }
  }
  return [...folders].sort().map((folder) => {
    const path = join(here, folder);
    const { name, version, license } = JSON.parse(readFileSync(join(path, "package.json"), "utf8"));
    const file = readdirSync(path).find((entry) => /^licen[cs]e/i.test(entry));
    if (!file) {
      throw new Error(`${name} ships no licence file`);
    }
    return { name, version, license, text: readFileSync(join(path, file), "utf8").trim() };
  });
}

/** The notices, each licence text once with the packages that share it. */
function notices(packages) {
  const byText = new Map();
  for (const one of packages) {
    byText.set(one.text, [...(byText.get(one.text) ?? []), one]);
  }
  const list = packages.map(({ name, version, license }) => `  ${name} ${version} (${license})`);
  const texts = [...byText].map(
    ([text, users]) => `${"-".repeat(78)}\n${users.map(({ name }) => name).join(", ")}\n\n${text}\n`,
  );
  return `The viewer of Cairn's reports contains these packages:\n\n${list.join("\n")}\n\n${texts.join("\n")}`;
}

function refuse(text, what, patterns) {
  for (const pattern of patterns) {
    const found = pattern.exec(text);
    if (found) {
      const around = text.slice(Math.max(0, found.index - 40), found.index + 60);
      throw new Error(`${what} must not hold ${pattern}: …${around}…`);
    }
  }
}

const script = await bundle("src/main.ts", { format: "iife" });
const style = await bundle("src/styles/page.css", {});
const packages = packagesOf(script.inputs);
const licences = notices(packages);

// Nothing inlined may end its element early, open a comment that changes how the rest parses, or look like a marker.
refuse(script.text, "The script", [/<\/script/i, /<!--/, /<script/i, /CAIRN:(TITLE|DATA)/, /@@/]);
refuse(style.text, "The style", [/<\/style/i, /<!--/, /CAIRN:/, /@@/]);
refuse(licences, "The licences", [/<\/script/i, /<!--/, /@@/]);

// Only this very script may run: its hash is the page's policy. Styles are set by Plot, so they stay open.
const hash = createHash("sha256").update(script.text, "utf8").digest("base64");
const policy = [
  "default-src 'none'",
  `script-src 'sha256-${hash}'`,
  "style-src 'unsafe-inline'",
  "img-src data: blob:",
  "base-uri 'none'",
  "form-action 'none'",
].join("; ");

const parts = { CSP: policy, STYLE: style.text, LICENCES: licences, SCRIPT: script.text };
const page = readFileSync(join(here, "src/page.html"), "utf8").replace(
  /@@(CSP|STYLE|LICENCES|SCRIPT)@@/g,
  (_, name) => parts[name],
);
for (const marker of [kTitleMarker, kDataMarker]) {
  if (page.split(marker).length !== 2) {
    throw new Error(`The page must hold ${marker} exactly once`);
  }
}

const path = outfile();
mkdirSync(dirname(path), { recursive: true });
writeFileSync(path, page);
writeFileSync(join(dirname(path), "THIRD_PARTY_VIEWER.txt"), licences);
console.log(`${path}: ${(page.length / 1e3).toFixed(0)} kB, ${packages.length} packages inside`);

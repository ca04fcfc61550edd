// SPDX-License-Identifier: BSD-3-Clause
// Runs the tests of one kind with Node's own runner: node test/run.mjs unit | browser [REPORT.html]. Of a report that is
// given is tested what must hold of any.
import { spawnSync } from "node:child_process";
import { readdirSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const [kind, report] = process.argv.slice(2);
const files = readdirSync(here)
  .filter((name) => name.endsWith(`.${kind}.test.mjs`))
  .map((name) => join(here, name));
if (files.length === 0) {
  console.error("usage: node test/run.mjs unit | browser [REPORT.html]");
  process.exit(2);
}
const env = { ...process.env, ...(report ? { CAIRN_REPORT: resolve(report) } : {}) };
const { status } = spawnSync(process.execPath, ["--test", "--test-reporter=spec", ...files], { stdio: "inherit", env });
process.exit(status ?? 1);

// SPDX-License-Identifier: BSD-3-Clause
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { build } from "esbuild";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");

/** The exports of a TypeScript module of src/, for Node. */
export async function loadModule(path) {
  const result = await build({
    absWorkingDir: root, entryPoints: [path], bundle: true, write: false, format: "esm", platform: "node", target: "node18", logLevel: "error",
  });
  const folder = mkdtempSync(join(tmpdir(), "cairn-viewer-"));
  try {
    const file = join(folder, "module.mjs");
    writeFileSync(file, result.outputFiles[0].text);
    return await import(pathToFileURL(file).href);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}

// SPDX-License-Identifier: BSD-3-Clause
import { ReportError, messageOf } from "./document/errors";
import { readEmbedded } from "./document/embedded";
import { parseReport } from "./document/report";
import { h } from "./dom";
import { startLinks } from "./links";
import { buildPage } from "./page";
import { startPaper } from "./paper";
import { startTheme } from "./theme";

async function start(): Promise<void> {
  const page = document.getElementById("page");
  if (!page) {
    return;
  }
  startPaper();
  startTheme();
  startLinks();
  try {
    const [json, buffers] = await Promise.all([
      readEmbedded(document, "cairn-report"),
      readEmbedded(document, "cairn-buffers"),
    ]);
    const report = parseReport(new TextDecoder("utf-8").decode(json), buffers);
    document.title = report.title;
    await buildPage(page, report);
    document.documentElement.dataset.state = "ready";
    performance.mark("cairn-ready");
  } catch (error) {
    page.replaceChildren(
      h(
        "main",
        { id: "content", class: "failure", tabindex: -1 },
        h("h1", null, "This report cannot be shown"),
        h("p", { role: "alert" }, messageOf(error)),
      ),
    );
    document.documentElement.dataset.state = "error";
    if (!(error instanceof ReportError)) {
      throw error;
    }
  }
}

void start();

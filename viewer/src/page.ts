// SPDX-License-Identifier: BSD-3-Clause
import { answerFigure } from "./answer";
import { chartFigure } from "./charts/chart_figure";
import { h, paragraphs, s } from "./dom";
import type { Report, Section } from "./document/report";
import { networkFigure } from "./network/network_figure";
import { licencesDisclosure, provenanceSection } from "./provenance";
import { sceneFigure } from "./scene/scene_figure";
import { tableFigure } from "./table";
import { themeControl } from "./theme";

function logo(): SVGElement {
  const stone = (cy: number, rx: number, ry: number, fill: string) => s("ellipse", { cx: 16, cy, rx, ry, fill });
  return s(
    "svg",
    { viewBox: "0 0 32 32", width: 26, height: 26, "aria-hidden": "true" },
    stone(25.5, 12, 5, "#009e73"),
    stone(15.5, 8.5, 4.2, "#56b4e9"),
    stone(7, 5.2, 3.6, "#e69f00"),
  );
}

function contents(report: Report): HTMLElement {
  const link = (id: string, title: string) => h("li", null, h("a", { href: `#${id}` }, title));
  return h(
    "nav",
    { class: "contents", "aria-label": "Contents" },
    h(
      "ol",
      null,
      ...report.sections.map((section) => link(`section-${section.id}`, section.title)),
      link("provenance", "Provenance"),
    ),
  );
}

function sectionContent(section: Section, settled: () => void): HTMLElement[] {
  switch (section.kind) {
    case "answer":
      return [answerFigure(section)];
    case "scene":
      return [sceneFigure(section, settled)];
    case "chart":
      return [chartFigure(section)];
    case "table":
      return [tableFigure(section.table, section.title, section.id)];
    case "network":
      return [networkFigure(section, settled)];
    case "text":
      return [];
    case "notice":
      return [
        h(
          "p",
          { class: "notice", "data-status": section.severity === "broken" ? "bad" : "doubt" },
          section.severity === "broken" ? `This section cannot be shown. ${section.message}` : section.message,
        ),
      ];
  }
}

function sectionElement(section: Section, settled: () => void): HTMLElement {
  const titleId = `title-${section.id}`;
  return h(
    "section",
    { id: `section-${section.id}`, class: `section kind-${section.kind}`, "aria-labelledby": titleId },
    h("h2", { id: titleId }, section.title),
    ...(section.text ? paragraphs(section.text, "section-text") : []),
    ...sectionContent(section, settled),
  );
}

/** Whether the first section says what the subtitle does. */
function answersItself({ sections: [first] }: Report): boolean {
  return first?.kind === "answer" && first.alignments.filter(({ judged }) => judged).length === 1;
}

/** Marks the section in view in the contents. */
function followReading(nav: HTMLElement, main: HTMLElement): void {
  const links = new Map(
    [...nav.querySelectorAll("a")].map((link) => [link.getAttribute("href")?.slice(1) ?? "", link]),
  );
  const observer = new IntersectionObserver(
    (entries) => {
      for (const entry of entries) {
        const link = links.get(entry.target.id);
        if (entry.isIntersecting && link) {
          links.forEach((other) => other.removeAttribute("aria-current"));
          link.setAttribute("aria-current", "true");
          const list = nav.firstElementChild;
          list?.scrollTo({ left: link.offsetLeft - 24 });
        }
      }
    },
    { rootMargin: "-20% 0px -70% 0px" },
  );
  main.querySelectorAll(".section").forEach((section) => observer.observe(section));
}

/** Builds the page; resolves once the first scene, if there is one in view, has drawn its first picture. */
export async function buildPage(page: HTMLElement, report: Report): Promise<void> {
  let settle: () => void = () => {};
  const firstScene = report.sections.find(({ kind }) => kind === "scene" || kind === "network");
  const drawn = new Promise<void>((resolve) => (settle = resolve));
  const nav = contents(report);
  const main = h(
    "main",
    { id: "content", tabindex: -1 },
    h(
      "header",
      { class: "lead" },
      h("h1", null, report.title),
      report.subtitle && !answersItself(report) && h("p", { class: "subtitle" }, report.subtitle),
    ),
    ...report.sections.map((section) => sectionElement(section, section === firstScene ? settle : () => {})),
    provenanceSection(report.provenance, report.cairnVersion),
  );
  page.replaceChildren(
    h(
      "header",
      { class: "bar" },
      h("div", { class: "bar-inner" }, h("span", { class: "brand" }, logo(), "Cairn"), nav, themeControl()),
    ),
    main,
    h(
      "footer",
      { class: "foot" },
      h("p", { class: "muted" }, `Cairn ${report.cairnVersion ?? ""} · one file, no network`),
      licencesDisclosure(),
    ),
  );
  followReading(nav, main);
  if (firstScene) {
    await drawn;
  }
}

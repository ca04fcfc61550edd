// SPDX-License-Identifier: BSD-3-Clause
import { badge, button, facts, h } from "../dom";
import { formatCount, formatLength, formatNumber, formatProbability, idText, positionText } from "../math/format";
import { apply, positionOf } from "../math/pose";
import type { NetworkLink } from "../document/report";
import { linkImages } from "./link_images";
import { hasPose, kUseTexts, type NetworkModel, type Selection } from "./network_model";

type Choose = (selection: Selection) => void;

const recordFacts = (...entries: Parameters<typeof facts>[1]) => facts("record-facts", entries);

function probabilityText(link: NetworkLink): string {
  return link.probability === null ? "not judged" : formatProbability(link.probability);
}

const kUseStatus = {
  used: "good",
  undecided: "good",
  contradicted: "bad",
  ambiguous: "doubt",
  rejected: "bad",
} as const;
const useBadge = ({ use }: NetworkLink) => badge(kUseStatus[use], kUseTexts[use]);

function linkRecord(model: NetworkModel, index: number, choose: Choose): HTMLElement[] {
  const link = model.links[index];
  const images = linkImages(model, index);
  const go = (node: number) =>
    button(model.nodes[node].name, () => choose({ kind: "node", index: node }), { class: "quiet record-link" });
  return [
    h("h3", null, model.linkName(index)),
    useBadge(link),
    recordFacts(
      ["Probability", probabilityText(link)],
      ["Found by", link.kind],
      ["Residual distance", link.residual === null ? null : formatLength(link.residual, model.lengthUnit)],
      ["Residual angle", link.residualDeg === null ? null : `${formatNumber(link.residualDeg, 3)}°`],
      ["Target", go(link.target)],
      ["Source", go(link.source)],
    ),
    ...(images ? [h("h4", null, "Keyframes"), images] : []),
    ...(link.reason ? [h("h4", null, "Reason"), h("p", { "data-record": "reason" }, link.reason)] : []),
  ];
}

function nodeRecord(
  model: NetworkModel,
  selection: Extract<Selection, { kind: "node" }>,
  stage: number,
  choose: Choose,
): HTMLElement[] {
  const node = model.nodes[selection.index];
  const pose = model.pose(selection.index, stage);
  const content: HTMLElement[] = [h("h3", null, node.name)];
  if (node.reason) {
    content.push(h("p", { class: "record-reason" }, `Left out: ${node.reason}`));
  }
  content.push(
    recordFacts(
      ["In the frame of", node.group === null ? "none" : model.section.groups[node.group].frame],
      ["Session", node.session],
      ["Landmarks", formatCount(node.landmarks)],
      ["Fused with others", node.fused === null ? null : formatCount(node.fused)],
      ["Keyframes", formatCount(node.keyframes)],
    ),
  );
  const { cloud } = node;
  if (cloud && selection.landmark !== undefined) {
    const p = positionOf(cloud, selection.landmark);
    content.push(
      h("h4", null, `Landmark ${idText(cloud.ids, selection.landmark)}`),
      recordFacts(["In its map", positionText(p)], ["In the view", positionText(apply(pose, p))]),
    );
  }
  if (cloud?.frames && selection.frame !== undefined) {
    const { poses, timestamps, ids } = cloud.frames;
    const at = 7 * selection.frame;
    const time = timestamps?.[selection.frame];
    content.push(
      h("h4", null, `Keyframe ${idText(ids, selection.frame)}`),
      recordFacts(
        ["In its map", positionText([poses[at], poses[at + 1], poses[at + 2]])],
        ["In the view", positionText(apply(pose, [poses[at], poses[at + 1], poses[at + 2]]))],
        ["Time", time === undefined || !Number.isFinite(time) ? null : `${time.toFixed(3)} s`],
      ),
    );
  }
  const links = model.linksOf(selection.index);
  if (links.length > 0) {
    const kFirst = 12;
    const sorted = [...links].sort((a, b) => (model.links[b].probability ?? 1) - (model.links[a].probability ?? 1));
    content.push(h("h4", null, "Its links"));
    for (const index of sorted.slice(0, kFirst)) {
      const link = model.links[index];
      const other = link.target === selection.index ? link.source : link.target;
      content.push(
        h(
          "div",
          { class: "record-row" },
          button(model.nodes[other].name, () => choose({ kind: "link", index }), { class: "quiet record-link" }),
          useBadge(link),
        ),
      );
    }
    if (sorted.length > kFirst) {
      content.push(h("p", { class: "muted" }, `and ${sorted.length - kFirst} more, in the table of links`));
    }
  }
  return content;
}

/** Everything the report knows about what is selected. */
export function networkRecord(model: NetworkModel, selection: Selection, stage: number, choose: Choose): HTMLElement[] {
  switch (selection.kind) {
    case "link":
      return linkRecord(model, selection.index, choose);
    case "node":
      return nodeRecord(model, selection, stage, choose);
  }
}

/** The images of all links that have some, those first whose link is least certain; null if none has. */
export function linkGallery(model: NetworkModel, choose: Choose): HTMLElement | null {
  const rank = (index: number) => {
    const { use, probability } = model.links[index];
    return use === "contradicted" ? -1 : hasPose(use) ? (probability ?? 2) : 4 - (probability ?? 0);
  };
  const shown = model.links.flatMap(({ view }, index) => (view ? [index] : [])).sort((a, b) => rank(a) - rank(b));
  if (shown.length === 0) {
    return null;
  }
  const items = shown.map((index) => {
    const pick = () => choose({ kind: "link", index });
    return h(
      "li",
      null,
      h(
        "div",
        { class: "gallery-head" },
        button(model.linkName(index), pick, { class: "quiet record-link" }),
        useBadge(model.links[index]),
        h("span", { class: "muted small" }, probabilityText(model.links[index])),
      ),
      linkImages(model, index),
    );
  });
  return h(
    "div",
    { class: "link-gallery" },
    h("h3", null, "Keyframes of the links"),
    h(
      "p",
      { class: "muted small" },
      "Of each link, the two keyframes that have the most landmarks in common; the least certain links first, rejected ones last.",
    ),
    h("ul", { tabindex: 0, "aria-label": "Keyframes of the links" }, ...items),
  );
}

// SPDX-License-Identifier: BSD-3-Clause
import { interpolateTurbo } from "d3-scale-chromatic";
import type { Frames, LandmarkCloud, LinkUse, NetworkLink, NetworkNode, NetworkSection } from "../document/report";
import { rampColor } from "../scene/coloring";
import { extentOf, type Extent } from "../scene/extent";
import { apply, kIdentity, poseOf, type Affine, type Quaternion } from "../math/pose";
import { giveSeriesColor } from "../series_style";
import type { Palette } from "../theme";

/** What is selected, in every view at once. */
export type Selection =
  | { kind: "node"; index: number; landmark?: number; frame?: number }
  | { kind: "link"; index: number };

export const kUseTexts: Record<LinkUse, string> = {
  used: "used",
  contradicted: "contradicted",
  undecided: "not optimised yet",
  ambiguous: "ambiguous",
  rejected: "rejected",
};

/** Whether a link counts: others are drawn dashed. */
export function counts(link: NetworkLink): boolean {
  return link.use === "used" || link.use === "undecided";
}

/** Whether such a link has a pose of its own. */
export function hasPose(use: LinkUse): boolean {
  return use !== "ambiguous" && use !== "rejected";
}

function hexOf(css: string): string {
  if (css.startsWith("#")) {
    return css;
  }
  const channels = (css.match(/[\d.]+/g) ?? []).slice(0, 3);
  return `#${channels.map((value) => Math.round(Number(value)).toString(16).padStart(2, "0")).join("")}`;
}

/** A link's colour by its probability; of one that nobody judged, grey. */
export function linkColor(link: NetworkLink, colors: Palette): string {
  return link.probability === null ? colors.muted : hexOf(rampColor(link.probability, colors.name));
}

/** What a network is, whatever is shown of it. */
export class NetworkModel {
  readonly section: NetworkSection;
  readonly nodes: NetworkNode[];
  readonly links: NetworkLink[];
  readonly lastStage: number;
  /** Of the shown group, in its frame. */
  extent: Extent = extentOf([], null, null);
  #group = 0;

  constructor(section: NetworkSection) {
    this.section = section;
    this.nodes = section.nodes;
    this.links = section.links;
    this.lastStage = section.stages.length - 1;
    this.nodes.forEach((node, index) => giveSeriesColor(node.name, (colors) => this.nodeColor(index, colors)));
    this.showGroup(this.largestGroup());
  }

  get group(): number {
    return this.#group;
  }

  get lengthUnit(): "m" | "mapunits" {
    return this.section.lengthUnit;
  }

  largestGroup(): number {
    const sizes = this.section.groups.map((_, group) => this.nodes.filter((node) => node.group === group).length);
    return Math.max(0, sizes.indexOf(Math.max(...sizes)));
  }

  isShown(index: number): boolean {
    const { group, cloud } = this.nodes[index];
    return cloud !== null && group === this.#group;
  }

  /** Nodes of the shown group that have landmarks. */
  shownNodes(): number[] {
    return this.nodes.flatMap((_, index) => (this.isShown(index) ? [index] : []));
  }

  /** Of a shown map that has keyframes. */
  frames(index: number): Frames | null {
    const frames = this.isShown(index) ? this.nodes[index].cloud?.frames : null;
    return frames && frames.count > 0 ? frames : null;
  }

  get landmarkCount(): number {
    return this.shownNodes().reduce((sum, index) => sum + (this.nodes[index].cloud?.count ?? 0), 0);
  }

  nodeColor(index: number, colors: Palette): string {
    const count = this.nodes.length;
    if (count <= colors.series.length) {
      return colors.series[index];
    }
    // Neighbours in the list get colours that are far apart.
    const place = (index * 0.618034) % 1;
    return hexOf(interpolateTurbo(colors.name === "light" ? 0.04 + 0.9 * place : 0.1 + 0.82 * place));
  }

  showGroup(group: number): void {
    this.#group = group;
    const placed = this.shownNodes().flatMap((index): [LandmarkCloud, Affine][] => {
      const { cloud } = this.nodes[index];
      return cloud ? [[cloud, this.pose(index, this.lastStage)]] : [];
    });
    this.extent = extentOf(placed, this.section.groups[group]?.up ?? null, placed[0]?.[0].frames ?? null);
  }

  /** group_from_node between two stages, e.g. 1.5; the identity of a map without a pose. */
  pose(index: number, stage: number): Affine {
    const { poses, scales } = this.nodes[index];
    if (!poses) {
      return kIdentity;
    }
    const before = Math.min(this.lastStage, Math.floor(stage));
    const after = Math.min(this.lastStage, before + 1);
    const share = stage - before;
    const mix = (a: number, b: number) => a + share * (b - a);
    const at = (of: number, k: number) => poses[7 * of + k];
    const q = slerp(
      [3, 4, 5, 6].map((k) => at(before, k)),
      [3, 4, 5, 6].map((k) => at(after, k)),
      share,
    );
    const t = [0, 1, 2].map((k) => mix(at(before, k), at(after, k)));
    const scale = scales ? Math.exp(mix(Math.log(scales[before]), Math.log(scales[after]))) : 1;
    return poseOf(t, q, scale);
  }

  centreOf(index: number, stage: number): [number, number, number] {
    return apply(this.pose(index, stage), this.nodes[index].centre);
  }

  linksOf(index: number): number[] {
    return this.links.flatMap(({ target, source }, link) => (target === index || source === index ? [link] : []));
  }

  linkName(index: number): string {
    const { target, source } = this.links[index];
    return `${this.nodes[target].name} ← ${this.nodes[source].name}`;
  }
}

function slerp(a: number[], b: number[], share: number): Quaternion {
  const cosine = a.reduce((sum, value, i) => sum + value * b[i], 0);
  const sign = cosine < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(1, Math.abs(cosine)));
  const [u, v] =
    angle < 1e-6
      ? [1 - share, sign * share]
      : [Math.sin((1 - share) * angle) / Math.sin(angle), (sign * Math.sin(share * angle)) / Math.sin(angle)];
  return a.map((value, i) => u * value + v * b[i]) as unknown as Quaternion;
}

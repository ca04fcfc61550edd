// SPDX-License-Identifier: BSD-3-Clause
import { announce, button, chooser, download, glyph, h, s } from "../dom";
import type { NetworkSection } from "../document/report";
import { canvasToPng } from "../export";
import { formatCount } from "../math/format";
import { paintRamp } from "../scene/legend";
import {
  kHardwareBudget,
  kSoftwareBudget,
  layerChip,
  listenToView,
  moreTools,
  pictureAndHelp,
  pointSizes,
  standardViews,
  toolGroup,
} from "../scene/controls";
import { Drawing } from "../scene/drawing";
import { KeyframeControls, type EnterableMap } from "../scene/keyframe_controls";
import { keyframeText, type Keyframe } from "../scene/keyframes";
import { listenForKeys } from "../scene/keyboard";
import type { OrbitState, StandardView } from "../scene/orbit";
import type { Quality } from "../scene/view3d";
import { isPrinting, kPaperWidth, onPaper } from "../paper";
import { onThemeChange, palette } from "../theme";
import { GraphView, linkLabel } from "./graph_view";
import { MatrixView } from "./matrix_view";
import { counts, NetworkModel, type Selection } from "./network_model";
import { linkGallery, networkRecord } from "./network_record";
import { NetworkStage, type NetworkLayer, type NetworkView } from "./network_stage";

/** Beyond this many, links that do not count are shown only if asked for. */
const kRejectedUpTo = 60;
/** Positions of the slider between two stages, and how long it plays from one to the next. */
const kStepsPerStage = 100;
const kStageMs = 900;

const kLayers: [NetworkLayer, string][] = [
  ["landmarks", "Landmarks"],
  ["cameras", "Cameras"],
  ["links", "Links"],
  ["rejected", "Links not used"],
  ["grid", "Grid"],
];

class NetworkFigure {
  readonly element = h("figure", { class: "card scene network", tabindex: -1 });
  readonly #model: NetworkModel;
  readonly #drawing: Drawing;
  readonly #view: NetworkView;
  readonly #stage: NetworkStage;
  readonly #graph: GraphView;
  readonly #matrix: MatrixView;
  readonly #legend = h("div", { class: "legend" });
  readonly #record = h("div", { class: "record" });
  readonly #slider: HTMLInputElement;
  readonly #play: HTMLButtonElement;
  readonly #keyframes: KeyframeControls<number>;
  readonly #stageName = h("output", { class: "iteration stage-name" });
  #playing = 0;

  constructor(section: NetworkSection, settled: () => void) {
    this.#drawing = new Drawing(this, settled);
    const { service } = this.#drawing;
    const model = (this.#model = new NetworkModel(section));
    const notUsed = model.links.filter((link) => !counts(link)).length;
    this.#view = {
      stage: model.lastStage,
      layers: { landmarks: true, cameras: true, links: true, rejected: notUsed <= kRejectedUpTo, grid: true },
      hidden: new Set(),
      pointSize: model.landmarkCount > 200_000 ? 1.25 : model.landmarkCount > 30_000 ? 1.75 : 2.5,
      selected: null,
      entered: null,
      images: true,
    };
    const budget = service.software ? kSoftwareBudget : kHardwareBudget;
    const choose = (selection: Selection | null) => this.#select(selection);
    this.#stage = new NetworkStage(model, this.#view, palette(), Math.ceil(model.landmarkCount / budget));
    this.#graph = new GraphView(model, choose);
    this.#matrix = new MatrixView(model, choose);
    this.#slider = h("input", {
      type: "range",
      min: 0,
      max: kStepsPerStage * model.lastStage,
      step: 1,
      value: kStepsPerStage * model.lastStage,
      class: "slider",
      "aria-label": "Before and after",
    });
    this.#slider.addEventListener("input", () => {
      this.#pause();
      this.#goTo(Number(this.#slider.value) / kStepsPerStage);
    });
    this.#play = button("Play", () => this.#toggle(), { class: "play", "aria-label": "Play from before to after" });

    this.#keyframes = new KeyframeControls(this.#enterable(), {
      enter: (keyframe) => this.#enter(keyframe),
      enterNearest: (role) => this.#enterNearest(role),
      leave: () => this.#leave(),
      showImages: (shown) => {
        this.#view.images = shown;
        this.redraw();
      },
    });

    const has3d = section.nodes.some((node) => node.cloud && node.group !== null);
    this.element.dataset.scene = section.id;
    if (has3d) {
      this.element.append(this.#toolbar());
      const alert = h(
        "p",
        { class: "notice", role: "alert" },
        "The 3D view needs WebGL 2, which this browser does not offer or has switched off. Graph, matrix and tables work without it.",
      );
      const pane = h(
        "div",
        { class: "pane", role: "group", "aria-label": "Maps in 3D" },
        service.available ? null : alert,
        this.#stage.surface,
      );
      this.element.classList.toggle("no-webgl", !service.available);
      this.element.append(
        h("div", { class: "scene-body" }, h("div", { class: "stage" }, pane), this.#side()),
        ...(model.lastStage > 0 ? [this.#timeline()] : []),
      );
    }
    const plans = h(
      "div",
      { class: "network-plans" },
      this.#plan("Graph", "Top view of the maps.", this.#graph.element),
      this.#plan("Pairs", "Probability of each link, in percent.", this.#matrix.element),
    );
    const gallery = linkGallery(model, choose);
    this.element.append(plans, this.#linkLegend(), ...(gallery ? [gallery] : []));
    if (!has3d) {
      plans.before(h("div", { class: "scene-body is-flat" }, this.#side()));
    }
    this.#listen();
    this.#refreshSide();
    this.#goTo(model.lastStage);
    requestAnimationFrame(() => {
      this.#layOut();
      this.#lookFrom("home");
      this.#drawPlans();
      if (!has3d) {
        this.#drawing.report();
      }
    });
  }

  // Parts

  #side(): HTMLElement {
    return h("aside", { class: "scene-side", "aria-label": "Maps and record" }, this.#record, this.#legend);
  }

  #plan(title: string, text: string, content: HTMLElement): HTMLElement {
    return h("div", { class: "network-plan" }, h("h3", null, title), h("p", { class: "muted small" }, text), content);
  }

  #toolbar(): HTMLElement {
    const model = this.#model;
    const { toggle, more } = moreTools();
    const bar = h("div", { class: "toolbar" }, this.#keyframes.element, toggle, more);
    const has: Record<NetworkLayer, boolean> = {
      landmarks: true,
      cameras: model.nodes.some((node) => node.cloud?.frames),
      links: model.links.some(counts),
      rejected: model.links.some((link) => !counts(link)),
      grid: true,
    };
    const chips = kLayers
      .filter(([name]) => has[name])
      .map(([name, text]) =>
        layerChip(text, name, this.#view.layers, () => {
          this.#stage.moveTo();
          this.redraw();
          if (name === "rejected") {
            this.#drawPlans();
          }
        }),
      );
    more.append(toolGroup("Show", ...chips));
    if (model.section.groups.length > 1) {
      const groups = model.section.groups.map(({ frame }, index) => {
        const size = model.nodes.filter((node) => node.group === index).length;
        return [index, `${frame}, ${size} ${size === 1 ? "map" : "maps"}`] as const;
      });
      const group = chooser("Group of maps", groups, model.group, (index) => {
        this.#showGroup(index);
        this.#refreshSide();
        this.#lookFrom("home");
      });
      more.append(toolGroup("Group", group));
    }
    more.append(
      pointSizes({ min: 0.5, max: 8, step: 0.25 }, this.#view.pointSize, (size) => {
        this.#view.pointSize = size;
        this.redraw();
      }),
      standardViews((name) => this.#lookFrom(name)),
      pictureAndHelp(() => this.#savePicture()),
    );
    return bar;
  }

  #timeline(): HTMLElement {
    const { stages } = this.#model.section;
    const marks = h("div", { class: "stage-marks" });
    stages.forEach((name, index) => {
      const share = index / this.#model.lastStage;
      const mark = button(
        name,
        () => {
          this.#pause();
          this.#goTo(index);
        },
        { class: "quiet", "data-stage": index },
      );
      mark.style.setProperty("--at", String(share));
      marks.append(mark);
    });
    return h(
      "div",
      { class: "timeline network-timeline" },
      h("div", { class: "timeline-controls" }, this.#play, this.#stageName),
      h("div", { class: "timeline-track" }, this.#slider, marks),
    );
  }

  #linkLegend(): HTMLElement {
    const kWidth = 180;
    const ramp = h("canvas", { width: kWidth, height: 10, class: "ramp", "aria-hidden": "true" });
    paintRamp(ramp, palette());
    onThemeChange((colors) => paintRamp(ramp, colors));
    const line = (dash: string | null) => {
      const look = { stroke: "currentColor", "stroke-width": 2.5, "stroke-dasharray": dash };
      return glyph(30, 10, s("line", { x1: 1, x2: 29, y1: 5, y2: 5, ...look }));
    };
    return h(
      "div",
      { class: "network-legend small" },
      h("span", { class: "network-ramp" }, "Probability 0 %", ramp, "100 %"),
      h("span", null, line(null), " used"),
      h("span", null, line("5 4"), " not used: rejected, ambiguous or contradicted"),
      h("span", { class: "muted" }, "Choose a link or a map for its details."),
    );
  }

  // Selection

  #select(selection: Selection | null): void {
    this.#view.selected = selection;
    const group = selection?.kind === "node" ? this.#model.nodes[selection.index].group : null;
    if (group !== null && group !== this.#model.group) {
      this.#showGroup(group);
      this.redraw();
    }
    this.#refreshSide();
    this.#stage.drawOverlay();
    this.#drawPlans();
    if (selection?.kind === "link") {
      announce(linkLabel(this.#model, selection.index));
    } else if (selection?.kind === "node") {
      announce(this.#model.nodes[selection.index].name);
    }
  }

  #showGroup(group: number): void {
    this.#model.showGroup(group);
    this.#view.entered = null;
    this.#keyframes.offer(this.#enterable());
    this.#stage.showGroup();
  }

  #refreshSide(): void {
    const { selected } = this.#view;
    this.element.classList.toggle("has-record", selected !== null);
    if (selected) {
      this.#record.hidden = false;
      this.#record.replaceChildren(
        button("×", () => this.#select(null), { class: "close quiet", "aria-label": "Close the record" }),
        ...networkRecord(this.#model, selected, this.#view.stage, (next) => this.#select(next)),
      );
    } else {
      this.#record.hidden = true;
      this.#record.replaceChildren();
    }
    this.#legend.replaceChildren(this.#mapList());
  }

  #mapList(): HTMLElement {
    const model = this.#model;
    const colors = palette();
    const list = h("ul", { class: "map-list" });
    model.nodes.forEach((node, index) => {
      const color = model.nodeColor(index, colors);
      const look =
        node.group === null ? { fill: "none", "stroke-dasharray": "2.5 2" } : { fill: color, "stroke-dasharray": null };
      const dot = s("circle", { cx: 7, cy: 7, r: 5, stroke: color, "stroke-width": 1.5, ...look });
      const pick = button(node.name, () => this.#select({ kind: "node", index }), { class: "quiet record-link" });
      const selected = this.#view.selected;
      pick.setAttribute("aria-pressed", String(selected?.kind === "node" && selected.index === index));
      const note = node.group === null ? "left out" : formatCount(node.landmarks);
      const shown = h("input", {
        type: "checkbox",
        checked: !this.#view.hidden.has(index),
        "aria-label": `Show ${node.name}`,
        disabled: !model.isShown(index),
      });
      shown.addEventListener("change", () => this.#setShown(index, shown.checked));
      list.append(h("li", null, shown, glyph(14, 14, dot), pick, h("span", { class: "muted" }, note)));
    });
    return h("div", null, h("div", { class: "legend-title" }, "Maps"), list);
  }

  #setShown(index: number, shown: boolean): void {
    if (shown) {
      this.#view.hidden.delete(index);
    } else {
      this.#view.hidden.add(index);
    }
    this.#stage.moveTo();
    this.redraw();
  }

  // Keyframes

  #enterable(): EnterableMap<number>[] {
    return this.#model.shownNodes().flatMap((role) => {
      const frames = this.#model.frames(role);
      return frames ? [{ role, name: this.#model.nodes[role].name, frames }] : [];
    });
  }

  /** Looks through a keyframe's camera; its record says whose it is. */
  #enter(keyframe: Keyframe<number>): void {
    const frames = this.#model.frames(keyframe.role);
    if (!frames) {
      return;
    }
    const first = !this.#view.entered;
    this.#view.entered = keyframe;
    this.#keyframes.show(keyframe);
    this.#select({ kind: "node", index: keyframe.role, frame: keyframe.frame });
    this.#stage.moveTo();
    this.redraw();
    announce(`Keyframe ${keyframeText(frames, keyframe.frame)} of ${this.#model.nodes[keyframe.role].name} entered.`);
    if (first) {
      this.#stage.hint("Drag to leave");
    }
  }

  #enterNearest(node: number | null): void {
    const shown = this.#model.shownNodes().filter((index) => !this.#view.hidden.has(index));
    const nearest = this.#stage.nearestKeyframe(node === null ? shown : [node]);
    if (nearest) {
      this.#enter(nearest);
    }
  }

  #leave(): void {
    if (!this.#view.entered) {
      return;
    }
    this.#view.entered = null;
    this.#keyframes.show(null);
    this.#stage.moveTo();
    this.redraw();
    announce("Keyframe left.");
  }

  // Stages

  #goTo(stage: number): void {
    this.#view.stage = Math.min(this.#model.lastStage, Math.max(0, stage));
    const nearest = Math.round(this.#view.stage);
    const { stages } = this.#model.section;
    const exact = Math.abs(this.#view.stage - nearest) < 0.5 / kStepsPerStage;
    this.#slider.value = String(Math.round(kStepsPerStage * this.#view.stage));
    this.#slider.setAttribute("aria-valuetext", stages[nearest]);
    this.#stageName.textContent = exact ? stages[nearest] : `… ${stages[Math.ceil(this.#view.stage)]}`;
    this.element.querySelectorAll<HTMLElement>("[data-stage]").forEach((mark) => {
      mark.setAttribute("aria-pressed", String(exact && mark.dataset.stage === String(nearest)));
    });
    this.#stage.moveTo();
    this.redraw(true);
    if (this.#view.selected) {
      this.#refreshSide();
    }
  }

  #toggle(): void {
    if (this.#playing) {
      this.#pause();
      return;
    }
    const from = this.#view.stage >= this.#model.lastStage ? 0 : this.#view.stage;
    const start = performance.now();
    this.#play.textContent = "Pause";
    const tick = (now: number) => {
      this.#goTo(from + (now - start) / kStageMs);
      if (this.#view.stage >= this.#model.lastStage) {
        this.#pause();
      } else {
        this.#playing = requestAnimationFrame(tick);
      }
    };
    this.#playing = requestAnimationFrame(tick);
  }

  #pause(): void {
    cancelAnimationFrame(this.#playing);
    this.#playing = 0;
    this.#play.textContent = "Play";
  }

  // Views

  #listen(): void {
    const stage = this.#stage;
    const model = this.#model;
    const turn = (change: (orbit: OrbitState) => void) => {
      if (this.#view.entered) {
        stage.orbit = stage.orbitFromHere();
        this.#leave();
      }
      change(stage.orbit);
      this.redraw(true);
    };
    listenToView(stage, model, {
      turn,
      select: (selection) => {
        if (selection?.kind === "node" && selection.frame !== undefined) {
          this.#enter({ role: selection.index, frame: selection.frame });
        } else {
          this.#select(selection);
        }
      },
      wheelZooms: () => stage.surface.contains(document.activeElement),
    });
    listenForKeys({
      element: this.element,
      step: (by) => {
        this.#pause();
        this.#goTo(this.#view.stage + by / 10);
      },
      jump: (to) => {
        this.#pause();
        this.#goTo(to === "first" ? 0 : model.lastStage);
      },
      playPause: () => this.#toggle(),
      resetView: () => this.#lookFrom("home"),
      toggleRun: (index) => {
        if (model.isShown(index)) {
          this.#setShown(index, this.#view.hidden.has(index));
          this.#refreshSide();
        }
      },
      turn: (right, down) => turn((orbit) => model.extent.orbit.rotate(orbit, right, down)),
      zoom: (factor) => turn((orbit) => model.extent.orbit.zoom(orbit, factor, model.extent.reach)),
      keyframes: this.#keyframes,
      escape: () => {
        if (this.#view.entered) {
          this.#leave();
          return true;
        }
        const had = this.#view.selected !== null;
        if (had) {
          this.#select(null);
        }
        return had;
      },
    });
    onThemeChange((colors) => {
      stage.setColors(colors);
      this.#refreshSide();
      this.#drawPlans();
      this.redraw();
    });
    new ResizeObserver(() => this.#layOut()).observe(stage.surface);
    onPaper(
      () => {
        this.#drawNow();
        this.#drawPlans(kPaperWidth);
      },
      () => this.#drawPlans(),
    );
    let plansWidth = 0;
    new ResizeObserver(() => {
      if (!isPrinting() && this.#graph.element.clientWidth !== plansWidth) {
        plansWidth = this.#graph.element.clientWidth;
        this.#drawPlans();
      }
    }).observe(this.#graph.element);
  }

  #layOut(): void {
    const width = this.#stage.surface.clientWidth;
    const tall = Math.max(300, Math.min(620, innerHeight - 260));
    const height = width < 600 ? Math.max(260, Math.min(420, width * 0.9)) : tall;
    this.element.style.setProperty("--pane-height", `${Math.round(height)}px`);
    this.redraw();
  }

  #lookFrom(name: StandardView): void {
    this.#stage.orbit = this.#stage.standardOrbit(name);
    this.#leave();
    this.redraw();
  }

  /** @param paperWidth of both together; not given: as wide as they are shown */
  #drawPlans(paperWidth?: number): void {
    const colors = palette();
    const part = (share: number) => paperWidth && share * paperWidth;
    this.#graph.draw(colors, this.#view.selected, this.#view.layers.rejected, part(0.5));
    this.#matrix.draw(colors, this.#view.selected, part(0.4));
  }

  // Drawing: only when something changed, cheaply while it changes, in full once it rests

  redraw(moving = false): void {
    this.#drawing.schedule(moving);
  }

  drawnLandmarks(): number {
    return this.#model.landmarkCount;
  }

  drawFrame(quality: Quality): boolean {
    if (this.#stage.surface.clientWidth > 0) {
      this.#stage.draw(this.#drawing.service, quality);
    }
    return false;
  }

  /** For paper, which does not wait. */
  #drawNow(): void {
    if (this.#drawing.service.available && this.#stage.surface.clientWidth > 0) {
      this.#stage.drawForPaper(this.#drawing.service);
    }
  }

  async #savePicture(): Promise<void> {
    const picture = this.#stage.picture(this.#drawing.service, 2);
    download(`${this.#model.section.id}.png`, await canvasToPng(picture));
  }
}

/** Several maps: in 3D, as a graph and as a matrix; `settled` is called once it has drawn its first picture. */
export function networkFigure(section: NetworkSection, settled: () => void): HTMLElement {
  return new NetworkFigure(section, settled).element;
}

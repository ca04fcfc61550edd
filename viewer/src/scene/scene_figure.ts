// SPDX-License-Identifier: BSD-3-Clause
import { announce, button, chooser, download, h, toggleChip } from "../dom";
import type { Run, SceneSection } from "../document/report";
import { canvasToPng } from "../export";
import { formatNumber, labelOf } from "../math/format";
import { offeredPoses, onPoseShown, showPose, type ShownPose } from "../shown_pose";
import { isPrinting, onPaper } from "../paper";
import { onThemeChange, palette } from "../theme";
import type { ColorMode } from "./coloring";
import {
  kHardwareBudget,
  kHoverUpTo,
  kSoftwareBudget,
  layerChip,
  listenToView,
  moreTools,
  pictureAndHelp,
  pointSizes,
  standardViews,
  toolGroup,
} from "./controls";
import { Drawing } from "./drawing";
import { KeyframeControls } from "./keyframe_controls";
import { keyframeText, type Keyframe } from "./keyframes";
import { listenForKeys } from "./keyboard";
import { legendContent } from "./legend";
import type { OrbitState, StandardView } from "./orbit";
import { Pane } from "./pane";
import type { Pick } from "./picking";
import { recordContent } from "./record";
import { SceneModel, type Role } from "./scene_model";
import { Timeline } from "./timeline";
import type { Quality } from "./view3d";
import type { LayerName, ViewState } from "./view_state";

const kStacksBelow = 700;

const kLayers: [LayerName, string][] = [
  ["source", "Source"],
  ["target", "Target"],
  ["ellipses", "Ellipses"],
  ["matches", "Matches"],
  ["cameras", "Cameras"],
  ["truth", "Truth"],
  ["grid", "Grid"],
];

class SceneFigure {
  readonly element = h("figure", { class: "card scene", tabindex: -1 });
  readonly #section: SceneSection;
  readonly #model: SceneModel;
  readonly #drawing: Drawing;
  readonly #panes: Pane[];
  readonly #shown = new Set<Pane>();
  readonly #state: ViewState;
  readonly #timeline: Timeline | null;
  /** Maps whose keyframes can be entered, and what enters them. */
  readonly #roles: Role[];
  readonly #keyframes: KeyframeControls<Role> | null;
  readonly #stage = h("div", { class: "stage" });
  readonly #legend = h("div", { class: "legend" });
  readonly #record = h("div", { class: "record" });
  readonly #chips = new Map<Pane, HTMLButtonElement>();
  readonly #logBox = h("input", { type: "checkbox" });
  #bar: HTMLElement | null = null;
  #linked = true;
  #solo: Pane | null = null;
  /** The view that had the focus last. */
  #focused: Pane | null = null;
  #dirty = new Set<Pane>();

  constructor(section: SceneSection, settled: () => void) {
    this.#section = section;
    this.#drawing = new Drawing(this, settled);
    const { service } = this.#drawing;
    const model = (this.#model = new SceneModel(section));
    this.#state = {
      iteration: model.maxIterations,
      layers: {
        source: true,
        target: true,
        ellipses: true,
        matches: section.runs.length > 0 && model.landmarkCount <= kHoverUpTo,
        cameras: true,
        truth: false,
        grid: true,
      },
      // A map on its own needs no role; its own colours say more.
      color: !model.source && model.target.colors ? { kind: "own" } : { kind: "role" },
      logScale: null,
      scale: null,
      pointSize:
        model.landmarkCount > 200_000 ? 1.5 : model.landmarkCount > 30_000 ? 2.5 : model.landmarkCount > 6000 ? 3 : 3.5,
      selected: null,
      shown: null,
      entered: null,
      images: true,
    };
    const runs: (Run | null)[] = section.runs.length > 0 ? section.runs : [null];
    const budget = service.software ? kSoftwareBudget : kHardwareBudget;
    const stride = Math.ceil((model.landmarkCount * runs.length) / budget);
    this.#panes = runs.map(
      (run) => new Pane(model, run, this.#state, palette(), stride, (pane) => this.#enlarge(pane)),
    );
    this.#panes.forEach((pane) => this.#shown.add(pane));
    this.#timeline =
      model.maxIterations > 0
        ? new Timeline(section.runs, model.maxIterations, model.lengthUnit, (iteration) => this.#goTo(iteration))
        : null;

    this.#roles = (["source", "target"] as const).filter((role) => model.frames(role));
    const enterable = this.#roles.flatMap((role) => {
      const frames = model.frames(role);
      return frames ? [{ role, name: role === "source" ? "Source" : "Target", frames }] : [];
    });
    this.#keyframes =
      enterable.length > 0
        ? new KeyframeControls(enterable, {
            enter: (keyframe) => this.#enter(this.#focusedPane(), keyframe),
            enterNearest: (role) => this.#enterNearest(role ? [role] : this.#roles),
            leave: () => this.#leave(this.#panes),
            showImages: (shown) => {
              this.#state.images = shown;
              this.redraw();
            },
          })
        : null;

    this.element.dataset.scene = section.id;
    this.element.append(
      this.#toolbar(),
      h(
        "div",
        { class: "scene-body" },
        this.#stage,
        h("aside", { class: "scene-side", "aria-label": "Record of a landmark" }, this.#record),
      ),
    );
    if (this.#timeline) {
      this.element.append(this.#timeline.element);
    }
    this.element.append(this.#legend);
    const summary = summaryTable(section);
    if (summary) {
      this.element.append(h("details", { class: "scene-summary" }, h("summary", null, "All results"), summary));
    }
    this.#stage.append(...this.#panes.map((pane) => pane.element));
    this.#panes.forEach((pane) => this.#listen(pane));
    if (!service.available) {
      this.#stage.prepend(
        h(
          "p",
          { class: "notice", role: "alert" },
          "The 3D view needs WebGL 2, which this browser does not offer or has switched off. Numbers, charts and tables work without it.",
        ),
      );
      this.element.classList.add("no-webgl");
    }
    onThemeChange((colors) => {
      this.#panes.forEach((pane) => pane.setColors(colors));
      this.#timeline?.redraw();
      this.#colourChips();
      this.#refreshSide();
      this.redraw();
    });
    onPoseShown(section.id, (shown) => this.#showPose(shown));
    onPaper(() => this.#drawNow());
    new ResizeObserver(() => this.#layOut()).observe(this.#stage);
    document.addEventListener("fullscreenchange", () => {
      if (!document.fullscreenElement && this.#solo && this.element.classList.contains("is-fullscreen")) {
        this.#enlarge(this.#solo);
      }
    });
    listenForKeys({
      element: this.element,
      step: (by) => this.#timeline?.step(by),
      jump: (to) => this.#timeline?.jump(to === "first" ? 0 : model.maxIterations),
      playPause: () => this.#timeline?.toggle(),
      resetView: () => this.#view("home"),
      toggleRun: (index) => this.#panes[index] && section.runs.length > 1 && this.#toggle(this.#panes[index]),
      turn: (right, down) => this.#turn(this.#focusedPane(), (orbit) => model.extent.orbit.rotate(orbit, right, down)),
      zoom: (factor) =>
        this.#turn(this.#focusedPane(), (orbit) => model.extent.orbit.zoom(orbit, factor, model.extent.reach)),
      ...(this.#keyframes && { keyframes: this.#keyframes }),
      escape: () => this.#escape(),
    });
    this.#view("home");
    if (this.#timeline) {
      this.#timeline.jump(model.maxIterations);
    } else {
      this.#goTo(0);
    }
    this.#colourChips();
    this.#refreshSide();
    requestAnimationFrame(() => {
      this.#layOut();
      this.#view("home");
    });
  }

  // Controls

  #toolbar(): HTMLElement {
    const model = this.#model;
    const bar = (this.#bar = h("div", { class: "toolbar" }));
    if (this.#section.runs.length > 1) {
      const chips = this.#panes.map((pane, index) => {
        const chip = button(pane.run?.name ?? "", () => this.#toggle(pane), {
          class: "chip",
          "aria-pressed": "true",
          title: index < 9 ? `Key ${index + 1}` : null,
        });
        if (index < 9) {
          chip.prepend(h("kbd", { "aria-hidden": "true" }, String(index + 1)));
        }
        this.#chips.set(pane, chip);
        return chip;
      });
      bar.append(toolGroup("Strategies", ...chips));
    }
    const poses = offeredPoses(this.#section.id);
    if (poses.length > 1) {
      bar.append(toolGroup("Pose", this.#poseChooser(poses)));
    }
    const has: Record<LayerName, boolean> = {
      source: model.source !== null,
      target: true,
      ellipses: Boolean(model.target.ellipsoids ?? model.source?.ellipsoids),
      matches: model.hasResiduals,
      cameras: Boolean(model.target.frames ?? model.source?.frames),
      truth: model.truth !== null && model.source !== null,
      grid: true,
    };
    const layers = kLayers
      .filter(([name]) => has[name])
      .map(([name, label]) =>
        layerChip(model.source || name !== "target" ? label : "Landmarks", name, this.#state.layers, () => {
          this.#panes.forEach((pane) => pane.moveTo());
          this.#refreshSide();
          this.redraw();
        }),
      );
    const { toggle, more } = moreTools();
    bar.append(...(this.#keyframes ? [this.#keyframes.element] : []), toggle, more);
    more.append(toolGroup("Show", ...layers));
    more.append(
      toolGroup("Colour by", this.#colourChooser(), h("label", { class: "check log-check" }, this.#logBox, "log")),
    );
    more.append(
      pointSizes({ min: 1, max: 10, step: 0.5 }, this.#state.pointSize, (size) => {
        this.#state.pointSize = size;
        this.redraw();
      }),
      standardViews((name) => this.#view(name)),
    );
    if (this.#panes.length > 1) {
      const link = toggleChip(
        "Linked",
        true,
        (linked) => {
          this.#linked = linked;
          const from = this.#focusedPane();
          this.#panes.forEach((pane) => (pane.orbit = this.#linked ? from.orbit : copyOrbit(from.orbit)));
          if (this.#linked && this.#state.entered) {
            if (from.inside) {
              this.#enter(from, this.#state.entered);
            } else {
              this.#leave(this.#panes);
            }
          }
          this.redraw();
        },
        { title: "Turn all views together" },
      );
      more.append(toolGroup("Cameras", link));
    }
    more.append(pictureAndHelp(() => this.#savePicture()));
    return bar;
  }

  #colourChooser(): HTMLSelectElement {
    const model = this.#model;
    // By their names in the list.
    const choices = new Map<string, [label: string, mode: ColorMode]>();
    choices.set("role", [model.source ? "Source and target" : "One colour", { kind: "role" }]);
    if (model.hasResiduals) {
      choices.set("residual", ["Residual", { kind: "residual" }]);
    }
    for (const { name, label } of model.columns) {
      choices.set(`column:${name}`, [label, { kind: "column", name }]);
    }
    if (model.target.colors ?? model.source?.colors) {
      choices.set("own", ["Own colours", { kind: "own" }]);
    }
    const apply = () => {
      this.#state.scale = model.colorScale(this.#state.color, this.#state.logScale);
      this.#logBox.checked = this.#state.scale?.log ?? false;
      this.element.classList.toggle("has-scale", this.#state.scale !== null);
      this.#panes.forEach((pane) => pane.recolour());
      this.#refreshSide();
      this.redraw();
    };
    this.#logBox.addEventListener("change", () => {
      this.#state.logScale = this.#logBox.checked;
      apply();
    });
    const options = [...choices].map(([value, [label]]) => [value, label] as const);
    return chooser("Colour by", options, this.#state.color.kind, (value) => {
      this.#state.color = choices.get(value)?.[1] ?? { kind: "role" };
      this.#state.logScale = null;
      apply();
    });
  }

  /** What the alignment came to, or a candidate that it was held against. */
  #poseChooser(poses: readonly ShownPose[]): HTMLSelectElement {
    const several = this.#section.runs.length > 1;
    const names = poses.map(({ run, label }) => (several ? `${run}: ${label}` : label));
    const select = chooser(
      "Pose shown",
      ["As aligned", ...names].map((name, index) => [index, name]),
      0,
      (index) => showPose(this.#section.id, index === 0 ? null : poses[index - 1]),
    );
    onPoseShown(this.#section.id, (shown) => {
      select.selectedIndex = shown ? 1 + poses.indexOf(shown) : 0;
    });
    return select;
  }

  #showPose(shown: ShownPose | null): void {
    this.#state.shown = shown;
    this.#panes.forEach((pane) => pane.moveTo());
    this.#refreshRecord();
    this.redraw();
    announce(shown ? `${shown.label} shown.` : "The alignment’s own pose shown.");
  }

  #colourChips(): void {
    for (const [pane, chip] of this.#chips) {
      chip.setAttribute("aria-pressed", String(this.#shown.has(pane)));
    }
  }

  // Iterations and panes

  #goTo(iteration: number): void {
    this.#state.iteration = iteration;
    if (this.#state.shown) {
      showPose(this.#section.id, null);
    }
    for (const pane of this.#shown) {
      pane.moveTo();
    }
    this.#refreshRecord();
    this.redraw(true);
  }

  #toggle(pane: Pane): void {
    if (this.#shown.has(pane)) {
      if (this.#shown.size === 1) {
        announce("At least one strategy is always shown.");
        return;
      }
      this.#shown.delete(pane);
    } else {
      this.#shown.add(pane);
      pane.moveTo();
    }
    this.#colourChips();
    this.#timeline?.showRuns((run) => this.#panes.some((other) => other.run === run && this.#shown.has(other)));
    this.#refreshRecord();
    this.#layOut();
    announce(`${pane.run?.name ?? ""} ${this.#shown.has(pane) ? "shown" : "hidden"}.`);
  }

  #visiblePanes(): Pane[] {
    return this.#panes.filter((pane) => (this.#solo ? pane === this.#solo : this.#shown.has(pane)));
  }

  #layOut(): void {
    if (isPrinting()) {
      return;
    }
    const visible = this.#visiblePanes();
    const width = this.#stage.clientWidth;
    const wanted = visible.length <= 1 || width < kStacksBelow ? 1 : visible.length === 3 || visible.length > 4 ? 3 : 2;
    const columns = width < 960 ? Math.min(wanted, 2) : wanted;
    const rows = Math.ceil(visible.length / columns);
    // The whole figure fits the window below the page's bar: nothing has to cover anything.
    const parts = [this.#bar, this.#timeline?.element, this.#legend];
    const around = parts.reduce((sum, part) => sum + (part?.offsetHeight ?? 0), this.#solo ? 8 : 72);
    const tall = Math.min(this.#solo ? Infinity : 1000, innerHeight) - around;
    const first = visible[0]?.element;
    const frame = first && !first.hidden ? first.offsetHeight - visible[0].surface.offsetHeight : 0;
    const height =
      width < kStacksBelow && !this.#solo
        ? Math.max(240, Math.min(420, width * 0.8))
        : Math.max(180, tall / rows - (frame || 96));
    this.#stage.style.setProperty("--columns", String(columns));
    this.#stage.style.setProperty("--pane-height", `${Math.round(height)}px`);
    for (const pane of this.#panes) {
      pane.element.hidden = !visible.includes(pane);
    }
    this.redraw();
  }

  #enlarge(pane: Pane): void {
    const leaving = this.#solo === pane;
    this.#solo = leaving ? null : pane;
    this.element.classList.toggle("is-solo", !leaving);
    document.documentElement.classList.toggle("has-solo", !leaving);
    pane.maximise.setAttribute("aria-pressed", String(!leaving));
    if (leaving) {
      this.element.classList.remove("is-fullscreen");
      if (document.fullscreenElement) {
        void document.exitFullscreen();
      }
    } else {
      // Where the browser refuses full screen, the view still fills its window.
      this.element
        .requestFullscreen?.()
        .then(() => this.element.classList.add("is-fullscreen"))
        .catch(() => {});
    }
    requestAnimationFrame(() => this.#layOut());
  }

  #escape(): boolean {
    if (this.#state.entered) {
      this.#leave(this.#panes);
      return true;
    }
    if (this.#solo) {
      this.#enlarge(this.#solo);
      return true;
    }
    if (this.#state.selected) {
      this.#select(null);
      return true;
    }
    return false;
  }

  // Cameras

  #focusedPane(): Pane {
    const visible = this.#visiblePanes();
    const focused = visible.find((pane) => pane.element.contains(document.activeElement));
    return focused ?? visible.find((pane) => pane === this.#focused) ?? visible[0] ?? this.#panes[0];
  }

  /** Looks through a keyframe's camera, in all views that turn together. */
  #enter(pane: Pane, keyframe: Keyframe): void {
    const frames = this.#model.frames(keyframe.role);
    if (!frames) {
      return;
    }
    const first = !this.#state.entered;
    this.#state.entered = keyframe;
    this.#panes.forEach((other) => (other.inside = this.#linked || other === pane));
    this.#keyframes?.show(keyframe);
    this.redraw();
    announce(`Keyframe ${keyframeText(frames, keyframe.frame)} entered.`);
    if (first) {
      pane.hint("Drag to leave");
    }
  }

  #enterNearest(roles: readonly Role[]): void {
    const pane = this.#focusedPane();
    const nearest = pane.nearestKeyframe(roles);
    if (nearest) {
      this.#enter(pane, nearest);
    }
  }

  #leave(panes: readonly Pane[]): void {
    panes.forEach((pane) => (pane.inside = false));
    if (this.#state.entered && !this.#panes.some((pane) => pane.inside)) {
      this.#state.entered = null;
      this.#keyframes?.show(null);
      announce("Keyframe left.");
    }
    this.redraw();
  }

  #view(name: StandardView): void {
    const pane = this.#focusedPane();
    const orbit = pane.standardOrbit(name);
    const turned = this.#linked || name === "home" ? this.#panes : [pane];
    for (const other of turned) {
      other.orbit = this.#linked ? orbit : copyOrbit(orbit);
    }
    this.#leave(turned);
  }

  #turn(pane: Pane, change: (orbit: OrbitState) => void): void {
    if (pane.inside) {
      const turned = this.#linked ? this.#panes : [pane];
      const orbit = pane.orbitFromHere();
      turned.forEach((other) => (other.orbit = orbit));
      this.#leave(turned);
    }
    change(pane.orbit);
    if (this.#linked) {
      this.redraw(true);
    } else {
      this.#dirty.add(pane);
      this.#drawing.schedule(true);
    }
  }

  #listen(pane: Pane): void {
    pane.overlay.addEventListener("focus", () => (this.#focused = pane));
    listenToView(pane, this.#model, {
      turn: (change) => this.#turn(pane, change),
      select: (pick) => {
        if (pick && "frame" in pick) {
          this.#enter(pane, pick);
        } else {
          this.#select(pick);
        }
      },
      wheelZooms: () => this.#solo !== null || this.#stage.contains(document.activeElement),
    });
  }

  // Records

  #select(pick: Pick | null): void {
    this.#state.selected = pick;
    this.#refreshRecord();
    this.#visiblePanes().forEach((pane) => pane.drawOverlay());
  }

  #refreshRecord(): void {
    const { selected } = this.#state;
    this.element.classList.toggle("has-record", selected !== null);
    if (!selected) {
      this.#record.replaceChildren();
      return;
    }
    this.#record.replaceChildren(
      button("×", () => this.#select(null), { class: "close quiet", "aria-label": "Close the record" }),
      ...recordContent(this.#model, this.#visiblePanes(), selected),
    );
  }

  #refreshSide(): void {
    const stride = Math.max(...this.#panes.map((pane) => pane.matchStride));
    this.#legend.replaceChildren(
      h(
        "p",
        { class: "muted small" },
        `Click or tap a landmark${this.#keyframes ? " or a camera" : " for its record"}.`,
      ),
      ...legendContent(this.#model, this.#state, palette(), stride > 1 ? `one in ${stride} drawn` : null),
    );
  }

  // Drawing: only when something changed, cheaply while it changes, in full once it rests

  redraw(moving = false): void {
    this.#visiblePanes().forEach((pane) => this.#dirty.add(pane));
    this.#drawing.schedule(moving);
  }

  /** For paper, which does not wait: every pane in full, seen or not. */
  #drawNow(): void {
    this.element.querySelector<HTMLDetailsElement>(".scene-summary")?.setAttribute("open", "");
    if (this.#drawing.service.available) {
      for (const pane of this.#visiblePanes()) {
        pane.drawForPaper(this.#drawing.service);
      }
    }
  }

  drawnLandmarks(): number {
    return this.#model.landmarkCount * this.#visiblePanes().length;
  }

  drawFrame(quality: Quality): boolean {
    const { service } = this.#drawing;
    const oneAtATime = !quality.preview && this.drawnLandmarks() > kSoftwareBudget && service.software;
    for (const pane of this.#visiblePanes()) {
      if (this.#dirty.delete(pane)) {
        if (pane.surface.clientWidth > 0) {
          pane.draw(service, quality);
        }
        if (oneAtATime) {
          break;
        }
      }
    }
    return this.#visiblePanes().some((pane) => this.#dirty.has(pane));
  }

  async #savePicture(): Promise<void> {
    const colors = palette();
    const kGap = 12;
    const kCaption = 44;
    const ratio = 2;
    const panes = this.#visiblePanes();
    const columns = Number(this.#stage.style.getPropertyValue("--columns")) || 1;
    const width = panes[0].surface.clientWidth;
    const height = panes[0].surface.clientHeight;
    const canvas = document.createElement("canvas");
    const rows = Math.ceil(panes.length / columns);
    canvas.width = ratio * (columns * (width + kGap) + kGap);
    canvas.height = ratio * (rows * (height + kCaption + kGap) + kGap);
    const context = canvas.getContext("2d");
    if (!context) {
      return;
    }
    context.fillStyle = colors.background;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.scale(ratio, ratio);
    panes.forEach((pane, index) => {
      const x = kGap + (index % columns) * (width + kGap);
      const y = kGap + Math.floor(index / columns) * (height + kCaption + kGap);
      context.drawImage(pane.picture(this.#drawing.service, ratio), x, y + kCaption, width, height);
      context.fillStyle = colors.ink;
      context.font = "600 14px system-ui, sans-serif";
      context.fillText(pane.run?.name ?? this.#model.target.name, x + 4, y + 16);
      context.fillStyle = colors.muted;
      context.font = "12px system-ui, sans-serif";
      context.fillText(pane.caption, x + 4, y + 34);
    });
    download(`${this.#section.id}-${this.#state.iteration}.png`, await canvasToPng(canvas));
  }
}

function copyOrbit(orbit: OrbitState): OrbitState {
  return { ...orbit, target: [...orbit.target] };
}

/** What the alignments' results say: a row for each value that any of them has, a column for each strategy. */
function summaryTable(section: SceneSection): HTMLElement | null {
  const summaries = section.runs.map((run) => new Map(run.summary));
  // The reason of a verdict is in the answer.
  const keys = [...new Set(summaries.flatMap((summary) => [...summary.keys()]))].filter(
    (key) => key !== "reason" && summaries.some((summary) => (summary.get(key) ?? null) !== null),
  );
  if (keys.length === 0) {
    return null;
  }
  const text = (value: string | number | null) =>
    value === null ? "–" : typeof value === "number" ? formatNumber(value, 5) : value;
  return h(
    "table",
    { class: "summary-table" },
    h("thead", null, h("tr", null, h("td", null), ...section.runs.map((run) => h("th", { scope: "col" }, run.name)))),
    h(
      "tbody",
      null,
      ...keys.map((key) => {
        const { label, unit } = labelOf(key);
        return h(
          "tr",
          null,
          h("th", { scope: "row" }, label, unit && h("span", { class: "unit" }, ` ${unit}`)),
          ...summaries.map((summary, i) =>
            h("td", { "data-label": section.runs[i].name }, text(summary.get(key) ?? null)),
          ),
        );
      }),
    ),
  );
}

/** The 3D view of a section; `settled` is called once it has drawn its first picture. */
export function sceneFigure(section: SceneSection, settled: () => void): HTMLElement {
  return new SceneFigure(section, settled).element;
}

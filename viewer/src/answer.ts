// SPDX-License-Identifier: BSD-3-Clause
// What an alignment came to: the verdict, the pose and how sure it is, and the candidates it was held against.
import { drawCourse } from "./answer_course";
import type { AlignmentAnswer, AnswerCandidate, AnswerSection, OpenDirection, SimilarityPose } from "./document/report";
import { button, copyButton, h, kSigns, s, type Status } from "./dom";
import { formatCount, formatLength, formatNumber, formatProbability, formatShare } from "./math/format";
import { differenceOf, rollPitchYaw, similarityAt, type Affine } from "./math/pose";
import { onPaper } from "./paper";
import { offeredPoses, offerPoses, onPoseShown, showPose, type ShownPose } from "./shown_pose";

/** Candidates beyond these are shown on demand. */
const kFirstCandidates = 8;

const kVerdicts: Record<string, { kind: Status; word: string; meaning: string }> = {
  aligned: { kind: "good", word: "Aligned", meaning: "The pose can be used." },
  ambiguous: { kind: "doubt", word: "Ambiguous", meaning: "The evidence suffices for a match, but not for one pose." },
  rejected: { kind: "bad", word: "Rejected", meaning: "No pose can be trusted." },
};

export function verdictOf(alignment: AlignmentAnswer): { kind: Status; word: string; meaning: string } {
  if (alignment.judged && Object.prototype.hasOwnProperty.call(kVerdicts, alignment.status)) {
    return kVerdicts[alignment.status];
  }
  return alignment.status === "failed" || alignment.estimate === null
    ? { kind: "bad", word: "Failed", meaning: "There is no pose." }
    : { kind: "plain", word: "Not judged", meaning: `The method ${alignment.status}; its pose was not checked.` };
}

export function transformOf({ pose, scale }: SimilarityPose): Affine {
  return similarityAt(pose, [scale], 0);
}

/** The 4x4 matrix, a row a line, with all digits: what `--truth` and other programs read. */
export function matrixText(pose: SimilarityPose): string {
  const m = transformOf(pose);
  const row = (i: number) => [0, 1, 2, 3].map((j) => m[4 * i + j]).join(" ");
  return [row(0), row(1), row(2), "0 0 0 1"].join("\n");
}

const kAxes = ["x", "y", "z"];

/** "moving along y", "turning about (0.00 0.71 0.71)": in the target's frame. */
export function directionText({ translation, rotation, logScale }: OpenDirection): string {
  const along = (what: string, v: readonly number[]) => {
    const length = Math.hypot(...v);
    if (length < 1e-6) {
      return null;
    }
    const axis = v.findIndex((value) => Math.abs(value) > 0.995 * length);
    return `${what} ${axis >= 0 ? kAxes[axis] : `(${v.map((value) => (value / length).toFixed(2)).join(" ")})`}`;
  };
  const parts = [
    along("moving along", translation),
    along("turning about", rotation),
    Math.abs(logScale) > 1e-6 ? "scaling" : null,
  ].filter((part) => part !== null);
  return parts.join(", with ");
}

/** A bar from zero; SVG, so that it prints where backgrounds do not. */
function bar(share: number, className = ""): SVGElement {
  const width = Number.isFinite(share) ? Math.max(0, Math.min(1, share)) * 100 : 0;
  return s(
    "svg",
    { class: `bar-mark ${className}`, viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" },
    s("rect", { class: "bar-track", x: 0, y: 0, width: 100, height: 10 }),
    s("rect", { class: "bar-fill", x: 0, y: 0, width, height: 10 }),
  );
}

class AnswerFigure {
  readonly element = h("div", { class: "card answer" });
  readonly #section: AnswerSection;
  #alignment: AlignmentAnswer;
  /** -1: the alignment's own pose. */
  #candidate = -1;
  #all = false;
  readonly #body = h("div", { class: "answer-body" });

  constructor(section: AnswerSection) {
    this.#section = section;
    // Of several, first the one whose pose was checked.
    this.#alignment = section.alignments.find(({ judged }) => judged) ?? section.alignments[0];
    if (section.scene) {
      for (const alignment of section.alignments) {
        offerPoses(
          section.scene,
          alignment.candidates.map((candidate, i) => shown(alignment, candidate, i)),
        );
      }
      onPoseShown(section.scene, (pose) => this.#follow(pose));
    }
    if (section.alignments.length > 1) {
      this.element.append(this.#chooser());
    }
    this.element.append(this.#body);
    this.#fill();
    onPaper(() => {
      this.#all = true;
      this.#fill();
    });
  }

  /** One button an alignment, each with its verdict. */
  #chooser(): HTMLElement {
    const buttons = this.#section.alignments.map((alignment) => {
      const verdict = verdictOf(alignment);
      const chip = button(
        alignment.name,
        () => {
          this.#alignment = alignment;
          this.#candidate = -1;
          buttons.forEach((other) => other.setAttribute("aria-pressed", String(other === chip)));
          this.#fill();
        },
        { class: "choice", "aria-pressed": String(alignment === this.#alignment) },
      );
      chip.append(h("span", { class: "choice-note", "data-status": verdict.kind }, ` ${verdict.word}`));
      return chip;
    });
    return h("div", { class: "answer-choices", role: "group", "aria-label": "Strategies" }, ...buttons);
  }

  #follow(pose: ShownPose | null): void {
    const owner = pose && this.#section.alignments.find(({ name }) => name === pose.run);
    if (owner) {
      this.#alignment = owner;
    }
    this.#candidate = owner
      ? owner.candidates.findIndex((candidate, i) => shown(owner, candidate, i).label === pose?.label)
      : -1;
    const focused = document.activeElement instanceof HTMLElement && document.activeElement.dataset.candidate;
    this.#fill();
    if (focused) {
      this.#body.querySelector<HTMLElement>(`[data-candidate="${focused}"]`)?.focus();
    }
  }

  #choose(index: number): void {
    const candidate = this.#alignment.candidates[index];
    const { scene } = this.#section;
    // The alignment's own pose and that of its candidate are one; the slider goes on moving it.
    const own = isEstimate(this.#alignment, candidate);
    if (scene) {
      showPose(scene, own ? null : offered(scene, this.#alignment, candidate, index));
    }
    this.#candidate = own ? -1 : index;
    this.#fill();
    this.#body.querySelector<HTMLElement>(`[data-candidate="${index}"]`)?.focus();
  }

  #fill(): void {
    const { candidates, open, deviations } = this.#alignment;
    const course = candidates.length > 1 ? drawCourse(this.#alignment) : null;
    this.#body.replaceChildren(
      this.#verdict(),
      h(
        "div",
        { class: "answer-parts" },
        this.#pose(),
        deviations || open.length > 0 || this.#alignment.estimate ? this.#uncertainty() : "",
      ),
      ...(candidates.length > 0 ? [this.#candidates(course)] : []),
    );
  }

  #verdict(): HTMLElement {
    const { probability, reason, judged } = this.#alignment;
    const { kind, word, meaning } = verdictOf(this.#alignment);
    return h(
      "div",
      { class: "verdict", "data-status": kind },
      h(
        "div",
        { class: "verdict-head" },
        h(
          "p",
          { class: "verdict-word" },
          h("span", { class: "verdict-sign", "aria-hidden": "true" }, kSigns[kind]),
          h("strong", null, word),
        ),
        judged &&
          probability !== null &&
          h(
            "p",
            { class: "verdict-probability" },
            h("strong", null, formatProbability(probability)),
            h("span", null, " probability that the pose is right"),
            bar(probability),
          ),
      ),
      h("p", { class: "verdict-meaning" }, meaning),
      reason && h("p", { class: "verdict-reason" }, sentence(reason)),
    );
  }

  #pose(): HTMLElement {
    const { candidates, estimate, judged, status } = this.#alignment;
    const candidate = this.#candidate >= 0 ? candidates[this.#candidate] : null;
    const pose = candidate ?? estimate;
    if (!pose) {
      return h(
        "section",
        { class: "answer-part" },
        h("h3", null, "Pose"),
        h("p", { class: "muted" }, "There is none."),
      );
    }
    const trusted = !candidate && judged && status === "aligned";
    const title = candidate
      ? `Pose of candidate ${this.#candidate + 1}`
      : trusted || !judged
        ? "Pose"
        : "Best pose found, not trusted";
    const m = transformOf(pose);
    const matrix = h(
      "table",
      { class: "matrix", "aria-label": "target_from_source, row by row" },
      h(
        "tbody",
        null,
        ...[0, 1, 2, 3].map((i) =>
          h(
            "tr",
            null,
            ...[0, 1, 2, 3].map((j) => h("td", null, i < 3 ? fixed(m[4 * i + j], 6) : j === 3 ? "1" : "0")),
          ),
        ),
      ),
    );
    const [t, q] = [pose.pose.slice(0, 3), pose.pose.slice(3)];
    const angles = rollPitchYaw(m);
    const unit = this.#section.lengthUnit === "m" ? "m" : "map units";
    const line = (name: string, value: string, key: string) =>
      h("div", { "data-pose": key }, h("dt", null, name), h("dd", null, h("code", null, value)));
    const list = (values: readonly number[], digits: number) => values.map((value) => fixed(value, digits)).join("  ");
    const lines = h(
      "dl",
      { class: "pose-lines" },
      line(`Translation x y z (${unit})`, list(t, 6), "translation"),
      line("Quaternion qw qx qy qz", list(q, 9), "quaternion"),
      line("Roll pitch yaw (°)", list(angles, 4), "angles"),
      ...(pose.scale === 1 ? [] : [line("Scale of the source", formatNumber(pose.scale, 7), "scale")]),
    );
    return h(
      "section",
      { class: "answer-part answer-pose", "aria-label": title },
      h(
        "div",
        { class: "part-head" },
        h("h3", null, title),
        h(
          "div",
          { class: "copies" },
          copyButton(matrix, { caption: "Copy matrix", text: () => matrixText(pose) }),
          copyButton(lines, { caption: "Copy translation and quaternion", text: () => pose.pose.join(" ") }),
        ),
      ),
      h("p", { class: "muted small" }, "target_from_source, which moves the source onto the target"),
      matrix,
      lines,
    );
  }

  #uncertainty(): HTMLElement {
    const { deviations, open } = this.#alignment;
    const { lengthUnit } = this.#section;
    const title = this.#candidate >= 0 ? "Standard deviations of the estimate" : "Standard deviations";
    const part = h("section", { class: "answer-part answer-uncertainty", "aria-label": title }, h("h3", null, title));
    if (deviations) {
      const group = (title: string, values: readonly number[], text: (value: number) => string, role: string) => {
        const largest = Math.max(...values);
        return h(
          "div",
          { class: `deviations ${role}`, role: "group", "aria-label": title },
          h("h4", null, title),
          h(
            "dl",
            null,
            ...values.map((value, axis) =>
              h(
                "div",
                { "data-deviation": `${role}-${kAxes[axis]}` },
                h("dt", null, kAxes[axis]),
                h("dd", null, bar(largest > 0 ? value / largest : 0), h("span", null, text(value))),
              ),
            ),
          ),
        );
      };
      part.append(
        h("p", { class: "muted small" }, "Of the source’s centre, by axis of the target’s frame, from zero"),
        group("Along the axis", deviations.translation, (value) => formatLength(value, lengthUnit), "translation"),
        group("About the axis", deviations.rotationDeg, (value) => `${formatNumber(value, 3)}°`, "rotation"),
      );
      if (deviations.logScale !== null) {
        part.append(h("p", null, `Scale: ${formatNumber(100 * deviations.logScale, 3)} %`));
      }
    } else {
      part.append(
        h(
          "p",
          { class: "muted" },
          open.length > 0
            ? "None: the matches do not determine the pose."
            : "Unknown: the method does not estimate them.",
        ),
      );
    }
    if (open.length > 0) {
      part.append(
        h("h4", null, open.length === 1 ? "One open direction" : `${open.length} open directions`),
        h("p", { class: "muted small" }, "The matches do not determine:"),
        h("ul", { class: "open-directions" }, ...open.map((direction) => h("li", null, directionText(direction)))),
      );
    } else if (deviations) {
      part.append(h("p", { class: "muted small" }, "No direction of the pose is open."));
    }
    return part;
  }

  #candidates(course: SVGElement | null): HTMLElement {
    const { candidates, radius } = this.#alignment;
    const { lengthUnit, scene } = this.#section;
    const count = this.#all ? candidates.length : Math.min(kFirstCandidates, candidates.length);
    const chosen =
      this.#candidate >= 0 ? this.#candidate : candidates.findIndex((one) => isEstimate(this.#alignment, one));
    const likeliest = Math.max(...candidates.map(({ probability }) => probability));
    const hasSight = candidates.some(({ contradicted }) => contradicted !== null);
    const name = `candidate-${this.#section.id}`;
    const rows = candidates.slice(0, count).map((candidate, i) => {
      const probability = formatProbability(candidate.probability);
      const radio = h("input", {
        type: "radio",
        name,
        value: i,
        checked: i === chosen,
        "data-candidate": i,
        "aria-label": `Candidate ${i + 1}, ${probability}`,
      });
      radio.addEventListener("change", () => this.#choose(i));
      const contradicted = candidate.contradicted === null ? "–" : formatShare(candidate.contradicted);
      const away = this.#alignment.estimate
        ? differenceOf(transformOf(candidate), transformOf(this.#alignment.estimate))
        : null;
      const row = h(
        "tr",
        { "aria-current": i === chosen ? "true" : null },
        h("th", { scope: "row" }, h("label", null, radio, String(i + 1))),
        cell("Probability", h("span", { class: "with-bar" }, bar(candidate.probability), probability)),
        cell("Matched", `${formatCount(candidate.matches)} · ${formatShare(candidate.share)}`),
        hasSight && cell("Sight lines contradicted", contradicted),
        cell("Evidence", formatNumber(totalEvidence(candidate), 3), evidenceText(candidate)),
        cell(
          "From the estimate",
          away === null
            ? "–"
            : isEstimate(this.#alignment, candidate)
              ? "the same"
              : `${formatLength(away.translation, lengthUnit)}, ${formatNumber(away.rotationDeg, 3)}°`,
        ),
      );
      row.addEventListener("click", (event) => {
        if (!(event.target instanceof HTMLInputElement) && i !== chosen) {
          this.#choose(i);
        }
      });
      return row;
    });
    const none = 1 - candidates.reduce((sum, { probability }) => sum + probability, 0);
    const heads = [
      "Candidate",
      "Probability",
      "Matched",
      ...(hasSight ? ["Sight lines contradicted"] : []),
      "Evidence",
      "From the estimate",
    ];
    return h(
      "section",
      { class: "answer-part answer-candidates", "aria-label": "Candidates" },
      h(
        "div",
        { class: "part-head" },
        h("h3", null, candidates.length === 1 ? "The only candidate" : `${candidates.length} candidates`),
        scene && h("a", { href: `#section-${scene}`, class: "small" }, "See the chosen one in 3D"),
      ),
      h(
        "p",
        { class: "muted small" },
        candidates.length > 1 && h("span", { class: "how-to" }, "Choose one to see its pose here and in 3D. "),
        "Matched: landmarks with a counterpart",
        radius === null ? "" : ` within ${formatLength(radius, lengthUnit)}`,
        ", and their share of the smaller map. Evidence: log-likelihood ratio against a wrong pose.",
      ),
      h(
        "div",
        { class: course ? "candidates has-course" : "candidates" },
        h(
          "div",
          null,
          h(
            "table",
            { class: "candidate-table" },
            h("thead", null, h("tr", null, ...heads.map((head) => h("th", { scope: "col" }, head)))),
            h("tbody", null, ...rows),
          ),
          likeliest > 0 || none > 0
            ? h(
                "p",
                { class: "muted small" },
                `${candidates.length > 1 ? "None of them is right" : "It is not right"}: ${formatProbability(Math.max(0, none))}`,
              )
            : null,
          candidates.length > count
            ? button(`Show all ${candidates.length}`, () => {
                this.#all = true;
                this.#fill();
              })
            : null,
        ),
        course &&
          h(
            "figure",
            { class: "course" },
            h("figcaption", { class: "muted small" }, "From proposed to judged"),
            course,
          ),
      ),
    );
  }
}

function cell(label: string, content: Node | string, title: string | null = null): HTMLElement {
  return h("td", { "data-label": label, title }, content);
}

function sentence(text: string): string {
  const first = text.charAt(0).toUpperCase() + text.slice(1);
  return /[.!?]$/.test(first) ? first : `${first}.`;
}

/** Fixed decimals with a plain minus sign: numbers that people copy. */
function fixed(value: number, digits: number): string {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text;
}

export function totalEvidence(candidate: AnswerCandidate): number {
  return candidate.evidence.reduce((sum, { value }) => sum + value, 0);
}

function evidenceText(candidate: AnswerCandidate): string {
  return candidate.evidence.map(({ name, value }) => `${name}: ${formatNumber(value, 3)}`).join("\n");
}

function isEstimate(alignment: AlignmentAnswer, candidate: AnswerCandidate): boolean {
  const { estimate } = alignment;
  return estimate !== null && estimate.pose.every((value, i) => Math.abs(value - candidate.pose[i]) < 1e-6);
}

function shown(alignment: AlignmentAnswer, candidate: AnswerCandidate, index: number): ShownPose {
  return { run: alignment.name, label: `Candidate ${index + 1}`, pose: transformOf(candidate) };
}

/** The very pose that the scene was offered, so that its chooser knows it. */
function offered(scene: string, alignment: AlignmentAnswer, candidate: AnswerCandidate, index: number): ShownPose {
  const wanted = shown(alignment, candidate, index);
  return offeredPoses(scene).find(({ run, label }) => run === wanted.run && label === wanted.label) ?? wanted;
}

export function answerFigure(section: AnswerSection): HTMLElement {
  return section.alignments.length > 0
    ? new AnswerFigure(section).element
    : h("p", { class: "muted" }, "No maps were aligned.");
}

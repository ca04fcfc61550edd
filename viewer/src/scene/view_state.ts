// SPDX-License-Identifier: BSD-3-Clause
import type { ColorMode, ColorScale } from "./coloring";
import type { Keyframe } from "./keyframes";
import type { Pick } from "./picking";
import type { ShownPose } from "../shown_pose";

export type LayerName = "source" | "target" | "ellipses" | "matches" | "cameras" | "truth" | "grid";

/** What the reader has chosen for a scene; every pane shows it. */
export interface ViewState {
  iteration: number;
  layers: Record<LayerName, boolean>;
  color: ColorMode;
  /** Logarithmic colour scale; null: as suits the values. */
  logScale: boolean | null;
  scale: ColorScale | null;
  pointSize: number;
  selected: Pick | null;
  /** A pose in place of that of a run's iteration. */
  shown: ShownPose | null;
  /** The keyframe that some panes look through. */
  entered: Keyframe | null;
  /** Whether to show what it saw. */
  images: boolean;
}

// SPDX-License-Identifier: BSD-3-Clause
// Which pose a scene shows in place of its alignment's own: an answer and its 3D view change it together.
import type { Affine } from "./math/pose";

export interface ShownPose {
  /** Name of the run whose source map it moves. */
  run: string;
  label: string;
  pose: Affine;
}

type Listener = (shown: ShownPose | null) => void;

interface Channel {
  offered: ShownPose[];
  shown: ShownPose | null;
  listeners: Set<Listener>;
}

const channels = new Map<string, Channel>();

function channelOf(scene: string): Channel {
  let channel = channels.get(scene);
  if (!channel) {
    channel = { offered: [], shown: null, listeners: new Set() };
    channels.set(scene, channel);
  }
  return channel;
}

/** Poses that readers of the scene may choose. To be called before the scene is built. */
export function offerPoses(scene: string, poses: ShownPose[]): void {
  channelOf(scene).offered.push(...poses);
}

export function offeredPoses(scene: string): readonly ShownPose[] {
  return channelOf(scene).offered;
}

/** `null`: what the alignment itself came to. */
export function showPose(scene: string, shown: ShownPose | null): void {
  const channel = channelOf(scene);
  if (channel.shown !== shown) {
    channel.shown = shown;
    channel.listeners.forEach((listener) => listener(shown));
  }
}

export function onPoseShown(scene: string, listener: Listener): void {
  channelOf(scene).listeners.add(listener);
}

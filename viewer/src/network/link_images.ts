// SPDX-License-Identifier: BSD-3-Clause
// What two keyframes of a link saw, side by side.
import { h } from "../dom";
import type { FrameImage } from "../document/report";
import { formatCount } from "../math/format";
import { keyframeText } from "../scene/keyframes";
import { hasPose, type NetworkModel } from "./network_model";

const urls = new WeakMap<FrameImage, string>();

function urlOf(image: FrameImage): string {
  let url = urls.get(image);
  if (url === undefined) {
    url = URL.createObjectURL(new Blob([image.data as Uint8Array<ArrayBuffer>], { type: image.mediaType }));
    urls.set(image, url);
  }
  return url;
}

/** Both images of a link, the target's first; null if it has none. */
export function linkImages(model: NetworkModel, index: number): HTMLElement | null {
  const { target, source, use, view } = model.links[index];
  if (!view) {
    return null;
  }
  const sides = [
    [target, view.targetFrame],
    [source, view.sourceFrame],
  ].map(([node, frame]) => {
    const { name, cloud } = model.nodes[node];
    const image = cloud?.frames?.images.get(frame);
    if (!cloud?.frames || !image) {
      return null;
    }
    const keyframe = keyframeText(cloud.frames, frame);
    const picture = h("img", { src: urlOf(image), alt: `Keyframe ${keyframe} of ${name}`, decoding: "async" });
    return h("figure", null, picture, h("figcaption", null, name, " ", h("span", { class: "muted" }, keyframe)));
  });
  const seen = `${formatCount(view.matches)} common ${view.matches === 1 ? "landmark" : "landmarks"} in both images`;
  const at = hasPose(use) ? "" : ", at the poses of the maps";
  return h("div", { class: "link-images" }, ...sides, h("p", { class: "muted small" }, seen + at));
}

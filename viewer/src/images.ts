// SPDX-License-Identifier: BSD-3-Clause
import { h } from "./dom";
import type { ReportImage } from "./document/report";

/** Pictures with their captions; each is decoded when it comes near the view. */
export function imagesFigure(images: ReportImage[]): HTMLElement {
  return h(
    "div",
    { class: "images" },
    ...images.map((image) => {
      const blob = new Blob([image.data as Uint8Array<ArrayBuffer>], { type: image.mediaType });
      const picture = h("img", {
        src: URL.createObjectURL(blob),
        alt: image.caption || "Picture without a caption",
        width: image.width || null,
        height: image.height || null,
        loading: "lazy",
        decoding: "async",
      });
      return h("figure", { class: "card" }, picture, image.caption ? h("figcaption", null, image.caption) : null);
    }),
  );
}

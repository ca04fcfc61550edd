// SPDX-License-Identifier: BSD-3-Clause
import { Color, SRGBColorSpace, WebGLRenderer, type Camera, type Scene } from "three";

/**
 * The page's one WebGL context. Every pane of every scene draws through it and keeps the picture in a canvas of its
 * own: browsers allow few contexts, and a map shown in several panes is on the graphics card once.
 */
export class RenderService {
  static #shared: RenderService | null = null;
  readonly #renderer: WebGLRenderer | null;
  readonly #restored = new Set<() => void>();
  /** No graphics card: drawing takes the processor's time, so less is drawn while things move. */
  readonly software: boolean;
  readonly maxSize: number;
  #lost = false;

  static shared(): RenderService {
    return (this.#shared ??= new RenderService());
  }

  private constructor() {
    const probe = probeWebGl();
    this.software = probe?.software ?? true;
    this.maxSize = probe?.maxSize ?? 0;
    this.#renderer = null;
    if (probe) {
      const renderer = new WebGLRenderer({ antialias: false, alpha: false, powerPreference: "high-performance" });
      renderer.setPixelRatio(1);
      renderer.setScissorTest(true);
      renderer.outputColorSpace = SRGBColorSpace;
      renderer.domElement.addEventListener("webglcontextlost", () => (this.#lost = true));
      renderer.domElement.addEventListener("webglcontextrestored", () => {
        this.#lost = false;
        this.#restored.forEach((redraw) => redraw());
      });
      this.#renderer = renderer;
    }
  }

  get available(): boolean {
    return this.#renderer !== null;
  }

  /** `redraw` is called when a lost context is back. */
  onRestored(redraw: () => void): void {
    this.#restored.add(redraw);
  }

  /** Draws `scene` at `width` x `height` pixels, scaled into the whole of `into`'s canvas. */
  draw(
    scene: Scene,
    camera: Camera,
    into: CanvasRenderingContext2D,
    width: number,
    height: number,
    background: string,
  ): void {
    const renderer = this.#renderer;
    if (!renderer || this.#lost) {
      return;
    }
    const canvas = renderer.domElement;
    if (canvas.width < width || canvas.height < height) {
      renderer.setSize(Math.max(canvas.width, width), Math.max(canvas.height, height), false);
    }
    renderer.setViewport(0, 0, width, height);
    renderer.setScissor(0, 0, width, height);
    renderer.setClearColor(new Color(background), 1);
    renderer.render(scene, camera);
    into.imageSmoothingQuality = "high";
    into.drawImage(canvas, 0, canvas.height - height, width, height, 0, 0, into.canvas.width, into.canvas.height);
  }
}

function probeWebGl(): { software: boolean; maxSize: number } | null {
  try {
    const gl = document.createElement("canvas").getContext("webgl2");
    if (!gl) {
      return null;
    }
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    const maxSize = Math.min(8192, gl.getParameter(gl.MAX_RENDERBUFFER_SIZE) as number);
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    return { software: /swiftshader|llvmpipe|software|basic render/i.test(name), maxSize };
  } catch {
    return null;
  }
}

import type { App, Exported } from "./app.ts";
import { element } from "./dom.ts";
import { paintShapes, type Shape, shapesToSvg, sizedContext, svgDocument } from "./sketch.ts";

/** A part of a drawing that answers to the pointer (px). */
export interface Target {
  x: number;
  y: number;
  w: number;
  h: number;
  /** The robot that a click selects; null: none. */
  agent: number | null;
  /** What a click does instead. */
  act?: () => void;
  /** Shown under the pointer. */
  text: string;
}

/** A drawing of shapes that scrolls, with hover texts and clicks. */
export class SketchCanvas {
  readonly root: HTMLElement;
  private readonly canvas: HTMLCanvasElement;
  private readonly tip = element("div", { class: "tip", hidden: true });
  private shapes: Shape[] = [];
  private targets: Target[] = [];
  private width = 0;
  private height = 0;

  constructor(
    private readonly app: App,
    label: string,
  ) {
    this.canvas = element("canvas", { role: "img", "aria-label": label });
    this.root = element("div", { class: "sketch", tabindex: 0 }, this.canvas, this.tip);
    this.canvas.addEventListener("pointermove", (event) => this.hover(event));
    this.canvas.addEventListener("pointerleave", () => (this.tip.hidden = true));
    this.canvas.addEventListener("click", (event) => {
      const target = this.at(event);
      if (target?.act !== undefined) target.act();
      else if (target !== undefined) this.app.select(target.agent);
    });
  }

  /** Room that can be drawn on without scrolling (px). */
  get room(): { width: number; height: number } {
    return { width: this.root.clientWidth, height: this.root.clientHeight };
  }

  show(shapes: Shape[], width: number, height: number, targets: Target[]): void {
    this.shapes = shapes;
    this.targets = targets;
    this.width = width;
    this.height = height;
    paintShapes(sizedContext(this.canvas, width, height), shapes);
    this.app.framesDrawn++;
  }

  exported(): Exported {
    const { background } = this.app.theme;
    return {
      width: this.width,
      height: this.height,
      svg: () => svgDocument(this.width, this.height, background, shapesToSvg(this.shapes)),
      paint: (context, ratio) => {
        context.setTransform(ratio, 0, 0, ratio, 0, 0);
        context.fillStyle = background;
        context.fillRect(0, 0, this.width, this.height);
        paintShapes(context, this.shapes);
      },
    };
  }

  private at(event: MouseEvent): Target | undefined {
    const { offsetX, offsetY } = event;
    return this.targets.findLast(({ x, y, w, h }) => offsetX >= x && offsetX <= x + w && offsetY >= y && offsetY <= y + h);
  }

  private hover(event: PointerEvent): void {
    const target = this.at(event);
    this.tip.hidden = target === undefined;
    this.canvas.style.cursor = target !== undefined && (target.agent !== null || target.act !== undefined) ? "pointer" : "default";
    if (target === undefined) return;
    this.tip.textContent = target.text;
    const { scrollLeft, clientWidth } = this.root;
    this.tip.style.left = `${Math.max(scrollLeft, Math.min(event.offsetX + 12, scrollLeft + clientWidth - 270))}px`;
    this.tip.style.top = `${event.offsetY + 18}px`;
  }
}

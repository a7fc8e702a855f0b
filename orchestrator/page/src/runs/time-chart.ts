import type { Curve } from "../curves.ts";
import { element } from "../dom.ts";
import { figure, niceStep } from "../format.ts";
import { paintShapes, type Shape, sizedContext } from "../sketch.ts";

/** A curve and its colour. */
export interface Line {
  name: string;
  colour: string;
  curve: Curve;
  /** The curve as it is recorded, if `curve` is smoothed. */
  raw?: Curve;
}

/** What the axes show. */
export interface Axes {
  x: string;
  y: string;
  /** The values are per cent, and 100 is the most. */
  isShare: boolean;
}

/** Room around the curves for numbers and labels (px). */
const AROUND = { left: 62, right: 14, top: 8, bottom: 40 };
/** How opaque a curve is behind its smoothed one. */
const RAW = "55";

/** Colours of what is around the curves. */
export interface Ink {
  text: string;
  grid: string;
}

export const INK: Record<"light" | "dark", Ink> = {
  light: { text: "#5b6570", grid: "#dfe4e9" },
  dark: { text: "#9aa4af", grid: "#262c33" },
};

/** A part of the time (s), from and to. */
type Span = [number, number];

interface Frame {
  left: number;
  right: number;
  top: number;
  bottom: number;
}

/** A pointer that moves less far between down and up (px) has clicked. */
const CLICK_PX = 5;

/** The time that curves cover. */
function wholeSpan(lines: Line[]): Span | null {
  const ends = lines.flatMap(({ curve: { timeS } }) => (timeS.length === 0 ? [] : [timeS[0], timeS[timeS.length - 1]]));
  if (ends.length === 0) return null;
  const [from, until] = [Math.min(...ends), Math.max(...ends)];
  return until > from ? [from, until] : [from - 0.5, until + 0.5];
}

/** The values of curves within a span, with zero, and with a margin. */
function valuesWithin(lines: Line[], [from, until]: Span, isShare: boolean): Span {
  let [low, high] = [0, 0];
  for (const { curve: shown, raw } of lines) {
    const curve = raw ?? shown;
    curve.value.forEach((value, i) => {
      if (value === null || curve.timeS[i] < from || curve.timeS[i] > until) return;
      low = Math.min(low, value);
      high = Math.max(high, value);
    });
  }
  return high > low ? [low * 1.06, high * 1.06] : [0, isShare ? 100 : 1];
}

/** Axes and curves within a frame. Curves end at its edges. */
export function chartShapes(lines: Line[], axes: Axes, span: Span, { left, right, top, bottom }: Frame, ink: Ink): Shape[] {
  const [from, until] = span;
  const [low, high] = valuesWithin(lines, span, axes.isShare);
  const px = (t: number): number => left + ((right - left) * (t - from)) / (until - from);
  const py = (v: number): number => bottom - ((bottom - top) * (v - low)) / (high - low);
  const label = { kind: "text", fill: ink.text, size: 11 } as const;
  const shapes: Shape[] = [];
  const stepY = niceStep((high - low) / Math.max(2, Math.min(8, (bottom - top) / 28)));
  for (let k = Math.ceil(low / stepY); k * stepY <= high; k++) {
    const y = py(k * stepY);
    shapes.push({ kind: "line", x1: left, y1: y, x2: right, y2: y, stroke: ink.grid });
    shapes.push({ ...label, x: left - 7, y, text: figure(+(k * stepY).toPrecision(6)), anchor: "end" });
  }
  const stepX = niceStep((until - from) / Math.max(2, (right - left) / 62));
  for (let k = Math.ceil(from / stepX); k * stepX <= until; k++) {
    const x = px(k * stepX);
    shapes.push({ kind: "line", x1: x, y1: top, x2: x, y2: bottom, stroke: ink.grid });
    shapes.push({ ...label, x, y: bottom + 13, text: String(+(k * stepX).toPrecision(6)), anchor: "middle" });
  }
  shapes.push({ ...label, size: 12, x: (left + right) / 2, y: bottom + 30, text: axes.x, anchor: "middle" });
  shapes.push({ ...label, size: 12, x: left - 50, y: (top + bottom) / 2, text: axes.y, anchor: "middle", turned: true });
  const raw = lines.flatMap(({ raw, colour }) => (raw === undefined ? [] : [{ curve: raw, colour: `${colour}${RAW}`, width: 1 }]));
  for (const { curve, colour, width } of [...raw, ...lines.map((line) => ({ ...line, width: 1.75 }))]) {
    let points: number[] = [];
    const flush = (): void => {
      if (points.length > 2) shapes.push({ kind: "path", points, stroke: colour, width });
      points = [];
    };
    curve.value.forEach((value, i) => {
      const t = curve.timeS[i];
      if (value === null || t < from || t > until) flush();
      else points.push(px(t), py(value));
    });
    flush();
  }
  return shapes;
}

/** Curves over simulated time. The pointer, or a finger, reads values; a drag enlarges a span, a double click shows everything. */
export class TimeChart {
  readonly root: HTMLElement;
  private readonly canvas = element("canvas", { role: "img" });
  private readonly mark = element("div", { class: "mark", hidden: true });
  private readonly band = element("div", { class: "band", hidden: true });
  private lines: Line[] = [];
  private ink = INK.light;
  private axes: Axes = { x: "", y: "", isShare: false };
  private chosen: Span | null = null;
  private dragFrom: number | null = null;
  /** Where the pointer is (px); null: elsewhere. */
  private pointerX: number | null = null;

  constructor(private readonly moved: () => void) {
    this.root = element("div", { class: "chart-box" }, this.canvas, this.band, this.mark);
    new ResizeObserver(() => this.draw()).observe(this.root);
    this.root.addEventListener("pointerdown", (event) => {
      this.dragFrom = this.clampedX(event);
      this.point(event);
      if (event.pointerType === "mouse") this.root.setPointerCapture(event.pointerId);
    });
    this.root.addEventListener("pointermove", (event) => this.point(event));
    this.root.addEventListener("pointerup", (event) => this.drop(event));
    this.root.addEventListener("pointercancel", () => this.leave());
    this.root.addEventListener("pointerleave", () => this.leave());
    this.root.addEventListener("dblclick", () => {
      this.chosen = null;
      this.draw();
      this.moved();
    });
  }

  show(lines: Line[], axes: Axes, ink: Ink): void {
    this.lines = lines;
    this.ink = ink;
    // A span of another time means nothing in this one.
    if (axes.x !== this.axes.x) this.chosen = null;
    this.axes = axes;
    this.canvas.setAttribute("aria-label", `${axes.y} over ${axes.x} of ${lines.map(({ name }) => name).join(", ")}`);
    this.draw();
  }

  /** The time at the pointer, in the unit of the axis; null: it is elsewhere. */
  get timeS(): number | null {
    return this.pointerX === null || this.span === null ? null : this.timeAt(this.pointerX);
  }

  /** The part of the time that is shown. */
  get span(): Span | null {
    const whole = wholeSpan(this.lines);
    if (whole === null || this.chosen === null) return whole;
    const [from, until] = [Math.max(whole[0], this.chosen[0]), Math.min(whole[1], this.chosen[1])];
    return until > from ? [from, until] : whole;
  }

  private get frame(): Frame {
    const { left, right, top, bottom } = AROUND;
    return { left, right: this.root.clientWidth - right, top, bottom: this.root.clientHeight - bottom };
  }

  private draw(): void {
    const [width, height] = [this.root.clientWidth, this.root.clientHeight];
    if (width === 0 || height === 0) return;
    const context = sizedContext(this.canvas, width, height);
    if (this.span !== null) paintShapes(context, chartShapes(this.lines, this.axes, this.span, this.frame, this.ink));
  }

  private clampedX(event: PointerEvent): number {
    const { left, right } = this.frame;
    return Math.min(right, Math.max(left, event.clientX - this.root.getBoundingClientRect().left));
  }

  private timeAt(x: number): number {
    const [from, until] = this.span ?? [0, 1];
    const { left, right } = this.frame;
    return from + ((until - from) * (x - left)) / (right - left);
  }

  private point(event: PointerEvent): void {
    if (this.span === null) return;
    const x = this.clampedX(event);
    this.pointerX = x;
    this.mark.hidden = false;
    this.mark.style.left = `${x}px`;
    const from = event.pointerType === "mouse" ? this.dragFrom : null;
    this.band.hidden = from === null || Math.abs(x - from) < CLICK_PX;
    if (from !== null) {
      this.band.style.left = `${Math.min(x, from)}px`;
      this.band.style.width = `${Math.abs(x - from)}px`;
    }
    this.moved();
  }

  private drop(event: PointerEvent): void {
    const [from, x] = [this.dragFrom, this.clampedX(event)];
    if (event.pointerType === "mouse" && from !== null && Math.abs(x - from) >= CLICK_PX) {
      const ends = [this.timeAt(from), this.timeAt(x)];
      this.chosen = [Math.min(...ends), Math.max(...ends)];
      this.draw();
    }
    this.dragFrom = null;
    this.band.hidden = true;
    // The same place is another time now.
    this.moved();
  }

  private leave(): void {
    this.dragFrom = null;
    this.pointerX = null;
    this.mark.hidden = true;
    this.band.hidden = true;
    this.moved();
  }
}

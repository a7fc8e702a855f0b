import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { App } from "./app.ts";
import { aligned, type Curve } from "./curves.ts";
import { element } from "./dom.ts";
import { figure, niceStep } from "./format.ts";
import type { Shape } from "./sketch.ts";
import { CATEGORIES, OKABE_ITO } from "./swarm/colours.ts";

const HEIGHT = 170;
/** Points that a running simulation adds are drawn at most so often (ms). */
const REFRESH_MS = 500;

/** Curves over the time of the run, with the current time marked; a click goes to a time. */
export class Chart {
  readonly root: HTMLElement;
  private readonly now = element("div", { class: "now", "aria-hidden": "true" });
  private readonly box = element("div", { class: "chart-box" });
  private readonly heading = element("h3");
  private plot: uPlot | null = null;
  private version = "";
  private layout = "";
  private drawnMs = Number.NEGATIVE_INFINITY;
  private curves: Curve[] = [];

  constructor(
    private readonly app: App,
    private readonly labels: string[],
    private readonly unit: string,
    private readonly syncKey: string,
  ) {
    this.root = element("figure", { class: "chart" }, this.heading, this.box);
  }

  /** Draws the curves, if their version, the width or the theme has changed, and moves the mark of the current time. */
  show(version: string, content: () => { title: string; curves: Curve[] }): void {
    const width = this.root.clientWidth;
    if (width === 0) return;
    const layout = [width, this.app.theme.dark].join();
    const now = performance.now();
    const fresh = version !== this.version && now - this.drawnMs > REFRESH_MS;
    if (fresh || layout !== this.layout) {
      const { title, curves } = content();
      this.curves = curves;
      this.heading.textContent = this.unit === "" ? title : `${title} (${this.unit})`;
      const { timeS, values } = aligned(curves);
      if (this.plot !== null && layout === this.layout) this.plot.setData([timeS, ...values]);
      else this.draw(width, [timeS, ...values]);
      this.version = version;
      this.layout = layout;
      this.drawnMs = now;
      this.app.framesDrawn++;
    }
    this.moveNow();
  }

  /** The same chart as shapes, for files. */
  shapes(x: number, y: number, width: number, height: number): Shape[] {
    const { theme } = this.app;
    const [left, right, top, bottom] = [x + 60, x + width - 10, y + 24, y + height - 26];
    const times = this.curves.flatMap((c) => [c.timeS[0] ?? 0, c.timeS[c.timeS.length - 1] ?? 0]);
    const values = this.curves.flatMap((c) => c.value.filter((value) => value !== null));
    const [t0, t1] = [Math.min(...times), Math.max(...times)];
    const least = values.reduce((a, b) => Math.min(a, b), Number.POSITIVE_INFINITY);
    const most = values.reduce((a, b) => Math.max(a, b), Number.NEGATIVE_INFINITY);
    const label = { kind: "text", fill: theme.faintText, size: 11 } as const;
    const shapes: Shape[] = [{ ...label, x, y: y + 10, text: this.heading.textContent ?? "", fill: theme.text, size: 12 }];
    if (!(t1 > t0) || least > most) return shapes;
    const span = most > least ? most - least : 1;
    const px = (t: number): number => left + ((right - left) * (t - t0)) / (t1 - t0);
    const py = (v: number): number => bottom - ((bottom - top) * (v - least)) / span;
    const stepY = niceStep(span / 4);
    for (let v = Math.ceil(least / stepY) * stepY; v <= most; v += stepY) {
      shapes.push({ kind: "line", x1: left, y1: py(v), x2: right, y2: py(v), stroke: theme.dark ? "#30363d" : "#d0d7de" });
      shapes.push({ ...label, x: left - 5, y: py(v), text: figure(+v.toPrecision(6)), anchor: "end" });
    }
    const stepX = niceStep((t1 - t0) / 8);
    for (let t = Math.ceil(t0 / stepX) * stepX; t <= t1; t += stepX) {
      shapes.push({ ...label, x: px(t), y: bottom + 12, text: `${+t.toPrecision(6)} s`, anchor: "middle" });
    }
    this.curves.forEach((c, i) => {
      let points: number[] = [];
      const flush = (): void => {
        if (points.length > 2) shapes.push({ kind: "path", points, stroke: this.colour(i), width: 1.5 });
        points = [];
      };
      c.value.forEach((value, k) => {
        if (value === null) flush();
        else points.push(px(c.timeS[k]), py(value));
      });
      flush();
      if (this.labels.length > 1) shapes.push({ ...label, x: right - 30 * (this.labels.length - i), y: y + 10, text: this.labels[i], fill: this.colour(i) });
    });
    const now = px(Math.max(t0, Math.min(t1, this.app.store.state.timeNs / 1e9)));
    shapes.push({ kind: "line", x1: now, y1: top, x2: now, y2: bottom, stroke: theme.text, dash: [4, 3] });
    return shapes;
  }

  private colour(i: number): string {
    const colour = CATEGORIES[i % CATEGORIES.length];
    return this.app.theme.dark && colour === OKABE_ITO.blue ? OKABE_ITO.sky : colour;
  }

  private draw(width: number, data: uPlot.AlignedData): void {
    this.plot?.destroy();
    const { theme } = this.app;
    const axis: uPlot.Axis = {
      stroke: theme.faintText, grid: { stroke: theme.dark ? "#ffffff18" : "#00000014", width: 1 }, ticks: { show: false }, font: "11px system-ui",
    };
    this.plot = new uPlot(
      {
        width,
        height: HEIGHT,
        scales: { x: { time: false } },
        legend: { show: this.labels.length > 1 },
        cursor: { sync: { key: this.syncKey }, drag: { x: false, y: false }, y: false },
        axes: [
          { ...axis, size: 30, values: (_, ticks) => ticks.map((tick) => `${tick} s`) },
          { ...axis, size: 56, values: (_, ticks) => ticks.map((tick) => figure(+tick.toPrecision(6))) },
        ],
        series: [
          { label: "time", value: (_, value) => (value === null ? "–" : `${value.toFixed(2)} s`) },
          ...this.labels.map((label, i) => ({
            label, stroke: this.colour(i), width: 1.5, spanGaps: false, points: { show: false },
            value: (_: uPlot, value: number | null) => (value === null ? "–" : figure(value)),
          })),
        ],
      },
      data,
      this.box,
    );
    const { over } = this.plot;
    over.append(this.now);
    over.addEventListener("click", (event) => {
      if (this.plot !== null) this.app.seek(this.plot.posToVal(event.offsetX, "x") * 1e9);
    });
  }

  private moveNow(): void {
    if (this.plot === null) return;
    const left = this.plot.valToPos(this.app.store.state.timeNs / 1e9, "x");
    this.now.style.transform = `translateX(${Math.round(Math.max(0, Math.min(left, this.plot.over.clientWidth)))}px)`;
  }
}

import { type App, currentRun, type Exported } from "../app.ts";
import { element, selection, setText } from "../dom.ts";
import { figure, niceStep, seconds } from "../format.ts";
import type { Shape } from "../sketch.ts";
import { SketchCanvas, type Target } from "../sketch-canvas.ts";
import { css, OKABE_ITO } from "../swarm/colours.ts";
import { type MoteFigure, moteFigures } from "./figures.ts";
import { currentFrame, latestAt, type NetworkPanel, Redraw } from "./panel.ts";

/** One bar per mote: energy, radio duty cycle, queues, and whatever else the network counts. */
export class EnergyPanel implements NetworkPanel {
  readonly root: HTMLElement;
  private readonly sketch: SketchCanvas;
  private readonly choice: HTMLSelectElement;
  private readonly info = element("span", { class: "status" });
  private readonly note = element("div", { class: "empty" });
  private readonly bar: HTMLElement;
  private readonly redraw: Redraw;
  private chosen = "";

  constructor(private readonly app: App) {
    this.redraw = new Redraw(app);
    this.sketch = new SketchCanvas(app, "A figure of every mote");
    const choice = selection("Figure", [], "", (value) => (this.chosen = value));
    this.choice = choice.select;
    this.bar = element("div", { class: "toolbar" }, choice.root, this.info);
    this.root = element("div", { class: "panel" }, this.bar, this.sketch.root, this.note);
  }

  render(): void {
    const { overview, overviewVersion } = currentRun(this.app);
    const { timeNs } = this.app.store.state;
    const current = currentFrame(this.app);
    const { width, height } = this.sketch.room;
    if (!this.redraw.due(current?.frame.step, overviewVersion, this.chosen, width, height)) return;
    const sample = latestAt(overview.statistics, timeNs);
    const figures = sample?.statistics === undefined ? [] : moteFigures(sample.statistics);
    const queue = current?.frame.motes?.queueLength;
    if (queue !== undefined && queue.length > 0) figures.push({ name: "queue", label: "Queue length now", unit: "packets", values: [...queue] });
    this.note.hidden = figures.length > 0;
    this.bar.hidden = this.sketch.root.hidden = figures.length === 0;
    if (figures.length === 0) {
      const first = overview.statistics[0];
      this.note.textContent = first !== undefined
        ? `The first statistics were recorded at ${seconds(Number(first.timeNs))}: go to that time or later.`
        : "No statistics were recorded: run with netsim.mode = \"6tisch\" and output.motes = true.";
      return;
    }
    if (this.choice.options.length !== figures.length) {
      this.choice.replaceChildren(...figures.map(({ name, label }) => element("option", { value: name }, label)));
    }
    const shown = figures.find(({ name }) => name === this.chosen) ?? figures[0];
    this.choice.value = shown.name;
    const known = shown.values.filter((value) => Number.isFinite(value));
    const mean = known.reduce((sum, value) => sum + value, 0) / Math.max(1, known.length);
    const source = shown.name === "queue" ? "" : ` · counted until ${seconds(Number(sample?.timeNs ?? 0))}`;
    setText(this.info, `mean ${figure(mean)}, most ${figure(Math.max(...known))} ${shown.unit} over ${known.length} motes${source}`);
    if (width > 0) this.draw(shown, width, height);
  }

  exported(): Exported {
    return this.sketch.exported();
  }

  private draw(shown: MoteFigure, roomWidth: number, height: number): void {
    const { theme, store } = this.app;
    const count = shown.values.length;
    const [left, top, bottom] = [62, 26, height - 34];
    const pitch = Math.max(3, Math.min(40, (roomWidth - left - 16) / Math.max(1, count)));
    const width = Math.max(roomWidth, left + count * pitch + 16);
    const most = Math.max(...shown.values.filter((value) => Number.isFinite(value)), 0) || 1;
    const shapes: Shape[] = [];
    const targets: Target[] = [];
    const label = { kind: "text", fill: theme.faintText, size: 11 } as const;
    const y = (value: number): number => bottom - ((bottom - top) * value) / most;
    shapes.push({ ...label, x: 8, y: 10, text: shown.unit === "" ? shown.label : `${shown.label} (${shown.unit})` });
    const step = niceStep(most / 5);
    for (let value = 0; value <= most; value += step) {
      shapes.push({ kind: "line", x1: left, y1: y(value), x2: width - 8, y2: y(value), stroke: theme.dark ? "#ffffff1c" : "#0000001c" });
      shapes.push({ ...label, x: left - 6, y: y(value), text: figure(+value.toPrecision(6)), anchor: "end" });
    }
    const every = Math.max(1, Math.ceil(26 / pitch));
    shown.values.forEach((value, mote) => {
      const x = left + mote * pitch;
      if (mote % every === 0) shapes.push({ ...label, x: x + pitch / 2, y: bottom + 10, text: String(mote), anchor: "middle", size: 10 });
      if (!Number.isFinite(value)) return;
      const selected = store.state.selected === mote;
      const fill = selected ? OKABE_ITO.orange : theme.dark ? OKABE_ITO.sky : OKABE_ITO.blue;
      shapes.push({ kind: "rect", x: x + pitch * 0.1, y: y(value), w: pitch * 0.8, h: bottom - y(value), fill, stroke: selected ? css(theme.selected) : undefined });
      targets.push({ x, y: top, w: pitch, h: bottom - top, agent: mote, text: `mote ${mote}: ${figure(value)} ${shown.unit}` });
    });
    shapes.push({ ...label, x: Math.min(width, roomWidth) - 10, y: bottom + 24, text: "mote", anchor: "end" });
    this.sketch.show(shapes, width, height, targets);
  }
}

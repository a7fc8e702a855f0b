import { aligned, type Curve } from "../curves.ts";
import { element, selection, setText } from "../dom.ts";
import { download } from "../export.ts";
import { figure } from "../format.ts";
import { type Shape, shapesToSvg, svgDocument } from "../sketch.ts";
import type { Row, RunSeries, SeriesKind, Setting } from "./calls.ts";
import { shortKey } from "./columns.ts";
import { chartShapes, INK, type Line, TimeChart } from "./time-chart.ts";

const SVG_WIDTH = 900;
const SVG_HEIGHT = 420;
const LEGEND_COLUMNS = 3;

/** A run in the chart. */
export interface Drawn {
  row: Row;
  colour: string;
  /** What is loaded; undefined: it is on its way. */
  loaded: RunSeries | Error | undefined;
}

interface Actions {
  chooseSeries(name: string): void;
  drop(row: Row): void;
  clear(): void;
}

function labelWithUnit({ label, unit }: SeriesKind): string {
  return unit === "" ? label : `${label} (${unit})`;
}

/** A series of several runs over simulated time. */
export class Overlay {
  readonly root: HTMLElement;
  private readonly chart = new TimeChart(() => this.showValues());
  private readonly legend = element("ul", { class: "runs-legend", "aria-label": "Runs of the chart" });
  private readonly words = element("p", { class: "note", role: "status" });
  private readonly time = element("span", { class: "faint at" });
  private readonly series: HTMLSelectElement;
  private readonly buttons: HTMLButtonElement[];
  private readonly off = new Set<number>();
  private drawn: Drawn[] = [];
  private kind: SeriesKind | null = null;
  private dark = false;

  constructor(kinds: SeriesKind[], private readonly actions: Actions) {
    const choice = selection("Series", kinds.map((kind) => [kind.name, labelWithUnit(kind)] as const), kinds[0].name, (name) => actions.chooseSeries(name));
    this.series = choice.select;
    const button = (text: string, title: string, act: () => void): HTMLButtonElement => element("button", { type: "button", title, onclick: act }, text);
    this.buttons = [
      button("CSV", "Save the curves as a table", () => this.saveCsv()),
      button("SVG", "Save the chart as a picture", () => this.saveSvg()),
      button("Clear", "Select no run", () => actions.clear()),
    ];
    const fold = element("button", { type: "button", class: "fold", "aria-expanded": "true", "aria-label": "Show or hide the chart", onclick: () => {
      const isFolded = this.root.classList.toggle("folded");
      fold.setAttribute("aria-expanded", String(!isFolded));
      fold.textContent = isFolded ? "▴" : "▾";
    } }, "▾");
    const head = element("div", { class: "overlay-head" }, element("h2", {}, "Chart"), choice.root, this.time, element("span", { class: "spring" }), ...this.buttons, fold);
    this.root = element("section", { class: "overlay", "aria-label": "Chart of the selected runs" }, head, this.words, element("div", { class: "overlay-body" }, this.chart.root, this.legend));
  }

  /** Shows a series of runs. */
  show(kind: SeriesKind, drawn: Drawn[], dark: boolean): void {
    this.kind = kind;
    this.drawn = drawn;
    this.dark = dark;
    this.series.value = kind.name;
    const ids = new Set(drawn.map(({ row }) => row.id));
    for (const id of this.off) if (!ids.has(id)) this.off.delete(id);
    this.root.classList.toggle("empty", drawn.length === 0);
    const waiting = drawn.filter(({ loaded }) => loaded === undefined).length;
    const failed = drawn.find(({ loaded }) => loaded instanceof Error);
    const none = drawn.length > 0 && waiting === 0 && this.curves().every(({ curve }) => curve.value.every((value) => value === null));
    setText(
      this.words,
      drawn.length === 0 ? "Select up to 8 runs in the table to draw their series over each other."
        : failed !== undefined ? `${failed.row.name}: ${(failed.loaded as Error).message}`
        : waiting > 0 ? `Reading ${waiting} ${waiting === 1 ? "run" : "runs"}…`
        : none ? `None of these runs has a value of ${kind.label}.` : "",
    );
    this.words.hidden = this.words.textContent === "";
    this.drawLegend();
    this.draw();
  }

  /** For tests: the curves as they are drawn. */
  state(): { name: string; colour: string; on: boolean; points: number }[] {
    return this.drawn.map(({ row, colour, loaded }) => ({
      name: row.name, colour, on: !this.off.has(row.id), points: loaded === undefined || loaded instanceof Error ? 0 : loaded.time_s.length,
    }));
  }

  private get factor(): number {
    return this.kind?.unit === "%" ? 100 : 1;
  }

  private get axisLabel(): string {
    return this.kind === null ? "" : labelWithUnit(this.kind);
  }

  private curves(): (Drawn & { curve: Curve })[] {
    const { kind, factor } = this;
    if (kind === null) return [];
    return this.drawn.flatMap((drawn) => {
      const { loaded } = drawn;
      if (loaded === undefined || loaded instanceof Error) return [];
      const value = (loaded.values[kind.name] ?? []).map((value) => (value === null ? null : value * factor));
      return [{ ...drawn, curve: { timeS: loaded.time_s, value } }];
    });
  }

  private draw(): void {
    const lines = this.visible().map(({ row, colour, curve }): Line => ({ name: row.name, colour, curve }));
    this.chart.show(lines, this.axisLabel, INK[this.dark ? "dark" : "light"]);
    this.showValues();
  }

  /** The entries of the legend: each switches its curve off and on. */
  private drawLegend(): void {
    const keys = differing(this.drawn.map(({ row }) => row.settings));
    const entries = this.drawn.map(({ row, colour }) => {
      const settings = keys.slice(0, 4).map((key) => `${shortKey(key, keys)} ${shown(row.settings[key])}`);
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = colour;
      const words = element("span", { class: "words" }, element("span", { class: "strong" }, row.name), element("span", { class: "faint" }, settings.join(" · ")));
      const toggle = element("button", { type: "button", class: "toggle", "aria-pressed": String(!this.off.has(row.id)), title: `Switch the curve of ${row.name} off or on`, onclick: () => this.toggle(row) }, swatch, words, element("span", { class: "value" }));
      const drop = element("button", { type: "button", class: "drop", "aria-label": `Take ${row.name} out of the chart`, title: "Take it out of the chart", onclick: () => this.actions.drop(row) }, "×");
      return element("li", { "data-id": row.id }, toggle, drop);
    });
    const version = entries.map((entry) => entry.outerHTML.replace(/<span class="value">.*?<\/span>/g, "")).join();
    if (this.legend.dataset["version"] === version) return;
    this.legend.dataset["version"] = version;
    this.legend.replaceChildren(...entries);
    this.showValues();
  }

  private toggle(row: Row): void {
    if (!this.off.delete(row.id)) this.off.add(row.id);
    this.draw();
    this.legend.querySelector(`[data-id="${row.id}"] .toggle`)?.setAttribute("aria-pressed", String(!this.off.has(row.id)));
    delete this.legend.dataset["version"];
  }

  /** Values at the cursor, or the last ones. */
  private showValues(): void {
    const { timeS } = this.chart;
    setText(this.time, timeS === null ? "" : `at ${+timeS.toPrecision(4)} s`);
    for (const { row, curve } of this.curves()) {
      const value = timeS === null ? lastOf(curve) : nearest(curve, timeS);
      const entry = this.legend.querySelector(`[data-id="${row.id}"] .value`);
      if (entry !== null) setText(entry, value === null ? "–" : `${figure(+value.toPrecision(4))}${this.kind?.unit === "" ? "" : ` ${this.kind?.unit}`}`);
    }
  }

  private visible(): (Drawn & { curve: Curve })[] {
    return this.curves().filter(({ row }) => !this.off.has(row.id));
  }

  private saveCsv(): void {
    const curves = this.visible();
    const quoted = (text: string): string => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const { timeS, values } = aligned(curves.map(({ curve }) => curve));
    const lines = [["time_s", ...curves.map(({ row }) => quoted(`${row.name} ${this.axisLabel}`))].join(",")];
    timeS.forEach((time, i) => lines.push([time, ...values.map((column) => column[i] ?? "")].join(",")));
    download(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }), `${this.kind?.name ?? "series"}.csv`);
  }

  private saveSvg(): void {
    const { span } = this.chart;
    const lines = this.visible().map(({ row, colour, curve }): Line => ({ name: row.name, colour, curve }));
    const ink = INK[this.dark ? "dark" : "light"];
    const legendRows = Math.ceil(lines.length / LEGEND_COLUMNS);
    const frame = { left: 64, right: SVG_WIDTH - 20, top: 36, bottom: SVG_HEIGHT - 34 - 18 * legendRows };
    const text = { kind: "text", fill: this.dark ? "#e6e8eb" : "#1b1f24", size: 12 } as const;
    const shapes: Shape[] = [{ ...text, x: frame.left, y: 18, text: this.axisLabel, size: 14, bold: true }];
    if (span !== null) shapes.push(...chartShapes(lines, span, frame, ink));
    lines.forEach(({ name, colour }, i) => {
      const x = frame.left + ((frame.right - frame.left) / LEGEND_COLUMNS) * (i % LEGEND_COLUMNS);
      const y = frame.bottom + 34 + 18 * Math.floor(i / LEGEND_COLUMNS);
      shapes.push({ kind: "line", x1: x, y1: y, x2: x + 18, y2: y, stroke: colour, width: 3 }, { ...text, x: x + 24, y, text: name });
    });
    const svg = svgDocument(SVG_WIDTH, SVG_HEIGHT, this.dark ? "#14171b" : "#ffffff", shapesToSvg(shapes));
    download(new Blob([svg], { type: "image/svg+xml" }), `${this.kind?.name ?? "series"}.svg`);
  }
}

function lastOf({ value }: Curve): number | null {
  for (let i = value.length - 1; i >= 0; i--) if (value[i] !== null) return value[i];
  return null;
}

/** The value of a curve at a time, or at the point just before; null outside of it. */
function nearest({ timeS, value }: Curve, at: number): number | null {
  if (timeS.length === 0 || at > timeS[timeS.length - 1]) return null;
  let low = 0;
  let high = timeS.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (timeS[middle] <= at) low = middle + 1;
    else high = middle;
  }
  return low === 0 ? null : value[low - 1];
}

function shown(setting: Setting | undefined): string {
  return setting === undefined ? "–" : typeof setting === "number" ? figure(setting) : String(setting);
}

/** The keys that differ between some runs. */
export function differing(settings: Record<string, Setting>[]): string[] {
  const keys = [...new Set(settings.flatMap((of) => Object.keys(of)))].sort();
  return keys.filter((key) => settings.some((of) => of[key] !== settings[0][key]));
}


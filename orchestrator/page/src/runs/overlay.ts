import { aligned, type Curve } from "../curves.ts";
import { element, selection, setText } from "../dom.ts";
import { download } from "../export.ts";
import { figure } from "../format.ts";
import { type Shape, shapesToSvg, svgDocument } from "../sketch.ts";
import type { Row, RunSeries, SeriesKind, Setting } from "./calls.ts";
import { type Alignment, type Choices, SMOOTHINGS } from "./choices.ts";
import { shortKey } from "./columns.ts";
import { telling } from "./keys.ts";
import { type Axes, chartShapes, INK, type Line, TimeChart } from "./time-chart.ts";

const SVG_WIDTH = 900;
const SVG_HEIGHT = 460;
const SVG_LINE_PX = 18;
/** Width of a letter of the legend of a picture, about (px). */
const SVG_LETTER_PX = 6.4;
/** Keys that tell the runs of the chart apart, at most. */
const MOST_KEYS = 2;
/** Robots that start within so many seconds start together. */
const TOGETHER_S = 1e-6;

/** What each time is called on the axis, and the column of a table. */
const TIMES: Record<Alignment, { choice: string; label: string; column: string }> = {
  run: { choice: "since the run began", label: "simulated time (s)", column: "time_s" },
  robots: { choice: "since the robots started", label: "time since the robots started (s)", column: "time_since_robots_started_s" },
  share: { choice: "as a share of the run", label: "share of the time since the robots started (%)", column: "share_of_time_percent" },
};

/** A run in the chart. */
export interface Drawn {
  row: Row;
  colour: string;
  /** What is loaded; undefined: it is on its way. */
  loaded: RunSeries | Error | undefined;
}

interface Actions {
  choose(changes: Partial<Choices>): void;
  drop(row: Row): void;
  clear(): void;
}

export function labelWithUnit({ label, unit }: SeriesKind): string {
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
  private readonly times: HTMLSelectElement;
  private readonly smoothing: HTMLSelectElement;
  private readonly buttons: HTMLButtonElement[];
  private readonly off = new Set<number>();
  private drawn: Drawn[] = [];
  private kind: SeriesKind | null = null;
  private alignment: Alignment = "run";
  private smooth = 0;
  private dark = false;

  constructor(kinds: SeriesKind[], private readonly actions: Actions) {
    const choice = selection("Series", kinds.map((kind) => [kind.name, labelWithUnit(kind)] as const), kinds[0].name, (series) => actions.choose({ series }));
    this.series = choice.select;
    const times = selection("Time", Object.entries(TIMES).map(([name, { choice }]) => [name, choice] as const), "run", (time) => actions.choose({ time: time as Alignment }));
    this.times = times.select;
    const smoothing = selection("Moving mean", SMOOTHINGS.map((share) => [String(share), share === 0 ? "none" : `over ${share} % of the points`] as const), "0", (share) => actions.choose({ smooth: Number(share) }));
    this.smoothing = smoothing.select;
    const axes = element("details", { class: "menu up" }, element("summary", {}, "Axes"), element("div", { class: "menu-body" }, times.root, smoothing.root));
    document.addEventListener("click", (event) => {
      if (!axes.contains(event.target as Node)) axes.open = false;
    });
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
    const head = element("div", { class: "overlay-head" }, element("h2", {}, "Chart"), choice.root, this.time, element("span", { class: "spring" }), axes, ...this.buttons, fold);
    this.root = element("section", { class: "overlay", "aria-label": "Chart of the selected runs" }, head, this.words, element("div", { class: "overlay-body" }, this.chart.root, this.legend));
  }

  /** Shows a series of runs. */
  show(kind: SeriesKind, drawn: Drawn[], { time, smooth }: Choices, dark: boolean): void {
    this.kind = kind;
    this.drawn = drawn;
    this.dark = dark;
    const starts = drawn.flatMap(({ loaded }) => (loaded === undefined || loaded instanceof Error ? [] : [startOf(loaded)]));
    const isTogether = starts.every((start) => Math.abs(start - starts[0]) < TOGETHER_S);
    this.alignment = time === "" ? (isTogether ? "run" : "robots") : time;
    this.smooth = smooth;
    this.series.value = kind.name;
    this.times.value = this.alignment;
    this.smoothing.value = String(smooth);
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

  private get axes(): Axes {
    return { x: TIMES[this.alignment].label, y: this.kind === null ? "" : labelWithUnit(this.kind), isShare: this.kind?.unit === "%" };
  }

  private curves(): (Drawn & { curve: Curve; mean: number | null })[] {
    const { kind, factor, alignment } = this;
    if (kind === null) return [];
    return this.drawn.flatMap((drawn) => {
      const { loaded } = drawn;
      if (loaded === undefined || loaded instanceof Error) return [];
      const start = startOf(loaded);
      const end = loaded.time_s[loaded.time_s.length - 1];
      const timeS = loaded.time_s.map((t) => (alignment === "run" ? t : alignment === "robots" ? t - start : (100 * (t - start)) / (end - start)));
      const from = alignment === "run" ? 0 : Math.max(0, timeS.findIndex((t) => t >= 0));
      const value = (loaded.values[kind.name] ?? []).map((value) => (value === null ? null : value * factor));
      const mean = loaded.means[kind.name] ?? null;
      return [{ ...drawn, mean: mean === null ? null : mean * factor, curve: { timeS: timeS.slice(from), value: value.slice(from) } }];
    });
  }

  private lines(): Line[] {
    return this.visible().map(({ row, colour, curve }): Line =>
      this.smooth === 0 ? { name: row.name, colour, curve } : { name: row.name, colour, curve: smoothed(curve, this.smooth / 100), raw: curve },
    );
  }

  private draw(): void {
    this.chart.show(this.lines(), this.axes, INK[this.dark ? "dark" : "light"]);
    this.showValues();
  }

  /** What tells the runs of the chart apart, run by run: values of keys, or the seeds. */
  private differences(): [string, string][][] {
    const rows = this.drawn.map(({ row }) => row);
    const all = differing(rows.map((row) => row.settings));
    const { keys, enough } = telling(rows, all, MOST_KEYS);
    const pairs = rows.map((row) => keys.slice(0, enough).map((key): [string, string] => [shortKey(key, all), shown(row.settings[key])]));
    // Runs of the same settings have other seeds.
    const isAlike = new Set(pairs.map((own) => JSON.stringify(own))).size < rows.length && new Set(rows.map((row) => row.seed)).size > 1;
    return isAlike ? pairs.map((own, i) => [...own, ["seed", String(rows[i].seed ?? "–")]]) : pairs;
  }

  /** The entries of the legend: each switches its curve off and on. */
  private drawLegend(): void {
    const differences = this.differences();
    const entries = this.drawn.map(({ row, colour }, i) => {
      // A name of a key may be cut, its value never is.
      const settings = differences[i].map(([key, value]) => element("span", { class: "pair", title: `${key} ${value}` }, element("span", { class: key.length > 7 ? "" : "short" }, key), element("b", {}, value)));
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = colour;
      const words = element("span", { class: "words" }, element("span", { class: "strong" }, row.name), element("span", { class: "value" }), element("span", { class: "faint pairs" }, ...settings));
      const toggle = element("button", { type: "button", class: "toggle", "aria-pressed": String(!this.off.has(row.id)), title: `Switch the curve of ${row.name} off or on`, onclick: () => this.toggle(row) }, swatch, words);
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

  /** Values at the cursor, or the means. */
  private showValues(): void {
    const { timeS } = this.chart;
    setText(this.time, timeS === null ? "" : `at ${+timeS.toPrecision(4)} ${this.alignment === "share" ? "%" : "s"}`);
    for (const { row, curve, mean } of this.curves()) {
      const value = timeS === null ? mean : nearest(this.smooth === 0 ? curve : smoothed(curve, this.smooth / 100), timeS);
      const entry = this.legend.querySelector(`[data-id="${row.id}"] .value`);
      if (entry === null) continue;
      const text = value === null ? "–" : `${figure(+value.toPrecision(4))}${this.kind?.unit === "" ? "" : ` ${this.kind?.unit}`}`;
      setText(entry, timeS === null && value !== null ? `mean ${text}` : text);
    }
  }

  private visible(): ReturnType<Overlay["curves"]> {
    return this.curves().filter(({ row }) => !this.off.has(row.id));
  }

  private saveCsv(): void {
    const curves = this.lines();
    const label = this.smooth === 0 ? this.axes.y : `${this.axes.y}, moving mean over ${this.smooth} %`;
    const quoted = (text: string): string => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const { timeS, values } = aligned(curves.map(({ curve }) => curve));
    const lines = [[TIMES[this.alignment].column, ...curves.map(({ name }) => quoted(`${name} ${label}`))].join(",")];
    timeS.forEach((time, i) => lines.push([time, ...values.map((column) => column[i] ?? "")].join(",")));
    download(new Blob([`${lines.join("\n")}\n`], { type: "text/csv" }), `${this.kind?.name ?? "series"}.csv`);
  }

  private saveSvg(): void {
    const { span } = this.chart;
    const lines = this.lines();
    const text = { kind: "text", fill: this.dark ? "#e6e8eb" : "#1b1f24", size: 12 } as const;
    const differences = new Map(this.differences().map((pairs, i) => [this.drawn[i].row.name, pairs.map(([key, value]) => `${key} ${value}`).join(", ")]));
    const entries = lines.map(({ name, colour }) => {
      const difference = differences.get(name) ?? "";
      return { colour, words: difference === "" ? name : `${name}: ${difference}` };
    });
    const width = SVG_WIDTH - 84;
    const longest = Math.max(1, ...entries.map(({ words }) => 40 + SVG_LETTER_PX * words.length));
    const columns = Math.max(1, Math.min(3, Math.floor(width / longest)));
    const frame = { left: 64, right: 64 + width, top: 16, bottom: SVG_HEIGHT - 62 - SVG_LINE_PX * Math.ceil(entries.length / columns) };
    const shapes: Shape[] = span === null ? [] : chartShapes(lines, this.axes, span, frame, { ...INK[this.dark ? "dark" : "light"], text: text.fill });
    entries.forEach(({ words, colour }, i) => {
      const x = frame.left + (width / columns) * (i % columns);
      const y = frame.bottom + 58 + SVG_LINE_PX * Math.floor(i / columns);
      shapes.push({ kind: "line", x1: x, y1: y, x2: x + 18, y2: y, stroke: colour, width: 3 }, { ...text, x: x + 24, y, text: words });
    });
    const svg = svgDocument(SVG_WIDTH, SVG_HEIGHT, this.dark ? "#14171b" : "#ffffff", shapesToSvg(shapes));
    download(new Blob([svg], { type: "image/svg+xml" }), `${this.kind?.name ?? "series"}.svg`);
  }
}

/** When the robots of a run started; of one whose robots have not, its beginning. */
function startOf({ robots_started_s }: RunSeries): number {
  return robots_started_s ?? 0;
}

/** The mean of the points around each one: so many of all points, fewer at the ends. */
export function smoothed({ timeS, value }: Curve, share: number): Curve {
  const beside = Math.max(1, Math.round((share * timeS.length) / 2));
  return {
    timeS,
    value: value.map((own, i) => {
      if (own === null) return null;
      const known = value.slice(Math.max(0, i - beside), i + beside + 1).filter((other) => other !== null);
      return known.reduce((sum, other) => sum + other, 0) / known.length;
    }),
  };
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


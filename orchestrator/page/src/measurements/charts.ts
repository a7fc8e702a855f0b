import { figure, niceStep } from "../format.ts";
import type { Measurements } from "../gen/murmuration/view/v1/view_pb.ts";
import type { Shape } from "../sketch.ts";
import type { Target } from "../sketch-canvas.ts";
import { css, neutral, OKABE_ITO, type Theme } from "../swarm/colours.ts";
import { HALF_90, meanOf } from "./bins.ts";
import type { Curve, ShownRows } from "./shown.ts";

/** Candidates that are drawn. */
const MOST_CANDIDATES = 12;
const ROW = 24;
const CURVE_HEIGHT = 120;
/** Height of a line of a note, and about the mean width of its letters (px). */
const NOTE_LINE = 14;
const LETTER_PX = 5.9;

/** What a gain in nats means, where such gains are shown. */
const NATS = "nat: the unit of natural logarithms. A gain of g nats per row: the model with the effect gives a held-out row eᵍ times " +
  "the probability density that the model without it gives, in geometric mean over the rows. 0.1 nats: 1.11 times.";

/** A text in lines of at most so many letters, where its words allow it. */
function wrapped(text: string, letters: number): string[] {
  const lines = [""];
  for (const word of text.split(" ")) {
    const last = lines.length - 1;
    if (lines[last] !== "" && lines[last].length + 1 + word.length > letters) lines.push(word);
    else lines[last] += `${lines[last] === "" ? "" : " "}${word}`;
  }
  return lines;
}

/** Drawings one below the other. */
export class Charts {
  readonly shapes: Shape[] = [];
  readonly targets: Target[] = [];
  private y = 8;
  private readonly label: { kind: "text"; fill: string; size: number };

  constructor(
    private readonly theme: Theme,
    private readonly width: number,
  ) {
    this.label = { kind: "text", fill: theme.faintText, size: 11 };
  }

  get height(): number {
    return this.y + 8;
  }

  /** A title and notes below it, in as many lines as they need. */
  private title(text: string, ...notes: string[]): void {
    this.shapes.push({ kind: "text", x: 8, y: this.y + 8, text, fill: this.theme.text, size: 13, bold: true });
    this.y += 25;
    for (const line of notes.flatMap((note) => wrapped(note, (this.width - 16) / LETTER_PX))) {
      this.shapes.push({ ...this.label, x: 8, y: this.y, text: line });
      this.y += NOTE_LINE;
    }
  }

  private get grid(): string {
    return this.theme.dark ? "#ffffff22" : "#00000022";
  }

  private get strong(): string {
    return this.theme.dark ? OKABE_ITO.sky : OKABE_ITO.blue;
  }

  /** Bars beside their names, the values at the right end. */
  private bars(rows: { name: string; value: number; half: number; strong: boolean; text: string }[]): void {
    const [left, right] = [Math.min(190, this.width * 0.38), this.width - 84];
    const low = Math.min(0, ...rows.map(({ value, half }) => value - half));
    const high = Math.max(1e-12, ...rows.map(({ value, half }) => value + half));
    const x = (value: number): number => left + ((value - low) / (high - low)) * (right - left);
    for (const { name, value, half, strong, text } of rows) {
      const middle = this.y + ROW / 2;
      this.shapes.push({ ...this.label, x: left - 8, y: middle, text: name, anchor: "end", fill: this.theme.text });
      const fill = strong ? this.strong : neutral(this.theme.dark);
      const [from, to] = [Math.min(x(0), x(value)), Math.max(x(0), x(value))];
      this.shapes.push({ kind: "rect", x: from, y: this.y + 4, w: Math.max(1, to - from), h: ROW - 8, fill });
      if (half > 0) this.shapes.push({ kind: "line", x1: x(value - half), y1: middle, x2: x(value + half), y2: middle, stroke: this.theme.text, width: 1.5 });
      this.shapes.push({ ...this.label, x: this.width - 8, y: middle, text, anchor: "end", fill: this.theme.text });
      this.y += ROW;
    }
    this.y += 12;
  }

  ladder({ ladder, unit }: Measurements): void {
    const rows = ladder.filter(({ rmse }) => Number.isFinite(rmse));
    if (rows.length === 0) return;
    this.title("Error, effect by effect", `root mean squared error on rows that were held out (${unit})`);
    this.bars(rows.map(({ model, rmse }, i) => ({ name: model, value: rmse, half: 0, strong: i > 0, text: `${figure(rmse)} ${unit}` })));
  }

  candidates({ candidates }: Measurements): void {
    const rows = candidates.filter(({ gain, accepted }) => gain !== 0 || accepted).sort((a, b) => b.gain - a.gain).slice(0, MOST_CANDIDATES);
    if (rows.length === 0) return;
    this.title("Gain of each candidate", "held-out log score (nats per row) with 90 % interval; coloured: accepted", NATS);
    this.bars(rows.map(({ effect, gain, standardError, accepted }) => (
      { name: effect, value: gain, half: Number.isFinite(standardError) ? HALF_90 * standardError : 0, strong: accepted, text: figure(gain) })));
  }

  scores({ scores }: Measurements): void {
    if (scores.length === 0) return;
    this.title("Scores on rows that were held out", "value and 90 % interval");
    for (const { name, value, low, high } of scores) {
      const interval = Number.isFinite(low) && Number.isFinite(high) ? `${figure(low)} to ${figure(high)}` : "";
      const middle = this.y + 9;
      this.shapes.push({ ...this.label, x: 16, y: middle, text: name, fill: this.theme.text });
      this.shapes.push({ ...this.label, x: this.width * 0.66, y: middle, text: figure(value), anchor: "end", fill: this.theme.text });
      this.shapes.push({ ...this.label, x: this.width - 8, y: middle, text: interval, anchor: "end" });
      this.y += 18;
    }
    this.y += 12;
  }

  /** Mean residuals over a covariate. `chosen`: the number of the bin whose rows are shown; `choose`: called with the number of a bin. */
  curve(curve: Curve, shown: ShownRows, unit: string, chosen: number | null, choose: (bin: number) => void): void {
    const { rows } = shown;
    if (rows === undefined) return;
    const share = `${Math.round(100 * curve.explained)} % of the variance`;
    this.title(`Residual over ${curve.name}, ${share}`, `measured − predicted (${unit}): means of bins, 90 % intervals`);
    const legendY = this.y + 2;
    this.y += 14;
    const [left, right, top, bottom] = [50, this.width - 16, this.y, this.y + CURVE_HEIGHT];
    const models = [{ residual: rows.residual, colour: css(this.theme.wall), name: "as configured" }];
    if (shown.hasEffects) models.push({ residual: rows.residualWithEffects, colour: this.strong, name: "with what was found" });
    const means = models.map(({ residual }) => curve.bins.map((bin) => meanOf(bin.rows, residual)));
    const ends = means.flat().flatMap(({ mean, half }) => [mean - (half || 0), mean + (half || 0)]).filter(Number.isFinite);
    const [low, high] = [Math.min(0, ...ends), Math.max(0, ...ends, 1e-9)];
    const [x0, x1] = [curve.bins[0].from, curve.bins[curve.bins.length - 1].to];
    const x = (value: number): number => left + ((value - x0) / (x1 - x0)) * (right - left);
    const y = (value: number): number => bottom - ((value - low) / (high - low)) * (bottom - top);
    curve.bins.forEach(({ from, to, rows: inBin }, number) => {
      // Narrow bins can be hit, too.
      const room = Math.max(0, (8 - x(to) + x(from)) / 2);
      const [a, b] = [x(from) - room, x(to) + room];
      if (number === chosen) this.shapes.push({ kind: "rect", x: a, y: top, w: b - a, h: bottom - top, fill: this.theme.dark ? "#ffffff26" : "#0000001c" });
      const all = means.map((each, i) => `${models[i].name} ${figure(each[number].mean)} ${unit}`).join(", ");
      const range = from === to ? figure(from) : `${figure(from)} to ${figure(to)}`;
      this.targets.push({
        x: a, y: top, w: b - a, h: bottom - top, agent: null, act: () => choose(number),
        text: `${curve.name} ${range}: ${inBin.length} rows; mean residual ${all}`,
      });
    });
    const step = niceStep((high - low) / 3);
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
      this.shapes.push({ kind: "line", x1: left, y1: y(value), x2: right, y2: y(value), stroke: this.grid });
      this.shapes.push({ ...this.label, x: left - 5, y: y(value), text: figure(+value.toPrecision(6)), anchor: "end" });
    }
    this.shapes.push({ kind: "line", x1: left, y1: y(0), x2: right, y2: y(0), stroke: this.theme.text });
    means.forEach((each, i) => {
      const { colour } = models[i];
      const points: number[] = [];
      each.forEach(({ mean, half }, number) => {
        if (!Number.isFinite(mean)) return;
        const middle = (x(curve.bins[number].from) + x(curve.bins[number].to)) / 2 + 2 * i;
        points.push(middle, y(mean));
        this.shapes.push({ kind: "circle", x: middle, y: y(mean), r: 3, fill: colour });
        if (Number.isFinite(half)) this.shapes.push({ kind: "line", x1: middle, y1: y(mean - half), x2: middle, y2: y(mean + half), stroke: colour });
      });
      this.shapes.push({ kind: "path", points, stroke: colour, width: 1.5, dash: i === 0 ? [] : [5, 3] });
      const legendX = left + 110 * i;
      this.shapes.push({ kind: "line", x1: legendX, y1: legendY, x2: legendX + 16, y2: legendY, stroke: colour, width: 2, dash: i === 0 ? [] : [5, 3] });
      this.shapes.push({ ...this.label, x: legendX + 20, y: legendY, text: models[i].name, fill: colour });
    });
    const across = niceStep((x1 - x0) / 5);
    for (let value = Math.ceil(x0 / across) * across; value <= x1; value += across) {
      this.shapes.push({ kind: "line", x1: x(value), y1: bottom, x2: x(value), y2: bottom + 4, stroke: this.theme.faintText });
      this.shapes.push({ ...this.label, x: x(value), y: bottom + 13, text: figure(+value.toPrecision(6)), anchor: "middle" });
    }
    this.y = bottom + 34;
  }
}

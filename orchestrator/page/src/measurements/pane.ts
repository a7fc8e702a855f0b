import { type App, currentRun, type Exported, type ViewPanel } from "../app.ts";
import { composed } from "../compare.ts";
import { checkbox, element, setText } from "../dom.ts";
import { figure } from "../format.ts";
import type { Measurements } from "../gen/murmuration/view/v1/view_pb.ts";
import { Redraw } from "../network/panel.ts";
import { SketchCanvas } from "../sketch-canvas.ts";
import { SwarmView } from "../swarm/view.ts";
import { meanOf } from "./bins.ts";
import { Charts } from "./charts.ts";
import { ShownRows } from "./shown.ts";

/** The model against measurements: residuals on the map of the run, beside the ladder and the curves that choose which are shown. */
export class MeasurementsView implements ViewPanel {
  readonly root: HTMLElement;
  readonly shown: ShownRows;
  /** The maps, one for each run. */
  readonly views: SwarmView[];
  private readonly charts: SketchCanvas;
  private readonly redraw: Redraw;
  private readonly withEffects: { root: HTMLElement; input: HTMLInputElement };
  private readonly all: HTMLButtonElement;
  private readonly info = element("span", { class: "status" });

  constructor(
    private readonly app: App,
    private readonly measurements: Measurements,
  ) {
    const { store } = app;
    this.shown = new ShownRows(measurements);
    this.redraw = new Redraw(app);
    this.views = app.source.runs.map((run) => new SwarmView(app, run, "", this.shown));
    this.charts = new SketchCanvas(app, "Scores, and residuals over what was measured beside");
    this.withEffects = checkbox("with what was found", "Show the residuals that are left with all accepted effects", (on) => store.set({ withEffects: on }));
    this.all = element("button", { type: "button", title: "Show the rows of all bins (Esc)", onclick: () => store.set({ bin: null }) }, "all rows");
    const fit = element("button", { type: "button", title: "Fit everything into the view (F, or double-click)", onclick: () => this.view.refit() }, "Fit");
    const words = [measurements.title, measurements.verdict].filter((text) => text !== "").join(" – ");
    this.root = element("section", { class: "pane measurements", "aria-label": "Measurements" },
      element("p", { class: "verdict" }, words),
      element("div", { class: "toolbar" }, this.withEffects.root, this.all, fit, this.info),
      element("div", { class: "pair" }, ...this.views.map((view) => view.root), this.charts.root));
  }

  /** The map of the current run. */
  get view(): SwarmView {
    return this.views[this.app.source.runs.indexOf(currentRun(this.app))];
  }

  render(): void {
    const { state } = this.app.store;
    for (const view of this.views) view.root.hidden = view !== this.view;
    this.view.render();
    this.withEffects.root.hidden = !this.shown.hasEffects;
    this.withEffects.input.checked = state.withEffects;
    this.all.hidden = this.shown.bin(state) === null;
    setText(this.info, this.words());
    const { width } = this.charts.room;
    if (width > 0 && this.redraw.due(width, this.shown.mapKey(state))) this.draw(width);
  }

  exported(): Exported {
    const [map, charts] = [this.view.exported(), this.charts.exported()];
    return composed([{ part: map, x: 0, y: 0 }, { part: charts, x: map.width, y: 0 }], this.app.theme.background);
  }

  private draw(width: number): void {
    const { store, theme } = this.app;
    const charts = new Charts(theme, width);
    charts.ladder(this.measurements);
    charts.candidates(this.measurements);
    charts.scores(this.measurements);
    const chosen = this.shown.bin(store.state);
    for (const curve of this.shown.curves) {
      const bin = chosen?.curve === curve ? curve.bins.indexOf(chosen.bin) : null;
      charts.curve(curve, this.shown, this.measurements.unit, bin, (number) => store.set({ bin: number === bin ? null : `${curve.name}:${number}` }));
    }
    this.charts.show(charts.shapes, width, charts.height, charts.targets);
  }

  /** What the map shows. */
  private words(): string {
    const { rows } = this.shown;
    if (rows === undefined) return "The residuals of the rows are not here: give them with --residuals.";
    const { state } = this.app.store;
    const chosen = this.shown.bin(state);
    const { lines } = this.shown.map(state);
    const { count, mean } = meanOf(chosen?.bin.rows ?? [...rows.residual.keys()], this.shown.residual(state));
    const range = chosen === null ? "" : `${chosen.curve.name} ${chosen.bin.from === chosen.bin.to ? "" : `${figure(chosen.bin.from)} to `}${figure(chosen.bin.to)}: `;
    const on = lines.length > 0 ? ` on ${lines.length} ${this.measurements.unit === "dB" ? "links" : "ways"}` : "";
    const thinned = rows.residual.length < Number(rows.rowCount) ? ` (of ${rows.rowCount} rows in the file, evenly thinned)` : "";
    return `${range}${count} rows${on}${thinned}, mean residual ${figure(mean)} ${this.measurements.unit}${chosen === null ? "; click a bin of a curve to see its rows alone" : ""}`;
  }
}

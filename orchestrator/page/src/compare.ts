import type { App, Exported, ViewPanel } from "./app.ts";
import { Chart } from "./chart.ts";
import { curve, difference } from "./curves.ts";
import { element } from "./dom.ts";
import { figure } from "./format.ts";
import { exportedCharts } from "./series.ts";
import { svgDocument } from "./sketch.ts";
import { swarmToolbar } from "./swarm/pane.ts";
import { SwarmView } from "./swarm/view.ts";

/** Several drawings as one. */
export function composed(parts: { part: Exported; x: number; y: number }[], background: string): Exported {
  const width = Math.max(...parts.map(({ part, x }) => x + part.width));
  const height = Math.max(...parts.map(({ part, y }) => y + part.height));
  return {
    width,
    height,
    svg: () => svgDocument(width, height, background, parts.map(({ part, x, y }) => `<g transform="translate(${x} ${y})">${part.svg()}</g>`).join("\n")),
    paint: (context, ratio) => {
      for (const { part, x, y } of parts) {
        const canvas = element("canvas", { width: Math.round(part.width * ratio), height: Math.round(part.height * ratio) });
        part.paint(canvas.getContext("2d") as CanvasRenderingContext2D, ratio);
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.drawImage(canvas, x * ratio, y * ratio);
      }
    },
  };
}

/** Both runs side by side at the same time with the same camera; below, the series that both have and their differences. */
export class CompareView implements ViewPanel {
  readonly root: HTMLElement;
  readonly views: SwarmView[];
  private readonly toolbar: { root: HTMLElement; render(): void };
  private readonly grid = element("div", { class: "charts" });
  private readonly note = element("p", { class: "note" });
  private readonly charts = new Map<string, { both: Chart; difference: Chart }>();

  constructor(private readonly app: App) {
    this.toolbar = swarmToolbar(app, () => this.views.forEach((view) => view.refit()));
    this.views = app.source.runs.slice(0, 2).map((run, i) => new SwarmView(app, run, `${"AB"[i]}: ${run.run.name}, seed ${run.run.seed}`));
    this.root = element("section", { class: "pane compare", "aria-label": "Compare" }, this.toolbar.root,
      element("div", { class: "pair" }, ...this.views.map((view) => view.root)), element("div", { class: "differences" }, this.note, this.grid));
  }

  render(): void {
    this.toolbar.render();
    for (const view of this.views) view.render();
    const [a, b] = this.app.source.runs;
    let common = 0;
    for (const ofA of a.overview.series) {
      const ofB = b.overview.series.find((series) => series.name === ofA.name);
      if (ofB === undefined) continue;
      common++;
      let pair = this.charts.get(ofA.name);
      if (pair === undefined) {
        pair = {
          both: new Chart(this.app, ["A", "B"], ofA.unit, "compare"),
          difference: new Chart(this.app, ["B − A"], ofA.unit, "compare"),
        };
        this.charts.set(ofA.name, pair);
        this.grid.append(pair.both.root, pair.difference.root);
      }
      const version = `${a.overviewVersion} ${b.overviewVersion}`;
      pair.both.show(version, () => ({ title: ofA.label, curves: [curve(ofA), curve(ofB)] }));
      pair.difference.show(version, () => {
        const minus = difference(curve(ofA), curve(ofB));
        const mean = minus.mean === null ? "no time in common" : `mean ${figure(minus.mean)}`;
        return { title: `${ofA.label}: B − A, ${mean}`, curves: [minus.curve] };
      });
    }
    this.note.textContent = common > 0 ? "" : "The two runs have no series in common yet.";
    this.note.hidden = common > 0;
  }

  exported(): Exported {
    const views = this.views.map((view) => view.exported());
    const charts = exportedCharts(this.app, [...this.charts.values()].flatMap(({ both, difference: minus }) => [both, minus]));
    const top = Math.max(...views.map((view) => view.height));
    const parts = [...views.map((view, i) => ({ part: view, x: i * views[0].width, y: 0 })), { part: charts, x: 0, y: top }];
    return composed(parts, this.app.theme.background);
  }
}

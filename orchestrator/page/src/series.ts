import { type App, currentRun, type Exported, type ViewPanel } from "./app.ts";
import { Chart } from "./chart.ts";
import { curve } from "./curves.ts";
import { element } from "./dom.ts";
import { paintShapes, type Shape, shapesToSvg, svgDocument } from "./sketch.ts";

const EXPORT_WIDTH = 900;
const EXPORT_HEIGHT = 200;

/** Charts below each other, for files. */
export function exportedCharts(app: App, charts: Chart[]): Exported {
  const shapes: Shape[] = charts.flatMap((chart, i) => chart.shapes(14, 10 + i * EXPORT_HEIGHT, EXPORT_WIDTH - 28, EXPORT_HEIGHT - 10));
  const [width, height] = [EXPORT_WIDTH, Math.max(1, charts.length) * EXPORT_HEIGHT + 10];
  const { background } = app.theme;
  return {
    width,
    height,
    svg: () => svgDocument(width, height, background, shapesToSvg(shapes)),
    paint: (context, ratio) => {
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.fillStyle = background;
      context.fillRect(0, 0, width, height);
      paintShapes(context, shapes);
    },
  };
}

/** Figures of what robots broadcast. */
const OF_BROADCASTS = new Set(["n_sent", "n_deliveries", "mean_neighbours", "n_isolated"]);

/** The series view: a chart for each figure of the run. */
export class SeriesView implements ViewPanel {
  readonly root: HTMLElement;
  private readonly grid = element("div", { class: "charts" });
  private readonly note = element("div", { class: "empty" });
  private readonly charts = new Map<string, Chart>();
  private run = -1;

  constructor(private readonly app: App) {
    this.root = element("section", { class: "pane", "aria-label": "Series" }, this.grid, this.note);
  }

  render(): void {
    const { overview, overviewVersion } = currentRun(this.app);
    const { run } = this.app.store.state;
    if (run !== this.run) {
      this.run = run;
      this.charts.clear();
      this.grid.replaceChildren();
    }
    this.note.hidden = overview.series.length > 0;
    this.note.textContent = overviewVersion === 0 ? "Loading …" : "This run has no series yet.";
    // Of a network whose robots say nothing, what they hear is no figure.
    const sent = overview.series.find(({ name }) => name === "n_sent");
    const isSilent = sent?.value.every((value) => !(value > 0)) ?? false;
    for (const series of overview.series) {
      if (isSilent && OF_BROADCASTS.has(series.name)) continue;
      let chart = this.charts.get(series.name);
      if (chart === undefined) {
        chart = new Chart(this.app, [series.label], series.unit, "series");
        this.charts.set(series.name, chart);
        this.grid.append(chart.root);
      }
      const points = series.timeS.length;
      chart.show(`${run} ${points} ${series.timeS[points - 1]}`, () => ({ title: series.label, curves: [curve(series)] }));
    }
  }

  exported(): Exported {
    return exportedCharts(this.app, [...this.charts.values()]);
  }
}

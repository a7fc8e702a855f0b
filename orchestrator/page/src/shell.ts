import { type App, currentRun, type ViewPanel } from "./app.ts";
import { element, isTouch, selection } from "./dom.ts";
import { EventsPanel, robotNamed } from "./events.ts";
import { savePng, saveSvg } from "./export.ts";
import { helpDialog } from "./help.ts";
import type { MomentsBar } from "./moments.ts";
import { RobotPanel } from "./robot-panel.ts";
import type { SidePane, State, View } from "./store.ts";
import { TimeBar, type TimeActions } from "./time-bar.ts";

const VIEW_LABELS: Record<View, string> = { swarm: "Swarm", network: "Network", series: "Series", compare: "Compare", measurements: "Measurements" };
const SIDE_LABELS: Record<SidePane, string> = { robot: "Robot", events: "Events" };

/** The frame around the views: bar at the top, panel at the side, time bar. */
export class Shell {
  readonly root: HTMLElement;
  readonly events: EventsPanel;
  readonly help = helpDialog();
  readonly moments: MomentsBar;
  readonly find: HTMLInputElement;
  private readonly robot: RobotPanel;
  private readonly timeBar: TimeBar;
  private readonly main = element("main", {});
  private readonly side = element("div", { class: "side-body" });
  private readonly viewTabs = new Map<View, HTMLButtonElement>();
  private readonly sideTabs = new Map<SidePane, HTMLButtonElement>();
  private readonly title = element("span", { class: "run-name" });
  private readonly runChoice: HTMLSelectElement | null = null;

  constructor(
    private readonly app: App,
    readonly views: Map<View, ViewPanel>,
    actions: TimeActions,
  ) {
    const { store, source } = app;
    this.events = new EventsPanel(app);
    this.robot = new RobotPanel(app);
    this.timeBar = new TimeBar(app, actions);
    this.moments = this.timeBar.moments;
    const tabs = element("nav", { class: "tabs", "aria-label": "Views" });
    for (const view of views.keys()) {
      const tab = element("button", { type: "button", onclick: () => store.set({ view }) }, VIEW_LABELS[view]);
      this.viewTabs.set(view, tab);
      tabs.append(tab);
    }
    const header = element("header", {}, element("h1", {}, "Murmuration"), tabs, this.title);
    if (source.runs.length > 1) {
      const names = source.runs.map((run, i) => [String(i), `${"AB"[i] ?? i + 1}: ${run.run.name}, seed ${run.run.seed}`] as const);
      const choice = selection("Run", names, "0", (value) => store.set({ run: Number(value) }));
      this.runChoice = choice.select;
      header.append(choice.root);
    }
    header.append(element("span", { class: "spring" }), ...this.tools());
    this.find = element("input", {
      type: "search", placeholder: "Find: 3, or lost", "aria-label": "Find a robot by its number, or events by their text",
      oninput: () => this.findChanged(), onkeydown: (event) => this.findKey(event as KeyboardEvent),
    });
    const sideTabs = element("nav", { class: "tabs", "aria-label": "Side panel" });
    for (const pane of ["robot", "events"] as const) {
      const tab = element("button", { type: "button", onclick: () => store.set({ sidePane: pane }) }, SIDE_LABELS[pane]);
      this.sideTabs.set(pane, tab);
      sideTabs.append(tab);
    }
    const aside = element("aside", { "aria-label": "Details" }, this.find, sideTabs, this.side);
    this.root = element("div", { class: "shell" }, header, this.main, aside, this.timeBar.root, this.help);
  }

  /** The view that is shown. */
  get view(): ViewPanel | undefined {
    return this.views.get(this.app.store.state.view);
  }

  render(): void {
    const { state } = this.app.store;
    this.show(state);
    this.timeBar.render();
    if (state.sidePane === "robot") this.robot.render();
    else this.events.render();
    this.view?.render();
  }

  private show(state: State): void {
    const { view } = this;
    if (view !== undefined && this.main.firstChild !== view.root) this.main.replaceChildren(view.root);
    for (const [name, tab] of this.viewTabs) tab.setAttribute("aria-current", String(name === state.view));
    for (const [name, tab] of this.sideTabs) tab.setAttribute("aria-current", String(name === state.sidePane));
    const side = state.sidePane === "robot" ? this.robot.root : this.events.root;
    if (this.side.firstChild !== side) this.side.replaceChildren(side);
    const { run } = currentRun(this.app);
    const title = this.runChoice === null ? `${run.name}, seed ${run.seed}` : "";
    if (this.title.textContent !== title) this.title.textContent = title;
    if (this.runChoice !== null) this.runChoice.value = String(state.run);
  }

  private tools(): HTMLElement[] {
    const name = (): string => `${currentRun(this.app).run.name || "run"}-${this.app.store.state.view}-${(this.app.store.state.timeNs / 1e9).toFixed(2)}s`;
    const save = (write: typeof saveSvg) => () => {
      const exported = this.view?.exported() ?? null;
      if (exported !== null) write(exported, name());
    };
    return [
      element("button", { type: "button", title: "Save the view that is shown as an SVG file", onclick: save(saveSvg) }, "SVG"),
      element("button", { type: "button", title: "Save the view that is shown as a PNG file", onclick: save(savePng) }, "PNG"),
      element("button", {
        type: "button", title: "Switch between light and dark colours", "aria-label": "Light or dark",
        onclick: () => this.app.store.set({ theme: this.app.theme.dark ? "light" : "dark" }),
      }, "◐"),
      element("button", { type: "button", title: "Keys (?)", "aria-label": "Keys", onclick: () => this.help.showModal() }, "?"),
    ];
  }

  /** The number of a robot selects it; other text lists the events that contain it. */
  private findChanged(): void {
    const { store } = this.app;
    const text = this.find.value.trim();
    const robot = robotNamed(text);
    this.events.setFind(text);
    if (robot === null) {
      if (text !== "") store.set({ sidePane: "events" });
      return;
    }
    // The panel of the robot says so where there is no such robot.
    if (robot >= currentRun(this.app).run.agentCount) store.set({ sidePane: "robot" });
    this.app.select(robot, "show");
  }

  private findKey(event: KeyboardEvent): void {
    const robot = robotNamed(this.find.value);
    if (event.key === "Enter") {
      if (robot !== null) this.app.select(robot, "centre");
      // The keyboard of a phone gives way to the map.
      if (isTouch()) this.find.blur();
    }
    if (event.key === "Escape") this.find.blur();
    event.stopPropagation();
  }
}

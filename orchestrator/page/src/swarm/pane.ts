import { type App, currentRun, type Exported, type ViewPanel } from "../app.ts";
import { checkbox, element, selection, setText } from "../dom.ts";
import { wayActions } from "../network/way-panel.ts";
import { LINK_COLOURS, type LinkColour, ROBOT_COLOURS, type RobotColour } from "../store.ts";
import { SwarmView } from "./view.ts";

const ROBOT_LABELS: Record<RobotColour, string> = { group: "group", heard: "neighbours heard", queue: "queue length", rank: "rank" };
const LINK_LABELS: Record<LinkColour, string> = { delivery: "delivery", rssi: "RSSI", age: "age", none: "none" };

/** Choices of what the swarm views draw. */
export function swarmToolbar(app: App, refit: () => void): { root: HTMLElement; render(): void } {
  const { store } = app;
  const robots = selection("Robots", ROBOT_COLOURS.map((value) => [value, ROBOT_LABELS[value]] as const), "group",
    (value) => store.set({ robotColour: value as RobotColour }));
  const links = selection("Links", LINK_COLOURS.map((value) => [value, LINK_LABELS[value]] as const), "delivery",
    (value) => store.set({ linkColour: value as LinkColour }));
  const missed = checkbox("missed", "Show links that delivered within the last 5 s, but not in this period", (on) => store.set({ missed: on }));
  const trails = checkbox("trails", "Show where robots were in the last 10 s", (on) => store.set({ trails: on }));
  const ghosts = checkbox("ghosts", "Show where the selected robot last heard its neighbours to be", (on) => store.set({ ghosts: on }));
  const follow = checkbox("follow", "Keep the selected robot in the middle (O)", (on) => store.set({ follow: on }));
  const fit = element("button", { type: "button", title: "Fit everything into the view (F, or double-click)", onclick: refit }, "Fit");
  const way = wayActions(app);
  const followed = element("span", { class: "status" });
  const packet = element("span", { class: "field", hidden: true }, followed,
    element("button", { type: "button", title: "Previous hop ([)", "aria-label": "Previous hop", onclick: () => way.hop(-1) }, "◀\uFE0E"),
    element("button", { type: "button", title: "Next hop (])", "aria-label": "Next hop", onclick: () => way.hop(1) }, "▶\uFE0E"),
    element("button", { type: "button", title: "Stop following this packet (Esc)", onclick: () => way.clear() }, "clear"));
  return {
    root: element("div", { class: "toolbar", role: "toolbar", "aria-label": "What the swarm view draws" },
      robots.root, links.root, missed.root, trails.root, ghosts.root, follow.root, fit, packet),
    render() {
      const { state } = store;
      robots.select.value = state.robotColour;
      links.select.value = state.linkColour;
      missed.input.checked = state.missed;
      trails.input.checked = state.trails;
      ghosts.input.checked = state.ghosts;
      follow.input.checked = state.follow;
      packet.hidden = state.packet === null;
      if (state.packet !== null) setText(followed, app.follower.problem === "" ? `packet ${state.packet}` : `packet ${state.packet}: ${app.follower.problem}`);
    },
  };
}

/** The swarm view: the robots of the current run. */
export class SwarmPane implements ViewPanel {
  readonly root: HTMLElement;
  private readonly views: SwarmView[];
  private readonly toolbar: { root: HTMLElement; render(): void };

  constructor(private readonly app: App) {
    this.toolbar = swarmToolbar(app, () => this.view.refit());
    this.views = app.source.runs.map((run) => new SwarmView(app, run, ""));
    this.root = element("section", { class: "pane", "aria-label": "Swarm" }, this.toolbar.root, ...this.views.map((view) => view.root));
  }

  /** The view of the current run. */
  get view(): SwarmView {
    return this.views[this.app.source.runs.indexOf(currentRun(this.app))];
  }

  render(): void {
    this.toolbar.render();
    for (const view of this.views) view.root.hidden = view !== this.view;
    this.view.render();
  }

  exported(): Exported {
    return this.view.exported();
  }
}

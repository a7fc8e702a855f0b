import type { App, Exported, ViewPanel } from "../app.ts";
import { element } from "../dom.ts";
import type { NetworkPane as PaneName } from "../store.ts";
import { EnergyPanel } from "./energy.ts";
import { JoinPanel } from "./join.ts";
import { PacketsPanel } from "./packets.ts";
import type { NetworkPanel } from "./panel.ts";
import { SchedulePanel } from "./schedule.ts";
import { TreePanel } from "./tree.ts";

const LABELS: Record<PaneName, string> = {
  tree: "Routing tree", schedule: "Schedule", packets: "Packets", join: "Joining", energy: "Energy and queues",
};

/** The network view: one of its panes at a time. */
export class NetworkView implements ViewPanel {
  readonly root: HTMLElement;
  private readonly packets: PacketsPanel;
  private readonly schedule: SchedulePanel;
  private readonly panels: Record<PaneName, NetworkPanel>;
  private readonly tabs = new Map<PaneName, HTMLButtonElement>();
  private readonly body = element("div", { class: "panel-body" });

  constructor(private readonly app: App) {
    this.packets = new PacketsPanel(app);
    this.schedule = new SchedulePanel(app);
    this.panels = {
      tree: new TreePanel(app),
      schedule: this.schedule,
      packets: this.packets,
      join: new JoinPanel(app),
      energy: new EnergyPanel(app),
    };
    const bar = element("nav", { class: "tabs toolbar", "aria-label": "Panes of the network view" });
    for (const name of Object.keys(LABELS) as PaneName[]) {
      const tab = element("button", { type: "button", onclick: () => app.store.set({ networkPane: name }) }, LABELS[name]);
      this.tabs.set(name, tab);
      bar.append(tab);
    }
    this.root = element("section", { class: "pane", "aria-label": "Network" }, bar, this.body);
  }

  /** How many packets the filter of the packets pane lets through. */
  get packetsShown(): number {
    return this.packets.packetsShown;
  }

  /** What the schedule pane has marked: cells in which frames were sent, and in which they collided. */
  get scheduleDrawn(): { sent: number; collisions: number } {
    return this.schedule.drawn;
  }

  render(): void {
    const name = this.app.store.state.networkPane;
    for (const [tab, button] of this.tabs) button.setAttribute("aria-current", String(tab === name));
    const panel = this.panels[name];
    if (this.body.firstChild !== panel.root) this.body.replaceChildren(panel.root);
    panel.render();
  }

  exported(): Exported | null {
    return this.panels[this.app.store.state.networkPane].exported();
  }
}

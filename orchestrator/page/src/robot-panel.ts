import { type App, currentRun } from "./app.ts";
import { element } from "./dom.ts";
import { eventMark, goTo, isAbout } from "./events.ts";
import { ago, figure, seconds, unbroken } from "./format.ts";
import type { Event } from "./gen/murmuration/view/v1/view_pb.ts";
import type { FrameList } from "./source/frame-list.ts";
import { type FrameData, NO_MOTE } from "./source/frame.ts";
import { bit } from "./source/wire.ts";
import { exists, ghosts } from "./swarm/links.ts";
import type { Ghost } from "./swarm/picture.ts";

/** How many frames are searched for who heard the robot last. */
const SEARCH_FRAMES = 300;
/** While playing, the panel is written at most so often (ms). */
const REFRESH_MS = 200;

/** Details of the selected robot, or of the run if none is selected. */
export class RobotPanel {
  readonly root = element("div", { class: "robot" });
  private key = "";
  /** What the details of the run show; empty: they are not shown. */
  private shown = "";
  private writtenMs = 0;

  constructor(private readonly app: App) {}

  render(): void {
    const { state } = this.app.store;
    const data = currentRun(this.app);
    const index = data.ready(state.timeNs) ? data.frames.indexAt(state.timeNs) : -1;
    const step = index < 0 ? -1 : data.frames.step(index);
    const key = [state.selected, state.run, step, data.frames.generation, data.overviewVersion].join();
    const now = performance.now();
    if (key === this.key || (state.playing && now - this.writtenMs < REFRESH_MS)) return;
    this.key = key;
    this.writtenMs = now;
    const frame = index < 0 ? null : data.frames.frame(index);
    const { selected } = state;
    if (selected === null) {
      // Little of it changes from step to step, and writing it costs a layout and painting.
      const shown = [state.run, data.overviewVersion, frame?.held, frame?.taskComplete, ...(frame?.figures ?? []).map(({ value }) => figure(value))].join();
      if (this.root.childElementCount > 0 && shown === this.shown) return;
      this.shown = shown;
      this.root.replaceChildren(...this.aboutRun(frame));
      return;
    }
    this.shown = "";
    if (selected >= data.run.agentCount) {
      this.root.replaceChildren(empty(`There is no robot ${selected}: this run has robots 0 to ${data.run.agentCount - 1}.`));
    } else this.root.replaceChildren(...this.aboutRobot(selected, index, frame));
  }

  private aboutRun(frame: FrameData | null): HTMLElement[] {
    const { run, overview } = currentRun(this.app);
    const rows: [string, string][] = [
      ["Experiment", run.name || "without a name"],
      ["Seed", String(run.seed)],
      ["Robots", String(run.agentCount)],
      ["Control period", `${figure(Number(run.stepNs) / 1e6)} ms`],
    ];
    if (run.slotNs > 0n) rows.push(["TSCH slot", `${figure(Number(run.slotNs) / 1e6)} ms`]);
    if (run.channelCount > 0) rows.push(["Channels", String(run.channelCount)]);
    if (run.outcome !== "") rows.push(["Outcome", run.outcome]);
    for (const { name, value } of frame?.figures ?? []) rows.push([name, figure(value)]);
    const state = frame === null ? "" : frame.held ? "Robots stand still while the network forms." : frame.taskComplete ? "The task is done." : "";
    const important = overview.events.filter((event) => event.agent === undefined).slice(0, 12);
    return [
      element("h2", {}, "Run"),
      facts(rows),
      ...(state === "" ? [] : [element("p", { class: "note" }, state)]),
      empty("Click a robot, or type its number into the find box, to see its details."),
      ...(important.length === 0 ? [] : [element("h3", {}, "Important events"), ...this.eventRows(important)]),
    ];
  }

  private aboutRobot(agent: number, index: number, frame: FrameData | null): HTMLElement[] {
    const data = currentRun(this.app);
    const head = element("h2", {}, `Robot ${agent}`);
    const events = data.overview.events.filter((event) => isAbout(event, agent));
    if (frame === null) return [head, empty("Loading frames …")];
    const found: Ghost[] = [];
    ghosts(data.frames, index, agent, found);
    return [
      head,
      facts(this.robotFacts(agent, frame)),
      element("h3", {}, "Last heard by"),
      lastHeardBy(data.frames, index, agent),
      element("h3", {}, "Hears"),
      heardTable(found, (neighbour) => this.app.select(neighbour)),
      element("h3", {}, "Events"),
      ...(events.length === 0 ? [empty("Nothing happened to this robot.")] : this.eventRows(around(events, frame.timeNs))),
    ];
  }

  private robotFacts(agent: number, frame: FrameData): [string, string][] {
    const { run } = currentRun(this.app);
    const alive = exists(frame, agent);
    const rows: [string, string][] = [["State", alive ? "working" : "lost; its last position is shown"]];
    let first = 0;
    for (const group of run.groups) {
      if (agent >= first && agent < first + group.count) rows.push(["Group", group.name]);
      first += group.count;
    }
    rows.push(["Position", `(${frame.x[agent].toFixed(2)}, ${frame.y[agent].toFixed(2)}) m`]);
    if (frame.heading.length > 0) rows.push(["Heading", degrees(frame.heading[agent])]);
    if (frame.nSent.length > 0) rows.push(["Frames sent", `${frame.nSent[agent]} in the period`]);
    const { motes } = frame;
    if (motes !== null) {
      if (motes.alive.length > 0) rows.push(["Radio", bit(motes.alive, agent) ? "works" : "failed"]);
      const membership = [
        motes.synced.length > 0 ? (bit(motes.synced, agent) ? "synchronised" : "not synchronised") : "",
        motes.joined.length > 0 ? (bit(motes.joined, agent) ? "joined" : "not joined") : "",
      ].filter((text) => text !== "");
      if (membership.length > 0) rows.push(["Network", membership.join(", ")]);
      if (motes.parent.length > 0) rows.push(["Parent", motes.parent[agent] === NO_MOTE ? "none" : String(motes.parent[agent])]);
      if (motes.rank.length > 0) rows.push(["Rank", motes.rank[agent] >= 0xffff ? "infinite" : String(motes.rank[agent])]);
      if (motes.queueLength.length > 0) rows.push(["Packets queued", String(motes.queueLength[agent])]);
    }
    const missing = frame.formation?.missing.indexOf(agent) ?? -1;
    if (frame.formation !== null && missing >= 0) rows.push(["Lacks", frame.formation.reasons[frame.formation.reason[missing]]]);
    return rows;
  }

  private eventRows(events: Event[]): HTMLElement[] {
    return events.map((event) =>
      element("button", { type: "button", class: "event", title: event.text, onclick: () => goTo(this.app, event) },
        eventMark(event.kind),
        element("span", { class: "time" }, seconds(Number(event.timeNs))),
        element("span", { class: "words" }, event.text)));
  }
}

/** The last ten events before a time and the first five after it. */
function around(events: Event[], timeNs: number): Event[] {
  const next = events.findIndex((event) => Number(event.timeNs) > timeNs);
  const middle = next < 0 ? events.length : next;
  return events.slice(Math.max(0, middle - 10), middle + 5);
}

/** A heading in degrees from east towards north. */
function degrees(headingRad: number): string {
  const turn = ((headingRad * 180) / Math.PI) % 360;
  return `${Math.round(turn < 0 ? turn + 360 : turn)}°`;
}

function facts(rows: [string, string][]): HTMLElement {
  const list = element("dl", { class: "facts" });
  for (const [term, value] of rows) list.append(element("dt", {}, term), element("dd", {}, unbroken(value)));
  return list;
}

function empty(text: string): HTMLElement {
  return element("p", { class: "note" }, text);
}

/** The robots that heard a robot last, and when. */
function lastHeardBy(frames: FrameList, index: number, agent: number): HTMLElement {
  const now = frames.timeNs(index);
  for (let i = index; i >= Math.max(0, index - SEARCH_FRAMES); i--) {
    const { links, timeNs } = frames.frame(i);
    const receivers: number[] = [];
    for (let k = 0; k < links.sender.length; k++) if (links.sender[k] === agent) receivers.push(links.receiver[k]);
    if (receivers.length === 0) continue;
    const who = receivers.length > 12 ? `${receivers.slice(0, 12).join(", ")} and ${receivers.length - 12} more` : receivers.join(", ");
    const when = timeNs === now ? "in this period" : `${ago(timeNs, now)} ago, at ${seconds(timeNs)}`;
    return element("p", {}, `${receivers.length === 1 ? "Robot" : "Robots"} ${who}, ${when}.`);
  }
  const searched = ago(frames.timeNs(Math.max(0, index - SEARCH_FRAMES)), now);
  return empty(`Nobody heard it in the last ${searched} that are loaded.`);
}

function heardTable(found: Ghost[], select: (neighbour: number) => void): HTMLElement {
  if (found.length === 0) return empty("It heard nobody in the last 10 s.");
  const body = element("tbody");
  for (const ghost of found.slice(0, 40)) {
    body.append(element("tr", {},
      element("td", {}, element("button", { type: "button", class: "link", onclick: () => select(ghost.neighbour) }, String(ghost.neighbour))),
      element("td", {}, `${(ghost.agoNs / 1e9).toFixed(2)} s`),
      element("td", {}, ghost.errorM.toFixed(2)),
      element("td", {}, Number.isNaN(ghost.rssiDbm) ? "–" : ghost.rssiDbm.toFixed(0))));
  }
  const titles = ["Robot", "Heard ago", "Error (m)", "RSSI (dBm)"].map((title) => element("th", { scope: "col" }, title));
  return element("table", {}, element("thead", {}, element("tr", {}, ...titles)), body);
}

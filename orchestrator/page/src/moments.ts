import { type App, currentRun } from "./app.ts";
import { element, setText } from "./dom.ts";
import { EVENT_STYLES } from "./event-kinds.ts";
import { eventMark } from "./events.ts";
import { EventKind, type Overview } from "./gen/murmuration/view/v1/view_pb.ts";

/** A moment that a count goes to. */
interface Moment {
  timeNs: number;
  /** The robot that it happened to. */
  agent: number | undefined;
  /** The packet that was lost then. */
  packet: number | undefined;
}

/** All moments of a kind, in the order of time. */
export interface Moments {
  /** What a report around the page calls them: the kind of event in lower-case letters, or "dropped". */
  name: string;
  kind: EventKind;
  /** What one is called, and several; several are never counted where this is "". */
  one: string;
  many: string;
  at: Moment[];
}

/** In this order, what may have gone wrong first. */
const ORDER = [
  EventKind.COLLISION, EventKind.SITE_COLLISION, EventKind.DEATH, EventKind.UNSPECIFIED, EventKind.ISOLATED, EventKind.LEAVE, EventKind.ORDER,
  EventKind.BIRTH, EventKind.FORMED, EventKind.TASK, EventKind.JOIN, EventKind.PARENT, EventKind.REACHED,
];

/** What can be counted in a run and has happened in it at least once. Packets that were dropped stand for events of no kind. */
export function momentsOf(overview: Overview): Moments[] {
  const found = new Map<EventKind, Moment[]>(ORDER.map((kind) => [kind, []]));
  for (const { kind, timeNs, agent } of overview.events) found.get(kind)?.push({ timeNs: Number(timeNs), agent, packet: undefined });
  const { packets } = overview;
  const dropped = found.get(EventKind.UNSPECIFIED) as Moment[];
  packets?.outcome.forEach((outcome, i) => {
    if (outcome !== 0) dropped.push({ timeNs: Number(packets.endedNs[i]), agent: packets.source[i], packet: Number(packets.id[i]) });
  });
  dropped.sort((a, b) => a.timeNs - b.timeNs);
  return [...found].filter(([, at]) => at.length > 0).map(([kind, at]) => {
    const style = EVENT_STYLES.get(kind);
    const name = kind === EventKind.UNSPECIFIED ? "dropped" : EventKind[kind].toLowerCase();
    return { name, kind, one: style?.one ?? "dropped packet", many: style?.many ?? "dropped packets", at };
  });
}

/** "73 collisions", "2 of 73 collisions"; without a number what happens only once. */
export function countWords({ one, many, at }: Moments, index: number): string {
  if (many === "" && at.length === 1) return one;
  const words = at.length === 1 ? one : many === "" ? one : many;
  return index < 0 ? `${at.length} ${words}` : `${index + 1} of ${at.length} ${words}`;
}

/** Goes to a moment, and shows the robot and the packet that it is about. */
function goToMoment(app: App, { timeNs, agent, packet }: Moment): void {
  app.store.set({ playing: false });
  app.seek(timeNs);
  if (agent !== undefined) app.select(agent, "show");
  if (packet !== undefined) app.store.set({ packet });
}

/** A button for each kind of moment with their number: it goes to the first of them, and then from one to the next. */
export class MomentsBar {
  readonly root = element("div", { class: "counts", role: "group", "aria-label": "What happened how often" });
  private readonly buttons = new Map<string, { root: HTMLButtonElement; text: HTMLElement; moments: Moments; index: number }>();
  private key = "";

  constructor(private readonly app: App) {}

  render(): void {
    const { overview, overviewVersion } = currentRun(this.app);
    const { run } = this.app.store.state;
    const key = `${run} ${overviewVersion}`;
    if (key === this.key) return;
    if (!this.key.startsWith(`${run} `)) this.buttons.clear();
    this.key = key;
    const all = momentsOf(overview);
    for (const moments of all) {
      const known = this.buttons.get(moments.name);
      if (known === undefined) this.buttons.set(moments.name, this.button(moments));
      else known.moments = moments;
      this.name(moments.name);
    }
    const roots = all.map(({ name }) => (this.buttons.get(name) as { root: HTMLElement }).root);
    // Those that are there stay, since one of them may have the focus.
    if (roots.length !== this.root.childElementCount || roots.some((root, i) => root !== this.root.children[i])) this.root.replaceChildren(...roots);
    this.root.hidden = roots.length === 0;
  }

  /** Goes to the next moment of a kind, or the one before; false: there is none. */
  jump(name: string, direction: 1 | -1 = 1): boolean {
    const button = this.buttons.get(name);
    if (button === undefined) return false;
    const { length } = button.moments.at;
    button.index = button.index < 0 && direction < 0 ? length - 1 : (button.index + direction + length) % length;
    goToMoment(this.app, button.moments.at[button.index]);
    this.name(name);
    return true;
  }

  private name(name: string): void {
    const button = this.buttons.get(name);
    if (button !== undefined) setText(button.text, countWords(button.moments, button.index));
  }

  private button(moments: Moments): { root: HTMLButtonElement; text: HTMLElement; moments: Moments; index: number } {
    const text = element("span", {});
    const root = element("button", {
      type: "button", class: "chip", title: "Go to the first of them; press again for the next (Shift: the one before)",
      onclick: (event) => this.jump(moments.name, (event as MouseEvent).shiftKey ? -1 : 1),
    }, eventMark(moments.kind), text);
    return { root, text, moments, index: -1 };
  }
}

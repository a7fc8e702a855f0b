import { type App, currentRun } from "./app.ts";
import { element, setText } from "./dom.ts";
import { drawEventMark, EVENT_STYLES, eventStyle } from "./event-kinds.ts";
import { seconds } from "./format.ts";
import type { Event, EventKind } from "./gen/murmuration/view/v1/view_pb.ts";
import { VirtualList } from "./virtual-list.ts";

/** Whether an event is about a robot: it happened to it, or its text names it. */
export function isAbout(event: Event, agent: number): boolean {
  return event.agent === agent || new RegExp(`\\b(robot|mote|agent)s? ${agent}\\b`).test(event.text);
}

/** The robot that a text in the find box means: "3", "robot 3", "mote 3"; null: none. */
export function robotNamed(text: string): number | null {
  const [, number] = /^(?:(?:robot|mote|agent)\s*)?(\d+)$/i.exec(text.trim()) ?? [];
  return number === undefined ? null : Number(number);
}

/** Events of the run by time, filtered by kind and by what the find box holds. */
export class EventsPanel {
  readonly root: HTMLElement;
  private readonly list: VirtualList<Event>;
  /** Where no event is shown, why. */
  private readonly none = element("div", { class: "note" });
  private readonly count = element("button", {
    type: "button", class: "link", title: "Go to the first of them; press again for the next (Shift: the one before)",
    onclick: (event) => this.step((event as MouseEvent).shiftKey ? -1 : 1),
  });
  /** The event that the count has gone to; -1: none. */
  private index = -1;
  private readonly hiddenKinds = new Set<EventKind>();
  private readonly chips = element("div", { class: "chips" });
  private readonly chipOf = new Map<EventKind, HTMLElement>();
  private shown: Event[] = [];
  private find = "";
  /** How many events are shown of how many. */
  private about = "";
  private key = "";

  constructor(private readonly app: App) {
    this.list = new VirtualList("Events", 26, (event) => this.row(event));
    this.root = element("div", { class: "events" }, this.chips, element("div", {}, this.count, this.none), this.list.root);
    for (const [kind, style] of EVENT_STYLES) {
      const chip = element("button", {
        type: "button", class: "chip", "aria-pressed": "true", title: `Show or hide events of the kind "${style.label}"`,
        onclick: () => {
          if (!this.hiddenKinds.delete(kind)) this.hiddenKinds.add(kind);
          chip.setAttribute("aria-pressed", String(!this.hiddenKinds.has(kind)));
          this.render();
        },
      }, eventMark(kind), style.label);
      this.chips.append(chip);
      this.chipOf.set(kind, chip);
    }
  }

  /** Shows events about a robot, or those that contain a text. */
  setFind(find: string): void {
    this.find = find.trim();
    this.render();
  }

  get eventsShown(): number {
    return this.shown.length;
  }

  render(): void {
    const data = currentRun(this.app);
    const key = [this.app.store.state.run, data.overviewVersion, this.find, ...this.hiddenKinds].join();
    if (key !== this.key) {
      this.key = key;
      this.filter(data.overview.events);
    }
  }

  private filter(events: Event[]): void {
    const number = robotNamed(this.find);
    const text = this.find.toLowerCase();
    this.shown = events.filter((event) => {
      if (this.hiddenKinds.has(event.kind)) return false;
      if (number !== null) return isAbout(event, number);
      return text === "" || event.text.toLowerCase().includes(text);
    });
    const about = number === null ? "" : ` about robot ${number}`;
    const none = events.length === 0 && this.find === "" ? "Nothing has happened yet in this run." : `No event${about} matches. Clear the find box, or show more kinds.`;
    const kinds = new Set(events.map((event) => event.kind));
    for (const [kind, chip] of this.chipOf) chip.hidden = !kinds.has(kind);
    this.index = -1;
    setText(this.none, this.shown.length === 0 ? none : "");
    this.count.hidden = this.shown.length === 0;
    this.about = `${this.shown.length} of ${events.length} events${about}`;
    setText(this.count, this.about);
    this.list.show(this.shown);
    const next = this.shown.findIndex((event) => Number(event.timeNs) >= this.app.store.state.timeNs);
    if (next > 0) this.list.reveal(next);
  }

  /** Goes to the next event that is shown, or the one before. */
  private step(direction: 1 | -1): void {
    const { length } = this.shown;
    this.index = this.index < 0 && direction < 0 ? length - 1 : (this.index + direction + length) % length;
    this.app.store.set({ playing: false });
    goTo(this.app, this.shown[this.index]);
    this.list.reveal(this.index);
    setText(this.count, `${this.about}: number ${this.index + 1}`);
  }

  private row(event: Event): HTMLElement {
    return element("div", { class: "row", role: "listitem" },
      element("button", { type: "button", class: "event", title: event.text, onclick: () => goTo(this.app, event) },
        eventMark(event.kind),
        element("span", { class: "time" }, seconds(Number(event.timeNs))),
        element("span", { class: "words" }, event.text)));
  }
}

/** Goes to an event's time and shows the robot that it happened to. */
export function goTo(app: App, event: Event): void {
  app.seek(Number(event.timeNs));
  if (event.agent !== undefined) app.select(event.agent, "show");
}

/** The mark of a kind of event as a small picture. */
export function eventMark(kind: EventKind): HTMLCanvasElement {
  const canvas = element("canvas", { class: "mark", width: 24, height: 24, "aria-hidden": "true" });
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  context.scale(2, 2);
  drawEventMark(context, eventStyle(kind), 6, 6, 4.5);
  return canvas;
}

import { type App, currentRun, type Exported } from "../app.ts";
import { element, selection, setText } from "../dom.ts";
import { seconds } from "../format.ts";
import type { Packets } from "../gen/cosim/v1/netsim_pb.ts";
import type { Shape } from "../sketch.ts";
import { SketchCanvas, type Target } from "../sketch-canvas.ts";
import { NO_MOTE } from "../source/frame.ts";
import { OKABE_ITO } from "../swarm/colours.ts";
import { VirtualList } from "../virtual-list.ts";
import { type NetworkPanel, Redraw } from "./panel.ts";
import { WayPanel } from "./way-panel.ts";

/** Whatever the filter, the list holds at most so many packets. */
const MOST_ROWS = 20000;

interface Filter {
  kind: string;
  outcome: string;
  source: string;
  destination: string;
  text: string;
}

/** Packets that ended, filtered, and how many were dropped for which reason until now. */
export class PacketsPanel implements NetworkPanel {
  readonly root: HTMLElement;
  private readonly list: VirtualList<number>;
  private readonly count = element("button", {
    type: "button", class: "link", title: "Follow the first of them; press again for the next (Shift: the one before)",
    onclick: (event) => this.step((event as MouseEvent).shiftKey ? -1 : 1),
  });
  /** The packet that the count has gone to; -1: none. */
  private index = -1;
  /** How many packets are listed. */
  private words = "";
  private readonly drops: SketchCanvas;
  private readonly way: WayPanel;
  private readonly kinds: HTMLSelectElement;
  private readonly outcomes: HTMLSelectElement;
  private readonly note = element("div", { class: "empty" });
  private readonly redraw: Redraw;
  private filtered = "";
  private found: number[] = [];
  private readonly filter: Filter = { kind: "", outcome: "", source: "", destination: "", text: "" };
  private packets: Packets | undefined;
  private key = "";

  constructor(private readonly app: App) {
    this.redraw = new Redraw(app);
    this.drops = new SketchCanvas(app, "Packets dropped until now, by reason");
    this.way = new WayPanel(app);
    this.list = new VirtualList("Packets", 24, (packet) => this.row(packet));
    const kinds = selection("Kind", [["", "all"]], "", (value) => (this.filter.kind = value));
    const outcomes = selection("Outcome", [["", "all"]], "", (value) => (this.filter.outcome = value));
    this.kinds = kinds.select;
    this.outcomes = outcomes.select;
    const input = (label: string, name: "source" | "destination" | "text", hint: string): HTMLElement => {
      const box = element("input", { type: "text", class: name === "text" ? "" : "short", placeholder: hint, oninput: () => (this.filter[name] = box.value.trim()) });
      return element("label", { class: "field" }, label, box);
    };
    const bar = element("div", { class: "toolbar" }, kinds.root, outcomes.root,
      input("From", "source", "mote"), input("To", "destination", "mote"), input("Contains", "text", "text"), this.count);
    const titles = ["ended", "kind", "from", "to", "hops", "latency", "bytes", "outcome"].map((title) => element("span", {}, title));
    this.root = element("div", { class: "panel packets" }, bar, this.drops.root, this.way.root, element("div", { class: "packet head" }, ...titles), this.list.root, this.note);
  }

  get packetsShown(): number {
    return this.list.length;
  }

  render(): void {
    const { overview, overviewVersion } = currentRun(this.app);
    const { packets } = overview;
    const some = packets !== undefined && packets.id.length > 0;
    this.note.hidden = some;
    for (const child of this.root.children) if (child !== this.note) (child as HTMLElement).hidden = !some;
    this.note.textContent = "This network has no packets of its own: run with netsim.mode = \"6tisch\" and [[netsim.app]] to see some.";
    if (!some) return;
    const { state } = this.app.store;
    const followed = this.way.render();
    this.drops.root.hidden = followed;
    const filter = [state.run, ...Object.values(this.filter)].join();
    const key = [filter, overviewVersion, packets.id.length].join();
    if (key !== this.key) {
      this.key = key;
      this.packets = packets;
      this.offer(packets);
      this.select(packets, Number(overview.packetsLeftOut));
      // Another choice begins with what ends next.
      if (filter !== this.filtered) this.reveal(packets, state.timeNs);
      this.filtered = filter;
    }
    const { width } = this.drops.room;
    if ((width > 0 || followed) && this.redraw.due(state.timeNs, overviewVersion, width, state.packet)) {
      if (width > 0) this.drawDrops(packets, width);
      this.list.refresh();
    }
  }

  exported(): Exported {
    return this.app.store.state.packet === null ? this.drops.exported() : this.way.exported();
  }

  private reveal(packets: Packets, timeNs: number): void {
    this.list.reveal(Math.max(0, this.found.findIndex((i) => Number(packets.endedNs[i]) >= timeNs)));
  }

  private offer(packets: Packets): void {
    const fill = (select: HTMLSelectElement, options: [string, string][]): void => {
      if (select.options.length === options.length) return;
      const { value } = select;
      select.replaceChildren(...options.map(([option, text]) => element("option", { value: option }, text)));
      select.value = value;
    };
    fill(this.kinds, [["", "all"], ...packets.kinds.map((kind, i): [string, string] => [String(i), kind.name])]);
    fill(this.outcomes, [["", "all"], ["0", "delivered"], ["dropped", "dropped"],
      ...packets.reasons.map((reason, i): [string, string] => [String(i + 1), `dropped: ${reason}`])]);
  }

  private select(packets: Packets, leftOut: number): void {
    const { kind, outcome, source, destination, text } = this.filter;
    const found: number[] = [];
    for (let i = 0; i < packets.id.length; i++) {
      if (kind !== "" && packets.kind[i] !== Number(kind)) continue;
      if (outcome === "dropped" ? packets.outcome[i] === 0 : outcome !== "" && packets.outcome[i] !== Number(outcome)) continue;
      if (source !== "" && String(packets.source[i]) !== source) continue;
      if (destination !== "" && moteName(packets.destination[i]) !== destination) continue;
      if (text !== "" && !this.columns(packets, i).join(" ").includes(text)) continue;
      found.push(i);
      if (found.length >= MOST_ROWS) break;
    }
    this.found = found;
    this.list.show(found);
    const next = found.findIndex((i) => Number(packets.endedNs[i]) > this.app.store.state.timeNs);
    if (next > 0) this.list.reveal(next);
    const limited = found.length >= MOST_ROWS ? ", the first of more: narrow the filter" : "";
    const missing = leftOut > 0 ? `; ${leftOut} more ended and are not listed` : "";
    this.index = -1;
    this.words = `${found.length} of ${packets.id.length} packets${limited}${missing}`;
    setText(this.count, this.words);
  }

  /** Follows the next packet of the list, or the one before. */
  private step(direction: 1 | -1): void {
    const { length } = this.found;
    if (this.packets === undefined || length === 0) return;
    this.index = this.index < 0 && direction < 0 ? length - 1 : (this.index + direction + length) % length;
    this.app.store.set({ playing: false });
    this.show(this.packets, this.found[this.index]);
    this.list.reveal(this.index);
    setText(this.count, `${this.words}: number ${this.index + 1}`);
  }

  private columns(packets: Packets, i: number): string[] {
    return [
      seconds(Number(packets.endedNs[i]), 3),
      packets.kinds[packets.kind[i]]?.name ?? "?",
      String(packets.source[i]),
      moteName(packets.destination[i]),
      String(packets.hops[i]),
      `${(Number(packets.endedNs[i] - packets.createdNs[i]) / 1e6).toFixed(0)} ms`,
      String(packets.payloadBytes[i]),
      packets.outcome[i] === 0 ? "delivered" : `dropped: ${packets.reasons[packets.outcome[i] - 1] ?? "?"}`,
    ];
  }

  private row(i: number): HTMLElement {
    const packets = this.packets as Packets;
    const later = Number(packets.endedNs[i]) > this.app.store.state.timeNs;
    const cells = this.columns(packets, i).map((text) => element("span", {}, text));
    const classes = `event packet${later ? " later" : ""}${packets.outcome[i] === 0 ? "" : " dropped"}`;
    return element("div", { class: "row", role: "listitem" },
      element("button", {
        type: "button", class: classes, title: "Follow this packet hop by hop", "aria-current": Number(packets.id[i]) === this.app.store.state.packet,
        onclick: () => this.show(packets, i),
      }, ...cells));
  }

  /** Follows a packet, goes to where it ended and selects both of its ends. */
  private show(packets: Packets, i: number): void {
    this.app.seek(Number(packets.endedNs[i]));
    this.app.select(packets.source[i]);
    this.app.store.set({ packet: Number(packets.id[i]) });
    if (packets.destination[i] !== NO_MOTE) this.app.store.set({ peer: packets.destination[i] });
  }

  private drawDrops(packets: Packets, width: number): void {
    const { theme, store } = this.app;
    const counts = new Array<number>(packets.reasons.length).fill(0);
    let delivered = 0;
    for (let i = 0; i < packets.id.length; i++) {
      if (Number(packets.endedNs[i]) > store.state.timeNs) continue;
      if (packets.outcome[i] === 0) delivered++;
      else counts[packets.outcome[i] - 1]++;
    }
    const total = Math.max(1, ...counts);
    const shapes: Shape[] = [];
    const title = `dropped until now, by reason (${delivered} delivered)`;
    shapes.push({ kind: "text", x: 10, y: 12, text: title, fill: theme.faintText });
    const targets: Target[] = [];
    const some = counts.map((count, i) => ({ count, reason: packets.reasons[i], outcome: String(i + 1) })).filter(({ count }) => count > 0);
    some.forEach(({ count, reason, outcome }, i) => {
      const y = 24 + i * 18;
      targets.push({ x: 0, y, w: width, h: 18, agent: null, text: `Show the ${count} dropped packets: ${reason}`, act: () => this.choose(outcome) });
      shapes.push({ kind: "text", x: 130, y: y + 7, text: reason, fill: theme.text, anchor: "end" });
      shapes.push({ kind: "rect", x: 138, y, w: Math.max(1, ((width - 220) * count) / total), h: 13, fill: OKABE_ITO.vermilion });
      shapes.push({ kind: "text", x: 144 + ((width - 220) * count) / total, y: y + 7, text: String(count), fill: theme.text });
    });
    if (some.length === 0) shapes.push({ kind: "text", x: 10, y: 31, text: "none", fill: theme.text });
    this.drops.show(shapes, width, 28 + Math.max(1, some.length) * 18, targets);
  }

  /** Lists the packets of an outcome. */
  private choose(outcome: string): void {
    this.outcomes.value = outcome;
    this.filter.outcome = outcome;
  }
}

function moteName(mote: number): string {
  return mote === NO_MOTE ? "all" : String(mote);
}

import { type App, currentRun, type Exported } from "../app.ts";
import { element, setText } from "../dom.ts";
import { figure, niceStep, seconds } from "../format.ts";
import type { Shape } from "../sketch.ts";
import { SketchCanvas, type Target } from "../sketch-canvas.ts";
import { NO_MOTE } from "../source/frame.ts";
import { OKABE_ITO } from "../swarm/colours.ts";
import { Redraw } from "./panel.ts";
import type { Hop, Way } from "./way.ts";

/** Hops that the chart has room for before it scrolls. */
const CHART_HOPS = 8;
const ROW_PX = 22;
const LEFT = 96;
const RIGHT = 84;

/** A duration for people. */
function ms(ns: number): string {
  if (ns >= 10e9) return `${figure(ns / 1e9)} s`;
  return `${figure(+(ns / 1e6).toPrecision(5))} ms`;
}

/** What keys and buttons do to the way of a packet. */
export interface WayActions {
  /** Goes to the first frame of the next or previous hop; false if no packet is followed. */
  hop(direction: 1 | -1): boolean;
  /** Follows no packet any more; false if none was followed. */
  clear(): boolean;
}

export function wayActions(app: App): WayActions {
  return {
    hop(direction) {
      const { way } = app.follower;
      if (way === null) return false;
      const { timeNs } = app.store.state;
      const next = direction === 1 ? way.hops.find((hop) => hop.firstNs > timeNs) : way.hops.findLast((hop) => hop.firstNs < timeNs);
      if (next !== undefined) goToFrame(app, next.firstNs, next.sender);
      return true;
    },
    clear() {
      if (app.store.state.packet === null) return false;
      app.store.set({ packet: null });
      return true;
    },
  };
}

function goToFrame(app: App, timeNs: number, sender: number): void {
  app.store.set({ playing: false });
  app.seek(timeNs);
  app.select(sender);
}

/** The way of the followed packet: where its latency comes from, and each of its frames. */
export class WayPanel {
  readonly root: HTMLElement;
  private readonly title = element("h2", {});
  private readonly words = element("p", { class: "note" });
  private readonly sketch: SketchCanvas;
  private readonly body = element("tbody");
  private readonly table: HTMLElement;
  private readonly steps: HTMLButtonElement[];
  private readonly redraw: Redraw;
  private version = -1;
  private rows: { row: HTMLElement; sentNs: number }[] = [];

  constructor(private readonly app: App) {
    this.redraw = new Redraw(app);
    const actions = wayActions(app);
    this.sketch = new SketchCanvas(app, "Latency of the packet by hop");
    const button = (text: string, title: string, onclick: () => void): HTMLButtonElement => element("button", { type: "button", title, onclick }, text);
    this.steps = [
      button("◀\uFE0E previous hop", "Go to the first frame of the previous hop ([)", () => actions.hop(-1)),
      button("next hop ▶\uFE0E", "Go to the first frame of the next hop (])", () => actions.hop(1)),
    ];
    const onMap = button("on the map", "Show the way over the robots", () => app.store.set({ view: "swarm" }));
    const clear = button("clear", "Stop following this packet (Esc)", () => actions.clear());
    const titles = ["time", "sender → receiver", "channel", "attempt", "outcome"].map((title) => element("th", { scope: "col" }, title));
    this.table = element("div", { class: "way-table", tabindex: 0, "aria-label": "Frames of the packet" },
      element("table", {}, element("thead", {}, element("tr", {}, ...titles)), this.body));
    this.root = element("section", { class: "way", "aria-label": "Way of a packet", hidden: true },
      element("div", { class: "way-head" }, this.title, element("span", { class: "spring" }), ...this.steps, onMap, clear), this.words, this.sketch.root, this.table);
  }

  /** Draws the way; false if no packet is followed. */
  render(): boolean {
    const { follower, store } = this.app;
    const { packet, timeNs } = store.state;
    this.root.hidden = packet === null;
    if (packet === null) return false;
    const { way } = follower;
    if (follower.version !== this.version) {
      this.version = follower.version;
      this.describe(packet, way);
    }
    this.sketch.root.hidden = this.table.hidden = way === null;
    for (const step of this.steps) step.disabled = way === null || way.hops.length === 0;
    if (way === null) return true;
    const current = this.rows.findLast(({ sentNs }) => sentNs <= timeNs);
    for (const row of this.rows) row.row.setAttribute("aria-current", String(row === current));
    const { width } = this.sketch.room;
    if (width > 0 && this.redraw.due(this.version, timeNs, width)) this.draw(way, width);
    return true;
  }

  exported(): Exported {
    return this.sketch.exported();
  }

  private describe(id: number, way: Way | null): void {
    if (way === null) {
      setText(this.title, `Packet ${id}`);
      setText(this.words, this.app.follower.problem);
      this.body.replaceChildren();
      this.rows = [];
      return;
    }
    const { packet, frames, hops } = way;
    const ends = `${packet.source} → ${packet.destination === NO_MOTE ? "all" : packet.destination}`;
    setText(this.title, `Packet ${id}: ${packet.kind} ${ends}`);
    setText(this.words, `${latencyInWords(way)} ${endInWords(way)}${way.incomplete ? " Frames may be missing: the recording leaves some out where a step of the page covers several." : ""}`);
    const slotNs = Number(currentRun(this.app).run.slotNs);
    const hopOf = new Map(hops.flatMap((hop, i) => hop.frames.map((frame) => [frame, i + 1] as const)));
    this.rows = frames.map((frame) => {
      const to = frame.destination === NO_MOTE ? `all (${frame.nReceived} received it)` : String(frame.destination);
      const button = element("button", {
        type: "button", class: "link", title: "Go to this time and select the sender", onclick: () => goToFrame(this.app, frame.sentNs, frame.sender),
      }, seconds(frame.sentNs, 3));
      const offset = frame.channelOffset === NO_MOTE ? "" : ` (offset ${frame.channelOffset})`;
      const asn = slotNs > 0 ? `slot ${Math.floor(frame.sentNs / slotNs)} of the network; ` : "";
      const row = element("tr", {
        class: frame.outcome === "acknowledged" || frame.outcome === "sent" ? "" : "failed", title: `${asn}${frame.kind}, ${frame.lengthBytes} bytes`,
        onclick: () => goToFrame(this.app, frame.sentNs, frame.sender),
      },
        element("td", {}, button), element("td", {}, `${hopOf.get(frame)}. ${frame.sender} → ${to}`), element("td", {}, `${frame.channel}${offset}`),
        element("td", {}, String(frame.attempt)), element("td", {}, frame.outcome === "sent" ? "sent to all" : frame.outcome));
      return { row, sentNs: frame.sentNs };
    });
    this.body.replaceChildren(...this.rows.map(({ row }) => row));
  }

  private draw(way: Way, width: number): void {
    const { theme, store } = this.app;
    const { createdNs, endedNs } = way.packet;
    const span = Math.max(1, endedNs - createdNs, ...way.hops.map((hop) => hop.frames[hop.frames.length - 1].sentNs - createdNs));
    const right = width - RIGHT;
    const x = (timeNs: number): number => LEFT + ((right - LEFT) * (timeNs - createdNs)) / span;
    const shapes: Shape[] = [];
    const targets: Target[] = [];
    const label = { kind: "text", fill: theme.faintText, size: 11 } as const;
    const [waiting, again, sent] = [theme.dark ? "#4a535d" : "#c3cad2", OKABE_ITO.vermilion, theme.dark ? OKABE_ITO.sky : OKABE_ITO.blue];
    let legendX = LEFT;
    for (const [fill, text] of [[waiting, "waiting in the queue and for a slot"], [again, "retransmissions"], [sent, "frame on the air"]] as const) {
      shapes.push({ kind: "rect", x: legendX, y: 6, w: 10, h: 10, fill }, { ...label, x: legendX + 15, y: 11, text });
      legendX += 34 + text.length * 6;
    }
    const held = way.packet.reason !== "" || way.hops.length === 0;
    const rows = way.hops.length + (held ? 1 : 0);
    const bottom = 24 + rows * ROW_PX;
    const [unitNs, unit] = span >= 10e9 ? [1e9, "s"] : [1e6, "ms"];
    const step = niceStep(span / Math.max(2, (right - LEFT) / 90));
    for (let ns = 0; ns <= span; ns += step) {
      shapes.push({ kind: "line", x1: x(createdNs + ns), y1: 22, x2: x(createdNs + ns), y2: bottom, stroke: theme.dark ? "#ffffff1c" : "#0000001c" });
      shapes.push({ ...label, x: x(createdNs + ns), y: bottom + 9, text: figure(+(ns / unitNs).toPrecision(5)), anchor: "middle", size: 10 });
    }
    shapes.push({ ...label, x: width - 6, y: bottom + 9, text: unit, anchor: "end", size: 10 });
    const bar = (fromNs: number, untilNs: number, y: number, fill: string, text: string, agent: number): void => {
      const [x0, w] = [x(fromNs), Math.max(1.5, x(untilNs) - x(fromNs))];
      shapes.push({ kind: "rect", x: x0, y: y + 5, w, h: 12, fill });
      targets.push({ x: x0, y, w: Math.max(5, w), h: ROW_PX, agent, text });
    };
    way.hops.forEach((hop, i) => {
      const y = 24 + i * ROW_PX;
      const to = hop.receiver === NO_MOTE ? "all" : String(hop.receiver);
      shapes.push({ ...label, x: LEFT - 8, y: y + 11, text: `${i + 1}. ${hop.sender} → ${to}`, anchor: "end", fill: theme.text });
      if (hop.firstNs > hop.arrivedNs) bar(hop.arrivedNs, hop.firstNs, y, waiting, `mote ${hop.sender} keeps it for ${ms(hop.firstNs - hop.arrivedNs)}: queue and waiting for a slot`, hop.sender);
      if (hop.lastNs > hop.firstNs) bar(hop.firstNs, hop.lastNs, y, again, `retransmissions take ${ms(hop.lastNs - hop.firstNs)}`, hop.sender);
      for (const frame of hop.frames) {
        bar(frame.sentNs, frame.sentNs + (hop.doneNs - hop.lastNs), y, sent, `attempt ${frame.attempt} at ${seconds(frame.sentNs, 3)}: ${frame.outcome}`, hop.sender);
        if (frame.outcome === "lost") {
          const cx = x(frame.sentNs);
          shapes.push({ kind: "path", points: [cx - 3, y + 1, cx + 3, y + 7], stroke: theme.text }, { kind: "path", points: [cx - 3, y + 7, cx + 3, y + 1], stroke: theme.text });
        }
      }
      shapes.push({ ...label, x: width - 6, y: y + 11, text: ms(Math.max(0, hop.doneNs - hop.arrivedNs)), anchor: "end" });
    });
    if (held) {
      const y = 24 + way.hops.length * ROW_PX;
      const from = Math.min(way.lastArrivedNs, endedNs);
      shapes.push({ ...label, x: LEFT - 8, y: y + 11, text: `at mote ${way.lastMote}`, anchor: "end", fill: theme.text });
      bar(from, endedNs, y, waiting, `mote ${way.lastMote} holds the packet for ${ms(endedNs - from)}`, way.lastMote);
      shapes.push({ ...label, x: width - 6, y: y + 11, text: ms(endedNs - from), anchor: "end" });
    }
    const now = store.state.timeNs;
    if (now >= createdNs && now <= createdNs + span) {
      shapes.push({ kind: "line", x1: x(now), y1: 20, x2: x(now), y2: bottom, stroke: theme.text, width: 1.5, dash: [4, 3] });
    }
    const height = bottom + 18;
    const most = 42 + CHART_HOPS * ROW_PX;
    this.sketch.root.style.height = `${Math.min(height, most) + 2}px`;
    this.sketch.show(shapes, width, height, targets);
  }
}

/** Whole latency, and how much of it is waiting and how much retransmissions. */
function latencyInWords({ packet, hops, frames }: Way): string {
  const total = packet.endedNs - packet.createdNs;
  const sum = (part: (hop: Hop) => number): number => hops.reduce((all, hop) => all + Math.max(0, part(hop)), 0);
  const waiting = sum((hop) => hop.firstNs - hop.arrivedNs);
  const again = sum((hop) => hop.lastNs - hop.firstNs);
  const count = (n: number, word: string): string => `${n} ${word}${n === 1 ? "" : "s"}`;
  return `${ms(total)} from ${seconds(packet.createdNs, 3)} on: ${count(hops.length, "hop")}, ${count(frames.length, "frame")}; ` +
    `${ms(waiting)} waiting, ${ms(again)} retransmissions.`;
}

/** Why the packet ended. */
function endInWords({ packet, lastMote }: Way): string {
  if (packet.reason !== "") return `Dropped: ${packet.reason} at mote ${lastMote}.`;
  return packet.destination === NO_MOTE ? "It was sent to everyone in reach." : `Delivered to mote ${packet.destination}.`;
}

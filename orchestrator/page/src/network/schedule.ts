import { type App, currentRun, type Exported } from "../app.ts";
import { checkbox, element, selection } from "../dom.ts";
import { seconds } from "../format.ts";
import type { Schedule } from "../gen/cosim/v1/netsim_pb.ts";
import type { Shape } from "../sketch.ts";
import { SketchCanvas, type Target } from "../sketch-canvas.ts";
import { NO_MOTE, radioFrames } from "../source/frame.ts";
import { OKABE_ITO } from "../swarm/colours.ts";
import { type Cell, cells, mayCollide, type Role, slotAt, slotframes, type Use, usedCells } from "./cells.ts";
import { currentFrame, latestAt, type NetworkPanel, Redraw } from "./panel.ts";

const LEFT = 44;
const TOP = 46;
/** Slotframes of more slots than this are wider than the screen. */
const LONG_SLOTFRAME = 70;

/** The schedule matrix: who transmits and who listens in each slot and channel offset. */
export class SchedulePanel implements NetworkPanel {
  readonly root: HTMLElement;
  private readonly sketch: SketchCanvas;
  private readonly note = element("div", { class: "empty" });
  private readonly info = element("span", { class: "status" });
  private readonly choice: HTMLSelectElement;
  private readonly bar: HTMLElement;
  private readonly onlyUsed: { root: HTMLElement; input: HTMLInputElement };
  /** null: not chosen; then long slotframes are shown without their empty slots. */
  private usedOnly: boolean | null = null;
  private readonly redraw: Redraw;
  private schedule: Schedule | null = null;
  private handle = -1;
  private cells: Cell[] = [];
  private used: Use[] = [];
  /** Cells marked in the latest drawing: those in which frames were sent in the step shown, and those in which they collided. */
  drawn = { sent: 0, collisions: 0 };

  constructor(private readonly app: App) {
    this.redraw = new Redraw(app);
    this.sketch = new SketchCanvas(app, "Schedule: slot offset by channel offset");
    const choice = selection("Slotframe", [], "", (value) => {
      this.handle = Number(value);
      this.schedule = null;
    });
    this.choice = choice.select;
    this.onlyUsed = checkbox("used slots only", "Leave out slots in which no mote transmits or listens", (on) => {
      this.usedOnly = on;
    });
    this.bar = element("div", { class: "toolbar" }, choice.root, this.onlyUsed.root, this.info);
    this.root = element("div", { class: "panel" }, this.bar, this.sketch.root, this.note);
  }

  render(): void {
    const { overview, run, overviewVersion } = currentRun(this.app);
    const { timeNs } = this.app.store.state;
    const entry = latestAt(overview.schedules, timeNs);
    const schedule = entry?.schedule;
    const shown = schedule !== undefined && schedule.mote.length > 0;
    this.note.hidden = shown;
    this.bar.hidden = this.sketch.root.hidden = !shown;
    if (!shown) {
      this.drawn = { sent: 0, collisions: 0 };
      const first = overview.schedules[0];
      this.note.textContent = first !== undefined
        ? `The first schedule was recorded at ${seconds(Number(first.timeNs))}: go to that time or later.`
        : "No schedule was recorded. 6TiSCH networks have one: choose such a network, and record schedules.";
      return;
    }
    if (schedule !== this.schedule) this.choose(schedule);
    const length = slotframes(schedule).get(this.handle) ?? 1;
    const slotNs = Number(run.slotNs);
    const slot = slotNs > 0 ? slotAt(timeNs, slotNs, length) : -1;
    const { width, height } = this.sketch.room;
    const frame = currentFrame(this.app)?.frame;
    if (width === 0 || !this.redraw.due(entry?.timeNs, this.handle, this.usedOnly, slot, frame?.step, frame?.fromNs, width, height, overviewVersion)) return;
    const radio = frame === undefined || slotNs === 0 ? null : radioFrames(frame);
    this.used = radio === null ? [] : usedCells(radio, schedule, this.handle, slotNs);
    this.drawn = { sent: this.used.length, collisions: this.used.filter(({ collision }) => collision).length };
    const foreign = this.used.filter((use) => use.foreign).length;
    const others = foreign > 0 ? ` (${foreign} of another slotframe)` : "";
    const happened = radio === null || frame === undefined ? ""
      : ` · in the step shown (${seconds(frame.fromNs)} to ${seconds(frame.timeNs)}): frames sent in ${this.drawn.sent} cells${others}, collisions in ${this.drawn.collisions}`;
    const collisions = this.cells.filter(mayCollide).length;
    const asn = slotNs > 0 ? ` · ASN ${Math.floor(timeNs / slotNs)}, slot ${slot} of ${length}` : "";
    this.info.textContent =
      `${this.cells.length} ${this.cells.length === 1 ? "cell" : "cells"}, ${collisions} with possible collisions · recorded at ${seconds(Number(entry?.timeNs ?? 0))}${happened}${asn}`;
    const usedOnly = this.usedOnly ?? length > LONG_SLOTFRAME;
    this.onlyUsed.input.checked = usedOnly;
    const used = [...new Set([...this.cells, ...this.used].map((cell) => cell.slot))].sort((a, b) => a - b);
    this.draw(usedOnly ? used : Array.from({ length }, (_, i) => i), slot, width, height);
  }

  exported(): Exported {
    return this.sketch.exported();
  }

  private choose(schedule: Schedule): void {
    this.schedule = schedule;
    const frames = slotframes(schedule);
    if (!frames.has(this.handle)) this.handle = busiest(schedule, [...frames.keys()]);
    this.choice.replaceChildren(
      ...[...frames].map(([handle, length]) => element("option", { value: handle }, `${handle} (${length} slots)`)));
    this.choice.value = String(this.handle);
    this.cells = cells(schedule, this.handle);
  }

  private draw(slots: number[], slot: number, roomWidth: number, roomHeight: number): void {
    const { theme } = this.app;
    const length = slots.length;
    const columns = new Map(slots.map((s, column) => [s, column]));
    const channels = Math.max(1, ...this.cells.map((cell) => cell.channel + 1), ...this.used.map((use) => use.channel + 1));
    const cellWidth = Math.max(13, Math.min(64, Math.floor((roomWidth - LEFT - 12) / length)));
    const cellHeight = Math.max(18, Math.min(40, Math.floor((roomHeight - TOP - 68) / channels)));
    const right = LEFT + length * cellWidth;
    const bottom = TOP + channels * cellHeight;
    const shapes: Shape[] = [];
    const targets: Target[] = [];
    const label = { kind: "text", fill: theme.faintText, size: 11 } as const;
    shapes.push({ ...label, x: LEFT, y: 12, text: "slot offset" });
    shapes.push({ ...label, x: 10, y: TOP + (bottom - TOP) / 2, text: "channel offset", anchor: "middle", turned: true });
    const current = columns.get(slot);
    if (current !== undefined) {
      const fill = theme.dark ? "#ffffff26" : "#00000016";
      shapes.push({ kind: "rect", x: LEFT + current * cellWidth, y: TOP - 6, w: cellWidth, h: bottom - TOP + 12, fill });
    } else if (slot >= 0) {
      // The current slot is left out: a line between its neighbours shows where it would be.
      const x = LEFT + slots.filter((s) => s < slot).length * cellWidth;
      shapes.push({ kind: "line", x1: x, y1: TOP - 6, x2: x, y2: bottom + 6, stroke: theme.faintText, width: 2 });
    }
    const every = cellWidth >= 26 ? 1 : cellWidth >= 16 ? 2 : 5;
    for (let s = 0; s < length; s += every) {
      shapes.push({ ...label, x: LEFT + (s + 0.5) * cellWidth, y: TOP - 14, text: String(slots[s]), anchor: "middle", size: 10 });
    }
    for (let c = 0; c < channels; c++) shapes.push({ ...label, x: LEFT - 8, y: TOP + (c + 0.5) * cellHeight, text: String(c), anchor: "end" });
    const grid = theme.dark ? "#ffffff1c" : "#0000001c";
    for (let s = 0; s <= length; s++) shapes.push({ kind: "line", x1: LEFT + s * cellWidth, y1: TOP, x2: LEFT + s * cellWidth, y2: bottom, stroke: grid });
    for (let c = 0; c <= channels; c++) shapes.push({ kind: "line", x1: LEFT, y1: TOP + c * cellHeight, x2: right, y2: TOP + c * cellHeight, stroke: grid });
    for (const cell of this.cells) this.drawCell(shapes, targets, cell, columns.get(cell.slot) ?? 0, cellWidth, cellHeight);
    for (const use of this.used) this.drawUse(shapes, targets, use, columns.get(use.slot) ?? 0, cellWidth, cellHeight);
    const end = this.legend(shapes, bottom + 18, roomWidth);
    this.sketch.show(shapes, Math.max(roomWidth, right + 12), Math.max(roomHeight - 4, end + 16), targets);
  }

  private drawCell(shapes: Shape[], targets: Target[], cell: Cell, column: number, width: number, height: number): void {
    const { theme } = this.app;
    const { selected } = this.app.store.state;
    const x = LEFT + column * width + 1;
    const y = TOP + cell.channel * height + 1;
    const [w, h] = [width - 2, height - 2];
    const collides = mayCollide(cell);
    const fill = collides ? OKABE_ITO.vermilion : cell.shared ? OKABE_ITO.yellow : cell.transmitters.length > 0 ? OKABE_ITO.sky : undefined;
    shapes.push({ kind: "rect", x, y, w, h, fill, stroke: cell.receivers.length > 0 ? theme.text : undefined });
    if (selected !== null && [...cell.transmitters, ...cell.receivers].some((role) => role.mote === selected)) {
      shapes.push({ kind: "rect", x: x - 1, y: y - 1, w: w + 2, h: h + 2, stroke: theme.text, width: 3 });
    }
    const text = cellText(cell, w);
    // Collisions differ from other cells by more than their colour: by the number of transmitters, or by a stroke where it has no room.
    if (collides && text === "") shapes.push({ kind: "line", x1: x, y1: y + h, x2: x + w, y2: y, stroke: "#000000", width: 1.5 });
    const ink = fill === undefined ? theme.text : "#1b1f24";
    if (text !== "") shapes.push({ kind: "text", x: x + w / 2, y: y + h / 2, text, fill: ink, size: 10, anchor: "middle" });
    const agent = cell.transmitters[0]?.mote ?? cell.receivers[0]?.mote ?? null;
    targets.push({ x, y, w, h, agent, text: `slot ${cell.slot}, channel offset ${cell.channel}: ${describe(cell)}` });
  }

  /** A dot for a frame that was sent, a thick cross for frames that collided. */
  private drawUse(shapes: Shape[], targets: Target[], use: Use, column: number, width: number, height: number): void {
    const x = LEFT + column * width;
    const y = TOP + use.channel * height;
    useMark(shapes, use.collision ? "collision" : use.foreign ? "foreign" : "sent", x + width - Math.min(7, width / 3), y + Math.min(7, height / 3));
    const scheduled = this.cells.find((cell) => cell.slot === use.slot && cell.channel === use.channel);
    const list = use.frames.slice(0, 5).map((frame) =>
      `${frame.kind} ${frame.sender} → ${frame.destination === NO_MOTE ? "all" : frame.destination}: ${frame.outcome}`);
    if (use.frames.length > 5) list.push(`${use.frames.length - 5} more`);
    const text = `slot ${use.slot}, channel offset ${use.channel}: ${use.collision ? "collision; " : ""}sent: ${list.join(", ")}` +
      `${scheduled === undefined ? (use.foreign ? "; a cell of another slotframe" : "; not in the recorded schedule") : `; ${describe(scheduled)}`}`;
    targets.push({ x: x + 1, y: y + 1, w: width - 2, h: height - 2, agent: use.frames[0].sender, text });
  }

  /** Explains the marks; returns where it ends (px). */
  private legend(shapes: Shape[], top: number, roomWidth: number): number {
    const { theme } = this.app;
    let x = LEFT;
    let y = top;
    const advance = (text: string): void => {
      const w = 34 + text.length * 6;
      if (x > LEFT && x + w > roomWidth) [x, y] = [LEFT, y + 17];
    };
    for (const [fill, stroke, text] of [
      [OKABE_ITO.sky, undefined, "one mote transmits"],
      [OKABE_ITO.yellow, undefined, "shared"],
      [OKABE_ITO.vermilion, undefined, "possible collision: several may transmit, not shared"],
      [undefined, theme.text, "outlined: somebody listens"],
    ] as const) {
      advance(text);
      shapes.push({ kind: "rect", x, y: y - 5, w: 10, h: 10, fill, stroke });
      shapes.push({ kind: "text", x: x + 15, y, text, fill: theme.faintText, size: 11 });
      x += 34 + text.length * 6;
    }
    for (const [mark, text] of [
      ["sent", "a frame was sent in the step shown"],
      ["collision", "frames collided in the step shown"],
      ["foreign", "sent at this slot offset, in a cell of another slotframe"],
    ] as const) {
      advance(text);
      useMark(shapes, mark, x + 5, y);
      shapes.push({ kind: "text", x: x + 15, y, text, fill: theme.faintText, size: 11 });
      x += 34 + text.length * 6;
    }
    return y;
  }
}

/** All marks have an edge, so that they are seen on every colour of a cell. */
function useMark(shapes: Shape[], mark: "sent" | "collision" | "foreign", x: number, y: number): void {
  if (mark !== "collision") {
    const fill = mark === "sent" ? OKABE_ITO.green : "#ffffff";
    shapes.push({ kind: "circle", x, y, r: 3.5, fill, stroke: mark === "sent" ? "#ffffff" : OKABE_ITO.green, width: 1.2 });
    return;
  }
  for (const [stroke, width] of [["#ffffff", 5], ["#000000", 2.6]] as const) {
    shapes.push({ kind: "line", x1: x - 4, y1: y - 4, x2: x + 4, y2: y + 4, stroke, width }, { kind: "line", x1: x - 4, y1: y + 4, x2: x + 4, y2: y - 4, stroke, width });
  }
}

/** The slotframe with most cells: the one that is worth looking at first. */
function busiest(schedule: Schedule, handles: number[]): number {
  const counts = new Map<number, number>();
  for (const handle of schedule.slotframe) counts.set(handle, (counts.get(handle) ?? 0) + 1);
  return handles.reduce((best, handle) => ((counts.get(handle) ?? 0) > (counts.get(best) ?? 0) ? handle : best), handles[0]);
}

function cellText(cell: Cell, width: number): string {
  const { transmitters } = cell;
  if (transmitters.length === 0 || width < 18) return "";
  if (transmitters.length > 1) return width < 26 ? String(transmitters.length) : `${transmitters.length} tx`;
  const [{ mote, neighbour }] = transmitters;
  if (width < 34) return String(mote);
  return neighbour === NO_MOTE ? `${mote} →` : `${mote}→${neighbour}`;
}

function describe(cell: Cell): string {
  const list = (roles: Role[]): string => {
    const names = roles.slice(0, 8).map(({ mote, neighbour }) => (neighbour === NO_MOTE ? String(mote) : `${mote} (with ${neighbour})`));
    return roles.length > 8 ? `${names.join(", ")} and ${roles.length - 8} more` : names.join(", ");
  };
  const parts: string[] = [];
  if (cell.transmitters.length > 0) parts.push(`may transmit: ${list(cell.transmitters)}`);
  if (cell.receivers.length > 0) parts.push(`listen: ${list(cell.receivers)}`);
  if (cell.shared) parts.push("shared");
  if (mayCollide(cell)) parts.push("possible collision");
  return parts.join("; ");
}

import type { App, Exported } from "../app.ts";
import { element, setText } from "../dom.ts";
import { niceStep, seconds } from "../format.ts";
import { EventKind } from "../gen/murmuration/view/v1/view_pb.ts";
import type { Shape } from "../sketch.ts";
import { SketchCanvas } from "../sketch-canvas.ts";
import type { FrameData } from "../source/frame.ts";
import type { RunData } from "../source/source.ts";
import { bit } from "../source/wire.ts";
import { OKABE_ITO } from "../swarm/colours.ts";
import { exists } from "../swarm/links.ts";
import { VirtualList } from "../virtual-list.ts";
import { currentFrame, type NetworkPanel, Redraw } from "./panel.ts";

interface Missing {
  mote: number;
  lacks: string;
}

/** How many motes have joined, over time, and which have not, and why. */
export class JoinPanel implements NetworkPanel {
  readonly root: HTMLElement;
  private readonly sketch: SketchCanvas;
  private readonly taking = element("span");
  private readonly formed = element("button", { type: "button", class: "link", title: "Go to this time", onclick: () => this.app.seek(this.formedNs) });
  private readonly summary = element("h2", { class: "summary" }, this.taking, this.formed);
  /** When the network formed (ns). */
  private formedNs = 0;
  private readonly list: VirtualList<Missing>;
  private readonly note = element("div", { class: "empty" });
  private readonly redraw: Redraw;

  constructor(private readonly app: App) {
    this.redraw = new Redraw(app);
    this.sketch = new SketchCanvas(app, "Motes that joined, over time");
    this.list = new VirtualList("Motes that have not joined", 26, ({ mote, lacks }) =>
      element("div", { class: "row", role: "listitem" },
        element("button", { type: "button", class: "event", onclick: () => app.select(mote) },
          element("span", { class: "time" }, `mote ${mote}`), element("span", { class: "words" }, lacks))));
    this.root = element("div", { class: "panel join" }, this.summary, this.sketch.root, this.list.root, this.note);
  }

  render(): void {
    const current = currentFrame(this.app);
    const { width, height } = this.sketch.room;
    if (!this.redraw.due(current?.frame.step, current?.data.overviewVersion, width, height)) return;
    const motes = current?.frame.motes ?? null;
    const known = current !== null && (current.frame.formation !== null || (motes !== null && motes.joined.length > 0));
    this.note.hidden = known;
    this.note.textContent = current === null ? "Loading frames …" : "Motes of this network need not join it. Those of 6TiSCH networks do.";
    this.summary.hidden = this.sketch.root.hidden = this.list.root.hidden = !known;
    if (!known) return;
    const { frame, data } = current;
    const missing = missingMotes(frame);
    const total = data.run.agentCount;
    const formed = data.overview.events.find((event) => event.kind === EventKind.FORMED);
    this.formedNs = Number(formed?.timeNs ?? 0);
    this.formed.hidden = formed === undefined;
    setText(this.formed, `The network formed at ${seconds(this.formedNs)}.`);
    setText(this.taking, `${total - missing.length} of ${total} motes take part.`);
    this.list.show(missing);
    if (width > 0) this.draw(data, width, height);
  }

  exported(): Exported {
    return this.sketch.exported();
  }

  private draw(data: RunData, width: number, height: number): void {
    const { theme, store } = this.app;
    const end = Math.max(1, data.endNs);
    const [left, right, top, bottom] = [46, width - 14, 22, height - 30];
    const x = (timeNs: number): number => left + ((right - left) * timeNs) / end;
    const total = Math.max(1, data.run.agentCount);
    const y = (count: number): number => bottom - ((bottom - top) * count) / total;
    const shapes: Shape[] = [];
    const label = { kind: "text", fill: theme.faintText, size: 11 } as const;
    const grid = theme.dark ? "#ffffff1c" : "#0000001c";
    const stepY = niceStep(Math.max(1, total / 5));
    for (let count = 0; count <= total; count += stepY) {
      shapes.push({ kind: "line", x1: left, y1: y(count), x2: right, y2: y(count), stroke: grid });
      shapes.push({ ...label, x: left - 6, y: y(count), text: String(count), anchor: "end" });
    }
    const stepX = niceStep(end / 1e9 / 10) * 1e9;
    for (let t = 0; t <= end; t += stepX) shapes.push({ ...label, x: x(t), y: bottom + 12, text: String(+(t / 1e9).toPrecision(6)), anchor: "middle" });
    shapes.push({ ...label, x: right, y: bottom + 24, text: "time (s)", anchor: "end" });
    shapes.push({ ...label, x: 8, y: 10, text: "motes that joined, by their events" });
    const joined = new Set<number>();
    const points = [x(0), y(0)];
    for (const event of data.overview.events) {
      if (event.agent === undefined || (event.kind !== EventKind.JOIN && event.kind !== EventKind.LEAVE)) continue;
      const at = x(Number(event.timeNs));
      points.push(at, y(joined.size));
      if (event.kind === EventKind.JOIN) joined.add(event.agent);
      else joined.delete(event.agent);
      points.push(at, y(joined.size));
    }
    points.push(x(Math.max(Number(data.overview.untilNs), store.state.timeNs)), y(joined.size));
    shapes.push({ kind: "path", points, stroke: theme.dark ? OKABE_ITO.sky : OKABE_ITO.blue, width: 2 });
    const now = x(store.state.timeNs);
    shapes.push({ kind: "line", x1: now, y1: top, x2: now, y2: bottom, stroke: theme.text, dash: [4, 3] });
    this.sketch.show(shapes, width, height, []);
  }
}

/** Motes that do not take part, and what they lack. */
function missingMotes(frame: FrameData): Missing[] {
  const { formation, motes } = frame;
  if (formation !== null && !formation.formed) {
    return formation.missing.map((mote, i) => ({ mote, lacks: formation.reasons[formation.reason[i]] ?? "no reason given" }));
  }
  const missing: Missing[] = [];
  if (motes === null || motes.joined.length === 0) return missing;
  for (let mote = 0; mote < frame.x.length; mote++) {
    if (bit(motes.joined, mote)) continue;
    const works = motes.alive.length === 0 || bit(motes.alive, mote);
    missing.push({ mote, lacks: !exists(frame, mote) ? "its robot is lost" : works ? "not joined" : "its radio failed" });
  }
  return missing;
}

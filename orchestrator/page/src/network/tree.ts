import { hierarchy, tree } from "d3-hierarchy";
import type { App, Exported } from "../app.ts";
import { element } from "../dom.ts";
import { EventKind } from "../gen/murmuration/view/v1/view_pb.ts";
import type { Shape } from "../sketch.ts";
import { SketchCanvas, type Target } from "../sketch-canvas.ts";
import type { FrameMotes } from "../source/frame.ts";
import { bit } from "../source/wire.ts";
import { css, OKABE_ITO } from "../swarm/colours.ts";
import { forest, type TreeNode } from "./forest.ts";
import { currentFrame, type NetworkPanel, Redraw } from "./panel.ts";

/** A change of parent is highlighted for this time (ns). */
const CHANGED_NS = 5e9;
const MARGIN = 28;
/** Motes closer than this have neither number nor rank (px). */
const LABEL_PX = 22;
const WIDEST_PX = 16000;

interface Placed {
  mote: number;
  x: number;
  y: number;
}

/** The routing graph: each mote below its preferred parent. */
export class TreePanel implements NetworkPanel {
  readonly root: HTMLElement;
  private readonly sketch: SketchCanvas;
  private readonly note = element("div", { class: "empty" });
  private readonly redraw: Redraw;

  constructor(private readonly app: App) {
    this.sketch = new SketchCanvas(app, "Tree of preferred parents");
    this.redraw = new Redraw(app);
    this.root = element("div", { class: "panel" }, this.sketch.root, this.note);
  }

  render(): void {
    const current = currentFrame(this.app);
    const { width, height } = this.sketch.room;
    if (!this.redraw.due(current?.frame.step, current?.data.overviewVersion, width, height) || width === 0) return;
    const motes = current?.frame.motes ?? null;
    const hasTree = motes !== null && motes.parent.length > 0;
    this.sketch.root.hidden = !hasTree;
    this.note.hidden = hasTree;
    this.note.textContent = current === null
      ? "Loading frames …"
      : "This network has no routing graph. 6TiSCH networks have one: choose such a network in the experiment file.";
    if (current === null || motes === null || !hasTree) return;
    const changed = new Set<number>();
    for (const event of current.data.overview.events) {
      const age = current.frame.timeNs - Number(event.timeNs);
      if (event.kind === EventKind.PARENT && event.agent !== undefined && age >= 0 && age <= CHANGED_NS) changed.add(event.agent);
    }
    this.draw(motes, changed, width, height);
  }

  exported(): Exported {
    return this.sketch.exported();
  }

  private draw(motes: FrameMotes, changed: Set<number>, roomWidth: number, roomHeight: number): void {
    const { theme } = this.app;
    const { roots, alone } = forest(motes.parent);
    const top = hierarchy<TreeNode>({ mote: -1, loop: false, children: roots });
    const leaves = top.leaves().length;
    const width = Math.max(roomWidth, Math.min(WIDEST_PX, leaves * 12 + 2 * MARGIN));
    const perRow = Math.max(1, Math.floor((width - 2 * MARGIN) / 26));
    const aloneRows = Math.ceil(alone.length / perRow);
    const aloneHeight = alone.length === 0 ? 0 : 34 + aloneRows * 30;
    const levels = Math.max(1, top.height);
    const treeHeight = Math.max(roomHeight - aloneHeight - 80, levels * 46);
    tree<TreeNode>().size([width - 2 * MARGIN, treeHeight])(top);
    const spacing = (width - 2 * MARGIN) / Math.max(1, leaves);
    const shapes: Shape[] = [];
    const targets: Target[] = [];
    // The first level is that of the roots: what is above it is only there to lay them out side by side.
    const y = (value: number | undefined): number => 54 + ((value ?? 0) - treeHeight / levels) * (levels / Math.max(1, levels - 1));
    const placed: Placed[] = [];
    for (const node of top.descendants()) {
      if (node.depth === 0) continue;
      const at = { mote: node.data.mote, x: MARGIN + (node.x ?? 0), y: y(node.y) };
      placed.push(at);
      if (node.depth > 1 && node.parent !== null) {
        const fresh = changed.has(at.mote);
        const stroke = fresh ? OKABE_ITO.vermilion : css(theme.dead);
        const [px, py] = [MARGIN + (node.parent.x ?? 0), y(node.parent.y)];
        shapes.push({ kind: "line", x1: px, y1: py, x2: at.x, y2: at.y, stroke, width: fresh ? 2.5 : 1 });
      }
    }
    const aloneTop = 54 + treeHeight + 30;
    if (alone.length > 0) {
      const text = `not joined: without a preferred parent (${alone.length})`;
      shapes.push({ kind: "text", x: MARGIN - 14, y: aloneTop, text, fill: theme.faintText });
      alone.forEach((mote, i) => placed.push({ mote, x: MARGIN + (i % perRow) * 26, y: aloneTop + 24 + Math.floor(i / perRow) * 30 }));
    }
    for (const at of placed) this.mote(shapes, targets, at, motes, spacing >= LABEL_PX || alone.includes(at.mote));
    this.legend(shapes);
    this.sketch.show(shapes, width, aloneTop + aloneHeight, targets);
  }

  private mote(shapes: Shape[], targets: Target[], at: Placed, motes: FrameMotes, labelled: boolean): void {
    const { theme } = this.app;
    const { mote, x, y } = at;
    const r = labelled ? 10 : 5;
    const works = motes.alive.length === 0 || bit(motes.alive, mote);
    const joined = works && (motes.joined.length === 0 || bit(motes.joined, mote));
    const synced = works && motes.synced.length > 0 && bit(motes.synced, mote);
    const selected = this.app.store.state.selected === mote;
    if (selected) shapes.push({ kind: "circle", x, y, r: r + 4, stroke: theme.text, width: 2 });
    const fill = joined ? OKABE_ITO.sky : synced ? OKABE_ITO.yellow : theme.background;
    shapes.push({ kind: "circle", x, y, r, fill, stroke: works ? theme.text : css(theme.dead), width: 1, dash: synced || joined ? undefined : [3, 2] });
    if (!works) {
      shapes.push({ kind: "line", x1: x - r, y1: y - r, x2: x + r, y2: y + r, stroke: css(theme.dead), width: 2 });
      shapes.push({ kind: "line", x1: x - r, y1: y + r, x2: x + r, y2: y - r, stroke: css(theme.dead), width: 2 });
    }
    const ink = joined || synced ? "#1b1f24" : theme.text;
    if (labelled) shapes.push({ kind: "text", x, y, text: String(mote), fill: ink, size: mote > 99 ? 9 : 11, anchor: "middle", bold: selected });
    const rank = motes.rank.length > 0 && motes.rank[mote] < 0xffff ? motes.rank[mote] : null;
    if (labelled && rank !== null) {
      shapes.push({ kind: "text", x, y: y + r + 8, text: String(rank), fill: theme.faintText, size: 9, anchor: "middle", halo: theme.background });
    }
    const queue = motes.queueLength.length > 0 ? motes.queueLength[mote] : 0;
    if (queue > 0) {
      const h = Math.min(2 * r, 2 * queue);
      shapes.push({ kind: "rect", x: x + r + 2, y: y + r - h, w: labelled ? 4 : 2, h, fill: OKABE_ITO.orange });
    }
    const state = !works ? "radio failed" : joined ? "joined" : synced ? "synchronised, not joined" : "not synchronised";
    const text = `mote ${mote}: ${state}, rank ${rank ?? "infinite"}, ${queue} packets in queue`;
    targets.push({ x: x - r, y: y - r, w: 2 * r + 6, h: 2 * r, agent: mote, text });
  }

  private legend(shapes: Shape[]): void {
    const { theme } = this.app;
    let x = 16;
    const text = (words: string): void => {
      shapes.push({ kind: "text", x: x + 10, y: 14, text: words, fill: theme.faintText, size: 11 });
      x += 26 + words.length * 6;
    };
    const circle = (fill: string, dash?: number[]): void => void shapes.push({ kind: "circle", x, y: 14, r: 5, fill, stroke: theme.text, dash });
    circle(OKABE_ITO.sky);
    text("joined");
    circle(OKABE_ITO.yellow);
    text("synchronised");
    circle(theme.background, [3, 2]);
    text("neither");
    shapes.push({ kind: "rect", x: x - 2, y: 8, w: 4, h: 12, fill: OKABE_ITO.orange });
    text("packets in queue");
    shapes.push({ kind: "line", x1: x - 6, y1: 14, x2: x + 6, y2: 14, stroke: OKABE_ITO.vermilion, width: 2.5 });
    text("parent changed within 5 s; number below a mote: rank");
  }
}

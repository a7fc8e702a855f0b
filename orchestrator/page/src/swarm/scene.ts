import { EventKind } from "../gen/murmuration/view/v1/view_pb.ts";
import type { FrameData } from "../source/frame.ts";
import type { RunData } from "../source/source.ts";
import { bit } from "../source/wire.ts";
import type { State } from "../store.ts";
import { drawResiduals } from "../measurements/map.ts";
import type { ShownRows } from "../measurements/shown.ts";
import { css, shade, type Theme, withAlpha } from "./colours.ts";
import { exists, ghosts, MissedLinks, neighboursHeard } from "./links.ts";
import { Motion } from "./motion.ts";
import { Picture } from "./picture.ts";
import { drawSite } from "./site.ts";

/** Trails show where robots were within this time before (ns). */
const TRAIL_NS = 10e9;
/** Swarms up to this size have trails for every robot, larger ones for the selected robot. */
const TRAIL_ROBOTS = 200;
/** Points of a trail at most. */
const TRAIL_POINTS = 60;

/** Range of what colours mean, for the legend. */
export interface ColourRange {
  least: number;
  most: number;
}

/** Fills in the picture of a run at a time. Layers are rebuilt only when what they show has changed. */
export class Scene {
  readonly picture = new Picture();
  robotRange: ColourRange = { least: 0, most: 1 };
  linkRange: ColourRange = { least: 0, most: 1 };
  /** The frame in the picture; null before the first is loaded. */
  frame: FrameData | null = null;
  /** Where the robots are in the picture. */
  readonly motion = new Motion();
  private readonly missed = new MissedLinks();
  private heard = new Uint32Array(0);
  private linkColours = new Uint32Array(0);
  private group = new Uint8Array(0);
  private bornNs = new Float64Array(0);
  private bornVersion = -1;
  private siteKey = "";
  private key = "";
  private share = 0;
  private moves = false;
  private movesKey = "";

  /** `measured`: what is drawn in place of the run's links. */
  constructor(
    readonly data: RunData,
    readonly measured: ShownRows | null = null,
  ) {
    const count = data.run.agentCount;
    this.heard = new Uint32Array(count);
    this.group = new Uint8Array(count);
    let agent = 0;
    data.run.groups.forEach((group, i) => {
      for (let k = 0; k < group.count && agent < count; k++) this.group[agent++] = i;
    });
  }

  /** Brings the picture up to date; true if anything in it has changed. */
  update(state: State, theme: Theme): boolean {
    const { frames } = this.data;
    // Until its frame is loaded the picture stays as it was.
    if (!this.data.ready(state.timeNs)) return false;
    const index = frames.indexAt(state.timeNs);
    const { robotColour, linkColour, ghosts: showGhosts, selected, peer } = state;
    const missed = state.missed && this.measured === null;
    const trails = state.trails && this.measured === null;
    const first = Math.max(0, frames.indexAt(state.timeNs - TRAIL_NS));
    const key = [
      frames.step(index), frames.step(first), frames.generation, robotColour, linkColour, missed, trails, showGhosts, selected, peer,
      theme.dark, this.data.overviewVersion, this.measured?.mapKey(state),
    ].join();
    // While playing, robots move between the frames; links and colours are those of the frame before.
    const changed = key !== this.key;
    const share = state.playing && this.movesAfter(index) ? Motion.share(frames, index, state.timeNs) : 0;
    if (!changed && share === this.share) return false;
    this.key = key;
    this.share = share;
    const frame = frames.frame(index);
    this.frame = frame;
    this.motion.set(frame, share > 0 ? frames.frame(index + 1) : null, share);
    if (changed) {
      this.picture.background = theme.background;
      this.updateSite(frame, theme);
      if (trails) this.updateTrails(index, first, state, theme);
      else this.picture.trails.clear();
      if (this.measured?.rows !== undefined) drawResiduals(this.picture, this.measured.map(state), this.measured.rows.noise, theme);
      else this.updateLinks(frame, state, theme);
      this.picture.missed.clear();
      if (missed) {
        this.missed.find(frames, index, (sender, receiver) => {
          if (sender < frame.x.length && receiver < frame.x.length) {
            this.picture.missed.link(sender, receiver, frame.x, frame.y, theme.missed, true);
          }
        });
      }
      this.updateRobots(frame, state, theme);
      this.updateGhosts(index, state);
    }
    if (!changed || share > 0) {
      const { x, y, heading } = this.motion;
      this.picture.links.place(x, y);
      this.picture.missed.place(x, y);
      this.picture.robots.place(x, y, heading);
    }
    this.updateTrailHeads(frame, share, state, theme);
    this.updateMarks(frame, state, theme);
    return true;
  }

  /** Whether robots move between a frame and the next, so that pictures between them differ. */
  private movesAfter(index: number): boolean {
    const { frames } = this.data;
    if (index + 1 >= frames.length) return false;
    const key = `${frames.generation} ${frames.step(index)} ${frames.step(index + 1)}`;
    if (key !== this.movesKey) {
      this.movesKey = key;
      this.moves = Motion.moves(frames.frame(index), frames.frame(index + 1));
    }
    return this.moves;
  }

  private updateSite(frame: FrameData, theme: Theme): void {
    const key = `${theme.dark} ${frame.movedObstacles.map((m) => `${m.name} ${m.xM} ${m.yM}`).join()}`;
    if (key === this.siteKey) return;
    this.siteKey = key;
    drawSite(this.picture, this.data.run.place, frame.movedObstacles, theme);
  }

  private updateTrails(index: number, first: number, state: State, theme: Theme): void {
    const { trails } = this.picture;
    trails.clear();
    if (index === first) return;
    const { frames } = this.data;
    const all = this.data.run.agentCount <= TRAIL_ROBOTS;
    if (!all && state.selected === null) return;
    const every = Math.max(1, Math.ceil((index - first) / TRAIL_POINTS));
    let later = frames.frame(index);
    for (let i = index - every; i >= first; i -= every) {
      const earlier = frames.frame(i);
      const alpha = 0.5 * (1 - (index - i) / (index - first + 1));
      if (all) {
        for (let agent = 0; agent < later.x.length; agent++) this.trail(agent, earlier, later, alpha, theme);
      } else if (state.selected !== null) {
        this.trail(state.selected, earlier, later, alpha, theme);
      }
      later = earlier;
    }
  }

  private trail(agent: number, earlier: FrameData, later: FrameData, alpha: number, theme: Theme): void {
    if (!exists(earlier, agent) || !exists(later, agent)) return;
    const colour = withAlpha(theme.categories[this.group[agent] % theme.categories.length], alpha);
    this.picture.trails.segment(earlier.x[agent], earlier.y[agent], later.x[agent], later.y[agent], colour);
  }

  private updateTrailHeads(frame: FrameData, share: number, state: State, theme: Theme): void {
    const { trailHeads, trails } = this.picture;
    if (trailHeads.count > 0) trailHeads.clear();
    if (share === 0 || trails.count === 0) return;
    const { x, y } = this.motion;
    const add = (agent: number): void => {
      if (!exists(frame, agent)) return;
      trailHeads.segment(frame.x[agent], frame.y[agent], x[agent], y[agent], withAlpha(theme.categories[this.group[agent] % theme.categories.length], 0.5));
    };
    if (this.data.run.agentCount <= TRAIL_ROBOTS) for (let agent = 0; agent < frame.x.length; agent++) add(agent);
    else if (state.selected !== null && state.selected < frame.x.length) add(state.selected);
  }

  private updateLinks(frame: FrameData, state: State, theme: Theme): void {
    const layer = this.picture.links;
    layer.clear();
    const { sender, received, rssiDbm, stepsAgo } = frame.links;
    const mode = state.linkColour;
    if (mode === "none") return;
    this.linkRange = { least: 0, most: 1 };
    if (mode === "rssi") this.linkRange = { least: -100, most: -50 };
    if (mode === "age") {
      let most = 1;
      for (const steps of stepsAgo) if (steps > most) most = steps;
      this.linkRange.most = most;
    }
    const { least, most } = this.linkRange;
    if (this.linkColours.length < sender.length) this.linkColours = new Uint32Array(2 * sender.length);
    for (let k = 0; k < sender.length; k++) {
      let value = 0;
      if (mode === "delivery") {
        const sent = frame.nSent.length > 0 ? frame.nSent[sender[k]] : 0;
        value = sent > 0 ? Math.min(1, received[k] / sent) : 1;
      } else if (mode === "rssi") {
        value = rssiDbm.length > 0 ? rssiDbm[k] : Number.NaN;
      } else {
        value = stepsAgo.length > 0 ? stepsAgo[k] : 0;
      }
      this.linkColours[k] = Number.isNaN(value) ? theme.dead : theme.linkScale[shade(value, least, most)];
    }
    this.drawLinks(frame);
  }

  /** One line for each pair of robots, whether one direction delivered or both. */
  private drawLinks({ x, y, links: { sender, receiver } }: FrameData): void {
    const layer = this.picture.links;
    const upward = new Map<number, number>();
    for (let k = 0; k < sender.length; k++) {
      if (sender[k] < receiver[k]) upward.set(sender[k] * 0x4000000 + receiver[k], k);
    }
    for (let k = 0; k < sender.length; k++) {
      if (sender[k] < receiver[k]) continue;
      const pair = receiver[k] * 0x4000000 + sender[k];
      const other = upward.get(pair);
      if (other === undefined) {
        layer.link(sender[k], receiver[k], x, y, this.linkColours[k], false);
      } else {
        layer.linkBoth(sender[k], receiver[k], x, y, this.linkColours[k], this.linkColours[other]);
        upward.delete(pair);
      }
    }
    for (const k of upward.values()) layer.link(sender[k], receiver[k], x, y, this.linkColours[k], false);
  }

  private updateRobots(frame: FrameData, state: State, theme: Theme): void {
    const { robots } = this.picture;
    robots.clear();
    neighboursHeard(frame, this.heard);
    const values = this.figures(frame, state);
    this.robotRange = { least: 0, most: 1 };
    if (values !== null) {
      for (const value of values) if (value > this.robotRange.most && value < 0xffff) this.robotRange.most = value;
    }
    for (let agent = 0; agent < frame.x.length; agent++) {
      if (!exists(frame, agent)) continue;
      let colour = theme.categories[this.group[agent] % theme.categories.length];
      if (values !== null) {
        colour = agent < values.length && values[agent] < 0xffff ? theme.scale[shade(values[agent], 0, this.robotRange.most)] : theme.dead;
      }
      robots.add(agent, frame.x[agent], frame.y[agent], frame.heading.length > 0 ? frame.heading[agent] : 0, colour);
    }
  }

  /** The figure that colours the robots; null: their groups. */
  private figures(frame: FrameData, state: State): Uint32Array | null {
    if (state.robotColour === "heard") return this.heard;
    if (state.robotColour === "queue") return frame.motes?.queueLength ?? new Uint32Array(0);
    if (state.robotColour === "rank") return frame.motes?.rank ?? new Uint32Array(0);
    return null;
  }

  private updateGhosts(index: number, state: State): void {
    this.picture.ghosts.length = 0;
    const { selected } = state;
    if (selected !== null && selected < this.data.frames.frame(index).x.length && state.ghosts) {
      ghosts(this.data.frames, index, selected, this.picture.ghosts);
    }
  }

  private updateMarks(frame: FrameData, state: State, theme: Theme): void {
    const { marks, dead, labels } = this.picture;
    const { x, y } = this.motion;
    marks.clear();
    dead.length = 0;
    labels.length = 0;
    this.updateBirths();
    for (let agent = 0; agent < frame.x.length; agent++) {
      if (exists(frame, agent)) {
        if (frame.motes !== null && frame.motes.alive.length > 0 && !bit(frame.motes.alive, agent)) this.cross(agent, 5, theme);
      } else if (frame.timeNs >= this.bornNs[agent]) {
        dead.push(agent, frame.x[agent], frame.y[agent]);
        marks.ring(frame.x[agent], frame.y[agent], 6, theme.dead, 12);
        this.cross(agent, 4, theme);
      }
    }
    const { selected, peer } = state;
    if (peer !== null && peer < frame.x.length) marks.ring(x[peer], y[peer], 12, theme.selected, 12);
    if (selected === null || selected >= frame.x.length) return;
    marks.ring(x[selected], y[selected], 12, theme.selected, 24);
    marks.ring(x[selected], y[selected], 13, theme.selected, 24);
    for (const ghost of this.picture.ghosts) {
      marks.ring(ghost.x, ghost.y, 6, theme.ghost, 12);
      marks.segment(ghost.x, ghost.y, x[ghost.neighbour], y[ghost.neighbour], theme.ghost);
      if (this.picture.ghosts.length <= 30) {
        labels.push({ x: ghost.x, y: ghost.y, offsetPx: 9, text: String(ghost.neighbour), colour: css(theme.ghost) });
      }
    }
  }

  private cross(agent: number, r: number, theme: Theme): void {
    const { x, y } = this.motion;
    this.picture.marks.stroke(x[agent], y[agent], -r, -r, r, r, theme.dead);
    this.picture.marks.stroke(x[agent], y[agent], -r, r, r, -r, theme.dead);
  }

  /** Robots whose first event is a birth are not drawn before it. */
  private updateBirths(): void {
    if (this.bornVersion === this.data.overviewVersion) return;
    this.bornVersion = this.data.overviewVersion;
    this.bornNs = new Float64Array(this.data.run.agentCount);
    const seen = new Set<number>();
    for (const event of this.data.overview.events) {
      if (event.agent === undefined || seen.has(event.agent)) continue;
      if (event.kind !== EventKind.BIRTH && event.kind !== EventKind.DEATH) continue;
      seen.add(event.agent);
      if (event.kind === EventKind.BIRTH) this.bornNs[event.agent] = Number(event.timeNs);
    }
  }
}

import type { FrameList } from "../source/frame-list.ts";
import type { FrameData } from "../source/frame.ts";
import { bit } from "../source/wire.ts";
import type { Ghost } from "./picture.ts";

/** A link is missed if it delivered within this time before (ns). */
export const MISSED_WITHIN_NS = 5e9;
/** Ghosts come from deliveries within this time before (ns). */
export const GHOSTS_WITHIN_NS = 10e9;

/** When each pair of robots delivered last: a hash table, since a `Map` of tens of thousands of pairs takes longer than drawing them. */
class LatestDeliveries {
  private keys = new Float64Array(1024).fill(-1);
  private times = new Float64Array(1024);
  private count = 0;

  clear(): void {
    this.keys.fill(-1);
    this.count = 0;
  }

  set(pair: number, timeNs: number): void {
    if (2 * (this.count + 1) > this.keys.length) this.grow();
    const at = this.find(pair);
    if (this.keys[at] < 0) {
      this.keys[at] = pair;
      this.count++;
    }
    this.times[at] = timeNs;
  }

  /** Calls `take` for all pairs that delivered at or after a time; forgets the others once they are most of the table. */
  each(sinceNs: number, take: (pair: number, timeNs: number) => void): void {
    const { keys, times } = this;
    let kept = 0;
    for (let i = 0; i < keys.length; i++) {
      if (keys[i] < 0 || times[i] < sinceNs) continue;
      kept++;
      take(keys[i], times[i]);
    }
    if (2 * kept < this.count && this.count > 512) this.rebuild(keys.length, sinceNs);
  }

  private grow(): void {
    this.rebuild(2 * this.keys.length, Number.NEGATIVE_INFINITY);
  }

  private rebuild(size: number, sinceNs: number): void {
    const { keys, times } = this;
    this.keys = new Float64Array(size).fill(-1);
    this.times = new Float64Array(size);
    this.count = 0;
    for (let i = 0; i < keys.length; i++) if (keys[i] >= 0 && times[i] >= sinceNs) this.set(keys[i], times[i]);
  }

  /** Place of a pair, or where it belongs. */
  private find(pair: number): number {
    const { keys } = this;
    const mask = keys.length - 1;
    let at = (Math.imul(Math.floor(pair / 0x4000000), 0x9e3779b1) ^ Math.imul(pair % 0x4000000, 0x85ebca6b)) >>> 0;
    at = (at ^ (at >>> 15)) & mask;
    while (keys[at] >= 0 && keys[at] !== pair) at = (at + 1) & mask;
    return at;
  }
}

/**
 * Finds links that failed: pairs that delivered within the last 5 s, whose sender sent and whose receiver did not receive now. Keeps the
 * latest delivery of each pair, so that playing forward costs one pass over the links of a frame.
 */
export class MissedLinks {
  /** By sender times 2^26 plus receiver: a whole number without rounding. */
  private readonly latest = new LatestDeliveries();
  private frames: FrameList | null = null;
  private generation = -1;
  private timeNs = -1;

  /** Calls `found` for each missed link of frame `index`. */
  find(frames: FrameList, index: number, found: (sender: number, receiver: number) => void): void {
    const frame = frames.frame(index);
    this.advance(frames, index);
    this.latest.each(frame.timeNs - MISSED_WITHIN_NS, (pair, heardNs) => {
      const sender = Math.floor(pair / 0x4000000);
      if (heardNs < frame.timeNs && frame.nSent.length > 0 && frame.nSent[sender] > 0) found(sender, pair % 0x4000000);
    });
  }

  private advance(frames: FrameList, index: number): void {
    const timeNs = frames.timeNs(index);
    let from = frames.indexAt(this.timeNs) + 1;
    const same = frames === this.frames && frames.generation === this.generation;
    const forward = same && timeNs >= this.timeNs && this.timeNs >= frames.timeNs(0);
    if (!forward || timeNs - this.timeNs > MISSED_WITHIN_NS) {
      this.latest.clear();
      from = Math.max(0, frames.indexAt(timeNs - MISSED_WITHIN_NS));
      if (frames.timeNs(from) < timeNs - MISSED_WITHIN_NS) from++;
    }
    for (let i = from; i <= index; i++) {
      const { links, timeNs: heardNs } = frames.frame(i);
      for (let k = 0; k < links.sender.length; k++) this.latest.set(links.sender[k] * 0x4000000 + links.receiver[k], heardNs);
    }
    this.frames = frames;
    this.generation = frames.generation;
    this.timeNs = timeNs;
  }
}

/** Position of a robot at the end of a step, interpolated if frames were left out; null if the frames around it are not loaded. */
export function positionAtStep(frames: FrameList, agent: number, step: number): [number, number] | null {
  const before = frames.indexAtStep(step);
  if (before < 0) return null;
  const a = frames.frame(before);
  if (a.step === step || before + 1 >= frames.length) return a.step === step ? [a.x[agent], a.y[agent]] : null;
  const b = frames.frame(before + 1);
  const share = (step - a.step) / (b.step - a.step);
  return [a.x[agent] + (b.x[agent] - a.x[agent]) * share, a.y[agent] + (b.y[agent] - a.y[agent]) * share];
}

/** Where a robot last heard each of its neighbours to be, by the deliveries of the loaded frames; the latest delivery of each counts. */
export function ghosts(frames: FrameList, index: number, receiver: number, found: Ghost[]): void {
  found.length = 0;
  const now = frames.frame(index);
  const known = new Set<number>();
  for (let i = index; i >= 0 && now.timeNs - frames.timeNs(i) <= GHOSTS_WITHIN_NS; i--) {
    const frame = frames.frame(i);
    const { links } = frame;
    for (let k = 0; k < links.receiver.length; k++) {
      const sender = links.sender[k];
      if (links.receiver[k] !== receiver || known.has(sender)) continue;
      known.add(sender);
      const step = frame.step - (links.stepsAgo.length > 0 ? links.stepsAgo[k] : 0);
      const at = positionAtStep(frames, sender, step);
      if (at === null) continue;
      found.push({
        neighbour: sender,
        x: at[0],
        y: at[1],
        errorM: Math.hypot(at[0] - now.x[sender], at[1] - now.y[sender]),
        agoNs: now.timeNs - frame.timeNs,
        rssiDbm: links.rssiDbm.length > 0 ? links.rssiDbm[k] : Number.NaN,
      });
    }
  }
}

/** How many neighbours each robot heard in a frame. */
export function neighboursHeard(frame: FrameData, counts: Uint32Array): void {
  counts.fill(0);
  for (const receiver of frame.links.receiver) counts[receiver]++;
}

/** Whether an agent exists in a frame. */
export function exists(frame: FrameData, agent: number): boolean {
  return frame.alive.length === 0 || bit(frame.alive, agent);
}

import type { FrameData } from "../source/frame.ts";
import type { FrameList } from "../source/frame-list.ts";
import { exists } from "./links.ts";

/** Frames further apart than this are not interpolated (ns). */
const MOST_APART_NS = 5e9;

/** Where robots are: exactly as in a frame, or while playing between two frames. */
export class Motion {
  x: Float32Array = new Float32Array(0);
  y: Float32Array = new Float32Array(0);
  heading: Float32Array = new Float32Array(0);
  private readonly between = { x: new Float32Array(0), y: new Float32Array(0), heading: new Float32Array(0) };

  /** Share of the way from frame `index` to the next at a time (ns): 0 if there is no next frame near. */
  static share(frames: FrameList, index: number, timeNs: number): number {
    if (index + 1 >= frames.length || !frames.follows(index + 1)) return 0;
    const apart = frames.timeNs(index + 1) - frames.timeNs(index);
    return apart > MOST_APART_NS ? 0 : Math.max(0, Math.min(1, (timeNs - frames.timeNs(index)) / apart));
  }

  /** Whether any robot moves or turns from one frame to the next. */
  static moves(frame: FrameData, next: FrameData): boolean {
    const differs = (a: Float32Array, b: Float32Array): boolean => a.some((value, i) => i < b.length && value !== b[i]);
    return differs(frame.x, next.x) || differs(frame.y, next.y) || differs(frame.heading, next.heading);
  }

  /** Places the robots on their straight way from one frame to the next. Robots that only one of them has stay where they are. */
  set(frame: FrameData, next: FrameData | null, share: number): void {
    if (next === null || share === 0) {
      ({ x: this.x, y: this.y, heading: this.heading } = frame);
      return;
    }
    const { between } = this;
    const count = frame.x.length;
    if (between.x.length !== count) [between.x, between.y] = [new Float32Array(count), new Float32Array(count)];
    if (between.heading.length !== frame.heading.length) between.heading = new Float32Array(frame.heading.length);
    const turns = frame.heading.length === count && next.heading.length >= count;
    for (let i = 0; i < count; i++) {
      const stays = i >= next.x.length || !exists(frame, i) || !exists(next, i);
      const part = stays ? 0 : share;
      between.x[i] = part === 0 ? frame.x[i] : frame.x[i] + (next.x[i] - frame.x[i]) * part;
      between.y[i] = part === 0 ? frame.y[i] : frame.y[i] + (next.y[i] - frame.y[i]) * part;
      if (frame.heading.length === 0) continue;
      let turn = turns ? next.heading[i] - frame.heading[i] : 0;
      // The shorter way round.
      turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
      between.heading[i] = frame.heading[i] + turn * part;
    }
    ({ x: this.x, y: this.y, heading: this.heading } = between);
  }
}

import { currentRun, endOfRuns, type App } from "./app.ts";
import { EventKind } from "./gen/murmuration/view/v1/view_pb.ts";
import { SPEEDS } from "./time-bar.ts";

/** Where the network forms later than in this share of the run, the run is opened at its beginning. */
const LATEST_SHARE = 0.9;
/** Playing the rest of a run takes at most about this time (s), if a speed of the list allows it. */
const LONGEST_S = 120;
/** Who wants no motion sees the run so long after its beginning (ns): by then there are links and trails. */
const STILL_NS = 10e9;
/** After this time the run is opened at its beginning, though the program has not found yet when the network formed (ms). */
const PATIENCE_MS = 5000;

/** Where a page begins that was opened without a time in its address. */
export interface Opened {
  timeNs: number;
  playing: boolean;
  speed: number;
}

/** Begins where the network has formed and robots start; plays from there, unless the viewer wants no motion. */
export function opened(formedNs: number | null, endNs: number, still: boolean): Opened {
  const beginNs = formedNs !== null && formedNs < LATEST_SHARE * endNs ? formedNs : 0;
  const restNs = endNs - beginNs;
  const speeds = SPEEDS.map(([speed]) => Number(speed)).filter((speed) => speed >= 1 && Number.isFinite(speed));
  const speed = speeds.find((candidate) => restNs / 1e9 / candidate <= LONGEST_S) ?? speeds[speeds.length - 1];
  return still ? { timeNs: beginNs + Math.min(STILL_NS, restNs / 2), playing: false, speed } : { timeNs: beginNs, playing: true, speed };
}

/** Opens a run at something worth seeing, as soon as it is known where that is. */
export class Opening {
  private beganMs: number | null = null;
  /** What the state was when the page was made: once the viewer has changed it, there is nothing left to do. */
  private readonly before: string;
  private done: boolean;

  /** `wanted`: the address names no time. */
  constructor(private readonly app: App, wanted: boolean, private readonly keepSpeed: boolean) {
    this.done = !wanted || app.source.live !== null;
    this.before = this.touched();
  }

  get pending(): boolean {
    return !this.done;
  }

  /** The viewer, or a report around the page, has chosen another time. */
  cancel(): void {
    this.done = true;
  }

  /** Called before every picture of the screen. */
  update(nowMs: number): void {
    if (this.done) return;
    this.beganMs ??= nowMs;
    if (this.touched() !== this.before) {
      this.done = true;
      return;
    }
    const { overview } = currentRun(this.app);
    const formed = overview.events.find((event) => event.kind === EventKind.FORMED);
    if (formed === undefined && !overview.complete && nowMs - this.beganMs < PATIENCE_MS) return;
    this.done = true;
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const { speed, ...begin } = opened(formed === undefined ? null : Number(formed.timeNs), endOfRuns(this.app), still);
    this.app.store.set(this.keepSpeed ? begin : { ...begin, speed });
  }

  private touched(): string {
    const { timeNs, playing, selected, packet, speed } = this.app.store.state;
    return [timeNs, playing, selected, packet, speed].join();
  }
}

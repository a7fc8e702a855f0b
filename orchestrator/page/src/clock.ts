import { type App, currentRun, endOfRuns } from "./app.ts";

/** Pictures per second that fast playing aims at. */
const PICTURES_PER_SECOND = 30;
/** "As fast as possible" shows a finished run in at least so many frames. */
const FASTEST_FRAMES = 600;

/** Advances the time while playing and asks the source for the frames around it. */
export class Clock {
  private beforeMs = 0;

  constructor(private readonly app: App) {}

  /** Called before every picture of the screen. */
  tick(nowMs: number): void {
    // A tab in the background is not told of the time for long: do not jump by it.
    const elapsedS = Math.min(0.25, Math.max(0, (nowMs - this.beforeMs) / 1000));
    this.beforeMs = nowMs;
    const { store, source } = this.app;
    if (source.live !== null && store.state.atLive) {
      const { frames } = currentRun(this.app);
      if (frames.length > 0) store.set({ timeNs: frames.timeNs(frames.length - 1) });
      return;
    }
    if (store.state.playing) this.advance(elapsedS);
    const { timeNs, playing } = store.state;
    const steps = this.stepsPerFrame();
    for (const run of source.runs) run.want(timeNs, playing, steps);
  }

  private advance(elapsedS: number): void {
    const { store, source } = this.app;
    const { timeNs, speed } = store.state;
    const end = endOfRuns(this.app);
    const next = Math.min(end, speed === Number.POSITIVE_INFINITY ? this.nextFrameNs() : timeNs + elapsedS * speed * 1e9);
    if (!source.runs.every((run) => run.ready(next))) return;
    if (next >= end) {
      store.set(source.live === null ? { timeNs: end, playing: false } : { timeNs: end, playing: false, atLive: true });
    } else {
      store.set({ timeNs: next });
    }
  }

  private nextFrameNs(): number {
    const { frames } = currentRun(this.app);
    const every = this.app.source.kind === "embedded" ? Math.ceil(frames.length / FASTEST_FRAMES) : 1;
    const next = frames.indexAt(this.app.store.state.timeNs) + Math.max(1, every);
    return next < frames.length ? frames.timeNs(next) : endOfRuns(this.app);
  }

  /** Steps that playing advances per picture; recordings that are served leave the others out. */
  private stepsPerFrame(): number {
    const { run } = currentRun(this.app);
    const { speed } = this.app.store.state;
    if (speed === Number.POSITIVE_INFINITY) return Math.ceil(Number(run.stepCount) / FASTEST_FRAMES);
    return (speed * 1e9) / Number(run.stepNs) / PICTURES_PER_SECOND;
  }
}

import { type App, currentRun, type Exported } from "../app.ts";
import type { FrameData } from "../source/frame.ts";
import type { RunData } from "../source/source.ts";

/** One of the panes of the network view. */
export interface NetworkPanel {
  readonly root: HTMLElement;
  render(): void;
  exported(): Exported | null;
}

/** While playing, panes that cost much are drawn at most so often (ms). */
const REFRESH_MS = 150;

/** Decides whether a pane has to be drawn again: what it shows has changed, and while playing the latest drawing is not too young. */
export class Redraw {
  private key = "";
  private drawnMs = 0;

  constructor(private readonly app: App) {}

  due(...parts: unknown[]): boolean {
    const { state } = this.app.store;
    const key = [this.app.theme.dark, state.run, state.selected, window.devicePixelRatio, ...parts].join();
    const now = performance.now();
    if (key === this.key || ((state.playing || state.atLive) && now - this.drawnMs < REFRESH_MS)) return false;
    this.key = key;
    this.drawnMs = now;
    return true;
  }
}

/** The current run and its frame at the current time; null while it is not loaded. */
export function currentFrame(app: App): { data: RunData; frame: FrameData; index: number } | null {
  const data = currentRun(app);
  const { timeNs } = app.store.state;
  if (!data.ready(timeNs)) return null;
  const index = data.frames.indexAt(timeNs);
  return { data, frame: data.frames.frame(index), index };
}

/** The latest entry of a list in the order of time that is not after a time. */
export function latestAt<Entry extends { timeNs: bigint }>(entries: readonly Entry[], timeNs: number): Entry | undefined {
  return entries.findLast((entry) => Number(entry.timeNs) <= timeNs);
}

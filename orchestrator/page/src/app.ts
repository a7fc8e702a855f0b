import type { Follower } from "./network/follower.ts";
import type { RunData, Source } from "./source/source.ts";
import type { Store } from "./store.ts";
import type { Theme } from "./swarm/colours.ts";

/** What views share. */
export interface App {
  readonly store: Store;
  readonly source: Source;
  /** Finds the way of the followed packet. */
  readonly follower: Follower;
  /** Colours of the theme in force. */
  theme: Theme;
  /** Counts pictures whose pixels have changed. */
  framesDrawn: number;
  /** What went wrong with the last order to the simulation; empty: nothing. */
  problem: string;
  /** Shows a robot's details; puts it into the middle of the picture, or only if it is outside of the picture. */
  select(agent: number | null, camera?: "stay" | "show" | "centre"): void;
  /** Goes to a time (ns) and stops following the simulation. */
  seek(timeNs: number): void;
}

/** The run that the swarm and network views show. */
export function currentRun(app: App): RunData {
  return app.source.runs[Math.min(app.store.state.run, app.source.runs.length - 1)];
}

/** The latest time of all runs (ns). */
export function endOfRuns(app: App): number {
  return app.source.runs.reduce((end, run) => Math.max(end, run.endNs), 0);
}

/** A view in the main area. */
export interface ViewPanel {
  readonly root: HTMLElement;
  /** Called before every picture of the screen while the view is shown; draws only if something has changed. */
  render(): void;
  /** What the view shows, for files: its size, and how to draw it. */
  exported(): Exported | null;
}

/** What a view writes to SVG and PNG files. */
export interface Exported {
  width: number;
  height: number;
  svg(): string;
  paint(context: CanvasRenderingContext2D, ratio: number): void;
}

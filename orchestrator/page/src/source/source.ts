import type { Measurements, Overview, Run } from "../gen/murmuration/view/v1/view_pb.ts";
import type { FrameData } from "./frame.ts";
import type { FrameList } from "./frame-list.ts";

/** A run as the views see it, wherever its data come from. */
export interface RunData {
  readonly run: Run;
  readonly overview: Overview;
  /** Counts the changes of `overview`, so that views need not compare it. */
  readonly overviewVersion: number;
  /** The frames that are loaded: all of them, or a window around the time shown. */
  readonly frames: FrameList;
  /** The latest time that can be shown (ns). */
  readonly endNs: number;
  /** Frames have been asked for and have not arrived yet. */
  readonly loading: boolean;
  /** Whether the frame for a time is among those loaded. */
  ready(timeNs: number): boolean;
  /** Loads frames around a time, if they are not loaded. `stepsPerFrame` is how many steps playing advances with each frame drawn. */
  want(timeNs: number, playing: boolean, stepsPerFrame: number): void;
  /**
   * The frame at a time, if there is one, and all frames after it until the first that is not before another time (ns). What `frames`
   * holds stays as it is.
   */
  between(fromNs: number, untilNs: number, signal: AbortSignal): Promise<FrameData[]>;
}

/** Orders that a viewer gives to a running simulation. */
export type LiveOrder = "pause" | "resume" | "step";

/** How a simulation that is still running goes. */
export interface LiveState {
  reachedNs: number;
  lagS: number;
  speed: number;
  paused: boolean;
}

/** Where runs come from. */
export interface Source {
  readonly kind: "embedded" | "served" | "live";
  /** One run, or two to compare. */
  readonly runs: RunData[];
  /** The model against measurements, if they were given. */
  readonly measurements: Measurements | undefined;
  /** How the simulation goes; null unless it is running. */
  readonly live: LiveState | null;
  /** Short words for the status line; empty if there is nothing to say. */
  readonly status: string;
  /** Orders the simulation to pause, resume or take a step. */
  control(order: LiveOrder): Promise<void>;
}

/** What a source calls when its data change, or when it cannot go on. */
export interface SourceListener {
  changed(): void;
  failed(error: Error): void;
  /** The simulation has ended: the listener opens the finished run instead. */
  ended(): void;
}

import { create } from "@bufbuild/protobuf";
import { FramesSchema, type Measurements, type Overview, OverviewSchema, type Run, type Runs } from "../gen/murmuration/view/v1/view_pb.ts";
import type { Api } from "./api.ts";
import { decodeFrame, type FrameData } from "./frame.ts";
import { FrameList } from "./frame-list.ts";
import type { RunData, Source, SourceListener } from "./source.ts";
import { splitRepeated } from "./wire.ts";

/** Trails, ghosts and missed links look this far back (ns). */
const BEHIND_NS = 10e9;
/** Runs with at most this many steps, and robots times steps, are loaded as a whole. */
const WHOLE_STEPS = 1900;
const WHOLE_ROBOT_STEPS = 2e6;
/** Frames that one request may ask for. */
const MOST_PER_REQUEST = 2000;
/** While the program still reads the recording, its overview is asked for again after this time (ms). */
const OVERVIEW_POLL_MS = 500;

class ServedRun implements RunData {
  overview: Overview = create(OverviewSchema);
  overviewVersion = 0;
  readonly frames = new FrameList();
  private whole = false;
  private stride = 1;
  private request: { fromNs: number; untilNs: number; stride: number; abort: AbortController } | null = null;

  constructor(
    readonly run: Run,
    private readonly index: number,
    private readonly api: Api,
    private readonly listener: SourceListener,
  ) {
    void this.pollOverview();
  }

  get loading(): boolean {
    return this.request !== null;
  }

  get endNs(): number {
    return Number(this.run.endNs);
  }

  ready(timeNs: number): boolean {
    return this.frames.length > 0 && this.covers(Math.min(timeNs, this.endNs));
  }

  want(timeNs: number, playing: boolean, stepsPerFrame: number): void {
    if (this.whole) return;
    // Powers of two, so that a small change of speed keeps the window that is loaded.
    const stride = playing ? 2 ** Math.floor(Math.log2(Math.max(1, stepsPerFrame))) : 1;
    const time = Math.min(timeNs, this.endNs);
    const last = this.frames.length - 1;
    const loaded = last >= 0 && stride === this.stride && this.covers(time) && this.reachesBack(time);
    if (!loaded) {
      const pending = this.request;
      if (pending !== null && pending.stride === stride && time >= pending.fromNs && time <= pending.untilNs) return;
      void this.seek(time, stride);
      return;
    }
    const lastNs = this.frames.timeNs(last);
    if (playing && this.request === null && lastNs < this.lastFrameNs && lastNs - time < this.aheadNs(stride) / 2) {
      void this.extend(lastNs, stride);
    }
  }

  async between(fromNs: number, untilNs: number, signal: AbortSignal): Promise<FrameData[]> {
    const last = this.frames.length - 1;
    const loaded = last >= 0 && this.stride === 1 && this.frames.timeNs(0) <= fromNs && this.frames.timeNs(last) >= Math.min(untilNs, this.lastFrameNs);
    if (loaded) return this.frames.between(fromNs, untilNs);
    const found: FrameData[] = [];
    const end = Math.min(untilNs + this.stepNs, this.endNs);
    let from = fromNs;
    for (;;) {
      // An answer holds a limited number of frames and bytes: the next request goes on where it ended.
      const most = Math.min(MOST_PER_REQUEST, Math.ceil((end - from) / this.stepNs) + 2);
      const until = Math.min(end, from + (most - 2) * this.stepNs);
      const frames = (await this.ask(from, until, most, signal)).map(decodeFrame);
      const later = frames.filter((frame) => found.length === 0 || frame.timeNs > found[found.length - 1].timeNs);
      found.push(...later);
      const reachedNs = found[found.length - 1]?.timeNs ?? end;
      if (reachedNs >= Math.min(untilNs, this.lastFrameNs) || (later.length === 0 && until >= end)) return found;
      from = later.length === 0 ? until : reachedNs;
    }
  }

  /** Time after which no further frame is to be expected (ns): steps may be shorter than the control period, never longer by much. */
  private get lastFrameNs(): number {
    return this.endNs - 1;
  }

  private covers(timeNs: number): boolean {
    const last = this.frames.length - 1;
    const end = Math.min(this.frames.timeNs(last) + this.stepNs * this.stride, this.endNs);
    return timeNs >= this.frames.timeNs(0) && timeNs <= end;
  }

  /** Whether enough frames before a time are loaded for trails, ghosts and missed links. */
  private reachesBack(timeNs: number): boolean {
    return this.frames.timeNs(0) <= Math.max(0, timeNs - BEHIND_NS / 2) + this.stepNs * this.stride;
  }

  private get stepNs(): number {
    const steps = Number(this.run.stepCount);
    return steps > 0 ? this.endNs / steps : Number(this.run.stepNs);
  }

  private get fitsWhole(): boolean {
    const steps = Number(this.run.stepCount);
    return steps <= WHOLE_STEPS && steps * this.run.agentCount <= WHOLE_ROBOT_STEPS;
  }

  /** How far ahead of the time shown frames are loaded (ns): at most 150 of them, fewer of large swarms. */
  private aheadNs(stride: number): number {
    const frames = Math.min(150, Math.max(20, Math.floor(6e5 / Math.max(1, this.run.agentCount))));
    return frames * stride * this.stepNs;
  }

  private async seek(timeNs: number, stride: number): Promise<void> {
    const whole = this.fitsWhole;
    const fromNs = whole ? 0 : Math.max(0, timeNs - BEHIND_NS);
    const untilNs = whole ? this.endNs : Math.min(this.endNs, timeNs + this.aheadNs(stride));
    await this.load({ fromNs, untilNs, stride: whole ? 1 : stride }, async (signal) => {
      // The frame to be shown comes first: the window around it may take a while.
      const alone = this.ready(timeNs) ? null : await this.ask(timeNs, timeNs, 1, signal);
      if (alone !== null) {
        this.frames.replace(alone);
        this.listener.changed();
      }
      const most = Math.min(MOST_PER_REQUEST, Math.ceil((untilNs - fromNs) / (this.stepNs * (whole ? 0.5 : stride))) + 1);
      const frames = await this.ask(fromNs, untilNs, most, signal);
      this.frames.replace(frames);
      this.stride = whole ? 1 : stride;
      this.whole = whole;
    });
  }

  private async extend(lastNs: number, stride: number): Promise<void> {
    const untilNs = Math.min(this.endNs, lastNs + this.aheadNs(stride));
    const most = Math.min(MOST_PER_REQUEST, Math.max(1, Math.round((untilNs - lastNs) / (stride * this.stepNs))));
    await this.load({ fromNs: lastNs, untilNs, stride }, async (signal) => {
      this.frames.append(await this.ask(lastNs, untilNs, most, signal));
      const behind = this.frames.indexAt(lastNs - this.aheadNs(stride) - BEHIND_NS);
      if (behind > 0) this.frames.dropFirst(behind);
    });
  }

  private async ask(fromNs: number, untilNs: number, most: number, signal: AbortSignal): Promise<Uint8Array[]> {
    const bytes = await this.api.frames(this.index, fromNs, untilNs, most, signal);
    return splitRepeated(bytes, FramesSchema.field.frames.number).entries;
  }

  /** Runs one request at a time; a later one aborts the one before. */
  private async load(
    span: { fromNs: number; untilNs: number; stride: number },
    work: (signal: AbortSignal) => Promise<void>,
  ): Promise<void> {
    this.request?.abort.abort();
    const request = { ...span, abort: new AbortController() };
    this.request = request;
    try {
      await work(request.abort.signal);
      this.listener.changed();
    } catch (error) {
      if (!request.abort.signal.aborted) this.listener.failed(error as Error);
    } finally {
      if (this.request === request) this.request = null;
    }
  }

  private async pollOverview(): Promise<void> {
    try {
      do {
        if (this.overviewVersion > 0) await new Promise((resolve) => setTimeout(resolve, OVERVIEW_POLL_MS));
        this.overview = await this.api.overview(this.index);
        this.overviewVersion++;
        this.listener.changed();
      } while (!this.overview.complete);
    } catch (error) {
      this.listener.failed(error as Error);
    }
  }
}

class ServedSource implements Source {
  readonly kind = "served";
  readonly live = null;

  constructor(
    readonly runs: ServedRun[],
    readonly measurements: Measurements | undefined,
  ) {}

  get status(): string {
    const reading = this.runs.find((run) => run.overviewVersion > 0 && !run.overview.complete);
    if (reading === undefined) return "";
    return `timeline loaded up to ${(Number(reading.overview.untilNs) / 1e9).toFixed(0)} s`;
  }

  control(): Promise<void> {
    return Promise.resolve();
  }
}

/** Opens finished recordings that the program serves. */
export function openServed({ runs, measurements }: Runs, api: Api, listener: SourceListener): Source {
  return new ServedSource(runs.map((run, index) => new ServedRun(run, index, api, listener)), measurements);
}

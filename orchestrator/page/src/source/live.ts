import { create, fromBinary } from "@bufbuild/protobuf";
import { PacketsSchema } from "../gen/cosim/v1/netsim_pb.ts";
import { ControlKind, LiveSchema, type Overview, OverviewSchema, type Run, type Series } from "../gen/murmuration/view/v1/view_pb.ts";
import type { Api } from "./api.ts";
import type { FrameData } from "./frame.ts";
import { FrameList } from "./frame-list.ts";
import type { LiveOrder, LiveState, RunData, Source, SourceListener } from "./source.ts";
import { concatenate, splitRepeated } from "./wire.ts";

/** Frames kept for looking back: whichever limit is reached first. */
const RING_FRAMES = 3000;
const RING_BYTES = 200e6;
/** Points of a series beyond this are thinned to half. */
const SERIES_POINTS = 4000;

class LiveRun implements RunData {
  readonly overview: Overview = create(OverviewSchema);
  overviewVersion = 0;
  readonly frames = new FrameList();
  readonly loading = false;
  reachedNs = 0;

  constructor(readonly run: Run) {}

  get endNs(): number {
    const last = this.frames.length - 1;
    return Math.max(this.reachedNs, last >= 0 ? this.frames.timeNs(last) : 0);
  }

  ready(timeNs: number): boolean {
    return this.frames.length > 0 && timeNs >= this.frames.timeNs(0);
  }

  want(): void {}

  between(fromNs: number, untilNs: number): Promise<FrameData[]> {
    return Promise.resolve(this.frames.between(fromNs, untilNs));
  }

  addFrames(frames: Uint8Array[]): void {
    this.frames.append(frames);
    let excess = this.frames.length - RING_FRAMES;
    if (this.frames.bytes > RING_BYTES) excess = Math.max(excess, Math.ceil(this.frames.length / 20));
    if (excess > 0) this.frames.dropFirst(excess);
  }

  addOverview(added: Overview): void {
    const whole = this.overview;
    // Messages that add nothing must not make the views draw again.
    const some = added.events.length + added.schedules.length + added.statistics.length + added.series.length > 0 || added.packets !== undefined;
    if (some) this.overviewVersion++;
    whole.events.push(...added.events);
    whole.schedules.push(...added.schedules);
    whole.statistics.push(...added.statistics);
    if (whole.statistics.length > 400) whole.statistics.splice(0, whole.statistics.length - 400);
    whole.untilNs = added.untilNs > whole.untilNs ? added.untilNs : whole.untilNs;
    whole.packetsLeftOut += added.packetsLeftOut;
    for (const series of added.series) addSeries(whole.series, series);
    if (added.packets !== undefined) {
      whole.packets ??= create(PacketsSchema);
      const packets = whole.packets;
      const columns = ["id", "kind", "source", "destination", "createdNs", "endedNs", "hops", "payloadBytes", "outcome"] as const;
      for (const column of columns) (packets[column] as unknown[]).push(...added.packets[column]);
      if (added.packets.kinds.length > 0) packets.kinds = added.packets.kinds;
      if (added.packets.reasons.length > 0) packets.reasons = added.packets.reasons;
    }
  }
}

function addSeries(all: Series[], added: Series): void {
  const known = all.find((series) => series.name === added.name);
  if (known === undefined) {
    all.push(added);
    return;
  }
  known.timeS.push(...added.timeS);
  known.value.push(...added.value);
  if (known.timeS.length > SERIES_POINTS) {
    known.timeS = known.timeS.filter((_, i) => i % 2 === 1);
    known.value = known.value.filter((_, i) => i % 2 === 1);
  }
}

class LiveSource implements Source {
  readonly kind = "live";
  readonly runs: RunData[];
  readonly measurements = undefined;
  readonly status = "";
  live: LiveState = { reachedNs: 0, lagS: 0, speed: 0, paused: false };

  constructor(
    private readonly run: LiveRun,
    private readonly api: Api,
    private readonly listener: SourceListener,
  ) {
    this.runs = [run];
    this.read().catch((error: Error) => listener.failed(error));
  }

  async control(order: LiveOrder): Promise<void> {
    const kinds = { pause: ControlKind.PAUSE, resume: ControlKind.RESUME, step: ControlKind.STEP };
    await this.api.control(kinds[order]);
  }

  private async read(): Promise<void> {
    const reader = (await this.api.live()).getReader();
    const splitter = new LengthPrefixed();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      const messages = splitter.push(value);
      if (messages.length === 0) continue;
      for (const message of messages) {
        if (this.take(message)) {
          await reader.cancel();
          this.listener.ended();
          return;
        }
      }
      this.listener.changed();
    }
    throw new Error("The program closed the live stream before the run ended. Check that it still runs, then reload the page.");
  }

  /** Takes a `Live` message; true if it is the last one. */
  private take(message: Uint8Array): boolean {
    const { entries, rest } = splitRepeated(message, LiveSchema.field.frame.number);
    this.run.addFrames(entries);
    const live = fromBinary(LiveSchema, rest);
    if (live.added !== undefined) this.run.addOverview(live.added);
    if (live.status !== undefined) {
      const { reachedNs, lagS, speed, paused, ended } = live.status;
      this.live = { reachedNs: Number(reachedNs), lagS, speed, paused };
      this.run.reachedNs = Number(reachedNs);
      return ended;
    }
    return false;
  }
}

/** Cuts a stream of bytes into messages, each of which follows its length as a varint. */
export class LengthPrefixed {
  private parts: Uint8Array[] = [];
  private size = 0;
  /** Bytes that must have arrived before cutting is worth trying again. */
  private needed = 1;

  push(bytes: Uint8Array): Uint8Array[] {
    this.parts.push(bytes);
    this.size += bytes.length;
    if (this.size < this.needed) return [];
    const all = this.parts.length === 1 ? bytes : concatenate(this.parts);
    const messages: Uint8Array[] = [];
    let at = 0;
    for (;;) {
      let length = 0;
      let scale = 1;
      let start = at;
      while (start < all.length && all[start] >= 0x80) {
        length += (all[start++] & 0x7f) * scale;
        scale *= 128;
      }
      if (start >= all.length) {
        this.needed = all.length - at + 1;
        break;
      }
      length += all[start++] * scale;
      if (start + length > all.length) {
        this.needed = start - at + length;
        break;
      }
      messages.push(all.subarray(start, start + length));
      at = start + length;
    }
    this.parts = at < all.length ? [all.subarray(at)] : [];
    this.size = all.length - at;
    return messages;
  }
}

/** Watches a simulation that is running. */
export function openLive(run: Run, api: Api, listener: SourceListener): Source {
  return new LiveSource(new LiveRun(run), api, listener);
}

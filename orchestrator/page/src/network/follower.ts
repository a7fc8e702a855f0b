import { type App, currentRun } from "../app.ts";
import { seconds } from "../format.ts";
import { radioFrames } from "../source/frame.ts";
import type { RunData } from "../source/source.ts";
import { framesOf, packetIndex, packetSummary, placeWay, type Way, wayOf } from "./way.ts";

/** A frame of the recording that covers several steps lists at most so many radio frames. */
const MOST_FRAMES = 5000;
/** Time on the air of the longest frame where there are no slots (ns). */
const LONGEST_FRAME_NS = 4_256_000;

export const NO_RADIO_FRAMES = "This recording holds no radio frames; record them with output.frames = true.";

/** Finds the way of the followed packet, whichever part of the recording is loaded. */
export class Follower {
  /** The way of the followed packet; null: none is followed, or it is not known (yet). */
  way: Way | null = null;
  /** The run that the way belongs to. */
  data: RunData | null = null;
  /** Why there is no way; empty if there is one, or if no packet is followed. */
  problem = "";
  /** Counts the changes of what is above. */
  version = 0;
  private searched = "";
  private key = "";
  private request: AbortController | null = null;

  constructor(private readonly app: App) {}

  /** Frames have been asked for and have not arrived yet. */
  get loading(): boolean {
    return this.request !== null;
  }

  /** Looks for the way if another packet is followed, or if the list of packets has grown. Called before every picture of the screen. */
  update(): void {
    const { packet, run } = this.app.store.state;
    const data = currentRun(this.app);
    const searched = [packet, run, data.overviewVersion, data.overview.complete].join();
    if (searched === this.searched) return;
    this.searched = searched;
    const known = packet === null ? -1 : packetIndex(data.overview.packets, packet);
    const key = packet === null ? "" : [packet, run, known >= 0, known < 0 && data.overview.complete].join();
    if (key === this.key) return;
    this.key = key;
    this.request?.abort();
    this.request = null;
    this.data = data;
    const { packets } = data.overview;
    if (packet === null) this.show(null, "");
    else if (packets === undefined || known < 0) {
      this.show(null, data.overview.complete || data.run.live ? `The list of packets holds no packet ${packet}.` : "Loading packets …");
    } else {
      this.show(null, "Loading frames …");
      void this.load(data, known);
    }
  }

  private show(way: Way | null, problem: string): void {
    this.way = way;
    this.problem = problem;
    this.version++;
  }

  private async load(data: RunData, index: number): Promise<void> {
    const request = new AbortController();
    this.request = request;
    try {
      const packet = packetSummary(data.overview.packets as NonNullable<typeof data.overview.packets>, index);
      const slotNs = Number(data.run.slotNs) || LONGEST_FRAME_NS;
      const stepNs = Number(data.run.stepNs);
      const recorded = await data.between(Math.max(0, packet.createdNs - stepNs), packet.endedNs + slotNs, request.signal);
      if (request.signal.aborted) return;
      const frames = framesOf(packet.id, recorded);
      const first = data.frames.length > 0 ? data.frames.timeNs(0) : 0;
      if (frames === null) {
        const dropped = data.run.live && first > packet.createdNs;
        this.show(null, dropped ? `The steps of this packet are no longer at hand: the page keeps those since ${seconds(first)}.` : NO_RADIO_FRAMES);
      } else {
        const way = wayOf(packet, frames, slotNs);
        placeWay(way, recorded);
        way.incomplete = recorded.some((frame) => frame.timeNs - frame.fromNs > 1.5 * stepNs && (radioFrames(frame)?.length ?? 0) >= MOST_FRAMES);
        this.show(way, "");
      }
    } catch (error) {
      if (!request.signal.aborted) this.show(null, `The frames of this packet cannot be loaded: ${(error as Error).message}`);
    } finally {
      if (this.request === request) this.request = null;
    }
  }
}

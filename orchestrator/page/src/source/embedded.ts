import { fromBinary } from "@bufbuild/protobuf";
import { type Measurements, type Overview, OverviewSchema, RecordingSchema, RecordingsSchema, type Run } from "../gen/murmuration/view/v1/view_pb.ts";
import type { FrameData } from "./frame.ts";
import { FrameList } from "./frame-list.ts";
import type { LiveOrder, RunData, Source } from "./source.ts";
import { splitRepeated } from "./wire.ts";

class EmbeddedRun implements RunData {
  readonly run: Run;
  readonly overview: Overview;
  readonly overviewVersion = 1;
  readonly frames = new FrameList();
  readonly loading = false;

  constructor(bytes: Uint8Array) {
    const { entries, rest } = splitRepeated(bytes, RecordingSchema.field.frames.number);
    const recording = fromBinary(RecordingSchema, rest);
    if (recording.run === undefined) throw new Error("the recording in this page has no run: make the page again");
    this.run = recording.run;
    this.overview = recording.overview ?? fromBinary(OverviewSchema, new Uint8Array(0));
    this.frames.append(entries);
  }

  get endNs(): number {
    const last = this.frames.length > 0 ? this.frames.timeNs(this.frames.length - 1) : 0;
    return Math.max(last, Number(this.run.endNs));
  }

  ready(timeNs: number): boolean {
    return this.frames.length > 0 && timeNs >= this.frames.timeNs(0);
  }

  want(): void {}

  between(fromNs: number, untilNs: number): Promise<FrameData[]> {
    return Promise.resolve(this.frames.between(fromNs, untilNs));
  }
}

class EmbeddedSource implements Source {
  readonly kind = "embedded";
  readonly live = null;
  readonly status = "";

  constructor(
    readonly runs: RunData[],
    readonly measurements: Measurements | undefined,
  ) {}

  control(_order: LiveOrder): Promise<void> {
    return Promise.resolve();
  }
}

/** Opens the recordings that the page holds in `<script id="recording">`: base64 of the gzip of `Recordings`. */
export async function openEmbedded(script: HTMLElement): Promise<Source> {
  const text = atob((script.textContent ?? "").trim());
  const zipped = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) zipped[i] = text.charCodeAt(i);
  const stream = new Blob([zipped]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const { entries, rest } = splitRepeated(bytes, RecordingsSchema.field.recordings.number);
  if (entries.length === 0) throw new Error("the recording in this page is empty: make the page again");
  script.remove();
  return new EmbeddedSource(entries.map((entry) => new EmbeddedRun(entry)), fromBinary(RecordingsSchema, rest).measurements);
}

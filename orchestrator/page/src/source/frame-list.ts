import { decodeFrame, type FrameData, frameTimes } from "./frame.ts";

interface Slot {
  step: number;
  timeNs: number;
  fromNs: number;
  bytes: Uint8Array;
  data: FrameData | null;
}

/** Decoded frames are kept up to about this many bytes of their encoded form. */
const DECODED_LIMIT_BYTES = 120e6;

/** Loaded frames in the order of time. They stay encoded until they are looked at. */
export class FrameList {
  private slots: Slot[] = [];
  private readonly decoded: Slot[] = [];
  private decodedBytes = 0;
  private encodedBytes = 0;
  /** Counts how often all frames were replaced by others. */
  generation = 0;

  get length(): number {
    return this.slots.length;
  }

  /** Size of all loaded frames, encoded (bytes). */
  get bytes(): number {
    return this.encodedBytes;
  }

  /** End of the step of frame `i` (ns). */
  timeNs(i: number): number {
    return this.slots[i].timeNs;
  }

  /** Number of the step of frame `i`. */
  step(i: number): number {
    return this.slots[i].step;
  }

  /** Whether frame `i` follows frame `i - 1` in the sequence it was made for. */
  follows(i: number): boolean {
    return i > 0 && this.slots[i].fromNs <= this.slots[i - 1].timeNs;
  }

  /** Index of the last frame not after a time (ns); -1 if there is none. */
  indexAt(timeNs: number): number {
    let low = 0;
    let high = this.slots.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.slots[middle].timeNs <= timeNs) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** Index of the last frame not after a step; -1 if there is none. */
  indexAtStep(step: number): number {
    let low = 0;
    let high = this.slots.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.slots[middle].step <= step) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  /** Frame `i`, decoded now if it was not before. */
  frame(i: number): FrameData {
    const slot = this.slots[i];
    if (slot.data === null) {
      slot.data = decodeFrame(slot.bytes);
      this.decoded.push(slot);
      this.decodedBytes += slot.bytes.length;
      while (this.decodedBytes > DECODED_LIMIT_BYTES && this.decoded.length > 1) {
        const oldest = this.decoded.shift() as Slot;
        oldest.data = null;
        this.decodedBytes -= oldest.bytes.length;
      }
    }
    return slot.data;
  }

  /** The frame at a time, if there is one, and all loaded frames after it until the first that is not before another time (ns). */
  between(fromNs: number, untilNs: number): FrameData[] {
    const found: FrameData[] = [];
    for (let i = Math.max(0, this.indexAt(fromNs)); i < this.slots.length; i++) {
      found.push(this.frame(i));
      if (this.slots[i].timeNs >= untilNs) break;
    }
    return found;
  }

  /** Appends encoded frames that are later than the last one loaded; others are ignored. */
  append(frames: Uint8Array[]): void {
    for (const bytes of frames) {
      const slot = { ...frameTimes(bytes), bytes, data: null };
      const last = this.slots[this.slots.length - 1];
      if (last !== undefined && slot.timeNs <= last.timeNs) continue;
      this.slots.push(slot);
      this.encodedBytes += bytes.length;
    }
  }

  /** Forgets all frames and loads others. */
  replace(frames: Uint8Array[]): void {
    this.generation++;
    this.dropFirst(this.slots.length);
    this.append(frames);
  }

  /** Forgets the first `count` frames. */
  dropFirst(count: number): void {
    for (const slot of this.slots.splice(0, count)) {
      this.encodedBytes -= slot.bytes.length;
      if (slot.data === null) continue;
      this.decoded.splice(this.decoded.indexOf(slot), 1);
      this.decodedBytes -= slot.bytes.length;
    }
  }
}

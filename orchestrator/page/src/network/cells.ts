import type { Schedule } from "../gen/cosim/v1/netsim_pb.ts";
import { NO_MOTE } from "../source/frame.ts";
import type { RadioFrame } from "../source/radio.ts";

/** Link options of IEEE Std 802.15.4-2015, 8.4.2.2.2. */
export const TRANSMIT = 1;
export const RECEIVE = 2;
export const SHARED = 4;

/** A mote's part in a cell. */
export interface Role {
  mote: number;
  neighbour: number;
}

/** A slot and channel offset of a slotframe, with all motes that use it. */
export interface Cell {
  slot: number;
  channel: number;
  transmitters: Role[];
  receivers: Role[];
  shared: boolean;
}

/** The slotframes of a schedule: handle and length (slots), by handle. */
export function slotframes(schedule: Schedule): Map<number, number> {
  const found = new Map<number, number>();
  schedule.slotframe.forEach((handle, i) => found.set(handle, Math.max(found.get(handle) ?? 0, schedule.slotframeSlots[i])));
  return new Map([...found].sort((a, b) => a[0] - b[0]));
}

/** The cells of one slotframe over all motes. */
export function cells(schedule: Schedule, handle: number): Cell[] {
  const found = new Map<string, Cell>();
  for (let i = 0; i < schedule.mote.length; i++) {
    if (schedule.slotframe[i] !== handle) continue;
    const slot = schedule.slot[i];
    const channel = schedule.channelOffset[i];
    const key = `${slot} ${channel}`;
    let cell = found.get(key);
    if (cell === undefined) found.set(key, (cell = { slot, channel, transmitters: [], receivers: [], shared: false }));
    const role = { mote: schedule.mote[i], neighbour: schedule.neighbour[i] };
    if ((schedule.options[i] & TRANSMIT) !== 0) cell.transmitters.push(role);
    if ((schedule.options[i] & RECEIVE) !== 0) cell.receivers.push(role);
    if ((schedule.options[i] & SHARED) !== 0) cell.shared = true;
  }
  return [...found.values()];
}

/** Whether two motes may transmit at once in a cell that is not meant to be shared. */
export function mayCollide(cell: Cell): boolean {
  return !cell.shared && cell.transmitters.length > 1;
}

/** Slot offset in a slotframe at a time (ns). */
export function slotAt(timeNs: number, slotNs: number, slotframeSlots: number): number {
  return Math.floor(timeNs / slotNs) % slotframeSlots;
}

/** What was sent in a cell during a step. */
export interface Use {
  slot: number;
  channel: number;
  frames: RadioFrame[];
  /** Frames of two or more motes were on the same channel in the same slot, and somebody who listened missed one of them. */
  collision: boolean;
  /** All of them were sent in cells of another slotframe, as far as the schedule shows. */
  foreign: boolean;
}

/** Looks up which motes have which part in the cells of some slotframes. */
class CellIndex {
  private readonly lengths = new Set<number>();
  private readonly roles = new Set<string>();

  constructor(schedule: Schedule, wanted: (handle: number) => boolean) {
    for (let i = 0; i < schedule.mote.length; i++) {
      if (!wanted(schedule.slotframe[i])) continue;
      const length = schedule.slotframeSlots[i];
      this.lengths.add(length);
      const cell = `${length} ${schedule.slot[i]} ${schedule.channelOffset[i]}`;
      if ((schedule.options[i] & TRANSMIT) !== 0) this.roles.add(`${cell} ${schedule.mote[i]} t`);
      if ((schedule.options[i] & RECEIVE) !== 0) this.roles.add(`${cell} ${schedule.mote[i]} r`);
    }
  }

  /** Whether the sender of a frame may transmit in its cell, or its receiver listens there. */
  has(frame: RadioFrame, asn: number): boolean {
    for (const length of this.lengths) {
      const cell = `${length} ${asn % length} ${frame.channelOffset}`;
      if (this.roles.has(`${cell} ${frame.sender} t`) || this.roles.has(`${cell} ${frame.destination} r`)) return true;
    }
    return false;
  }
}

/**
 * The cells of a slotframe in which frames were sent, by time and channel offset. A frame does not say which slotframe its cell belongs
 * to: it is foreign if the schedule has such a cell in another slotframe and none in this one.
 */
export function usedCells(frames: readonly RadioFrame[], schedule: Schedule, handle: number, slotNs: number): Use[] {
  const length = slotframes(schedule).get(handle) ?? 1;
  const here = new CellIndex(schedule, (other) => other === handle);
  const elsewhere = new CellIndex(schedule, (other) => other !== handle);
  const onAir = new Map<string, RadioFrame[]>();
  for (const frame of frames) {
    const key = `${Math.floor(frame.sentNs / slotNs)} ${frame.channel}`;
    const known = onAir.get(key);
    if (known === undefined) onAir.set(key, [frame]);
    else known.push(frame);
  }
  const found = new Map<string, Use>();
  for (const frame of frames) {
    if (frame.channelOffset === NO_MOTE) continue;
    const asn = Math.floor(frame.sentNs / slotNs);
    const slot = asn % length;
    const key = `${slot} ${frame.channelOffset}`;
    let use = found.get(key);
    if (use === undefined) found.set(key, (use = { slot, channel: frame.channelOffset, frames: [], collision: false, foreign: true }));
    use.frames.push(frame);
    if (here.has(frame, asn) || !elsewhere.has(frame, asn)) use.foreign = false;
    const together = onAir.get(`${asn} ${frame.channel}`) ?? [];
    if (together.length > 1 && together.some(({ nMissed }) => nMissed > 0)) use.collision = true;
  }
  return [...found.values()];
}

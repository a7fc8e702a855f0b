import type { Schedule } from "../gen/cosim/v1/netsim_pb.ts";

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

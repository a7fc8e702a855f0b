import type { Packets } from "../gen/cosim/v1/netsim_pb.ts";
import { type FrameData, NO_MOTE, radioFrames } from "../source/frame.ts";
import type { RadioFrame } from "../source/radio.ts";
import { exists } from "../swarm/links.ts";

/** A packet that ended. */
export interface PacketSummary {
  id: number;
  kind: string;
  source: number;
  /** `NO_MOTE`: everyone in reach. */
  destination: number;
  createdNs: number;
  endedNs: number;
  hops: number;
  /** Why it was dropped; empty: it was delivered. */
  reason: string;
}

/** All frames that carried a packet from one mote to the next, and where its latency comes from. */
export interface Hop {
  sender: number;
  /** `NO_MOTE`: everyone in reach. */
  receiver: number;
  frames: RadioFrame[];
  /** The sender has the packet from here on (ns). */
  arrivedNs: number;
  /** Slot of the first frame (ns). */
  firstNs: number;
  /** Slot of the frame that the receiver got, or of the last frame if it got none (ns). */
  lastNs: number;
  /** End of that slot, or of the packet if that is earlier (ns). */
  doneNs: number;
  received: boolean;
  /** Position of the sender and the receiver when the frame of `lastNs` was sent (m); null: not known. */
  from: [number, number] | null;
  to: [number, number] | null;
}

/** The way of a packet from hop to hop. */
export interface Way {
  packet: PacketSummary;
  /** In the order of time. */
  frames: RadioFrame[];
  hops: Hop[];
  /** Where the packet was when it ended, and since when (ns). */
  lastMote: number;
  lastArrivedNs: number;
  /** Some frames may be missing: a step of the recording that covers several steps lists at most 5000 of them. */
  incomplete: boolean;
}

/** Entry `i` of a list of packets. */
export function packetSummary(packets: Packets, i: number): PacketSummary {
  const outcome = packets.outcome[i];
  return {
    id: Number(packets.id[i]),
    kind: packets.kinds[packets.kind[i]]?.name ?? "packet",
    source: packets.source[i],
    destination: packets.destination[i],
    createdNs: Number(packets.createdNs[i]),
    endedNs: Number(packets.endedNs[i]),
    hops: packets.hops[i],
    reason: outcome === 0 ? "" : (packets.reasons[outcome - 1] ?? "unknown reason"),
  };
}

/** Index of a packet in a list; -1: it is not listed. */
export function packetIndex(packets: Packets | undefined, id: number): number {
  const wanted = BigInt(Math.round(id));
  return packets?.id.indexOf(wanted) ?? -1;
}

/** The radio frames of a packet in the frames of a recording, each once and in the order of time; null: the recording holds none at all. */
export function framesOf(id: number, recorded: readonly FrameData[]): RadioFrame[] | null {
  const found = new Map<string, RadioFrame>();
  let kept = false;
  for (const frame of recorded) {
    const radio = radioFrames(frame);
    if (radio === null) continue;
    kept = true;
    for (const sent of radio) if (sent.packet === id) found.set(`${sent.sentNs} ${sent.sender} ${sent.channel}`, sent);
  }
  return kept ? [...found.values()].sort((a, b) => a.sentNs - b.sentNs || a.sender - b.sender) : null;
}

/** Groups the frames of a packet by hop and splits its latency among them. `slotNs` is how long a frame takes at most. */
export function wayOf(packet: PacketSummary, frames: RadioFrame[], slotNs: number): Way {
  const groups: RadioFrame[][] = [];
  for (const frame of frames) {
    const same = groups.findLast((group) => group[0].sender === frame.sender && group[0].destination === frame.destination);
    // A mote that has not got the acknowledgment sends again, perhaps after the receiver has forwarded the packet.
    if (same !== undefined && (frame.attempt > 1 || same === groups[groups.length - 1])) same.push(frame);
    else groups.push([frame]);
  }
  let lastMote = packet.source;
  let arrivedNs = packet.createdNs;
  const hops = groups.map((group): Hop => {
    const got = group.filter(({ outcome }) => outcome === "acknowledged" || outcome === "not acknowledged");
    // Fragments are several frames sent for the first time: the packet has arrived with the last one.
    const fragments = group.filter(({ attempt }) => attempt === 1).length > 1;
    const decisive = (fragments ? got[got.length - 1] : got[0]) ?? group[group.length - 1];
    const everyone = group[0].destination === NO_MOTE;
    const hop: Hop = {
      sender: group[0].sender, receiver: group[0].destination, frames: group, arrivedNs: Math.min(arrivedNs, group[0].sentNs), firstNs: group[0].sentNs,
      lastNs: decisive.sentNs, doneNs: Math.max(decisive.sentNs, Math.min(decisive.sentNs + slotNs, packet.endedNs)), received: everyone ? decisive.nReceived > 0 : got.length > 0, from: null, to: null,
    };
    lastMote = hop.received && !everyone ? hop.receiver : hop.sender;
    arrivedNs = hop.doneNs;
    return hop;
  });
  return { packet, frames, hops, lastMote, lastArrivedNs: arrivedNs, incomplete: false };
}

/** Where a mote was at a time, interpolated between the frames of a recording; null: it does not exist there, or no frame is at hand. */
export function positionAt(recorded: readonly FrameData[], agent: number, timeNs: number): [number, number] | null {
  let after = recorded.findIndex((frame) => frame.timeNs >= timeNs);
  if (after < 0) after = recorded.length - 1;
  if (after < 0) return null;
  const b = recorded[after];
  const a = recorded[Math.max(0, after - 1)];
  if (agent >= b.x.length || agent >= a.x.length) return null;
  if (a === b || b.timeNs <= timeNs || !exists(a, agent)) return [b.x[agent], b.y[agent]];
  const share = Math.max(0, (timeNs - a.timeNs) / (b.timeNs - a.timeNs));
  return [a.x[agent] + (b.x[agent] - a.x[agent]) * share, a.y[agent] + (b.y[agent] - a.y[agent]) * share];
}

/** Fills in where sender and receiver of each hop were. */
export function placeWay(way: Way, recorded: readonly FrameData[]): void {
  for (const hop of way.hops) {
    hop.from = positionAt(recorded, hop.sender, hop.lastNs);
    hop.to = hop.receiver === NO_MOTE ? null : positionAt(recorded, hop.receiver, hop.lastNs);
  }
}

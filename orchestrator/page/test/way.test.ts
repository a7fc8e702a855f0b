import { create, toBinary } from "@bufbuild/protobuf";
import assert from "node:assert/strict";
import { test } from "node:test";
import { FrameOutcome, FramesSchema, ScheduleSchema } from "../src/gen/cosim/v1/netsim_pb.ts";
import { FrameSchema } from "../src/gen/murmuration/view/v1/view_pb.ts";
import { usedCells } from "../src/network/cells.ts";
import { framesOf, type PacketSummary, placeWay, wayOf } from "../src/network/way.ts";
import { decodeFrame, type FrameData, radioFrames } from "../src/source/frame.ts";
import { FrameList } from "../src/source/frame-list.ts";
import { Motion } from "../src/swarm/motion.ts";
import { Raster } from "../src/swarm/raster.ts";

const SLOT = 10_000_000;
const { LOST, NOT_ACKNOWLEDGED, ACKNOWLEDGED } = FrameOutcome;

interface Sent {
  slot: number;
  from: number;
  to: number;
  outcome: FrameOutcome;
  attempt?: number;
  packet?: number;
  channel?: number;
  offset?: number;
  missed?: number;
}

/** A recorded frame that ends at a time (s), with what was on the air; robot i stands at (i, time). */
function recorded(timeS: number, sent: Sent[] | null): FrameData {
  return decodeFrame(toBinary(FrameSchema, create(FrameSchema, {
    step: BigInt(timeS), timeNs: BigInt(timeS) * 1_000_000_000n, fromNs: BigInt(Math.max(0, timeS - 1)) * 1_000_000_000n,
    alive: new Uint8Array([255]), xM: [0, 1, 2, 3], yM: [timeS, timeS, timeS, timeS],
    frames: sent === null ? undefined : create(FramesSchema, {
      sentNs: sent.map(({ slot }) => BigInt(slot * SLOT)), sender: sent.map(({ from }) => from), destination: sent.map(({ to }) => to),
      channel: sent.map(({ channel }) => channel ?? 11), channelOffset: sent.map(({ offset }) => offset ?? 0), kind: sent.map(() => 0),
      lengthBytes: sent.map(() => 60), packet: sent.map(({ packet }) => BigInt(packet ?? 7)), attempt: sent.map(({ attempt }) => attempt ?? 1),
      nReceived: sent.map(() => 1), nMissed: sent.map(({ missed }) => missed ?? 0), outcome: sent.map(({ outcome }) => outcome), kinds: ["data"],
    }),
  })));
}

const PACKET: PacketSummary = { id: 7, kind: "app", source: 3, destination: 0, createdNs: 100e6, endedNs: 1560e6, hops: 2, reason: "" };

test("the latency of a packet is split by hop, retransmissions apart from waiting", () => {
  const frames = [
    recorded(0, []),
    recorded(1, [
      { slot: 20, from: 3, to: 1, outcome: LOST },
      { slot: 50, from: 3, to: 1, outcome: NOT_ACKNOWLEDGED, attempt: 2 },
      { slot: 60, from: 2, to: 0, outcome: ACKNOWLEDGED, packet: 8 },
    ]),
    // The sender repeats a frame that was received, after the receiver has forwarded the packet.
    recorded(2, [
      { slot: 155, from: 1, to: 0, outcome: ACKNOWLEDGED },
      { slot: 157, from: 3, to: 1, outcome: ACKNOWLEDGED, attempt: 3 },
    ]),
  ];
  const sent = framesOf(7, [...frames, frames[1]]) ?? [];
  assert.deepEqual(sent.map(({ sentNs, sender, outcome }) => [sentNs / SLOT, sender, outcome]),
    [[20, 3, "lost"], [50, 3, "not acknowledged"], [155, 1, "acknowledged"], [157, 3, "acknowledged"]]);
  const way = wayOf(PACKET, sent, SLOT);
  assert.deepEqual(way.hops.map(({ sender, receiver, frames: own }) => [sender, receiver, own.length]), [[3, 1, 3], [1, 0, 1]]);
  const [first, second] = way.hops;
  assert.deepEqual([first.arrivedNs, first.firstNs, first.lastNs, first.doneNs].map((ns) => ns / SLOT), [10, 20, 50, 51]);
  assert.deepEqual([second.arrivedNs, second.firstNs, second.doneNs].map((ns) => ns / SLOT), [51, 155, 156]);
  // The parts add up to the latency.
  assert.equal(way.hops.reduce((sum, hop) => sum + hop.doneNs - hop.arrivedNs, 0), PACKET.endedNs - PACKET.createdNs);
  placeWay(way, frames);
  assert.deepEqual([first.from, first.to], [[3, 0.5], [1, 0.5]]);
});

test("a dropped packet ends at the mote that had it last", () => {
  const frames = [recorded(1, [
    { slot: 20, from: 3, to: 1, outcome: ACKNOWLEDGED },
    { slot: 40, from: 1, to: 0, outcome: LOST },
    { slot: 60, from: 1, to: 0, outcome: LOST, attempt: 2 },
  ])];
  const way = wayOf({ ...PACKET, reason: "max_retries" }, framesOf(7, frames) ?? [], SLOT);
  assert.equal(way.lastMote, 1);
  assert.deepEqual(way.hops.map(({ received }) => received), [true, false]);
});

test("a recording without radio frames is not one in which nothing was sent", () => {
  assert.equal(framesOf(7, [recorded(1, null)]), null);
  assert.deepEqual(framesOf(7, [recorded(1, [])]), []);
});

test("frames are marked in the cell of their time and channel offset, and collide only in one slot on one channel", () => {
  const frame = recorded(2, [
    { slot: 105, from: 1, to: 0, outcome: ACKNOWLEDGED, channel: 15, offset: 2 },
    { slot: 108, from: 1, to: 0, outcome: LOST, channel: 20, offset: 3, missed: 1 },
    { slot: 108, from: 2, to: 0, outcome: ACKNOWLEDGED, channel: 20, offset: 3 },
    { slot: 109, from: 1, to: 0, outcome: LOST, channel: 20, offset: 4, missed: 1 },
    { slot: 109, from: 2, to: 0, outcome: ACKNOWLEDGED, channel: 21, offset: 5 },
    { slot: 112, from: 3, to: 0, outcome: ACKNOWLEDGED, offset: 0xffffffff },
    { slot: 136, from: 1, to: 0, outcome: ACKNOWLEDGED, offset: 2 },
  ]);
  const schedule = create(ScheduleSchema, {
    mote: [1, 2], slotframe: [1, 0], slotframeSlots: [31, 101], slot: [12, 8], channelOffset: [2, 5], options: [1, 1], neighbour: [0, 0],
  });
  const used = usedCells(radioFrames(frame) ?? [], schedule, 1, SLOT);
  assert.deepEqual(used.map(({ slot, channel, frames, collision, foreign }) => [slot, channel, frames.length, collision, foreign]), [
    [12, 2, 2, false, false], [15, 3, 2, true, false], [16, 4, 1, false, false], [16, 5, 1, false, true],
  ]);
});

test("while playing robots are between two frames, at a step exactly where it has them", () => {
  const list = new FrameList();
  const bytes = (step: number, heading: number): Uint8Array => toBinary(FrameSchema, create(FrameSchema, {
    step: BigInt(step), timeNs: BigInt(step) * 1_000_000_000n, fromNs: BigInt(Math.max(0, step - 1)) * 1_000_000_000n,
    alive: new Uint8Array([1]), xM: [step], yM: [0], headingRad: [heading],
  }));
  list.append([bytes(0, 3), bytes(1, -3), bytes(9, 0)]);
  assert.equal(Motion.share(list, 0, 0.25e9), 0.25);
  assert.equal(Motion.share(list, 1, 2e9), 0);
  const motion = new Motion();
  motion.set(list.frame(0), list.frame(1), 0.5);
  assert.equal(motion.x[0], 0.5);
  // The heading turns the shorter way, over π.
  assert.ok(Math.abs(motion.heading[0] - Math.PI) < 1e-6);
  motion.set(list.frame(0), list.frame(1), 0);
  assert.equal(motion.x, list.frame(0).x);
});

test("lines and triangles stay within the picture and cover what they should", () => {
  const raster = new Raster(10, 8);
  raster.line(-5, 3.5, 30, 3.5, 0xff0000ff, 0xff0000ff, false);
  assert.equal(raster.pixels.filter((pixel) => pixel !== 0).length, 10);
  for (const [x0, y0, x1, y1] of [[-100, -50, 100, 60], [5, -9, 5, 99], [9.99, 7.99, 0, 0], [4, 4, 4, 4]]) {
    raster.line(x0, y0, x1, y1, 0xff00ff00, 0x80ff0000, true);
  }
  const other = new Raster(10, 8);
  other.triangle(0, 0, 10, 0, 0, 8, 0xffffffff);
  assert.equal(other.pixels.filter((pixel) => pixel !== 0).length, 40);
});

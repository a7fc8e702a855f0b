import { create, toBinary } from "@bufbuild/protobuf";
import assert from "node:assert/strict";
import { test } from "node:test";
import { FrameSchema } from "../src/gen/murmuration/view/v1/view_pb.ts";
import { FrameList } from "../src/source/frame-list.ts";
import { decodeFrame } from "../src/source/frame.ts";
import { ghosts, MissedLinks, positionAtStep } from "../src/swarm/links.ts";
import type { Ghost } from "../src/swarm/picture.ts";
import { triangulate } from "../src/swarm/triangulate.ts";

interface Delivery {
  from: number;
  to: number;
  stepsAgo?: number;
}

/** A frame of two robots, 1 s a step; robot 0 moves by 1 m a step. */
function encoded(step: number, deliveries: Delivery[], sent = [1, 1]): Uint8Array {
  return toBinary(FrameSchema, create(FrameSchema, {
    step: BigInt(step),
    timeNs: BigInt(step) * 1_000_000_000n,
    fromNs: BigInt(Math.max(0, step - 1)) * 1_000_000_000n,
    alive: new Uint8Array([3]),
    xM: [step, 10],
    yM: [0, 300],
    headingRad: [0, 1],
    nSent: sent,
    links: {
      sender: deliveries.map((d) => d.from),
      receiver: deliveries.map((d) => d.to),
      received: deliveries.map(() => 300),
      stepsAgo: deliveries.map((d) => d.stepsAgo ?? 0),
    },
  }));
}

function list(frames: Uint8Array[]): FrameList {
  const made = new FrameList();
  made.append(frames);
  return made;
}

function missed(finder: MissedLinks, frames: FrameList, index: number): string[] {
  const found: string[] = [];
  finder.find(frames, index, (sender, receiver) => found.push(`${sender}-${receiver}`));
  return found;
}

test("a frame decodes to the values that were encoded", () => {
  const frame = decodeFrame(encoded(7, [{ from: 0, to: 1, stepsAgo: 200 }]));
  assert.equal(frame.step, 7);
  assert.equal(frame.timeNs, 7e9);
  assert.deepEqual([...frame.y], [0, 300]);
  assert.deepEqual([...frame.links.received], [300]);
  assert.deepEqual([...frame.links.stepsAgo], [200]);
  assert.equal(frame.motes, null);
});

test("a link is missed if it delivered within 5 s, and its sender sent without being heard", () => {
  const frames = list([
    encoded(0, []),
    encoded(1, [{ from: 0, to: 1 }]),
    encoded(2, []),
    encoded(3, [], [0, 1]),
    encoded(4, []),
    encoded(5, []),
    encoded(6, []),
    encoded(7, []),
  ]);
  const forward = new MissedLinks();
  const all = Array.from({ length: 8 }, (_, i) => missed(forward, frames, i));
  assert.deepEqual(all, [[], [], ["0-1"], [], ["0-1"], ["0-1"], ["0-1"], []]);
  // Jumping gives what playing gives.
  for (const i of [6, 2, 7, 1]) assert.deepEqual(missed(forward, frames, i), all[i]);
});

test("a ghost stands where the sender was when the latest delivery was sent", () => {
  const frames = list([encoded(0, []), encoded(1, []), encoded(2, []), encoded(3, [{ from: 0, to: 1, stepsAgo: 2 }]), encoded(4, [])]);
  const found: Ghost[] = [];
  ghosts(frames, 4, 1, found);
  assert.equal(found.length, 1);
  assert.deepEqual([found[0].x, found[0].errorM, found[0].agoNs], [1, 3, 1e9]);
});

test("positions between frames that were kept are interpolated", () => {
  const frames = list([encoded(0, []), encoded(4, [])]);
  assert.deepEqual(positionAtStep(frames, 0, 3), [3, 0]);
  assert.equal(positionAtStep(frames, 0, 5), null);
});

test("triangles of a concave polygon have its area", () => {
  const x = [0, 4, 4, 2, 0];
  const y = [0, 0, 4, 1, 4];
  const t = triangulate(x, y);
  let area = 0;
  for (let i = 0; i < t.length; i += 3) {
    const [a, b, c] = t.slice(i, i + 3);
    area += Math.abs((x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a])) / 2;
  }
  assert.equal(area, 10);
});

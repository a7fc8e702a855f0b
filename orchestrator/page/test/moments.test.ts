import assert from "node:assert/strict";
import { test } from "node:test";
import { create } from "@bufbuild/protobuf";
import { robotNamed } from "../src/events.ts";
import { unbroken } from "../src/format.ts";
import { EventKind, OverviewSchema } from "../src/gen/murmuration/view/v1/view_pb.ts";
import { countWords, momentsOf } from "../src/moments.ts";
import { opened } from "../src/opening.ts";
import { pinched } from "../src/swarm/camera.ts";

test("a number or a number of a robot names a robot", () => {
  for (const text of ["3", " 3 ", "robot 3", "Mote 3", "agent3"]) assert.equal(robotNamed(text), 3, text);
  for (const text of ["", "lost", "3 m", "robots", "-3", "3.5"]) assert.equal(robotNamed(text), null, text);
});

test("moments are counted by kind, dropped packets among them", () => {
  const event = (kind: EventKind, timeNs: bigint, agent?: number) => ({ kind, timeNs, agent, step: 0n, text: "" });
  const overview = create(OverviewSchema, {
    events: [event(EventKind.FORMED, 5n), event(EventKind.COLLISION, 7n, 2), event(EventKind.DEATH, 8n, 1), event(EventKind.COLLISION, 9n, 0)],
    packets: { id: [40n, 41n, 42n], source: [3, 4, 5], outcome: [2, 0, 1], endedNs: [30n, 10n, 20n] },
  });
  const all = momentsOf(overview);
  assert.deepEqual(all.map(({ name }) => name), ["collision", "death", "dropped", "formed"]);
  assert.deepEqual(all.map((moments) => countWords(moments, -1)), ["2 collisions", "1 failure", "2 dropped packets", "network formed"]);
  assert.equal(countWords(all[0], 1), "2 of 2 collisions");
  assert.equal(countWords(all[1], 0), "1 of 1 failure");
  assert.deepEqual(all[2].at.map(({ timeNs, agent, packet }) => [timeNs, agent, packet]), [[20, 5, 42], [30, 3, 40]]);
});

test("a run opens where its network has formed, at a speed that ends", () => {
  assert.deepEqual(opened(null, 25e9, false), { timeNs: 0, playing: true, speed: 1 });
  assert.deepEqual(opened(184e9, 3784e9, false), { timeNs: 184e9, playing: true, speed: 50 });
  // Formed as good as never: from the beginning.
  assert.deepEqual(opened(24e9, 25e9, false), { timeNs: 0, playing: true, speed: 1 });
  assert.deepEqual(opened(184e9, 3784e9, true), { timeNs: 194e9, playing: false, speed: 50 });
  assert.deepEqual(opened(null, 4e9, true), { timeNs: 2e9, playing: false, speed: 1 });
  assert.equal(opened(null, 1e15, false).speed, 100);
});

test("what is between two fingers stays between them", () => {
  const camera = { x: 3, y: -2, scale: 10 };
  const [width, height] = [400, 300];
  const at = (c: typeof camera, [px, py]: [number, number]) => [c.x + (px - width / 2) / c.scale, c.y - (py - height / 2) / c.scale];
  const after = pinched(camera, [120, 80], [170, 60], 2.5, width, height);
  assert.equal(after.scale, 25);
  at(after, [170, 60]).forEach((place, axis) => assert.ok(Math.abs(place - at(camera, [120, 80])[axis]) < 1e-12));
});

test("a number and its unit are not parted", () => {
  assert.equal(unbroken("1000 ms"), "1000\u00A0ms");
  assert.equal(unbroken("1 in the period, 5 %"), "1\u00A0in the period, 5\u00A0%");
});

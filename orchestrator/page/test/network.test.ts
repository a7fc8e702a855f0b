import { create } from "@bufbuild/protobuf";
import assert from "node:assert/strict";
import { test } from "node:test";
import { MoteStatisticsSchema, ScheduleSchema } from "../src/gen/cosim/v1/netsim_pb.ts";
import { cells, mayCollide, slotAt, slotframes } from "../src/network/cells.ts";
import { moteFigures } from "../src/network/figures.ts";
import { forest } from "../src/network/forest.ts";

const NONE = 0xffffffff;

test("the slot offset is the absolute slot number modulo the length of the slotframe", () => {
  assert.equal(slotAt(0, 10e6, 101), 0);
  assert.equal(slotAt(1_009_999_999, 10e6, 101), 100);
  assert.equal(slotAt(1_010_000_000, 10e6, 101), 0);
});

test("two transmitters collide only where the cell is not shared", () => {
  const schedule = create(ScheduleSchema, {
    mote: [1, 2, 0, 1, 2],
    slotframe: [1, 1, 1, 0, 0],
    slotframeSlots: [31, 31, 31, 101, 101],
    slot: [4, 4, 4, 0, 0],
    channelOffset: [2, 2, 2, 0, 0],
    options: [1, 1, 2, 7, 7],
    neighbour: [0, 0, NONE, NONE, NONE],
  });
  assert.deepEqual([...slotframes(schedule)], [[0, 101], [1, 31]]);
  const [cell] = cells(schedule, 1);
  assert.deepEqual(cell.transmitters.map((role) => role.mote), [1, 2]);
  assert.equal(mayCollide(cell), true);
  assert.equal(mayCollide(cells(schedule, 0)[0]), false);
});

test("transient loops of parents are cut, and every mote appears once", () => {
  // 1, 2 and 3 form a loop; 4 hangs below it; 5 is alone.
  const { roots, alone } = forest(new Uint32Array([NONE, 2, 3, 1, 3, NONE, 0]));
  const seen: number[] = [...alone];
  const visit = (node: (typeof roots)[number]): void => {
    seen.push(node.mote);
    node.children.forEach(visit);
  };
  roots.forEach(visit);
  assert.deepEqual(seen.sort(), [0, 1, 2, 3, 4, 5, 6]);
  assert.deepEqual(alone, [5]);
  assert.deepEqual(roots.map(({ mote, loop }) => [mote, loop]), [[0, false], [1, true]]);
});

test("energy figures follow from charge, battery and time", () => {
  const statistics = create(MoteStatisticsSchema, {
    columns: [
      { name: "charge_uc", unit: "uC", values: [3600, 0], known: new Uint8Array([1]) },
      { name: "battery_mah", unit: "mAh", values: [1, 1] },
      { name: "up_ns", unit: "ns", values: [2e9, 2e9] },
      { name: "radio_on_ns", unit: "ns", values: [2e7, 1e9] },
    ],
  });
  const figures = new Map(moteFigures(statistics).map(({ name, values }) => [name, values]));
  assert.equal(figures.get("mean_current")?.[0], 1800);
  assert.ok(Number.isNaN(figures.get("mean_current")?.[1]));
  assert.equal(figures.get("battery_used")?.[0], 0.1);
  assert.deepEqual(figures.get("duty_cycle"), [1, 50]);
});

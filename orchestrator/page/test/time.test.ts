import assert from "node:assert/strict";
import { test } from "node:test";
import { aligned, difference, valueAt } from "../src/curves.ts";
import { LengthPrefixed } from "../src/source/live.ts";
import { INITIAL } from "../src/store.ts";
import { formatFragment, parseFragment } from "../src/url-state.ts";

test("the address restores what it captured", () => {
  const state = {
    ...INITIAL, view: "network" as const, networkPane: "packets" as const, timeNs: 12_345_678_901, selected: 7, packet: 1227, follow: true, speed: Number.POSITIVE_INFINITY,
    camera: { x: -1.5, y: 20, scale: 8 }, missed: false, linkColour: "age" as const,
  };
  const restored = { ...INITIAL, ...parseFragment(formatFragment(state)) };
  assert.deepEqual(restored, state);
});

test("nonsense in an address is ignored", () => {
  assert.deepEqual(parseFragment("#view=nothing&t=-3&robot=x&camera=1,2"), {});
});

test("messages are cut wherever the stream was", () => {
  const long = new Uint8Array(300).fill(9);
  const stream = new Uint8Array([2, 7, 8, 0, 0xac, 0x02, ...long, 1, 5]);
  for (const size of [1, 2, 7, 400]) {
    const splitter = new LengthPrefixed();
    const messages: number[][] = [];
    for (let at = 0; at < stream.length; at += size) {
      for (const message of splitter.push(stream.subarray(at, at + size))) messages.push([...message]);
    }
    assert.deepEqual(messages, [[7, 8], [], [...long], [5]]);
  }
});

test("curves are compared at common times", () => {
  const a = { timeS: [0, 1, 2, 3], value: [0, 1, null, 3] };
  const b = { timeS: [0, 2], value: [1, 5] };
  assert.equal(valueAt(b, 1), 3);
  assert.equal(valueAt(b, 2.5), null);
  const minus = difference(a, b);
  assert.deepEqual(minus.curve.value, [1, 2, null, null]);
  assert.equal(minus.mean, 1.5);
  assert.deepEqual(aligned([a, b]).values[1], [1, undefined, 5, undefined]);
});

import { fromBinary } from "@bufbuild/protobuf";
import { BinaryReader } from "@bufbuild/protobuf/wire";
import { type MovedObstacle, MovedObstacleSchema, MoteStatesSchema, type TaskFigure, TaskFigureSchema } from "../gen/cosim/v1/common_pb.ts";
import { type Formation, FormationSchema, type Packets, PacketsSchema } from "../gen/cosim/v1/netsim_pb.ts";
import { FrameSchema, LinksSchema } from "../gen/murmuration/view/v1/view_pb.ts";
import { decodeRadioFrames, type RadioFrame } from "./radio.ts";
import { packedFixed32, packedFloat, packedUint32 } from "./wire.ts";

/** The value of a destination, parent or neighbour field that names no single mote. */
export const NO_MOTE = 0xffffffff;

/** Deliveries of a frame as typed columns, one entry per pair. Optional columns are empty where the recording has none. */
export interface FrameLinks {
  sender: Uint32Array;
  receiver: Uint32Array;
  received: Uint32Array;
  rssiDbm: Float32Array;
  stepsAgo: Uint32Array;
  hops: Uint32Array;
}

/** States of the motes as typed columns. Empty columns: the network has no such state. */
export interface FrameMotes {
  alive: Uint8Array;
  synced: Uint8Array;
  joined: Uint8Array;
  rank: Uint32Array;
  parent: Uint32Array;
  queueLength: Uint32Array;
}

/** A decoded `Frame`. Columns are typed arrays, so that 10,000 robots decode in about a millisecond. */
export interface FrameData {
  step: number;
  timeNs: number;
  fromNs: number;
  alive: Uint8Array;
  x: Float32Array;
  y: Float32Array;
  z: Float32Array;
  heading: Float32Array;
  nSent: Uint32Array;
  links: FrameLinks;
  motes: FrameMotes | null;
  formation: Formation | null;
  packets: Packets | null;
  /** Encoded radio frames; null: the network keeps none. `radioFrames` decodes them. */
  radio: Uint8Array | null;
  movedObstacles: MovedObstacle[];
  figures: TaskFigure[];
  held: boolean;
  taskComplete: boolean;
}

const NO_FLOATS = new Float32Array(0);
const NO_INTEGERS = new Uint32Array(0);
const NO_BYTES = new Uint8Array(0);
const NO_LINKS: FrameLinks = {
  sender: NO_INTEGERS,
  receiver: NO_INTEGERS,
  received: NO_INTEGERS,
  rssiDbm: NO_FLOATS,
  stepsAgo: NO_INTEGERS,
  hops: NO_INTEGERS,
};

const FRAME = FrameSchema.field;
const LINKS = LinksSchema.field;
const MOTES = MoteStatesSchema.field;

/** Step and times of an encoded frame, read without decoding its columns. */
export function frameTimes(bytes: Uint8Array): { step: number; timeNs: number; fromNs: number } {
  const reader = new BinaryReader(bytes);
  const times = { step: 0, timeNs: 0, fromNs: 0 };
  while (reader.pos < reader.len) {
    const [number, type] = reader.tag();
    if (number === FRAME.step.number) times.step = Number(reader.uint64());
    else if (number === FRAME.timeNs.number) times.timeNs = Number(reader.uint64());
    else if (number === FRAME.fromNs.number) times.fromNs = Number(reader.uint64());
    else reader.skip(type, number);
  }
  return times;
}

/** Decodes a frame. */
export function decodeFrame(bytes: Uint8Array): FrameData {
  const reader = new BinaryReader(bytes);
  const frame: FrameData = {
    step: 0,
    timeNs: 0,
    fromNs: 0,
    alive: NO_BYTES,
    x: NO_FLOATS,
    y: NO_FLOATS,
    z: NO_FLOATS,
    heading: NO_FLOATS,
    nSent: NO_INTEGERS,
    links: NO_LINKS,
    motes: null,
    formation: null,
    packets: null,
    radio: null,
    movedObstacles: [],
    figures: [],
    held: false,
    taskComplete: false,
  };
  while (reader.pos < reader.len) {
    const [number, type] = reader.tag();
    switch (number) {
      case FRAME.step.number: frame.step = Number(reader.uint64()); break;
      case FRAME.timeNs.number: frame.timeNs = Number(reader.uint64()); break;
      case FRAME.fromNs.number: frame.fromNs = Number(reader.uint64()); break;
      case FRAME.alive.number: frame.alive = reader.bytes(); break;
      case FRAME.xM.number: frame.x = packedFloat(reader.bytes()); break;
      case FRAME.yM.number: frame.y = packedFloat(reader.bytes()); break;
      case FRAME.zM.number: frame.z = packedFloat(reader.bytes()); break;
      case FRAME.headingRad.number: frame.heading = packedFloat(reader.bytes()); break;
      case FRAME.nSent.number: frame.nSent = packedUint32(reader.bytes()); break;
      case FRAME.links.number: frame.links = decodeLinks(reader.bytes()); break;
      case FRAME.motes.number: frame.motes = decodeMotes(reader.bytes()); break;
      case FRAME.formation.number: frame.formation = fromBinary(FormationSchema, reader.bytes()); break;
      case FRAME.packets.number: frame.packets = fromBinary(PacketsSchema, reader.bytes()); break;
      case FRAME.frames.number: frame.radio = reader.bytes(); break;
      case FRAME.movedObstacles.number: frame.movedObstacles.push(fromBinary(MovedObstacleSchema, reader.bytes())); break;
      case FRAME.figures.number: frame.figures.push(fromBinary(TaskFigureSchema, reader.bytes())); break;
      case FRAME.held.number: frame.held = reader.bool(); break;
      case FRAME.taskComplete.number: frame.taskComplete = reader.bool(); break;
      default: reader.skip(type, number);
    }
  }
  return frame;
}

const decodedRadio = new WeakMap<FrameData, RadioFrame[]>();

/** The radio frames of a frame's steps, decoded the first time; null: the network keeps none. */
export function radioFrames(frame: FrameData): RadioFrame[] | null {
  if (frame.radio === null) return null;
  let decoded = decodedRadio.get(frame);
  if (decoded === undefined) decodedRadio.set(frame, (decoded = decodeRadioFrames(frame.radio)));
  return decoded;
}

function decodeLinks(bytes: Uint8Array): FrameLinks {
  const reader = new BinaryReader(bytes);
  const links: FrameLinks = { ...NO_LINKS };
  while (reader.pos < reader.len) {
    const [number, type] = reader.tag();
    switch (number) {
      case LINKS.sender.number: links.sender = packedUint32(reader.bytes()); break;
      case LINKS.receiver.number: links.receiver = packedUint32(reader.bytes()); break;
      case LINKS.received.number: links.received = packedUint32(reader.bytes()); break;
      case LINKS.rssiDbm.number: links.rssiDbm = packedFloat(reader.bytes()); break;
      case LINKS.stepsAgo.number: links.stepsAgo = packedUint32(reader.bytes()); break;
      case LINKS.hops.number: links.hops = packedUint32(reader.bytes()); break;
      default: reader.skip(type, number);
    }
  }
  return links;
}

function decodeMotes(bytes: Uint8Array): FrameMotes {
  const reader = new BinaryReader(bytes);
  const motes: FrameMotes = {
    alive: NO_BYTES,
    synced: NO_BYTES,
    joined: NO_BYTES,
    rank: NO_INTEGERS,
    parent: NO_INTEGERS,
    queueLength: NO_INTEGERS,
  };
  while (reader.pos < reader.len) {
    const [number, type] = reader.tag();
    switch (number) {
      case MOTES.alive.number: motes.alive = reader.bytes(); break;
      case MOTES.synced.number: motes.synced = reader.bytes(); break;
      case MOTES.joined.number: motes.joined = reader.bytes(); break;
      case MOTES.rank.number: motes.rank = packedUint32(reader.bytes()); break;
      case MOTES.parent.number: motes.parent = packedFixed32(reader.bytes()); break;
      case MOTES.queueLength.number: motes.queueLength = packedUint32(reader.bytes()); break;
      default: reader.skip(type, number);
    }
  }
  return motes;
}

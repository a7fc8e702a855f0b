import { fromBinary } from "@bufbuild/protobuf";
import { FramesSchema, FrameOutcome } from "../gen/cosim/v1/netsim_pb.ts";

/** A radio frame: a data frame or a beacon that was on the air. */
export interface RadioFrame {
  /** Beginning of its slot, or of the frame itself where there are no slots (ns). */
  sentNs: number;
  sender: number;
  /** `NO_MOTE`: everyone in reach. */
  destination: number;
  channel: number;
  /** `NO_MOTE`: it was sent outside of any cell. */
  channelOffset: number;
  kind: string;
  /** Length of the PSDU (bytes). */
  lengthBytes: number;
  /** Number of the packet that it carries; 0: of none that is counted. */
  packet: number;
  /** How often it has been sent, this time included. */
  attempt: number;
  nReceived: number;
  /** Motes in reach that listened on its channel and did not receive it. */
  nMissed: number;
  outcome: RadioOutcome;
}

/** "sent": the frame was for everyone in reach. */
export type RadioOutcome = "sent" | "lost" | "not acknowledged" | "acknowledged";

const OUTCOMES: Record<FrameOutcome, RadioOutcome> = {
  [FrameOutcome.UNSPECIFIED]: "sent",
  [FrameOutcome.LOST]: "lost",
  [FrameOutcome.NOT_ACKNOWLEDGED]: "not acknowledged",
  [FrameOutcome.ACKNOWLEDGED]: "acknowledged",
};

/** Decodes the radio frames of a step. */
export function decodeRadioFrames(bytes: Uint8Array): RadioFrame[] {
  const columns = fromBinary(FramesSchema, bytes);
  return columns.sentNs.map((sentNs, i) => ({
    sentNs: Number(sentNs),
    sender: columns.sender[i],
    destination: columns.destination[i],
    channel: columns.channel[i],
    channelOffset: columns.channelOffset[i],
    kind: columns.kinds[columns.kind[i]] ?? "frame",
    lengthBytes: columns.lengthBytes[i],
    packet: Number(columns.packet[i]),
    attempt: columns.attempt[i],
    nReceived: columns.nReceived[i],
    nMissed: columns.nMissed[i],
    outcome: OUTCOMES[columns.outcome[i]] ?? "sent",
  }));
}

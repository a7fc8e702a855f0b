import { BinaryReader, WireType } from "@bufbuild/protobuf/wire";

/**
 * Separates the entries of one repeated message field from all other fields of an encoded message. The entries stay encoded, so
 * that a recording of thousands of frames is opened without decoding them.
 */
export function splitRepeated(message: Uint8Array, fieldNumber: number): { entries: Uint8Array[]; rest: Uint8Array } {
  const reader = new BinaryReader(message);
  const entries: Uint8Array[] = [];
  const others: Uint8Array[] = [];
  while (reader.pos < reader.len) {
    const start = reader.pos;
    const [number, type] = reader.tag();
    if (number === fieldNumber && type === WireType.LengthDelimited) {
      entries.push(reader.bytes());
    } else {
      reader.skip(type, number);
      others.push(message.subarray(start, reader.pos));
    }
  }
  return { entries, rest: concatenate(others) };
}

/** Joins byte arrays end to end. */
export function concatenate(parts: Uint8Array[]): Uint8Array {
  let length = 0;
  for (const part of parts) length += part.length;
  const whole = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

/** Decodes a packed `repeated float`. */
export function packedFloat(bytes: Uint8Array): Float32Array {
  // The copy aligns the values; protobuf and every browser's processor are little-endian.
  return new Float32Array(bytes.slice().buffer);
}

/** Decodes a packed `repeated fixed32`. */
export function packedFixed32(bytes: Uint8Array): Uint32Array {
  return new Uint32Array(bytes.slice().buffer);
}

/** Decodes a packed `repeated uint32`. */
export function packedUint32(bytes: Uint8Array): Uint32Array {
  let count = 0;
  for (let i = 0; i < bytes.length; i++) if (bytes[i] < 0x80) count++;
  const values = new Uint32Array(count);
  let value = 0;
  let shift = 0;
  let n = 0;
  for (let i = 0; i < bytes.length; i++) {
    const byte = bytes[i];
    value |= (byte & 0x7f) << shift;
    if (byte < 0x80) {
      values[n++] = value;
      value = 0;
      shift = 0;
    } else {
      shift += 7;
    }
  }
  return values;
}

/** Whether bit `i` of a bitmap with the least significant bit first is set. */
export function bit(bitmap: Uint8Array, i: number): boolean {
  return (bitmap[i >> 3] & (1 << (i & 7))) !== 0;
}

// SPDX-License-Identifier: BSD-3-Clause
import { ReportError } from "./errors";
import { count as readCount, oneOf, type Field, type Reader } from "./field";

const kTypes = {
  u8: Uint8Array,
  i8: Int8Array,
  u16: Uint16Array,
  i16: Int16Array,
  u32: Uint32Array,
  i32: Int32Array,
  f32: Float32Array,
  f64: Float64Array,
} as const;

export type BufferType = keyof typeof kTypes;
export type BufferArray<T extends BufferType> = InstanceType<(typeof kTypes)[T]>;

const kAlignment = 8;

/** The page's binary buffers: every array is a view of the one block, nothing is copied. */
export class Buffers {
  readonly #bytes: ArrayBuffer;

  constructor(bytes: ArrayBuffer) {
    this.#bytes = bytes;
  }

  get byteLength(): number {
    return this.#bytes.byteLength;
  }

  /** The array that `field` names, which must be of one of `types` and of `count` elements. */
  read<T extends BufferType>(field: Field, types: readonly T[], count?: number): BufferArray<T> {
    const type = oneOf(...types)(field.get("type"));
    const offset = readCount(field.get("offset"));
    const size = readCount(field.get("count"));
    if (count !== undefined && size !== count) {
      throw new ReportError(`${field.path}: expected ${count} elements, found ${size}.`);
    }
    if (offset % kAlignment !== 0) {
      throw new ReportError(`${field.path}: offset ${offset} is not a multiple of ${kAlignment}.`);
    }
    const end = offset + size * kTypes[type].BYTES_PER_ELEMENT;
    if (end > this.byteLength) {
      throw new ReportError(
        `${field.path}: the buffer ends at byte ${end}, but the report holds only ` +
          `${this.byteLength} bytes of buffers. Is the file complete?`,
      );
    }
    return new kTypes[type](this.#bytes, offset, size) as BufferArray<T>;
  }

  reader<T extends BufferType>(types: readonly T[], count?: number): Reader<BufferArray<T>> {
    return (field) => this.read(field, types, count);
  }
}

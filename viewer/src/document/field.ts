// SPDX-License-Identifier: BSD-3-Clause
import { ReportError } from "./errors";

/** One value of the JSON document together with its path, so that every complaint says where. */
export class Field {
  constructor(
    readonly value: unknown,
    readonly path: string,
  ) {}

  fail(expected: string): never {
    const found = this.value === undefined ? "nothing" : (JSON.stringify(this.value) ?? String(this.value));
    const shown = found.length > 60 ? `${found.slice(0, 57)}…` : found;
    throw new ReportError(`${this.path || "document"}: expected ${expected}, found ${shown}.`);
  }

  get isNull(): boolean {
    return this.value === null || this.value === undefined;
  }

  get(key: string): Field {
    const path = this.path ? `${this.path}.${key}` : key;
    const members = this.object();
    return new Field(Object.prototype.hasOwnProperty.call(members, key) ? members[key] : undefined, path);
  }

  object(): Record<string, unknown> {
    if (typeof this.value !== "object" || this.value === null || Array.isArray(this.value)) {
      this.fail("an object");
    }
    return this.value as Record<string, unknown>;
  }

  list(length?: number): Field[] {
    if (!Array.isArray(this.value)) {
      this.fail(length === undefined ? "a list" : `a list of ${length}`);
    }
    if (length !== undefined && this.value.length !== length) {
      throw new ReportError(`${this.path}: expected ${length} entries, found ${this.value.length}.`);
    }
    return this.value.map((item, index) => new Field(item, `${this.path}[${index}]`));
  }
}

/** Reads a value, or fails with its path. The types of the report are those of its readers. */
export type Reader<T> = (field: Field) => T;

export const text: Reader<string> = (field) => (typeof field.value === "string" ? field.value : field.fail("text"));
export const number: Reader<number> = (field) =>
  typeof field.value === "number" ? field.value : field.fail("a number");
export const truth: Reader<boolean> = (field) =>
  typeof field.value === "boolean" ? field.value : field.fail("true or false");
export const anything: Reader<unknown> = (field) => field.value ?? null;
export const count: Reader<number> = (field) =>
  Number.isSafeInteger(field.value) && (field.value as number) >= 0 ? (field.value as number) : field.fail("a count");

export function oneOf<T extends string>(...choices: T[]): Reader<T> {
  return (field) =>
    choices.find((choice) => choice === field.value) ?? field.fail(choices.map((choice) => `"${choice}"`).join(" or "));
}

export function orElse<T, Other>(read: Reader<T>, other: Other): Reader<T | Other> {
  return (field) => (field.isNull ? other : read(field));
}

export function orNull<T>(read: Reader<T>): Reader<T | null> {
  return orElse(read, null);
}

export function list<T>(read: Reader<T>, length?: number): Reader<T[]> {
  return (field) => field.list(length).map(read);
}

export function listOrEmpty<T>(read: Reader<T>): Reader<T[]> {
  return orElse(list(read), []);
}

/** Numbers, where null stands for one that is not finite. */
export function numbers(length?: number): Reader<number[]> {
  return list(orElse(number, NaN), length);
}

type Shape = Record<string, Reader<unknown>>;
type Read<S extends Shape> = { [Key in keyof S]: ReturnType<S[Key]> };

/** An object; `xLabel` is read from the field `x_label`. */
export function object<S extends Shape>(shape: S): Reader<Read<S>> {
  const readers = Object.entries(shape).map(
    ([key, read]) => [key, key.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`), read] as const,
  );
  return (field) => Object.fromEntries(readers.map(([key, name, read]) => [key, read(field.get(name))])) as Read<S>;
}

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
    if (typeof this.value !== "object" || this.value === null || Array.isArray(this.value)) {
      this.fail("an object");
    }
    const path = this.path ? `${this.path}.${key}` : key;
    const own = Object.prototype.hasOwnProperty.call(this.value, key);
    return new Field(own ? (this.value as Record<string, unknown>)[key] : undefined, path);
  }

  text(): string {
    return typeof this.value === "string" ? this.value : this.fail("text");
  }

  textOrNull(): string | null {
    return this.isNull ? null : this.text();
  }

  number(): number {
    return typeof this.value === "number" ? this.value : this.fail("a number");
  }

  numberOrNull(): number | null {
    return this.isNull ? null : this.number();
  }

  truth(): boolean {
    return typeof this.value === "boolean" ? this.value : this.fail("true or false");
  }

  count(): number {
    const value = this.value;
    return typeof value === "number" && Number.isSafeInteger(value) && value >= 0 ? value : this.fail("a count");
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

  listOrEmpty(): Field[] {
    return this.isNull ? [] : this.list();
  }

  /** Numbers, where null stands for one that is not finite. */
  numbers(length?: number): number[] {
    return this.list(length).map((item) => (item.value === null ? NaN : item.number()));
  }

  finiteNumbers(length: number): number[] {
    return this.list(length).map((item) => item.number());
  }

  texts(): string[] {
    return this.list().map((item) => item.text());
  }

  textsOrNull(length: number): string[] | null {
    return this.isNull ? null : this.list(length).map((item) => item.text());
  }

  oneOf<T extends string>(...choices: T[]): T {
    const found = choices.find((choice) => choice === this.value);
    return found ?? this.fail(choices.map((choice) => `"${choice}"`).join(" or "));
  }

  object(): Record<string, unknown> {
    if (typeof this.value !== "object" || this.value === null || Array.isArray(this.value)) {
      this.fail("an object");
    }
    return this.value as Record<string, unknown>;
  }
}

// SPDX-License-Identifier: BSD-3-Clause

/** A report that cannot be shown, or a part of one; the message is for the reader of the page. */
export class ReportError extends Error {
  override name = "ReportError";
}

export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

// SPDX-License-Identifier: BSD-3-Clause
import { ReportError, messageOf } from "./errors";

const kEncoding = "gzip-base64";

const kSextet = (() => {
  const table = new Uint8Array(128).fill(255);
  const alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (let i = 0; i < alphabet.length; ++i) {
    table[alphabet.charCodeAt(i)] = i;
  }
  return table;
})();

interface FromBase64 {
  fromBase64?: (text: string) => Uint8Array<ArrayBuffer>;
}

/** Base64 to bytes; white space is allowed anywhere, anything else foreign is refused. */
export function decodeBase64(text: string): Uint8Array<ArrayBuffer> {
  const native = (Uint8Array as unknown as FromBase64).fromBase64;
  if (native) {
    try {
      return native.call(Uint8Array, text);
    } catch {
      // The loop below says what is wrong.
    }
  }
  const bytes = new Uint8Array(Math.floor((text.length * 3) / 4));
  let length = 0;
  let bits = 0;
  let held = 0;
  for (let i = 0; i < text.length; ++i) {
    const code = text.charCodeAt(i);
    const sextet = code < 128 ? kSextet[code] : 255;
    if (sextet === 255) {
      if (code <= 32 || code === 61 /* = */) {
        continue;
      }
      throw new ReportError(`Embedded data: character ${i} is not base64.`);
    }
    bits = ((bits << 6) | sextet) & 0xffffff;
    held += 6;
    if (held >= 8) {
      held -= 8;
      bytes[length++] = (bits >> held) & 255;
    }
  }
  return bytes.slice(0, length);
}

export async function gunzip(bytes: Uint8Array<ArrayBuffer>, what: string): Promise<ArrayBuffer> {
  if (typeof DecompressionStream === "undefined") {
    throw new ReportError(
      "This browser cannot decompress the report (DecompressionStream is missing). " +
        "Please use a browser of 2023 or later.",
    );
  }
  try {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return await new Response(stream).arrayBuffer();
  } catch (error) {
    throw new ReportError(`${what} cannot be decompressed (${messageOf(error)}). Is the file complete?`);
  }
}

/** The content of one data element of the page; the element is emptied to free its memory. */
export async function readEmbedded(page: Document, id: string): Promise<ArrayBuffer> {
  const element = page.getElementById(id);
  if (!element) {
    throw new ReportError(
      `This page holds no report: its element "${id}" is missing. ` +
        "Reports are written by `cairn report`, or by `--report` of other verbs.",
    );
  }
  const encoding = element.getAttribute("data-encoding");
  if (encoding !== kEncoding) {
    throw new ReportError(`"${id}": encoding ${encoding ?? "(none)"} is not ${kEncoding}.`);
  }
  const bytes = decodeBase64(element.textContent ?? "");
  element.textContent = "";
  return gunzip(bytes, id === "cairn-report" ? "The report's document" : "The report's buffers");
}

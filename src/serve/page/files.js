// Files in place of a word: a drawing, which is sent unchanged, a picture, which is sent as a JPEG that
// fits into a request, or, in a page without a server, the log of a flight.

import { about } from "./wish.js";

const MOST_SIDE = 1200;
const MOST_BASE64 = 180_000;
/** Maximum number of characters in a drawing. With the rest of the request, it fits into the server's limit. */
const MOST_TEXT = 240_000;
/** Maximum number of bytes in a log, enough for ten minutes of a hundred variables. */
export const MOST_LOG = 16_000_000;
/** Backgrounds for a transparent picture, and the difference in brightness below which ink is invisible on one. */
const GROUNDS = [255, 0, 128],
  APART = 40;

/**
 * Reads a file. Returns null if the page does not accept it.
 * @param {File} file
 * @returns {Promise<Opened | null>}
 */
export async function opened(file) {
  const { name } = file;
  const kind = name.split(".").pop()?.toLowerCase();
  try {
    if (kind === "svg" || kind === "json") {
      const text = decoded(await file.arrayBuffer());
      // A log in JSON contains variables instead of strokes.
      if (kind === "json" && about.alone && !text.includes('"strokes"')) return await log(file);
      return text.length > MOST_TEXT ? null : { name, kind, text };
    }
    const picture = await jpeg(file).catch(() => null);
    if (picture) return { name, kind: "jpg", ...picture };
    return about.alone && !file.type.startsWith("image/") ? await log(file) : null;
  } catch {
    return null;
  }
}

/** Decodes the text of a drawing by its byte order mark or its XML declaration. */
function decoded(/** @type {ArrayBuffer} */ bytes) {
  const [a, b] = new Uint8Array(bytes);
  const wide = (a === 0xff && b === 0xfe) || b === 0 ? "utf-16le" : (a === 0xfe && b === 0xff) || a === 0 ? "utf-16be" : "";
  const head = new TextDecoder("latin1").decode(bytes.slice(0, 200));
  const declared = /^<\?xml[^>]*\bencoding\s*=\s*["']([^"']+)/.exec(head)?.[1];
  return new TextDecoder(wide || declared || "utf-8", { fatal: true }).decode(bytes);
}

/** @param {File} file @returns {Promise<Opened | null>} */
async function log(file) {
  if (file.size > MOST_LOG) return null;
  const reader = new FileReader();
  const read = new Promise((resolve, reject) => Object.assign(reader, { onload: resolve, onerror: reject }));
  reader.readAsDataURL(file);
  await read;
  return { name: file.name, kind: "log", text: `${reader.result}`.split(",")[1] };
}

/** @param {File} file @returns {Promise<Pick<Opened, "text" | "size">>} */
async function jpeg(file) {
  const bitmap = await createImageBitmap(file);
  const scale = Math.min(1, MOST_SIDE / Math.max(bitmap.width, bitmap.height));
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [bitmap.width * scale, bitmap.height * scale].map(Math.ceil);
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  pen.globalCompositeOperation = "destination-over";
  const ground = groundOf(pen, canvas);
  pen.fillStyle = `rgb(${ground} ${ground} ${ground})`;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  const texts = [0.9, 0.7, 0.5, 0.3].map(
    (quality) => canvas.toDataURL("image/jpeg", quality).split(",")[1],
  );
  const text = texts.find((text) => text.length < MOST_BASE64) ?? texts[texts.length - 1];
  return { text, size: [canvas.width, canvas.height] };
}

/**
 * Returns the background on which nearly all ink of a transparent picture is visible, as the command
 * line does. It is white if most of the picture is paper. @returns {number}
 */
function groundOf(
  /** @type {CanvasRenderingContext2D} */ pen,
  /** @type {HTMLCanvasElement} */ { width, height },
) {
  const { data } = pen.getImageData(0, 0, width, height);
  const lost = GROUNDS.map(() => 0);
  let opaque = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] < 128) continue;
    opaque += 1;
    GROUNDS.forEach((ground, k) => {
      lost[k] += [0, 1, 2].every((c) => Math.abs(data[i + c] - ground) < APART) ? 1 : 0;
    });
  }
  const isPaper = 2 * opaque > width * height && 2 * lost[0] > opaque;
  return GROUNDS.find((_, k) => isPaper || lost[k] <= 0.01 * opaque) ?? GROUNDS[0];
}

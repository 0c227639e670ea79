// A file in place of a word: a drawing as it is, a picture as a JPEG that fits into a request.

const MOST_SIDE = 1200;
const MOST_BASE64 = 180_000;
/** Most characters of a drawing: what a request may hold, less the rest of it. */
const MOST_TEXT = 240_000;
/** Grounds for a transparent picture, and how far its ink is from the one it is lost on. */
const GROUNDS = [255, 0, 128],
  APART = 40;

/**
 * Reads a file; null if it is neither drawing nor picture.
 * @param {File} file
 * @returns {Promise<Opened | null>}
 */
export async function opened(file) {
  const kind = file.name.split(".").pop()?.toLowerCase();
  try {
    if (kind === "svg" || kind === "json") {
      const text = await file.text();
      return text.length > MOST_TEXT ? null : { name: file.name, kind, text };
    }
    return { name: file.name, kind: "jpg", ...(await jpeg(file)) };
  } catch {
    return null;
  }
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
 * The ground on which nearly all ink of a transparent picture stands out, as the command line finds
 * it; white where most of the picture is paper. @returns {number}
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

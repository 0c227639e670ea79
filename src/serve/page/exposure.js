// Shows the photograph during its exposure, by masking its pixels along the lamp's path.
//
// A long exposure adds up light. The room brightens in proportion to the elapsed time, and the trail
// appears as soon as the lamp has passed. The lamp's path is drawn into two small masks: the whole
// path, and the part that has been flown. While time advances, the second mask only grows.

import { span } from "./replay.js";

/** Width of the masks in pixels, which is enough for soft edges. */
const MASK_WIDTH = 960;
/** Maximum width of the drawn photograph in pixels. */
const MOST_WIDTH = 1920;
/**
 * Widths of the trail and its bloom, and of their soft edges, as fractions of the photograph's width.
 */
const TRAIL = { wide: 0.01, soft: 0.004 },
  BLOOM = { wide: 0.022, soft: 0.03 };

/** @param {number} width @param {number} height */
function sheet(width, height) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const pen = canvas.getContext("2d");
  if (!pen) throw new Error("no canvas");
  return { canvas, pen };
}

/**
 * @param {HTMLImageElement} image decoded
 * @param {LightMap} replay
 * @param {HTMLCanvasElement} canvas
 */
export function exposure(image, replay, canvas) {
  const width = Math.min(MOST_WIDTH, image.naturalWidth),
    height = Math.round((width * image.naturalHeight) / image.naturalWidth);
  [canvas.width, canvas.height] = [width, height];
  const pen = canvas.getContext("2d");
  const scale = MASK_WIDTH / width,
    high = Math.round(height * scale);
  const [whole, flown, wholeBloom, flownBloom, mask, bloom] = [0, 1, 2, 3, 4, 5].map(() =>
    sheet(MASK_WIDTH, high),
  );
  const { begin, length } = span(replay);
  const place = (/** @type {number} */ x, /** @type {number} */ y) =>
    /** @type {[number, number]} */ ([(x * MASK_WIDTH) / 10_000, (y * high) / 10_000]);

  for (const [{ pen: each }, { wide, soft }] of /** @type {const} */ ([
    [whole, TRAIL],
    [flown, TRAIL],
    [wholeBloom, BLOOM],
    [flownBloom, BLOOM],
  ])) {
    Object.assign(each, {
      lineCap: "round",
      lineJoin: "round",
      shadowColor: "#000",
      lineWidth: wide * MASK_WIDTH,
      shadowBlur: soft * MASK_WIDTH,
    });
  }

  /**
   * Draws the part of the path between two times, in 1/100 s.
   * @param {CanvasRenderingContext2D} into @param {number} from @param {number} to
   */
  function trace(into, from, to) {
    for (const { at } of replay.strokes) {
      if (at[0] > to || at[at.length - 3] < from) continue;
      into.beginPath();
      let begun = false;
      for (let i = 0; i < at.length; i += 3) {
        if (i + 3 < at.length && at[i + 3] < from) continue;
        if (at[i] > to) {
          // At this time, the lamp is between two points of the map.
          const share = i ? (to - at[i - 3]) / Math.max(1, at[i] - at[i - 3]) : 0;
          if (begun)
            into.lineTo(
              ...place(
                at[i - 2] + share * (at[i + 1] - at[i - 2]),
                at[i - 1] + share * (at[i + 2] - at[i - 1]),
              ),
            );
          break;
        }
        const [x, y] = place(at[i + 1], at[i + 2]);
        if (begun) into.lineTo(x, y);
        else {
          into.moveTo(x, y);
          into.lineTo(x + 0.01, y);
        }
        begun = true;
      }
      into.stroke();
    }
  }
  for (const { pen: each } of [whole, wholeBloom]) trace(each, -Infinity, Infinity);
  const room = roomOf(image, wholeBloom.canvas);
  let until = -Infinity;

  /** Yields the positions and colors of the lamps that are lit at a time. @param {number} now */
  function* lamps(now) {
    for (const { at, rgb } of replay.strokes) {
      if (at[0] > now || at[at.length - 3] < now) continue;
      let i = 0;
      while (i + 3 < at.length && at[i + 3] <= now) i += 3;
      const share = i + 3 < at.length ? (now - at[i]) / Math.max(1, at[i + 3] - at[i]) : 0;
      const next = i + 3 < at.length ? i + 3 : i;
      yield {
        x: at[i + 1] + share * (at[next + 1] - at[i + 1]),
        y: at[i + 2] + share * (at[next + 2] - at[i + 2]),
        rgb,
      };
    }
  }

  /** Shows a fraction of the exposure, 0 to 1. */
  return function show(/** @type {number} */ share) {
    if (!pen) return;
    const now = begin + share * length;
    if (now < until) {
      for (const { pen: each } of [flown, flownBloom]) each.clearRect(0, 0, MASK_WIDTH, high);
      until = -Infinity;
    }
    for (const { pen: each } of [flown, flownBloom]) trace(each, until, now);
    until = now;

    // Along the flown path, the photograph's pixels are shown. The other pixels fade in near the end.
    mask.pen.globalCompositeOperation = "copy";
    mask.pen.fillStyle = `rgb(0 0 0 / ${share ** 8})`;
    mask.pen.fillRect(0, 0, MASK_WIDTH, high);
    mask.pen.globalCompositeOperation = "destination-out";
    mask.pen.drawImage(wholeBloom.canvas, 0, 0);
    // The bloom of the flown part is shown, but not a later part of the trail beside it.
    bloom.pen.globalCompositeOperation = "copy";
    bloom.pen.drawImage(flownBloom.canvas, 0, 0);
    bloom.pen.globalCompositeOperation = "destination-out";
    bloom.pen.drawImage(whole.canvas, 0, 0);
    mask.pen.globalCompositeOperation = "source-over";
    mask.pen.drawImage(bloom.canvas, 0, 0);
    mask.pen.drawImage(flown.canvas, 0, 0);

    pen.globalCompositeOperation = "copy";
    pen.drawImage(mask.canvas, 0, 0, width, height);
    pen.globalCompositeOperation = "source-in";
    pen.drawImage(image, 0, 0, width, height);
    // Elsewhere, the room without any trail is shown. Light adds up linearly, and the photograph's
    // values are gamma-encoded.
    pen.globalCompositeOperation = "destination-over";
    pen.globalAlpha = share ** (1 / 2.2);
    pen.drawImage(room, 0, 0, width, height);
    pen.globalAlpha = 1;
    pen.globalCompositeOperation = "lighter";
    for (const lamp of lamps(now))
      glow(pen, (lamp.x * width) / 10_000, (lamp.y * height) / 10_000, width * 0.075, lamp.rgb);
  };
}

/**
 * Returns a coarse picture of the room without the trail, in which each part has the mean color around the trail.
 * @param {HTMLImageElement} image
 * @param {HTMLCanvasElement} trail
 */
function roomOf(image, trail) {
  const [across, down, fine] = [8, 5, 8];
  const around = sheet(across * fine, down * fine),
    coarse = sheet(across, down);
  around.pen.drawImage(image, 0, 0, across * fine, down * fine);
  around.pen.globalCompositeOperation = "destination-out";
  around.pen.drawImage(trail, 0, 0, across * fine, down * fine);
  const { data } = around.pen.getImageData(0, 0, across * fine, down * fine);
  const parts = Array.from({ length: across * down + 1 }, () => [0, 0, 0, 0]);
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] < 250) continue; // pixels of the trail do not count
    const x = (i / 4) % (across * fine),
      y = Math.floor(i / 4 / (across * fine));
    for (const sum of [
      parts[Math.floor(y / fine) * across + Math.floor(x / fine)],
      parts[across * down],
    ]) {
      for (let k = 0; k < 3; k += 1) sum[k] += data[i + k];
      sum[3] += 1;
    }
  }
  const all = parts[across * down];
  for (let i = 0; i < across * down; i += 1) {
    const [r, g, b, n] = parts[i][3] ? parts[i] : all;
    coarse.pen.fillStyle = `rgb(${[r, g, b].map((sum) => sum / Math.max(1, n)).join(" ")})`;
    coarse.pen.fillRect(i % across, Math.floor(i / across), 1, 1);
  }
  return coarse.canvas;
}

/**
 * Draws a lamp against the dark.
 * @param {CanvasRenderingContext2D} pen
 * @param {number} x
 * @param {number} y
 * @param {number} radius
 * @param {number[]} rgb
 */
function glow(pen, x, y, radius, rgb) {
  // White light looks warm against the dark. A colored lamp is white only in its center.
  const warm = rgb.every((value) => value > 200) ? [255, 196, 116] : rgb;
  const halo = pen.createRadialGradient(x, y, 0, x, y, radius);
  const stops = /** @type {[number, string][]} */ ([
    [0, "#fffdf6"],
    [0.06, "#fff6e4"],
    [0.1, `rgba(${warm}, 0.5)`],
    [0.22, `rgba(${warm}, 0.2)`],
    [0.5, `rgba(${warm}, 0.07)`],
    [1, `rgba(${warm}, 0)`],
  ]);
  for (const [at, color] of stops) halo.addColorStop(at, color);
  pen.fillStyle = halo;
  pen.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
}

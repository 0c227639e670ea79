// A drawing and its history: plain data, so that it can be kept, undone and tested.
//
// Strokes never change: a stroke that is moved or painted is a new one. A state of the drawing is
// the list of its strokes' ids, and the history a list of such states.

/**
 * @typedef {object} Sketch
 * @property {[number, number]} page width and height that the points are in
 * @property {Stroke[]} strokes all strokes of the history
 * @property {number[][]} states ids of what was seen, oldest first
 * @property {number} now index of the state that is seen
 */

/** Most points of a drawing: one that is longer does not fit into a request. */
const MOST_POINTS = 9000;

/** @returns {Sketch} */
export const emptySketch = () => ({ page: [0, 0], strokes: [], states: [[]], now: 0 });

/** The page's shape, width / height. */
export const shape = (/** @type {Sketch} */ { page: [width, height] }) => width / height || 16 / 9;

/** The strokes that are seen, in their order. @returns {Stroke[]} */
export function seen(/** @type {Sketch} */ sketch) {
  const known = new Map(sketch.strokes.map((stroke) => [stroke.id, stroke]));
  return sketch.states[sketch.now].flatMap((id) => known.get(id) ?? []);
}

/**
 * The drawing as the program reads it: points within the page, in the order of time, and no more
 * of them than fit.
 * @param {Sketch} sketch
 * @param {((color: string) => number[]) | null} rgb color of a stroke as the lamp has it
 */
export function written(sketch, rgb) {
  const [width, height] = sketch.page;
  const strokes = seen(sketch);
  const every = Math.max(
    1,
    Math.ceil(strokes.reduce((sum, stroke) => sum + stroke.points.length, 0) / MOST_POINTS),
  );
  let late = 0;
  const lines = strokes.map(({ points }) => {
    const kept = points.filter((_, i) => i % every === 0 || i === points.length - 1);
    // Each stroke begins where the one before it ended: what was drawn first may have been moved.
    const begin = late - kept[0][2] + 0.3;
    return kept.map(([x, y, t]) => {
      late = Math.max(late, t + begin);
      return [rounded(clamp(x, width)), rounded(clamp(y, height)), Math.round(1000 * late) / 1000];
    });
  });
  return JSON.stringify({
    strokes: lines,
    y: "down",
    canvas: [0, 0, width, height],
    ...(rgb && { colors: strokes.map((stroke) => rgb(stroke.color)) }),
  });
}

const clamp = (/** @type {number} */ value, /** @type {number} */ most) =>
  Math.min(most, Math.max(0, value));
const rounded = (/** @type {number} */ value) => Math.round(10 * value) / 10;

// A drawing and its history as plain data, so that it can be stored, undone and tested.
//
// Strokes never change. Moving or painting a stroke creates a new one. A state of the drawing is the
// list of its strokes' ids, and the history is a list of such states.

/**
 * @typedef {object} Sketch
 * @property {[number, number]} page width and height of the page in the units of the points
 * @property {Stroke[]} strokes all strokes of the history
 * @property {number[][]} states ids of the visible strokes in each state, oldest first
 * @property {number} now index of the current state
 */

/** Maximum number of points in a drawing. More do not fit into a request. */
const MOST_POINTS = 9000;

/** @returns {Sketch} */
export const emptySketch = () => ({ page: [0, 0], strokes: [], states: [[]], now: 0 });

/** Returns the aspect (width / height) of the page. */
export const shape = (/** @type {Sketch} */ { page: [width, height] }) => width / height || 16 / 9;

/** Returns the visible strokes in their order. @returns {Stroke[]} */
export function seen(/** @type {Sketch} */ sketch) {
  const known = new Map(sketch.strokes.map((stroke) => [stroke.id, stroke]));
  return sketch.states[sketch.now].flatMap((id) => known.get(id) ?? []);
}

/**
 * Returns the drawing in the program's JSON format, with points inside the page, in the order of time.
 * A drawing with too many points is thinned out.
 * @param {Sketch} sketch
 * @param {((color: string) => number[]) | null} rgb returns the lamp's color for a stroke's color
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
    // Each stroke begins 0.3 s after the previous one ended, because moving strokes may have changed their order.
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

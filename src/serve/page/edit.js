// Editing of a drawing: its history, and adding, moving and finding strokes.

import { seen } from "./sketch.js";

/** @typedef {import("./sketch.js").Sketch} Sketch */

const MOST_STATES = 200;

export const canUndo = (/** @type {Sketch} */ sketch) => sketch.now > 0;
export const canRedo = (/** @type {Sketch} */ sketch) => sketch.now < sketch.states.length - 1;
export const undone = (/** @type {Sketch} */ sketch) => ({
  ...sketch,
  now: Math.max(0, sketch.now - 1),
});
export const redone = (/** @type {Sketch} */ sketch) => ({
  ...sketch,
  now: Math.min(sketch.states.length - 1, sketch.now + 1),
});

/** Returns the sketch with a list of strokes as its newest state. */
export function withStrokes(/** @type {Sketch} */ sketch, /** @type {Stroke[]} */ strokes) {
  const states = [
    ...sketch.states.slice(0, sketch.now + 1),
    strokes.map((stroke) => stroke.id),
  ].slice(-MOST_STATES);
  const used = new Set(states.flat());
  const known = new Map([...sketch.strokes, ...strokes].map((stroke) => [stroke.id, stroke]));
  return {
    ...sketch,
    strokes: [...known.values()].filter((stroke) => used.has(stroke.id)),
    states,
    now: states.length - 1,
  };
}

const newId = (/** @type {Sketch} */ sketch) =>
  1 + sketch.strokes.reduce((most, stroke) => Math.max(most, stroke.id), 0);

export function withStroke(
  /** @type {Sketch} */ sketch,
  /** @type {Stroke["points"]} */ points,
  /** @type {string} */ color,
) {
  return withStrokes(sketch, [...seen(sketch), { id: newId(sketch), color, points }]);
}

export function without(/** @type {Sketch} */ sketch, /** @type {Stroke} */ gone) {
  return withStrokes(
    sketch,
    seen(sketch).filter((stroke) => stroke.id !== gone.id),
  );
}

export function painted(
  /** @type {Sketch} */ sketch,
  /** @type {Stroke} */ stroke,
  /** @type {string} */ color,
) {
  const id = newId(sketch);
  return withStrokes(
    sketch,
    seen(sketch).map((old) => (old.id === stroke.id ? { ...old, id, color } : old)),
  );
}

/**
 * Returns the sketch with all points changed by `to`.
 * @param {Sketch} sketch
 * @param {(x: number, y: number) => [number, number]} to
 */
export function moved(sketch, to) {
  const first = newId(sketch);
  return withStrokes(
    sketch,
    seen(sketch).map((stroke, i) => ({
      ...stroke,
      id: first + i,
      points: movedPoints(stroke.points, to),
    })),
  );
}

/**
 * @param {Stroke["points"]} points
 * @param {(x: number, y: number) => [number, number]} to
 * @returns {Stroke["points"]}
 */
export const movedPoints = (points, to) => points.map(([x, y, t]) => [...to(x, y), t]);

/** Returns the left, top, right and bottom of strokes, or null without strokes. */
export function bounds(/** @type {Stroke[]} */ strokes) {
  const all = strokes.flatMap((stroke) => stroke.points);
  if (!all.length) return null;
  const [xs, ys] = [0, 1].map((axis) => all.map((point) => point[axis]));
  const least = (/** @type {number[]} */ of) => of.reduce((a, b) => Math.min(a, b));
  const most = (/** @type {number[]} */ of) => of.reduce((a, b) => Math.max(a, b));
  return { left: least(xs), top: least(ys), right: most(xs), bottom: most(ys) };
}

/** Returns the distance of a point from a stroke. @param {Stroke} stroke @param {number} x @param {number} y */
export function distance({ points }, x, y) {
  let best = Math.hypot(points[0][0] - x, points[0][1] - y);
  for (let i = 1; i < points.length; i += 1) {
    const [[ax, ay], [bx, by]] = [points[i - 1], points[i]];
    const length2 = (bx - ax) ** 2 + (by - ay) ** 2;
    const along = length2
      ? Math.min(1, Math.max(0, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2))
      : 0;
    best = Math.min(best, Math.hypot(ax + along * (bx - ax) - x, ay + along * (by - ay) - y));
  }
  return best;
}

/** Returns the stroke nearest to a point, or null if none is within reach. Of equally near strokes, the newest is returned. */
export function touched(
  /** @type {Stroke[]} */ strokes,
  /** @type {number} */ x,
  /** @type {number} */ y,
  /** @type {number} */ reach,
) {
  /** @type {Stroke | null} */
  let found = null;
  let least = reach;
  for (const stroke of strokes) {
    const far = distance(stroke, x, y);
    if (far <= least) [found, least] = [stroke, far];
  }
  return found;
}

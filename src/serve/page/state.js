// The state of the page: a visitor's word, drawing and choices. It survives a reload.

import { emptySketch } from "./sketch.js";

const KEY = "noctograph";

/** Returns the state of a new visitor. */
export const fresh = () => ({
  /** Random name of this visitor, followed by the number of the newest request. */
  visitor: Array.from(crypto.getRandomValues(new Uint32Array(4)), (part) =>
    part.toString(16).padStart(8, "0"),
  ).join(""),
  number: 0,
  language: "",
  /** @type {"word" | "pad" | "sent"} */
  mode: "word",
  word: "",
  sketch: emptySketch(),
  /** @type {Opened | null} */
  opened: null,
  color: "white",
  /** @type {string[]} colors of single letters */
  painted: [],
  lamp: "",
  room: "",
  body: "",
  pace: "written",
  seed: 0,
  /** Aspect (width / height) of a photograph in a link, or 0 for that of the screen. */
  aspect: 0,
  /** @type {Record<string, string>} settings that differ from the scene's */
  settings: {},
  /**
   * @type {{ id: string, number: number, title: string | null } | null}
   */
  sent: null,
});

/** @typedef {ReturnType<typeof fresh>} State */

const isOf = (/** @type {string} */ names) => (/** @type {any} */ value) =>
  names.split(" ").includes(value);
const isText = (/** @type {unknown} */ value) => typeof value === "string";
const isColor = isOf("white red orange yellow green cyan blue magenta");
/** Checks of the parts' values, in addition to their types. @type {Record<string, (value: any) => boolean>} */
const KNOWN = {
  visitor: (value) => /^\w{1,40}$/.test(value),
  number: Number.isSafeInteger,
  mode: isOf("word pad sent"),
  color: isColor,
  painted: (value) => value.every(isColor),
  lamp: isOf(" headlights ring color-led"),
  room: (value) => !value || /^\d+(\.\d+)?(x\d+(\.\d+)?){2}$/.test(value),
  body: isOf(" a6400 canon-eos-2000d one-inch phone"),
  pace: isOf("written even"),
  seed: (value) => Number.isSafeInteger(value) && value >= 0,
  aspect: (value) => !value || (value >= 0.4 && value <= 2.5),
  settings: (value) => Object.values(value).every(isText),
  sketch: isSketch,
  sent: (value) => typeof value.id === "string",
  opened: ({ kind, name, text, corners = [], out = [], size = [] }) =>
    isOf("svg json jpg log")(kind) && [name, text].every(isText) && [corners, out, size].every(Array.isArray),
};

/**
 * Applies parts of a stored state or of a link. Parts that this version does not know, such as those
 * of another version, are left out. Returns true if any part was left out.
 * @param {State} state @param {Record<string, any>} parts
 */
export function take(state, parts) {
  let left = false;
  for (const [part, value] of Object.entries(parts)) {
    const usual = Reflect.get(state, part);
    const isNone = value === null && usual === null;
    let fits = isNone || (value !== null && typeof value === typeof usual && Array.isArray(value) === Array.isArray(usual));
    try {
      fits &&= isNone || KNOWN[part]?.(value) !== false;
    } catch {
      fits = false;
    }
    if (fits && Object.hasOwn(state, part)) Reflect.set(state, part, value);
    else left = true;
  }
  return left;
}

/** Returns true for a coordinate or time that a drawing may contain. @param {any} value */
const isNumber = (value) => Number.isFinite(value) && Math.abs(value) < 1e6;

/** Returns true if a value is a valid drawing. @param {any} value */
function isSketch({ page, strokes, states, now }) {
  const isPoint = (/** @type {unknown} */ point) =>
    Array.isArray(point) && point.length === 3 && point.every(isNumber);
  const isStroke = (/** @type {any} */ { id, color, points }) =>
    Number.isInteger(id) && typeof color === "string" && points.length && points.every(isPoint);
  return page.length === 2 && page.every(isNumber) && Array.isArray(states[now]) && strokes.every(isStroke);
}

/**
 * Settings and room of a link or of a stored state. `key` is the key of the message that
 * some were left out, and `left` is this key while the message is shown.
 * @type {{ settings: Record<string, string>, room: string, key: string, left: string }}
 */
export const origin = { settings: {}, room: "", key: "left-out-kept", left: "" };

/** @returns {State} */
function restored() {
  const state = fresh();
  try {
    const kept = JSON.parse(sessionStorage.getItem(KEY) ?? "{}");
    if (take(state, kept)) origin.left = origin.key;
  } catch {
    origin.left = origin.key;
  }
  // Without an entry, the state of its flight cannot be shown.
  if (state.mode === "sent" && !state.sent) state.mode = "word";
  Object.assign(origin, { settings: state.settings, room: state.room });
  return state;
}

export const state = restored();

/** @type {((changed: Set<string>) => void)[]} */
const watchers = [];

/** Adds a function that is called with the names of the changed parts. */
export function watch(/** @type {(changed: Set<string>) => void} */ tell) {
  watchers.push(tell);
}

/** Changes the state, stores it, and calls the functions that watch it. */
export function change(/** @type {Partial<State>} */ parts) {
  Object.assign(state, parts);
  keep();
  const changed = new Set(Object.keys(parts));
  for (const tell of watchers) tell(changed);
}

export function keep() {
  try {
    sessionStorage.setItem(KEY, JSON.stringify(state));
  } catch {
    // The page works without a storage that is full or forbidden.
    try {
      sessionStorage.setItem(KEY, JSON.stringify({ ...state, opened: null }));
    } catch {
      /* forbidden */
    }
  }
}

/** Resets the state for a new visitor. Only the language is kept, if one is given. */
export function forget(language = "") {
  change({ ...fresh(), language });
}

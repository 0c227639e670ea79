// What a visitor has made and chosen: the only place that holds it. It outlives a reload.

import { emptySketch } from "./sketch.js";

const KEY = "noctograph";

/** A visitor who has made nothing yet. */
export const fresh = () => ({
  /** Random name of this visitor, and the number of the newest wish. */
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
  /** Width / height of a photograph that a link names; 0: that of the screen. */
  aspect: 0,
  /** @type {Record<string, string>} settings that differ from the scene's */
  settings: {},
  /**
   * @type {{ id: string, number: number, title: string | null } | null}
   */
  sent: null,
});

/** @typedef {ReturnType<typeof fresh>} State */

/** @returns {State} */
function restored() {
  const state = fresh();
  try {
    const kept = JSON.parse(sessionStorage.getItem(KEY) ?? "{}");
    for (const key of Object.keys(state))
      if (key in kept && typeof kept[key] === typeof Reflect.get(state, key))
        Reflect.set(state, key, kept[key]);
    // Null has the type of an object: these two may be either.
    state.opened ??= null;
    state.sent ??= null;
    state.sketch ??= emptySketch();
  } catch {
    return state; // what another version wrote is no loss
  }
  return state;
}

export const state = restored();

/** @type {((changed: Set<string>) => void)[]} */
const watchers = [];

/** Calls back with the names of what changed. */
export function watch(/** @type {(changed: Set<string>) => void} */ tell) {
  watchers.push(tell);
}

/** Changes the state, keeps it and tells all who watch. */
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
    // Full (a large file was opened) or forbidden: the page works without.
    try {
      sessionStorage.setItem(KEY, JSON.stringify({ ...state, opened: null }));
    } catch {
      /* forbidden */
    }
  }
}

/** A new visitor: everything is forgotten but the language, if one is given. */
export function forget(language = "") {
  change({ ...fresh(), language });
}

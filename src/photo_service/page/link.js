// The link of a photograph: all that makes it stands behind the `#` of the page's address, so that
// any browser makes it again.

import { change, fresh, state, watch } from "./state.js";
import { seen } from "./sketch.js";

/** What makes a photograph, beside the word. */
const PARTS = /** @type {const} */ ([
  "color", "painted", "lamp", "room", "body", "pace", "seed", "settings", "sketch", "aspect",
]);

/** What a link says of the wish, in a shape (width / height). */
function parts(/** @type {number} */ aspect) {
  const strokes = seen(state.sketch);
  const sketch = { ...state.sketch, strokes, states: [strokes.map(({ id }) => id)], now: 0 };
  const [now, usual] = [{ ...state, sketch, aspect }, fresh()];
  const all = new URLSearchParams({ word: state.word.trim() });
  for (const part of PARTS) {
    const text = JSON.stringify(now[part]);
    if (text !== JSON.stringify(usual[part])) all.set(part, text);
  }
  return `${all}`;
}

/** What the address says; "" where it says nothing. */
let said = "";

/** Puts the link of what is wished into the address, and returns it. */
export function putLink(/** @type {number} */ aspect) {
  state.aspect = aspect;
  said = parts(aspect);
  history.replaceState(null, "", `#${said}`);
  return location.href;
}

/** Opens what the address says, if it says something. What is none of ours is left out. */
export function openLink() {
  const all = new URLSearchParams(location.hash.slice(1));
  if (!all.has("word")) return;
  const told = { ...fresh(), visitor: state.visitor, number: state.number, language: state.language };
  told.word = all.get("word") ?? "";
  for (const part of PARTS) {
    try {
      const value = JSON.parse(all.get(part) ?? "null");
      const usual = told[part];
      const fits = typeof value === typeof usual && Array.isArray(value) === Array.isArray(usual);
      if (value !== null && fits && isSketch(part, value)) Reflect.set(told, part, value);
    } catch {
      // another page's
    }
  }
  if (!told.word.trim() && seen(told.sketch).length) told.mode = "pad";
  said = "";
  change(told);
  said = parts(state.aspect);
}

// What is changed is no longer what the address says, and takes the shape of this screen.
watch(() => {
  if (!said || said === parts(state.aspect)) return;
  said = "";
  state.aspect = 0;
  if (location.hash.startsWith("#word=")) history.replaceState(null, "", ".");
});

/** Whether a part that is a drawing can be drawn. @param {string} part @param {any} value */
function isSketch(part, value) {
  if (part !== "sketch") return true;
  const isPoint = (/** @type {unknown} */ point) =>
    Array.isArray(point) && point.length === 3 && point.every(Number.isFinite);
  const isStroke = (/** @type {any} */ { id, color, points }) =>
    Number.isInteger(id) && typeof color === "string" && points?.length && points.every(isPoint);
  const { page, strokes, states, now } = value;
  return page?.length === 2 && page.every(Number.isFinite) && states?.[now] && strokes?.every(isStroke);
}

addEventListener("hashchange", openLink);

// The link of a photograph contains all settings behind the `#` of the page's address, so that any
// browser can make the photograph again.

import { change, fresh, origin, state, take, watch } from "./state.js";
import { seen } from "./sketch.js";

/** Settings of a photograph, in addition to the word. */
const PARTS = /** @type {const} */ ([
  "color", "painted", "lamp", "room", "body", "pace", "seed", "settings", "sketch", "aspect",
]);

/** Returns the settings for a link, with the aspect (width / height). */
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

/** Settings in the address, or "" if there are none. */
let said = "";

/** Puts the link of the current settings into the address, and returns it. */
export function putLink(/** @type {number} */ aspect) {
  state.aspect = aspect;
  said = parts(aspect);
  history.replaceState(null, "", `#${said}`);
  return location.href;
}

/** Applies the settings in the address, if any. Unknown settings are left out with a message. */
export function openLink() {
  const all = new URLSearchParams(location.hash.slice(1));
  if (!all.has("word")) return;
  const told = { ...fresh(), visitor: state.visitor, number: state.number, language: state.language };
  told.word = all.get("word") ?? "";
  all.delete("word");
  /** @type {Record<string, unknown>} */
  const values = {};
  for (const [part, text] of all) {
    const isPart = PARTS.some((known) => known === part);
    try {
      values[isPart ? part : ""] = JSON.parse(text);
    } catch {
      values[""] = null;
    }
  }
  const left = take(told, values);
  if (!told.word.trim() && seen(told.sketch).length) told.mode = "pad";
  said = "";
  change(told);
  Object.assign(origin, { settings: told.settings, room: told.room, key: "left-out", left: left ? "left-out" : "" });
  said = parts(state.aspect);
}

// After a change the address is outdated, and the photograph takes the shape of this screen.
watch(() => {
  if (!said || said === parts(state.aspect)) return;
  said = "";
  state.aspect = 0;
  if (location.hash.startsWith("#word=")) history.replaceState(null, "", ".");
});

addEventListener("hashchange", openLink);

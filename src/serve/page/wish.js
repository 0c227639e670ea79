// The request for a photograph: the word, drawing or file with its settings.

import { seen, written } from "./sketch.js";
import { state } from "./state.js";

/** Decks that carry the lamps, by the page's names of the lamps. */
export const DECKS = { ring: "led-ring", "color-led": "color-led" };
/** Lenses of the cameras that the drawer offers. */
const LENSES = { a6400: "kit-16mm", "canon-eos-2000d": "28mm", "one-inch": "28mm" };

/** @type {About} */
export let about;
export const learn = (/** @type {About} */ told) => {
  about = told;
};

/**
 * Returns the word as it is written. As in the program, any white space becomes a space, and
 * characters that only control the direction of text are left out.
 */
const word = () =>
  state.word
    .replace(/\s/g, " ")
    .replace(/[\xad\u061c\u180e\u200b\u200e\u200f\u202a-\u202e\u2060-\u206f\ufeff]/g, "")
    .replace(/([\u0600-\u1cff]?)([\u200c\u200d])/g, (_, joined, joiner) => (joined ? joined + joiner : ""))
    .trim();
/** Returns the letters, each of which may have its own color. */
export const letters = () => [...word().replace(/ /g, "")];
export const colorOf = (/** @type {number} */ i) => state.painted[i] ?? state.color;

/** Returns the colors of the letters or strokes. */
function colors() {
  if (state.mode === "pad" || isDrawing()) return seen(state.sketch).map((stroke) => stroke.color);
  return letters().map((_, i) => colorOf(i));
}

/** Returns true for the log of a flight, whose word may be known. */
export const isLog = () => state.opened?.kind === "log";
export const isDrawing = () => !state.opened && !word() && seen(state.sketch).length > 0;
export const isEmpty = () =>
  state.opened ? isNothing(state.opened) : !word() && !seen(state.sketch).length;
/** Returns true if all strokes of a file are left out. */
const isNothing = (/** @type {Opened} */ { out, of }) => out !== undefined && out.length === of;
/** Returns the title of the photograph, or null for a drawing. */
export const title = () => (state.opened || isDrawing() ? null : word());

/** Returns the lamp that writes: the chosen one or, if a color is needed, one with colors. */
function lamp() {
  if (state.lamp && state.lamp !== "headlights") return state.lamp;
  const plain = colors().every((color) => color === "white");
  if (state.opened ? !state.opened.colored : plain) return "headlights";
  return about.deck === "led-ring" ? "ring" : "color-led";
}

/** Largest sides of the pad in meters, and its fraction of the photograph's sides. */
const PAD_M = [3, 1.7];
export const FILL = 0.8;
/** Aspect below which the screen is that of a phone or of an upright tablet. */
const NARROW = 1.3;

/** Returns a color of the lamps by its name. */
const color = (/** @type {string} */ name) =>
  about.colors.find((color) => color.name === name) ?? about.colors[0];

/** Returns a pad's width and height in meters for an aspect. */
function canvas(/** @type {number} */ aspect) {
  const high = Math.min(PAD_M[1], PAD_M[0] / aspect);
  return [high * aspect, high].map((side) => Math.round(1000 * side) / 1000);
}

/** @returns {{ word: string, log?: string } | { drawing: { kind: string, text: string } }} */
function subject() {
  if (state.opened && isLog()) return { word: word(), log: state.opened.text };
  if (state.opened) return { drawing: { kind: state.opened.kind, text: state.opened.text } };
  if (!isDrawing()) return { word: word() };
  // White is the lamp's own color, which a drawing expresses as black.
  const own = lamp() === "color-led" ? "white" : "";
  const rgb = (/** @type {string} */ name) => (name === own ? [0, 0, 0] : color(name).screen);
  return {
    drawing: { kind: "json", text: written(state.sketch, lamp() === "headlights" ? null : rgb) },
  };
}

/** Returns the corners and the selected strokes of a file as settings. @param {Opened} opened */
function chosen({ corners, out = [], of = 0 }) {
  const all = Array.from({ length: of }, (_, i) => i + 1);
  const few = 2 * out.length > of ? all.filter((n) => !out.includes(n)) : out;
  const begins = few.filter((n) => !few.includes(n - 1)),
    ends = few.filter((n) => !few.includes(n + 1));
  const list = begins.map((n, i) => (n === ends[i] ? `${n}` : `${n}-${ends[i]}`)).join(",");
  return {
    ...(corners && { "letters.corners_px": JSON.stringify(corners.flat()) }),
    ...(list && { [few === out ? "letters.without" : "letters.ink"]: list }),
  };
}

/** @param {number} aspect @returns {Record<string, string>} */
function settings(aspect) {
  const set = { ...state.settings };
  const writes = lamp();
  if (state.seed) set.seed = `${state.seed}`;
  if (state.opened && !isLog()) {
    const high = Number(set["letters.cap_height_m"] ?? 0.5);
    set["letters.canvas_m"] = JSON.stringify([6 * high, 2 * high]);
    Object.assign(set, chosen(state.opened));
  }
  // On a narrow screen, a word fills more of the width.
  if (aspect < NARROW && !state.opened) set["camera.framing.fill_frac"] = "0.85";
  if (isDrawing()) {
    set["letters.canvas_m"] = JSON.stringify(canvas(state.sketch.page[0] / state.sketch.page[1]));
    set["camera.framing.fill_frac"] = `${FILL}`;
    set["letters.pace"] = state.pace;
  }
  if (writes !== "headlights") {
    set["light.deck"] = DECKS[/** @type {keyof typeof DECKS} */ (writes)];
    set["plan.lights"] = JSON.stringify([writes]);
    const wrgb = (/** @type {string} */ name) =>
      name === "white" && writes === "color-led"
        ? [255, 0, 0, 0]
        : color(name)[/** @type {"ring"} */ (writes)];
    if (!state.opened && !isDrawing())
      set["light.letters_wrgb"] = JSON.stringify(letters().map((_, i) => wrgb(colorOf(i))));
  }
  if (state.body) set["camera.body"] = state.body;
  if (state.body in LENSES)
    set["camera.lens"] = LENSES[/** @type {keyof typeof LENSES} */ (state.body)];
  return set;
}

/** Returns the request for a photograph with an aspect (width / height). */
export function wish(/** @type {number} */ aspect) {
  return {
    ...subject(),
    settings: settings(aspect),
    aspect,
    ...(state.room && { room: state.room }),
  };
}

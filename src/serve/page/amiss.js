// What is amiss: why a word is not read, and what another version's link, state or a file of another
// kind makes impossible. Loaded when something is.

import { change, origin, state } from "./state.js";
import { sentence } from "./words.js";

/** Reasons that the letters tell better. */
const ALIKE = ["misread", "other-length", "unsure"];

/**
 * The letter that is taken most easily for another one, and for which.
 * @param {Judged} verdict
 * @returns {{ i: number, letter: string, best: string } | null}
 */
export function pair({ letters, rival }) {
  if (isLine(letters)) return null;
  const read = [...(rival?.word ?? "")].filter((letter) => letter !== " ");
  let i = read.length === letters.length ? letters.findIndex(({ expected }, k) => !isAlike(expected, read[k])) : -1;
  if (i >= 0 && read[i] !== "?") return { i, letter: letters[i].expected, best: read[i] };
  const shares = letters.map(({ rivals }) => rivals[0]?.p ?? 0);
  i = shares.indexOf(Math.max(...shares));
  return shares[i] >= ALIKE_P ? { i, letter: letters[i].expected, best: letters[i].rivals[0].letter } : null;
}
/** Least probability of another letter that counts as visible. */
const ALIKE_P = 0.03;

/** True if two texts have the same shape for the reader: without marks and case, I as l and 1. */
const isAlike = (/** @type {string} */ a, /** @type {string} */ b) => shapes(a) === shapes(b);
const shapes = (/** @type {string} */ text) =>
  text.normalize("NFD").replace(/[\p{M}\s]/gu, "").toLowerCase().replace(/[l1|]/g, "i");

/** True if a line is the only one. */
const isLine = (/** @type {LetterVerdict[]} */ letters) => letters.length === 1 && /[Il1|]/.test(letters[0].expected);

/** Why a word is not read, as the eye sees it. @param {Judged} verdict */
export function reason(verdict) {
  const { letters, rival, word } = verdict;
  const key = (verdict.reason ?? "").replace(/_/g, "-");
  const why = (/** @type {string} */ key, values = {}) => sentence("reasons", { key, text: "", values });
  if (!ALIKE.includes(key)) return why(key);
  if (isLine(letters)) return why("alone");
  const alike = pair(verdict);
  if (alike) return why("pair", alike);
  const isOther = rival && !rival.word.includes("?") && !isAlike(rival.word, word);
  return isOther ? why("rival", { word: rival.word }) : why(key);
}

/**
 * Leaves out what another version's link or state has set, and this one does not know. Returns
 * whether there was something. @param {Said} error
 */
export function leaveOut({ key, values }) {
  const foreign = Object.keys(state.settings).filter((known) => state.settings[known] === origin.settings[known]);
  const name = `${values?.setting ?? ""}.`;
  const named = foreign.filter((known) => name.startsWith(`${known}.`) || `${known}.`.startsWith(name));
  // What is not named, or follows from others, may be any of them.
  const isUnnamed = !named.length && ["page-old", "not-possible"].includes(key);
  const isRoom = isUnnamed && state.room !== "" && state.room === origin.room;
  const wrong = isUnnamed && !isRoom ? foreign : named;
  if (!wrong.length && !isRoom) return false;
  const settings = Object.fromEntries(Object.entries(state.settings).filter(([known]) => !wrong.includes(known)));
  change({ settings, ...(isRoom && { room: "" }) });
  origin.left = origin.key;
  return true;
}

/**
 * An error of an opened log: in a sentence of the page.
 * @param {Said} error @param {boolean} isSeen whether the log was photographed: then it is the word
 * @returns {Said}
 */
export function ofLog(error, isSeen) {
  if (error.key !== "log" || !state.opened) return error;
  const values = { name: state.opened.name, word: state.word.trim() };
  return { ...error, key: isSeen && values.word ? "log-word" : "log", values };
}

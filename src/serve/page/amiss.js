// Explanations of illegible words, of links and states of another version, and of unsuitable files.
// This module is loaded when it is first needed.

import { change, origin, state } from "./state.js";
import { sentence } from "./words.js";

/** Reasons that are explained by the letters, if possible. */
const ALIKE = ["misread", "other-length", "unsure"];

/**
 * Returns the letter that is most easily taken for another one, and that other letter.
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
/** Smallest probability of another letter for which a letter counts as similar to it. */
const ALIKE_P = 0.03;

/** Returns true if two texts look the same to the reader: marks and case do not count, and I equals l and 1. */
const isAlike = (/** @type {string} */ a, /** @type {string} */ b) => shapes(a) === shapes(b);
const shapes = (/** @type {string} */ text) =>
  text.normalize("NFD").replace(/[\p{M}\s]/gu, "").toLowerCase().replace(/[l1|]/g, "i");

/** Returns true for a word that is a single vertical line. */
const isLine = (/** @type {LetterVerdict[]} */ letters) => letters.length === 1 && /[Il1|]/.test(letters[0].expected);

/** Returns a sentence with the visible reason why a word is illegible. @param {Judged} verdict */
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
 * Removes the settings of another version's link or state that caused an error. Returns true if there
 * were any. @param {Said} error
 */
export function leaveOut({ key, values }) {
  const foreign = Object.keys(state.settings).filter((known) => state.settings[known] === origin.settings[known]);
  const name = `${values?.setting ?? ""}.`;
  const named = foreign.filter((known) => name.startsWith(`${known}.`) || `${known}.`.startsWith(name));
  // If the error names no setting, any of them may have caused it.
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
 * Returns an error of an opened log with the key of a sentence of the page.
 * @param {Said} error @param {boolean} isSeen whether the log was photographed, so that the word is the cause
 * @returns {Said}
 */
export function ofLog(error, isSeen) {
  if (error.key !== "log" || !state.opened) return error;
  const values = { name: state.opened.name, word: state.word.trim() };
  return { ...error, key: isSeen && values.word ? "log-word" : "log", values };
}

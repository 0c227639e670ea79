// The verdict, as a sentence or two.

import { byId, make } from "./dom.js";
import { about, isLog } from "./wish.js";
import { hasWord, sentence, t } from "./words.js";

/**
 * What is said; `why` opens the program's own words.
 * @typedef {{ first: string, then?: string, why?: boolean }} Spoken
 */

/** Without these there is something to see; the others are told at home. */
const DARK = ["unlit", "underexposed", "no-picture"];

/** Why a photograph shows nothing that could be sent. @param {Shot} shot */
export const obstacle = (shot) => shot.obstacles.find(({ key }) => DARK.includes(key));

/** Errors whose English words say more than the page's sentence. */
const EXPLAINED = ["broken", "drawing-broken", "log", "not-possible", "page-old"];
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
/** A share of another letter that the eye sees. */
const ALIKE_P = 0.03;

/** Whether two texts have one shape, as the reader sees it: without marks and case, I as l and 1. */
const isAlike = (/** @type {string} */ a, /** @type {string} */ b) => shapes(a) === shapes(b);
const shapes = (/** @type {string} */ text) =>
  text.normalize("NFD").replace(/[\p{M}\s]/gu, "").toLowerCase().replace(/[l1|]/g, "i");

/** Whether a line stands alone. */
const isLine = (/** @type {LetterVerdict[]} */ letters) => letters.length === 1 && /[Il1|]/.test(letters[0].expected);

/** Why a word is not read, as the eye sees it. @param {Judged} verdict */
function reason(verdict) {
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
 * What is said of a photograph of a word. @param {Shot} shot
 * @param {Judged | null} verdict that of the photograph which is kept; null: it is not known yet
 * @returns {Spoken}
 */
export function ofShot(shot, verdict) {
  const flight = t("flight", { n: Math.round(shot.flight_s) });
  const dark = obstacle(shot);
  if (dark) return { first: sentence("obstacles", dark) };
  if (!verdict) return { first: t(isLog() && !shot.verdict ? "unjudged-log" : "unjudged"), then: flight };
  const read = verdict.read.replace(/\s+/g, " ").trim();
  if (verdict.legible) return { first: t("reads", { read }), then: flight };
  const wrong = verdict.letters.find(({ expected, best }) => best !== expected);
  // Without a server nothing is sent.
  const sends = wrong ? t("way-letter", { letter: wrong.expected }) : t("way");
  const way = isLog() ? "" : about.alone ? t("way-alone") : sends;
  if (!wrong && verdict.reason) {
    return {
      first: t("unsure"),
      then: `${reason(verdict)} ${way}`.trim(),
    };
  }
  // A question mark stands for light that is no letter.
  return { first: read && !read.includes("?") ? t("unreadable", { read }) : t("unreadable-nothing"), then: way };
}

/** What is said of an error: its sentence, and a way out. @param {Said} said @returns {Spoken} */
export function ofError(said) {
  const way = `way-${said.key}`;
  return {
    first: sentence("errors", said),
    then: hasWord(way) ? t(way) : undefined,
    why: about.home && said.text !== "" && EXPLAINED.includes(said.key),
  };
}

/**
 * Puts a sentence where it is read out; the same one again is no news.
 * @param {HTMLElement} line
 * @param {Spoken} spoken
 */
export function say(line, { first, then, why }) {
  const asks = why ? t("why") : "";
  if (line.textContent === [first, then, asks].filter(Boolean).join(" ")) return;
  line.replaceChildren(
    make(
      "span",
      {},
      ...(then
        ? [make("strong", {}, first), " ", make("span", { className: "then" }, then)]
        : [first]),
      ...(why ? [" ", make("button", { type: "button", className: "why", onclick: () => byId("more").click() }, asks)] : []),
    ),
  );
}

/** What is said of the length of a drawing. @param {number} seconds @param {number} battery_s */
export function ofLength(seconds, battery_s) {
  const n = Math.round(seconds);
  const key = n > battery_s ? "too-long" : n > 0.7 * battery_s ? "nearly-full" : "room-for-more";
  return { first: t("flight-of", { n }), then: t(key) };
}

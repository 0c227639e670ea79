// The sentences about a photograph, an error or a drawing's length.

import { byId, make } from "./dom.js";
import { about, isLog } from "./wish.js";
import { hasWord, sentence, t } from "./words.js";

/**
 * One or two sentences. If `why` is true, a button opens the program's own message.
 * @typedef {{ first: string, then?: string, why?: boolean }} Spoken
 */

/** Problems that leave nothing visible. Only the host also sees other problems. */
const DARK = ["unlit", "underexposed", "no-picture"];

/** Returns the problem because of which a photograph shows nothing that could be sent. @param {Shot} shot */
export const obstacle = (shot) => shot.obstacles.find(({ key }) => DARK.includes(key));

/** Errors whose English message says more than the page's sentence. */
const EXPLAINED = ["broken", "drawing-broken", "log", "not-possible", "page-old"];
/**
 * Returns the sentences about a photograph. @param {Shot} shot
 * @param {Judged | null} verdict verdict on the photograph that is kept, or null if it is not known yet
 * @param {(verdict: Judged) => string} [reason] returns the reason for an illegible word
 * @returns {Spoken}
 */
export function ofShot(shot, verdict, reason = () => "") {
  const flight = t("flight", { n: Math.round(shot.flight_s) });
  const dark = obstacle(shot);
  if (dark) return { first: sentence("obstacles", dark) };
  if (!verdict) return { first: t(isLog() && !shot.verdict ? "unjudged-log" : "unjudged"), then: flight };
  const read = verdict.read.replace(/\s+/g, " ").trim();
  if (verdict.legible) return { first: t("reads", { read }), then: flight };
  const wrong = verdict.letters.find(({ expected, best }) => best !== expected);
  // Without a server, nothing can be sent.
  const sends = wrong ? t("way-letter", { letter: wrong.expected }) : t("way");
  const way = isLog() ? "" : about.alone ? t("way-alone") : sends;
  if (!wrong && verdict.reason) {
    return {
      first: t("unsure"),
      then: `${reason(verdict)} ${way}`.trim(),
    };
  }
  // A question mark stands for light that is not a letter.
  return { first: read && !read.includes("?") ? t("unreadable", { read }) : t("unreadable-nothing"), then: way };
}

/** Returns the sentence about an error, and advice. @param {Said} said @returns {Spoken} */
export function ofError(said) {
  const way = `way-${said.key}`;
  return {
    first: sentence("errors", said),
    then: hasWord(way) ? t(way) : undefined,
    why: about.home && said.text !== "" && EXPLAINED.includes(said.key),
  };
}

/**
 * Shows sentences where a screen reader reads them. Repeated sentences are not read again.
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

/** Returns the sentences about the flight time of a drawing. @param {number} seconds @param {number} battery_s */
export function ofLength(seconds, battery_s) {
  const n = Math.round(seconds);
  const key = n > battery_s ? "too-long" : n > 0.7 * battery_s ? "nearly-full" : "room-for-more";
  return { first: t("flight-of", { n }), then: t(key) };
}

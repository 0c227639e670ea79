// The photograph, which fills the stage. It stays, dimmed, until the next one is loaded. Each touch of
// a letter gives the letter the next color.

import { byId, make } from "./dom.js";
import { offered } from "./lights.js";
import { change, state } from "./state.js";
import { t } from "./words.js";
import { colorOf, letters } from "./wish.js";

const frame = byId("frame"),
  marks = byId("marks");
let photo = /** @type {HTMLImageElement} */ (byId("photo"));
const light = /** @type {HTMLCanvasElement} */ (byId("light"));

/** @type {((fraction: number) => void) | null} */
let show = null;
/** @type {LightMap | null} */
let map = null;
let wanted = 1;

/** Shows a fraction of the exposure. At 1, the photograph itself is shown. */
export function expose(/** @type {number} */ share) {
  const whole = share >= 1 || !map;
  light.hidden = whole;
  frame.classList.toggle("exposing", !whole);
  wanted = share;
  if (whole || !map) return;
  if (show) return show(share);
  // The module is loaded when the first exposure is shown.
  const asked = map;
  import("./exposure.js").then(({ exposure }) => {
    if (map !== asked) return;
    show ??= exposure(photo, map, light);
    if (wanted < 1) show(wanted);
  });
}

/**
 * Decodes and shows a photograph. Returns false, and shows nothing, if it is outdated by then.
 * @param {string} src @param {string} alt @param {LightMap} replay @param {number} aspect
 * @param {() => boolean} wanted
 */
export async function hang(src, alt, replay, aspect, wanted) {
  const next = new Image();
  next.src = src;
  await next.decode();
  if (!wanted()) return false;
  // The decoded image replaces the previous one, so that no image is decoded twice.
  Object.assign(next, { id: "photo", alt });
  photo.replaceWith(next);
  photo = next;
  const { top, bottom } = extent(replay);
  for (const [name, value] of Object.entries({
    shape: aspect,
    low: bottom,
    tall: Math.max(0.1, bottom - top),
    middle: (top + bottom) / 2,
  }))
    frame.style.setProperty(`--${name}`, `${value}`);
  frame.hidden = false;
  [show, map] = [null, replay];
  return true;
}

/** Returns the lamp's highest and lowest position, as fractions of the photograph's height. @param {LightMap} replay */
function extent({ strokes }) {
  const heights = strokes.flatMap(({ at }) => at.filter((_, i) => i % 3 === 2));
  const [top, bottom] = heights.reduce(([a, b], y) => [Math.min(a, y), Math.max(b, y)], [1e4, 0]);
  return top < bottom ? { top: top / 1e4, bottom: bottom / 1e4 } : { top: 0.25, bottom: 0.75 };
}

/** Removes the photograph. */
export function clear() {
  frame.hidden = true;
  photo.removeAttribute("src");
  photo.alt = "";
  marks.replaceChildren();
  [show, map] = [null, null];
}

export const dim = (/** @type {boolean} */ waits) => frame.classList.toggle("waits", waits);

/**
 * Shows the letters' boxes on the photograph, and what is wrong with illegible letters.
 * @param {Shot["boxes"] | undefined} boxes @param {LetterVerdict[]} read
 * @param {{ i: number, best: string } | null} alike the letter that is most easily taken for another one
 */
export function mark(boxes, read, alike) {
  const written = boxes?.length ? letters() : [];
  const focused = [...marks.querySelectorAll("button")].indexOf(
    /** @type {HTMLButtonElement} */ (document.activeElement),
  );
  marks.hidden = !written.length;
  marks.setAttribute("aria-label", t("letters"));
  marks.replaceChildren(
    ...written.flatMap((letter, i) => {
      const box = boxes?.[i];
      if (!box) return [];
      const { best, expected } = read[i] ?? {};
      const isAlike = alike?.i === i;
      const wrong = isAlike || (best !== undefined && best !== expected);
      const color = t(colorOf(i));
      const looks = isAlike ? t("could-be", alike) : best ? t("looks-like", { best }) : t("looks-like-nothing");
      const button = make("button", {
        type: "button",
        tabIndex: i === Math.max(0, focused) ? 0 : -1,
        "aria-label": [`${letter}: ${color}`, wrong ? looks : ""].filter(Boolean).join(", "),
      });
      button.onclick = () => next(i);
      const item = make(
        "li",
        { className: wrong ? "wrong" : "" },
        button,
        ...(wrong ? [make("b", { "aria-hidden": "true" }, looks)] : []),
      );
      const [left, top, right, bottom] = box;
      for (const [side, value] of Object.entries({
        left,
        top,
        width: right - left,
        height: bottom - top,
      }))
        item.style.setProperty(side, `${value / 100}%`);
      return [item];
    }),
  );
  if (focused >= 0) marks.querySelectorAll("button")[focused]?.focus();
}

/** Gives the next color to a letter. */
function next(/** @type {number} */ i) {
  const names = offered();
  const color = names[(names.indexOf(colorOf(i)) + 1) % names.length];
  change({ painted: letters().map((_, k) => (k === i ? color : colorOf(k))) });
}

marks.onkeydown = (event) => {
  const step = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (!step) return;
  event.preventDefault();
  const buttons = [...marks.querySelectorAll("button")];
  const now = buttons.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
  const to = buttons[(now + step + buttons.length) % buttons.length];
  buttons.forEach((button) => {
    button.tabIndex = button === to ? 0 : -1;
  });
  to?.focus();
};

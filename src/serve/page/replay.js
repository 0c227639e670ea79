// The strip below the photograph, a time scale on which each bar is a lit stroke and each gap a dark
// transit. Its slider sets the fraction of the exposure.

import { icon, make } from "./dom.js";
import { t } from "./words.js";

const PLAYED_MS = 6000;
const still = matchMedia("(prefers-reduced-motion: reduce)");

/** Returns the time of the first light, and the time from there to the last, in 1/100 s. @param {LightMap} replay */
export function span({ strokes }) {
  const begin = strokes.reduce((least, { at }) => Math.min(least, at[0]), Infinity);
  const end = strokes.reduce((most, { at }) => Math.max(most, at[at.length - 3]), 0);
  return { begin, length: Math.max(1, end - begin) };
}

/**
 * Builds the strip in an element.
 * @param {HTMLElement} box
 * @param {(fraction: number) => void} expose shows a fraction of the exposure
 */
export function replay(box, expose) {
  const play = make("button", { type: "button" });
  const dark = make("div", { className: "dark" }),
    lit = make("div", { className: "lit" });
  const range = make("input", { type: "range", min: "0", max: "1000", value: "1000" });
  const strip = make(
    "div",
    { className: "strip" },
    dark,
    lit,
    make("div", { className: "lamp" }),
    range,
  );
  const clock = make("output", { dir: "auto" });
  box.append(play, strip, clock);
  let film = 0,
    seconds = 0,
    share = 1;

  function put(/** @type {number} */ now) {
    share = now;
    strip.style.setProperty("--p", `${100 * share}%`);
    range.value = `${Math.round(1000 * share)}`;
    const all = Math.round(seconds),
      text =
        share >= 1
          ? t("seconds", { n: all })
          : t("clock", { now: Math.round(share * seconds), all });
    if (clock.textContent !== text) {
      clock.textContent = text;
      range.setAttribute("aria-valuetext", text);
    }
    expose(share);
  }
  function pressed(/** @type {boolean} */ plays) {
    play.replaceChildren(icon(plays ? "pause" : "play"));
    play.setAttribute("aria-label", t(plays ? "pause" : "watch"));
    range.setAttribute("aria-label", t("exposure"));
  }
  function stop() {
    cancelAnimationFrame(film);
    film = 0;
    pressed(false);
  }
  /** Plays the exposure within `length` ms, from its beginning if it is at its end. @param {number} [first] initial fraction */
  function run(length = PLAYED_MS, first = share >= 1 ? 0 : share) {
    stop();
    if (still.matches) return put(1);
    pressed(true);
    let begun = 0;
    const step = (/** @type {number} */ time) => {
      begun ||= time;
      put(Math.min(1, first + Math.max(0, time - begun) / length));
      if (share < 1) film = requestAnimationFrame(step);
      else stop();
    };
    film = requestAnimationFrame(step);
  }
  play.onclick = () => (film ? stop() : run());
  range.oninput = () => {
    stop();
    put(Number(range.value) / 1000);
  };
  pressed(false);

  return {
    run,
    stop,
    words: () => {
      pressed(film > 0);
      put(share);
    },
    /** Shows the strokes of a new photograph and its whole exposure. If it is a sharper photograph of the same flight, the fraction is kept. */
    load(/** @type {LightMap} */ map, /** @type {number} */ flight_s, isSame = false) {
      if (!isSame) stop();
      seconds = flight_s;
      const { begin, length } = span(map);
      const bars = map.strokes.map(({ at }) => {
        const bar = make("i");
        bar.style.left = `${(100 * (at[0] - begin)) / length}%`;
        bar.style.width = `${(100 * (at[at.length - 3] - at[0])) / length}%`;
        return bar;
      });
      dark.replaceChildren(...bars);
      lit.replaceChildren(...bars.map((bar) => bar.cloneNode()));
      put(isSame ? share : 1);
    },
  };
}

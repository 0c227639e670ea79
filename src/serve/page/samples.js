// Samples for an evening without photographs: a name, a house and a heart in color, which are
// photographed like those of visitors and written one after another.

import { post, sleep } from "./ask.js";
import { make } from "./dom.js";
import { exposure } from "./exposure.js";
import { loop } from "./loop.js";
import { fresh } from "./state.js";
import { DECKS } from "./wish.js";

/** Times in which a sample is written and for which it is shown, and time after which a failed request is repeated. */
const WRITTEN_MS = 9_000,
  STANDS_MS = 5_000,
  AGAIN_MS = 10_000;

/** Returns a drawing of a line in one color on a square of 100 units. */
const drawing = (/** @type {string} */ color, /** @type {string} */ line) => ({
  drawing: {
    kind: "svg",
    text: `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path fill="none" stroke="${color}" d="${line}"/></svg>`,
  },
});
const HOUSE = drawing("black", "M8 50L50 12 92 50M20 40V90H80V40M42 90V62H58V90");
const HEART = drawing("red", "M50 88C8 56 6 20 30 18 42 17 50 28 50 38 50 28 58 17 70 18 94 20 92 56 50 88Z");

/** Returns the requests for the samples. @param {string} deck that of the scene's drone */
function wishes(deck) {
  const lamp = deck === DECKS.ring ? "ring" : "color-led";
  const canvas = { "letters.canvas_m": "[3,1]" };
  return [
    { word: "Noor", settings: {} },
    { ...HOUSE, settings: canvas },
    { ...HEART, settings: { ...canvas, "light.deck": DECKS[lamp], "plan.lights": JSON.stringify([lamp]) } },
  ];
}

/** Photographs of the samples, or null for one that could not be made. @type {(Shot | null)[]} */
const shots = [];

/**
 * Shows the samples in an element as long as `isWanted` returns true.
 * @param {Element} box @param {string} deck @param {() => boolean} isWanted
 */
export async function putSamples(box, deck, isWanted) {
  const all = wishes(deck),
    { visitor } = fresh();
  for (let i = 0; isWanted(); i = (i + 1) % all.length) {
    const asked = { ...all[i], visitor, number: i + 1, aspect: 1.8 };
    const shot = (shots[i] ??= await post("live", asked).catch(() => null));
    if (shot?.photo && isWanted()) await write(shot, box);
    else await sleep(AGAIN_MS);
  }
}

/** @param {Shot} shot @param {Element} box */
async function write(shot, box) {
  const photo = make("img", { src: shot.photo, alt: "" }),
    light = make("canvas", { "aria-hidden": "true" });
  await photo.decode();
  box.replaceChildren(make("div", { className: "frame" }, photo, light));
  light.hidden = true;
  loop(exposure(photo, shot.replay, light), photo, light, WRITTEN_MS, Infinity);
  await sleep(WRITTEN_MS + STANDS_MS);
}

// The kiosk's start screen, and the return to it when nobody uses the page.

import { get } from "./ask.js";
import { byId, make, style } from "./dom.js";
import { exposure } from "./exposure.js";
import { loop, stopLoop } from "./loop.js";
import { putSamples } from "./samples.js";
import { change, forget, state } from "./state.js";
import { about, isEmpty } from "./wish.js";
import { LANGUAGES, ofMaker, preferred, speak, speakAll, t } from "./words.js";

/** Time without a touch after which the page is reset for the next visitor, with a warning before. */
const IDLE_S = 60,
  SAID_S = 10;
/** Times for which the newest photograph of the evening is written and shown. */
const WRITTEN_MS = 20_000,
  STANDS_MS = 20_000;

const start = byId("start"),
  main = /** @type {HTMLElement} */ (document.querySelector("main"));
let idle = 0;

/** Starts the kiosk with the start screen, unless a visitor's work was restored. */
export async function startKiosk() {
  home = preferred("");
  await speakAll();
  if (isEmpty()) showStart();
  for (const event of ["pointerdown", "pointermove", "keydown", "input", "wheel"])
    addEventListener(event, touched, { capture: true });
  for (const event of ["contextmenu", "dragstart"])
    addEventListener(event, (event) => event.preventDefault());
  addEventListener("wheel", (event) => event.ctrlKey && event.preventDefault(), { passive: false });
  addEventListener("keydown", (event) => leadsOut(event) && event.preventDefault());
  if (new URLSearchParams(location.search).has("keyboard"))
    Promise.all([import("./keyboard.js"), style("keyboard.css")]).then(([{ putKeyboard }]) =>
      putKeyboard(),
    );
  addEventListener("news", () => {
    if (!start.hidden) putEvening();
  });
  addEventListener("visitor", nextColor);
  touched();
}

/**
 * Returns true for a key that prints, saves, reloads, zooms or leaves the page, but not for one that
 * edits text. Keys that the browser reserves (a new window) are blocked by its own kiosk mode, see
 * docs/how-to/tablet.md.
 * @param {KeyboardEvent} event
 */
const leadsOut = ({ key, altKey, ctrlKey, metaKey }) =>
  /^F\d/.test(key) ||
  (altKey && /^(Arrow|Home)/.test(key)) ||
  ((ctrlKey || metaKey) && !/^([acvxyz]|Arrow.*|Home|End|Backspace|Delete)$/i.test(key));

/** Notes that somebody uses the page. The movement of a mouse without a pressed button does not count. @param {Event} [event] */
function touched(event) {
  if (event instanceof PointerEvent && event.type === "pointermove" && !event.buttons) return;
  idle = 0;
  // The question stays until its button is pressed, or something else is touched.
  if (!(event?.target instanceof Node && byId("still").contains(event.target)))
    byId("still").hidden = true;
}

setInterval(() => {
  if (!about?.kiosk || !start.hidden) return;
  idle += 1;
  if (isEmpty() && state.mode === "word" ? idle >= IDLE_S / 2 : idle >= IDLE_S) return over();
  const left = IDLE_S - idle;
  if (left <= SAID_S && !isEmpty()) putStill(left);
}, 1000);

/** Asks whether somebody is still there, before the page is reset. @param {number} left seconds */
function putStill(left) {
  const box = byId("still");
  if (box.hidden) {
    const here = make("button", { type: "button", className: "first" }, t("still-here"));
    here.onclick = () => touched();
    box.replaceChildren(make("p", { id: "still-text" }), here);
    box.hidden = false;
  }
  byId("still-text").textContent = t("still-there", { n: left });
}

/** Forgets the visitor, and shows the start screen. */
function over() {
  byId("still").hidden = true;
  history.replaceState(null, "", location.pathname + location.search);
  unzoom();
  forget();
  // The next visitor begins with the language of the tablet.
  /** @type {HTMLSelectElement} */ (byId("language")).value = home;
  speak(home).then(() => {
    change({ language: "" });
    showStart();
  });
}

/** Resets the zoom of the page, if the browser allows it. */
function unzoom() {
  const view = /** @type {HTMLMetaElement} */ (document.querySelector("meta[name=viewport]"));
  const { content } = view;
  view.content = `${content}, maximum-scale=1`;
  setTimeout(() => {
    view.content = content;
  }, 100);
}
/** Language of the tablet. */
let home = "en";

export async function showStart() {
  const words = make(
    "div",
    { className: "words" },
    make("h2", {}, t("start-title")),
    make("p", {}, ofMaker(about.brand.sentence) || t("start-sentence")),
    make("span", { className: "begin", "aria-hidden": "true" }, t("start-touch")),
  );
  const whole = make("button", {
    type: "button",
    className: "whole",
    "aria-label": t("start-touch"),
  });
  whole.onclick = leave;
  const tongues = make(
    "nav",
    { className: "tongues", "aria-label": t("language") },
    ...Object.entries(LANGUAGES).map(([code, name]) => {
      const button = make(
        "button",
        { type: "button", lang: code, "aria-pressed": `${code === document.documentElement.lang}` },
        name,
      );
      button.onclick = async () => {
        await speak(code);
        /** @type {HTMLSelectElement} */ (byId("language")).value = code;
        change({ language: code });
        showStart();
      };
      return button;
    }),
  );
  start.replaceChildren(
    make("div", { className: "show" }),
    words,
    whole,
    make("div", { className: "evening", role: "group", "aria-label": t("evening") }),
    tongues,
  );
  start.setAttribute("aria-label", t("start-title"));
  start.hidden = false;
  main.inert = true;
  await putEvening();
}

/** Colors with which visitors of a kiosk begin in turn, so that the wall is colorful. */
const TURN = ["orange", "green", "red", "white"];
let turn = 0;

/** Selects another color for the next visitor, if the scene's drone has a color lamp. */
function nextColor() {
  if (isEmpty() && about.deck !== "none") change({ color: TURN[turn++ % TURN.length] });
}

function leave() {
  stopLoop();
  nextColor();
  start.hidden = true;
  main.inert = false;
  touched();
  byId("word").focus({ preventScroll: true });
}

/** Shows photographs of this evening. The newest is large and written repeatedly, and the others are below it. */
async function putEvening() {
  const wall = /** @type {{ photos: { key: string, title: string | null }[] } | null} */ (
    await get("wall").catch(() => null)
  );
  const photos = wall?.photos ?? [];
  const show = start.querySelector(".show"),
    row = start.querySelector(".evening");
  if (!show || !row || start.hidden) return;
  const image = (/** @type {{ key: string, title: string | null }} */ { key, title }) =>
    make("img", { src: `wall/${key}.jpg`, alt: title ?? t("drawing") });
  row.replaceChildren(
    ...photos.slice(1, 7).map((photo) => make("div", { className: "frame" }, image(photo))),
  );
  if (!photos.length) {
    if (show.firstChild && !show.hasAttribute("data-key")) return;
    show.removeAttribute("data-key");
    show.replaceChildren(make("div", { className: "waiting" }));
    putSamples(show, about.deck, () => show.isConnected && !start.hidden && !show.hasAttribute("data-key"));
    return;
  }
  if (show.getAttribute("data-key") === photos[0].key) return;
  show.setAttribute("data-key", photos[0].key);
  const first = image(photos[0]),
    canvas = make("canvas", { "aria-hidden": "true" });
  show.replaceChildren(make("div", { className: "frame" }, first, canvas));
  canvas.hidden = true;
  const map = /** @type {LightMap | null} */ (
    await get(`wall/${photos[0].key}.json`).catch(() => null)
  );
  await first.decode().catch(() => {});
  if (map?.strokes.length && !start.hidden)
    loop(exposure(first, map, canvas), first, canvas, WRITTEN_MS, STANDS_MS);
}

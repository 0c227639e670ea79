// The wall: what was approved, one after the other large for a while, a new one before the others,
// and the code of the page. No button.

import { follow, get, onLost, sleep } from "./ask.js";
import { putBrand } from "./brand.js";
import { byId, make } from "./dom.js";
import { exposure } from "./exposure.js";
import { loop } from "./loop.js";
import { putSamples } from "./samples.js";
import { preferred, putWords, speakAll, t } from "./words.js";

/** A photograph is written once, and hangs large for a minute at least. */
const HANGS_MS = 60_000,
  WRITTEN_MS = 20_000;
const MOST = 7;

/** Time between two looks at a flight. */
const LIVE_MS = 250;

/** @typedef {WallPhoto} Hung */
const newest = byId("newest"),
  older = byId("older");
/** @type {Hung[]} */
let photos = [];
let since = 0,
  timer = 0;
/** The newest that has hung large. */
let latest = "";
/** The deck of the scene's drone. */
let deck = "";

/** What is known of a photograph: how long it shone only of the large one. @param {Hung} photo @param {boolean} large */
function caption({ title, flight_s, flying }, large) {
  const n = Math.round(flight_s);
  if (!large) return make("figcaption", {}, make("bdi", {}, flying ? t("flying-now") : title ?? t("drawing")));
  const light = make("small", {}, t(flying ? "flying-now" : "seconds-of-light", { n }));
  return make("figcaption", {}, make("bdi", {}, title ?? t("drawing")), light);
}

const image = (/** @type {Hung} */ { key, title }) =>
  make("img", {
    src: `wall/${key}.jpg`,
    alt: title === null ? t("alt-drawing") : t("alt", { title }),
  });

/** Hangs the photographs: another one large each minute, the newest first, those after it small. */
function hang() {
  clearTimeout(timer);
  if (!photos.length) putBare();
  byId("wall").classList.toggle("bare", !photos.length);
  const shown = photos.findIndex(({ key }) => key === newest.dataset.key);
  const wait = HANGS_MS - (Date.now() - since);
  if (photos.length > 1) timer = window.setTimeout(hang, Math.max(wait, 0) || HANGS_MS);
  let large = photos[shown];
  const live = photos.find((photo) => photo.live);
  // A flight is seen at once, and its photograph hangs for as long as another.
  const next = live ?? (large && ofFlight(large) !== newest.dataset.flight ? large : null);
  if (next && (next !== large || ofFlight(next) !== newest.dataset.flight)) {
    since = Date.now();
    put((large = next));
  } else if (!live && photos.length && (!large || wait <= 0)) {
    const other = photos[0].key === latest ? photos[(shown + 1) % photos.length] : photos[0];
    since = Date.now();
    latest = photos[0].key;
    if (other !== large) put(other);
    large = other;
  }
  newest.hidden = !large;
  if (!large) {
    newest.replaceChildren();
    newest.dataset.key = "";
  } else newest.querySelector("figcaption")?.replaceWith(caption(large, true));
  newest.classList.toggle("pair", !!large && !!ofFlight(large));
  const place = photos.indexOf(large);
  const rest = [...photos.slice(place + 1), ...photos.slice(0, Math.max(place, 0))].slice(0, MOST - 1);
  const known = new Map(
    [...older.children].map((figure) => [/** @type {HTMLElement} */ (figure).dataset.key, figure]),
  );
  older.replaceChildren(...rest.map((photo) => known.get(photo.key) ?? figure(photo)));
}

/** Nothing hangs yet: the lamp waits, and then writes what could. */
function putBare() {
  const bare = byId("bare");
  if (!bare.hidden && bare.firstChild) return;
  bare.hidden = false;
  const show = make("div", {});
  bare.replaceChildren(show);
  putSamples(show, deck, () => show.isConnected && !photos.length);
}

/** @param {Hung} photo */
function figure(photo) {
  const hung = make(
    "figure",
    {},
    make("div", { className: "frame" }, image(photo)),
    caption(photo, false),
  );
  hung.dataset.key = photo.key;
  return hung;
}

/** The photograph of the flight that is beside it: none, the light so far, or the name of its file. @param {Hung} photo */
const ofFlight = ({ live, flown }) => (live ? "live" : (flown?.name ?? ""));

/** Hangs what was promised beside what is flown. @param {Hung} photo */
async function putPair(photo) {
  const side = (/** @type {HTMLImageElement} */ image, /** @type {string} */ said) =>
    make("div", { className: "side" }, make("div", { className: "frame" }, image), make("small", {}, said));
  const flown = photo.live ? t("flying-now") : t("as-flown", { p: photo.flown?.readability ?? "" });
  let seen = image(photo);
  if (photo.flown && !photo.live) seen.src = `wall/${photo.key}/${photo.flown.name}.jpg`;
  else seen.classList.add("unexposed");
  newest.replaceChildren(
    side(image(photo), t("promised", { p: photo.readability ?? "" })),
    side(seen, flown),
    caption(photo, true),
  );
  byId("bare").hidden = true;
  for (let n = 0; photo.live && seen.isConnected; n += 1) {
    const later = make("img", { src: `wall/${photo.key}/live.jpg?${n}`, alt: seen.alt });
    // The light so far stays where a picture is lost on the way.
    if (await later.decode().then(() => true, () => false)) {
      seen.replaceWith(later);
      seen = later;
    }
    await sleep(LIVE_MS);
  }
}

/** Hangs a photograph large, and writes it once. @param {Hung} photo */
async function put(photo) {
  [newest.dataset.key, newest.dataset.flight] = [photo.key, ofFlight(photo)];
  if (ofFlight(photo)) return putPair(photo);
  const whole = image(photo),
    light = make("canvas", { "aria-hidden": "true" });
  light.hidden = true;
  newest.replaceChildren(make("div", { className: "frame" }, whole, light), caption(photo, true));
  const map = /** @type {LightMap | null} */ (await get(`wall/${photo.key}.json`).catch(() => null));
  await whole.decode().catch(() => {});
  byId("bare").hidden = photos.length > 0;
  if (map?.strokes.length && whole.isConnected)
    loop(exposure(whole, map, light), whole, light, WRITTEN_MS, Infinity);
}

async function begun() {
  const about = await get("about.json").catch(() => null);
  await speakAll(new URLSearchParams(location.search).get("language") ?? preferred(""));
  putWords(document);
  putBrand(about);
  deck = about?.deck ?? "";
  // Phones reach no machine that is in no network.
  const reached = about?.network === true;
  const code = () => make("div", { className: "code" }, make("img", { src: "qr.svg", alt: t("code-of-page") }));
  byId("invite").replaceChildren(
    ...(reached ? [code()] : []),
    make("p", {}, t("write-yours"), make("small", {}, t(reached ? "write-where" : "write-here"))),
  );
  onLost((lost) => {
    byId("lost").textContent = lost ? t(lost === "moved" ? "moved" : "lost") : "";
  });
  follow(async (_, restarted) => {
    // After a restart the page itself may be another one.
    if (restarted) return location.reload();
    const told = await get("wall").catch(() => null);
    if (told) {
      photos = told.photos;
      hang();
    }
  });
}
begun();

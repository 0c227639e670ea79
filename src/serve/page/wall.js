// The wall, which shows approved photographs one after another, a new one first, and the code of the
// page. It has no controls.

import { follow, get, onLost, sleep } from "./ask.js";
import { putBrand } from "./brand.js";
import { byId, make } from "./dom.js";
import { exposure } from "./exposure.js";
import { loop } from "./loop.js";
import { putSamples } from "./samples.js";
import { preferred, putWords, speakAll, t } from "./words.js";

/** Shortest time for which a photograph is large, and time in which it is written once. */
const HANGS_MS = 60_000,
  WRITTEN_MS = 20_000;
const MOST = 7;

/** Time between two pictures of a flight in progress. */
const LIVE_MS = 250;

/** @typedef {WallPhoto} Hung */
const newest = byId("newest"),
  older = byId("older");
/** @type {Hung[]} */
let photos = [];
let since = 0,
  timer = 0;
/** Key of the newest photograph that was large. */
let latest = "";
/** Light deck of the scene's drone. */
let deck = "";

/** Returns the caption of a photograph, with the duration of its light if it is large. @param {Hung} photo @param {boolean} large */
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

/** Shows the photographs: another one large each minute, the newest first, and the following ones small. */
function hang() {
  clearTimeout(timer);
  if (!photos.length) putBare();
  byId("wall").classList.toggle("bare", !photos.length);
  const shown = photos.findIndex(({ key }) => key === newest.dataset.key);
  const wait = HANGS_MS - (Date.now() - since);
  if (photos.length > 1) timer = window.setTimeout(hang, Math.max(wait, 0) || HANGS_MS);
  let large = photos[shown];
  const live = photos.find((photo) => photo.live);
  // A flight is shown immediately, and its photograph as long as any other.
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

/** Shows samples while there are no photographs. */
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

/** Returns which photograph of the flight is shown beside the preview: "" for none, "live" for the light so far, or the file's name. @param {Hung} photo */
const ofFlight = ({ live, flown }) => (live ? "live" : (flown?.name ?? ""));

/** Shows the preview beside the photograph of the flight. @param {Hung} photo */
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
    // If a picture cannot be loaded, the previous one stays.
    if (await later.decode().then(() => true, () => false)) {
      seen.replaceWith(later);
      seen = later;
    }
    await sleep(LIVE_MS);
  }
}

/** Shows a photograph large, and writes it once. @param {Hung} photo */
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
  // Without a network, no phone can open the page.
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
    // After a restart, the page may be of another version.
    if (restarted) return location.reload();
    const told = await get("wall").catch(() => null);
    if (told) {
      photos = told.photos;
      hang();
    }
  });
}
begun();

// The page of a visitor's entry, with the photograph, its replay, and the ways to keep it.

import { follow, get, onLost, Refused } from "./ask.js";
import { putBrand } from "./brand.js";
import { byId, make } from "./dom.js";
import { exposure } from "./exposure.js";
import { replay } from "./replay.js";
import { save } from "./save.js";
import { become } from "./state-of.js";
import { day, LANGUAGES, preferred, putWords, sentence, speakAll, t } from "./words.js";

const photo = /** @type {HTMLImageElement} */ (byId("photo")),
  light = /** @type {HTMLCanvasElement} */ (byId("light"));
/** @type {ForVisitor | null} */
let entry = null;
/** @type {LightMap | null} */
let map = null;
/** @type {((fraction: number) => void) | null} */
let show = null;
let maker = "Noctograph",
  logo = false,
  /** True if a phone can reach this page. */
  reached = false;

const strip = replay(byId("replay"), (share) => {
  light.hidden = share >= 1 || !map;
  photo.classList.toggle("unexposed", !light.hidden);
  if (light.hidden || !map) return;
  show ??= exposure(photo, map, light);
  show(share);
});

/** Returns the name of the photograph that is kept: that of the flight, if there is one. */
const shown = () => entry?.flown?.name ?? "photo";
const name = () => entry?.title ?? t("a-drawing");
const file = () => `${(entry?.title ?? "").replace(/[^\p{L}\p{N}]+/gu, "-") || "photograph"}.png`;
/** Name of the photograph that the page shows. */
let seen = "";

function put() {
  if (!entry) return;
  document.title = `${name()}: ${maker}`;
  byId("title").replaceChildren(make("bdi", {}, name()));
  photo.alt = entry.title === null ? t("alt-drawing") : t("alt", { title: entry.title });
  strip.words();
  become(entry, byId("state"), byId("clock"), strip);
  const { flown, readability } = entry;
  if (flown && readability !== null && flown.readability !== null)
    byId("state").append(` ${t("promised-flown", { p: readability, f: flown.readability })}`);
  const keep = keeping(t(flown ? "keep-flown" : "keep"), "first", shown());
  keep.id = "keep";
  const print = make("button", { type: "button", className: "second" }, t("print-card"));
  print.onclick = () => window.print();
  byId("acts").replaceChildren(
    keep,
    ...(flown ? [keeping(t("keep-promised"), "second", "photo")] : []),
    ...(navigator.canShare?.({ files: [new File([], "a.png", { type: "image/png" })] })
      ? [sharing()]
      : []),
    print,
  );
  putCard();
}

/** Returns a button that saves a photograph. @param {string} said @param {string} look @param {string} of */
function keeping(said, look, of) {
  const button = make("button", { type: "button", className: look }, said);
  button.onclick = () => save(`${of}.png`, file()).catch(() => {});
  return button;
}

function sharing() {
  const button = make("button", { type: "button", className: "second" }, t("share"));
  button.onclick = async () => {
    const blob = await (await fetch(`${shown()}.png`)).blob();
    // Canceling is not an error.
    await navigator
      .share({ files: [new File([blob], file(), { type: "image/png" })], title: name() })
      .catch(() => {});
  };
  return button;
}

/** Fills the card for printing, in A6 landscape format. */
function putCard() {
  if (!entry) return;
  byId("card").replaceChildren(
    make(
      "div",
      { className: "photo" },
      make("div", { className: "frame" }, make("img", { src: `${shown()}.jpg`, alt: "" })),
    ),
    make(
      "div",
      { className: "foot" },
      make(
        "div",
        {},
        make("h2", {}, make("bdi", {}, name())),
        make("p", {}, t("card", { n: Math.round(entry.flight_s) })),
        make("p", {}, day(entry.made)),
      ),
      make(
        "div",
        { className: "maker" },
        logo ? make("img", { src: "brand/logo.svg", alt: maker }) : maker,
        ...(reached ? [make("span", {}, t("card-scan"))] : []),
      ),
      ...(reached ? [make("img", { src: "qr.svg", alt: "" })] : []),
    ),
  );
}

async function load() {
  try {
    entry = await get("entry.json");
    put();
    if (seen !== shown()) await putPhoto();
  } catch (error) {
    if (error instanceof Refused) gone(error.said);
  }
}

/** Shows the photograph and its replay. */
async function putPhoto() {
  if (!entry) return;
  [seen, show, map] = [shown(), null, null];
  photo.src = `${seen}.jpg`;
  const [told] = await Promise.all([
    get(entry.flown ? `${seen}.json` : "replay.json").catch(() => null),
    photo.decode().catch(() => {}),
  ]);
  byId("frame").style.setProperty("--shape", `${photo.naturalWidth / photo.naturalHeight || 1.78}`);
  byId("frame").hidden = false;
  map = told;
  if (!map?.strokes.length || !entry) return;
  byId("replay").classList.remove("idle");
  strip.load(map, entry.flown ? map.seconds : entry.flight_s);
  if (entry.state !== "flying") strip.run();
  put();
}

/** @param {Said} said */
function gone(said) {
  entry = null;
  byId("frame").hidden = true;
  byId("gone").hidden = false;
  byId("replay").classList.add("idle");
  byId("acts").replaceChildren();
  byId("title").textContent = t("entry-gone");
  byId("state").textContent = said.key === "gone" ? t("entry-gone-why") : sentence("errors", said);
}

async function begun() {
  const about = /** @type {About | null} */ (await get("about.json").catch(() => null));
  maker = putBrand(about);
  logo = about?.brand.logo ?? false;
  reached = about?.network ?? false;
  await speakAll(preferred(""));
  putWords(document);
  const language = /** @type {HTMLSelectElement} */ (byId("language"));
  for (const [code, own] of Object.entries(LANGUAGES)) language.add(new Option(own, code));
  language.value = document.documentElement.lang;
  language.onchange = async () => {
    await speakAll(language.value);
    if (entry) put();
    else load();
  };
  onLost((lost) => {
    byId("lost").textContent = lost === true ? t("lost") : "";
  });
  await load();
  document.body.dataset.ready = "true";
  follow(load);
}
begun();

// The visitor's page: a word or a drawing becomes a photograph, which the visitor can send.

import { ask, begin, current, follow, get, onLost, post, Refused, sleep } from "./ask.js";
import { byId, draw, putIcons, style } from "./dom.js";
import { putLights, screen } from "./lights.js";
import { replay } from "./replay.js";
import { putBrand } from "./brand.js";
import { emptySketch, seen, shape } from "./sketch.js";
import * as stage from "./stage.js";
import { change, forget, origin, state, watch } from "./state.js";
import { obstacle, ofError, ofLength, ofShot, say } from "./verdict.js";
import { about, FILL, isDrawing, isEmpty, isLog, learn, title, wish } from "./wish.js";
import { LANGUAGES, ofMaker, preferred, putWords, sentence, speak, speakAll, t } from "./words.js";

/** Pauses in typing before a sharper photograph is shown, or judged. */
const REST_MS = 900,
  JUDGED_MS = 250;
/**
 * Least readability, and largest probability of a rival, with which a word that is legible in a small
 * photograph is also legible in a large one. Two of 167 words were legible only when small: 0.72 and 0.84,
 * with rivals of 0.05 and 0.49.
 */
const SURE = 0.88,
  SURE_RIVAL = 0.35;
/** Width in device pixels above which the photograph of a keystroke is too coarse. */
const SHARP_PX = 1100;
/** Flight time of a Crazyflie with a full battery. */
const BATTERY_S = 240;

const main = /** @type {HTMLElement} */ (document.querySelector("main"));
const area = /** @type {HTMLElement} */ (document.querySelector(".stage"));
const word = /** @type {HTMLInputElement} */ (byId("word"));
const language = /** @type {HTMLSelectElement} */ (byId("language"));
const verdict = byId("verdict");
const strip = replay(byId("replay"), stage.expose);

/**
 * What is known about the newest request.
 * @typedef {object} Known
 * @property {Shot | null} shot
 * @property {Large | null} large
 * @property {boolean} alone whether there is no large one, so that the small one is judged
 * @property {Said | null} error why there is no photograph
 * @property {Said | null} refused why it was not sent
 * @property {Said[]} stops checks that stop the flight, as far as they are known
 * @property {DrawnSource | null} source strokes of the opened file
 * @property {string} of parts of the request on which `source` depends
 * @property {boolean} busy whether the server has too many requests
 * @property {boolean} linked whether its link was shared or copied
 * @property {number} cut number of letters removed from a word that was too long
 */
/** @type {Known} */
const known = {
  shot: null,
  large: null,
  alone: false,
  error: null,
  refused: null,
  stops: [],
  source: null,
  of: "",
  busy: false,
  linked: false,
  cut: 0,
};
let asked = "",
  filled = 0,
  resting = 0,
  sending = false;

/* ---------- Photographs ---------- */

/** Returns the aspect (width / height) of the stage, or the earlier one while strokes are selected. */
function aspect() {
  if (state.aspect) return state.aspect;
  if (isDrawing()) return rounded(shape(state.sketch));
  if (!(isChoosing() && filled))
    filled = rounded(area.clientWidth / Math.max(1, area.clientHeight));
  return filled;
}
// Aspects are rounded, so that similar tablets share photographs.
const rounded = (/** @type {number} */ value) =>
  Math.min(2.5, Math.max(0.4, Math.round(20 * value) / 20));

/** Aspect of the photograph that is requested now. */
let shapeNow = 1;

/** Requests the photograph of the current word or drawing, if it differs from the last request. */
async function wanted() {
  shapeNow = aspect();
  const wishes = isEmpty() ? null : wish(shapeNow);
  const text = JSON.stringify(wishes);
  if (text === asked) return;
  asked = text;
  clearTimeout(resting);
  const mine = begin(),
    wasWrong = known.error !== null;
  Object.assign(known, { shot: null, large: null, alone: false, error: null, refused: null, stops: [], busy: false });
  known.linked = false;
  if (wasWrong) drawer?.putShot(known);
  const { opened } = state;
  const of = opened ? JSON.stringify([opened.text, opened.corners]) : "";
  if (of !== known.of) Object.assign(known, { of, source: null });
  if (!wishes) return nothing();
  stage.dim(true);
  putDesk();
  const strokes = isDrawing() ? seen(state.sketch) : [];
  const shot = await ask("live", wishes, (busy) => {
    known.busy = busy;
    putDesk();
  });
  if (!shot || mine !== current()) return;
  known.source = shot.source ?? shot.error?.values.source ?? known.source;
  // A picture is flown in its own colors.
  const inks = known.source?.strokes ?? [];
  const colored = inks.some(({ color }) => !["black", "gray", "white"].includes(color ?? "black"));
  if (state.opened && !state.opened.colored !== !colored)
    return change({ opened: { ...state.opened, colored } });
  if (shot.error) {
    const { leaveOut, ofLog } = await loadAmiss();
    if (mine !== current() || leaveOut(shot.error)) return;
    return failed(ofLog(shot.error, state.opened?.text === seenLog));
  }
  if (isLog()) seenLog = state.opened?.text;
  await shown(shot, strokes, () => mine === current());
  if (mine !== current()) return;
  putReason();
  const sharp = area.clientWidth * devicePixelRatio > SHARP_PX;
  const isHome = !about.kiosk && about.home;
  if (isUnjudged()) resting = window.setTimeout(() => enlarge(isHome), JUDGED_MS);
  // A server makes small photographs unless a large one is requested.
  else if ((sharp && !about.slow) || isHome) resting = window.setTimeout(() => enlarge(isHome), REST_MS);
}

/** The log that was photographed, after which any fault is in the word. @type {string | undefined} */
let seenLog;
/** Module that is loaded when it is first needed. @type {typeof import("./amiss.js") | null} */
let amiss = null;
const loadAmiss = async () => (amiss ??= (await Promise.all([import("./amiss.js"), speakAll().catch(() => {})]))[0]);
/** True if the module cannot be loaded. */
let lacksAmiss = false;

/** Loads the reasons for an illegible word, and shows them. */
async function putReason() {
  if (amiss || judged()?.legible !== false) return;
  await loadAmiss().catch(() => (lacksAmiss = true));
  putMarks();
  putDesk();
}

/**
 * Returns the verdict on the kept photograph, or null until it is known. That on a small photograph counts
 * only if the word is certainly legible in the large one, too.
 * @returns {Judged | null}
 */
function judged() {
  const small = known.shot?.verdict;
  if (!small || known.alone) return small ?? null;
  if (known.large?.letters) return /** @type {Judged} */ (/** @type {unknown} */ (known.large));
  const isSure = small.readability >= SURE && (small.rival?.p ?? 0) <= SURE_RIVAL;
  return small.legible && isSure ? small : null;
}
/** Returns false while the reasons for an illegible word are being loaded. */
const isReasoned = () => judged()?.legible !== false || amiss !== null || lacksAmiss;
const isUnjudged = () => Boolean(known.shot?.verdict) && !judged();

/** @param {Shot} shot @param {Stroke[]} strokes @param {() => boolean} wanted */
async function shown(shot, strokes, wanted) {
  const hung = await stage
    .hang(shot.photo, alt(), shot.replay, shot.width / shot.height, wanted)
    .catch(() => false);
  if (!hung) return;
  known.shot = shot;
  stage.dim(false);
  strip.load(shot.replay, shot.flight_s);
  pad?.putLit(strokes);
  putMarks();
  putDesk();
  main.dataset.shown = `${shot.number}`;
  // The replay of a flight in progress continues at its current time.
  if (state.mode === "sent") dispatchEvent(new Event("news"));
}

/** The request for the large photograph. @type {{ of: unknown, answer: Promise<any> }} */
let enlarging = { of: null, answer: Promise.resolve() };

/** Requests the large photograph once, because a second request would abort the first. */
function enlarge(/** @type {boolean} */ advice) {
  const of = current();
  if (enlarging.of !== of)
    enlarging = {
      of,
      answer: enlarged(advice).finally(() => {
        if (enlarging.of === of) enlarging.of = null;
      }),
    };
  return enlarging.answer;
}

/** @param {boolean} advice */
async function enlarged(advice) {
  const mine = current();
  const wished = wish(shapeNow);
  const large = await ask("photos", { ...wished, advice });
  if (large?.error && mine === current()) {
    known.alone = true;
    putDesk();
  }
  if (!large || large.error) return large;
  if (large.stops.length) await speakAll();
  if (mine !== current() || !known.shot) return null;
  known.stops = large.stops;
  known.large = Object.assign(large, { files: {}, wish: { ...wished, visitor: state.visitor } });
  putMarks();
  putDesk();
  putReason();
  if (drawer) drawer.putShot(known);
  const still = () => known.large === large;
  if (
    await stage
      .hang(
        large.photo,
        alt(),
        large.replay,
        known.shot.width / known.shot.height,
        still,
      )
      .catch(() => false)
  ) {
    strip.load(large.replay, large.flight_s, true);
    main.dataset.large = `${large.number}`;
  }
  return large;
}

const alt = () => (state.word.trim() ? t("alt", { title: state.word.trim() }) : t("alt-drawing"));

function nothing() {
  stage.clear();
  strip.stop();
  pad?.putLit([]);
  putDesk();
}

/** Shows an error in place of a photograph. @param {Said} error */
async function failed(error) {
  const mine = current();
  // Without the page's texts, the program's English text is shown.
  await speakAll().catch(() => {});
  if (mine !== current()) return;
  known.error = error;
  stage.clear();
  stage.dim(false);
  pad?.putLit([]);
  putDesk();
  drawer?.putShot(known);
}

function putMarks() {
  const verdict = judged();
  stage.mark(
    title() !== null && state.mode !== "sent" ? known.shot?.boxes : [],
    verdict?.letters ?? [],
    amiss && verdict?.legible === false && verdict.letters.every(({ best, expected }) => best === expected) ? amiss.pair(verdict) : null,
  );
}

/* ---------- The desk ---------- */

/** Returns the state that the page shows. */
function seenState() {
  if (state.mode !== "word") return state.mode;
  if (isChoosing()) return "choosing";
  return isEmpty() || known.error ? "empty" : "word";
}

const isChoosing = () => state.mode === "word" && state.opened?.choosing === true;

/** Returns the reason why the photograph cannot be sent, or "". */
function hindrance() {
  if (!known.shot || known.error) return "nothing";
  if (isUnjudged() && !about.alone) return "unjudged";
  if (about.alone) return state.opened ? "nothing" : "";
  return obstacle(known.shot) || known.stops.length ? "unsafe" : "";
}

function putDesk() {
  main.dataset.state = seenState();
  main.dataset.judged = `${!isUnjudged() && isReasoned()}`;
  for (const part of /** @type {NodeListOf<HTMLElement>} */ (
    document.querySelectorAll("[data-in]")
  )) {
    part.hidden = !part.dataset.in?.split(" ").includes(seenState());
  }
  if (word.value.trim() !== state.word.trim()) word.value = state.word;
  putPlan();
  byId("replay").classList.toggle("idle", !known.shot);
  const unread = judged()?.legible === false;
  for (const id of ["send", "send-drawing"]) {
    byId(id).setAttribute("aria-disabled", `${hindrance() !== "" || sending}`);
    byId(id).textContent = t(
      about.alone ? "share" : sending ? "sending" : unread && id === "send" ? "send-anyway" : "send",
    );
  }
  say(verdict, spoken());
  say(byId("left"), spokenOnPad());
  byId("opened").hidden = !state.opened;
  byId("opened-name").textContent = state.opened?.name ?? "";
  byId("lights").hidden = state.opened !== null;
  // A link cannot contain a file.
  byId("send").hidden = about.alone === true && state.opened !== null;
  byId("field").hidden = state.opened !== null && !isLog();
  word.placeholder = t(isLog() ? "place-log" : "place");
  byId("choose").hidden =
    !state.opened || isLog() || (known.error !== null && !known.source && !isChoosing());
  byId("choose").setAttribute("aria-pressed", `${isChoosing()}`);
  if (isChoosing()) picture?.putPicture(known.source);
}

/** Shows a lamp that traces the letters until the first photograph. */
function putPlan() {
  const plan = byId("plan"),
    said = word.value.trim();
  plan.style.cssText = `--n: ${said.length}; --c: ${screen(state.color)}`;
  if (plan.dataset.of === said) return;
  plan.dataset.of = said;
  const lines = ["", "lit", "lamp"].map((name) => {
    const line = draw("text", { x: "50%", y: "50%", class: name });
    line.append(
      ...[...said].map((letter, i) => {
        const traced = draw("tspan");
        traced.style.setProperty("--i", `${i}`);
        traced.textContent = letter;
        return traced;
      }),
    );
    return line;
  });
  const svg = draw("svg");
  svg.append(...(said ? lines : []));
  plan.replaceChildren(svg);
}

/** @returns {import("./verdict.js").Spoken} */
function spoken() {
  if (known.cut) return { first: t("cut", { n: about.limits.letters }) };
  if (known.linked) return { first: t("linked") };
  const wrong = known.error ?? known.refused;
  if (wrong) return ofError(wrong);
  if (isEmpty()) return { first: t(state.opened ? "all-out" : "empty") };
  const stop = known.stops[0];
  if (known.shot) {
    const said = stop
      ? { first: sentence("stops", stop), then: t("way-flight-impossible") }
      : ofShot(known.shot, isReasoned() ? judged() : null, amiss?.reason);
    return origin.left ? { first: said.first, then: t(origin.left) } : said;
  }
  return { first: t(known.busy ? "busy" : about.slow ? "looking-slow" : "looking") };
}

/** @returns {import("./verdict.js").Spoken} */
function spokenOnPad() {
  const { shot } = known;
  if (isEmpty()) return { first: t("pad-empty") };
  if (!shot || known.refused || known.error || obstacle(shot) || known.stops.length)
    return spoken();
  return ofLength(shot.flight_s, BATTERY_S);
}

/* ---------- Sending ---------- */

/**
 * Repeats an action until it succeeds or is refused for good.
 * @template T
 * @param {() => Promise<T>} work
 * @returns {Promise<T>}
 */
async function insist(work) {
  for (let tries = 0; ; tries += 1) {
    try {
      return await work();
    } catch (error) {
      const waits = error instanceof Refused && ["busy", "entries-many"].includes(error.said.key);
      if (error instanceof Refused && !waits) throw error;
      await sleep(Math.min(5000, 500 * 2 ** tries));
    }
  }
}

async function send() {
  // A visitor may send a photograph before its verdict is known.
  if (!["", "unjudged"].includes(hindrance()) || sending) return;
  if (about.alone) return share();
  sending = true;
  clearTimeout(resting);
  putDesk();
  try {
    const { number } = current();
    const photo = JSON.stringify({ ...wish(shapeNow), visitor: state.visitor, number });
    const language = document.documentElement.lang;
    const entry = await insist(() => post("entries", { visitor: state.visitor, photo, language }));
    change({
      mode: "sent",
      sent: {
        id: entry.id,
        number: entry.number,
        title: title(),
      },
    });
    strip.run();
    byId("sent").focus({ preventScroll: true });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    await speakAll().catch(() => {});
    if (error.said.values?.stops) known.stops = error.said.values.stops;
    else known.refused = error.said;
  } finally {
    sending = false;
    putDesk();
  }
}

/** Puts the photograph's link into the address, and shares or copies it. */
async function share() {
  const { putLink } = await import("./link.js");
  const url = putLink(shapeNow);
  const given = navigator.share?.({ url }) ?? navigator.clipboard?.writeText(url);
  await given?.catch(() => {});
  known.linked = true;
  putDesk();
}

/** Begins another photograph. A kiosk forgets the last visitor. */
function another() {
  history.replaceState(null, "", location.pathname + location.search);
  if (about.kiosk) {
    forget(state.language);
    return dispatchEvent(new Event("visitor"));
  }
  change({
    mode: "word",
    word: "",
    sketch: emptySketch(),
    opened: null,
    painted: [],
    color: "white",
    sent: null,
  });
  pad?.setTool("draw");
  word.focus({ preventScroll: true });
}

/* ---------- Controls ---------- */

word.oninput = () => {
  if (!about) return putPlan();
  const most = about.limits.letters,
    typed = [...word.value];
  known.cut = Math.max(0, typed.length - most);
  if (known.cut) word.value = typed.slice(0, most).join("");
  change({
    word: word.value,
    opened: isLog() ? state.opened : null,
    sketch: emptySketch(),
    painted: state.painted.slice(0, typed.length),
  });
};
byId("desk").onsubmit = (event) => {
  event.preventDefault();
  word.blur();
};
byId("send").onclick = send;
byId("send-drawing").onclick = send;
byId("draw").onclick = () => {
  history.pushState("pad", "", "#pad");
  draws();
};
byId("type").onclick = () => {
  if (history.state === "pad") history.back();
  else types();
};
addEventListener("popstate", () => {
  if (location.hash === "#pad") draws();
  else if (state.mode === "pad") types();
});

async function draws() {
  await loadPad();
  change({ mode: "pad", word: "", painted: [], opened: null });
  openPad();
  byId("pad").focus({ preventScroll: true });
}

/** The pad, which is loaded when it is first opened. @type {typeof import("./pad.js") | null} */
let pad = null;

async function loadPad() {
  [pad] = await Promise.all([import("./pad.js"), style("pad.css"), speakAll()]);
}

function openPad() {
  pad?.openPad();
  if (known.shot && isDrawing()) pad?.putLit(seen(state.sketch));
}

function types() {
  change({ mode: "word" });
  pad?.setTool("draw");
  word.focus({ preventScroll: true });
}

byId("opened-close").onclick = () => {
  change({ opened: null });
  word.focus();
};

/** The strokes of a file, which are loaded when first needed. @type {typeof import("./picture.js") | null} */
let picture = null;

async function openPicture() {
  [picture] = await Promise.all([import("./picture.js"), style("picture.css"), speakAll()]);
  putDesk();
}
byId("choose").onclick = () => {
  if (state.opened) change({ opened: { ...state.opened, choosing: !isChoosing() } });
  openPicture();
};

language.onchange = async () => {
  await speak(language.value);
  change({ language: language.value });
};

/* ---------- The drawer, which a kiosk lacks ---------- */

/** @type {typeof import("./drawer.js") | null} */
let drawer = null;
byId("more").onclick = async () => {
  const [loaded] = await Promise.all([import("./drawer.js"), style("drawer.css"), speakAll()]);
  drawer = loaded;
  drawer.openDrawer(known);
};

async function openFile(/** @type {File | undefined} */ file) {
  if (!file || about.kiosk) return;
  const { MOST_LOG, opened } = await import("./files.js");
  const found = await opened(file);
  history.replaceState(null, "", ".");
  // The word in the field is the one that was flown in a log.
  const kept = found?.kind === "log" ? state.word : "";
  if (found) change({ mode: "word", word: kept, sketch: emptySketch(), painted: [], opened: found });
  else {
    change({ mode: "word", word: "", sketch: emptySketch(), opened: null });
    begin();
    asked = "null";
    const key = about.alone && file.size > MOST_LOG ? "too-large" : "no-picture";
    failed({ key, values: { name: file.name }, text: "" });
  }
}
addEventListener("open-file", (event) => openFile(/** @type {CustomEvent} */ (event).detail));
addEventListener("dragover", (event) => {
  event.preventDefault();
  main.classList.toggle("dropping", !about.kiosk);
});
addEventListener("dragleave", () => main.classList.remove("dropping"));
addEventListener("drop", (event) => {
  event.preventDefault();
  main.classList.remove("dropping");
  openFile(event.dataTransfer?.files[0]);
});

/* ---------- Changes of the state ---------- */

/** Changes that end the message about settings that were left out. */
const WISHED = ["word", "sketch", "opened", "settings", "lamp", "room", "body"];

watch((changed) => {
  if (WISHED.some((part) => changed.has(part))) origin.left = "";
  if (changed.has("visitor")) {
    known.cut = 0;
    pad?.setTool("draw");
  }
  if (changed.has("language") || changed.has("mode") || changed.has("sent")) putSaid();
  if (changed.has("color") || changed.has("lamp") || changed.has("language")) {
    for (const box of document.querySelectorAll(".lights"))
      putLights(box, box.getAttribute("data-of") ?? "");
  }
  if (changed.has("sketch") || changed.has("mode")) pad?.putSketch();
  if (changed.has("word") && !changed.has("language"))
    known.cut &&= word.value.length >= about.limits.letters ? known.cut : 0;
  if (known.shot && (changed.has("painted") || changed.has("mode") || changed.has("language")))
    putMarks();
  putDesk();
  wanted();
});

/** Shows the texts that do not depend on the photograph. */
function putSaid() {
  putBrand(about);
  byId("consent").textContent =
    ofMaker(about.brand.consent) || t(about.wall === "open" ? "consent-open" : "consent");
  strip.words();
  pad?.putSketch();
  if (state.sent && state.mode === "sent")
    Promise.all([import("./sent.js"), speakAll()]).then(([{ showSent }]) => showSent(byId("sent"), another, strip));
}

onLost((lost) => {
  byId("lost").textContent = lost === "moved" ? t("moved") : lost ? t("lost") : "";
});

let resizing = 0,
  screenSize = "";
new ResizeObserver(() => {
  // A longer sentence needs no other photograph.
  const now = `${innerWidth} ${innerHeight}`;
  if (now === screenSize) return;
  screenSize = now;
  clearTimeout(resizing);
  resizing = window.setTimeout(() => {
    if (about && !isDrawing() && state.mode !== "pad") wanted();
  }, 300);
}).observe(area);
// The photograph does not overlap the desk.
new ResizeObserver(() => area.style.setProperty("--desk", `${byId("desk").offsetHeight}px`)).observe(
  byId("desk"),
);

async function begun() {
  const [told] = await Promise.all([
    insist(() => get("about.json")),
    insist(() => speak(preferred(state.language)).catch(() => speak("en"))),
  ]);
  learn(told);
  if (about.base !== undefined) {
    const { makeHere } = await import("./here.js");
    makeHere(about.base, (route, init) => {
      about.slow ||= ["live", "photos"].includes(route);
      putDesk();
      return fetch(route, init);
    });
  }
  if (state.number < 1) state.number = Math.floor(Date.now() / 100) % 1e9;
  for (const [code, name] of Object.entries(LANGUAGES)) language.add(new Option(name, code));
  const spokenNow = document.documentElement.lang;
  if (!(spokenNow in LANGUAGES))
    language.add(
      new Option(new Intl.DisplayNames(spokenNow, { type: "language" }).of(spokenNow), spokenNow),
    );
  language.value = spokenNow;
  document.documentElement.classList.toggle("kiosk", about.kiosk);
  area.style.setProperty("--fill", `${FILL}`);
  byId("more").hidden = about.kiosk;
  putIcons();
  putWords(document);
  if (state.mode === "pad" && location.hash !== "#pad") history.replaceState("pad", "", "#pad");
  else if (location.hash === "#pad") state.mode = "pad";
  if (state.mode === "pad") await loadPad().then(openPad);
  if (isChoosing()) await openPicture();
  // A word may have been typed already.
  if (!state.word && state.mode === "word" && !state.opened) state.word = word.value;
  change({ language: state.language, color: state.color, mode: state.mode });
  if (about.kiosk)
    await Promise.all([import("./start.js"), style("start.css")]).then(([{ startKiosk }]) =>
      startKiosk(),
    );
  else if (state.mode === "word") word.focus({ preventScroll: true });
  document.body.dataset.ready = "true";
  if (about.alone) return;
  follow((_, restarted) => {
    if (restarted) {
      asked = "";
      wanted();
    }
    dispatchEvent(new Event("news"));
  });
}
begun();

// The operator's page, with the list of entries in the order of flight, a large photograph, and its actions.

import { follow, get, onLost, post, Refused } from "./ask.js";
import { putBrand } from "./brand.js";
import { byId, make } from "./dom.js";
import { exposure } from "./exposure.js";
import { replay } from "./replay.js";
import { refusal, save } from "./save.js";
import { number, preferred, putWords, sentence, speakAll, t } from "./words.js";

/** Tabs, each with the states of its entries. @type {[string, State[]][]} */
const TABS = [
  ["waiting", ["waiting"]],
  ["approved", ["approved", "flying"]],
  ["flown", ["flown"]],
  ["not-shown", ["rejected"]],
];

/** @type {Queue} */
let queue = { revision: -1, paused: false, flying: null, entries: [], notes: [] };
let tab = "waiting",
  chosen = "",
  /** Key of the sentence about what the wall shows. */
  rule = "wall-approved";
/** Actions that can be undone. @type {{ id: string, was: State, now: State }[]} */
const answered = [];
/** Take-off time of the entry in the air, in ms, as far as this page knows, or 0. */
let tookOff = 0;
/** Entry on which this page is acting, whose change is expected. */
let own = "";
/** Time in ms until which keys and buttons are ignored, because another operator changed the entry. */
let held = 0;
const HELD_MS = 700;

const photo = make("img", { alt: "" }),
  light = make("canvas", { "aria-hidden": "true" });
const frame = make("div", { className: "frame" }, photo, light),
  bar = make("div", { className: "replay", dir: "ltr" });
/** @type {((fraction: number) => void) | null} */
let show = null;
/** @type {LightMap | null} */
let map = null;
const strip = replay(bar, (share) => {
  light.hidden = share >= 1 || !map;
  photo.classList.toggle("unexposed", !light.hidden);
  if (light.hidden || !map) return;
  show ??= exposure(photo, map, light);
  show(share);
});

const inTab = (/** @type {string} */ name) =>
  queue.entries.filter(({ state }) => TABS.find(([known]) => known === name)?.[1].includes(state));
const current = () => queue.entries.find(({ id }) => id === chosen);
const title = (/** @type {ForOperator} */ entry) => entry.title ?? t("a-drawing");

/** Ignores keys and buttons for a moment after an unexpected change, because they were meant for the previous entry. */
function hold() {
  held = Date.now() + HELD_MS;
  byId("entry").classList.add("held");
  setTimeout(() => byId("entry").classList.toggle("held", Date.now() < held), HELD_MS);
}

/** Shows another entry in place of one that another operator acted on, or that its visitor withdrew. */
function choose(/** @type {string} */ id) {
  const gone = current();
  if (chosen && chosen !== own) hold();
  if (gone && chosen !== own) toast(t("answered", { title: title(gone) }));
  chosen = id;
}

/* ---------- Display ---------- */

function put() {
  const list = inTab(tab);
  if (!list.some(({ id }) => id === chosen)) choose(list[0]?.id ?? "");
  putHeader();
  putList(list);
  putEntry();
  putAir();
  byId("flights").replaceChildren(
    ...queue.notes.map(({ key, name, why }) => make("p", {}, t(key, { name, why }))),
  );
}

function putHeader() {
  const had = byId("tabs").contains(document.activeElement);
  byId("tabs").replaceChildren(
    ...TABS.map(([name]) => {
      const button = make(
        "button",
        { type: "button", ...(name === tab && { "aria-current": "page" }) },
        `${t(`tab-${name}`)} `,
        make("b", {}, number(inTab(name).length)),
      );
      button.onclick = () => {
        tab = name;
        chosen = "";
        put();
      };
      return button;
    }),
  );
  if (had)
    /** @type {HTMLElement | null} */ (byId("tabs").querySelector("[aria-current]"))?.focus();
  const ready = inTab("approved").length;
  byId("pause").textContent = t(queue.paused ? "resume" : "pause-sending");
  byId("pause").setAttribute("aria-pressed", `${queue.paused}`);
  byId("export").textContent = t("export", { n: ready });
  byId("export").setAttribute("aria-disabled", `${!ready}`);
}

/** @param {ForOperator[]} list */
function putList(list) {
  const box = byId("list"),
    had = box.contains(document.activeElement);
  box.setAttribute("aria-label", t(`tab-${tab}`));
  box.replaceChildren(
    ...list.map((entry) => {
      const wrong = note(entry);
      const button = make(
        "button",
        { type: "button", ...(entry.id === chosen && { "aria-current": "true" }) },
        make(
          "span",
          { className: "frame" },
          make("img", { src: `entries/${entry.id}/photo.jpg`, alt: "", loading: "lazy" }),
        ),
        make(
          "span",
          {},
          make("strong", {}, make("bdi", {}, title(entry))),
          make("small", {}, t("seconds", { n: Math.round(entry.flight_s) })),
          ...(wrong ? [make("small", { className: "note" }, wrong)] : []),
        ),
        make(
          "time",
          { dateTime: entry.made },
          new Intl.DateTimeFormat(document.documentElement.lang, { timeStyle: "short" }).format(
            new Date(entry.made),
          ),
        ),
      );
      button.onclick = () => {
        chosen = entry.id;
        put();
      };
      return make("li", {}, button);
    }),
  );
  if (!list.length) box.append(make("li", { className: "none" }, t("queue-empty")));
  box.append(make("li", { className: "rule" }, t(rule)));
  if (had) /** @type {HTMLElement | null} */ (box.querySelector("[aria-current]"))?.focus();
}

/** Returns a sentence about what the operator should check, or "". @param {ForOperator} entry */
function note(entry) {
  if (entry.stops.length) return sentence("stops", entry.stops[0]);
  if (entry.obstacles.length) return sentence("obstacles", entry.obstacles[0]);
  const wrong = entry.letters?.find(({ expected, best }) => best !== expected);
  if (wrong) return t("letter-looks", { letter: wrong.expected, best: wrong.best ?? "–" });
  return entry.legible === false ? t("not-sure") : "";
}

let drawn = "";
function putEntry() {
  const entry = current(),
    box = byId("entry");
  if (!entry) {
    drawn = "";
    const hint = tab === "waiting" ? t("queue-nothing") : "";
    return box.replaceChildren(make("p", { className: "none" }, hint));
  }
  box.setAttribute("aria-label", title(entry));
  const facts = /** @type {[string, string][]} */ ([
    ["fact-written", title(entry)],
    ["fact-read", entry.read ?? "–"],
    [
      "fact-flight",
      [
        t("seconds", { n: Math.round(entry.flight_s) }),
        ...(entry.drones > 1 ? [t("n-drones", { n: entry.drones })] : []),
      ].join(", "),
    ],
    [
      "fact-safety",
      [
        ...entry.stops.map((said) => sentence("stops", said)),
        ...entry.obstacles.map((said) => sentence("obstacles", said)),
      ].join(" ") || t("safe"),
    ],
    ...(entry.flown
      ? [["fact-flown", t("promised-flown", { p: entry.readability ?? "–", f: entry.flown.readability ?? "–" })]]
      : []),
  ]);
  const list = make(
    "dl",
    { className: "facts" },
    ...facts.map(([name, text]) =>
      make("div", {}, make("dt", {}, t(name)), make("dd", {}, make("bdi", {}, text))),
    ),
  );
  const acts = make("div", { className: "acts" }, ...actions(entry));
  const was = box.dataset.state;
  box.dataset.state = entry.state;
  if (drawn === entry.id && box.querySelector(".facts")) {
    if (was !== entry.state) hold();
    const had = box.querySelector(".acts")?.contains(document.activeElement);
    box.querySelector(".facts")?.replaceWith(list);
    box.querySelector(".acts")?.replaceWith(acts);
    if (had) acts.querySelector("button")?.focus();
    return;
  }
  drawn = entry.id;
  box.replaceChildren(make("div", { className: "photo" }, frame), bar, list, acts);
  putPhoto(entry);
}

/** @param {ForOperator} entry */
async function putPhoto(entry) {
  [show, map] = [null, null];
  photo.src = `entries/${entry.id}/photo.jpg`;
  photo.alt = entry.title === null ? t("alt-drawing") : t("alt", { title: entry.title });
  const told = /** @type {LightMap | null} */ (
    await get(`entries/${entry.id}/replay.json`).catch(() => null)
  );
  await photo.decode().catch(() => {});
  frame.style.setProperty("--shape", `${photo.naturalWidth / photo.naturalHeight || 1.78}`);
  if (drawn !== entry.id || !told?.strokes.length) return bar.classList.add("idle");
  bar.classList.remove("idle");
  map = told;
  strip.load(told, entry.flight_s);
}

/** @param {string} word @param {string} key @param {string} look @param {() => void} act */
function action(word, key, look, act) {
  const button = make(
    "button",
    { type: "button", className: look },
    `${t(word)} `,
    make("kbd", {}, key),
  );
  button.dataset.do = word;
  button.onclick = act;
  return button;
}

/** Returns a button that moves the entry in the order of flight. @param {string} word @param {string} face @param {1 | -1} by */
function step(word, face, by) {
  const button = make("button", { type: "button", "aria-label": t(word), title: t(word) }, face);
  button.onclick = () => reorder(by);
  return button;
}

/** @param {ForOperator} entry */
function actions(entry) {
  const gap = make("span", { className: "gap" });
  const order = [step("sooner", "↑", -1), step("later", "↓", 1)];
  const watch = action("watch-short", "␣", "", () => strip.run());
  const script = action("script", "S", "", () =>
    save(`entries/${entry.id}/flight.zip`, `${entry.number}-${title(entry)}.zip`).catch(tell),
  );
  if (entry.state === "waiting")
    return [
      action("approve", "A", "first", () => answer("approve")),
      action("reject", "R", "second", () => answer("reject")),
      watch,
      gap,
      ...order,
    ];
  if (entry.state === "approved")
    return [
      action("fly", "F", "first", () => answer("fly")),
      action("back-to-waiting", "W", "second", () => answer("wait")),
      hide(entry),
      script,
      watch,
      gap,
      ...order,
    ];
  if (entry.state === "flying")
    return [
      action("flown", "F", "first", () => answer("flown")),
      action("back-to-approved", "A", "second", () => answer("approve")),
      hide(entry),
      script,
      watch,
    ];
  if (entry.state === "flown")
    return [
      hide(entry),
      action("fly-again", "F", "second", () => answer("fly")),
      script,
      watch,
    ];
  return [action("back-to-waiting", "W", "second", () => answer("wait")), watch];
}

/** @param {ForOperator} entry */
const hide = ({ hidden }) =>
  action(hidden ? "show-again" : "take-down", "D", "second", () =>
    answer(hidden ? "show" : "hide"),
  );

function putAir() {
  const box = byId("air");
  const flying = queue.entries.find(({ state }) => state === "flying");
  box.hidden = !flying;
  if (!flying) {
    tookOff = 0;
    return;
  }
  tookOff ||= Date.now();
  const run = make("progress", { max: flying.flight_s, "aria-label": t("in-the-air") }),
    clock = make("span");
  box.replaceChildren(
    make("span", {}, `${t("in-the-air")} `, make("strong", {}, make("bdi", {}, title(flying)))),
    run,
    clock,
    action("flown", "F", "second", () => answer("flown", flying)),
  );
  const tick = () => {
    if (!run.isConnected) return;
    const now = Math.min(flying.flight_s, (Date.now() - tookOff) / 1000);
    run.value = now;
    clock.textContent = t("clock", { now: Math.round(now), all: Math.round(flying.flight_s) });
    setTimeout(tick, 500);
  };
  tick();
}

/* ---------- Actions ---------- */

const BECOMES = /** @type {Record<string, State>} */ ({
  approve: "approved",
  reject: "rejected",
  wait: "waiting",
  fly: "flying",
  flown: "flown",
});

/** @param {string} what @param {ForOperator | undefined} [entry] */
async function answer(what, entry = current()) {
  if (!entry || entry.id === own || Date.now() < held) return;
  const at = inTab(tab).findIndex(({ id }) => id === entry.id);
  own = entry.id;
  try {
    await post(`entries/${entry.id}`, { do: what, was: entry.state });
    if (what === "fly") tookOff = Date.now();
    if (what in BECOMES) answered.push({ id: entry.id, was: entry.state, now: BECOMES[what] });
  } catch (error) {
    tell(error);
    hold();
  }
  await load((list) => {
    // The next entry of the list takes its place.
    if (!list.some(({ id }) => id === entry.id))
      chosen = list[Math.min(Math.max(0, at), list.length - 1)]?.id ?? "";
  });
  if (own === entry.id) own = "";
}

/** Undoes the last action. */
async function undo() {
  const last = answered.pop();
  if (!last) return;
  const back = Object.entries(BECOMES).find(([, state]) => state === last.was)?.[0];
  try {
    await post(`entries/${last.id}`, { do: back, was: last.now });
  } catch (error) {
    tell(error);
  }
  await load(() => {
    tab = TABS.find(([, states]) => states.includes(last.was))?.[0] ?? tab;
    chosen = last.id;
  });
}

/** @param {1 | -1} by */
async function reorder(by) {
  const list = inTab(tab).map(({ id }) => id),
    at = list.indexOf(chosen),
    to = at + by;
  if (at < 0 || to < 0 || to >= list.length) return;
  [list[at], list[to]] = [list[to], list[at]];
  // All entries keep their order, except for those of this tab among themselves.
  const places = new Set(list),
    moved = [...list];
  const ids = queue.entries.map(({ id }) => (places.has(id) ? moved.shift() : id));
  await post("order", { ids }).catch(tell);
  await load();
}

/** @param {unknown} error */
function tell(error) {
  toast(error instanceof Refused ? refusal(error.said) : t("lost"));
}

let told = 0;
/** Shows a text for six seconds. @param {string} text */
function toast(text) {
  const line = byId("toast");
  line.textContent = text;
  clearTimeout(told);
  told = window.setTimeout(() => {
    line.textContent = "";
  }, 6000);
}

/** @param {string} head @param {Node[]} parts */
function sheet(head, ...parts) {
  const box = /** @type {HTMLDialogElement} */ (byId("sheet"));
  const close = make("button", { type: "button", className: "second" }, t("close"));
  close.onclick = () => box.close();
  box.replaceChildren(make("h2", {}, head), ...parts, close);
  box.setAttribute("aria-label", head);
  if (!box.open) box.showModal();
}

byId("pause").onclick = async () => {
  await post("pause", { paused: !queue.paused }).catch(tell);
  await load();
};
byId("show-code").onclick = async () => {
  const told = await get("address.json").catch(tell);
  if (!told) return;
  const cards = make("div", { className: "cards" }, ...["visitors", "kiosk", "wall"].map((of) => card(of, told)));
  const print = make("button", { type: "button", className: "first" }, t("print"));
  print.onclick = () => window.print();
  const note = told.network ? wlan(cards) : make("p", { className: "note" }, t("no-phone"));
  sheet(t("show-code"), note, cards, print);
};

/** Returns a card to print, with the name, the code and the address of a page. @param {string} of @param {any} told */
function card(of, told) {
  const copy = make("button", { type: "button", className: "second" }, t("copy"));
  copy.onclick = async () => {
    await navigator.clipboard.writeText(told[of]).then(() => {
      copy.textContent = t("copied");
    }, tell);
  };
  const code = () => make("div", { className: "code" }, make("img", { src: `${of}.svg`, alt: t(`code-${of}`) }));
  return make(
    "section",
    {},
    make("h3", {}, t(`code-${of}`)),
    make("p", {}, t(`for-${of}`)),
    ...(told.network ? [code()] : []),
    make("a", { href: told[of] }, told[of]),
    copy,
    make("div", { className: "wlan" }),
  );
}

/** Returns the fields for the hall's WLAN, whose code then appears on each card. @param {HTMLElement} cards */
function wlan(cards) {
  const [name, password] = ["wlan-name", "wlan-password"].map((key) =>
    make("input", { type: "text", autocomplete: "off", spellcheck: false, placeholder: t(key), "aria-label": t(key) }),
  );
  const escaped = (/** @type {HTMLInputElement} */ { value }) => value.replace(/[\\;,:"]/g, "\\$&");
  const put = () => {
    const text = `WIFI:T:${password.value ? "WPA" : "nopass"};S:${escaped(name)};P:${escaped(password)};;`;
    const hex = [...new TextEncoder().encode(text)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    for (const box of cards.querySelectorAll(".wlan"))
      box.replaceChildren(
        ...(name.value
          ? [
              make("p", {}, t("wlan-join", { name: name.value })),
              make("div", { className: "code" }, make("img", { src: `text.svg?${hex}`, alt: t("wlan") })),
            ]
          : []),
      );
  };
  name.onchange = password.onchange = put;
  return make("div", { className: "fields" }, name, password);
}
byId("keys").onclick = () =>
  sheet(
    t("all-keys"),
    make(
      "dl",
      { className: "keys" },
      ...[
        ["A", "approve"],
        ["R", "reject"],
        ["F", "key-fly"],
        ["W", "back-to-waiting"],
        ["D", "take-down"],
        ["S", "script"],
        ["Z", "undo-answer"],
        ["↑ ↓", "key-choose"],
        ["Shift ↑ ↓", "key-order"],
        ["␣", "watch-short"],
      ].flatMap(([key, word]) => [make("dt", {}, make("kbd", {}, key)), make("dd", {}, t(word))]),
    ),
  );
byId("export").onclick = async () => {
  if (byId("export").getAttribute("aria-disabled") === "true") return;
  byId("export").setAttribute("aria-disabled", "true");
  byId("export").textContent = t("exporting");
  try {
    await save("export.zip", "evening.zip");
    const entries = await get("export.json");
    const refused = entries.filter(
      (/** @type {{ refused: Said[] }} */ { refused }) => refused.length,
    );
    if (refused.length)
      sheet(
        t("export-refused"),
        make(
          "ul",
          {},
          ...refused.map((/** @type {{ number: number, refused: Said[] }} */ it) =>
            make(
              "li",
              {},
              `${it.number}: ${it.refused.map(refusal).join(" ")}`,
            ),
          ),
        ),
      );
  } catch (error) {
    tell(error);
  }
  putHeader();
};

addEventListener("keydown", (event) => {
  if (
    event.ctrlKey ||
    event.metaKey ||
    event.altKey ||
    /** @type {HTMLDialogElement} */ (byId("sheet")).open
  )
    return;
  const target = /** @type {HTMLElement} */ (event.target);
  if (target.matches("input")) return;
  const press = (/** @type {string[]} */ ...names) =>
    names.map((name) => byId("entry").querySelector(`[data-do="${name}"]`)).find(Boolean);
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (step) {
    event.preventDefault();
    if (event.shiftKey) return reorder(/** @type {1 | -1} */ (step));
    const list = inTab(tab),
      at = list.findIndex(({ id }) => id === chosen);
    chosen = list[Math.min(list.length - 1, Math.max(0, at + step))]?.id ?? "";
    return put();
  }
  if (event.key === " " && target.matches("button, a")) return;
  const key = event.key.toLowerCase();
  const found = {
    a: press("approve", "back-to-approved"),
    r: press("reject"),
    f: press("fly", "flown", "fly-again") ?? byId("air").querySelector("button"),
    w: press("back-to-waiting"),
    d: press("take-down", "show-again"),
    s: press("script"),
    " ": press("watch-short"),
  }[key];
  if (key === "z") undo();
  else if (key === "?") byId("keys").click();
  else if (found) {
    event.preventDefault();
    /** @type {HTMLElement} */ (found).click();
  }
});

/* ---------- Start ---------- */

/** Loads and shows the queue. @param {(list: ForOperator[]) => void} [then] called before the queue is shown */
async function load(then) {
  const told = await get("queue.json").catch(() => null);
  if (!told) return;
  queue = told;
  then?.(inTab(tab));
  put();
}

async function begun() {
  const about = /** @type {About} */ (await get("about.json"));
  if (about.wall === "open") rule = "wall-open";
  await speakAll(preferred(""));
  putWords(document);
  putBrand(about, t("queue"));
  onLost((lost) => {
    byId("lost").textContent = lost ? t(lost === "moved" ? "moved" : "lost") : "";
  });
  put();
  follow(() => load());
}
begun();

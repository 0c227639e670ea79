// The drawer with settings, advice and files, which visitors of a hall do not need. A kiosk has no drawer.

import { Refused } from "./ask.js";
import { byId, make } from "./dom.js";
import { refusal, saveOf } from "./save.js";
import { change, state } from "./state.js";
import { about, isLog } from "./wish.js";
import { number, sentence, t } from "./words.js";

const drawer = /** @type {HTMLDialogElement} */ (byId("drawer"));

/**
 * Sliders that set a key of the scene: [key, word, unit, least, most, step].
 */
const SLIDERS = /** @type {const} */ ([
  ["letters.cap_height_m", "height", "m", 0.2, 1.2, 0.05],
  ["plan.stroke_speed_m_s", "speed", "m/s", 0.05, 0.8, 0.05],
  ["plan.drones", "drones", "", 1, 4, 1],
]);
/**
 * Choices that set a key of the scene: [key, word, choices]. A choice is translated if the page's texts contain its name.
 * @type {[string, string, [string, string][]][]}
 */
const CHOICES = [
  [
    "preset",
    "drone",
    [
      ["cf21", "Crazyflie 2.1"],
      ["cf21-thrust-kit", "Crazyflie 2.1, thrust kit"],
      ["cf-brushless", "Crazyflie Brushless"],
    ],
  ],
  [
    "controller.kind",
    "controller",
    [
      ["pid", "PID"],
      ["lqr", "LQR"],
      ["lqr-integral", "lqr-integral"],
      ["lqr-feedforward", "lqr-feedforward"],
      ["geometric", "geometric"],
    ],
  ],
  [
    "photo.ambient_cd_m2",
    "ambient",
    [
      ["0.008", "ambient-dark"],
      ["0.1", "ambient-dim"],
      ["1", "ambient-lit"],
    ],
  ],
];
/**
 * Choices that set a part of the page's state.
 * @type {[ "lamp" | "room" | "body" | "pace", string, [string, string][]][]}
 */
const OWN = [
  [
    "lamp",
    "lamp",
    [
      ["", "lamp-auto"],
      ["headlights", "headlights"],
      ["ring", "ring"],
      ["color-led", "color-led"],
    ],
  ],
  [
    "pace",
    "pace",
    [
      ["written", "pace-written"],
      ["even", "pace-even"],
    ],
  ],
  [
    "room",
    "room",
    [
      ["", "any"],
      ["4x3x2.5", "4 × 3 × 2.5 m"],
      ["6x4x3", "6 × 4 × 3 m"],
      ["10x6x4", "10 × 6 × 4 m"],
    ],
  ],
  [
    "body",
    "body",
    [
      ["", "full-frame"],
      ["a6400", "Sony α6400, 16 mm"],
      ["canon-eos-2000d", "Canon EOS 2000D, 28 mm"],
      ["one-inch", "compact"],
      ["phone", "phone"],
    ],
  ],
];
const FILES = [
  ["photo.png", "file-photo"],
  ["scene.toml", "file-scene"],
  ["flight.zip", "file-script"],
];

/**
 * Values of the default scene for a page that does not receive the scene.
 * @type {Record<string, string>}
 */
const PLAIN = {
  "letters.cap_height_m": "0.5",
  "plan.stroke_speed_m_s": "0.2",
  "plan.drones": "1",
  preset: "cf21",
  "controller.kind": "pid",
  "photo.ambient_cd_m2": "0.008",
};

/** @typedef {{ shot: Shot | null, large: Large | null, error: Said | null }} Known */
/** @type {Known} */
let known = { shot: null, large: null, error: null };
/** Controller of the last flight, which is kept if the gains of a newer request are refused. @type {Record<string, any>} */
let flown = {};

/** Returns the value of a key in the scene with which the page began. */
const first = (/** @type {string} */ key) =>
  `${key.split(".").reduce((/** @type {any} */ table, part) => table?.[part], about.scene) ?? PLAIN[key] ?? ""}`;
const value = (/** @type {string} */ key) => state.settings[key] ?? first(key);

const isGain = (/** @type {string} */ key) => key.startsWith("controller.") && key !== "controller.kind";

/** @param {Record<string, string>} set */
function put(set) {
  const settings = { ...state.settings, ...set };
  // Gains apply to only one controller.
  if ("controller.kind" in set) {
    for (const key of Object.keys(settings)) if (isGain(key)) delete settings[key];
    flown = {};
    drawer.querySelector(".gains")?.replaceChildren();
  }
  for (const key of Object.keys(settings))
    if (!isGain(key) && settings[key] === first(key)) delete settings[key];
  change({ settings });
}

export function openDrawer(/** @type {Known} */ now) {
  known = now;
  build();
  if (!drawer.open) drawer.showModal();
}

/** Shows the verdict, the advice and the files of the newest photograph. */
export function putShot(/** @type {Known} */ now) {
  known = now;
  if (!drawer.open) return;
  drawer.querySelector(".files")?.replaceChildren(...downloads());
  drawer.querySelector(".of-shot")?.replaceChildren(...ofShot());
  const list = drawer.querySelector(".gains");
  if (!list?.contains(document.activeElement)) list?.replaceChildren(...gains());
}

function build() {
  const close = make("button", { type: "button" }, t("close"));
  close.onclick = () => drawer.close();
  const again = make("button", { type: "button", className: "second" }, t("another-evening"));
  again.onclick = () => change({ seed: state.seed + 1 });
  const initial = make("button", { type: "button" }, t("initial"));
  initial.onclick = () => {
    change({ settings: {}, lamp: "", room: "", body: "", pace: "written", seed: 0 });
    build();
  };
  const file = make("input", { type: "file", accept: about.alone ? "" : ".svg,.json,image/*", className: "sr" });
  file.onchange = () => {
    drawer.close();
    dispatchEvent(new CustomEvent("open-file", { detail: file.files?.[0] }));
  };
  const how = make(
    "details",
    { className: "how", open: drawer.querySelector(".how")?.matches("[open]") ?? false },
    make("summary", {}, t("how")),
    part("light", own("lamp"), make("p", { className: "note" }, t("light-note"))),
    part(
      "flight-part",
      // A log cannot be flown with other settings.
      ...(isLog() ? [] : [...SLIDERS.map(slider), own("pace"), choice(CHOICES[0]), choice(CHOICES[1]), ...ofGains()]),
      own("room"),
    ),
    part(
      "camera",
      own("body"),
      choice(CHOICES[2]),
      make("div", { className: "row" }, again, initial),
    ),
  );
  drawer.replaceChildren(
    make("header", {}, make("h2", {}, t("more")), close),
    part("save", make("div", { className: "files" }, ...downloads())),
    make("label", { className: "button second file" }, file, t(about.alone ? "open-log" : "open")),
    make("div", { className: "of-shot" }, ...ofShot()),
    how,
    make(
      "nav",
      { className: "links" },
      make("a", { className: "button", href: "wall.html" }, t("wall")),
    ),
  );
}

/** @param {string} name @param {Node[]} children */
const part = (name, ...children) => make("fieldset", {}, make("legend", {}, t(name)), ...children);

/** @param {typeof SLIDERS[number]} slider */
function slider([key, word, unit, min, max, step]) {
  const shown = make("span", { className: "value" });
  const range = make("input", {
    type: "range",
    min: `${min}`,
    max: `${max}`,
    step: `${step}`,
    value: value(key),
  });
  const label = () => {
    shown.textContent = `${number(Number(range.value))} ${unit}`.trim();
    range.setAttribute("aria-valuetext", shown.textContent);
  };
  range.dataset.key = key;
  range.oninput = () => {
    label();
    put({ [key]: range.value });
  };
  label();
  return make("label", { className: "slider" }, make("span", {}, t(word)), shown, range);
}

/**
 * @param {string} word
 * @param {[string, string][]} choices
 * @param {string} now
 * @param {(value: string) => void} set
 */
function select(word, choices, now, set) {
  const list = choices.some(([code]) => code === now)
    ? choices
    : [...choices, /** @type {[string, string]} */ ([now, now])];
  const box = make(
    "select",
    {},
    ...list.map(([code, name]) => make("option", { value: code, selected: code === now }, t(name))),
  );
  box.onchange = () => set(box.value);
  return make("label", { className: "choice" }, make("span", {}, t(word)), box);
}

/** @param {typeof CHOICES[number]} choice */
function choice([key, word, choices]) {
  const label = select(word, choices, value(key), (chosen) => put({ [key]: chosen }));
  /** @type {HTMLElement} */ (label.querySelector("select")).dataset.key = key;
  return label;
}

/** Returns the fields for the gains, which only the host can change. */
function ofGains() {
  if (!about.scene) return [];
  const list = make("div", { className: "gains" }, ...gains());
  return [make("details", {}, make("summary", {}, t("gains")), list)];
}

/** Returns the gains of the controller that flew, with a field for each number or list of numbers. */
function gains() {
  flown = known.large?.controller ?? flown;
  const { kind = "", ...tables } = flown;
  const table = kind.split("-")[0];
  const all = Object.entries(tables[table] ?? {});
  return all.filter(([, gain]) => [gain].flat().every(Number.isFinite)).map(([name, gain]) => {
    const key = `controller.${table}.${name}`;
    const text = state.settings[key]?.replace(/[[\]]/g, "") ?? [gain].flat().join(", ");
    const field = make("input", { type: "text", value: text, spellcheck: false });
    field.dataset.key = key;
    field.onchange = () => put({ [key]: Array.isArray(gain) ? `[${field.value}]` : field.value });
    return make("label", { className: "choice" }, make("code", {}, name), field);
  });
}

/** @param {"lamp" | "room" | "body" | "pace"} name */
function own(name) {
  const [, word, choices] = /** @type {typeof OWN[number]} */ (
    OWN.find(([known]) => known === name)
  );
  const label = select(word, choices, state[name], (chosen) => change({ [name]: chosen }));
  /** @type {HTMLElement} */ (label.querySelector("select")).id = name;
  return label;
}

/* ---------- Facts about the photograph ---------- */

function ofShot() {
  const { shot, large, error } = known;
  const verdict = shot?.verdict;
  const parts = [];
  // The host reads the program's own message, which says what is wanted.
  if (error?.text && about.home)
    parts.push(make("p", { className: "stop" }, [error.text, error.hint].filter(Boolean).join(": ")));
  if (verdict) {
    parts.push(
      make(
        "p",
        { className: "read" },
        t("read-percent", {
          read: verdict.read.replace(/\s+/g, " "),
          word: verdict.word.replace(/\s+/g, " "),
          percent: Math.round(100 * verdict.readability),
        }),
      ),
    );
    parts.push(
      make(
        "ol",
        { className: "letters", "aria-label": t("letters") },
        ...verdict.letters.map(({ expected, best, p }) =>
          make(
            "li",
            { className: best === expected ? "" : "wrong" },
            best === expected || !best ? expected : `${expected} → ${best}`,
            make("small", {}, p === null ? "–" : `${number(Math.round(100 * p))} %`),
          ),
        ),
      ),
    );
  }
  for (const [group, all] of /** @type {["obstacles" | "stops", Said[]][]} */ ([
    ["obstacles", large?.obstacles ?? shot?.obstacles ?? []],
    ["stops", large?.stops ?? []],
  ])) {
    parts.push(...all.map((said) => make("p", { className: "stop" }, sentence(group, said))));
  }
  parts.push(
    ...(large?.warnings ?? shot?.warnings ?? []).map((said) =>
      make("p", { className: "note" }, sentence("obstacles", said)),
    ),
  );
  if (large?.remedies.length)
    parts.push(make("div", { className: "advice" }, ...large.remedies.map(remedy)));
  return parts;
}

/** Returns the buttons that save the files of the large photograph. */
function downloads() {
  const { large } = known;
  if (!large) return [];
  const files = FILES.filter(([name]) => name === "photo.png" || (about.home && !(name === "flight.zip" && isLog())));
  return files.map(([name, word]) =>
    download(large, name, name === "scene.toml" && "drawing" in large.wish ? "file-scene-drawing" : word),
  );
}

/** @param {Suggestion} remedy */
function remedy({ gain, set, message }) {
  const button = make(
    "button",
    { type: "button", className: "second" },
    sentence("advice", message),
    make("small", {}, t("gain", { percent: Math.round(100 * gain) })),
  );
  button.onclick = () => {
    put(Object.fromEntries(set.flatMap(({ key, value }) => (value === null ? [] : [[key, value]]))));
    build();
  };
  return button;
}

/**
 * Returns a button that makes and saves a file, or the reason why it cannot be made.
 * @param {Large} large
 * @param {string} name
 * @param {string} word
 */
function download(large, name, word) {
  const button = make("button", { type: "button", className: "second" }, t(word));
  button.dataset.file = name;
  const refused = make("p", { className: "refused", role: "status" });
  if (name === "flight.zip" && large.stops.length) {
    button.setAttribute("aria-disabled", "true");
    refused.textContent = t("no-script");
    return make("div", {}, button, refused);
  }
  button.onclick = async () => {
    if (button.getAttribute("aria-busy") === "true") return;
    button.setAttribute("aria-busy", "true");
    refused.textContent = "";
    try {
      await saveOf(large, name);
    } catch (error) {
      refused.textContent = error instanceof Refused ? refusal(error.said) : t("lost");
    }
    button.removeAttribute("aria-busy");
  };
  return make("div", {}, button, refused);
}

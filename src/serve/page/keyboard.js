// An on-screen keyboard for a kiosk whose system has none. The kiosk's address ends with `?keyboard`.

import { byId, draw, make } from "./dom.js";
import { watch } from "./state.js";
import { t } from "./words.js";

const LATIN = ["qwertyuiop", "asdfghjkl", "zxcvbnm-’"];
/** @type {Record<string, string[]>} */
const ROWS = {
  de: ["qwertzuiopü", "asdfghjklöä", "yxcvbnmß-’"],
  fr: ["azertyuiop", "qsdfghjklm", "wxcvbnéèçà-’"],
  es: ["qwertyuiop", "asdfghjklñ", "zxcvbnmáéíóú"],
};

const word = /** @type {HTMLInputElement} */ (byId("word"));
const box = make("div", { className: "keyboard", "data-in": "empty word" });
/** @type {HTMLButtonElement[]} */
let letters = [];
let shift = false;

/** Returns a letter in the current case. A word begins with a capital. */
function cased(/** @type {string} */ letter) {
  const capital = letter.toLocaleUpperCase();
  return (shift || !word.value) && capital.length === 1 ? capital : letter;
}

/** Inserts a text at the cursor. An empty text deletes the letter before it. */
function type(/** @type {string} */ text) {
  const [from, to] = [word.selectionStart ?? 0, word.selectionEnd ?? 0];
  word.setRangeText(text, text || from < to ? from : Math.max(0, from - 1), to, "end");
  shift = false;
  word.dispatchEvent(new Event("input", { bubbles: true }));
  putCase();
}

function putCase() {
  for (const key of letters) key.textContent = cased(key.value);
  box.querySelector(".shift")?.setAttribute("aria-pressed", `${shift}`);
}

/** Returns the icon of the delete key. */
function back() {
  const sign = draw("svg", { class: "icon turns", viewBox: "0 0 24 24", "aria-hidden": "true" });
  sign.append(draw("path", { d: "M9 5h12v14H9l-6-7zM12 9.5l5 5M17 9.5l-5 5" }));
  return sign;
}

/** @param {string} className @param {() => void} act @param {Node | string} face */
function key(className, act, face, name = "") {
  const button = make("button", { type: "button", className }, face);
  if (name) button.setAttribute("aria-label", t(name));
  button.onclick = act;
  return button;
}

function put() {
  const rows = ["1234567890", ...(ROWS[document.documentElement.lang] ?? LATIN)].map((row) =>
    [...row].map((letter) => {
      const button = key("", () => type(cased(letter)), letter);
      button.value = letter;
      return button;
    }),
  );
  letters = rows.flat();
  const turn = () => {
    shift = !shift;
    putCase();
  };
  const last = [
    key("shift", turn, "⇧", "key-shift"),
    key("space", () => type(" "), " ", "key-space"),
    key("", () => type(""), back(), "key-delete"),
  ];
  box.replaceChildren(...[...rows, last].map((row) => make("div", {}, ...row)));
  putCase();
}

export function putKeyboard() {
  byId("consent").before(box);
  // The system's own keyboard is not shown, and the field keeps the focus.
  word.inputMode = "none";
  box.onpointerdown = (event) => event.preventDefault();
  watch((changed) => {
    if (changed.has("language")) put();
    else if (changed.has("word")) putCase();
  });
  put();
}

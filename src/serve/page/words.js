// Texts in the visitor's language. Each language has a table, such as `words/en.json`, and a second
// one, such as `words/en-more.json`, with texts that are not needed at the start.

/** Languages with complete tables, with their native names. */
export const LANGUAGES = { en: "English", de: "Deutsch", fr: "Français", es: "Español" };

/** @typedef {string | Partial<Record<Intl.LDMLPluralRule, string>>} Phrase */
/** @type {Record<string, Phrase | Record<string, string>>} */
let table = {};
let language = "en";
/** True if both tables are loaded, see `speakAll`. */
let whole = false;
const RIGHT_TO_LEFT = ["ar", "fa", "he", "ur"];

/** Returns the chosen language, or else the browser's first language for which there is a table. */
export function preferred(/** @type {string} */ chosen) {
  if (chosen) return chosen;
  const known = navigator.languages
    .map((name) => name.slice(0, 2))
    .find((name) => name in LANGUAGES);
  return known ?? "en";
}

/** Loads the tables of a language. @param {string} code @param {string[]} parts */
export async function wordsOf(code, parts = [""]) {
  const tables = parts.map(async (part) => {
    const name = `words/${code}${part}.json`;
    const response = await fetch(new URL(name, import.meta.url));
    if (!response.ok) throw new Error(`no ${name}`);
    return response.json();
  });
  return Object.assign({}, ...(await Promise.all(tables)));
}

/** Loads a language, and sets the document's texts. */
export async function speak(/** @type {string} */ code) {
  table = await wordsOf(code, whole ? ["", "-more"] : [""]);
  language = code;
  const root = document.documentElement;
  root.lang = code;
  root.dir = RIGHT_TO_LEFT.includes(code) ? "rtl" : "ltr";
  putWords(document);
}

/** Loads both tables of a language. */
export function speakAll(code = language) {
  if (whole && code === language) return Promise.resolve();
  whole = true;
  return speak(code).catch((error) => {
    whole = false;
    throw error;
  });
}

/** Sets the texts (data-t), labels (data-l) and placeholders (data-p) of all elements that name a key. */
export function putWords(/** @type {Document | Element} */ root) {
  for (const element of root.querySelectorAll("[data-t]")) {
    const kept = element.querySelector(".icon");
    element.textContent = t(element.getAttribute("data-t") ?? "");
    if (kept) element.prepend(kept);
  }
  for (const element of root.querySelectorAll("[data-l]")) {
    const label = t(element.getAttribute("data-l") ?? "");
    element.setAttribute("aria-label", label);
    if (element.matches("button")) element.setAttribute("title", label);
  }
  for (const element of root.querySelectorAll("[data-p]")) {
    element.setAttribute("placeholder", t(element.getAttribute("data-p") ?? ""));
  }
}

/** Returns a phrase with its values, of which `n` selects the singular or a plural. */
export function t(
  /** @type {string} */ key,
  /** @type {Record<string, string | number>} */ values = {},
) {
  return worded(/** @type {Phrase | undefined} */ (table[key]) ?? key, values);
}

export const hasWord = (/** @type {string} */ key) => key in table;

/**
 * Returns a message of the server in the visitor's language, or in English if the table lacks it.
 * @param {"errors" | "obstacles" | "stops" | "advice" | "reasons"} group
 * @param {Said} said
 */
export function sentence(group, said) {
  const phrase = /** @type {Record<string, Phrase> | undefined} */ (table[group])?.[said.key];
  return phrase ? worded(phrase, said.values ?? {}) : said.text;
}

/** @param {Phrase} phrase @param {Record<string, string | number>} values */
export function worded(phrase, values, code = language) {
  const rule = new Intl.PluralRules(code).select(Number(values.n ?? 0));
  const text = typeof phrase === "string" ? phrase : (phrase[rule] ?? phrase.other ?? "");
  return text.replace(/\{(\w+)\}/g, (_, name) => {
    const value = values[name];
    return typeof value === "number" ? number(value) : isolated(`${value ?? ""}`);
  });
}

/** Formats a number in the language. */
export const number = (/** @type {number} */ value) =>
  new Intl.NumberFormat(language, { maximumFractionDigits: 2 }).format(value);

/** Isolates a text that may run in the other direction. */
function isolated(/** @type {string} */ text) {
  const foreign =
    document.documentElement.dir === "rtl" || /[\u0590-\u08ff\ufb1d-\ufefc]/.test(text);
  return foreign ? `\u2068${text}\u2069` : text;
}

/** Returns the host's sentence in the language, or else in English, or else the first one. */
export function ofMaker(/** @type {Record<string, string> | undefined} */ sentences) {
  return sentences?.[language] ?? sentences?.en ?? Object.values(sentences ?? {})[0] ?? "";
}

/** Formats a date in the language. */
export function day(/** @type {string} */ iso) {
  return new Intl.DateTimeFormat(language, { dateStyle: "long" }).format(new Date(iso));
}

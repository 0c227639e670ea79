// Words in the visitor's language: `words/en.json` and its sisters, a table a language; what no
// visitor reads at first stands in `words/en-more.json`.

/** Languages that are complete, by their own names. */
export const LANGUAGES = { en: "English", de: "Deutsch", fr: "Français", es: "Español" };

/** @typedef {string | Partial<Record<Intl.LDMLPluralRule, string>>} Phrase */
/** @type {Record<string, Phrase | Record<string, string>>} */
let table = {};
let language = "en";
/** Whether all words are wanted, see `speakAll`. */
let whole = false;
const RIGHT_TO_LEFT = ["ar", "fa", "he", "ur"];

/** The language to begin with: the one that was chosen, or the browser's first that is there. */
export function preferred(/** @type {string} */ chosen) {
  if (chosen) return chosen;
  const known = navigator.languages
    .map((name) => name.slice(0, 2))
    .find((name) => name in LANGUAGES);
  return known ?? "en";
}

/** The words of a language, in parts. @param {string} code @param {string[]} parts */
export async function wordsOf(code, parts = [""]) {
  const tables = parts.map(async (part) => {
    const name = `words/${code}${part}.json`;
    const response = await fetch(new URL(name, import.meta.url));
    if (!response.ok) throw new Error(`no ${name}`);
    return response.json();
  });
  return Object.assign({}, ...(await Promise.all(tables)));
}

/** Loads a language and words the document in it. */
export async function speak(/** @type {string} */ code) {
  table = await wordsOf(code, whole ? ["", "-more"] : [""]);
  language = code;
  const root = document.documentElement;
  root.lang = code;
  root.dir = RIGHT_TO_LEFT.includes(code) ? "rtl" : "ltr";
  putWords(document);
}

/** The same with all words: those of settings, of the operator, of the wall and of what stops. */
export function speakAll(code = language) {
  if (whole && code === language) return Promise.resolve();
  whole = true;
  return speak(code).catch((error) => {
    whole = false;
    throw error;
  });
}

/** Words all elements that ask for it: as text (data-t), label (data-l) or placeholder (data-p). */
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

/** A phrase with its values; `n` chooses between one and several. */
export function t(
  /** @type {string} */ key,
  /** @type {Record<string, string | number>} */ values = {},
) {
  return worded(/** @type {Phrase | undefined} */ (table[key]) ?? key, values);
}

export const hasWord = (/** @type {string} */ key) => key in table;

/**
 * What the server says, in the visitor's language; its own English where the table lacks it.
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

/** A number as the language writes it. */
export const number = (/** @type {number} */ value) =>
  new Intl.NumberFormat(language, { maximumFractionDigits: 2 }).format(value);

/** A foreign word that keeps its own direction within a sentence of the other. */
function isolated(/** @type {string} */ text) {
  const foreign =
    document.documentElement.dir === "rtl" || /[\u0590-\u08ff\ufb1d-\ufefc]/.test(text);
  return foreign ? `\u2068${text}\u2069` : text;
}

/** A maker's sentence in the language, or in English, or the first that there is. */
export function ofMaker(/** @type {Record<string, string> | undefined} */ sentences) {
  return sentences?.[language] ?? sentences?.en ?? Object.values(sentences ?? {})[0] ?? "";
}

/** A day as the language writes it. */
export function day(/** @type {string} */ iso) {
  return new Intl.DateTimeFormat(language, { dateStyle: "long" }).format(new Date(iso));
}

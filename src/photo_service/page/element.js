// <noctograph-photo word="NOOR"> shows a photograph with its verdict in any page. The reader's browser
// makes it when it becomes visible. `set` contains keys of the scene: set="controller.kind=pid;
// preset=cf-brushless". The texts are in the language of the page.

import { make } from "./maker.js";
import { LANGUAGES, worded, wordsOf } from "./words.js";

const STYLE = `
  :host { display: block; max-inline-size: 60rem; }
  figure { margin: 0; }
  img { display: block; inline-size: 100%; block-size: auto; background: #0c0b09; aspect-ratio: var(--aspect); }
  p { margin: 0; display: grid; place-items: center; overflow: hidden; container-type: inline-size; aspect-ratio: var(--aspect); background: #0c0b09; }
  span { white-space: pre; font: min(90cqw / var(--n), 25cqw) / 1 system-ui, sans-serif; color: transparent; -webkit-text-stroke: 1px #ffcb80; }
  figcaption { margin-block-start: 0.5em; }
  a { color: inherit; }
`;

/** Texts that are shown until the words are loaded, or if they cannot be loaded. */
const BARE = { "element-none": "No photograph here: put the folder beside your page." };

class NoctographPhoto extends HTMLElement {
  static observedAttributes = ["word", "set", "aspect"];
  #ends = new AbortController();
  /** Starts when the element is about to become visible. */
  #sight = new IntersectionObserver(
    ([{ isIntersecting }]) => {
      if (!isIntersecting) return;
      this.#sight.disconnect();
      this.#isSeen = true;
      this.#put();
    },
    { rootMargin: "25%" },
  );
  #isSeen = false;

  connectedCallback() {
    if (!this.shadowRoot) this.attachShadow({ mode: "open" });
    this.#plan();
    if (this.#isSeen) this.#put();
    else this.#sight.observe(this);
  }

  attributeChangedCallback() {
    if (!this.isConnected || !this.shadowRoot) return;
    this.#plan();
    if (this.#isSeen) this.#put();
  }

  disconnectedCallback() {
    this.#ends.abort();
    this.#sight.disconnect();
  }

  get #aspect() {
    return Number(this.getAttribute("aspect")) || 16 / 9;
  }

  /** Shows the outlines until the photograph is ready. Returns its place and its caption. */
  #plan() {
    const word = this.getAttribute("word") ?? "";
    const caption = document.createElement("figcaption");
    const figure = document.createElement("figure");
    const plan = document.createElement("p");
    plan.append(Object.assign(document.createElement("span"), { textContent: word }));
    plan.ariaHidden = "true";
    figure.append(plan, caption);
    const style = Object.assign(document.createElement("style"), { textContent: STYLE });
    this.shadowRoot?.replaceChildren(style, figure);
    this.style.setProperty("--aspect", `${this.#aspect}`);
    this.style.setProperty("--n", `${word.length || 1}`);
    return { plan, caption };
  }

  async #put() {
    this.#ends.abort();
    const { signal } = (this.#ends = new AbortController());
    const word = this.getAttribute("word") ?? "";
    const { plan, caption } = this.#plan();
    const pairs = (this.getAttribute("set") ?? "").split(";").filter((pair) => pair.includes("="));
    const settings = Object.fromEntries(
      pairs.map((pair) => [pair.split("=")[0], pair.slice(pair.indexOf("=") + 1)].map((side) => side.trim())),
    );
    const t = await phrases(this);
    if (signal.aborted) return;
    const tell = (/** @type {number} */ done) => {
      caption.textContent = t("element-made", { n: Math.round(100 * done) });
    };
    tell(0);
    const body = JSON.stringify({ visitor: "element", word, settings, aspect: this.#aspect });
    const answer = await make("live", body, { signal, tell }).catch((error) => ({ error, none: true }));
    if (signal.aborted) return;
    if (answer.none) {
      caption.textContent = t("element-none");
    } else if (answer.error) {
      caption.textContent = t("element-error", { text: answer.error.text });
    } else {
      const image = Object.assign(document.createElement("img"), { src: answer.photo, alt: t("alt", { title: word }) });
      plan.replaceWith(image);
      const link = document.createElement("a");
      const parts = { word, settings: JSON.stringify(settings), aspect: `${this.#aspect}` };
      link.href = `${new URL("index.html", import.meta.url)}#${new URLSearchParams(parts)}`;
      link.textContent = t("change-it");
      caption.replaceChildren(`${read(answer.verdict, word, t)} ${t("flight", { n: Math.round(answer.flight_s) })} `, link);
    }
    this.dispatchEvent(new CustomEvent("photograph", { detail: answer }));
  }
}

/** @typedef {(key: string, values?: Record<string, string | number>) => string} Say */

/** Returns the reading as a sentence. @param {any} verdict @param {string} word @param {Say} t */
function read(verdict, word, t) {
  if (!verdict) return "";
  if (verdict.legible) return t("reads", { read: verdict.read });
  // A question mark stands for light that is not a letter.
  const isUnsure = verdict.read === word || !verdict.read || verdict.read.includes("?");
  return isUnsure ? t("unreadable-nothing") : t("unreadable", { read: verdict.read });
}

/** Loads the phrases in the language of an element. @param {Element} element @returns {Promise<Say>} */
async function phrases(element) {
  const said = element.closest("[lang]")?.getAttribute("lang")?.slice(0, 2) ?? "en";
  const code = said in LANGUAGES ? said : "en";
  const table = await wordsOf(code, ["", "-more"]).catch(() => BARE);
  return (key, values = {}) => worded(table[key] ?? key, values, code);
}

customElements.define("noctograph-photo", NoctographPhoto);

// <noctograph-photo word="NOOR">: a photograph with its verdict in a page of one's own, made by the
// reader's browser. `set` has keys of the scene: set="controller.kind=pid; preset=cf-brushless".

import { make } from "./maker.js";

const STYLE = `
  :host { display: block; max-inline-size: 60rem; }
  figure { margin: 0; }
  img { display: block; inline-size: 100%; block-size: auto; background: #0c0b09; aspect-ratio: var(--aspect); }
  p { margin: 0; display: grid; place-items: center; overflow: hidden; container-type: inline-size; aspect-ratio: var(--aspect); background: #0c0b09; }
  span { white-space: pre; font: min(90cqw / var(--n), 25cqw) / 1 system-ui, sans-serif; color: transparent; -webkit-text-stroke: 1px #ffcb80; }
  figcaption { margin-block-start: 0.5em; }
  a { color: inherit; }
`;

class NoctographPhoto extends HTMLElement {
  static observedAttributes = ["word", "set", "aspect"];
  #ends = new AbortController();

  connectedCallback() {
    if (!this.shadowRoot) this.attachShadow({ mode: "open" });
    this.#put();
  }

  attributeChangedCallback() {
    if (this.isConnected && this.shadowRoot) this.#put();
  }

  disconnectedCallback() {
    this.#ends.abort();
  }

  async #put() {
    this.#ends.abort();
    const { signal } = (this.#ends = new AbortController());
    const word = this.getAttribute("word") ?? "";
    const aspect = Number(this.getAttribute("aspect")) || 16 / 9;
    const pairs = (this.getAttribute("set") ?? "").split(";").filter((pair) => pair.includes("="));
    const settings = Object.fromEntries(
      pairs.map((pair) => [pair.split("=")[0], pair.slice(pair.indexOf("=") + 1)].map((side) => side.trim())),
    );
    const image = Object.assign(document.createElement("img"), { alt: "" });
    const caption = document.createElement("figcaption");
    const figure = document.createElement("figure");
    // What the lamp will write, until the photograph is there.
    const plan = document.createElement("p");
    plan.append(Object.assign(document.createElement("span"), { textContent: word }));
    plan.ariaHidden = "true";
    figure.append(plan, caption);
    const style = Object.assign(document.createElement("style"), { textContent: STYLE });
    this.shadowRoot?.replaceChildren(style, figure);
    this.style.setProperty("--aspect", `${aspect}`);
    this.style.setProperty("--n", `${word.length || 1}`);
    const tell = (/** @type {number} */ done) => {
      caption.textContent = `The photograph is being made: ${Math.round(100 * done)} %`;
    };
    tell(0);
    const body = JSON.stringify({ visitor: "element", word, settings, aspect });
    const answer = await make("live", body, { signal, tell }).catch((error) => ({ error: { text: String(error) } }));
    if (signal.aborted) return;
    if (answer.error) {
      caption.textContent = `No photograph: ${answer.error.text}`;
    } else {
      plan.replaceWith(image);
      image.src = answer.photo;
      image.alt = `${word}, written with light in the dark`;
      const { verdict, flight_s } = answer;
      // A question mark stands for light that is no letter.
      const unsure = verdict && (verdict.read === word || !verdict.read || verdict.read.includes("?"));
      const misread = unsure ? "Most people could not read it." : `Most people would read ${verdict?.read}.`;
      const read = verdict && (verdict.legible ? `Reads as ${verdict.read}.` : misread);
      const link = document.createElement("a");
      const parts = { word, settings: JSON.stringify(settings), aspect: `${aspect}` };
      link.href = `${new URL("index.html", import.meta.url)}#${new URLSearchParams(parts)}`;
      link.textContent = "Change it";
      caption.replaceChildren(`${read ?? ""} The flight takes ${Math.round(flight_s)} seconds. `, link);
    }
    this.dispatchEvent(new CustomEvent("photograph", { detail: answer }));
  }
}

customElements.define("noctograph-photo", NoctographPhoto);

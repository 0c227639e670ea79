// Helper functions for the document.

/**
 * Returns the element with an id.
 * @param {string} id
 * @returns {HTMLElement}
 */
export function byId(id) {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no element #${id}`);
  return found;
}

/**
 * Creates an element with properties, attributes (those with a dash, and `role`) and children.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} name
 * @param {Record<string, unknown>} [given]
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(name, given = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(given)) {
    if (key in element && !key.includes("-")) Reflect.set(element, key, value);
    else if (value !== undefined) element.setAttribute(key, `${value}`);
  }
  element.append(...children);
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/**
 * Creates an SVG element with attributes.
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} name
 * @param {Record<string, string | number>} [attributes]
 * @returns {SVGElementTagNameMap[K]}
 */
export function draw(name, attributes = {}) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, `${value}`);
  return element;
}

// Paths of icons, which are stroked in a square of 24 units.
const ICONS = {
  play: "M8 5.5v13l11-6.5z",
  pause: "M8.5 6v12M15.5 6v12",
  pen: "M4 18c3-7 5-11 7-11s0 9 3 9 3-5 6-5",
  undo: "M9 6 4.5 10.5 9 15M5 10.5h9a5 5 0 0 1 0 10h-3",
  redo: "m15 6 4.5 4.5L15 15m4-4.5h-9a5 5 0 0 0 0 10h3",
  rub: "m4 14 9-9 7 7-8 8H9zM8.5 9.5l7 7M12 20h8",
  paint:
    "M12 3.5c3.5 4.2 5.5 7.2 5.5 10a5.5 5.5 0 0 1-11 0c0-2.8 2-5.800 5.5-10zM12 16.5a2.5 2.5 0 0 0 2.5-2.5",
  move: "M12 3v18M3 12h18M9.5 5.5 12 3l2.5 2.5m-5 13L12 21l2.5-2.5m-9-9L3 12l2.5 2.5m13-5L21 12l-2.5 2.5",
  close: "m6 6 12 12M18 6 6 18",
  keys: "M3 7h18v10H3zM7 11h.01M11 11h.01M15 11h.01M8 14h8",
};

/**
 * @param {string} name
 * @returns {SVGSVGElement}
 */
export function icon(name) {
  const turns = name === "undo" || name === "redo" ? " turns" : "";
  const box = draw("svg", { class: `icon${turns}`, viewBox: "0 0 24 24", "aria-hidden": "true" });
  box.append(draw("path", { d: ICONS[/** @type {keyof typeof ICONS} */ (name)] }));
  return box;
}

/** Puts icons into the elements that name one, before their text. */
export function putIcons(root = document) {
  for (const element of root.querySelectorAll("[data-icon]")) {
    const name = element.getAttribute("data-icon") ?? "";
    if (element.querySelector(".icon")?.getAttribute("data-name") === name) continue;
    element.querySelector(".icon")?.remove();
    const drawn = icon(name);
    drawn.setAttribute("data-name", name);
    element.prepend(drawn);
  }
}

/**
 * Loads a style sheet. The promise is fulfilled when it is loaded, or cannot be loaded.
 * @param {string} href
 * @returns {Promise<void>}
 */
export function style(href) {
  if (document.querySelector(`link[href="${href}"]`)) return Promise.resolve();
  const link = make("link", { rel: "stylesheet", href });
  document.head.append(link);
  return new Promise((done) => {
    link.onload = link.onerror = () => done();
  });
}

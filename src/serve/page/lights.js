// The choice of the light's color, which the arrow keys change.

import { make } from "./dom.js";
import { change, state } from "./state.js";
import { t } from "./words.js";
import { about } from "./wish.js";

/** Colors that a visitor is offered. The host is offered all colors. */
const FEW = ["white", "red", "orange", "green"];

/** Returns the names of the offered colors. */
export const offered = () =>
  about.colors
    .map(({ name }) => name)
    .filter((name) => (state.lamp && !about.kiosk) || FEW.includes(name));

/** Colors of the lamp for a dark screen. The photograph shows the true colors. */
const SEEN = {
  white: "#fff1d8",
  red: "#ff3b30",
  orange: "#ff9a1f",
  yellow: "#ffdd33",
  green: "#35e04a",
  cyan: "#3adbe6",
  blue: "#4d78ff",
  magenta: "#f04ddb",
};

/** Returns the screen color for a color of the lamp. */
export const screen = (/** @type {string} */ name) =>
  SEEN[/** @type {keyof typeof SEEN} */ (name)] ?? "#fff1d8";

/** Shows the choice in an element. @param {Element} box @param {string} group */
export function putLights(box, group) {
  const choices = offered().map((name) => {
    const input = make("input", {
      type: "radio",
      name: `light-${group}`,
      value: name,
      checked: name === state.color,
      "aria-label": t(name),
    });
    input.onchange = () => change({ color: name, ...(group === "word" && { painted: [] }) });
    const dot = make("span");
    dot.style.setProperty("--c", screen(name));
    return make("label", { title: t(name) }, input, dot);
  });
  const had = box.contains(document.activeElement);
  box.replaceChildren(
    make("fieldset", {}, make("legend", { className: "sr" }, t("color")), ...choices),
  );
  if (had) /** @type {HTMLElement | null} */ (box.querySelector(":checked"))?.focus();
}

// The host's brand, with a title and a logo.

import { make } from "./dom.js";

/**
 * Shows the host's title or logo. Returns the host's name.
 * @param {About | null} about
 * @param {string} [of] name of the page
 */
export function putBrand(about, of) {
  const { title, logo } = about?.brand ?? { title: null, logo: false };
  const name = title ?? "Noctograph";
  document.title = of ? `${of}: ${name}` : name;
  document
    .querySelector(".brand")
    ?.replaceChildren(logo ? make("img", { src: "brand/logo.svg", alt: name }) : name);
  return name;
}

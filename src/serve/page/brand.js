// The maker's brand: title and logo.

import { make } from "./dom.js";

/**
 * Puts title and logo. Returns the maker's name.
 * @param {About | null} about
 * @param {string} [of] what the page is
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

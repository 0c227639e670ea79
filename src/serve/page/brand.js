// The maker's brand: title, logo and accent.

import { make } from "./dom.js";

/**
 * Puts title, logo and accent. Returns the maker's name.
 * @param {About | null} about
 * @param {string} [of] what the page is
 */
export function putBrand(about, of) {
  const { title, accent, logo } = about?.brand ?? { title: null, accent: null, logo: false };
  const name = title ?? "Noctograph";
  document.title = of ? `${of}: ${name}` : name;
  document
    .querySelector(".brand")
    ?.replaceChildren(logo ? make("img", { src: "brand/logo.svg", alt: name }) : name);
  // The program has checked that it can be read on the night.
  if (accent) document.documentElement.style.setProperty("--accent", accent);
  return name;
}

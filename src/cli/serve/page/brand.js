// The maker's brand: title, logo and accent.

import { make } from "./dom.js";

/** Puts title, logo and accent. Returns the maker's name. @param {About | null} about @param {string} [of] what the page is */
export function putBrand(about, of) {
  const { title, accent, logo } = about?.brand ?? { title: null, accent: null, logo: false };
  const name = title ?? "Noctograph";
  document.title = of ? `${of}: ${name}` : name;
  document.querySelector(".brand")?.replaceChildren(logo ? make("img", { src: "brand/logo.svg", alt: name }) : name);
  if (accent) putAccent(accent);
  return name;
}

/** The maker's color, where it can be read on the night. @param {string} color */
function putAccent(color) {
  const parts = /^#([0-9a-f]{2})([0-9a-f]{2})([0-9a-f]{2})$/i.exec(color)?.slice(1).map((part) => parseInt(part, 16) / 255);
  if (!parts) return;
  const [r, g, b] = parts.map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
  const contrast = (0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05) / 0.0534;
  if (contrast >= 4.5) document.documentElement.style.setProperty("--accent", color);
}

// Downloads. A refused download yields a sentence instead of a file.

import { post, Refused, request } from "./ask.js";
import { make } from "./dom.js";
import { sentence } from "./words.js";

/** Returns the sentences about a refusal. @param {Said} said */
export const refusal = (said) =>
  [
    sentence("errors", said),
    ...(said.values?.stops ?? []).map((/** @type {Said} */ stop) => sentence("stops", stop)),
  ].join(" ");

/** Saves the file at a route. @param {string} route @param {string} name */
export async function save(route, name) {
  const response = await request(route);
  if (!response.ok)
    throw new Refused(
      (await response.json().catch(() => null))?.error ?? { key: "not-possible", text: "" },
      response.status,
    );
  put(await response.blob(), name);
}

/**
 * Makes and saves a file of a large photograph. With a scene, the drawing that it names is also saved.
 * @param {Large} large @param {string} name
 */
export async function saveOf(large, name) {
  if (!large.files[name]) {
    const made =
      name === "flight.zip" ? await post("script", large.wish) : await post("photos", { ...large.wish, files: true });
    if (made.error) throw new Refused(made.error);
    Object.assign(large.files, made.files);
  }
  const drawing = Object.keys(large.files).filter((known) => name === "scene.toml" && known.startsWith("drawing."));
  for (const file of [name, ...drawing])
    put(new Blob([Uint8Array.from(atob(large.files[file]), (sign) => sign.charCodeAt(0))]), file);
}

/** @param {Blob} blob @param {string} name */
function put(blob, name) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

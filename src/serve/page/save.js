// Downloads that may be refused: a refusal is a sentence, no file.

import { Refused, request } from "./ask.js";
import { make } from "./dom.js";

/** Saves what a route gives. @param {string} route @param {string} name */
export async function save(route, name) {
  const response = await request(route);
  if (!response.ok)
    throw new Refused(
      (await response.json().catch(() => null))?.error ?? { key: "not-possible", text: "" },
      response.status,
    );
  const link = make("a", { href: URL.createObjectURL(await response.blob()), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

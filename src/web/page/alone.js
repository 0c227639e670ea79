// The page without a server: what `noctograph serve` answers elsewhere, a worker makes here.

import { answeredBy } from "./ask.js";
import { byId } from "./dom.js";
import { openLink } from "./link.js";
import { make } from "./maker.js";
import { preferred, speak, t } from "./words.js";

/** Large photographs whose files can be saved, by their ids: what was asked, and its files. */
const kept = /** @type {Map<string, { body: string, files: Record<string, string> }>} */ (new Map());
const MOST_KEPT = 3;
const TYPES = { png: "image/png", toml: "application/toml", csv: "text/csv", zip: "application/zip" };

/** @param {number} done */
function tell(done) {
  const stage = /** @type {HTMLElement} */ (document.querySelector(".stage"));
  stage.style.setProperty("--done", `${done % 1}`);
}

/** @param {string} route @param {RequestInit} init */
async function answer(route, { body, signal } = {}) {
  const text = typeof body === "string" ? body : "";
  const made = make(route, text, { signal: signal ?? undefined, tell }).catch((error) => {
    if (signal?.aborted) throw error;
    // Without the module there is no page; what is missing on the way may come.
    if (route === "about" && `${error}`.includes("CompileError")) tooOld();
    if (route === "about") throw error;
    return { error: { key: "broken", text: `${error}` } };
  });
  const answer = await made.finally(() => tell(0));
  if (!answer.files) return Response.json(answer);
  const { files, ...rest } = answer;
  kept.set(rest.id, { body: text, files });
  for (const id of [...kept.keys()].slice(0, -MOST_KEPT)) kept.delete(id);
  return Response.json(rest);
}

/** Says that this browser cannot run the module. */
async function tooOld() {
  await speak(preferred("")).catch(() => {});
  byId("verdict").textContent = t("browser-old");
}

/** A file of a large photograph. @param {string} id @param {string} name */
async function file(id, name) {
  const photo = kept.get(id);
  if (!photo) return Response.json({ error: { key: "gone", text: "" } }, { status: 404 });
  if (name === "flight.zip" && !photo.files[name]) {
    const made = await make("script", photo.body);
    if (made.error) return Response.json(made, { status: 409 });
    Object.assign(photo.files, made.files);
  }
  const bytes = Uint8Array.from(atob(photo.files[name]), (sign) => sign.charCodeAt(0));
  const type = TYPES[/** @type {keyof typeof TYPES} */ (name.split(".").pop())];
  return new Response(bytes, { headers: { "Content-Type": type } });
}

answeredBy((route, init) => {
  const [, id, name] = route.split("/");
  return name ? file(id, name) : answer(route.replace(".json", ""), init);
});
document.documentElement.classList.add("alone");
openLink();
// Once seen, the page needs no network.
navigator.serviceWorker?.register("sw.js").catch(() => {});
await import("./main.js");

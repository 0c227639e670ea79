// Answers the page's requests in this browser.

import { answeredBy } from "./ask.js";
import { beginWith, make, prepare, ready } from "./maker.js";

/** Requests to a server that a page can answer itself. */
const MADE = ["live", "photos", "script"];

/** @param {number} done */
function tellStage(done) {
  const stage = /** @type {HTMLElement} */ (document.querySelector(".stage"));
  stage.style.setProperty("--done", `${done % 1}`);
}

/**
 * Answers a request like a server. Rejects if this browser cannot.
 * @param {string} kind @param {RequestInit} init
 */
async function answered(kind, { body, signal }) {
  const text = typeof body === "string" ? body : "";
  try {
    return Response.json(await make(kind, text, { signal: signal ?? undefined, tell: tellStage }));
  } catch (error) {
    if (signal?.aborted || /CompileError|DecompressionStream/.test(`${error}`) || kind === "about") throw error;
    return Response.json({ error: { key: "broken", text: `${error}` } });
  } finally {
    tellStage(0);
  }
}

/**
 * Makes the page's photographs here. Until the module is loaded, a server makes them. If this
 * browser cannot make them, `instead` answers from then on.
 * @param {string} scene the text of the scene from which the page starts
 * @param {(route: string, init: RequestInit) => Promise<Response>} instead
 */
export function makeHere(scene, instead) {
  if (scene) beginWith(scene);
  let can = true;
  try {
    // The module compiles in the background.
    prepare((share) => {
      // A page without a server reports this at its first request.
      if (share >= 0) tellStage(share);
      else can = !scene;
    });
  } catch {
    can = false;
  }
  answeredBy(async (route, init) => {
    const kind = route.replace(".json", "");
    if (scene && can && !ready()) return fetch(route, init);
    if (!can || !(MADE.includes(kind) || (kind === "about" && !scene))) return instead(route, init);
    try {
      return await answered(kind, init);
    } catch (error) {
      if (init.signal?.aborted) throw error;
      can = false;
      return instead(route, init);
    }
  });
}

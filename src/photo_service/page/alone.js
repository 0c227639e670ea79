// The page without a server, whose requests a worker answers in place of `noctograph serve`.

import { byId } from "./dom.js";
import { makeHere } from "./here.js";
import { openLink } from "./link.js";
import { preferred, speak, t } from "./words.js";

makeHere("", async () => {
  // The page cannot start without the module.
  await speak(preferred("")).catch(() => {});
  byId("verdict").textContent = t("browser-old");
  return new Promise(() => {});
});
document.documentElement.classList.add("alone");
openLink();
// After the first visit the page needs no network.
navigator.serviceWorker?.register("sw.js").catch(() => {});
await import("./main.js");

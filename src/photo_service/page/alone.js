// The page without a server: what `noctograph serve` answers elsewhere, a worker makes here.

import { byId } from "./dom.js";
import { makeHere } from "./here.js";
import { openLink } from "./link.js";
import { preferred, speak, t } from "./words.js";

makeHere("", async () => {
  // Without the module there is no page.
  await speak(preferred("")).catch(() => {});
  byId("verdict").textContent = t("browser-old");
  return new Promise(() => {});
});
document.documentElement.classList.add("alone");
openLink();
// Once seen, the page needs no network.
navigator.serviceWorker?.register("sw.js").catch(() => {});
await import("./main.js");

// Keeps the page for use without a network: all of its files, in the version that was built. An open
// page keeps its version to the end: the next one begins when the page is loaded again.

const VERSION = "@VERSION@";
const FILES = "@FILES@".split(" ");

addEventListener("install", (event) => {
  // Past the browser's cache, which may hold files of the version before.
  const all = FILES.map((file) => new Request(file, { cache: "reload" }));
  event.waitUntil(caches.open(VERSION).then((cache) => cache.addAll(all)));
});

addEventListener("activate", (event) => {
  const outdated = async () => {
    const names = (await caches.keys()).filter((name) => name.startsWith("noctograph-") && name !== VERSION);
    for (const name of names) await caches.delete(name);
    // The first page of all is of this version; any other one is served from when it is loaded again.
    if (!names.length) await clients.claim();
  };
  event.waitUntil(outdated());
});

addEventListener("message", ({ data }) => {
  if (data === "begin") skipWaiting();
});

addEventListener("fetch", (event) => {
  const asked = new URL(event.request.url);
  if (event.request.method !== "GET" || asked.origin !== location.origin) return;
  event.respondWith(answered(event.request));
});

/** @param {Request} request */
async function answered(request) {
  // The only open page is loaded again: the next version begins, and answers.
  if (request.mode === "navigate" && registration.waiting && (await clients.matchAll()).length < 2) {
    registration.waiting.postMessage("begin");
    return new Response("", { headers: { Refresh: "0" } });
  }
  const known = await caches.match(request, { ignoreSearch: true, cacheName: VERSION });
  return known ?? fetch(request);
}

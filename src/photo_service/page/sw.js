// Stores all files of the page in the version that was built, for use without a network. An open page
// keeps its version until it is loaded again.

const VERSION = "@VERSION@";
const FILES = "@FILES@".split(" ");

addEventListener("install", (event) => {
  // The browser's cache is bypassed, because it may contain files of the previous version.
  const all = FILES.map((file) => new Request(file, { cache: "reload" }));
  event.waitUntil(caches.open(VERSION).then((cache) => cache.addAll(all)));
});

addEventListener("activate", (event) => {
  const outdated = async () => {
    const names = (await caches.keys()).filter((name) => name.startsWith("noctograph-") && name !== VERSION);
    for (const name of names) await caches.delete(name);
    // The first page has this version. Any other page is served when it is loaded again.
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
  // If the only open page is loaded again, the next version takes over and answers.
  if (request.mode === "navigate" && registration.waiting && (await clients.matchAll()).length < 2) {
    registration.waiting.postMessage("begin");
    return new Response("", { headers: { Refresh: "0" } });
  }
  const known = await caches.match(request, { ignoreSearch: true, cacheName: VERSION });
  return known ?? fetch(request);
}

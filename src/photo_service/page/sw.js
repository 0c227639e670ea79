// Keeps the page for use without a network: all of its files, in the version that was built.

const VERSION = "@VERSION@";
const FILES = "@FILES@".split(" ");

addEventListener("install", (event) => {
  skipWaiting();
  event.waitUntil(caches.open(VERSION).then((cache) => cache.addAll(FILES)));
});

addEventListener("activate", (event) => {
  const outdated = async () => {
    for (const name of await caches.keys())
      if (name.startsWith("noctograph-") && name !== VERSION) await caches.delete(name);
    await clients.claim();
  };
  event.waitUntil(outdated());
});

addEventListener("fetch", (event) => {
  const asked = new URL(event.request.url);
  if (event.request.method !== "GET" || asked.origin !== location.origin) return;
  const known = caches.match(event.request, { ignoreSearch: true, cacheName: VERSION });
  event.respondWith(known.then((response) => response ?? fetch(event.request)));
});

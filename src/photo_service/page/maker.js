// Makes photographs in this browser with a worker, one after another.

/**
 * @typedef {object} Job
 * @property {string} kind "about", "live", "photos" or "script"
 * @property {string} body
 * @property {AbortSignal} [signal]
 * @property {(done: number) => void} [tell] receives the fraction that is done
 * @property {(answer: any) => void} resolve
 * @property {(error: unknown) => void} reject
 */
/** The text of the scene from which the page starts, or "" for the default. */
let base = "";
/** @type {Job[]} */
const waiting = [];
/** @type {Job | null} */
let running = null;
/** @type {Worker | null} */
let worker = null;
let isReady = false;
/** @type {(share: number) => void} */
let tellLoad = () => {};

/** The address of the worker. A page of another origin needs its own worker to load it. */
function source() {
  const url = new URL("worker.js", import.meta.url);
  if (url.origin === location.origin) return url;
  return URL.createObjectURL(new Blob([`import ${JSON.stringify(url)};`], { type: "text/javascript" }));
}

function start() {
  const started = new Worker(source(), { type: "module" });
  started.onmessage = ({ data: { loaded, done, answer, memory, broken } }) => {
    // A worker that was ended must not answer a new request.
    if (worker !== started) return;
    if (loaded !== undefined) {
      isReady = loaded === 2;
      return tellLoad(isReady ? 0 : loaded);
    }
    if (done !== undefined) return running?.tell?.(done);
    // A faulty worker is replaced, because its memory may be corrupt.
    if (broken !== undefined) end();
    if (memory) document.documentElement.dataset.memory = memory;
    if (broken === undefined) running?.resolve(answer);
    else running?.reject(new Error(broken));
    running = null;
    next();
  };
  started.onerror = () => {
    tellLoad(-1);
    started.onmessage?.(new MessageEvent("message", { data: { broken: "no worker" } }));
  };
  if (base) started.postMessage({ kind: "base", body: base });
  return started;
}

function end() {
  worker?.terminate();
  worker = null;
}

function next() {
  if (running) return;
  running = waiting.shift() ?? null;
  if (!running) return;
  try {
    worker ??= start();
    worker.postMessage({ kind: running.kind, body: running.body });
  } catch (error) {
    // The browser cannot start a worker for this page.
    running.reject(error);
    running = null;
  }
}

/**
 * Loads and compiles the module before it is wanted.
 * @param {typeof tellLoad} tell receives the fraction that is loaded, 0 at the end, and -1 if it cannot be loaded
 */
export function prepare(tell) {
  tellLoad = tell;
  worker ??= start();
}

/** Returns true if the module can start immediately. */
export const ready = () => isReady;

/**
 * Makes a product. An abandoned request is not started. A running photograph of a keystroke is
 * finished, because it takes little time, and a larger job is ended.
 * @param {string} kind
 * @param {string} [body] a request as JSON
 * @param {{ signal?: AbortSignal, tell?: (done: number) => void }} [options]
 * @returns {Promise<any>}
 */
export function make(kind, body = "", { signal, tell } = {}) {
  return new Promise((resolve, reject) => {
    const job = { kind, body, signal, tell, resolve, reject };
    signal?.addEventListener("abort", () => {
      reject(signal.reason);
      if (waiting.includes(job)) waiting.splice(waiting.indexOf(job), 1);
      if (running !== job) return;
      job.tell = undefined;
      if (kind === "live") return;
      end();
      running = null;
      next();
    });
    waiting.push(job);
    next();
  });
}

/** Sets the scene from which the page starts, as the text of its file. @param {string} scene */
export function beginWith(scene) {
  base = scene;
  worker?.postMessage({ kind: "base", body: base });
}

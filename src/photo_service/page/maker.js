// Photographs that this browser makes itself: a worker makes them, one after another.

/**
 * @typedef {object} Job
 * @property {string} kind "about", "live", "photos" or "script"
 * @property {string} body
 * @property {AbortSignal} [signal]
 * @property {(done: number) => void} [tell] receives the share that is done
 * @property {(answer: any) => void} resolve
 * @property {(error: unknown) => void} reject
 */
/** The text of the scene that the page begins with; "": the default. */
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

/** The address of the worker. A page of another origin starts none from here, but its own that loads it. */
function source() {
  const url = new URL("worker.js", import.meta.url);
  if (url.origin === location.origin) return url;
  return URL.createObjectURL(new Blob([`import ${JSON.stringify(url)};`], { type: "text/javascript" }));
}

function start() {
  const started = new Worker(source(), { type: "module" });
  started.onmessage = ({ data: { loaded, done, answer, memory, broken } }) => {
    // One that was ended answers nothing that is asked now.
    if (worker !== started) return;
    if (loaded !== undefined) {
      isReady = loaded === 2;
      return tellLoad(isReady ? 0 : loaded);
    }
    if (done !== undefined) return running?.tell?.(done);
    // What a fault leaves behind in the module's memory is gone with its worker.
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
    // A browser that has no worker for this page.
    running.reject(error);
    running = null;
  }
}

/**
 * Loads and compiles the module before it is wanted.
 * @param {typeof tellLoad} tell receives the share that is loaded; 0 at the end, and -1 where it cannot be
 */
export function prepare(tell) {
  tellLoad = tell;
  worker ??= start();
}

/** Whether the module can begin at once. */
export const ready = () => isReady;

/**
 * Has something made. One that nobody wants any more is not begun; a photograph of a keystroke that
 * is being made is soon done, anything larger is ended.
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

/** Takes the scene that the page begins with, as the text of its file. @param {string} scene */
export function beginWith(scene) {
  base = scene;
  worker?.postMessage({ kind: "base", body: base });
}

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
// The module is compiled while the page loads.
/** @type {Worker | null} */
let worker = start();

function start() {
  const started = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
  started.onmessage = ({ data: { done, answer, memory, broken } }) => {
    if (done !== undefined) return running?.tell?.(done);
    // What a fault leaves behind in the module's memory is gone with its worker.
    if (broken !== undefined) end();
    if (memory) document.documentElement.dataset.memory = memory;
    if (broken === undefined) running?.resolve(answer);
    else running?.reject(new Error(broken));
    running = null;
    next();
  };
  started.onerror = () => started.onmessage?.(new MessageEvent("message", { data: { broken: "no worker" } }));
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
  worker ??= start();
  worker.postMessage({ kind: running.kind, body: running.body });
}

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

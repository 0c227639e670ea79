// Requests. Requests for photographs are numbered, so that answers cannot be confused. The newest
// request is repeated until it is answered, even if the connection is lost.

import { keep, state } from "./state.js";

/** Times after which a request is repeated, doubled with each try for slow answers. */
const LIVE_MS = 15_000;
const LARGE_MS = 90_000;
const LONGEST_PAUSE_MS = 10_000;

/** @type {(lost: boolean | "moved") => void} */
let tellLost = () => {};
/** True if the last request reached no server. */
let lost = false;
/** The newest request for a photograph. @type {{ number: number, ends: AbortController }} */
let newest = { number: 0, ends: new AbortController() };

/** Sets a function to call when the connection is lost or restored, or the address has become invalid. */
export function onLost(/** @type {(lost: boolean | "moved") => void} */ tell) {
  tellLost = tell;
}

/** Answers a request: by the server or, in a page without a server, by the page's own worker. */
let answers = (/** @type {string} */ route, /** @type {RequestInit} */ init) => fetch(route, init);

/** @param {typeof answers} other */
export function answeredBy(other) {
  answers = other;
}

/** Returns the answer to a request. @param {string} route @param {RequestInit} init */
export const request = (route, init = {}) => answers(route, init);

const setLost = (/** @type {boolean | "moved"} */ now) => {
  if (now !== lost) tellLost(now);
  lost = now === true;
};

/** @param {number} ms @param {AbortSignal} [signal] */
export const sleep = (ms, signal) =>
  new Promise((wake) => {
    const timer = setTimeout(wake, ms);
    signal?.addEventListener("abort", () => {
      clearTimeout(timer);
      wake(undefined);
    });
  });

/** Returns the pause in ms before the next try, which doubles up to 10 s. */
const pause = (/** @type {number} */ tries) =>
  Math.min(LONGEST_PAUSE_MS, 500 * 2 ** Math.min(tries, 6));

/** Error that is shown if the server's answer cannot be read. @type {Said} */
const UNKNOWN = { key: "not-possible", text: "this cannot be done" };

/** A refusal with its message. */
export class Refused extends Error {
  constructor(/** @type {Said} */ said, status = 0) {
    super(said.text);
    this.said = said;
    this.status = status;
  }
}

/**
 * Posts to a route, and returns the JSON of the answer.
 * @param {string} route @param {unknown} body @param {AbortSignal} [signal]
 */
export async function post(route, body, signal) {
  return told(
    await request(route, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
      signal,
    }),
  );
}

/** Gets the JSON of a route. */
export async function get(
  /** @type {string} */ route,
  /** @type {AbortSignal} */ signal = new AbortController().signal,
) {
  return told(await request(route, { signal, cache: "no-store" }));
}

/** @param {Response} response */
async function told(response) {
  setLost(false);
  const json = await response.json().catch(() => null);
  if (!response.ok)
    throw new Refused(
      json?.error ?? { ...UNKNOWN, key: response.status === 503 ? "busy" : UNKNOWN.key },
      response.status,
    );
  return json;
}

const next = () => {
  state.number = Math.max(state.number + 1, newest.number + 1);
  keep();
  return state.number;
};

/** Aborts the newest request, and returns a new one in its place. */
export function begin() {
  newest.ends.abort();
  newest = { number: next(), ends: new AbortController() };
  return newest;
}

/** Returns the newest request. It remains the same object when a repetition changes its number. */
export const current = () => newest;

/**
 * Requests a photograph until it is answered. Returns null if a newer request was begun.
 * @param {"live" | "photos"} route
 * @param {Record<string, unknown>} wish
 * @param {(busy: boolean) => void} tellBusy
 * @returns {Promise<any>} the answer, or `{ error: Said }`
 */
export async function ask(route, wish, tellBusy = () => {}) {
  const mine = newest;
  const { signal } = mine.ends;
  for (let tries = 0; mine === newest; tries += 1) {
    const ends = new AbortController();
    const end = () => ends.abort();
    signal.addEventListener("abort", end);
    const patience = (route === "live" ? LIVE_MS : LARGE_MS) * 2 ** Math.min(tries, 4);
    const timer = setTimeout(end, patience);
    try {
      const answer = await post(
        route,
        { ...wish, visitor: state.visitor, number: mine.number },
        ends.signal,
      );
      if (mine !== newest) return null;
      tellBusy(false);
      return answer;
    } catch (error) {
      if (mine !== newest) return null;
      if (error instanceof Refused && error.status !== 503) return { error: error.said };
      if (error instanceof Refused) tellBusy(true);
      else if (ends.signal.aborted) mine.number = next();
      else setLost(true);
      await sleep(pause(tries), signal);
    } finally {
      clearTimeout(timer);
      signal.removeEventListener("abort", end);
    }
  }
  return null;
}

/**
 * Waits repeatedly for a new revision or a restart of the server, and calls `tell` for each.
 * @param {(news: { revision: number, boot: string }, restarted: boolean) => void} tell
 */
export async function follow(tell) {
  let [revision, boot, tries] = [-1, "", 0];
  for (;;) {
    try {
      const news = await get(`news?seen=${revision}`, AbortSignal.timeout(40_000));
      const restarted = boot !== "" && news.boot !== boot;
      const changed = news.revision !== revision || restarted;
      [revision, boot, tries] = [news.revision, news.boot, 0];
      if (changed) tell(news, restarted);
      else await sleep(200);
    } catch (error) {
      if (error instanceof Refused) setLost(error.status === 403 ? "moved" : false);
      else setLost(true);
      await sleep(pause(tries));
      tries += 1;
    }
  }
}

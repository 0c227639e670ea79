// The state of an entry after it was sent, and the ways to take its photograph home.

import { get, post, Refused } from "./ask.js";
import { make } from "./dom.js";
import { change, state } from "./state.js";
import { become } from "./state-of.js";
import { t } from "./words.js";
import { about } from "./wish.js";

/** Returns the address of an entry's page, on the host of this page. */
export const entryPage = (/** @type {string} */ id) => new URL(`/e/${id}/`, location.href).href;

/** @typedef {ReturnType<typeof import("./replay.js").replay>} Strip */

/** @param {HTMLElement} box @param {() => void} another @param {Strip} strip */
export function showSent(box, another, strip) {
  const { sent } = state;
  if (!sent) return;
  const about_it = make("p", { role: "status" }),
    clock = make("p", { role: "timer" });
  // The image is created only when it is needed, because it is loaded as soon as it has an address.
  const code = () => make("img", {
    src: `entries/${sent.id}/qr.svg`,
    alt: t("code"),
    width: 144,
    height: 144,
  });
  const lead = make("p", {}, make("strong", {}, t("take-home")), make("br"), t("point-phone"));
  const home = about.network
    ? make("div", { className: "home" }, make("div", { className: "code" }, code()), lead)
    : make("p", { className: "home" }, t("no-phone"));
  const again = make("button", { type: "button", className: "second" }, t("another"));
  again.onclick = another;
  // A kiosk has no links. The visitor's phone opens the page by the code.
  const keep = make(
    "a",
    { className: "button first own", href: entryPage(sent.id), target: "_blank", rel: "noopener" },
    t("keep"),
  );
  const back = make("button", { type: "button", hidden: true }, t("take-back"));
  back.onclick = async () => {
    // The change that this request causes must not be shown.
    shown = "";
    const refused = await post(`entries/${sent.id}`, {
      do: "withdraw",
      visitor: state.visitor,
    }).catch((error) => error);
    if (refused instanceof Error) return showSent(box, another, strip);
    box.replaceChildren();
    change({ mode: "word", sent: null });
  };
  const row = make("div", { className: "row" }, ...(about.kiosk ? [] : [keep]), again, back);
  box.replaceChildren(
    make("h2", {}, sent.title === null ? t("sent-drawing") : t("sent", { title: sent.title })),
    about_it,
    clock,
    home,
    row,
  );
  follow(sent.id, (entry) => {
    become(entry, about_it, clock, strip);
    back.hidden = entry?.state !== "waiting";
  }, about_it);
}

let shown = "";

/**
 * Shows the state of an entry, now and after each change.
 * @param {string} id
 * @param {(entry: ForVisitor | null) => void} put
 * @param {HTMLElement} line
 */
async function follow(id, put, line) {
  shown = id;
  const tell = async () => {
    if (shown !== id || !line.isConnected) return removeEventListener("news", tell);
    const entry = await get(`entries/${id}`).catch((error) => error);
    if (shown !== id) return;
    if (entry instanceof Refused) line.textContent = t("entry-gone-why");
    // A lost connection is reported elsewhere.
    if (entry instanceof Error) return;
    put(entry);
  };
  addEventListener("news", tell);
  line.textContent = t("state-waiting");
  await tell();
}

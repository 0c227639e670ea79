// The state of an entry as its visitor reads it, with a countdown to take-off.

import { t } from "./words.js";

let timer = 0,
  /** Id of the entry in the air, as far as this page knows, or "". */
  flying = "";

/**
 * Shows the state of an entry. Before its flight, the time to take-off is counted down. During the
 * flight, the replay runs in real time, and a phone vibrates at the start.
 * @param {ForVisitor | null} entry @param {HTMLElement} line @param {HTMLElement} clock
 * @param {ReturnType<typeof import("./replay.js").replay>} strip
 */
export function become(entry, line, clock, strip) {
  const isAhead = entry !== null && ["waiting", "approved"].includes(entry.state);
  const place = isAhead && (entry.ahead ? t("ahead", { n: entry.ahead }) : t("ahead-none"));
  line.textContent = [t(`state-${entry?.state ?? "waiting"}`), place].filter(Boolean).join(" ");
  clearInterval(timer);
  const told = Date.now();
  const count = () => {
    const left = Math.ceil((isAhead ? entry.ahead_s : 0) - (Date.now() - told) / 1000);
    const time = `${Math.floor(left / 60)}:${`${left % 60}`.padStart(2, "0")}`;
    clock.textContent = left > 0 ? t("take-off-in", { time }) : "";
    if (left <= 0) clearInterval(timer);
  };
  timer = window.setInterval(count, 1000);
  count();
  const was = flying;
  flying = entry?.state === "flying" ? entry.id : "";
  if (!flying || !entry) return;
  if (was !== flying) navigator.vibrate?.(300);
  // After a restart, the server does not know the take-off time.
  if (was !== flying || entry.flown_s !== null)
    strip.run(1000 * entry.flight_s, Math.min(1, (entry.flown_s ?? 0) / entry.flight_s));
}

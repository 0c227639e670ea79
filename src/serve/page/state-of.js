// What becomes of an entry, as a visitor reads it.

import { t } from "./words.js";

/** @param {ForVisitor | null} entry */
export function becomes(entry) {
  if (!entry) return t("state-waiting");
  const parts = [t(`state-${entry.state}`)];
  if (entry.ahead !== undefined && ["waiting", "approved"].includes(entry.state)) {
    parts.push(entry.ahead ? t("ahead", { n: entry.ahead }) : t("ahead-none"));
    const minutes = Math.round((entry.ahead_s ?? 0) / 60);
    if (minutes) parts.push(t("in-minutes", { n: minutes }));
  }
  return parts.join(" ");
}

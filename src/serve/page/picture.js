// Selection of strokes from an opened file. The picture is shown with the corners of its paper and
// with its strokes. Touching a stroke or a color leaves it out or adds it again.

import { byId, draw, make } from "./dom.js";
import { touched } from "./edit.js";
import { screen } from "./lights.js";
import { change, state } from "./state.js";
import { t } from "./words.js";

/** Largest distance, in pixels, at which a finger touches a stroke. */
const REACH_PX = 24;
/** Screen colors of strokes for which the page offers no lamp color. */
const INKS = { purple: "#b98cff", pink: "#ff8ac4" };
/** Distance of corners that are set by hand from the picture's edges at first, as a fraction of its sides. */
const INSET = 0.1;

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const view = byId("picture");
const image = make("img", { alt: "" });
const table = draw("path", { class: "table" });
const svg = draw("svg", { role: "group" });
const handles = [0, 1, 2, 3].map((k) => make("button", { type: "button", className: "corner" }));
const box = make("div", { className: "sheet" }, image, svg, ...handles);
const note = make("p", {}),
  inks = make("div", { className: "inks", role: "group" }),
  set = make("button", { type: "button", className: "second" });
view.append(make("div", { className: "hold" }, box), note, set, inks);

/** @type {DrawnSource | null} */
let source = null;
/** Strokes of the file. @type {Stroke[]} */
let strokes = [];
/** Corners while one of them is being dragged. @type {Corners | null} */
let dragged = null;
/** @type {{ x: number, y: number, corner: [number, number] } | null} */
let grip = null;

const opened = () => /** @type {Opened} */ (state.opened);
const out = () => opened().out ?? [];
const corners = () => dragged ?? opened().corners ?? source?.corners ?? null;
/** Returns the width and the height of the picture, or of the drawing with a margin. */
function size() {
  const far = (/** @type {number} */ axis) =>
    1.05 *
    strokes.reduce((most, { points }) => points.reduce((m, p) => Math.max(m, p[axis]), most), 0);
  return opened().size ?? [far(0) || 16, far(1) || 9];
}

/** Shows the strokes of an opened file, and which of them are selected. */
export function putPicture(/** @type {DrawnSource | null} */ found) {
  if (found !== source || !svg.childElementCount) putStrokes(found);
  const [width, height] = size();
  const picture = opened().kind === "jpg" ? `data:image/jpeg;base64,${opened().text}` : "";
  image.hidden = !picture;
  if (picture && image.src !== picture) image.src = picture;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  box.style.setProperty("--shape", `${width / height}`);
  strokes.forEach(({ id, color }, i) => {
    svg.children[i + 1].setAttribute("aria-checked", `${!out().includes(id)}`);
    svg.children[i + 1].setAttribute("aria-label", t("stroke", { n: id, color: t(color) }));
  });
  svg.setAttribute("aria-label", t("strokes"));
  note.textContent = t(corners() ? "choose-picture" : "choose-strokes");
  putCorners();
  putInks();
}

function putStrokes(/** @type {DrawnSource | null} */ found) {
  source = found;
  strokes = (found?.strokes ?? []).map(({ color, at }, i) => ({
    id: i + 1,
    color: color ?? "mixed",
    points: Array.from({ length: at.length / 2 }, (_, k) => [at[2 * k], at[2 * k + 1], 0]),
  }));
  const line = (/** @type {Stroke} */ { id, color, points }) => {
    const path = draw("path", {
      d: `M${points.map(([x, y]) => `${x} ${y}`).join("L")}${points.length === 1 ? "l.01 0" : ""}`,
      role: "checkbox",
      "data-n": id,
      tabindex: id === 1 ? 0 : -1,
    });
    path.style.stroke = INKS[/** @type {keyof typeof INKS} */ (color)] ?? screen(color);
    return path;
  };
  svg.replaceChildren(table, ...strokes.map(line));
  const names = [...new Set(strokes.map(({ color }) => color))];
  inks.replaceChildren(
    ...names.map((name) => {
      const button = make("button", { type: "button", "data-ink": name }, make("i"), make("span"));
      if (name !== "mixed") button.style.setProperty("--c", name);
      button.onclick = () => {
        const drawn = button.getAttribute("aria-pressed") === "true";
        put(drawn ? of(name) : [], of(name));
      };
      return button;
    }),
  );
}

/** Returns the numbers of the strokes of a color. */
const of = (/** @type {string} */ name) =>
  strokes.filter(({ color }) => color === name).map(({ id }) => id);

/** Shows the handles, and darkens the picture outside the paper. */
function putCorners() {
  const [[width, height], now] = [size(), corners()];
  const path = now && `M${now.map(([x, y]) => `${x} ${y}`).join("L")}Z`;
  table.setAttribute("d", path ? `M0 0H${width}V${height}H0Z${path}` : "");
  handles.forEach((handle, k) => {
    handle.hidden = !now;
    handle.setAttribute("aria-label", t(`corner-${k}`));
    if (!now) return;
    handle.style.left = `${(100 * now[k][0]) / width}%`;
    handle.style.top = `${(100 * now[k][1]) / height}%`;
  });
}

/** Shows which colors are selected, and the button that switches between corners set by hand and detected ones. */
function putInks() {
  for (const button of inks.querySelectorAll("[data-ink]")) {
    const name = button.getAttribute("data-ink") ?? "";
    const drawn = of(name).map((id) => !out().includes(id));
    const all = drawn.every(Boolean) ? "true" : drawn.some(Boolean) ? "mixed" : "false";
    button.setAttribute("aria-pressed", all);
    /** @type {Element} */ (button.lastChild).textContent = t(name);
  }
  inks.setAttribute("aria-label", t("inks"));
  const { corners: own, size: sides } = opened();
  set.textContent = t(own ? "corners-find" : "corners-set");
  set.hidden = !sides;
  // The button keeps its place, so that the picture does not move while its corners are dragged.
  set.classList.toggle("idle", !own && corners() !== null);
}
set.onclick = () => {
  const { corners: own, size: sides } = opened();
  if (sides) putOwn(own ? null : whole(sides));
};

/** @param {[number, number]} sides @returns {Corners} */
function whole([width, height]) {
  const [left, top] = [INSET * width, INSET * height];
  const [right, bottom] = [width - left, height - top];
  return [[left, top], [right, top], [right, bottom], [left, bottom]]; // prettier-ignore
}

/** Leaves some strokes out, and adds others again. @param {number[]} leave @param {number[]} take */
function put(leave, take) {
  const kept = out().filter((id) => !take.includes(id));
  change({
    opened: { ...opened(), out: [...kept, ...leave].sort((a, b) => a - b), of: strokes.length },
  });
}
const toggle = (/** @type {number} */ id) => put(out().includes(id) ? [] : [id], [id]);

/** Sets the corners. The selection is cleared, because other corners yield other strokes. */
const putOwn = (/** @type {Corners | null} */ own) =>
  change({ opened: { ...opened(), corners: own ?? undefined, out: [] } });

svg.onclick = (event) => {
  const { target, detail, clientX, clientY } = event;
  const at = /** @type {SVGSVGElement} */ (svg).getScreenCTM()?.inverse() ?? new DOMMatrix();
  const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(at);
  // A click by the keyboard has no position and selects the focused stroke.
  const id = detail ? 0 : Number(/** @type {Element} */ (target).getAttribute("data-n"));
  const stroke = id || touched(strokes, x, y, REACH_PX * at.a)?.id;
  if (stroke) toggle(stroke);
};

svg.onkeydown = (event) => {
  const lines = /** @type {SVGElement[]} */ ([...svg.querySelectorAll("[data-n]")]);
  const now = lines.indexOf(/** @type {SVGElement} */ (document.activeElement));
  const [dx, dy] = ARROWS[/** @type {keyof typeof ARROWS} */ (event.key)] ?? [0, 0];
  if (now < 0 || !(dx || dy || event.key === " " || event.key === "Enter")) return;
  event.preventDefault();
  if (!(dx || dy)) return toggle(now + 1);
  const next = lines[(now + dx + dy + lines.length) % lines.length];
  for (const line of lines) line.setAttribute("tabindex", line === next ? "0" : "-1");
  next.focus();
};

/** Returns true if four corners form a convex quadrilateral in clockwise order. */
const isConvex = (/** @type {Corners} */ of) =>
  of.every(([x, y], k) => {
    const [[ax, ay], [bx, by]] = [of[(k + 1) % 4], of[(k + 2) % 4]];
    return (ax - x) * (by - ay) - (ay - y) * (bx - ax) > 1;
  });

/** Moves a corner within the picture, if the four corners still form a sheet. */
function moved(/** @type {number} */ k, /** @type {number} */ x, /** @type {number} */ y) {
  const [width, height] = size();
  const inside = (/** @type {number} */ value, /** @type {number} */ most) =>
    Math.round(Math.min(most, Math.max(0, value)));
  const now = /** @type {Corners} */ (corners()).map((corner) => [...corner]);
  now[k] = [inside(x, width), inside(y, height)];
  if (isConvex(/** @type {Corners} */ (now))) dragged = /** @type {Corners} */ (now);
}

/** Makes the dragged corners those of the paper. */
function settle() {
  const own = dragged;
  [dragged, grip] = [null, null];
  if (own) putOwn(own);
}

handles.forEach((handle, k) => {
  handle.onpointerdown = (event) => {
    const now = corners();
    if (event.button > 0 || grip || !now) return;
    handle.setPointerCapture(event.pointerId);
    grip = { x: event.clientX, y: event.clientY, corner: now[k] };
  };
  handle.onpointermove = (event) => {
    if (!grip || !handle.hasPointerCapture(event.pointerId)) return;
    const scale = size()[0] / box.clientWidth;
    const [dx, dy] = [event.clientX - grip.x, event.clientY - grip.y];
    moved(k, grip.corner[0] + scale * dx, grip.corner[1] + scale * dy);
    putCorners();
  };
  handle.onlostpointercapture = settle;
  handle.onkeydown = (event) => {
    const arrow = ARROWS[/** @type {keyof typeof ARROWS} */ (event.key)];
    const now = corners();
    if (!arrow || !now) return;
    event.preventDefault();
    const step = event.shiftKey ? 1 : Math.max(...size()) / 100;
    moved(k, now[k][0] + step * arrow[0], now[k][1] + step * arrow[1]);
    settle();
  };
});

// The pad lies over the photograph. One pointer draws, a tap makes a dot, and a finished stroke is photographed.

import { byId, draw, make } from "./dom.js";
import { screen } from "./lights.js";
import {
  bounds,
  canRedo,
  canUndo,
  moved,
  painted,
  redone,
  touched,
  undone,
  withStroke,
  without,
} from "./edit.js";
import { seen, shape } from "./sketch.js";
import { change, state } from "./state.js";
import { t } from "./words.js";

/** Height of the page in its units. Its width follows from the aspect of the screen. */
const HIGH = 1000;
/** Distance in pixels below which a pointer makes a dot. */
const DOT_PX = 6;
/** Largest distance, in pixels, at which a finger touches a stroke. */
const REACH_PX = 24;
/** A step of the arrow keys, in units of the page. */
const STEP = 25;

const page = byId("page");
const pad = /** @type {SVGSVGElement} */ (/** @type {unknown} */ (byId("pad")));
const ink = draw("g", { class: "ink" }),
  frame = draw("g", { class: "handles" }),
  cursor = draw("path", { class: "cursor", d: "M-14 0H14M0-14V14" });
const said = make("p", { className: "sr", role: "status" });
pad.append(ink, frame, cursor);
page.append(said);

/** @typedef {"draw" | "rub" | "paint" | "move"} Tool */
/** @type {Tool} */
let tool = "draw";
/** Ids of the strokes that the photograph on the stage shows. @type {Set<number>} */
let lit = new Set();
/**
 * The pointer that draws. Further pointers are palms, and are ignored.
 * @typedef {object} Finger
 * @property {number} id
 * @property {DOMMatrix} at transform from the screen to the page when the finger came down
 * @property {Stroke["points"]} points
 * @property {SVGPathElement} path
 * @property {number} x position where it came down, in pixels
 * @property {number} y
 * @property {boolean} dot whether it has not moved yet
 */
/** @type {Finger | null} */
let finger = null;
/**
 * State of a movement of the drawing.
 * @typedef {object} Grip
 * @property {Map<number, DOMPoint>} pointers positions of one or two pointers
 * @property {DOMMatrix} at
 * @property {DOMPoint | null} pinned the corner opposite to a handle
 * @property {{ center: DOMPoint, size: number }} from center and size at the beginning
 * @property {(x: number, y: number) => [number, number]} moves
 */
/** @type {Grip | null} */
let grip = null;
/** Pen that is moved by the keyboard. @type {{ x: number, y: number, points: Stroke["points"] | null }} */
let pen = { x: 0, y: 0, points: null };

const path = (/** @type {Stroke["points"]} */ points) =>
  `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}${points.length === 1 ? "l.01 0" : ""}`;

/** Opens the pad. An empty page takes the aspect of its area on the screen. */
export function openPad() {
  if (!seen(state.sketch).length) {
    const area = /** @type {HTMLElement} */ (page.parentElement);
    const style = getComputedStyle(page);
    const [wide, high] = [
      area.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight),
      area.clientHeight - parseFloat(style.paddingTop) - parseFloat(style.paddingBottom),
    ];
    const ratio = Math.min(2.4, Math.max(0.5, wide / Math.max(1, high)));
    state.sketch.page = [Math.round(ratio * HIGH), HIGH];
  }
  putShape();
  [pen.x, pen.y] = state.sketch.page.map((side) => side / 2);
  putInk();
}

/** Shows the sketch as it is now. */
export function putSketch() {
  putShape();
  putInk();
}

function putShape() {
  const [width, height] = state.sketch.page;
  pad.setAttribute("viewBox", `0 0 ${width || 16} ${height || 9}`);
  /** @type {HTMLElement} */ (page.parentElement).style.setProperty(
    "--page",
    `${shape(state.sketch)}`,
  );
}

/** Sets the strokes that the photograph on the stage shows, which are no longer drawn as lines. */
export function putLit(/** @type {Stroke[]} */ strokes) {
  lit = new Set(strokes.map((stroke) => stroke.id));
  putInk();
}

/** Draws the strokes, the handles and the cursor. */
function putInk() {
  const strokes = seen(state.sketch);
  const known = new Map([...ink.children].map((line) => [line.getAttribute("data-id"), line]));
  ink.replaceChildren(
    ...strokes.map((stroke) => {
      const line =
        known.get(`${stroke.id}`) ?? draw("path", { d: path(stroke.points), "data-id": stroke.id });
      line.setAttribute("class", lit.has(stroke.id) ? "taken lit" : "taken");
      /** @type {SVGElement} */ (line).style.stroke = screen(stroke.color);
      return line;
    }),
    ...(finger && tool === "draw" ? [finger.path] : []),
  );
  putHandles();
  pad.classList.toggle("keys", byKeys && document.activeElement === pad);
  cursor.setAttribute("transform", `translate(${pen.x} ${pen.y})`);
  pad.setAttribute("data-tool", tool);
  pad.setAttribute("aria-label", `${t("pad")} ${t("pad-strokes", { n: strokes.length })}`);
  byId("hint").classList.toggle("used", strokes.length > 0 || finger !== null);
  for (const [id, on] of /** @type {[string, boolean][]} */ ([
    ["undo", canUndo(state.sketch)],
    ["redo", canRedo(state.sketch)],
  ]))
    byId(id).setAttribute("aria-disabled", `${!on}`);
  for (const name of ["rub", "paint", "move"])
    byId(name).setAttribute("aria-pressed", `${tool === name}`);
}

/** Draws a box around the drawing, with a handle at each corner, while the drawing can be moved. */
function putHandles() {
  const box = tool === "move" ? bounds(seen(state.sketch)) : null;
  frame.replaceChildren();
  if (!box) return;
  const { left, top, right, bottom } = box;
  frame.append(
    draw("rect", {
      x: left - 20,
      y: top - 20,
      width: right - left + 40,
      height: bottom - top + 40,
    }),
  );
  for (const [x, y] of [
    [left, top],
    [right, top],
    [left, bottom],
    [right, bottom],
  ]) {
    const [cx, cy] = [x + (x === left ? -20 : 20), y + (y === top ? -20 : 20)];
    const handle = draw("circle", {
      cx,
      cy,
      r: 14,
      "data-x": left + right - x,
      "data-y": top + bottom - y,
    });
    // The area that a finger can touch is larger than the visible handle.
    const target = draw("circle", {
      cx,
      cy,
      r: 44,
      class: "target",
      "data-x": left + right - x,
      "data-y": top + bottom - y,
    });
    frame.append(handle, target);
  }
}

/**
 * Returns a pointer's position on the page, by the transform when the finger came down.
 * @param {{ clientX: number, clientY: number }} event
 * @param {DOMMatrix} at
 */
const place = (event, at) => new DOMPoint(event.clientX, event.clientY).matrixTransform(at);
const matrix = () => /** @type {DOMMatrix} */ (pad.getScreenCTM()).inverse();
const inside = (/** @type {number} */ value, /** @type {number} */ axis) =>
  Math.min(state.sketch.page[axis], Math.max(0, value));

pad.onpointerdown = (event) => {
  if (event.button > 0 && event.pointerType === "mouse") return;
  event.preventDefault();
  pad.focus({ preventScroll: true });
  if (tool === "move") return take(event);
  if (finger) return;
  const at = matrix(),
    { x, y } = place(event, at);
  // The other end of a pen erases.
  const rubs = tool === "rub" || (event.pointerType === "pen" && (event.buttons & 32) > 0);
  pad.setPointerCapture(event.pointerId);
  finger = {
    id: event.pointerId,
    at,
    points: [[inside(x, 0), inside(y, 1), event.timeStamp / 1000]],
    path: draw("path", { class: "finger" }),
    x: event.clientX,
    y: event.clientY,
    dot: true,
  };
  if (rubs || tool === "paint") return touch(event, rubs);
  finger.path.setAttribute("d", path(finger.points));
  putInk();
};

pad.onpointermove = (event) => {
  if (tool === "move") return pull(event);
  if (!finger || event.pointerId !== finger.id) return;
  if (tool !== "draw") return touch(event, tool === "rub");
  const parts = event.getCoalescedEvents?.() ?? [];
  for (const part of parts.length ? parts : [event]) {
    const { x, y } = place(part, finger.at),
      last = finger.points[finger.points.length - 1];
    if (Math.hypot(part.clientX - finger.x, part.clientY - finger.y) >= DOT_PX) finger.dot = false;
    if (Math.hypot(x - last[0], y - last[1]) < 0.5) continue;
    finger.points.push([inside(x, 0), inside(y, 1), Math.max(last[2], part.timeStamp / 1000)]);
  }
  finger.path.setAttribute("d", path(finger.dot ? finger.points.slice(0, 1) : finger.points));
};

pad.onpointerup =
  pad.onpointercancel =
  pad.onlostpointercapture =
    (event) => {
      if (tool === "move") return leave(event);
      if (!finger || event.pointerId !== finger.id) return;
      const { points, dot, path: line } = finger;
      finger = null;
      line.remove();
      if (tool !== "draw") return;
      change({ sketch: withStroke(state.sketch, dot ? points.slice(0, 1) : points, state.color) });
    };

/**
 * Erases or paints the stroke under a pointer.
 * @param {PointerEvent} event
 * @param {boolean} rubs
 */
function touch(event, rubs) {
  const { at } = /** @type {NonNullable<typeof finger>} */ (finger);
  const { x, y } = place(event, at);
  const stroke = touched(seen(state.sketch), x, y, REACH_PX * Math.abs(at.a));
  if (!stroke || (!rubs && stroke.color === state.color)) return;
  change({
    sketch: rubs ? without(state.sketch, stroke) : painted(state.sketch, stroke, state.color),
  });
}

/* Moving and resizing: one finger moves the drawing, and a handle or two fingers resize it. */

/** @param {PointerEvent} event */
function take(event) {
  if (!bounds(seen(state.sketch))) return;
  const at = grip?.at ?? matrix();
  const handle = /** @type {Element} */ (event.target);
  const pinned = handle.hasAttribute("data-x")
    ? new DOMPoint(Number(handle.getAttribute("data-x")), Number(handle.getAttribute("data-y")))
    : null;
  pad.setPointerCapture(event.pointerId);
  settle();
  grip = {
    pointers: new Map(grip?.pointers ?? []),
    at,
    pinned: grip ? null : pinned,
    from: { center: new DOMPoint(), size: 1 },
    moves: (x, y) => [x, y],
  };
  if (grip.pointers.size < 2) grip.pointers.set(event.pointerId, place(event, at));
  grip.from = held(grip);
}

/**
 * Returns the center of the points that hold the drawing, and their distance.
 * @param {NonNullable<typeof grip>} of
 */
function held({ pointers, pinned }) {
  const points = [...pointers.values(), ...(pinned ? [pinned] : [])];
  const [first, second] = [points[0], points[1] ?? points[0]];
  const center = pinned ?? new DOMPoint((first.x + second.x) / 2, (first.y + second.y) / 2);
  return { center, size: Math.max(1, Math.hypot(first.x - second.x, first.y - second.y)) };
}

/** @param {PointerEvent} event */
function pull(event) {
  if (!grip?.pointers.has(event.pointerId)) return;
  grip.pointers.set(event.pointerId, place(event, grip.at));
  const { from } = grip,
    { center, size } = held(grip);
  grip.moves = kept(
    size / from.size,
    [from.center.x, from.center.y],
    [center.x - from.center.x, center.y - from.center.y],
  );
  const [[ax, ay], [bx]] = [grip.moves(0, 0), grip.moves(1, 0)];
  for (const layer of [ink, frame])
    layer.setAttribute("transform", `translate(${ax} ${ay}) scale(${bx - ax})`);
  pad.classList.add("moving");
}

/** @param {PointerEvent} event */
function leave(event) {
  if (!grip?.pointers.delete(event.pointerId)) return;
  settle();
  if (!grip.pointers.size) grip = null;
  else grip = { ...grip, pinned: null, from: held(grip), moves: (x, y) => [x, y] };
}

/** Applies the movement to the drawing. */
function settle() {
  for (const layer of [ink, frame]) layer.removeAttribute("transform");
  pad.classList.remove("moving");
  if (!grip) return;
  const { moves } = grip;
  const [[ax, ay], [bx]] = [moves(0, 0), moves(1, 0)];
  if (Math.abs(ax) + Math.abs(ay) + Math.abs(bx - ax - 1) > 1e-6)
    change({ sketch: moved(state.sketch, moves) });
}

/**
 * Returns a scaling about a point and a shift, limited so that the drawing stays on the page and is large enough to be held.
 * @param {number} wanted @param {[number, number]} about @param {[number, number]} by
 * @returns {(x: number, y: number) => [number, number]}
 */
function kept(wanted, about, by) {
  const box = bounds(seen(state.sketch));
  if (!box) return (x, y) => [x, y];
  const [width, height] = state.sketch.page;
  const [wide, high] = [Math.max(1, box.right - box.left), Math.max(1, box.bottom - box.top)];
  const scale = Math.min(
    Math.max(wanted, Math.min(1, 60 / Math.max(wide, high))),
    width / wide,
    height / high,
  );
  const shifts = [0, 1].map((axis) => {
    const near = axis ? box.top : box.left,
      far = axis ? box.bottom : box.right;
    const shift = about[axis] * (1 - scale) + by[axis];
    return Math.min(state.sketch.page[axis] - scale * far, Math.max(-scale * near, shift));
  });
  return (x, y) => [scale * x + shifts[0], scale * y + shifts[1]];
}

pad.onwheel = (event) => {
  const box = tool === "move" && bounds(seen(state.sketch));
  if (!box) return;
  event.preventDefault();
  resize(event.deltaY < 0 ? 1.05 : 1 / 1.05);
};

function resize(/** @type {number} */ by) {
  const box = bounds(seen(state.sketch));
  if (box)
    change({
      sketch: moved(
        state.sketch,
        kept(by, [(box.left + box.right) / 2, (box.top + box.bottom) / 2], [0, 0]),
      ),
    });
}

/* The keyboard: arrow keys move the pen, and Space puts it down and lifts it. */

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

pad.onkeydown = (event) => {
  const arrow = ARROWS[/** @type {keyof typeof ARROWS} */ (event.key)];
  if (!arrow && ![" ", "Escape", "+", "-"].includes(event.key)) return;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  if (tool === "move") {
    const step = event.shiftKey ? 5 : STEP;
    if (arrow)
      change({ sketch: moved(state.sketch, kept(1, [0, 0], [arrow[0] * step, arrow[1] * step])) });
    if (event.key === "+" || event.key === "-") resize(event.key === "+" ? 1.1 : 1 / 1.1);
    if (event.key === "Escape") setTool("draw");
    return;
  }
  if (arrow) {
    const step = event.shiftKey ? 5 : STEP;
    [pen.x, pen.y] = [inside(pen.x + arrow[0] * step, 0), inside(pen.y + arrow[1] * step, 1)];
    pen.points?.push([pen.x, pen.y, event.timeStamp / 1000]);
  } else if (event.key === " ") {
    space(event.timeStamp / 1000);
  } else if (event.key === "Escape") {
    pen.points = null;
  }
  putPen();
};

function space(/** @type {number} */ time_s) {
  const near = tool === "draw" ? null : touched(seen(state.sketch), pen.x, pen.y, 60);
  if (near && tool === "rub") change({ sketch: without(state.sketch, near) });
  else if (near) change({ sketch: painted(state.sketch, near, state.color) });
  if (tool !== "draw") return;
  if (!pen.points) {
    pen.points = [[pen.x, pen.y, time_s]];
    said.textContent = t("pen-down");
  } else {
    const points = pen.points;
    pen.points = null;
    said.textContent = t("pen-up");
    change({ sketch: withStroke(state.sketch, points, state.color) });
  }
}

function putPen() {
  putInk();
  if (pen.points) ink.append(draw("path", { class: "finger", d: path(pen.points) }));
}
pad.addEventListener("focus", putInk);
pad.addEventListener("blur", putInk);

// The cursor is visible while the keyboard is used.
let byKeys = false;
addEventListener(
  "keydown",
  () => {
    byKeys = true;
  },
  { capture: true },
);
addEventListener(
  "pointerdown",
  () => {
    byKeys = false;
  },
  { capture: true },
);

/* Tools. */

export function setTool(/** @type {Tool} */ name) {
  settle();
  [grip, finger] = [null, null];
  tool = name;
  putInk();
}

for (const name of /** @type {Tool[]} */ (["rub", "paint", "move"]))
  byId(name).onclick = () => setTool(tool === name ? "draw" : name);
byId("undo").onclick = () => {
  if (canUndo(state.sketch)) change({ sketch: undone(state.sketch) });
};
byId("redo").onclick = () => {
  if (canRedo(state.sketch)) change({ sketch: redone(state.sketch) });
};
addEventListener("keydown", (event) => {
  if (state.mode !== "pad" || !(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z")
    return;
  event.preventDefault();
  byId(event.shiftKey ? "redo" : "undo").click();
});

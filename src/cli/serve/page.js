"use strict";
const $ = selector => document.querySelector(selector);
const $$ = selector => [...document.querySelectorAll(selector)];
const VISITOR = Array.from(crypto.getRandomValues(new Uint32Array(4)), part => part.toString(16)).join("");
const COLORS = /*colors*/; // of the screen, and the bytes of the lamps that show them
const BODIES = { "a6400": "kit-16mm", "canon-eos-2000d": "28mm", "one-inch": "28mm" };
const LATER_MS = 700; // after which typing rests
const PEN_M_S = 0.2, BATTERY_S = 240;

let drawing = null; // {kind, text}: what was opened
let strokes = []; // what was drawn: [x, y, seconds]
let painted = []; // the color of each letter or stroke
let color = "white", before = "white"; // the color that is chosen, and the one chosen before it
let advised = {}; // settings that advice set
let seed = 0, number = 0, kept = null, timer = 0, newest = {};

/* Words of the page. A language is a column of words.json; a word that it lacks stays English. */
let language = WORDS[navigator.language.slice(0, 2)] ? navigator.language.slice(0, 2) : "en";
const english = {};
const t = (key, values = {}) => (WORDS[language]?.[key] ?? WORDS.en[key] ?? english[key] ?? key)
  .replace(/\{(\w+)\}/g, (_, name) => values[name]);
function speak() {
  document.documentElement.lang = language;
  for (const element of $$("[data-t]")) {
    english[element.dataset.t] ??= element.textContent;
    element.textContent = t(element.dataset.t);
  }
  for (const element of $$("[data-l]")) element.setAttribute("aria-label", t(element.dataset.l));
  paint();
}
for (const code of Object.keys(WORDS)) $("#language").add(new Option(WORDS[code].name, code));
$("#language").value = language;
$("#language").onchange = event => { language = event.target.value; speak(); };

/* What is wished. */
const inColor = () => $("#lamp").value !== "headlights";
const colorOf = i => painted[i] ?? color;
// White is the color LED deck's own, which has a die for it.
const isOwn = name => name === "white" && $("#lamp").value === "color-led";
// What has a color of its own: the letters of a word, or strokes. An SVG file has its colors.
function parts() {
  if (drawing) return [];
  return strokes.length ? strokes.map((_, i) => `${i + 1}`) : [...$("#word").value.replace(/\s/g, "")];
}
function subject() {
  if (drawing) return { drawing };
  if (!strokes.length) return { word: $("#word").value.trim() };
  const rgb = name => isOwn(name) ? [0, 0, 0] : COLORS[name].screen;
  const colors = inColor() ? { colors: strokes.map((_, i) => rgb(colorOf(i))) } : {};
  return { drawing: { kind: "json", text: JSON.stringify({ strokes, y: "down", ...colors }) } };
}
function settings() {
  const set = { ...advised };
  for (const input of $$("[data-key]")) {
    if (input.value !== input.dataset.first) set[input.dataset.key] = input.value;
  }
  if (seed) set.seed = `${seed}`;
  const height = +$("[data-key='letters.cap_height_m']").value;
  if (strokes.length || drawing) set["letters.canvas_m"] = JSON.stringify([6 * height, 2 * height]);
  if (strokes.length || drawing?.kind === "json") set["letters.pace"] = $("#pace").checked ? "written" : "even";
  const lamp = $("#lamp").value, body = $("#body").value;
  if (inColor()) {
    set["light.deck"] = lamp === "ring" ? "led-ring" : "color-led";
    set["plan.lights"] = JSON.stringify([lamp]);
    const wrgb = name => isOwn(name) ? [255, 0, 0, 0] : COLORS[name][lamp];
    if (subject().word) set["light.letters_wrgb"] = JSON.stringify(parts().map((_, i) => wrgb(colorOf(i))));
  }
  if (body) set["camera.body"] = body;
  if (BODIES[body]) set["camera.lens"] = BODIES[body];
  return set;
}
function wish() {
  const room = $("#room").value;
  return { visitor: VISITOR, ...subject(), settings: settings(), ...(room && { room }) };
}

/* Photos: a small one at once, a large one with advice when typing rests. */
const post = (route, body) =>
  fetch(route, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
async function ask(route, onEvent) {
  const response = await post(route, wish());
  if (response.status === 503) return onEvent({ busy: true });
  if (!response.ok) return onEvent({ error: await response.text(), hint: "" });
  onEvent(await response.json());
}
function change() {
  const mine = ++number;
  clearTimeout(timer);
  kept = null;
  $("#done").hidden = true;
  $("#advice").replaceChildren();
  const wanted = subject();
  if (!wanted.drawing && !wanted.word) return reset();
  $("#photo").classList.add("busy");
  const retry = route => () => { if (mine === number) timer = setTimeout(() => run(route), LATER_MS); };
  const run = route => ask(route, event => {
    if (mine !== number || event.stopped) return;
    if (event.busy) { $("#facts").textContent = t("busy"); return retry(route)(); }
    if (event.error) return fail(event);
    (route === "live" ? showLive : showLarge)(event);
    if (route === "live") timer = setTimeout(() => run("photos"), LATER_MS);
    else $("#photo").classList.remove("busy");
  }).catch(() => { if (mine === number) fail({ error: t("gone"), hint: "" }); });
  run("live");
}
function reset() {
  $("#photo img").removeAttribute("src");
  $("#photo").classList.remove("busy");
  for (const id of ["#verdict", "#letters", "#facts"]) $(id).replaceChildren();
  $("#verdict").className = "";
  $("#letters").hidden = false;
}
function fail({ error, hint }) {
  $("#photo").classList.remove("busy");
  $("#verdict").className = "bad";
  $("#verdict").textContent = error;
  $("#facts").textContent = hint;
  $("#letters").replaceChildren();
}
const title = () => subject().word || t("drawing");
function showVerdict(verdict) {
  const line = $("#verdict");
  line.className = verdict ? (verdict.legible ? "good" : "bad") : "";
  line.textContent = verdict
    ? t(verdict.legible ? "legible" : "illegible", { read: verdict.read.replace(/\n/g, " "), percent: Math.round(100 * verdict.readability) })
    : t("unjudged");
  $("#letters").hidden = !verdict;
  $("#letters").replaceChildren(...(verdict?.letters ?? []).map(({ expected, best, p }) => {
    const chip = document.createElement("li");
    const reads = best && best !== expected ? `${expected} → ${best}` : expected;
    chip.append(reads, Object.assign(document.createElement("small"), { textContent: p === null ? "–" : `${Math.round(100 * p)} %` }));
    if (best !== expected) chip.className = "bad";
    return chip;
  }));
}
function warn(texts) {
  for (const textContent of texts.filter(Boolean)) {
    $("#facts").append(" ", Object.assign(document.createElement("span"), { className: "stop", textContent }));
  }
}
function showLive({ photo, verdict, flight_s, obstacles }) {
  const img = $("#photo img");
  img.src = photo;
  img.alt = t("alt", { title: title() });
  showVerdict(verdict);
  $("#facts").textContent = t("facts", { seconds: Math.round(flight_s) });
  warn(obstacles);
  document.body.dataset.shown = title();
}
function showLarge(shot) {
  kept = shot.id;
  $("#photo img").src = `photos/${kept}/photo.png`;
  showVerdict(shot.word === undefined ? null : shot);
  warn([shot.stops && t("stops", shot)]);
  for (const link of $$("#done a")) link.href = `photos/${kept}/${link.download}`;
  $("#done").hidden = false;
  $("#advice").replaceChildren(...shot.remedies.map(({ change: text, gain, set }) => {
    const button = document.createElement("button");
    button.textContent = t("apply", { text, gain: Math.round(100 * gain) });
    button.onclick = () => {
      for (const { key, value } of set) {
        const input = $(`[data-key="${key}"]`);
        if (input) { input.value = value; label(input); }
        if (!input || input.value !== value) advised[key] = value;
      }
      change();
    };
    return button;
  }));
  $("#printed").textContent = [title(), $("#verdict").textContent, $("#facts").textContent,
    Object.entries(settings()).map(([key, value]) => `${key} = ${value}`).join(", "),
    `${new Date().toLocaleDateString(language)} · ${t("on-paper")}`].filter(Boolean).join("\n");
  document.body.dataset.kept = kept;
}

/* Controls. */
function label(input) {
  if (input.type !== "range") return;
  const value = input.previousElementSibling;
  value.textContent = `${input.value} ${input.dataset.unit ?? ""}`.trim();
  input.setAttribute("aria-valuetext", value.textContent);
}
for (const input of $$("[data-key]")) {
  const first = `${input.dataset.key.split(".").reduce((table, key) => table[key], SCENE)}`;
  if (input.options && ![...input.options].some(option => option.value === first)) input.add(new Option(first));
  input.value = first;
  input.dataset.first = input.value;
  label(input);
  input.oninput = () => { delete advised[input.dataset.key]; label(input); change(); };
}
for (const id of ["#lamp", "#room", "#body", "#pace"]) $(id).onchange = () => { paint(); change(); };
$("#controls").onsubmit = event => event.preventDefault();
$("#word").oninput = () => {
  if (strokes.length) painted = [];
  drawing = null;
  strokes = [];
  paint();
  change();
};
$("#again").onclick = () => { seed += 1; change(); };
$("#print").onclick = () => print();
$("#hang").onclick = async () => {
  await post("wall", { id: kept });
  openWall();
};
for (const element of $$(".home")) element.hidden = !HOME;
$("#network").hidden = HOME;

function paint() {
  $("#colors").hidden = !inColor();
  $("#swatches").replaceChildren(...Object.entries(COLORS).map(([name, { screen }]) => {
    const swatch = document.createElement("button");
    Object.assign(swatch, { type: "button", title: t(name) });
    swatch.style.background = `rgb(${screen})`;
    swatch.setAttribute("role", "radio");
    swatch.setAttribute("aria-label", t(name));
    swatch.setAttribute("aria-checked", name === color);
    swatch.onclick = () => {
      [before, color] = [color, name];
      if (!painted.length) change();
      paint();
      $("#swatches [aria-checked=true]").focus();
    };
    return swatch;
  }));
  painted.length = Math.min(painted.length, parts().length);
  $("#painted").replaceChildren(...parts().map((part, i) => {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: part });
    button.style.color = `rgb(${COLORS[colorOf(i)].screen})`;
    button.setAttribute("aria-label", `${part}: ${t(colorOf(i))}`);
    button.onclick = () => {
      painted = parts().map((_, k) => k === i ? color : painted[k] ?? before);
      paint();
      change();
      $$("#painted button")[i].focus();
    };
    return button;
  }));
  ink();
}

/* Drawing: order and speed are kept, one stroke from pen down to pen up. */
const pad = $("#pad"), pen = pad.getContext("2d");
let stroke = null;
function ink() {
  pen.clearRect(0, 0, pad.width, pad.height);
  pen.lineCap = pen.lineJoin = "round";
  pen.strokeStyle = "#555";
  pen.lineWidth = 1;
  pen.strokeRect(40, 75, 720, 150);
  pen.lineWidth = 4;
  (stroke ? [...strokes, stroke] : strokes).forEach((line, i) => {
    pen.strokeStyle = `rgb(${COLORS[inColor() ? colorOf(i) : "white"].screen})`;
    pen.beginPath();
    line.forEach(([x, y]) => pen.lineTo(x, y));
    pen.stroke();
  });
  const all = strokes.flat();
  const box = k => Math.max(...all.map(p => p[k])) - Math.min(...all.map(p => p[k]));
  const scale = all.length ? Math.min(2 / Math.max(1, box(0)), 0.5 / Math.max(1, box(1))) : 0;
  const length = strokes.reduce((sum, line) => sum + line.slice(1).reduce((s, p, i) => s + Math.hypot(p[0] - line[i][0], p[1] - line[i][1]), 0), 0);
  const seconds = Math.round(length * scale / PEN_M_S);
  $("#length").textContent = strokes.length ? t("length", { meters: (length * scale).toFixed(1), seconds }) : "";
  $("#length").classList.toggle("stop", seconds > BATTERY_S);
}
function point(event) {
  const box = pad.getBoundingClientRect();
  const at = (value, from, size, pixels) => Math.round(10 * (value - from) / size * pixels) / 10;
  return [at(event.clientX, box.left, box.width, pad.width), at(event.clientY, box.top, box.height, pad.height), Math.round(event.timeStamp) / 1000];
}
pad.onpointerdown = event => {
  pad.setPointerCapture(event.pointerId);
  drawing = null;
  stroke = [point(event)];
};
pad.onpointermove = event => {
  if (!stroke) return;
  const parts = event.getCoalescedEvents?.() ?? [];
  stroke.push(...(parts.length ? parts : [event]).map(point));
  ink();
};
pad.onpointerup = pad.onpointercancel = () => {
  if (!stroke) return;
  if (stroke.length === 1) stroke.push([stroke[0][0] + 0.1, stroke[0][1], stroke[0][2] + 0.05]);
  painted = strokes.map((_, i) => colorOf(i)).concat(color);
  strokes.push(stroke.sort((a, b) => a[2] - b[2]));
  stroke = null;
  $("#word").value = "";
  paint();
  change();
};
$("#undo").onclick = () => { strokes.pop(); paint(); change(); };
$("#clear").onclick = () => { strokes = []; drawing = null; paint(); change(); };
/* A picture as a JPEG on white that fits into a request. */
async function picture(file) {
  const bitmap = await createImageBitmap(file);
  const canvas = document.createElement("canvas");
  const scale = Math.min(1, 1200 / Math.max(bitmap.width, bitmap.height));
  [canvas.width, canvas.height] = [bitmap.width * scale, bitmap.height * scale].map(Math.ceil);
  const flat = canvas.getContext("2d");
  flat.fillStyle = "#fff";
  flat.fillRect(0, 0, canvas.width, canvas.height);
  flat.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  const texts = [.9, .7, .5, .3].map(quality => canvas.toDataURL("image/jpeg", quality).split(",")[1]);
  return { kind: "jpg", text: texts.find(text => text.length < 200_000) ?? texts.at(-1) };
}
async function open(file) {
  if (!file) return;
  const kind = file.name.split(".").pop().toLowerCase();
  try {
    drawing = ["svg", "json"].includes(kind) ? { kind, text: await file.text() } : await picture(file);
  } catch {
    return fail({ error: t("no-picture", { name: file.name }), hint: "" });
  }
  strokes = [];
  $("#word").value = "";
  paint();
  change();
}
$("#file").onchange = event => open(event.target.files[0]);
document.ondragover = event => { event.preventDefault(); document.body.classList.add("dropping"); };
document.ondragleave = () => document.body.classList.remove("dropping");
document.ondrop = event => { event.preventDefault(); document.body.classList.remove("dropping"); open(event.dataTransfer.files[0]); };

/* The wall: newest photos on the whole screen. */
let wallTimer = 0;
async function hangAll() {
  const photos = await (await fetch("wall")).json();
  const key = photos.map(photo => photo.number).join();
  if (newest.key === key) return;
  newest = { key };
  $("#wall div").style.setProperty("--columns", Math.ceil(Math.sqrt(photos.length)));
  $("#wall div").replaceChildren(...photos.map(({ number, word }) => {
    const figure = document.createElement("figure");
    const img = Object.assign(new Image(), { src: `wall/${number}`, alt: t("alt", { title: word }) });
    figure.append(img, Object.assign(document.createElement("figcaption"), { textContent: word }));
    return figure;
  }));
  if (!photos.length) $("#wall div").textContent = t("bare");
}
function openWall() {
  if (!$("#wall").open) $("#wall").showModal();
  hangAll();
  clearInterval(wallTimer);
  wallTimer = setInterval(hangAll, 3000);
}
$("#see-wall").onclick = openWall;
$("#wall").onclose = () => { clearInterval(wallTimer); if (location.hash === "#wall") history.replaceState(null, "", "."); };
if (location.hash === "#wall") openWall();
speak();

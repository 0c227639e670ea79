"use strict";
const still = matchMedia("(prefers-reduced-motion: reduce)");

for (const film of document.querySelectorAll(".film")) {
  const frames = [...film.querySelectorAll("figure")];
  const controls = document.createElement("div");
  controls.className = "controls";
  controls.innerHTML = "<button>play</button><input type=range aria-label='share of the exposure'>";
  const [button, slider] = controls.children;
  slider.min = 0;
  slider.max = frames.length - 1;
  slider.value = slider.max;
  const show = () => frames.forEach((frame, i) => frame.classList.toggle("on", i === +slider.value));
  let timer = 0;
  const stop = () => { clearInterval(timer); timer = 0; button.textContent = "play"; };
  button.onclick = () => {
    if (timer) return stop();
    if (slider.value === slider.max) slider.value = 0;
    button.textContent = "pause";
    timer = setInterval(() => {
      slider.value = +slider.value + 1;
      show();
      if (slider.value === slider.max) stop();
    }, still.matches ? 1000 : 250);
    show();
  };
  slider.oninput = () => { stop(); show(); };
  film.classList.add("playing");
  film.after(controls);
  show();
}

for (const canvas of document.querySelectorAll("canvas.path")) {
  const paths = JSON.parse(canvas.dataset.paths);
  const places = paths.flat();
  const pen = canvas.getContext("2d");
  const middle = [0, 1, 2].map(k => {
    const values = places.map(place => place[k]);
    return (Math.min(...values) + Math.max(...values)) / 2;
  });
  const around = Math.max(1, ...places.map(place => Math.hypot(place[0] - middle[0], place[1] - middle[1])));
  const above = Math.max(1, ...places.map(place => Math.abs(place[2] - middle[2])));
  let [turn, tilt] = [0.5, 0.35];
  const draw = () => {
    const { width, height } = canvas;
    const tall = above * Math.cos(tilt) + around * Math.abs(Math.sin(tilt));
    const scale = 0.48 * Math.min(width / around, height / tall);
    const ink = getComputedStyle(canvas).color;
    const flat = place => {
      const [x, y, z] = middle.map((m, k) => place[k] - m);
      const [a, b] = [x * Math.cos(turn) - y * Math.sin(turn), x * Math.sin(turn) + y * Math.cos(turn)];
      return [width / 2 + scale * a, height / 2 - scale * (z * Math.cos(tilt) + b * Math.sin(tilt))];
    };
    pen.clearRect(0, 0, width, height);
    for (const lit of [0, 1]) {
      pen.strokeStyle = lit ? "#e69f00" : ink;
      pen.globalAlpha = lit ? 1 : 0.35;
      pen.lineWidth = lit ? 3 : 1;
      pen.beginPath();
      for (const path of paths) {
        for (let i = 1; i < path.length; i++) {
          if (path[i][3] !== lit) continue;
          pen.moveTo(...flat(path[i - 1]));
          pen.lineTo(...flat(path[i]));
        }
      }
      pen.stroke();
    }
  };
  const move = (x, y) => {
    turn += x;
    tilt = Math.max(-1.5, Math.min(1.5, tilt + y));
    draw();
  };
  canvas.onpointerdown = event => canvas.setPointerCapture(event.pointerId);
  canvas.onpointermove = event => { if (event.buttons) move(event.movementX * 0.01, event.movementY * 0.01); };
  canvas.onkeydown = event => {
    const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (by) { event.preventDefault(); move(...by); }
  };
  matchMedia("(prefers-color-scheme: dark)").onchange = draw;
  draw();
}

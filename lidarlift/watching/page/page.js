"use strict";
// Asks for what is new once a second and draws it. Positions are [x, y, z] in decimetres; x is drawn upwards, y to the
// left, as the LiDAR's first scan looks ahead.
const EVERY = 1000, HEIGHTS = [-20, 60];  // ms; decimetres of the colour scale above the trajectory's start
const COLOURS = { trajectory: "#d55e00", loop: "#009e73", start: "#0072b2" };
const known = { version: -1, trajectory: [], map: [], loops: [] };
const view = { x: 0, y: 0, scale: 1, follow: true };  // centre in decimetres; pixels per decimetre
const canvas = document.getElementById("map"), pen = canvas.getContext("2d");
const show = (id, text) => { document.getElementById(id).textContent = text; };
const dark = matchMedia("(prefers-color-scheme: dark)");

async function ask() {
  const since = `version=${known.version}&frames=${known.trajectory.length}&parts=${known.map.length}`;
  let wait = EVERY;
  try {
    const answer = await fetch(`/progress.json?${since}`, { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.statusText);
    const news = await answer.json();
    take(news);
    if (news.finished) return;
  } catch (error) {
    say("no answer: the run has ended, or the connection is lost", true);
    wait = 3 * EVERY;
  }
  setTimeout(ask, wait);
}

function take(news) {
  const [frames, parts] = news.from;
  known.trajectory.splice(frames, Infinity, ...news.trajectory);
  known.map.splice(parts, Infinity, ...news.map);
  known.loops = news.loops;
  known.version = news.version;
  figures(news);
  if (view.follow) fit();
  draw();
}

function say(text, bad = false) {
  const state = document.getElementById("state");
  if (state.textContent !== text) state.textContent = text;
  state.classList.toggle("bad", bad);
}

function figures(news) {
  document.title = `${news.frames}/${news.total} ${news.title}`;
  show("title", news.title);
  show("frames", `${news.frames} / ${news.total}`);
  show("rate", news.rate === null ? "–" : news.rate.toFixed(1));
  show("left", news.finished ? "0:00" : news.rate ? clock((news.total - news.frames) / news.rate) : "–");
  for (const [status, count] of Object.entries(news.counts)) show(status, count);
  document.getElementById("failed").classList.toggle("bad", news.counts.failed > 0);
  show("loops", news.loops.length);
  show("problems", news.problems);
  const bar = document.getElementById("bar");
  bar.max = Math.max(news.total, 1);
  bar.value = news.frames;
  const last = news.last ? `frame ${news.last.frame}: ${news.last.status}, ${news.last.points} points` : "waiting for the first frame";
  say(news.finished ? "finished; the run folder is written next" : news.frames < news.total ? last : "all frames are registered; loops and map follow");
}

function clock(seconds) {
  const whole = Math.round(seconds), pad = (value) => String(value).padStart(2, "0");
  return whole < 3600 ? `${Math.floor(whole / 60)}:${pad(whole % 60)}`
    : `${Math.floor(whole / 3600)}:${pad(Math.floor(whole / 60) % 60)}:${pad(whole % 60)}`;
}

function fit() {
  let [west, east, south, north] = [-50, 50, -50, 50];
  for (const [x, y] of known.trajectory) {
    west = Math.min(west, -y); east = Math.max(east, -y); south = Math.min(south, x); north = Math.max(north, x);
  }
  const margin = 200;
  view.x = (west + east) / 2;
  view.y = (south + north) / 2;
  view.scale = Math.min(canvas.clientWidth / (east - west + 2 * margin), canvas.clientHeight / (north - south + 2 * margin));
}

function draw() {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const at = ([x, y]) => [width / 2 + (-y - view.x) * view.scale, height / 2 - (x - view.y) * view.scale];
  const base = known.trajectory.length ? known.trajectory[0][2] : 0, size = view.scale > 0.8 ? 2 : 1;
  for (const part of known.map) {
    for (const point of part) {
      const [u, v] = at(point);
      if (u < 0 || v < 0 || u > width || v > height) continue;
      pen.fillStyle = SHADES[dark.matches ? 1 : 0][shade(point[2] - base)];
      pen.fillRect(u, v, size, size);
    }
  }
  stroke(known.trajectory.map(at), COLOURS.trajectory, 2);
  for (const loop of known.loops) stroke(loop.map(at), COLOURS.loop, 1.5);
  if (known.trajectory.length) {
    disc(at(known.trajectory[0]), COLOURS.start);
    disc(at(known.trajectory[known.trajectory.length - 1]), COLOURS.trajectory);
  }
  show("scale", `Height of the picture: ${(height / view.scale / 10).toFixed(0)} m.`);
}

function shade(height) {
  const share = (height - HEIGHTS[0]) / (HEIGHTS[1] - HEIGHTS[0]);
  return Math.min(15, Math.max(0, Math.floor(16 * share)));
}

// cividis, told apart by colour-blind people; its darkest end is left out on dark ground, its brightest on white
const SHADES = [false, true].map((onDark) => Array.from({ length: 16 }, (_, k) => {
  const t = onDark ? 0.35 + 0.65 * k / 15 : 0.8 * k / 15, mix = (a, b) => Math.round(a + (b - a) * t);
  return `rgb(${mix(0, 253)}, ${mix(34, 231)}, ${mix(78, 55)})`;
}));

function stroke(points, colour, width) {
  pen.beginPath();
  points.forEach(([u, v], k) => { if (k) pen.lineTo(u, v); else pen.moveTo(u, v); });
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
}

function disc([u, v], colour) {
  pen.beginPath();
  pen.arc(u, v, 4, 0, 2 * Math.PI);
  pen.fillStyle = colour;
  pen.fill();
}

function move(right, up) {
  view.x += right / view.scale;
  view.y += up / view.scale;
  view.follow = false;
  draw();
}

function zoom(factor) {
  view.scale = Math.min(20, Math.max(0.002, view.scale * factor));
  view.follow = false;
  draw();
}

let grabbed = null;
canvas.addEventListener("pointerdown", (event) => { grabbed = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
canvas.addEventListener("pointermove", (event) => {
  if (!grabbed) return;
  move(grabbed[0] - event.clientX, event.clientY - grabbed[1]);
  grabbed = [event.clientX, event.clientY];
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { grabbed = null; });
canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 500)); }, { passive: false });
canvas.addEventListener("keydown", (event) => {
  const step = 40, keys = {
    ArrowLeft: () => move(-step, 0), ArrowRight: () => move(step, 0), ArrowUp: () => move(0, step), ArrowDown: () => move(0, -step),
    "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), 0: () => { view.follow = true; fit(); draw(); },
  };
  if (!(event.key in keys) || event.ctrlKey || event.metaKey) return;
  event.preventDefault();
  keys[event.key]();
});
addEventListener("resize", () => { if (view.follow) fit(); draw(); });
dark.addEventListener("change", draw);
ask();

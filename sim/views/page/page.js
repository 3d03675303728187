// The page: one scan is shown at a time, whoever asks for it: slider, keys, charts, lists or the film as it plays.

const film = $("film");
const cameras = [];
let clock = 0; // s of the mission, where there is no film to keep the time
let last = 0; // ms, of the animation frame before
const broken = () => !film || film.error !== null;
const lists = [...document.querySelectorAll("ol.events li")];
const lossStarts = [...new Set([...document.querySelectorAll("#losses li")].map((li) => Number(li.dataset.first)))].sort((a, b) => a - b);

// Shows scan k; `keep` leaves the film alone, which is there already.
function go(k, keep = false) {
  state.k = clamp(k);
  clock = data.times[state.k];
  if (!keep) seek();
  const time = `${data.times[state.k].toFixed(1)} s`;
  $("now").textContent = time;
  const error = data.mean[state.k];
  $("error").textContent = error === null ? "-".repeat(data.labelled) : `${error.toFixed(2)} m`;
  $("slider").value = state.k;
  $("slider").setAttribute("aria-valuetext", time);
  $("cursor").style.left = `${xOf(state.k)}px`;
  drawMap();
  tell();
  for (const li of lists) {
    const inside = Number(li.dataset.first) <= state.k && state.k <= Number(li.dataset.last);
    if (inside) li.setAttribute("aria-current", "true");
    else li.removeAttribute("aria-current");
  }
}

// Brings the film to the middle of the scan's frame; while it is on its way, only the last wish counts.
function seek() {
  if (broken() || film.seeking || film.readyState < 1) return;
  const goal = (state.k + 0.5) / data.rate;
  if (Math.abs(film.currentTime - goal) > 1e-3) film.currentTime = goal;
}

// Number, state of trouble, and states to the cameras and to the tracks of each person at a scan, the worst off first.
const nowOf = (k) => data.now[k].map((n) => data.looks.rows[n]);

// The table under Now.
function tell() {
  const rows = nowOf(state.k).map(([m, trouble, ...words]) => {
    const row = document.createElement("tr");
    row.className = trouble;
    for (const text of [String(m), ...words]) row.insertCell().textContent = text;
    return row;
  });
  $("state").tBodies[0].replaceChildren(...rows);
}

function drawCameras() {
  if (!film || film.readyState < 2 || film.seeking) return;
  $("cameras").dataset.time = film.currentTime; // s of the film that is shown
  cameras.forEach((canvas, i) => {
    const [x, y, w, h] = data.film.tiles[i];
    canvas.getContext("2d").drawImage(film, x, y, w, h, 0, 0, canvas.width, canvas.height);
  });
}

function play(on) {
  state.playing = on;
  $("play").textContent = on ? "Pause" : "Play";
  $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  if (on && state.k === scans - 1) go(0);
  if (!broken()) {
    film.playbackRate = state.speed;
    if (on) film.play().catch(() => play(false));
    else film.pause();
  }
  if (on) requestAnimationFrame((now) => { last = now; tick(now); });
  else go(state.k);
}

function tick(now) {
  if (!state.playing) return;
  if (broken()) clock += ((now - last) / 1000) * state.speed;
  last = now;
  const time = broken() ? clock - data.times[0] : film.currentTime;
  const k = Math.floor(time * data.rate + 1e-6);
  if (!(film && film.seeking) && k !== state.k) {
    const running = clock;
    go(k, true);
    if (broken()) clock = running;
  }
  drawCameras();
  if (k >= scans - 1 || (!broken() && film.ended)) play(false);
  else requestAnimationFrame(tick);
}

function jump(way) {
  const next = way > 0 ? lossStarts.find((k) => k > state.k) : lossStarts.filter((k) => k < state.k).pop();
  if (next === undefined) return;
  const li = document.querySelector(`#losses li[data-first="${next}"]`);
  choose(li);
  li.parentElement.scrollTop = li.offsetTop - 40; // the list scrolls, the page stays
}

// Goes to where an event of the lists begins.
function choose(li) {
  if (state.playing) play(false);
  state.person = li.dataset.person === undefined ? null : Number(li.dataset.person);
  for (const details of document.querySelectorAll("ol.events details")) details.open = li.contains(details);
  go(Number(li.dataset.first));
}

function onKey(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("select")) return;
  const pressing = event.target.matches("button, summary");
  const actions = {
    ArrowLeft: () => go(state.k - 1), ArrowRight: () => go(state.k + 1),
    Home: () => go(0), End: () => go(scans - 1),
    n: () => jump(1), p: () => jump(-1),
    " ": pressing ? null : () => play(!state.playing),
  };
  const action = actions[event.key.length > 1 ? event.key : event.key.toLowerCase()];
  if (!action) return;
  event.preventDefault();
  if (state.playing && event.key !== " ") play(false);
  action();
}

function fillChoices() {
  for (const kind of ["people", "uavs"]) {
    data.names[kind].forEach((name, n) => $("follow").add(new Option(name, `${kind} ${n}`)));
  }
  data.names.uavs.forEach((name, i) => $("who").add(new Option(name, i)));
  for (const name of ["follow", "who"]) $(name).addEventListener("change", () => { state[name] = $(name).value; drawMap(); });
  $("speed").addEventListener("change", () => {
    state.speed = Number($("speed").value);
    if (film) film.playbackRate = state.speed;
  });
}

function bindMap() {
  $("map").addEventListener("pointermove", (event) => {
    const text = named(event.offsetX, event.offsetY);
    $("tip").hidden = !text;
    $("tip").textContent = text;
    const right = event.offsetX > $("map").clientWidth / 2;
    $("tip").style.left = right ? "" : `${event.offsetX + 14}px`;
    $("tip").style.right = right ? `${$("map").clientWidth - event.offsetX + 14}px` : "";
    $("tip").style.top = `${event.offsetY + 14}px`;
  });
  $("map").addEventListener("pointerleave", () => { $("tip").hidden = true; });
}

function bindFilm() {
  if (!film) return;
  const tiles = data.film.tiles;
  $("cameras").style.setProperty("--wide", Math.ceil(Math.sqrt(tiles.length)) || 1); // columns beside the map
  $("cameras").style.setProperty("--narrow", Math.min(tiles.length, 5) || 1); // and below it
  tiles.forEach(([, , w, h], i) => {
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: 2 * w, height: 2 * h });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `Camera of ${data.names.uavs[i]} with its detections and tracks`);
    $("cameras").append(canvas);
    cameras.push(canvas);
  });
  for (const name of ["seeked", "loadeddata"]) {
    film.addEventListener(name, () => { drawCameras(); if (!state.playing) seek(); });
  }
  const presented = () => { drawCameras(); film.requestVideoFrameCallback(presented); };
  if (film.requestVideoFrameCallback) film.requestVideoFrameCallback(presented);
  $("whole").hidden = false;
  $("whole").addEventListener("click", () => {
    const on = document.querySelector(".stage").classList.toggle("whole");
    $("whole").setAttribute("aria-pressed", on);
  });
}

// Marks in legends by their kind, each drawn in a colour or with a look.
const MARKS = {
  tree: (ctx, cover) => {
    ctx.globalAlpha = 0.6 * cover;
    disc(ctx, 13, 10, 8, colours.canopy);
    ctx.globalAlpha = 1;
    ring(ctx, 13, 10, 8, colours.canopy_edge, 1);
  },
  person: (ctx, look) => personMark(ctx, 11, 10, 0, look, 8),
  track: (ctx) => { ctx.beginPath(); ctx.ellipse(13, 10, 11, 7, 0, 0, 7); ctx.stroke(); },
  mapped: (ctx, colour) => {
    ctx.globalAlpha = 0.25;
    ctx.fillStyle = colours.unseen;
    ctx.fillRect(13, 2, 12, 16);
    ctx.globalAlpha = 1;
    ctx.setLineDash([3, 3]);
    ring(ctx, 13, 10, 8, colour, 1.5);
    ctx.setLineDash([]);
  },
  view: (ctx) => ctx.strokeRect(5, 3, 16, 14),
  believed: (ctx) => { ctx.lineWidth = 1; ctx.setLineDash([3, 3]); ctx.strokeRect(5, 3, 16, 14); },
  intent: (ctx, colour) => { ctx.lineWidth = 2.5; ctx.setLineDash([2, 4]); stroke(ctx, [[2, 10], [18, 10]]); ctx.setLineDash([]); ring(ctx, 21, 10, 3.5, colour, 2); },
  detection: (ctx) => drawDetection(ctx, 13, 10, 7),
  box: (ctx) => ctx.fillRect(2, 4, 22, 12),
  thin: (ctx) => ctx.fillRect(2, 8, 22, 3),
  diamond: (ctx) => diamond(ctx, 13, 10),
};

function legend(list, entries) {
  for (const [text, kind, look] of entries) {
    const canvas = document.createElement("canvas");
    const item = document.createElement("li");
    canvas.style.width = "26px";
    fit(canvas, 26, 20);
    const ctx = canvas.getContext("2d");
    if (typeof look === "string") ctx.fillStyle = ctx.strokeStyle = look;
    ctx.lineWidth = 2;
    MARKS[kind](ctx, look);
    item.append(canvas, text);
    $(list).append(item);
  }
}

function layOut() {
  sizeMap();
  sizeCharts();
  go(state.k);
}

$("slider").max = scans - 1;
$("slider").disabled = scans < 2;
$("slider").addEventListener("input", () => { if (state.playing) play(false); go(Number($("slider").value)); });
$("play").addEventListener("click", () => play(!state.playing));
for (const [name, act] of [["back", () => go(state.k - 1)], ["on", () => go(state.k + 1)],
  ["before", () => jump(-1)], ["after", () => jump(1)]]) {
  $(name).addEventListener("click", () => { if (state.playing) play(false); act(); });
}
for (const li of lists) li.querySelector("button").addEventListener("click", () => choose(li));
addEventListener("keydown", onKey);
addEventListener("resize", layOut);
legend("map-legend", data.map_legend);
legend("chart-legend", data.chart_legend);
fillChoices();
bindMap();
bindFilm();
bindCharts((k) => { if (state.playing) play(false); go(k); });
layOut();

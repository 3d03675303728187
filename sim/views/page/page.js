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
  const error = fleetMean(state.k);
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

// The states of a person to the tracks, the worst first; of the lost, those lost for longer.
function trouble(k, m) {
  const hold = data.holds[k][m];
  let first = k;
  while (first > 0 && data.holds[first - 1][m] === hold) first -= 1;
  return [WORST.indexOf(hold) + 1 || 6, hold === LOST ? first : 0, m];
}

// The table under Now, sorted by trouble.
function tell() {
  const order = data.people[state.k].map((_, m) => trouble(state.k, m));
  order.sort((one, other) => one[0] - other[0] || one[1] - other[1] || one[2] - other[2]);
  const rows = order.map(([, , m]) => {
    const row = document.createElement("tr");
    row.className = lost(state.k, m) ? "lost" : unfound(state.k, m) ? "unfound" : "";
    for (const text of [String(m), views(state.k, m), holders(state.k, m)]) row.insertCell().textContent = text;
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
  data.people[0].forEach((_, m) => $("follow").add(new Option(`person ${m}`)));
  data.uavs[0].forEach((_, i) => {
    $("follow").add(new Option(`UAV ${i}`));
    $("who").add(new Option(`UAV ${i}`, i));
  });
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
    canvas.setAttribute("aria-label", `Camera of UAV ${i} with its detections and tracks`);
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

// Lists what is drawn at some scan of the mission: each entry has a text, a mark, and whether it is.
function legend(list, entries) {
  for (const [text, draw] of entries.filter((entry) => entry[2])) {
    const canvas = document.createElement("canvas");
    const item = document.createElement("li");
    canvas.style.width = "26px";
    fit(canvas, 26, 20);
    draw(canvas.getContext("2d"));
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
const box = (colour) => (ctx) => { ctx.fillStyle = colour; ctx.fillRect(2, 4, 22, 12); };
const mark = (view, colour) => (ctx) => { personMark(ctx, 11, 10, 0, view); if (colour) ring(ctx, 11, 10, 8, colour, 2.5); };
const known = { // views on the map, states in the lanes and in the bars, kinds of tracks of no person
  views: new Set(data.people.flatMap((row, k) => row.map((at, m) => at && viewOf(k, m)))),
  states: new Set(data.states.flat(2)),
  holds: new Set(data.holds.flat()),
  kinds: new Set(data.unmatched.map((event) => event[0])),
};
const sparsest = data.trees.reduce((least, tree) => Math.min(least, tree[4]), 1);
legend("map-legend", [
  ["porous tree", (ctx) => { ctx.globalAlpha = 0.6 * sparsest; disc(ctx, 13, 10, 8, colours.canopy); ctx.globalAlpha = 1; ring(ctx, 13, 10, 8, colours.canopy_edge, 1); },
    sparsest < 1],
  ["person", mark(SEEN), known.views.has(SEEN)], ["hidden", mark(HIDDEN), known.views.has(HIDDEN)],
  ["outside every view", mark(OUT), known.views.has(OUT)],
  ["lost", mark(SEEN, colours.lost), known.holds.has(LOST)],
  ["not found yet", mark(SEEN, colours.not_found_yet), known.holds.has(NOT_FOUND)],
  ["track, 95 %", (ctx) => { ctx.strokeStyle = colours.vermillion; ctx.lineWidth = 2; ctx.beginPath(); ctx.ellipse(13, 10, 11, 7, 0, 0, 7); ctx.stroke(); },
    data.tracks.some((scan) => scan.rows.length)],
  ["view of a UAV", (ctx) => { ctx.strokeStyle = colours.blue; ctx.lineWidth = 2; ctx.strokeRect(5, 3, 16, 14); },
    data.views.flat().some(Boolean)],
  ["view as believed", (ctx) => { ctx.strokeStyle = colours.blue; ctx.setLineDash([3, 3]); ctx.strokeRect(5, 3, 16, 14); ctx.setLineDash([]); },
    data.believed !== null],
  ["intent", (ctx) => { ctx.setLineDash([2, 4]); ctx.strokeStyle = colours.blue; ctx.lineWidth = 2.5; stroke(ctx, [[2, 10], [18, 10]]); ctx.setLineDash([]); ring(ctx, 21, 10, 3.5, colours.blue, 2); },
    data.plans.times.length],
]);
const sees = (i) => data.states.some((rows) => rows[i].includes(SEEN)); // a UAV that sees nobody has a curve
const distinct = fleet <= colours.uavs.length;
legend("chart-legend", [
  ...(distinct ? data.uavs[0].map((_, i) => [`${sees(i) ? "seen by " : ""}UAV ${i}`, box(uavColour(i)), true])
    : [["seen: lanes are the UAVs in brackets", box(uavColour(0)), known.states.has(SEEN)]]),
  ["shown, not detected", box(paleUavColour(0)), known.states.has(MISSED)], ["hidden", box(colours.hidden), known.states.has(HIDDEN)],
  ["out of view", (ctx) => { ctx.fillStyle = colours.out_of_view; ctx.fillRect(2, 8, 22, 3); }, known.states.has(OUT)],
  ["held by all", box(colours.held), known.holds.has(HELD)], ["held by some", box(colours.held_by_some), known.holds.has(SOME)],
  ["off, in the track's ellipse", box(colours.off), known.holds.has(OFF)],
  ["lost", box(colours.lost), known.holds.has(LOST)], ["not found yet", box(colours.not_found_yet), known.holds.has(NOT_FOUND)],
  ["track held", box(colours.held), known.kinds.has("track held")],
  ["false track", box(colours.false), known.kinds.has("false track")], ["duplicate track", box(colours.pale_false), known.kinds.has("duplicate track")],
  ["track switched", (ctx) => diamond(ctx, 13, 10), data.switches.length],
]);
fillChoices();
bindMap();
bindFilm();
bindCharts((k) => { if (state.playing) play(false); go(k); });
layOut();

// What the drawings share: the data, colours, and strokes in CSS pixels.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const OUT = 0, MISSED = 1, SEEN = 2, HIDDEN = 3; // see page_data.py
const colours = data.colours;
const scans = data.times.length;
const state = { k: 0, playing: false, speed: 1, who: "", follow: "", person: null };

const clamp = (k) => Math.max(0, Math.min(scans - 1, k));
const uavColour = (i) => colours.uavs[i % colours.uavs.length];
const trackColour = (n) => colours.tracks[n % colours.tracks.length];

// Gives a canvas its size in CSS pixels and as many pixels as the screen has.
function fit(canvas, width, height) {
  const ratio = devicePixelRatio || 1;
  canvas.style.height = `${height}px`;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  canvas.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
}

function stroke(ctx, points) {
  ctx.beginPath();
  for (const point of points) ctx.lineTo(...point);
  ctx.stroke();
}

function disc(ctx, x, y, radius, colour) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  ctx.fillStyle = colour;
  ctx.fill();
}

function ring(ctx, x, y, radius, colour, width) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.stroke();
}

function write(ctx, text, x, y, colour, align) {
  ctx.font = '600 13px system-ui, "DejaVu Sans", sans-serif';
  ctx.textAlign = align;
  ctx.textBaseline = "middle";
  ctx.lineJoin = "round";
  ctx.strokeStyle = colours.panel;
  ctx.lineWidth = 3.5;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}

// Words for lists: "UAV 0", "UAVs 0, 1 and 2".
function uavs(numbers) {
  const most = numbers.slice(0, -1).join(", ");
  return `UAV${numbers.length > 1 ? "s" : ""} ${most ? `${most} and ` : ""}${numbers[numbers.length - 1]}`;
}

// What the cameras make of a person at a scan, in words.
function views(k, m) {
  if (data.people[k][m] === null) return "not there";
  const told = data.codes[k].map((row) => row[m]);
  const among = (test) => told.flatMap((code, i) => (test(code) ? [i] : []));
  const [seen, missed, hidden] = [among((c) => c === SEEN), among((c) => c === MISSED), among((c) => c >= HIDDEN)];
  if (seen.length) return `seen by ${uavs(seen)}`;
  if (missed.length) return `shown to ${uavs(missed)}, not detected`;
  if (!hidden.length) return "outside every view";
  const from = (code) => uavs(hidden.filter((i) => told[i] === code));
  const by = (code) => (code > HIDDEN ? `tree ${code - HIDDEN - 1}` : "somebody");
  const all = [...new Set(hidden.map((i) => told[i]))];
  return `hidden ${all.map((code) => `by ${by(code)} from ${from(code)}`).join(", ")}`;
}

// Who holds a person at a scan, and as which track, in words.
function holders(k, m) {
  if (data.people[k][m] === null) return "";
  const byTrack = new Map();
  data.holders[k].forEach((row, i) => row[m] >= 0 && byTrack.set(row[m], [...(byTrack.get(row[m]) || []), i]));
  if (!byTrack.size) return "nobody";
  const fleet = data.works[k].filter(Boolean).length;
  const whose = (holding) => (fleet > 1 && holding.length === fleet ? "all" : uavs(holding));
  return [...byTrack].map(([track, holding]) => `track ${track} of ${whose(holding)}`).join(", ");
}

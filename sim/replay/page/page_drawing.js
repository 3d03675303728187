// What the drawings share: the data, colours, and strokes in CSS pixels.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
// Of a person to a camera: STATES of sim/replay/history.py; 0 stands for absent, -1 for a UAV that has broken down.
const OUT = 1, HIDDEN = 2, MISSED = 3, SEEN = 4;
const NOT_FOUND = 1, LOST = 2, SOME = 3, HELD = 4; // of a person to all tracks: HOLDS of sim/evaluation/holding.py
const colours = data.colours;
const scans = data.times.length;
const state = { k: 0, playing: false, speed: 1, who: "", follow: "", person: null };

const clamp = (k) => Math.max(0, Math.min(scans - 1, k));
const uavColour = (i) => colours.uavs[i % colours.uavs.length];
const paleUavColour = (i) => colours.pale_uavs[i % colours.pale_uavs.length];
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

const FONT = '600 13px system-ui, "DejaVu Sans", sans-serif';

function write(ctx, text, x, y, colour, align) {
  ctx.font = FONT;
  ctx.textAlign = align;
  ctx.textBaseline = "middle";
  ctx.lineJoin = "round";
  ctx.strokeStyle = colours.panel;
  ctx.lineWidth = 3.5;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
}

// Names beside marks: noted while the marks are drawn, written when all are, where they cover least.
const names = { marks: [], wanted: [] };
const SIDES = [[0, 1], [0, -1], [1, 0], [-1, 0], [1, -1], [1, 1], [-1, -1], [-1, 1]];
const OUTSIDE = [[1, -1], [0, -1], [-1, -1], [-1, 0]]; // of the top left corner of a view, so that no edge runs through

function reserve(x, y, reach) {
  names.marks.push([x - reach, y - reach, x + reach, y + reach]);
}

function want(text, x, y, colour, gap, sides = SIDES) {
  names.wanted.push({ text, x, y, colour, gap, sides });
}

function writeNames(ctx) {
  const taken = names.marks;
  const overlap = (a, b) =>
    Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0])) * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));
  ctx.font = FONT;
  for (const { text, x, y, colour, gap, sides } of names.wanted) {
    const [w, h] = [ctx.measureText(text).width / 2, 8];
    const boxes = sides.flatMap(([dx, dy]) => [gap, gap + 16].map((away) => {
      const [u, v] = [x + dx * (away + w), y + dy * (away + h)];
      return { away, box: [u - w, v - h, u + w, v + h] };
    }));
    const cost = ({ away, box }) => away + taken.reduce((sum, other) => sum + overlap(box, other), 0);
    const { box } = boxes.reduce((one, other) => (cost(other) < cost(one) ? other : one));
    write(ctx, text, (box[0] + box[2]) / 2, (box[1] + box[3]) / 2, colour, "center");
    taken.push(box);
  }
  names.marks = [];
  names.wanted = [];
}

// Words for lists: "UAV 0", "UAVs 0, 1 and 2".
function uavs(numbers) {
  const most = numbers.slice(0, -1).join(", ");
  return `UAV${numbers.length > 1 ? "s" : ""} ${most ? `${most} and ` : ""}${numbers[numbers.length - 1]}`;
}

// The state of a person to the cameras at a scan, in words.
const views = (k, m) => data.texts[data.view_texts[m][k]] || "not there";

// The UAVs that hold a person at a scan, and their tracks, in words.
function holders(k, m) {
  if (data.people[k][m] === null) return "";
  const byTrack = new Map();
  data.holders[k].forEach((row, i) => row[m] >= 0 && byTrack.set(row[m], [...(byTrack.get(row[m]) || []), i]));
  if (!byTrack.size) return data.holds[k][m] === LOST ? "lost" : "not found yet";
  const fleet = data.works[k].filter(Boolean).length;
  const whose = (holding) => (fleet > 1 && holding.length === fleet ? "all" : uavs(holding));
  return [...byTrack].map(([track, holding]) => `track ${track} of ${whose(holding)}`).join(", ");
}

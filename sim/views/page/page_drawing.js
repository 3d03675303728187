// What the drawings share: the data, colours, and strokes in CSS pixels.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const colours = data.colours;
const scans = data.times.length;
const state = { k: 0, playing: false, speed: 1, who: "", follow: "", person: null };

const clamp = (k) => Math.max(0, Math.min(scans - 1, k));
const tracksOf = (k, i) => data.tracks[k].held[i].map((n) => data.tracks[k].rows[n]);

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
const CORNERS = [[-1, -1], [1, -1], [-1, 1], [1, 1]]; // of a view
const OUTSIDE = [[1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1]]; // of the top left one, so that no edge runs through

function reserve(x, y, reach) {
  names.marks.push([x - reach, y - reach, x + reach, y + reach]);
}

// A name that is not needed is left out where it would cover much, as in films.
function want(text, x, y, colour, gap, { sides = SIDES, needed = true } = {}) {
  names.wanted.push({ text, x, y, colour, gap, sides, needed });
}

// The name of a view, outside it at the corner where the least of the name lies in other views or beyond the canvas.
function wantOutside(ctx, text, view, others, colour) {
  const choices = CORNERS.map(([a, b]) => {
    const [x, y] = [view[1 + a], view[2 + b]];
    const sides = OUTSIDE.map(([dx, dy]) => [-a * dx, -b * dy]);
    const costs = sides.map((side) => Math.round(covered(ctx, boxOf(ctx, text, x, y, side, 1), others)));
    const least = Math.min(...costs);
    return { x, y, least, sides: sides.filter((_, n) => costs[n] === least) };
  });
  const { x, y, sides } = choices.reduce((one, other) => (other.least < one.least ? other : one));
  want(text, x, y, colour, 1, { sides });
}

// Left, top, right, bottom of a name on a side of its mark.
function boxOf(ctx, text, x, y, [dx, dy], away) {
  ctx.font = FONT;
  const [w, h] = [ctx.measureText(text).width / 2, 8];
  const [u, v] = [x + dx * (away + w), y + dy * (away + h)];
  return [u - w, v - h, u + w, v + h];
}

// Pixels of a box in others, and beyond the canvas.
function covered(ctx, box, others) {
  const common = (other) => Math.max(0, Math.min(box[2], other[2]) - Math.max(box[0], other[0]))
    * Math.max(0, Math.min(box[3], other[3]) - Math.max(box[1], other[1]));
  const beyond = (box[2] - box[0]) * (box[3] - box[1]) - common([0, 0, ctx.canvas.clientWidth, ctx.canvas.clientHeight]);
  return others.reduce((sum, other) => sum + common(other), beyond);
}

function writeNames(ctx) {
  const taken = names.marks;
  for (const { text, x, y, colour, gap, sides, needed } of names.wanted) {
    const boxes = sides.flatMap((side) => [gap, gap + 16].map((away) => {
      const box = boxOf(ctx, text, x, y, side, away);
      return { box, cost: away + covered(ctx, box, taken) };
    }));
    const { box, cost } = boxes.reduce((one, other) => (other.cost < one.cost ? other : one));
    if (!needed && cost > gap + 20) continue;
    write(ctx, text, (box[0] + box[2]) / 2, (box[1] + box[3]) / 2, colour, "center");
    taken.push(box);
  }
  names.marks = [];
  names.wanted = [];
}


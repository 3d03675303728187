// The map: trees, area, people, UAVs with their views, tracks with ellipses and intents of one scan.

const map = { canvas: $("map"), ctx: $("map").getContext("2d"), scale: 1, x: 0, y: 0 };

// The first UAV that works at a scan, or the one that was chosen; -1 if it has broken down.
function trackOwner(k) {
  const i = state.who === "" ? data.works[k].indexOf(1) : Number(state.who);
  return i >= 0 && data.works[k][i] ? i : -1;
}

const lost = (k, m) => data.holds[k][m] === LOST;
const unfound = (k, m) => data.holds[k][m] === NOT_FOUND;

function sizeMap() {
  const width = map.canvas.parentElement.clientWidth;
  const aspect = (data.area[0] + 2 * data.margin) / (data.area[1] + 2 * data.margin);
  const height = Math.min(width / aspect, Math.max(320, 0.5 * innerHeight));
  fit(map.canvas, width, height);
}

// Sets where metres go: the whole area, or 40 m round the person or UAV that the map follows.
function aim(width, height) {
  const [kind, index] = state.follow.split(" ");
  const at = kind === "person" ? data.people[state.k][index] : kind === "UAV" ? data.uavs[state.k][index] : null;
  const spans = at ? [40, 40] : data.area.map((edge) => edge + 2 * data.margin);
  map.scale = Math.min(width / spans[0], height / spans[1]);
  [map.x, map.y] = at || [0, 0];
}

const px = (x) => map.canvas.clientWidth / 2 + (x - map.x) * map.scale;
const py = (y) => map.canvas.clientHeight / 2 - (y - map.y) * map.scale;

function drawMap() {
  const { ctx, canvas } = map;
  aim(canvas.clientWidth, canvas.clientHeight);
  ctx.fillStyle = colours.panel;
  ctx.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  drawGround(ctx);
  const k = state.k;
  data.works[k].forEach((works, i) => works && data.views[k][i] && drawView(ctx, data.views[k][i], i));
  if (data.believed) data.works[k].forEach((works, i) => works && data.believed[k][i] && drawBelieved(ctx, data.believed[k][i], i));
  drawTrails(ctx, k);
  drawIntents(ctx, k);
  const views = data.views[k].map((view, i) => data.works[k][i] && view && bounds(view));
  data.uavs[k].forEach((at, i) => drawUav(ctx, at, i, data.works[k][i], views));
  const who = trackOwner(k);
  if (who >= 0) for (const track of tracksOf(k, who)) drawTrack(ctx, track);
  data.people[k].forEach((at, m) => at && notePerson(at, k, m));
  writeNames(ctx);
  data.people[k].forEach((at, m) => at && drawPerson(ctx, at, k, m));
  drawScale(ctx, canvas.clientWidth - 10, canvas.clientHeight - 9);
}

function drawScale(ctx, right, low) {
  const metres = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].find((m) => m * map.scale > 40) || 10000;
  const left = right - metres * map.scale;
  for (const [ink, width] of [[colours.panel, 5], [colours.ink, 2]]) {
    ctx.strokeStyle = ink;
    ctx.lineWidth = width;
    stroke(ctx, [[left, low - 5], [left, low], [right, low], [right, low - 5]]);
  }
  write(ctx, `${metres} m`, (left + right) / 2, low - 11, colours.ink, "center");
}

function drawGround(ctx) {
  const [w, h] = data.area.map((edge) => edge / 2);
  ctx.strokeStyle = colours.line;
  ctx.lineWidth = 0.6;
  for (let x = -Math.floor(w / 10) * 10; x <= w; x += 10) line(ctx, [[x, -h], [x, h]]);
  for (let y = -Math.floor(h / 10) * 10; y <= h; y += 10) line(ctx, [[-w, y], [w, y]]);
  ctx.strokeStyle = colours.faint;
  ctx.lineWidth = 1;
  ctx.strokeRect(px(-w), py(h), 2 * w * map.scale, 2 * h * map.scale);
  for (const [x, y, canopy, trunk, cover] of data.trees) {
    ctx.globalAlpha = 0.6 * cover;
    disc(ctx, px(x), py(y), canopy * map.scale, colours.canopy);
    ctx.globalAlpha = 1;
    ring(ctx, px(x), py(y), canopy * map.scale, colours.canopy_edge, 1);
    disc(ctx, px(x), py(y), Math.max(trunk * map.scale, 1.8), colours.trunk);
  }
}

function outline(ctx, corners) {
  ctx.beginPath();
  for (let c = 0; c < corners.length; c += 2) ctx.lineTo(px(corners[c]), py(corners[c + 1]));
  ctx.closePath();
}

function drawBelieved(ctx, corners, i) {
  outline(ctx, corners);
  ctx.strokeStyle = uavColour(i);
  ctx.lineWidth = 1;
  ctx.setLineDash([3, 3]);
  ctx.stroke();
  ctx.setLineDash([]);
}

function drawView(ctx, corners, i) {
  const colour = uavColour(i);
  outline(ctx, corners);
  ctx.globalAlpha = 0.14;
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1.6;
  ctx.setLineDash(uavDashes(i));
  ctx.stroke();
  ctx.setLineDash([]);
}

function drawTrails(ctx, k) {
  ctx.strokeStyle = colours.faint;
  ctx.lineWidth = 1;
  for (let m = 0; m < data.people[k].length; m++) {
    const past = [];
    for (let j = Math.max(0, k - data.trail); j <= k; j++) if (data.people[j][m]) past.push(data.people[j][m]);
    line(ctx, past);
  }
}

// What is left of the plans that are flown, from where each UAV is.
function drawIntents(ctx, k) {
  const { times, step, controls } = data.plans;
  let e = times.length - 1;
  while (e >= 0 && times[e] > data.times[k] + 1e-6) e--;
  if (e < 0) return;
  data.works[k].forEach((works, i) => {
    if (!works) return;
    let [x, y] = data.uavs[k][i];
    const path = [[x, y]];
    controls[e][i].forEach(([vx, vy], h) => {
      const left = Math.min(Math.max(times[e] + (h + 1) * step - data.times[k], 0), step);
      path.push([(x += vx * left), (y += vy * left)]);
    });
    ctx.setLineDash([2, 4]);
    ctx.strokeStyle = uavColour(i);
    ctx.lineWidth = 2.5;
    line(ctx, path);
    ctx.setLineDash([]);
    ring(ctx, px(x), py(y), 4, uavColour(i), 2);
  });
}

// Left, top, right, bottom of a view in pixels.
function bounds(view) {
  const [xs, ys] = [0, 1].map((axis) => view.filter((_, c) => c % 2 === axis));
  return [px(Math.min(...xs)), py(Math.max(...ys)), px(Math.max(...xs)), py(Math.min(...ys))];
}

// Named at a corner of its view, if that has one.
function drawUav(ctx, [x, y], i, works, views) {
  const colour = works ? uavColour(i) : colours.faint;
  const [u, v] = [px(x), py(y)];
  for (const [ink, width] of [[colours.panel, 5], [colour, 2.4]]) {
    ctx.strokeStyle = ink;
    ctx.lineWidth = width;
    for (const way of [1, -1]) stroke(ctx, [[u - 6, v - 6 * way], [u + 6, v + 6 * way]]);
    for (const dx of [-6, 6]) for (const dy of [-6, 6]) ring(ctx, u + dx, v + dy, 2.6, ink, width - 0.6);
  }
  if (!works) {
    ctx.strokeStyle = colours.alarm;
    ctx.lineWidth = 2.5;
    for (const way of [1, -1]) stroke(ctx, [[u - 13, v - 13 * way], [u + 13, v + 13 * way]]);
  }
  reserve(u, v, 8);
  if (!works) want(`UAV ${i}: broken down`, u, v, colours.ink, 14);
  else if (views[i]) wantOutside(ctx, `UAV ${i}`, views[i], views.filter((view, j) => view && j !== i), colour);
  else want(`UAV ${i}`, u, v, colour, 10);
}

function drawTrack(ctx, [number, x, y, a, b, turn, reported]) {
  const colour = trackColour(number);
  ctx.strokeStyle = colour;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.ellipse(px(x), py(y), a * map.scale, b * map.scale, -turn, 0, 2 * Math.PI);
  ctx.stroke();
  for (const [ink, width] of [[colours.panel, 4], [colour, 2]]) {
    ctx.strokeStyle = ink;
    ctx.lineWidth = width;
    for (const p of [-1, 1]) for (const q of [-1, 1]) {
      stroke(ctx, [[px(x) + 4 * p, py(y) + 4 * q], [px(x) + 7.5 * p, py(y) + 7.5 * q]]);
    }
  }
  reserve(px(x), py(y), 6);
  want(`${number}${reported ? "" : "?"}`, px(x), py(y), colour, 8);
}

// The best state of a person to the cameras at a scan: shown, hidden or out of view.
const viewOf = (k, m) => {
  const states = data.states[k].map((row) => row[m]);
  return states.some((view) => view >= MISSED) ? SEEN : states.includes(HIDDEN) ? HIDDEN : OUT;
};

// A person that a frame shows is a full disc, one that something hides is hollow, one outside every view is grey.
function personMark(ctx, u, v, turn, view) {
  const ink = view === OUT ? colours.faint : colours.ink;
  ctx.strokeStyle = ink;
  ctx.lineWidth = 2;
  stroke(ctx, [[u, v], [u + 9 * Math.cos(turn), v - 9 * Math.sin(turn)]]);
  disc(ctx, u, v, 3.4, ink);
  if (view === HIDDEN) disc(ctx, u, v, 1.9, colours.panel);
}

function notePerson([x, y], k, m) {
  const [u, v] = [px(x), py(y)];
  const name = data.people[k].length > 8 ? String(m) : `person ${m}`;
  reserve(u, v, 10);
  if (lost(k, m)) want(name, u, v, colours.lost, 12);
  else if (unfound(k, m) || state.person === m) want(name, u, v, colours.ink, 12);
}

function drawPerson(ctx, [x, y], k, m) {
  const [u, v] = [px(x), py(y)];
  personMark(ctx, u, v, data.headings[k][m], viewOf(k, m));
  if (lost(k, m)) ring(ctx, u, v, 11, colours.lost, 2.5);
  if (unfound(k, m)) ring(ctx, u, v, 11, colours.not_found_yet, 2.5);
}

// The thing nearest to a pixel of the map, in words; "" if nothing is near.
function named(u, v) {
  const k = state.k;
  const who = trackOwner(k);
  const found = [];
  const add = (x, y, text, bonus) => found.push([Math.hypot(px(x) - u, py(y) - v) - bonus, text]);
  data.people[k].forEach((at, m) => at && add(...at, `person ${m}: ${views(k, m)}; ${holders(k, m)}`, 6));
  data.uavs[k].forEach(([x, y, z], i) => add(x, y, `UAV ${i}${data.works[k][i] ? `, ${z.toFixed(1)} m up` : ", broken down"}`, 4));
  if (who >= 0) {
    for (const [number, x, y, a, b, , reported] of tracksOf(k, who)) {
      add(x, y, `track ${number} of UAV ${who}${reported ? "" : ", not reported"}: 95 % within ${a.toFixed(1)} × ${b.toFixed(1)} m`, 4);
    }
  }
  const near = found.filter(([gap]) => gap < 12).sort((one, other) => one[0] - other[0])[0];
  if (near) return near[1];
  const t = data.trees.findIndex(([x, y, r]) => Math.hypot(px(x) - u, py(y) - v) < r * map.scale);
  if (t < 0) return "";
  const [, , radius, , cover] = data.trees[t];
  const hides = cover < 1 ? `, hides ${Math.round(100 * cover)} % from above` : "";
  return `tree ${t}, canopy of ${radius} m radius${hides}`;
}

function line(ctx, points) {
  stroke(ctx, points.map(([x, y]) => [px(x), py(y)]));
}

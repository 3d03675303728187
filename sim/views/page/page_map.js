// The map: trees, area, people, UAVs with their views, tracks with ellipses and intents of one scan.

const map = { canvas: $("map"), ctx: $("map").getContext("2d"), scale: 1, x: 0, y: 0 };

// The UAV whose tracks are shown: the scene's, or the one that was chosen; -1 for none.
const trackOwner = (k) => (state.who === "" ? data.owner[k] : Number(state.who));

function sizeMap() {
  const width = map.canvas.parentElement.clientWidth;
  const aspect = (data.area[0] + 2 * data.margin) / (data.area[1] + 2 * data.margin);
  const height = Math.min(width / aspect, Math.max(320, 0.5 * innerHeight));
  fit(map.canvas, width, height);
}

// Sets where metres go: the whole area, or 40 m round the person or UAV that the map follows.
function aim(width, height) {
  const [kind, index] = state.follow.split(" ");
  const mark = kind && data[kind][state.k][index];
  const at = mark && mark.slice(1, 3);
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
  if (data.maps && trackOwner(k) >= 0) drawBelievedForest(ctx, data.maps.made[data.maps.believed[k][trackOwner(k)]]);
  const uavs = data.uavs[k].map(([look, x, y, z, view, believed, intent]) => ({ look: data.looks.uavs[look], x, y, view, believed, intent }));
  for (const uav of uavs) if (uav.view) drawView(ctx, uav);
  for (const uav of uavs) if (uav.believed) drawBelieved(ctx, uav);
  drawTrails(ctx, k);
  for (const uav of uavs) if (uav.intent) drawIntent(ctx, uav);
  const views = uavs.map((uav) => uav.view && bounds(uav.view));
  uavs.forEach((uav, i) => drawUav(ctx, uav, views[i], views.filter((view, j) => view && j !== i)));
  const who = trackOwner(k);
  if (who >= 0) for (const track of tracksOf(k, who)) drawTrack(ctx, track);
  data.people[k].forEach((person, m) => person && notePerson(person, m));
  writeNames(ctx);
  for (const person of data.people[k]) if (person) drawPerson(ctx, person);
  for (const [x, y] of data.detections[k]) drawDetection(ctx, px(x), py(y), 4);
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
  for (const [x, y, radius, cover, colour, edge] of data.trees) {
    ctx.globalAlpha = edge ? 0.6 * cover : 1;
    disc(ctx, px(x), py(y), edge ? radius * map.scale : Math.max(radius * map.scale, 1.8), colour);
    ctx.globalAlpha = 1;
    if (edge) ring(ctx, px(x), py(y), radius * map.scale, edge, 1);
  }
}

function outline(ctx, corners) {
  ctx.beginPath();
  for (let c = 0; c < corners.length; c += 2) ctx.lineTo(px(corners[c]), py(corners[c + 1]));
  ctx.closePath();
}

function drawBelieved(ctx, { look, believed }) {
  outline(ctx, believed);
  ctx.strokeStyle = look[1];
  ctx.lineWidth = 1;
  ctx.setLineDash([3, 3]);
  ctx.stroke();
  ctx.setLineDash([]);
}

// The crowns that a UAV has mapped, and the ground that it has not seen.
function drawBelievedForest(ctx, [crowns, strips]) {
  ctx.beginPath();
  for (let c = 0; c < strips.length; c += 4) {
    const [west, south, east, north] = strips.slice(c, c + 4);
    ctx.rect(px(west), py(north), (east - west) * map.scale, (north - south) * map.scale);
  }
  ctx.globalAlpha = 0.25;
  ctx.fillStyle = colours.unseen;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.setLineDash([3, 3]);
  for (let c = 0; c < crowns.length; c += 3) ring(ctx, px(crowns[c]), py(crowns[c + 1]), crowns[c + 2] * map.scale, colours.trunk, 1.5);
  ctx.setLineDash([]);
}

function drawView(ctx, { look, view }) {
  const [, colour, dashes] = look;
  outline(ctx, view);
  ctx.globalAlpha = 0.14;
  ctx.fillStyle = colour;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1.6;
  ctx.setLineDash(dashes);
  ctx.stroke();
  ctx.setLineDash([]);
}

// Trails of people, and those of the tracks on the scene's map.
function drawTrails(ctx, k) {
  ctx.lineWidth = 1;
  for (const [look, path, first, until] of data.trails[k]) {
    const [colour, ofTrack] = data.looks.trails[look];
    if (ofTrack && trackOwner(k) !== data.owner[k]) continue;
    ctx.strokeStyle = colour;
    line(ctx, data.paths[path].slice(first, until));
  }
}

function drawDetection(ctx, u, v, reach) {
  ring(ctx, u, v, reach, colours.ink, 4);
  ring(ctx, u, v, reach, colours.detection, 2);
}

function drawIntent(ctx, { look, x, y, intent }) {
  const path = [[x, y]];
  for (let c = 0; c < intent.length; c += 2) path.push([intent[c], intent[c + 1]]);
  const [u, v] = path[path.length - 1];
  ctx.setLineDash([2, 4]);
  ctx.strokeStyle = look[1];
  ctx.lineWidth = 2.5;
  line(ctx, path);
  ctx.setLineDash([]);
  ring(ctx, px(u), py(v), 4, look[1], 2);
}

// Left, top, right, bottom of a view in pixels.
function bounds(view) {
  const [xs, ys] = [0, 1].map((axis) => view.filter((_, c) => c % 2 === axis));
  return [px(Math.min(...xs)), py(Math.max(...ys)), px(Math.max(...xs)), py(Math.min(...ys))];
}

// Named at a corner of its view, if that has one.
function drawUav(ctx, { look, x, y }, view, others) {
  const [name, colour, , trouble, , touched] = look;
  const [u, v] = [px(x), py(y)];
  for (const [ink, width] of [[colours.panel, 5], [colour, 2.4]]) {
    ctx.strokeStyle = ink;
    ctx.lineWidth = width;
    for (const way of [1, -1]) stroke(ctx, [[u - 6, v - 6 * way], [u + 6, v + 6 * way]]);
    for (const dx of [-6, 6]) for (const dy of [-6, 6]) ring(ctx, u + dx, v + dy, 2.6, ink, width - 0.6);
  }
  if (trouble) {
    ctx.strokeStyle = trouble;
    ctx.lineWidth = 2.5;
    for (const way of [1, -1]) stroke(ctx, [[u - 13, v - 13 * way], [u + 13, v + 13 * way]]);
  }
  reserve(u, v, 8);
  if (touched) {
    ring(ctx, u, v, 15, colours.alarm, 3);
    want(`touched ${touched}`, u, v, colours.alarm, 16);
  }
  if (view) wantOutside(ctx, name, view, others, colour);
  else want(name, u, v, trouble ? colours.ink : colour, trouble ? 14 : 10);
}

function drawTrack(ctx, [look, x, y, a, b, turn]) {
  const [name, colour] = data.looks.tracks[look];
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
  want(name, px(x), py(y), colour, 8, { needed: !data.crowd });
}

// A disc with a line ahead, hollow if something hides the person, in a ring of the colour of the trouble.
function personMark(ctx, u, v, turn, [colour, hollow, trouble], reach = 11) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = 2;
  stroke(ctx, [[u, v], [u + 9 * Math.cos(turn), v - 9 * Math.sin(turn)]]);
  disc(ctx, u, v, 3.4, colour);
  if (hollow) disc(ctx, u, v, 1.9, colours.panel);
  if (trouble) ring(ctx, u, v, reach, trouble, 2.5);
}

function notePerson([look, x, y], m) {
  const [label, named] = data.looks.people[look];
  reserve(px(x), py(y), 10);
  const chosen = state.person === m;
  if (named || chosen) want(label, px(x), py(y), named || colours.ink, 12, { needed: chosen || !data.crowd });
}

function drawPerson(ctx, [look, x, y, heading]) {
  personMark(ctx, px(x), py(y), heading, data.looks.people[look].slice(2));
}

// The thing nearest to a pixel of the map, in words; "" if nothing is near.
function named(u, v) {
  const k = state.k;
  const who = trackOwner(k);
  const found = [];
  const add = (x, y, text, bonus) => found.push([Math.hypot(px(x) - u, py(y) - v) - bonus, text]);
  for (const [m, , views, holders] of nowOf(k)) {
    const mark = data.people[k][m];
    if (mark) add(mark[1], mark[2], `${data.names.people[m]}: ${views}; ${holders}`, 6);
  }
  for (const [look, x, y, z] of data.uavs[k]) add(x, y, data.looks.uavs[look][4].replace("{}", z.toFixed(1)), 4);
  for (const [look, x, y, a, b] of who >= 0 ? tracksOf(k, who) : []) {
    const text = data.looks.tracks[look][2].replace("{}", data.names.uavs[who]);
    add(x, y, `${text}: 95 % within ${a.toFixed(1)} × ${b.toFixed(1)} m`, 4);
  }
  const near = found.filter(([gap]) => gap < 12).sort((one, other) => one[0] - other[0])[0];
  if (near) return near[1];
  const tree = data.trees.find(([x, y, r]) => Math.hypot(px(x) - u, py(y) - v) < r * map.scale);
  return tree ? tree[6] : "";
}

function line(ctx, points) {
  stroke(ctx, points.map(([x, y]) => [px(x), py(y)]));
}

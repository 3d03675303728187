// The charts: the timeline of each person and OSPA over time, on one time axis with the slider.

const GUTTER = 100, RIGHT = 14, LANE = 4;
const people = data.people[0].length;
const rowHeight = Math.max(10, Math.min(26, Math.round(260 / Math.max(people, 1))));
const charts = { timeline: $("timeline"), ospa: $("ospa"), height: 125 };

const plotWidth = () => charts.ospa.clientWidth - GUTTER - RIGHT;
const snapped = (x) => Math.round(x * devicePixelRatio) / devicePixelRatio;
const xOf = (k) => GUTTER + ((k + 0.5) * plotWidth()) / scans;
const scanAt = (x) => clamp(Math.floor(((x - GUTTER) / plotWidth()) * scans));

function sizeCharts() {
  const width = $("charts").clientWidth;
  fit(charts.timeline, width, people ? people * rowHeight + 8 : 24);
  fit(charts.ospa, width, charts.height);
  const [from, to] = [xOf(0), xOf(scans - 1)];
  $("slider").style.left = `${from - 8}px`; // half a thumb
  $("slider").style.width = `${to - from + 16}px`;
  drawTimeline();
  drawOspa();
}

function drawTimeline() {
  const ctx = charts.timeline.getContext("2d");
  ctx.clearRect(0, 0, charts.timeline.clientWidth, charts.timeline.clientHeight);
  if (!people) write(ctx, "nobody is there", GUTTER, 12, colours.faint, "left");
  for (let m = 0; m < people; m++) {
    const top = 4 + m * rowHeight;
    write(ctx, people > 12 ? String(m) : `person ${m}`, GUTTER - 8, top + rowHeight / 2 - 1, colours.ink, "right");
    for (let k = 0; k < scans; k++) drawCell(ctx, k, m, top);
  }
}

// One scan of one person: stripes of the UAVs that detect them, or what hides them; below, whether they are held.
function drawCell(ctx, k, m, top) {
  if (data.people[k][m] === null) return;
  const [left, right] = [k, k + 1].map((edge) => snapped(xOf(edge - 0.5))); // else seams would show
  const width = right - left;
  const high = rowHeight - LANE - 3;
  const told = data.codes[k].map((row) => row[m]);
  const seen = told.flatMap((code, i) => (code === SEEN ? [uavColour(i)] : []));
  const other = told.includes(MISSED) ? colours.detection : told.some((c) => c >= HIDDEN) ? colours.canopy : colours.line;
  const stripes = seen.length ? seen : [other];
  stripes.forEach((colour, s) => {
    ctx.fillStyle = colour;
    ctx.fillRect(left, top + (s * high) / stripes.length, width, high / stripes.length);
  });
  ctx.fillStyle = lost(k, m) ? colours.alarm : colours.ink;
  if (lost(k, m)) ctx.fillRect(left, top + high, width, LANE);
  else ctx.fillRect(left, top + high + LANE / 2 - 0.75, width, 1.5);
}

function drawOspa() {
  const ctx = charts.ospa.getContext("2d");
  const bottom = charts.height - 22;
  const level = (value) => (value <= 1 ? 1.2 * value : 1.2 + Math.log10(value)); // linear below a metre
  const top = level(Math.max(1.5, 1.15 * Math.max(0, ...data.ospa.flat().map((v) => v || 0))));
  const y = (value) => bottom - (level(value) / top) * (bottom - 8);
  ctx.clearRect(0, 0, charts.ospa.clientWidth, charts.height);
  write(ctx, "OSPA", 8, bottom / 2 - 7, colours.ink, "left");
  for (const tick of [0, 0.5, 1, 2, 5, 10, 20, 50]) {
    if (level(tick) > top) continue;
    ctx.strokeStyle = tick === 1 ? colours.faint : colours.line;
    ctx.setLineDash(tick === 1 ? [5, 4] : []);
    ctx.lineWidth = 1;
    stroke(ctx, [[GUTTER, y(tick)], [GUTTER + plotWidth(), y(tick)]]);
    write(ctx, String(tick), GUTTER - 8, y(tick), colours.soft, "right");
  }
  ctx.setLineDash([]);
  drawTimes(ctx, bottom);
  const curve = (of, colour, width) => {
    ctx.strokeStyle = ctx.fillStyle = colour;
    ctx.lineWidth = width;
    let run = [];
    for (let k = 0; k <= scans; k++) {
      const value = k < scans ? of(k) : null;
      if (value !== null) run.push([xOf(k), y(value)]);
      else if (run.length === 1) disc(ctx, ...run[0], 2, colour);
      else stroke(ctx, run);
      if (value === null) run = [];
    }
  };
  for (let i = 0; i < data.ospa[0].length; i++) curve((k) => data.ospa[k][i], uavColour(i), 1.2);
  curve(fleetMean, colours.ink, 2);
}

// Mean OSPA over the UAVs that work; null if none does.
function fleetMean(k) {
  const known = data.ospa[k].filter((value) => value !== null);
  return known.length ? known.reduce((sum, value) => sum + value, 0) / known.length : null;
}

function drawTimes(ctx, bottom) {
  const span = data.times[scans - 1] - data.times[0];
  const step = [0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600].find((s) => span / s <= 10) || 7200;
  for (let time = 0; time <= span + 1e-9; time += step) {
    const x = scans > 1 ? xOf((time / span) * (scans - 1)) : xOf(0);
    ctx.strokeStyle = colours.faint;
    ctx.lineWidth = 1;
    stroke(ctx, [[x, bottom], [x, bottom + 4]]);
    write(ctx, `${Number(time.toFixed(1))}${time === 0 ? " s" : ""}`, x, bottom + 13, colours.soft, "center");
  }
}

function bindCharts(go) {
  for (const canvas of [charts.timeline, charts.ospa]) {
    const jump = (event) => go(scanAt(event.clientX - canvas.getBoundingClientRect().left));
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      jump(event);
    });
    canvas.addEventListener("pointermove", (event) => event.buttons === 1 && jump(event));
  }
}

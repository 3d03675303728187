// The charts: the timeline of each person and OSPA over time, on one time axis with the slider.

const RIGHT = 14, BAR = 4, FOLDED = 30;
const { rows, folded, unmatched } = data.timeline;
const GUTTER = data.timeline.bracketed ? 170 : 100;
const simultaneous = 1 + unmatched.bars.reduce((most, bar) => Math.max(most, bar[3]), -1); // tracks of no person
const thin = Math.min(BAR + 2, 72 / Math.max(simultaneous, 1)); // height of one, with its gap
const deep = thin * simultaneous;
const lanes = rows.reduce((sum, row) => sum + row.lanes.length + 1, 0);
const lane = Math.max(2, Math.min(10, Math.floor(260 / Math.max(1, lanes))));
const tops = []; // of the rows, then of the row of people without one
for (let n = 0, top = 4; n <= rows.length; n++) {
  tops.push(top);
  if (n < rows.length) top += Math.max(rows[n].lanes.length * lane + BAR + 8, 15); // else names overlap
}
const low = tops[rows.length] + (folded ? FOLDED + 8 : 0) + (data.people[0].length ? 0 : 16);
const charts = { timeline: $("timeline"), ospa: $("ospa"), height: data.labelled ? 125 : 30 };

const plotWidth = () => charts.ospa.clientWidth - GUTTER - RIGHT;
const snapped = (x) => Math.round(x * devicePixelRatio) / devicePixelRatio;
const xOf = (k) => GUTTER + (k * plotWidth()) / scans; // of the instant of a scan, which stands for the time until the next
const scanAt = (x) => clamp(Math.floor(((x + 1 - GUTTER) / plotWidth()) * scans)); // a pixel before a scan is still the scan

function sizeCharts() {
  const width = $("charts").clientWidth;
  fit(charts.timeline, width, low + 4 + (deep && deep + 6));
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
  if (!data.people[0].length && data.labelled) write(ctx, "no people", GUTTER, 12, colours.faint, "left");
  rows.forEach((row, n) => {
    write(ctx, row.name, GUTTER - 8, (tops[n] + tops[n + 1]) / 2 - 3, colours.ink, "right");
    row.lanes.forEach((spans, i) => spans.forEach((bar) => drawLane(ctx, bar, tops[n] + i * lane)));
    for (const [shade, first, until] of row.holds) span(ctx, first, until, barOf(n), BAR, shade);
  });
  if (folded) drawFolded(ctx, tops[rows.length]);
  if (deep) write(ctx, unmatched.name, GUTTER - 8, low + deep / 2 - 1, colours.ink, "right");
  for (const [shade, first, until, row] of unmatched.bars) {
    span(ctx, first, until, low + row * thin, Math.max(thin - 2, 1), shade);
  }
  for (const [k, n] of data.timeline.switches) {
    diamond(ctx, xOf(k), n < 0 ? tops[rows.length] + FOLDED / 2 : barOf(n) + BAR / 2);
  }
}

// Top of the bar of the tracks in a row.
const barOf = (n) => tops[n + 1] - BAR - 7;

// Shares of the people without a row of their own by their states to the tracks.
function drawFolded(ctx, top) {
  write(ctx, folded.name, GUTTER - 8, top + FOLDED / 2, colours.ink, "right");
  for (const [shade, first, until, above, high] of folded.bars) span(ctx, first, until, top + FOLDED * above, FOLDED * high, shade);
}

// Fills what stands for some scans, both included.
function span(ctx, first, until, top, high, shade) {
  const [left, right] = [first, until + 1].map((edge) => snapped(xOf(edge))); // else seams would show
  ctx.fillStyle = data.timeline.shades[shade];
  ctx.fillRect(left, top, right - left, high);
}

// The state of one person to one camera for a while; a slim one is of little interest.
function drawLane(ctx, [shade, first, until, , high], top) {
  if (high < 0.5) span(ctx, first, until, top + lane / 3, lane / 3, shade);
  else span(ctx, first, until, top, Math.max(lane - 0.5, 1.5), shade);
}

function diamond(ctx, x, y) {
  ctx.beginPath();
  for (const [dx, dy] of [[0, -5], [5, 0], [0, 5], [-5, 0]]) ctx.lineTo(x + dx, y + dy);
  ctx.closePath();
  ctx.fillStyle = colours.orange;
  ctx.fill();
  ctx.strokeStyle = colours.ink;
  ctx.lineWidth = 1;
  ctx.stroke();
}

function drawOspa() {
  const ctx = charts.ospa.getContext("2d");
  const bottom = charts.height - 22;
  const level = (value) => (value <= 1 ? 1.2 * value : 1.2 + Math.log10(value)); // linear below a metre
  const top = level(Math.max(1.5, 1.15 * Math.max(0, ...data.ospa.flat().map((v) => v || 0))));
  const y = (value) => bottom - (level(value) / top) * (bottom - 8);
  ctx.clearRect(0, 0, charts.ospa.clientWidth, charts.height);
  if (!data.labelled) return drawTimes(ctx, bottom);
  write(ctx, "OSPA", 8, bottom / 2 - 7, colours.ink, "left");
  let lowest = Infinity;
  for (const tick of [0, 0.5, 1, 2, 5, 10, 20, 50]) {
    if (level(tick) > top || lowest - y(tick) < 13) continue; // else one number would cover the last
    lowest = y(tick);
    ctx.strokeStyle = tick === 1 ? colours.faint : colours.line;
    ctx.setLineDash(tick === 1 ? [5, 4] : []);
    ctx.lineWidth = 1;
    stroke(ctx, [[GUTTER, y(tick)], [GUTTER + plotWidth(), y(tick)]]);
    write(ctx, String(tick), GUTTER - 8, y(tick), colours.soft, "right");
  }
  ctx.setLineDash([]);
  drawTimes(ctx, bottom);
  const curve = (of, colour, width, dashes) => {
    ctx.strokeStyle = ctx.fillStyle = colour;
    ctx.setLineDash(dashes);
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
  data.lines.forEach(([colour, dashes], i) => curve((k) => data.ospa[k][i], colour, 1.2, dashes));
  curve((k) => data.mean[k], colours.ink, 2, []);
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

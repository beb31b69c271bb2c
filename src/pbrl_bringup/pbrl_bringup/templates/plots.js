// Curves over time with the slider's cursor.

const PLOT = { width: 540, height: 118, left: 52, right: 10, top: 20, bottom: 20 };

function unwrap(angles) {
  const out = [angles[0]];
  for (let i = 1; i < angles.length; i++) {
    out.push(out[i - 1] + wrapped(angles[i] - angles[i - 1]));
  }
  return out;
}

// Lowest and highest value of the draws at each time.
function envelope(lists) {
  if (!lists.length) return null;
  const across = lists[0].map((_, i) => lists.map((list) => list[i]));
  return { low: across.map((v) => Math.min(...v)), high: across.map((v) => Math.max(...v)) };
}

// What a plot shows: all of what was recorded, and predictions as far as they stay within twice its span.
function range(series) {
  const ends = (values) => { const known = values.filter((v) => v !== null); return [Math.min(...known), Math.max(...known)]; };
  const [low, high] = ends(series[0].values), reach = Math.max(high - low, 1e-3);
  const all = series.map((s) => ends(s.values));
  return [Math.max(Math.min(...all.map((e) => e[0])), low - reach), Math.min(Math.max(...all.map((e) => e[1])), high + reach)];
}

// One plot: `series` of {values, kind}; returns a function that moves the cursor to a time.
function drawPlot(parent, title, unit, time, series, band, last) {
  const height = PLOT.height + (last ? 14 : 0), svg = element(parent, "svg", { viewBox: `0 0 ${PLOT.width} ${height}` });
  let [low, high] = range(series);
  const pad = Math.max(0.08 * (high - low), 1e-3);
  low -= pad; high += pad;
  const end = time[time.length - 1] || 1, bottom = PLOT.height - PLOT.bottom;
  const X = (t) => PLOT.left + (t / end) * (PLOT.width - PLOT.left - PLOT.right);
  const Y = plotAxes(svg, PLOT, [low, high], title, unit);
  if (last) {
    timeAxis(svg, X, 0, end, bottom);
    element(svg, "text", { x: X(end), y: bottom + 31, "text-anchor": "end" }, "seconds since the push began");
  }
  const inside = element(svg, "svg", { x: 0, y: PLOT.top - 4, width: PLOT.width, height: bottom - PLOT.top + 8,
    viewBox: `0 ${PLOT.top - 4} ${PLOT.width} ${bottom - PLOT.top + 8}` });
  if (band) {
    const there = time.map((t, i) => [X(t), Y(band.high[i])]), back = time.map((t, i) => [X(t), Y(band.low[i])]).reverse();
    element(inside, "path", { class: "band", d: path([...there, ...back], true) });
  }
  for (const { values, kind } of series) {
    element(inside, "path", { class: kind + " curve", d: path(values.map((v, i) => [X(time[i]), Y(v)])) });
  }
  const cursor = element(svg, "path", { class: "cursor" });
  return (t) => cursor.setAttribute("d", `M${X(t)} ${PLOT.top - 2}V${bottom}`);
}

// Whether anything told the heading: an angle that never moves by the least bit was not recorded.
function headingSeen(episode) {
  return episode.recorded.some((pose) => pose[2] !== episode.recorded[0][2]);
}

function drawMotion(parent, episode) {
  parent.replaceChildren();
  const columns = [["to the right, x", "m", 0, 1], ["away, y", "m", 1, 1], ["turned", "degrees", 2, 180 / Math.PI]];
  if (!headingSeen(episode)) columns.pop();
  return columns.map(([title, unit, k, factor], row) => {
    // Angles are shown from where the push began, each unwound along its own path.
    const start = k === 2 ? episode.recorded[0][2] : 0;
    const column = (poses) => (k === 2 ? unwrap([start, ...poses.map((p) => p[2])]).slice(1) : poses.map((p) => p[k])).map((v) => (v - start) * factor);
    const series = [{ values: column(episode.recorded), kind: "recorded" }];
    if (episode.before.length) series.push({ values: column(episode.before), kind: "before" });
    if (episode.after.length) series.push({ values: column(episode.after), kind: "after" });
    return drawPlot(parent, title, unit, episode.time, series, envelope(episode.draws.map(column)), row === columns.length - 1);
  });
}

function drawEffort(parent, episode) {
  parent.replaceChildren();
  const columns = [["force to the right", "newton", 0], ["force away", "newton", 1], ["turning moment about its middle", "newton metre", 2]];
  if (episode.wrench.every((w) => w[2] === 0)) columns.pop();
  return columns.map(([title, unit, k], row) =>
    drawPlot(parent, title, unit, episode.time, [{ values: episode.wrench.map((w) => w[k]), kind: "effortline" }], null, row === columns.length - 1));
}

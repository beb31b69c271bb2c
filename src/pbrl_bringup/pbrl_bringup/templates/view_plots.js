// Curves of the wrenches over the shown interval of time, who holds what, and the cursor.

const CURVE = { left: 52, right: 12, top: 22, bottom: 6, height: 104, axis: 22 };
const AXES = ["x", "y", "z"];
const MOST_POINTS = 3000; // of one curve

// `set(t)` moves the time of the page; `zoomed(from, to)` is told the interval that is shown from now on.
function makePlots(parent, data, streams, { span, set, zoomed, kept }) {
  let shown = kept || [...span()], time = 0, plots = [];

  const wanted = () => {
    const felt = data.grippers.map((gripper, i) => ({ kind: "wrenches", i, names: AXES, note: gripper.felt })).filter((each) => streams.whole("wrenches", each.i));
    const forces = felt.map((each) => ({ ...each, columns: [0, 1, 2], unit: "N", title: `force, ${data.grippers[each.i].name}` }));
    const torques = felt.filter((each) => data.grippers[each.i].torque)
      .map((each) => ({ ...each, columns: [3, 4, 5], unit: "N m", title: `torque, ${data.grippers[each.i].name}` }));
    return [...forces, ...torques, ...data.residuals.flatMap((each, i) => {
      const common = { kind: "residuals", i, moments: each.when };
      const of = data.objects[each.object].name;
      return [{ ...common, columns: [0, 1], names: ["x", "y"], unit: "N", title: `force that the model lacks, ${of}` },
        { ...common, columns: [2], names: ["moment"], unit: "N m", title: `moment that the model lacks, ${of}` }];
    })];
  };

  function draw() {
    parent.replaceChildren();
    const list = wanted(), held = data.grasps.length > 0;
    plots = [];
    const columns = Math.min(2, Math.max(list.length, 1)), width = Math.max(320, Math.floor((parent.clientWidth - 12 * (columns - 1)) / columns));
    parent.style.setProperty("--columns", String(columns));
    list.forEach((what, k) => plots.push(drawCurve(what, width, k >= list.length - columns)));
    if (held) plots.push(drawHeld(parent.clientWidth || 900));
    move(time);
  }

  const X = (box) => (t) => box.left + ((t - shown[0]) / (shown[1] - shown[0] || 1)) * (box.width - box.left - box.right);

  function limits(found, columns) {
    let low = Infinity, high = -Infinity;
    const first = indexBefore(found.time, shown[0]), last = Math.min(indexBefore(found.time, shown[1]) + 1, found.time.length - 1);
    for (const column of columns) {
      for (let k = first; k <= last; k++) {
        const a = found.low[column][k], b = (found.high || found.low)[column][k];
        if (a !== null && a < low) low = a;
        if (b !== null && b > high) high = b;
      }
    }
    if (!(low <= high)) return [-1, 1];
    const pad = Math.max(0.06 * (high - low), 0.05);
    return [low - pad, high + pad];
  }

  function drawCurve(what, width, last) {
    const box = { ...CURVE, width, height: CURVE.height + (last ? CURVE.axis - CURVE.bottom : 0), bottom: last ? CURVE.axis : CURVE.bottom };
    const figure = document.createElement("figure");
    parent.append(figure);
    const svg = element(figure, "svg", { viewBox: `0 0 ${width} ${box.height}`, role: "img", "aria-label": `${what.title} over time` });
    svg.dataset.plot = `${what.kind}-${what.i}-${what.columns[0]}`;
    const found = streams.curve(what.kind, what.i, shown[0], shown[1]), x = X(box);
    const Y = plotAxes(svg, box, limits(found, what.columns), what.title, what.unit), bottom = box.height - box.bottom;
    const key = element(svg, "text", { x: width - box.right - 44, y: 13, "text-anchor": "end" });
    if (what.names.length > 1) what.names.forEach((name, k) => element(key, "tspan", { class: `key${k}`, dx: 8 }, name));
    if (what.note) element(svg, "title", {}, what.note);
    if (last) timeAxis(svg, x, shown[0], shown[1], bottom, Math.max(4, Math.floor(width / 90)));
    const inside = element(svg, "svg", { x: box.left, y: box.top - 3, width: width - box.left - box.right, height: bottom - box.top + 6,
      viewBox: `${box.left} ${box.top - 3} ${width - box.left - box.right} ${bottom - box.top + 6}` });
    for (const [a, b] of what.moments || []) element(inside, "rect", { class: "acting", x: x(a), y: 0, width: Math.max(x(b) - x(a), 1), height: bottom });
    what.columns.forEach((column, k) => drawBand(inside, found, column, x, Y, k));
    const cursor = element(svg, "path", { class: "cursor", d: `M0 ${box.top - 3}V${bottom}` });
    listen(svg, box);
    return (t) => place1(cursor, x(t), box);
  }

  // A band from least to greatest, and lines along both: a single sample is still seen as a line.
  function drawBand(parent, found, column, x, Y, k) {
    const low = found.low[column], high = (found.high || found.low)[column], { time } = found;
    const from = indexBefore(time, shown[0]), to = Math.min(indexBefore(time, shown[1]) + 1, time.length - 1);
    const limit = Math.max(found.gap, (3 * (time[time.length - 1] - time[0])) / Math.max(time.length - 1, 1));
    const many = Math.ceil((to - from) / MOST_POINTS);
    if (many > 1) return drawBand(parent, gathered(found, column, from, to, many), 0, x, Y, k);
    let line = "", band = "", part = [];
    const close = () => {
      if (found.high && part.length) {
        band += path([...part.map((j) => [x(time[j]), Y(high[j])]), ...part.reverse().map((j) => [x(time[j]), Y(low[j])])], true);
        part.reverse();
      }
      if (part.length) line += path(part.map((j) => [x(time[j]), Y((low[j] + high[j]) / 2)]));
      part = [];
    };
    for (let j = from; j <= to; j++) {
      if (low[j] === null || (part.length && time[j] - time[j - 1] > limit)) close();
      if (low[j] !== null) part.push(j);
    }
    close();
    if (band) element(parent, "path", { class: `band${k}`, d: band });
    element(parent, "path", { class: `line${k}`, d: line });
  }

  // One column with every so many samples as one, from the least to the greatest of them.
  function gathered({ time, low, high, gap }, column, from, to, many) {
    const out = { time: [], low: [[]], high: [[]], gap };
    for (let j = from; j <= to; j += many) {
      const end = Math.min(j + many, to + 1), lows = low[column].slice(j, end), highs = (high || low)[column].slice(j, end);
      out.time.push(time[Math.floor((j + end - 1) / 2)]);
      out.low[0].push(lows.includes(null) ? null : Math.min(...lows));
      out.high[0].push(highs.includes(null) ? null : Math.max(...highs));
    }
    return out;
  }

  // A lane a gripper: bars while it holds something, with the name of what it holds.
  function drawHeld(width) {
    const box = { left: CURVE.left, right: CURVE.right, width }, lane = 18, x = X(box);
    const figure = document.createElement("figure");
    figure.className = "held";
    parent.append(figure);
    const height = lane * data.grippers.length + 2;
    const svg = element(figure, "svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": "who holds what over time" });
    const inside = element(svg, "svg", { x: box.left, y: 0, width: width - box.left - box.right, height, viewBox: `${box.left} 0 ${width - box.left - box.right} ${height}` });
    data.grippers.forEach((gripper, i) => element(svg, "text", { x: box.left - 7, y: lane * i + 13, "text-anchor": "end" }, gripper.name));
    for (const grasp of data.grasps) {
      const row = data.grippers.findIndex((each) => each.name === grasp.gripper), object = data.objects.findIndex((each) => each.name === grasp.object);
      const end = grasp.open ? Math.max(grasp.end, data.end) : grasp.end;
      const left = Math.max(x(grasp.start), box.left), wide = x(end) - left;
      if (wide <= 0) continue;
      element(inside, "rect", { class: `grasp ${colour(Math.max(object, 0))}`, x: left, y: lane * row + 1, width: wide, height: lane - 3, rx: 3 });
      if (wide > 30) element(inside, "text", { class: "grasptext", x: left + 5, y: lane * row + 13 }, grasp.object.slice(0, Math.floor(wide / 6.4)));
    }
    const cursor = element(svg, "path", { class: "cursor", d: `M0 0V${height}` });
    listen(svg, box);
    return (t) => place1(cursor, x(t), box);
  }

  function place1(cursor, x, box) {
    const inside = x >= box.left - 1 && x <= box.width - box.right + 1;
    cursor.setAttribute("visibility", inside ? "visible" : "hidden");
    if (inside) cursor.setAttribute("transform", `translate(${x.toFixed(1)} 0)`);
  }

  function listen(svg, box) {
    const at = (event) => {
      const frame = svg.getBoundingClientRect(), x = ((event.clientX - frame.left) / frame.width) * box.width;
      return shown[0] + ((x - box.left) / (box.width - box.left - box.right)) * (shown[1] - shown[0]);
    };
    let held = false;
    svg.addEventListener("pointerdown", (event) => { held = true; svg.setPointerCapture(event.pointerId); set(at(event)); });
    svg.addEventListener("pointermove", (event) => { if (held) set(at(event)); });
    for (const kind of ["pointerup", "pointercancel"]) svg.addEventListener(kind, () => { held = false; });
    svg.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(event.deltaY * 0.0015), at(event)); }, { passive: false });
  }

  // Show more or less time about a moment, never beyond the recording and never less than a twentieth of a second.
  function zoom(factor, about = time) {
    const [start, end] = span(), long = Math.min(Math.max((shown[1] - shown[0]) * factor, 0.05), end - start);
    const share = Math.min(Math.max((about - shown[0]) / (shown[1] - shown[0] || 1), 0), 1);
    const from = Math.min(Math.max(about - share * long, start), end - long);
    show(from, from + long);
  }

  function show(from, to) {
    shown = [from, to];
    draw();
    zoomed(from, to);
  }

  // The interval follows a cursor that leaves it.
  function move(t) {
    time = t;
    const long = shown[1] - shown[0], [start, end] = span();
    if ((t < shown[0] || t > shown[1]) && long < end - start) {
      const from = Math.min(Math.max(t - (t > shown[1] ? 0.1 : 0.9) * long, start), end - long);
      show(from, from + long);
      return;
    }
    for (const plot of plots) plot(t);
  }

  // New data: the interval keeps its length and reaches to the end.
  function follow(end) {
    const long = shown[1] - shown[0], from = Math.max(end - long, span()[0]);
    shown = [from, from + long];
    draw();
  }

  draw();
  return { draw, move, zoom, follow, whole: () => show(...span()), shown: () => shown };
}

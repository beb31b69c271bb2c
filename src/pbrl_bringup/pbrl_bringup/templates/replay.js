// Recording and simulation side by side under one time: slider, button, keys. No library, nothing from outside.

const SVG = "http://www.w3.org/2000/svg";
// Drawn at the size at which they are first shown, so that letters are as large as the page's.
const PANEL = { width: 560, height: 460, margin: 26 };
const STRIP = { width: 1120, height: 150, left: 58, right: 16, top: 14, bottom: 34 };

const TICK = 40; // Milliseconds between pictures: recorded poses are further apart.
const APART = 0.75; // Seconds between moments from which on there was no hold in between.

function add(parent, name, attributes, text) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text) node.textContent = text;
  parent.appendChild(node);
  return node;
}

const line = (points, closed) => (points.length ? "M" + points.map((p) => p[0].toFixed(1) + " " + p[1].toFixed(1)).join("L") + (closed ? "Z" : "") : "");
const placed = (outline, [x, y, turn]) => {
  const c = Math.cos(turn), s = Math.sin(turn);
  return outline.map(([a, b]) => [x + c * a - s * b, y + s * a + c * b]);
};
const wrapped = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));

function niceStep(span, count) {
  const rough = span / count, power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= rough);
}

function length(metres) {
  const size = Math.abs(metres);
  return size >= 0.995 ? size.toFixed(1) + " m" : size >= 0.0995 ? (100 * size).toFixed(0) + " cm" : (1000 * size).toFixed(size < 0.01 ? 1 : 0) + " mm";
}

// The part of the floor that the object and what is named keep to; a simulation that runs away is cut off.
function floorBox(data) {
  const points = data.recorded.flatMap((pose) => placed(data.outline, pose)).concat(data.hand);
  const low = [0, 1].map((k) => Math.min(...points.map((p) => p[k]))), high = [0, 1].map((k) => Math.max(...points.map((p) => p[k])));
  for (const place of data.places.filter((each) => !each.onBody)) {
    for (const k of [0, 1]) {
      const reach = 0.6 * (high[k] - low[k]) + 0.3;
      for (const p of place.shape) {
        if (p[k] < low[k] && p[k] > low[k] - reach) low[k] = p[k];
        if (p[k] > high[k] && p[k] < high[k] + reach) high[k] = p[k];
      }
    }
  }
  return [...low, ...high];
}

function mapping([left, bottom, right, top]) {
  const inner = [PANEL.width - 2 * PANEL.margin, PANEL.height - 2 * PANEL.margin];
  const scale = Math.min(inner[0] / (right - left || 1), inner[1] / (top - bottom || 1));
  const x = (left + right) / 2, y = (bottom + top) / 2;
  return { scale, map: (p) => [PANEL.width / 2 + scale * (p[0] - x), PANEL.height / 2 - scale * (p[1] - y)],
    left: x - PANEL.width / 2 / scale, right: x + PANEL.width / 2 / scale,
    bottom: y - PANEL.height / 2 / scale, top: y + PANEL.height / 2 / scale };
}

function drawFloor(svg, view, data) {
  svg.setAttribute("viewBox", `0 0 ${PANEL.width} ${PANEL.height}`);
  const step = niceStep(view.right - view.left, 6);
  let lines = "";
  for (let x = Math.ceil(view.left / step) * step; x < view.right; x += step) lines += `M${view.map([x, 0])[0].toFixed(1)} 0V${PANEL.height}`;
  for (let y = Math.ceil(view.bottom / step) * step; y < view.top; y += step) lines += `M0 ${view.map([0, y])[1].toFixed(1)}H${PANEL.width}`;
  add(svg, "path", { class: "grid", d: lines });
  if (data.room.length) add(svg, "path", { class: "room", d: line(data.room.map(view.map), true) });
  const bar = view.scale * step;
  add(svg, "path", { class: "axis", d: `M14 ${PANEL.height - 14}h${bar.toFixed(1)}m0 -5v10m${-bar.toFixed(1)} 0v-10` });
  add(svg, "text", { x: 14 + bar / 2, y: PANEL.height - 20, "text-anchor": "middle", class: "halo" }, length(step));
}

// What is named and stands in the room is drawn once; what is on the body moves with it.
function drawPlaces(svg, view, data) {
  const moving = [];
  for (const place of data.places) {
    const shape = add(svg, "path", { class: "place" }), text = add(svg, "text", { class: "placetext halo", "text-anchor": "middle" }, place.effect);
    const show = (pose) => {
      const corners = (place.onBody ? placed(place.shape, pose) : place.shape).map(view.map);
      shape.setAttribute("d", line(corners, true));
      const middle = [0, 1].map((k) => corners.reduce((sum, p) => sum + p[k], 0) / corners.length);
      text.setAttribute("x", Math.min(Math.max(middle[0], 50), PANEL.width - 50));
      text.setAttribute("y", Math.min(Math.max(Math.min(...corners.map((p) => p[1])) - 6, 16), PANEL.height - 30));
    };
    if (place.onBody) moving.push(show);
    else show();
  }
  return (pose) => moving.forEach((show) => show(pose));
}

function drawRecording(svg, view, data) {
  drawFloor(svg, view, data);
  const way = data.recorded.map((pose, k) => (k && data.time[k] - data.time[k - 1] < APART ? "L" : "M") + view.map(pose).map((v) => v.toFixed(1)).join(" "));
  add(svg, "path", { class: "recorded trail", d: way.join("") });
  const body = add(svg, "path", { class: "recorded body" }), places = drawPlaces(svg, view, data);
  const shaft = add(svg, "path", { class: "force" }), head = add(svg, "path", { class: "forcehead" });
  const hand = add(svg, "circle", { class: "gripper", r: 6 }), newtons = add(svg, "text", { class: "forcetext halo", "text-anchor": "middle" });
  const most = Math.max(...data.force.map(([x, y]) => Math.hypot(x, y)), 1e-9);
  return (k) => {
    body.setAttribute("d", line(placed(data.outline, data.recorded[k]).map(view.map), true));
    places(data.recorded[k]);
    const [x, y] = view.map(data.hand[k]), [fx, fy] = data.force[k], size = Math.hypot(fx, fy);
    hand.setAttribute("cx", x);
    hand.setAttribute("cy", y);
    const long = (95 * size) / most, [ux, uy] = size ? [fx / size, -fy / size] : [0, 0];
    const [ex, ey] = [x + long * ux, y + long * uy], shown = long > 12;
    shaft.setAttribute("d", shown ? `M${x.toFixed(1)} ${y.toFixed(1)}L${(ex - 8 * ux).toFixed(1)} ${(ey - 8 * uy).toFixed(1)}` : "");
    head.setAttribute("d", shown ? line([[ex, ey], [ex - 11 * ux - 5 * uy, ey - 11 * uy + 5 * ux], [ex - 11 * ux + 5 * uy, ey - 11 * uy - 5 * ux]], true) : "");
    newtons.textContent = size.toFixed(size < 10 ? 1 : 0) + " N";
    newtons.setAttribute("x", Math.min(Math.max(ex + 18 * ux, 24), PANEL.width - 24));
    newtons.setAttribute("y", Math.min(Math.max(ey + 18 * uy + 4, 14), PANEL.height - 6));
  };
}

function drawSimulation(svg, view, data) {
  drawFloor(svg, view, data);
  const ghost = add(svg, "path", { class: "ghost" }), places = drawPlaces(svg, view, data);
  const kinds = ["before", "after"].filter((kind) => data[kind]);
  const trails = kinds.map((kind) => add(svg, "path", { class: kind + " trail" }));
  const bodies = kinds.map((kind) => add(svg, "path", { class: kind }));
  return (k, enlarge) => {
    const larger = (pose, real) => pose.map((value, i) => real[i] + enlarge * (i === 2 ? wrapped(value - real[i]) : value - real[i]));
    let first = k;
    while (first > 0 && data.stretch[first - 1] === data.stretch[k]) first -= 1;
    ghost.setAttribute("d", line(placed(data.outline, data.recorded[k]).map(view.map), true));
    kinds.forEach((kind, i) => {
      const pose = larger(data[kind][k], data.recorded[k]);
      const way = data[kind].slice(first, k + 1).map((each, j) => view.map(larger(each, data.recorded[first + j])));
      bodies[i].setAttribute("d", line(placed(data.outline, pose).map(view.map), true));
      trails[i].setAttribute("d", line(way));
    });
    places(data[kinds[kinds.length - 1]][k]);
  };
}

function drawStrip(svg, data, errors) {
  const { width, height, left, right, top, bottom } = STRIP;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const end = data.time[data.time.length - 1] || 1, kinds = Object.keys(errors);
  const most = Math.max(...kinds.flatMap((kind) => errors[kind]), 3 * data.noise, 1e-4);
  const x = (t) => left + (t / end) * (width - left - right), y = (e) => height - bottom - (e / most) * (height - top - bottom);
  const band = ([a, b], kind) => add(svg, "rect", { class: kind, x: x(Math.max(a, 0)), y: top, width: Math.max(x(Math.min(b, end)) - x(Math.max(a, 0)), 0), height: height - top - bottom });
  data.heldOut.forEach((each) => band(each, "heldout"));
  data.moments.forEach((each) => band(each, "acting"));
  for (let e = 0, step = niceStep(most, 3); e <= most; e += step) {
    add(svg, "path", { class: "grid", d: `M${left} ${y(e).toFixed(1)}H${width - right}` });
    add(svg, "text", { x: left - 8, y: y(e) + 4, "text-anchor": "end" }, e ? length(e) : "0");
  }
  for (let t = 0, step = niceStep(end, STRIP.width / 120); t <= end; t += step) add(svg, "text", { x: x(t), y: height - 14, "text-anchor": "middle" }, `${+t.toFixed(3)} s`);
  if (data.noise) add(svg, "path", { class: "noise", d: `M${left} ${y(data.noise).toFixed(1)}H${width - right}` });
  for (const kind of kinds) {
    const parts = new Map();
    data.time.forEach((t, k) => parts.set(data.stretch[k], [...(parts.get(data.stretch[k]) || []), [x(t), y(errors[kind][k])]]));
    add(svg, "path", { class: kind + " curve", d: [...parts.values()].map((each) => line(each)).join("") });
  }
  const cursor = add(svg, "path", { class: "cursor" });
  return { x, end, move: (t) => cursor.setAttribute("d", `M${x(t).toFixed(1)} ${top - 6}V${height - bottom}`) };
}

function makeReplay(section) {
  section.hidden = false;
  PANEL.width = section.querySelector(".recording svg").clientWidth || PANEL.width;
  PANEL.height = Math.round(0.82 * PANEL.width);
  STRIP.width = section.querySelector(".strip svg").clientWidth || STRIP.width;
  const data = JSON.parse(section.querySelector("script").textContent), find = (selector) => section.querySelector(selector);
  const slider = find("input[type=range]"), button = find(".play"), clock = find(".clock"), now = find(".now"), enlarge = find(".enlarge");
  const kinds = ["before", "after"].filter((kind) => data[kind]);
  const errors = Object.fromEntries(kinds.map((kind) => [kind, data[kind].map((p, k) => Math.hypot(p[0] - data.recorded[k][0], p[1] - data.recorded[k][1]))]));
  const view = mapping(floorBox(data)), recording = drawRecording(find(".recording svg"), view, data);
  const simulation = drawSimulation(find(".simulation svg"), view, data), strip = drawStrip(find(".strip svg"), data, errors);
  let time = 0, timer = null, stamp = 0;

  function indexAt(t) {
    let low = 0, high = data.time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (data.time[middle] <= t + 1e-9) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  function show(t) {
    time = Math.min(Math.max(t, 0), strip.end);
    const k = indexAt(time);
    recording(k);
    simulation(k, enlarge.checked ? 10 : 1);
    strip.move(time);
    slider.value = String(Math.round((1000 * time) / strip.end));
    slider.setAttribute("aria-valuetext", `${time.toFixed(1)} of ${strip.end.toFixed(1)} seconds`);
    clock.textContent = `${time.toFixed(1)} of ${strip.end.toFixed(1)} s`;
    const turned = (kind) => Math.abs((wrapped(data[kind][k][2] - data.recorded[k][2]) * 180) / Math.PI).toFixed(1);
    const said = kinds.map((kind) => `${kind === "before" ? (data.after ? "before the repair" : "the model") : "repaired"} <b class="${kind}">${length(errors[kind][k])}</b>, ${turned(kind)}\u00b0`);
    const away = time - data.time[k] > APART ? " It is not held now; what is seen is the last moment before." : "";
    now.innerHTML = `Off at this moment: ${said.join("; ")}.${away}`;
  }

  function stop() {
    clearInterval(timer);
    timer = null;
    button.textContent = "\u25b6";
    button.setAttribute("aria-label", "play");
  }

  function tick() {
    const moment = performance.now();
    show(time + (moment - stamp) / 1000);
    stamp = moment;
    if (time >= strip.end) stop();
  }

  function toggle() {
    if (timer !== null) return stop();
    if (time >= strip.end) show(0);
    stamp = performance.now();
    button.textContent = "\u2759\u2759";
    button.setAttribute("aria-label", "pause");
    timer = setInterval(tick, TICK);
  }

  function key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const step = event.shiftKey ? 1 : 0.1;
    const moves = { ArrowLeft: () => time - step, ArrowRight: () => time + step, Home: () => 0, End: () => strip.end };
    if (event.key === " " && event.target !== enlarge) toggle();
    else if (moves[event.key]) {
      stop();
      show(moves[event.key]());
    } else return;
    event.preventDefault();
  }

  button.addEventListener("click", toggle);
  enlarge.addEventListener("change", () => show(time));
  slider.addEventListener("input", () => {
    stop();
    show((Number(slider.value) * strip.end) / 1000);
  });
  find(".strip svg").addEventListener("click", (event) => {
    const box = event.currentTarget.getBoundingClientRect(), x = ((event.clientX - box.left) / box.width) * STRIP.width;
    stop();
    show(((x - strip.x(0)) / (strip.x(strip.end) - strip.x(0))) * strip.end);
  });
  // What is printed, or seen before anybody touches the slider: where the simulation before the repair is furthest off.
  show(data.time[errors.before.indexOf(Math.max(...errors.before))]);
  return key;
}

const sections = [...document.querySelectorAll(".replay")], keys = sections.map(makeReplay);
let current = 0;
sections.forEach((section, k) => ["focusin", "pointerdown"].forEach((kind) => section.addEventListener(kind, () => { current = k; })));
document.addEventListener("keydown", (event) => { if (keys.length) keys[current](event); });

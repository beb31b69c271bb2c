// Recording and simulation side by side under one time: slider, button, keys. No library, nothing from outside.

// Drawn at the size at which they are first shown, so that letters are as large as the page's.
const PANEL = { width: 560, height: 460, margin: 26 };
const STRIP = { width: 1120, height: 150, left: 58, right: 16, top: 14, bottom: 34 };

const APART = 0.75; // Seconds between moments from which on there was no hold in between.

// The part of the floor that the object and what is named keep to; a simulation that runs away is cut off.
function floorBox(data) {
  const points = data.recorded.flatMap((pose) => place(data.outline, pose)).concat(data.hand);
  // As arguments of one call they would be too many for the stack.
  const ends = (of) => [0, 1].map((k) => points.reduce((end, p) => of(end, p[k]), points[0][k]));
  const low = ends(Math.min), high = ends(Math.max);
  for (const fixed of data.places.filter((each) => !each.onBody)) {
    for (const k of [0, 1]) {
      const reach = 0.6 * (high[k] - low[k]) + 0.3;
      for (const p of fixed.shape) {
        if (p[k] < low[k] && p[k] > low[k] - reach) low[k] = p[k];
        if (p[k] > high[k] && p[k] < high[k] + reach) high[k] = p[k];
      }
    }
  }
  return [...low, ...high];
}

function drawPanel(svg, view, data) {
  svg.setAttribute("viewBox", `0 0 ${PANEL.width} ${PANEL.height}`);
  drawFloor(svg, view, data.room);
  scaleBar(svg, view);
}

// What is named and stands in the room is drawn once; what is on the body moves with it.
function drawPlaces(svg, view, data) {
  const moving = [];
  for (const named of data.places) {
    const shape = element(svg, "path", { class: "place" }), text = element(svg, "text", { class: "placetext halo", "text-anchor": "middle" }, named.effect);
    const show = (pose) => {
      const corners = (named.onBody ? place(named.shape, pose) : named.shape).map(view.map);
      shape.setAttribute("d", path(corners, true));
      const middle = [0, 1].map((k) => corners.reduce((sum, p) => sum + p[k], 0) / corners.length);
      text.setAttribute("x", Math.min(Math.max(middle[0], 50), PANEL.width - 50));
      text.setAttribute("y", Math.min(Math.max(Math.min(...corners.map((p) => p[1])) - 6, 16), PANEL.height - 30));
    };
    if (named.onBody) moving.push(show);
    else show();
  }
  return (pose) => moving.forEach((show) => show(pose));
}

function drawRecording(svg, view, data) {
  drawPanel(svg, view, data);
  const way = data.recorded.map((pose, k) => (k && data.time[k] - data.time[k - 1] < APART ? "L" : "M") + view.map(pose).map((v) => v.toFixed(1)).join(" "));
  element(svg, "path", { class: "recorded trail", d: way.join("") });
  const body = element(svg, "path", { class: "recorded body" }), places = drawPlaces(svg, view, data);
  const shaft = element(svg, "path", { class: "force" }), head = element(svg, "path", { class: "forcehead" });
  const hand = element(svg, "circle", { class: "gripper", r: 6 }), newtons = element(svg, "text", { class: "forcetext halo", "text-anchor": "middle" });
  const most = Math.max(...data.force.map(([x, y]) => Math.hypot(x, y)), 1e-9);
  return (k) => {
    body.setAttribute("d", path(place(data.outline, data.recorded[k]).map(view.map), true));
    places(data.recorded[k]);
    const [x, y] = view.map(data.hand[k]), [fx, fy] = data.force[k], size = Math.hypot(fx, fy);
    hand.setAttribute("cx", x);
    hand.setAttribute("cy", y);
    const long = (95 * size) / most, [ux, uy] = size ? [fx / size, -fy / size] : [0, 0];
    const [ex, ey] = [x + long * ux, y + long * uy];
    setArrow(shaft, head, [x, y], [ex, ey]);
    newtons.textContent = size.toFixed(size < 10 ? 1 : 0) + " N";
    newtons.setAttribute("x", Math.min(Math.max(ex + 18 * ux, 24), PANEL.width - 24));
    newtons.setAttribute("y", Math.min(Math.max(ey + 18 * uy + 4, 14), PANEL.height - 6));
  };
}

function drawSimulation(svg, view, data) {
  drawPanel(svg, view, data);
  const ghost = element(svg, "path", { class: "ghost" }), places = drawPlaces(svg, view, data);
  const kinds = ["before", "after"].filter((kind) => data[kind]);
  const trails = kinds.map((kind) => element(svg, "path", { class: kind + " trail" }));
  const bodies = kinds.map((kind) => element(svg, "path", { class: kind }));
  return (k, enlarge) => {
    const larger = (pose, real) => pose.map((value, i) => real[i] + enlarge * (i === 2 ? wrapped(value - real[i]) : value - real[i]));
    let first = k;
    while (first > 0 && data.stretch[first - 1] === data.stretch[k]) first -= 1;
    ghost.setAttribute("d", path(place(data.outline, data.recorded[k]).map(view.map), true));
    kinds.forEach((kind, i) => {
      const pose = larger(data[kind][k], data.recorded[k]);
      const way = data[kind].slice(first, k + 1).map((each, j) => view.map(larger(each, data.recorded[first + j])));
      bodies[i].setAttribute("d", path(place(data.outline, pose).map(view.map), true));
      trails[i].setAttribute("d", path(way));
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
  const band = ([a, b], kind) => element(svg, "rect", { class: kind, x: x(Math.max(a, 0)), y: top, width: Math.max(x(Math.min(b, end)) - x(Math.max(a, 0)), 0), height: height - top - bottom });
  data.heldOut.forEach((each) => band(each, "heldout"));
  data.moments.forEach((each) => band(each, "acting"));
  data.unbelieved.forEach((each) => band(each, "unbelieved"));
  for (let e = 0, step = niceStep(most, 3); e <= most; e += step) {
    element(svg, "path", { class: "grid", d: `M${left} ${y(e).toFixed(1)}H${width - right}` });
    element(svg, "text", { x: left - 8, y: y(e) + 4, "text-anchor": "end" }, e ? length(e) : "0");
  }
  for (let t = 0, step = niceStep(end, STRIP.width / 120); t <= end; t += step) element(svg, "text", { x: x(t), y: height - 14, "text-anchor": "middle" }, `${+t.toFixed(3)} s`);
  if (data.noise) element(svg, "path", { class: "noise", d: `M${left} ${y(data.noise).toFixed(1)}H${width - right}` });
  for (const kind of kinds) {
    const parts = new Map();
    data.time.forEach((t, k) => parts.set(data.stretch[k], [...(parts.get(data.stretch[k]) || []), [x(t), y(errors[kind][k])]]));
    element(svg, "path", { class: kind + " curve", d: [...parts.values()].map((each) => path(each)).join("") });
  }
  const cursor = element(svg, "path", { class: "cursor" });
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
  const view = mapping(floorBox(data), PANEL.width, PANEL.height, PANEL.margin), recording = drawRecording(find(".recording svg"), view, data);
  const simulation = drawSimulation(find(".simulation svg"), view, data), strip = drawStrip(find(".strip svg"), data, errors);
  const span = () => [0, strip.end], player = makePlayer({ slider, button, clock, span, show });

  function show(time) {
    const k = indexBefore(data.time, time + 1e-9);
    recording(k);
    simulation(k, enlarge.checked ? 10 : 1);
    strip.move(time);
    now.replaceChildren("Off at this moment: ");
    kinds.forEach((kind, i) => {
      const turned = Math.abs((wrapped(data[kind][k][2] - data.recorded[k][2]) * 180) / Math.PI).toFixed(1);
      const number = document.createElement("b");
      number.className = kind;
      number.textContent = length(errors[kind][k]);
      now.append(`${i ? "; " : ""}${kind === "before" ? (data.after ? "before the repair" : "the model") : "repaired"} `, number, `, ${turned}\u00b0`);
    });
    const doubted = data.unbelieved.find(([start, end]) => start <= time && time <= end), shown = " What is seen is the last moment before.";
    if (doubted) now.append(`. Left out now: ${doubted[2]}.${shown}`);
    else now.append(time - data.time[k] > APART ? `. It is not held now.${shown}` : ".");
  }

  function key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || (event.key === " " && event.target === enlarge)) return;
    const action = playerKey(player, span, event);
    if (!action) return;
    action();
    event.preventDefault();
  }

  enlarge.addEventListener("change", () => player.to(player.time()));
  find(".strip svg").addEventListener("click", (event) => {
    const box = event.currentTarget.getBoundingClientRect(), x = ((event.clientX - box.left) / box.width) * STRIP.width;
    player.jump(((x - strip.x(0)) / (strip.x(strip.end) - strip.x(0))) * strip.end);
  });
  // What is printed, or seen before anybody touches the slider: where the simulation before the repair is furthest off.
  player.jump(data.time[errors.before.indexOf(Math.max(...errors.before))]);
  return key;
}

const sections = [...document.querySelectorAll(".replay")], keys = sections.map(makeReplay);
let current = 0;
sections.forEach((section, k) => ["focusin", "pointerdown"].forEach((kind) => section.addEventListener(kind, () => { current = k; })));
document.addEventListener("keydown", (event) => { if (keys.length) keys[current](event); });

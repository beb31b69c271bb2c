// The room from above: it can be moved and enlarged; objects, grippers and forces go where they were at a time.

const PALETTE = 6; // colours of objects in view.css
const STRONGEST = 90; // [px] arrow of the largest force
const WEAK = 10; // [N] forces that are all smaller are not drawn as if they were large
const MILLI = { map: ([x, y]) => [1000 * x, 1000 * y] }; // posteriors are drawn in millimetres of the body's frame

function colour(i) { return `c${i % PALETTE}`; }

// `forces(i)` is the largest force of a gripper [N]; `kept` the view of a picture that this one takes the place of.
function makeScene(svg, data, streams, forces, kept) {
  svg.replaceChildren();
  const grid = element(svg, "path", { class: "grid" }), floor = element(svg, "g", { class: "metres" });
  const still = element(floor, "g"), regions = element(floor, "g"), moving = element(floor, "g"), over = element(svg, "g");
  let view = viewAt([0, 0], 100, 100, 100), scale = null, moment = 0, touched = false;

  if (data.room.length) element(still, "path", { class: "room", d: path(data.room, true, 3) });
  data.objects.forEach((_, i) => trail(i));
  const area = element(still, "path", { class: "area" }), plan = element(still, "path", { class: "plan" });
  const residualTrails = data.residuals.map((_, i) => residualTrail(i));
  const places = data.regions.map(drawRegion), bodies = data.objects.map(drawBodyOf), hands = data.grippers.map(drawHand);
  const missing = data.residuals.map((each) => ({ ...arrow("residual"), object: each.object }));

  function trail(i) {
    const found = streams.whole("objects", i), object = data.objects[i];
    if (!found || found.time.length < 2) return;
    const limit = Math.max(found.gap, (3 * (found.time[found.time.length - 1] - found.time[0])) / found.time.length);
    const way = found.time.map((t, k) => (k && t - found.time[k - 1] <= limit ? "L" : "M") + found.x[k] + " " + found.y[k]);
    element(still, "path", { class: `trail ${colour(i)}`, d: way.join("") });
    const first = [found.x[0], found.y[0], found.theta[0] ?? (object.pose ? object.pose[2] : 0)];
    element(still, "path", { class: "start", d: path(place(object.outline, first), true, 3) });
  }

  // Forces that the model lacks, a bar from the place where the object was then, every now and then.
  function residualTrail(i) {
    const found = streams.whole("residuals", i), most = data.residuals[i].largest || 1;
    if (!found || !found.time.length) return null;
    const every = Math.max(1, Math.floor(found.time.length / 150)), bars = [];
    for (let k = 0; k < found.time.length; k += every) {
      const at = streams.pose("objects", data.residuals[i].object, found.time[k]);
      const middle = (column) => (found.low[column][k] + (found.high || found.low)[column][k]) / 2;
      if (at) bars.push(path([[at.x, at.y], [at.x + (0.35 * middle(0)) / most, at.y + (0.35 * middle(1)) / most]], false, 3));
    }
    return element(still, "path", { class: "residualtrail", d: bars.join("") });
  }

  function drawBodyOf(object, i) {
    const group = element(moving, "g", { class: `body ${colour(i)}` });
    if (object.outline.length) element(group, "path", { class: object.movable ? "outline" : "outline fixed", d: path(object.outline, true, 3) });
    else element(group, "path", { class: "outline", d: "M-0.1 0H0.1M0 -0.1V0.1" });
    for (const [x, y] of object.casters) element(group, "circle", { class: "caster", cx: x, cy: y, r: 0.025 });
    if (object.model) drawPosterior(group, object.model);
    for (const region of data.regions) if (region.object === i) drawPlaceIn(group, region);
    return { group, name: element(over, "text", { class: "name halo", "text-anchor": "middle" }, object.name) };
  }

  // The cloud of the wheel moves with the body; a hinge stays where it is in the room.
  function drawPosterior(group, model) {
    if (model.wheel) cloud(element(group, "g", { class: "posterior", transform: "scale(0.001)" }), MILLI, model.wheel, 3);
    if (!model.hinge) return;
    const fixed = element(still, "g", { class: "posterior", transform: "scale(0.001)" }), [x, y, radius] = model.hinge.mean;
    element(fixed, "circle", { class: "after trail", cx: 1000 * x, cy: 1000 * y, r: 1000 * radius });
    cloud(fixed, MILLI, model.hinge, 3);
  }

  function drawPlaceIn(group, region) {
    if (region.shape.length > 2) element(group, "path", { class: "place", d: path(region.shape, true, 3) });
    else for (const [x, y] of region.shape) element(group, "path", { class: "place", d: `M${x - 0.06} ${y}h0.12M${x} ${y - 0.06}v0.12` });
    if (region.uncertainty.length) element(group, "path", { class: "unsure", d: path(region.uncertainty, true, 3) });
  }

  function drawRegion(region) {
    if (region.object === null) drawPlaceIn(regions, region);
    return element(over, "text", { class: "placetext halo", "text-anchor": "middle" }, region.effect);
  }

  function arrow(kind) { return { shaft: element(over, "path", { class: kind }), head: element(over, "path", { class: `${kind}head` }) }; }

  function drawHand(gripper) {
    const dot = element(over, "circle", { class: "gripper", r: 5.5 });
    return { dot, ...arrow("force"), text: element(over, "text", { class: "forcetext halo" }) };
  }

  let strongest = Math.max(WEAK, ...data.grippers.map((_, i) => forces(i)));

  function lookAt(next) {
    view = next;
    svg.setAttribute("viewBox", `0 0 ${view.width} ${view.height}`);
    const [x, y] = view.map([0, 0]);
    floor.setAttribute("transform", `matrix(${view.scale} 0 0 ${-view.scale} ${x} ${y})`);
    svg.style.setProperty("--px", String(1000 / view.scale)); // a pixel in the millimetres of posteriors
    grid.setAttribute("d", gridLines(view, 14));
    if (scale) scale.remove();
    scale = element(svg, "g");
    scaleBar(scale, view);
    update(moment);
  }

  function box() {
    const seen = data.objects.flatMap((object, i) => {
      const found = streams.whole("objects", i);
      const poses = found && found.time.length ? found.x.map((x, k) => [x, found.y[k], found.theta[k] ?? 0]) : object.pose ? [object.pose] : [];
      const every = Math.max(1, Math.floor(poses.length / 100));
      return poses.filter((_, k) => k % every === 0).flatMap((pose) => (object.outline.length ? place(object.outline, pose) : [pose]));
    });
    const fixed = data.regions.filter((region) => region.object === null).flatMap((region) => region.shape);
    const all = [...data.room, ...seen, ...fixed, ...data.plans.flatMap((each) => each.points)];
    return all.length ? bounds(all) : [-2, -2, 2, 2];
  }

  function fit() {
    touched = false;
    const { clientWidth: width, clientHeight: height } = svg;
    lookAt(mapping(box(), width || 900, height || 420, 24));
  }

  // Enlarge about a point of the picture [px]; its middle where none is said.
  function zoom(factor, at = [view.width / 2, view.height / 2]) {
    touched = true;
    const fixed = view.unmap(at), next = Math.min(Math.max(view.scale * factor, 2), 20000), k = view.scale / next;
    const middle = view.unmap([view.width / 2, view.height / 2]);
    lookAt(viewAt([0, 1].map((c) => fixed[c] + (middle[c] - fixed[c]) * k), next, view.width, view.height));
  }

  function move(dx, dy) {
    touched = true;
    lookAt(viewAt(view.unmap([view.width / 2 - dx, view.height / 2 - dy]), view.scale, view.width, view.height));
  }

  // The whole room stays in a picture that nobody has moved.
  function resize() {
    const { clientWidth: width, clientHeight: height } = svg;
    if (width && height && (width !== view.width || height !== view.height)) {
      if (!touched) return fit();
      lookAt(viewAt(view.unmap([view.width / 2, view.height / 2]), view.scale * (width / view.width), width, height));
    }
  }

  const shownAt = (node, [x, y]) => { node.setAttribute("x", x.toFixed(1)); node.setAttribute("y", y.toFixed(1)); };

  // Everything that moves, at a time.
  function update(t) {
    moment = t;
    data.objects.forEach((object, i) => {
      const seen = streams.pose("objects", i, t), pose = seen || (object.pose ? { x: object.pose[0], y: object.pose[1], theta: object.pose[2], seen: false } : null);
      const { group, name } = bodies[i];
      group.style.display = name.style.display = pose ? "" : "none";
      if (!pose) return;
      const theta = pose.theta ?? (object.pose ? object.pose[2] : 0);
      group.setAttribute("transform", `translate(${pose.x.toFixed(4)} ${pose.y.toFixed(4)}) rotate(${((theta * 180) / Math.PI).toFixed(3)})`);
      group.classList.toggle("unseen", !pose.seen);
      shownAt(name, view.map([pose.x, pose.y]));
    });
    data.grippers.forEach((_, i) => updateHand(i, t));
    data.regions.forEach((region, i) => {
      const at = region.object === null ? { x: 0, y: 0, theta: 0 } : streams.pose("objects", region.object, t);
      places[i].style.display = at ? "" : "none";
      if (!at) return;
      const corners = place(region.shape, [at.x, at.y, at.theta ?? 0]).map(view.map);
      shownAt(places[i], [corners.reduce((sum, p) => sum + p[0], 0) / corners.length, Math.min(...corners.map((p) => p[1])) - 6]);
    });
    missing.forEach((each, i) => updateMissing(each, i, t));
    const now = data.plans.filter((each) => each.time <= t && (each.until === null || t < each.until));
    plan.setAttribute("d", now.filter((each) => !each.pairs).map((each) => path(each.points, false, 3)).join(""));
    area.setAttribute("d", now.filter((each) => each.pairs).map((each) => each.points.map((p, k) => (k % 2 ? "L" : "M") + p[0] + " " + p[1]).join("")).join(""));
  }

  function updateHand(i, t) {
    const { dot, shaft, head, text } = hands[i], pose = streams.pose("grippers", i, t), force = pose && streams.values("forces", i, t);
    dot.style.display = pose ? "" : "none";
    text.style.display = "none";
    if (!pose) { setArrow(shaft, head, [0, 0], [0, 0]); return; }
    const [x, y] = view.map([pose.x, pose.y]);
    dot.setAttribute("cx", x.toFixed(1));
    dot.setAttribute("cy", y.toFixed(1));
    const [fx, fy] = force || [0, 0], size = Math.hypot(fx, fy);
    strongest = Math.max(strongest, size); // a running graph may push harder than ever before
    const k = STRONGEST / strongest;
    // The arrow's point touches the gripper: a push is read as coming from outside.
    const tail = [x - fx * k, y + fy * k];
    if (!setArrow(shaft, head, tail, [x, y])) return;
    text.style.display = "";
    text.textContent = `${size.toFixed(0)} N`;
    shownAt(text, [tail[0] - (fx / size) * 18 - 12, tail[1] + (fy / size) * 12 + 4]);
  }

  function updateMissing({ shaft, head, object }, i, t) {
    const pose = streams.pose("objects", object, t), lacks = pose && streams.values("residuals", i, t);
    if (!lacks) { setArrow(shaft, head, [0, 0], [0, 0]); return; }
    const [x, y] = view.map([pose.x, pose.y]), k = STRONGEST / (data.residuals[i].largest || 1);
    setArrow(shaft, head, [x, y], [x + lacks[0] * k, y - lacks[1] * k]);
  }

  if (kept) { lookAt(kept); touched = true; } else fit();
  return { update, fit, zoom, move, resize, view: () => view, kept: () => (touched ? view : null) };
}

// The hand in the picture: dragging moves it, the wheel enlarges it about the pointer; `scene()` is the one drawn now.
function handleScene(svg, scene) {
  dragging(svg, (dx, dy) => scene().move(dx, dy));
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = svg.getBoundingClientRect();
    scene().zoom(Math.exp(-event.deltaY * 0.0015), [event.clientX - box.left, event.clientY - box.top]);
  }, { passive: false });
}

// Calls `moved(dx, dy)` [px] while a node is dragged.
function dragging(node, moved) {
  let last = null;
  node.addEventListener("pointerdown", (event) => { last = [event.clientX, event.clientY]; node.setPointerCapture(event.pointerId); });
  node.addEventListener("pointermove", (event) => {
    if (!last) return;
    moved(event.clientX - last[0], event.clientY - last[1]);
    last = [event.clientX, event.clientY];
  });
  for (const kind of ["pointerup", "pointercancel"]) node.addEventListener(kind, () => { last = null; });
}

// The push from above: what happened and what the models predict, at one time.

const SCENE = { width: 760, height: 540, margin: 34 };

// The part of the floor that everything recorded stays in; a prediction that runs away is cut off.
function sceneBox(object, episode) {
  const along = (poses) => bounds(poses.flatMap((pose) => place(object.footprint, pose)));
  const seen = along(episode.recorded), reach = 0.45 * Math.max(seen[2] - seen[0], seen[3] - seen[1]);
  const hinge = object.hinge ? [[...object.hinge.mean.slice(0, 2), ...object.hinge.mean.slice(0, 2)]] : [];
  const all = [seen, ...hinge, ...[episode.before, episode.after].filter((poses) => poses.length).map(along)];
  const low = (k) => Math.max(Math.min(...all.map((box) => box[k])), seen[k] - reach);
  const high = (k) => Math.min(Math.max(...all.map((box) => box[k])), seen[k] + reach);
  return [low(0), low(1), high(2), high(3)];
}

// Draws the still parts and returns a function that moves the rest to a fractional index.
function drawScene(svg, object, episode, room) {
  svg.replaceChildren();
  svg.setAttribute("viewBox", `0 0 ${SCENE.width} ${SCENE.height}`);
  const view = mapping(sceneBox(object, episode), SCENE.width, SCENE.height, SCENE.margin);
  drawFloor(svg, view, room);
  element(svg, "path", { class: "start", d: path(place(object.footprint, episode.recorded[0]).map(view.map), true) });
  const trail = (poses, kind) => element(svg, "path", { class: kind + " trail", d: path(poses.map(view.map)) });
  if (episode.before.length && !episode.restart) trail(episode.before, "before");
  trail(episode.recorded, "recorded");
  const draws = episode.draws.map(() => element(svg, "path", { class: "draw" }));
  const body = element(svg, "path", { class: "recorded body" });
  const casters = object.casters.map(() => element(svg, "circle", { class: "caster", r: 5 }));
  const before = element(svg, "path", { class: "before" });
  const after = element(svg, "path", { class: "after" });
  const pin = object.wheel ? element(svg, "circle", { class: "pin", r: 6 }) : null;
  const pivot = object.hinge ? element(svg, "circle", { class: "pin", r: 6 }) : null;
  if (pivot) {
    const [x, y] = view.map(object.hinge.mean);
    element(svg, "circle", { class: "after trail", cx: x, cy: y, r: object.hinge.mean[2] * view.scale, "stroke-dasharray": "3 5" });
  }
  const pinText = pin || pivot ? element(svg, "text", { class: "aftertext halo" }, pin ? "held here" : "turns here") : null;
  const grippers = episode.contacts.map(() => element(svg, "circle", { class: "gripper", r: 5.5 }));
  const shaft = element(svg, "path", { class: "force" }), head = element(svg, "path", { class: "forcehead" });
  const newtons = element(svg, "text", { class: "forcetext halo" });
  const beforeText = element(svg, "text", { class: "beforetext halo", "text-anchor": "middle" }, "before learning");
  const strongest = Math.max(...episode.wrench.map((w) => Math.hypot(w[0], w[1])), 1e-6);
  scaleBar(svg, view);
  element(svg, "text", { class: "halo", x: 14, y: 24 }, "dotted: where it stood before the push");

  const outline = (node, pose) => node.setAttribute("d", path(place(object.footprint, pose).map(view.map), true));
  const at = (node, point) => { const [x, y] = view.map(point); node.setAttribute("cx", x); node.setAttribute("cy", y); };

  function drawForce(pose, index) {
    const held = place(episode.contacts.map((c) => c.point), pose);
    grippers.forEach((node, i) => at(node, held[i]));
    const force = [0, 1].map((k) => valueAt(episode.wrench.map((w) => w[k]), index));
    const size = Math.hypot(...force);
    const base = held.length ? [0, 1].map((k) => held.reduce((sum, p) => sum + p[k], 0) / held.length) : pose;
    const [x, y] = view.map(base), pixels = (110 * size) / strongest;
    const [ux, uy] = size > 0 ? [force[0] / size, -force[1] / size] : [0, 0];
    // The arrow's point touches the gripper: a push is read as coming from outside.
    const tail = [x - ux * pixels, y - uy * pixels], seen = setArrow(shaft, head, tail, [x, y]);
    newtons.setAttribute("visibility", seen ? "visible" : "hidden");
    newtons.textContent = size.toFixed(0) + " N";
    newtons.setAttribute("x", Math.min(Math.max(tail[0] - ux * 22 - 14, 4), SCENE.width - 44));
    newtons.setAttribute("y", Math.min(Math.max(tail[1] - uy * 14 + 4, 16), SCENE.height - 8));
  }

  return function update(index) {
    const pose = poseAt(episode.recorded, index);
    outline(body, pose);
    place(object.casters, pose).forEach((point, i) => at(casters[i], point));
    if (episode.after.length) outline(after, poseAt(episode.after, index));
    episode.draws.forEach((poses, i) => outline(draws[i], poseAt(poses, index)));
    if (episode.before.length) {
      const far = poseAt(episode.before, index);
      outline(before, far);
      labelBefore(far, pose);
    }
    if (pin) place([object.wheel.mean], pose).forEach((point) => at(pin, point));
    if (pivot) at(pivot, object.hinge.mean);
    if (pinText) {
      const mark = pin || pivot, x = Number(mark.getAttribute("cx")), right = x < SCENE.width * 0.8;
      pinText.setAttribute("x", x + (right ? 11 : -11));
      pinText.setAttribute("text-anchor", right ? "start" : "end");
      pinText.setAttribute("y", Number(mark.getAttribute("cy")) + 16);
    }
    drawForce(pose, index);
  };

  // Name the runaway outline at its own edge, once it has parted from the recorded one.
  function labelBefore(far, pose) {
    const parted = Math.hypot(far[0] - pose[0], far[1] - pose[1]);
    const corners = place(object.footprint, far).map(view.map);
    const away = [far[0] - pose[0], pose[1] - far[1]], size = Math.hypot(...away) || 1;
    const reach = (p) => (p[0] * away[0] + p[1] * away[1]) / size;
    const edge = corners.sort((a, b) => reach(b) - reach(a)).slice(0, 2);
    const x = (edge[0][0] + edge[1][0]) / 2, y = (edge[0][1] + edge[1][1]) / 2;
    const outside = corners.every((p) => p[0] < 0 || p[0] > SCENE.width || p[1] < 0 || p[1] > SCENE.height);
    beforeText.textContent = outside ? `before learning: out of sight, ${length(parted)} off` : "before learning";
    beforeText.setAttribute("visibility", parted > 0.06 ? "visible" : "hidden");
    const half = beforeText.textContent.length * 3.9; // [px] at least as wide as the text, which is centred
    beforeText.setAttribute("x", Math.min(Math.max(x, half), SCENE.width - half));
    beforeText.setAttribute("y", Math.min(Math.max(y - 8, 40), SCENE.height - 44));
  }
}

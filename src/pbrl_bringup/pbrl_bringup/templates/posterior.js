// The posterior of the wheel on the outline of the body, and enlarged; or of a hinge in the room.

function cloud(svg, view, posterior, radius) {
  for (const draw of posterior.draws) {
    const [x, y] = view.map(draw);
    element(svg, "circle", { class: "dot", cx: x.toFixed(1), cy: y.toFixed(1), r: radius });
  }
  element(svg, "path", { class: "ellipse", d: path(posterior.ellipse.map(view.map), true) });
  const [x, y] = view.map(posterior.mean);
  element(svg, "path", { class: "mean", d: `M${x - 6} ${y}H${x + 6}M${x} ${y - 6}V${y + 6}` });
}

function truthMarks(svg, view, object, size) {
  for (const point of object.truth ? object.truth.locked : []) {
    const [x, y] = view.map(point);
    element(svg, "path", { class: "truthmark", d: `M${x} ${y - size}L${x + size} ${y}L${x} ${y + size}L${x - size} ${y}Z` });
  }
}

function drawBody(svg, object) {
  const width = 400, box = bounds([...object.footprint, ...object.wheel.ellipse, ...object.casters]);
  const height = Math.round(Math.min(360, Math.max(190, ((width - 90) * (box[3] - box[1])) / (box[2] - box[0]) + 90)));
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const view = mapping(box, width, height, 42);
  element(svg, "path", { class: "recorded body", d: path(object.footprint.map(view.map), true) });
  for (const point of object.casters) {
    const [x, y] = view.map(point);
    element(svg, "circle", { class: "caster", cx: x, cy: y, r: 6 });
  }
  if (object.casters.length) {
    const [x, y] = view.map([0, 0]);
    element(svg, "text", { class: "halo", x, y: y + 4, "text-anchor": "middle" }, "\u25cb casters");
  }
  cloud(svg, view, object.wheel, 1.6);
  truthMarks(svg, view, object, 11);
  const frame = zoomBox(object).flat(), a = view.map(frame.slice(0, 2)), b = view.map(frame.slice(2));
  const corner = { x: Math.min(a[0], b[0]), y: Math.min(a[1], b[1]) };
  element(svg, "rect", { class: "axis", fill: "none", "stroke-dasharray": "2 3", ...corner, width: Math.abs(b[0] - a[0]), height: Math.abs(b[1] - a[1]) });
  element(svg, "text", { class: "halo", x: 12, y: 20 }, "seen from above in its own axes; front: right");
  scaleBar(svg, view);
}

// Corners of what the enlarged picture shows: the cloud, its ellipse and what lies close to it.
function zoomBox(object) {
  const mean = object.wheel.mean, reach = 1.25 * Math.max(0.02, object.wheel.radius95);
  const near = [...object.casters, ...(object.truth ? object.truth.locked : [])];
  const close = near.filter((p) => Math.hypot(p[0] - mean[0], p[1] - mean[1]) < Math.max(4 * reach, 0.08));
  const away = (p) => Math.max(Math.abs(p[0] - mean[0]), Math.abs(p[1] - mean[1]));
  const size = Math.max(reach, ...close.map((p) => 1.3 * away(p)), ...object.wheel.ellipse.map((p) => 1.05 * away(p)));
  return [[mean[0] - 1.5 * size, mean[1] - size], [mean[0] + 1.5 * size, mean[1] + size]];
}

function drawZoom(svg, object) {
  // The caption has a strip of its own above what is drawn.
  const width = 400, height = 270, strip = 26, corners = zoomBox(object);
  svg.setAttribute("viewBox", `0 ${-strip} ${width} ${height + strip}`);
  const view = mapping(bounds(corners), width, height, 8);
  element(svg, "path", { class: "recorded body", d: path(object.footprint.map(view.map), true) });
  for (const point of object.casters) {
    const [x, y] = view.map(point);
    element(svg, "circle", { class: "caster", cx: x, cy: y, r: 8 });
  }
  cloud(svg, view, object.wheel, 2.4);
  truthMarks(svg, view, object, 15);
  for (const [x, y] of object.casters.map(view.map)) {
    if (x > 0 && x < width && y > 0 && y < height) element(svg, "text", { class: "halo", x: x + 13, y: y - 10 }, "caster");
  }
  element(svg, "text", { class: "halo", x: 12, y: 20 - strip }, "enlarged; cross: mean, line: 95 % region");
  scaleBar(svg, view);
}

function drawHinge(svg, object) {
  const width = 400, height = 400, hinge = object.hinge;
  const paths = object.episodes.filter((e) => !e.restart).map((e) => e.recorded);
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const view = mapping(bounds([...paths.flat(), ...hinge.ellipse]), width, height, 58);
  for (const points of paths) element(svg, "path", { class: "recorded", d: path(points.map(view.map)) });
  const [x, y] = view.map(hinge.mean);
  element(svg, "circle", { class: "after trail", cx: x, cy: y, r: hinge.mean[2] * view.scale, "stroke-dasharray": "3 5" });
  cloud(svg, view, hinge, 1.8);
  const side = x < width / 2 ? { x: Math.max(x - 8, 12), "text-anchor": "start" } : { x: Math.min(x + 8, width - 12), "text-anchor": "end" };
  element(svg, "text", { class: "aftertext halo", y: y + (y > height - 80 ? -14 : 22), ...side }, `hinge, radius ${length(hinge.mean[2])}`);
  element(svg, "text", { class: "halo", x: 12, y: 20 }, "solid: recorded path; dotted: circle about the hinge");
  scaleBar(svg, view);
}

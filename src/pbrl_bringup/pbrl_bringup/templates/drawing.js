// Small helpers for hand-made SVG: elements, mappings from metres to pixels, outlines, ticks.

function element(parent, tag, attributes, text) {
  const node = document.createElementNS(parent.namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  if (text !== undefined) node.textContent = text;
  parent.appendChild(node);
  return node;
}

// Outline (body frame) at a planar pose: points in world.
function place(outline, pose) {
  const c = Math.cos(pose[2]), s = Math.sin(pose[2]);
  return outline.map(([x, y]) => [pose[0] + c * x - s * y, pose[1] + s * x + c * y]);
}

// Pose at a fractional index of a list of poses; the angle goes the short way round.
function poseAt(poses, index) {
  const i = Math.min(Math.floor(index), poses.length - 1), j = Math.min(i + 1, poses.length - 1), f = index - i;
  const a = poses[i], b = poses[j];
  const turn = Math.atan2(Math.sin(b[2] - a[2]), Math.cos(b[2] - a[2]));
  return [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * turn];
}

function valueAt(values, index) {
  const i = Math.min(Math.floor(index), values.length - 1), j = Math.min(i + 1, values.length - 1);
  if (values[i] === null || values[j] === null) return null;
  return values[i] + (index - i) * (values[j] - values[i]);
}

// Fractional index of a time in an increasing list.
function indexOf(time, t) {
  if (t <= time[0]) return 0;
  for (let i = 1; i < time.length; i++) {
    if (time[i] >= t) return i - 1 + (t - time[i - 1]) / (time[i] - time[i - 1]);
  }
  return time.length - 1;
}

function bounds(points) {
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

// The same scale in x and y, y up, `box` in metres centred in width x height pixels.
function mapping(box, width, height, margin) {
  const scale = Math.min((width - 2 * margin) / (box[2] - box[0]), (height - 2 * margin) / (box[3] - box[1]));
  const cx = (box[0] + box[2]) / 2, cy = (box[1] + box[3]) / 2;
  const map = ([x, y]) => [width / 2 + (x - cx) * scale, height / 2 - (y - cy) * scale];
  return { map, scale, left: cx - width / 2 / scale, right: cx + width / 2 / scale,
    bottom: cy - height / 2 / scale, top: cy + height / 2 / scale };
}

function path(points, closed) {
  if (!points.length) return "";
  return "M" + points.map((p) => p[0].toFixed(1) + " " + p[1].toFixed(1)).join("L") + (closed ? "Z" : "");
}

// A round step such that about `count` of them fit into `span`.
function niceStep(span, count) {
  const raw = Math.max(span, 1e-9) / count, power = Math.pow(10, Math.floor(Math.log10(raw)));
  return [1, 2, 5, 10].map((k) => k * power).find((step) => step >= raw * 0.999);
}

function length(metres) {
  if (metres >= 10) return metres.toFixed(0) + " m";
  if (metres >= 1) return trim(metres.toFixed(1)) + " m";
  return metres >= 0.01 ? trim((metres * 100).toFixed(1)) + " cm" : trim((metres * 1000).toFixed(1)) + " mm";
}

function trim(text) { return text.includes(".") ? text.replace(/\.?0+$/, "") : text; }

// A bar that says how long a round number of metres is.
function scaleBar(svg, view, width, height) {
  const metres = niceStep((width / view.scale) * 0.13, 1), pixels = metres * view.scale;
  const x = width - 18 - pixels, y = height - 18;
  element(svg, "path", { class: "axis", fill: "none", d: `M${x} ${y - 4}V${y}H${x + pixels}V${y - 4}` });
  element(svg, "text", { class: "halo", x: x + pixels / 2, y: y - 8, "text-anchor": "middle" }, length(metres));
}

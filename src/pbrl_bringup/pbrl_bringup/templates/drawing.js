// Small helpers for hand-made SVG, shared by all pages: elements, mappings from metres to pixels, outlines, arrows, ticks.

// Asked of the page's own elements: a report holds no address, not even that of a namespace.
const SVG = (document.querySelector("svg") || document.documentElement).namespaceURI;

function element(parent, tag, attributes, text) {
  const node = document.createElementNS(SVG, tag);
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

// An angle between -pi and pi.
function wrapped(angle) { return Math.atan2(Math.sin(angle), Math.cos(angle)); }

// Pose at a fractional index of a list of poses; the angle goes the short way round.
function poseAt(poses, index) {
  const i = Math.min(Math.floor(index), poses.length - 1), j = Math.min(i + 1, poses.length - 1), f = index - i;
  const a = poses[i], b = poses[j], turn = wrapped(b[2] - a[2]);
  return [a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * turn];
}

function valueAt(values, index) {
  const i = Math.min(Math.floor(index), values.length - 1), j = Math.min(i + 1, values.length - 1);
  if (values[i] === null || values[j] === null) return null;
  return values[i] + (index - i) * (values[j] - values[i]);
}

// Number of the last entry of an increasing list that is not greater than `t`; 0 where all are.
function indexBefore(list, t) {
  let low = 0, high = list.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (list[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

// Fractional index of a time in an increasing list.
function indexOf(time, t) {
  const i = indexBefore(time, t);
  if (i >= time.length - 1 || t <= time[i]) return i;
  return i + (t - time[i]) / (time[i + 1] - time[i]);
}

function bounds(points) {
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

// The same scale in x and y, y up, a point in metres in the middle of width x height pixels.
function viewAt([cx, cy], scale, width, height) {
  const map = ([x, y]) => [width / 2 + (x - cx) * scale, height / 2 - (y - cy) * scale];
  const unmap = ([x, y]) => [cx + (x - width / 2) / scale, cy - (y - height / 2) / scale];
  return { map, unmap, scale, width, height, left: cx - width / 2 / scale, right: cx + width / 2 / scale,
    bottom: cy - height / 2 / scale, top: cy + height / 2 / scale };
}

// `box` in metres centred in width x height pixels, as large as fits.
function mapping(box, width, height, margin) {
  const scale = Math.min((width - 2 * margin) / (box[2] - box[0] || 1), (height - 2 * margin) / (box[3] - box[1] || 1));
  return viewAt([(box[0] + box[2]) / 2, (box[1] + box[3]) / 2], scale, width, height);
}

function path(points, closed, digits = 1) {
  if (!points.length) return "";
  return "M" + points.map((p) => p[0].toFixed(digits) + " " + p[1].toFixed(digits)).join("L") + (closed ? "Z" : "");
}

// Lines of a grid of round metres over a whole view.
function gridLines(view, count) {
  const step = niceStep(view.right - view.left, count);
  let lines = "";
  for (let x = Math.ceil(view.left / step) * step; x < view.right; x += step) lines += `M${view.map([x, 0])[0].toFixed(1)} 0V${view.height}`;
  for (let y = Math.ceil(view.bottom / step) * step; y < view.top; y += step) lines += `M0 ${view.map([0, y])[1].toFixed(1)}H${view.width}`;
  return lines;
}

function drawFloor(svg, view, room) {
  element(svg, "path", { class: "grid", d: gridLines(view, 7) });
  if (room.length) element(svg, "path", { class: "room", d: path(room.map(view.map), true) });
}

// An arrow in pixels; no arrow where it is too short to be one.
function setArrow(shaft, head, tail, tip) {
  const long = Math.hypot(tip[0] - tail[0], tip[1] - tail[1]), seen = long > 9;
  const [ux, uy] = seen ? [(tip[0] - tail[0]) / long, (tip[1] - tail[1]) / long] : [0, 0];
  const neck = [tip[0] - 11 * ux, tip[1] - 11 * uy];
  shaft.setAttribute("d", seen ? path([tail, neck]) : "");
  head.setAttribute("d", seen ? path([tip, [neck[0] + 6 * uy, neck[1] - 6 * ux], [neck[0] - 6 * uy, neck[1] + 6 * ux]], true) : "");
  return seen;
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
function scaleBar(svg, view) {
  const metres = niceStep((view.width / view.scale) * 0.13, 1), pixels = metres * view.scale;
  const x = view.width - 18 - pixels, y = view.height - 18;
  element(svg, "path", { class: "axis", fill: "none", d: `M${x} ${y - 4}V${y}H${x + pixels}V${y - 4}` });
  element(svg, "text", { class: "halo", x: x + pixels / 2, y: y - 8, "text-anchor": "middle" }, length(metres));
}

// The axes of a plot over time: lines at round values, its title and unit; `box` says where in its SVG it lies [px].
function plotAxes(svg, box, [low, high], title, unit) {
  const bottom = box.height - box.bottom, Y = (v) => bottom - ((v - low) / (high - low)) * (bottom - box.top);
  const step = niceStep(high - low, 3), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
    element(svg, "path", { class: "grid", d: `M${box.left} ${Y(v).toFixed(1)}H${box.width - box.right}` });
    element(svg, "text", { x: box.left - 7, y: Y(v) + 4, "text-anchor": "end" }, (Math.abs(v) < step / 2 ? 0 : v).toFixed(digits));
  }
  element(svg, "text", { class: "strong", x: box.left, y: 13 }, title);
  element(svg, "text", { x: box.width - box.right, y: 13, "text-anchor": "end" }, unit);
  return Y;
}

// Round times from `start` to `end` below a plot.
function timeAxis(svg, X, start, end, bottom, count = 6) {
  const step = niceStep(end - start, count), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  for (let t = Math.ceil(start / step - 1e-9) * step; t <= end + 1e-9; t += step) {
    element(svg, "path", { class: "axis", d: `M${X(t).toFixed(1)} ${bottom}v4` });
    element(svg, "text", { x: X(t), y: bottom + 17, "text-anchor": "middle" }, trim(t.toFixed(digits)));
  }
}

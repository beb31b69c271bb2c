// What the server sent: the whole of the streams coarsely, the shown interval, and what is near the cursor finely.

const NEAR = 6; // [s] to each side of the cursor that are known to the last sample
const NEAR_SAMPLES = 4000, WINDOW_CELLS = 1500;

function makeStreams(data) {
  const layers = { near: null, window: null, whole: data.streams };
  const waiting = { near: null, window: null };

  // Ask for an interval; while an answer is on its way only the newest wish is kept.
  async function ask(name, from, to, most) {
    if (waiting[name]) { waiting[name] = [from, to, most]; return false; }
    waiting[name] = [from, to, most];
    try {
      let asked;
      do {
        asked = waiting[name];
        const answer = await fetch(`detail?from=${asked[0]}&to=${asked[1]}&most=${asked[2]}`);
        if (!answer.ok) throw new Error(`/detail: ${answer.status}`);
        layers[name] = await answer.json();
      } while (waiting[name] !== asked);
    } finally {
      waiting[name] = null;
    }
    return true;
  }

  // Layers that know a time, the finest first.
  function at(t) { return [layers.near, layers.window, layers.whole].filter((each) => each && each.from <= t && t <= each.to); }

  function track(kind, i, t) {
    for (const layer of at(t)) {
      const found = layer[kind][i];
      if (found && found.time.length) return found;
    }
    return layers.whole[kind][i];
  }

  // Pose at a time, and whether it was seen then; null where it never was.
  function pose(kind, i, t) {
    const found = track(kind, i, t);
    if (!found || !found.time.length) return null;
    const { time, x, y, theta, gap } = found, index = indexOf(time, t), k = Math.floor(index), next = Math.min(k + 1, time.length - 1);
    const turn = (j) => (theta[j] === null ? 0 : theta[j]);
    const [px, py, angle] = poseAt([[x[k], y[k], turn(k)], [x[next], y[next], turn(next)]], Math.min(index - k, 1));
    const seen = t >= time[0] - gap && t <= time[time.length - 1] + gap && (time[next] - time[k] <= Math.max(gap, coarse(found)) || index === k);
    return { x: px, y: py, theta: theta[k] === null ? null : angle, seen };
  }

  // The usual step of what was sent: longer than the stream's own where it was thinned.
  function coarse(found) { return (2 * (found.time[found.time.length - 1] - found.time[0])) / Math.max(found.time.length - 1, 1); }

  // Values at a time: the middle of the band; null in a gap.
  function values(kind, i, t) {
    const found = track(kind, i, t);
    if (!found || !found.time.length) return null;
    const { time, low, high, gap } = found, index = indexOf(time, t), k = Math.floor(index), next = Math.min(k + 1, time.length - 1);
    if (t < time[0] - gap || t > time[time.length - 1] + gap || time[next] - time[k] > Math.max(gap, coarse(found))) return null;
    const middle = (column, j) => (low[column][j] + (high || low)[column][j]) / 2;
    return low.map((_, column) => middle(column, k) + (index - k) * (middle(column, next) - middle(column, k)));
  }

  // What a curve over an interval is drawn from.
  function curve(kind, i, from, to) {
    const shown = layers.window && layers.window.from <= from && to <= layers.window.to ? layers.window : layers.whole;
    return shown[kind][i] || layers.whole[kind][i];
  }

  function grow(known, found, begin) {
    if (!known) return;
    if (!known.high && known.low) known.high = known.low.map((column) => [...column]);
    const last = known.time.length ? known.time[known.time.length - 1] : -Infinity;
    const first = found.time.findIndex((t) => t > last), old = known.time.length && known.time[0] < begin - 30 ? indexBefore(known.time, begin) : 0;
    const columns = (each) => [each.time, ...(each.x ? [each.x, each.y, each.theta] : [...each.low, ...(each.high || each.low)])];
    const there = columns(known), fresh = columns(found);
    there.forEach((column, k) => {
      if (first >= 0) column.push(...fresh[k].slice(first));
      if (old) column.splice(0, old);
    });
    known.gap = found.time.length > 2 ? Math.max(known.gap, 0.5) : known.gap;
  }

  return {
    pose, values, curve,
    whole: (kind, i) => layers.whole[kind][i],
    // Fetch what the cursor needs, if it is not there; resolves to whether there is something new to draw.
    near(t) {
      if (data.live) return Promise.resolve(false); // what comes is complete
      const there = layers.near;
      const half = NEAR / 2, known = there && t - half >= there.from && t + half <= there.to;
      return known ? Promise.resolve(false) : ask("near", Math.max(t - NEAR, 0), t + NEAR, NEAR_SAMPLES);
    },
    window: (from, to) => (data.live ? Promise.resolve(false) : ask("window", from, to, WINDOW_CELLS)),
    // Put what is new behind what is known; what is older than `begin` is forgotten.
    append(update, begin) {
      layers.whole.to = update.to;
      for (const kind of ["objects", "grippers", "wrenches", "forces", "residuals"]) {
        update[kind].forEach((found, i) => { if (found) grow(layers.whole[kind][i], found, begin); });
      }
    },
  };
}

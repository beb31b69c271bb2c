// The page: one time for the picture, the curves and the words; keys; what comes new from a running graph.

const byId = (id) => document.getElementById(id);

function count(list, what) { return `${list.length} ${what}${list.length === 1 ? "" : "s"}`; }

async function fetched(address) {
  const answer = await fetch(address);
  if (!answer.ok) throw new Error(`${address}: ${answer.status}`);
  return answer.json();
}

const RECENT = 30; // [s] of a running graph that the curves show at first

function begin(data) {
  const span = () => [data.begin || 0, Math.max(data.end, (data.begin || 0) + 1e-3)];
  let streams = makeStreams(data), drawing = false, scene, plots, now;
  const following = byId("follow"), speed = byId("speed");

  // The largest horizontal force [N] that a gripper felt.
  function largest(i) {
    const found = streams.whole("forces", i);
    if (!found) return 0;
    const ends = (column) => Math.max(...(found.high || found.low)[column].map((v, k) => Math.max(Math.abs(v), Math.abs(found.low[column][k]))), 0);
    return Math.hypot(ends(0), ends(1));
  }

  function centre(i) {
    const seen = streams.pose("objects", i, player.time()), pose = seen ? [seen.x, seen.y] : data.objects[i].pose;
    const [x, y] = pose ? scene.view().map(pose) : [0, 0];
    if (pose) scene.move(scene.view().width / 2 - x, scene.view().height / 2 - y);
  }

  function build() {
    const [start, end] = span(), recent = data.live ? [Math.max(end - RECENT, start), Math.max(end, start + RECENT)] : null;
    byId("title").textContent = document.title = data.title;
    tellState();
    scene = makeScene(byId("scene"), data, streams, largest, scene && scene.kept());
    plots = makePlots(byId("curves"), data, streams, { span, set: (t) => jump(t), zoomed, kept: plots ? plots.shown() : recent });
    now = makeNow(byId("now").tBodies[0], data, streams, centre);
    makeLegend(byId("legend"), data);
    makeNotes(byId("notes"), data);
  }

  function tellState(text) {
    // A clock that counts from 1970 is told as a date, one that counts from a start as it is.
    const from = data.origin > 1e8 ? new Date(1000 * data.origin).toISOString().replace("T", " ").slice(0, 19) + " UTC" : `${trim(data.origin.toFixed(3))} s`;
    const held = data.live ? "live" : `${data.end.toFixed(1)} s`;
    byId("state").textContent = text || `${held} since ${from}, ${count(data.objects, "object")}, ${count(data.grippers, "gripper")}`;
  }

  function draw() {
    drawing = false;
    const t = player.time();
    scene.update(t);
    plots.move(t);
    now(t);
  }

  // At most one picture a frame, however often the slider moves.
  function show(t) {
    if (!drawing) {
      drawing = true;
      requestAnimationFrame(draw);
    }
    streams.near(t).then((fresh) => { if (fresh) show(player.time()); }, lost);
  }

  function lost(error) { tellState(`no answer from the server (${error.message}); start ./pbrl view again`); }

  function zoomed(from, to) {
    byId("whole").hidden = to - from >= span()[1] - span()[0] - 1e-6;
    if (!byId("whole").hidden) streams.window(from, to).then((fresh) => { if (fresh) plots.draw(); }, lost);
  }

  const player = makePlayer({ slider: document.querySelector("#player input"), button: document.querySelector("#player .play"),
    clock: document.querySelector("#player .clock"), span, show, speed: () => Number(speed.value) });

  function jump(t) {
    follow(false);
    player.jump(t);
  }

  const follows = () => data.live && following.getAttribute("aria-pressed") === "true";

  function follow(on) {
    following.setAttribute("aria-pressed", String(on && data.live));
    if (follows()) player.jump(data.end);
  }

  // What a running graph says, as it comes; the browser connects again by itself.
  function listen() {
    const events = new EventSource("events");
    let heard = performance.now(), open = false;
    const again = () => fetched("data").then((found) => {
      data = found;
      streams = makeStreams(data);
      build();
      player.to(follows() ? data.end : player.time());
    }, lost);
    events.addEventListener("open", () => { open = true; again(); });
    events.addEventListener("error", () => { open = false; tellState("the server does not answer; trying again"); });
    events.addEventListener("still", again);
    events.addEventListener("streams", (event) => {
      const update = JSON.parse(event.data);
      heard = performance.now();
      data.end = update.end;
      streams.append(update.streams, data.begin = Math.max(data.begin || 0, update.end - 600));
      if (!follows()) return;
      plots.follow(data.end);
      player.to(data.end);
    });
    setInterval(() => {
      const quiet = (performance.now() - heard) / 1000;
      if (open) tellState(quiet > 2 ? `live, nothing new for ${quiet.toFixed(0)} s` : undefined);
    }, 500);
  }

  const keys = { "+": () => scene.zoom(1.25), "=": () => scene.zoom(1.25), "-": () => scene.zoom(0.8), f: () => scene.fit(),
    a: () => plots.whole(), "[": () => plots.zoom(0.8), "]": () => plots.zoom(1.25), "?": () => byId("help").showModal() };

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT" || byId("help").open) return;
    if (event.key === " " && event.target.tagName === "BUTTON") return; // it is pressed
    const action = keys[event.key] || playerKey(player, span, event);
    if (!action) return;
    if (!keys[event.key]) follow(false);
    event.preventDefault();
    action();
  });
  byId("closer").addEventListener("click", keys["+"]);
  byId("farther").addEventListener("click", keys["-"]);
  byId("fit").addEventListener("click", keys.f);
  byId("whole").addEventListener("click", keys.a);
  byId("help-open").addEventListener("click", keys["?"]);
  following.addEventListener("click", () => follow(!follows()));
  for (const kind of ["input", "pointerdown"]) byId("player").querySelector("input").addEventListener(kind, () => follow(false));
  handleScene(byId("scene"), () => scene);
  build();
  following.hidden = !data.live;
  if (data.live) listen();
  new ResizeObserver(() => { scene.resize(); plots.draw(); }).observe(byId("curves"));
  player.to(data.live ? data.end : 0);
  requestAnimationFrame(() => requestAnimationFrame(() => performance.mark("first-picture")));
}

fetched("data").then(begin, (error) => { byId("title").textContent = `No data: ${error.message}`; });

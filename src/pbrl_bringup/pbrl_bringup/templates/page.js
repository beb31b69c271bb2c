// One time for everything on the page: slider, play button, keys.

const report = JSON.parse(document.getElementById("report").textContent);

function makePlayer(section) {
  const object = report.objects[Number(section.dataset.object)];
  const find = (selector) => section.querySelector(selector);
  const slider = find("input[type=range]"), button = find(".play"), clock = find(".clock"), now = find(".now");
  let episode, updates, end, timer = null, time = 0, stamp = 0;

  function show(t) {
    time = Math.min(Math.max(t, 0), end);
    const index = indexOf(episode.time, time);
    slider.value = String(Math.round((1000 * time) / end));
    clock.textContent = `${time.toFixed(1)} of ${end.toFixed(1)} s`;
    updates.scene(index);
    updates.cursors.forEach((move) => move(time));
    now.innerHTML = errors(index);
  }

  function errors(index) {
    const [before, after] = [episode.error_before, episode.error_after].map((e) => (e.length ? valueAt(e, index) : null));
    const parts = [];
    if (before !== null) parts.push(`before learning off by <span class="before">${length(before)}</span>`);
    if (after !== null) parts.push(`after learning by <span class="after">${length(after)}</span>`);
    if (!parts.length) return "";
    if (!headingSeen(episode)) return `At this moment: prediction ${parts.join(", ")}.`;
    const [start, here] = [episode.recorded[0][2], poseAt(episode.recorded, index)[2]];
    const turned = (Math.atan2(Math.sin(here - start), Math.cos(here - start)) * 180) / Math.PI;
    const way = Math.abs(turned) < 0.5 ? "" : turned > 0 ? " to the left" : " to the right";
    const since = episode.restart ? ` (both start again every ${episode.restart} s from where the ${object.name.replace(/_.$/, "").replaceAll("_", " ")} was)` : "";
    return `At this moment it has turned by ${Math.abs(turned).toFixed(0)}\u00b0${way}; prediction ${parts.join(", ")}${since}.`;
  }

  function choose(number) {
    episode = object.episodes[number];
    end = episode.time[episode.time.length - 1] || 1;
    section.querySelectorAll(".has-before").forEach((node) => { node.hidden = !episode.before.length; });
    updates = { scene: drawScene(find(".scene svg"), object, episode, report.room),
      cursors: [...drawMotion(find(".motion"), episode), ...drawEffort(find(".effort"), episode)] };
    show(telling());
  }

  // Where predictions part most, if they start again and again; else the last moment with a force worth an arrow: the picture that tells most before anybody touches the slider.
  function telling() {
    if (episode.restart) return episode.time[episode.error_before.indexOf(Math.max(...episode.error_before))];
    const force = episode.wrench.map((w) => Math.hypot(w[0], w[1])), most = Math.max(...force, 0);
    const last = force.findLastIndex((f) => f > 0.4 * most);
    return last > 0 ? episode.time[last] : end;
  }

  function stop() {
    if (timer !== null) cancelAnimationFrame(timer);
    timer = null;
    button.innerHTML = "&#9654;";
    button.setAttribute("aria-label", "play");
  }

  function frame(moment) {
    show(time + (moment - stamp) / 1000);
    stamp = moment;
    if (time >= end) stop();
    else timer = requestAnimationFrame(frame);
  }

  function toggle() {
    if (timer !== null) return stop();
    if (time >= end) time = 0;
    button.innerHTML = "&#10073;&#10073;";
    button.setAttribute("aria-label", "pause");
    stamp = performance.now();
    timer = requestAnimationFrame(frame);
  }

  slider.addEventListener("input", () => { stop(); show((Number(slider.value) / 1000) * end); });
  button.addEventListener("click", toggle);
  find(".episodes").addEventListener("change", (event) => { stop(); choose(Number(event.target.value)); });
  if (object.wheel) {
    drawBody(find(".posterior .body"), object);
    drawZoom(find(".posterior .zoom"), object);
  } else if (object.hinge) {
    drawHinge(find(".posterior .zoom"), object);
  }
  choose(0);
  return { toggle, step: (seconds) => { stop(); show(time + seconds); }, to: (share) => { stop(); show(share * end); } };
}

const players = [...document.querySelectorAll("section.object")].filter((s) => report.objects[Number(s.dataset.object)].episodes.length).map(makePlayer);

document.addEventListener("keydown", (event) => {
  if (event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey) return;
  const actions = { " ": (p) => p.toggle(), ArrowLeft: (p) => p.step(-0.1), ArrowRight: (p) => p.step(0.1), Home: (p) => p.to(0), End: (p) => p.to(1) };
  const action = actions[event.key];
  if (!action) return;
  event.preventDefault();
  players.forEach(action);
});

// One time for everything on the page: slider, play button, keys.

const report = JSON.parse(document.getElementById("report").textContent);

function makePage(section) {
  const object = report.objects[Number(section.dataset.object)];
  const find = (selector) => section.querySelector(selector), now = find(".now");
  let episode, updates, end = 1;
  const player = makePlayer({ slider: find("input[type=range]"), button: find(".play"), clock: find(".clock"), span: () => [0, end], show });

  function show(time) {
    const index = indexOf(episode.time, time);
    updates.scene(index);
    updates.cursors.forEach((move) => move(time));
    tellErrors(index);
  }

  // A sentence whose numbers have the colours of their curves.
  function tellErrors(index) {
    const [before, after] = [episode.error_before, episode.error_after].map((e) => (e.length ? valueAt(e, index) : null));
    const parts = [];
    if (before !== null) parts.push(["before learning off by ", coloured("before", length(before))]);
    if (after !== null) parts.push(["after learning by ", coloured("after", length(after))]);
    now.replaceChildren();
    if (!parts.length) return;
    const told = parts.flatMap((part, i) => (i ? [", ", ...part] : part));
    if (!headingSeen(episode)) return now.append("At this moment: prediction ", ...told, ".");
    const [start, here] = [episode.recorded[0][2], poseAt(episode.recorded, index)[2]];
    const turned = (wrapped(here - start) * 180) / Math.PI;
    const way = Math.abs(turned) < 0.5 ? "" : turned > 0 ? " to the left" : " to the right";
    const since = episode.restart ? ` (both start again every ${episode.restart} s from where the ${object.name.replace(/_.$/, "").replaceAll("_", " ")} was)` : "";
    now.append(`At this moment it has turned by ${Math.abs(turned).toFixed(0)}\u00b0${way}; prediction `, ...told, `${since}.`);
  }

  function coloured(kind, text) {
    const node = document.createElement("span");
    node.className = kind;
    node.textContent = text;
    return node;
  }

  function choose(number) {
    episode = object.episodes[number];
    end = episode.time[episode.time.length - 1] || 1;
    section.querySelectorAll(".has-before").forEach((node) => { node.hidden = !episode.before.length; });
    updates = { scene: drawScene(find(".scene svg"), object, episode, report.room),
      cursors: [...drawMotion(find(".motion"), episode), ...drawEffort(find(".effort"), episode)] };
    player.jump(telling());
  }

  // Where predictions part most, if they start again and again; else the last moment with a force worth an arrow: the picture that tells most before anybody touches the slider.
  function telling() {
    if (episode.restart) return episode.time[episode.error_before.indexOf(Math.max(...episode.error_before))];
    const force = episode.wrench.map((w) => Math.hypot(w[0], w[1])), most = Math.max(...force, 0);
    const last = force.findLastIndex((f) => f > 0.4 * most);
    return last > 0 ? episode.time[last] : end;
  }

  find(".episodes").addEventListener("change", (event) => choose(Number(event.target.value)));
  if (object.wheel) {
    drawBody(find(".posterior .body"), object);
    drawZoom(find(".posterior .zoom"), object);
  } else if (object.hinge) {
    drawHinge(find(".posterior .zoom"), object);
  }
  choose(0);
  return (event) => playerKey(player, () => [0, end], event);
}

const pages = [...document.querySelectorAll("section.object")].filter((s) => report.objects[Number(s.dataset.object)].episodes.length).map(makePage);

document.addEventListener("keydown", (event) => {
  if (event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey) return;
  for (const page of pages) {
    const action = page(event);
    if (!action) return;
    event.preventDefault();
    action();
  }
});

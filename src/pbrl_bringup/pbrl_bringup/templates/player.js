// One time for all that a part of a page shows: slider, play button and clock. All pages play with it.

const TICK = 16; // [ms] between pictures while it plays

// `show(t)` draws a time; `span()` gives first and last time [s]; `speed()` seconds of the recording a second.
function makePlayer({ slider, button, clock, span, show, speed = () => 1, stopped = () => {} }) {
  let time = span()[0], timer = null, stamp = 0;

  function to(t) {
    const [start, end] = span();
    time = Math.min(Math.max(t, start), end);
    slider.value = String(Math.round((Number(slider.max) * (time - start)) / (end - start || 1)));
    slider.setAttribute("aria-valuetext", `${time.toFixed(1)} of ${end.toFixed(1)} seconds`);
    clock.textContent = `${time.toFixed(1)} of ${end.toFixed(1)} s`;
    show(time);
  }

  function stop() {
    if (timer === null) return;
    clearInterval(timer);
    timer = null;
    button.textContent = "\u25b6";
    button.setAttribute("aria-label", "play");
    stopped();
  }

  function tick() {
    const moment = performance.now(), [, end] = span(), next = time + ((moment - stamp) / 1000) * speed();
    stamp = moment;
    to(next);
    if (next >= end) stop();
  }

  function toggle() {
    if (timer !== null) return stop();
    const [start, end] = span();
    if (time >= end) time = start;
    button.textContent = "\u2759\u2759";
    button.setAttribute("aria-label", "pause");
    stamp = performance.now();
    timer = setInterval(tick, TICK);
  }

  function jump(t) { stop(); to(t); }

  slider.addEventListener("input", () => {
    const [start, end] = span();
    jump(start + (Number(slider.value) / Number(slider.max)) * (end - start));
  });
  button.addEventListener("click", toggle);
  return { to, jump, stop, toggle, step: (seconds) => jump(time + seconds), time: () => time, playing: () => timer !== null };
}

// What a key does to a player, or nothing; `shift` steps ten times as far.
function playerKey(player, span, event) {
  const step = event.shiftKey ? 1 : 0.1;
  const actions = { " ": () => player.toggle(), ArrowLeft: () => player.step(-step), ArrowRight: () => player.step(step),
    Home: () => player.jump(span()[0]), End: () => player.jump(span()[1]) };
  return actions[event.key];
}

// The page of a recorded run: its clock and bar. A test reads the number of pictures and the time of the script from
// the canvas.
"use strict";
(async () => {
  const [button, field, slider] = ["#play", "#time", "#slider"].map((one) => document.querySelector(one));
  const speed = part("speed");
  let stage;
  try {
    stage = new Stage();
    stage.setScene(openScene(await unpacked("scene")));
  } catch (error) {
    part("message").textContent = `This run cannot be drawn: ${error.message}`;
    part("message").hidden = false;
    throw error;
  }
  const { scene } = stage;
  const frames = new Frames(scene);
  const end = scene.time.at(-1);
  const last = scene.time.length - 1;
  let time = 0;
  let playing = true;

  slider.max = end || 1;
  const show = (typing = false) => {
    slider.value = time;
    slider.setAttribute("aria-valuenow", time.toFixed(3));
    if (!typing) field.value = time.toFixed(3);
    button.textContent = playing ? "❚❚" : "▶";
    curves.follow(time);
    stage.stale = true;
  };
  const seek = (moment, typing) => {
    time = Math.min(end, Math.max(0, moment));
    playing = false;
    stage.leap = true;
    show(typing);
  };
  const curves = new Curves(part("panel"), scene.curves, (moment) => seek(moment, false));
  const toggle = () => {
    playing = !playing;
    if (playing && time >= end) time = 0;
    show();
  };
  button.addEventListener("click", toggle);
  field.addEventListener("input", () => Number.isFinite(parseFloat(field.value)) && seek(parseFloat(field.value), true));
  slider.addEventListener("input", () => seek(Number(slider.value)));
  part("loop").addEventListener("click", () => part("loop").classList.toggle("on"));
  part("ticks").replaceChildren(...scene.events.map(({ time: at, name }) => {
    const tick = document.createElement("i");
    tick.style.left = `${(100 * at) / (end || 1)}%`;
    tick.title = `${at.toFixed(2)} s: ${name}`;
    return tick;
  }));
  const step = (way) => {
    const at = scene.time[Math.min(last, Math.max(0, sampleAt(time + 1e-6) + way))];
    seek(at, false);
  };
  const faster = (way) => {
    speed.selectedIndex = Math.min(speed.length - 1, Math.max(0, speed.selectedIndex + way));
  };
  const KEYS = { " ": toggle, ArrowLeft: () => seek(time - 1, false), ArrowRight: () => seek(time + 1, false), ",": () => step(-1),
    ".": () => step(1), Home: () => seek(0, false), End: () => seek(end, false), "+": () => faster(1), "-": () => faster(-1) };
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input[type=text], select")) return;
    if (event.key in KEYS) KEYS[event.key]();
    else if (!stage.key(event)) return;
    event.preventDefault();
  });

  const sampleAt = (moment) => {
    let [low, high] = [0, last];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (scene.time[middle] <= moment) low = middle;
      else high = middle;
    }
    return scene.time[high] <= moment ? high : low;
  };
  // Draws the present time; returns whether its frames were there.
  const draw = (elapsed) => {
    const k = sampleAt(time);
    const next = Math.min(k + 1, last);
    const before = frames.frame(k);
    const after = before && frames.frame(next);
    if (!before || !after) return false;
    const span = scene.time[next] - scene.time[k];
    const share = span > 0 ? (time - scene.time[k]) / span : 0;
    stage.draw({ before, after, share, rate: span > 0 ? 1 / span : 0, k, time }, elapsed);
    return true;
  };
  const advance = (moment) => {
    if (moment <= end) return moment;
    stage.leap = true;
    if (part("loop").classList.contains("on")) return moment % end;
    playing = false;
    return end;
  };
  let before = null;
  const tick = (now) => {
    const elapsed = before === null ? 0 : Math.min(0.25, (now - before) / 1000);
    before = now;
    if (playing && end > 0) {
      const moment = time;
      time = advance(time + elapsed * Number(speed.value));
      if (draw(elapsed)) show();
      else time = moment; // its piece is not unpacked yet: the clock waits
    } else if (stage.stale) draw(null);
    requestAnimationFrame(tick);
  };
  if (stage.view.software) stage.say("no graphics card: expect fewer pictures a second");
  show();
  requestAnimationFrame(tick);
})();

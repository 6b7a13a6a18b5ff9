// The player of a page of balls: clock, bar and camera. A test reads the script's time per picture from the canvas.
"use strict";
(async () => {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const root = document.getElementById("root");
  const [canvas, button, field, slider] = ["canvas", "button", "input", "[role=slider]"].map((s) => root.querySelector(s));
  const [speed, paint, message] = ["speed", "paint", "message"].map((id) => document.getElementById(id));
  const say = (text) => {
    message.textContent = text;
    message.hidden = text === "";
  };
  const end = scene.time.at(-1);
  const last = scene.time.length - 1;
  let time = 0;
  let playing = true;
  let stale = true; // whether the picture must be drawn anew

  // --- The bar
  slider.max = end || 1;
  const show = (typing = false) => {
    slider.value = time;
    slider.setAttribute("aria-valuenow", time.toFixed(3));
    if (!typing) field.value = time.toFixed(3);
    button.textContent = playing ? "❚❚" : "▶";
    stale = true;
  };
  const seek = (moment, typing) => {
    time = Math.min(end, Math.max(0, moment));
    playing = false;
    show(typing);
  };
  const toggle = () => {
    playing = !playing;
    show();
  };
  button.addEventListener("click", toggle);
  field.addEventListener("input", () => Number.isFinite(parseFloat(field.value)) && seek(parseFloat(field.value), true));
  slider.addEventListener("input", () => seek(Number(slider.value)));
  paint.addEventListener("change", () => (stale = true));
  window.addEventListener("resize", () => (stale = true));
  window.addEventListener("keydown", (event) => {
    if (event.code !== "Space" || event.target.closest("button, input, select")) return;
    event.preventDefault();
    toggle();
  });

  // --- The camera: it turns about a target, which the rover's path carries along
  const arm = scene.view.eye.map((value, i) => value - scene.view.target[i]);
  let target = scene.view.target;
  let distance = Math.hypot(...arm);
  let azimuth = Math.atan2(arm[0], arm[2]);
  let elevation = Math.asin(arm[1] / distance);
  const away = () => [
    Math.cos(elevation) * Math.sin(azimuth),
    Math.sin(elevation),
    Math.cos(elevation) * Math.cos(azimuth),
  ];
  const orbit = (dx, dy) => {
    azimuth -= 0.006 * dx;
    elevation = Math.min(1.55, Math.max(-1.55, elevation + 0.006 * dy));
  };
  const pan = (dx, dy) => {
    const x = unit(cross([0, 1, 0], away()));
    const y = cross(away(), x);
    const scale = (2 * distance * Math.tan(scene.view.angle / 2)) / canvas.clientHeight;
    target = target.map((value, i) => value + scale * (dy * y[i] - dx * x[i]));
  };
  const zoom = (factor) => {
    distance = Math.min(1e4, Math.max(3 * scene.radius, distance * factor));
  };
  const pointers = new Map();
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (before === undefined) return;
    const [dx, dy] = [event.clientX - before.clientX, event.clientY - before.clientY];
    if (pointers.size === 2) {
      const [other] = [...pointers.values()].filter((pointer) => pointer.pointerId !== event.pointerId);
      const span = (pointer) => Math.hypot(pointer.clientX - other.clientX, pointer.clientY - other.clientY);
      zoom(span(before) / Math.max(1, span(event)));
      pan(dx / 2, dy / 2);
    } else if (event.buttons & 2 || event.shiftKey) pan(dx, dy);
    else orbit(dx, dy);
    pointers.set(event.pointerId, event);
    stale = true;
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1)));
    stale = true;
  }, { passive: false });

  // --- What the page holds
  say("unpacking");
  const names = ["radii", "fixed", "poses", "vertices", "colours", "triangles"];
  const blobs = Object.fromEntries(await Promise.all(names.map(async (name) => [name, await unpacked(name)])));
  let view;
  try {
    view = new GrainView(canvas, scene, blobs);
  } catch (error) {
    say(`The balls cannot be drawn: ${error.message}`);
    throw error;
  }
  const poses = new Float32Array(blobs.poses.buffer);
  const frames = new GrainFrames(scene);
  const { gl } = view;
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const engine = gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  const software = /swiftshader|llvmpipe|software|basic render/i.test(engine);
  const ratio = () => (software ? 1 : Math.min(2, window.devicePixelRatio || 1));

  // --- The clock
  const held = [-1, -1]; // the samples in the graphics card's memory
  const slotOf = (k, other) => {
    let slot = held.indexOf(k);
    if (slot >= 0) return slot;
    const levels = frames.sample(k);
    if (levels === null) return -1;
    slot = held[0] === other ? 1 : 0;
    view.upload(slot, levels);
    held[slot] = k;
    return slot;
  };
  const sampleAt = (moment) => {
    let [low, high] = [0, last];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (scene.time[middle] <= moment) low = middle;
      else high = middle;
    }
    return scene.time[high] <= moment ? high : low;
  };
  const posesAt = (k, next, share) => {
    const size = 7 * scene.solids;
    const result = new Float32Array(size);
    for (let i = 0; i < size; i++) result[i] = (1 - share) * poses[k * size + i] + share * poses[next * size + i];
    for (let i = 3; i < size; i += 7) {
      const length = Math.hypot(result[i], result[i + 1], result[i + 2], result[i + 3]);
      for (let j = i; j < i + 4; j++) result[j] /= length;
    }
    return result;
  };
  // Draws the present time; returns whether its samples were there.
  const draw = () => {
    const k = sampleAt(time);
    const next = Math.min(k + 1, last);
    const slots = [slotOf(k, next), -1];
    slots[1] = slotOf(next, k);
    if (slots[0] < 0 || slots[1] < 0) return false;
    const span = scene.time[next] - scene.time[k];
    const share = span > 0 ? (time - scene.time[k]) / span : 0;
    const centre = scene.centres[k].map((value, i) => (1 - share) * value + share * scene.centres[next][i]);
    const look = target.map((value, i) => value + centre[i]);
    const direction = away();
    const camera = { eye: look.map((v, i) => v + distance * direction[i]), target: look, angle: scene.view.angle };
    const rate = span > 0 ? 1 / span : 0;
    view.draw({ slots, share, rate, poses: posesAt(k, next, share), camera, paint: Number(paint.value), ratio: ratio() });
    return true;
  };
  const spent = []; // ms of script, of the latest pictures
  let before = null;
  const tick = (now) => {
    const begin = performance.now();
    const elapsed = before === null ? 0 : Math.min(0.25, (now - before) / 1000);
    before = now;
    let drawn = false;
    if (playing && end > 0) {
      const moment = time;
      time = (time + elapsed * Number(speed.value)) % end;
      drawn = draw();
      if (drawn) show();
      else time = moment; // its piece is not unpacked yet: the clock waits
    } else if (stale) {
      drawn = draw();
      stale = !drawn;
    }
    if (drawn) measured(performance.now() - begin);
    requestAnimationFrame(tick);
  };
  const measured = (took) => {
    spent.push(took);
    if (spent.length > 120) spent.shift();
    canvas.dataset.script = spent.slice().sort((a, b) => a - b)[Math.floor(spent.length / 2)].toFixed(2);
    canvas.dataset.drawn = Number(canvas.dataset.drawn || 0) + 1;
  };
  const begin = () => {
    const levels = frames.sample(0);
    if (levels === null) {
      requestAnimationFrame(begin);
      return;
    }
    view.setBalls(new Float32Array(blobs.radii.buffer), blobs.fixed, levels);
    say(software ? "This browser draws without a graphics card: expect a few pictures a second." : "");
    if (software) setTimeout(() => say(""), 6000);
    show();
    requestAnimationFrame(tick);
  };
  begin();
})();

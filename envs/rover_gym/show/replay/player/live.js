// The page of a live drive: keys, stick, gamepad and sliders become messages, frames become pictures, states become text
// and curves. All text goes into the page as text.
"use strict";
(() => {
  const KEPT = 20; // s of curves
  const PERIOD = 100; // ms between two commands by hand; the drive forgets one after 1000
  const DEAD = 0.12; // of a gamepad's stick, which never rests at zero
  const STEERS = { w: [1, 0], s: [-1, 0], a: [0, 1], d: [0, -1],
    arrowup: [1, 0], arrowdown: [-1, 0], arrowleft: [0, 1], arrowright: [0, -1] };
  const ACTS = { " ": () => say({ do: "pause", on: !state?.paused }), ".": () => say({ do: "step" }),
    r: () => say({ do: "rewind", seconds: 5 }), t: () => throwRock() };
  const CHOICES = ["driver", "ground", "model"];
  const SLIDERS = ["friction", "gravity", "difficulty", "goal_distance"];

  const SCENE = 1; // kind of a binary message; others are frames
  const HEAD = 16; // bytes

  let stage;
  try {
    stage = new Stage();
    stage.eye.preset = "chase";
  } catch (error) {
    part("message").textContent = `The scene cannot be drawn: ${error.message}`;
    part("message").hidden = false;
  }
  let socket = null;
  let state = null;
  let samples = [];
  let world = null;
  const pressed = new Set();
  const held = {}; // controls that the user has just changed keep their value until the drive has answered

  // --- messages ---------------------------------------------------------------------------------------------------
  const say = (message) => {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
  const notice = (text) => stage?.say(text, 6);
  const throwRock = () => say({ do: "rock", radius: Number(part("radius").value) });

  const connect = () => {
    socket = new WebSocket(`ws://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => stage && socket.send('{"do":"watch"}'));
    socket.addEventListener("message", (event) => {
      if (typeof event.data !== "string") {
        receive(event.data);
        return;
      }
      const message = JSON.parse(event.data);
      if (message.choices) offer(message.choices);
      if (message.error) notice(message.error);
      if (message.state) show(message.state);
    });
    socket.addEventListener("close", () => {
      part("clock").textContent = "connection lost, reconnecting";
      setTimeout(connect, 1000);
    });
  };

  const offer = (choices) => {
    for (const name of CHOICES) {
      part(name).replaceChildren(...choices[name].map((value) => new Option(value, value)));
    }
    samples = [];
  };

  // --- pictures ---------------------------------------------------------------------------------------------------
  let number = -1; // of the scene
  let [before, now] = [null, null]; // the last two frames
  const receive = (message) => {
    const head = new DataView(message);
    const [kind, scene, time] = [head.getUint32(0, true), head.getUint32(4, true), head.getFloat64(8, true)];
    if (kind === SCENE) {
      const opened = openScene(new Uint8Array(message, HEAD));
      stage.setScene(opened, number >= 0 && opened.reach === stage.scene.reach); // a rover of another size is fitted anew
      number = scene;
      before = now = null;
    } else if (scene === number) {
      const frame = { ...wholeFrame(stage.scene.channels, new Uint8Array(message), HEAD), time, at: performance.now() };
      before = now && time > now.time ? now : frame;
      now = frame;
      mark(frame);
      const { ruts } = stage.view;
      for (let at = HEAD + sizeOf(stage.scene.channels); ruts && at < message.byteLength; at += 8)
        ruts.press(head.getUint32(at, true), head.getUint32(at + 4, true));
    }
  };
  // Adds the feet of the wheels that bear something to their marks.
  const mark = ({ forces }) => stage.scene.wheels.forEach((wheel, i) => {
    const [x, y, z, fx, fy, fz] = [0, 1, 2, 3, 4, 5].map((c) => forces.value(i, c));
    stage.view.overlays.bands?.add(i, x, Math.hypot(fx, fy, fz) > 0.01 ? y + 0.02 * wheel.radius : NaN, z);
  });
  // Between two control periods the poses are interpolated: the picture is one period behind and does not jerk.
  let drawn = null;
  const paint = (moment) => {
    const still = state?.paused && now && performance.now() - now.at > 1000;
    if (now && (!still || stage.stale)) {
      const share = Math.min(1, (performance.now() - now.at) / (1000 * stage.scene.period));
      const elapsed = drawn === null ? null : Math.min(0.25, (moment - drawn) / 1000);
      stage.draw({ before, after: now, share, rate: 1 / stage.scene.period, k: 0, time: now.time }, elapsed);
      drawn = moment;
    }
    requestAnimationFrame(paint);
  };

  // --- driving by hand --------------------------------------------------------------------------------------------
  const typing = (event) => event.target.matches?.("select, input[type=number]");
  addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (key in STEERS) {
      if (!pressed.has(key)) { pressed.add(key); drive(); }
    } else if (key in ACTS) {
      if (!event.repeat) ACTS[key]();
    } else if (!stage?.scene || !stage.key(event)) return;
    event.preventDefault();
  });
  addEventListener("keyup", (event) => { if (pressed.delete(event.key.toLowerCase())) drive(); });
  addEventListener("blur", () => pressed.clear());

  let pad = null;
  addEventListener("gamepadconnected", (event) => {
    pad = event.gamepad.index;
    part("gamepad").textContent = "gamepad";
  });
  addEventListener("gamepaddisconnected", (event) => {
    if (event.gamepad.index !== pad) return;
    pad = null;
    part("gamepad").textContent = "gamepad disconnected";
    drive();
  });
  const beyond = (value) => (Math.abs(value) < DEAD ? 0 : value);
  const limited = (value) => Math.max(-1, Math.min(1, value)) || 0;
  const fromPad = () => {
    const read = pad === null ? null : navigator.getGamepads()[pad];
    if (!read?.connected) return [0, 0];
    const trigger = (read.buttons[7]?.value ?? 0) - (read.buttons[6]?.value ?? 0);
    return [beyond(trigger) || beyond(-(read.axes[1] ?? 0)), beyond(-(read.axes[0] ?? 0))];
  };
  const fromKeys = () => [...pressed].reduce(([a, b], key) => [a + STEERS[key][0], b + STEERS[key][1]], [0, 0]);
  // The stick on a touch screen: up is forward, left turns left.
  let pulled = [0, 0];
  const stick = part("stick");
  const pull = (event) => {
    const box = stick.getBoundingClientRect();
    const reach = 0.36 * box.width;
    let [x, y] = [(event.clientX - box.x - box.width / 2) / reach, (event.clientY - box.y - box.height / 2) / reach];
    const far = Math.max(1, Math.hypot(x, y));
    [x, y] = [x / far, y / far];
    pulled = [beyond(-y), beyond(-x)];
    stick.firstChild.style.transform = `translate(${reach * x}px, ${reach * y}px)`;
    drive();
  };
  const release = () => {
    pulled = [0, 0];
    stick.firstChild.style.transform = "";
    drive();
  };
  stick.addEventListener("pointerdown", (event) => {
    stick.setPointerCapture(event.pointerId);
    pull(event);
  });
  stick.addEventListener("pointermove", (event) => { if (stick.hasPointerCapture(event.pointerId)) pull(event); });
  for (const name of ["pointerup", "pointercancel"]) stick.addEventListener(name, release);
  const fromSliders = () => [Number(part("forward").value), Number(part("turn").value)];
  let moving = false;
  const drive = () => {
    const [forward, turn] = [fromKeys(), pulled, fromPad(), fromSliders()].find(([a, b]) => a || b) ?? [0, 0];
    const asked = forward !== 0 || turn !== 0;
    if (asked || moving) say({ do: "drive", forward: limited(forward), turn: limited(turn) });
    moving = asked;
  };
  setInterval(drive, PERIOD);

  // --- controls ---------------------------------------------------------------------------------------------------
  part("pause").addEventListener("click", () => ACTS[" "]());
  part("step").addEventListener("click", () => ACTS["."]());
  part("back").addEventListener("click", () => ACTS.r());
  part("restart").addEventListener("click", () => say({ do: "restart" }));
  part("record").addEventListener("click", () => say({ do: "record", on: !state?.recording }));
  part("rock").addEventListener("click", throwRock);
  part("stop").addEventListener("click", () => {
    part("forward").value = part("turn").value = 0;
    label();
    drive();
  });
  part("wheel").addEventListener("click", (event) => {
    if (event.target.matches("button")) say({ do: "take" });
  });
  const change = (name, value) => {
    held[name] = performance.now();
    say({ do: "change", name, value });
  };
  for (const name of CHOICES) part(name).addEventListener("change", (event) => {
    change(name, event.target.value);
    event.target.blur();
  });
  for (const name of ["friction", "gravity"]) part(name).addEventListener("input", (event) => {
    change(name, Number(event.target.value));
  });
  for (const name of ["difficulty", "goal_distance", "seed"]) part(name).addEventListener("change", (event) => {
    change(name, Number(event.target.value));
  });
  const label = () => {
    for (const slider of document.querySelectorAll("#panel input[type=range]")) {
      slider.nextElementSibling.textContent = slider.value;
    }
  };
  part("panel").addEventListener("input", label);
  part("panel").addEventListener("change", (event) => { if (event.target.type === "range") event.target.blur(); });

  // --- what the drive says ----------------------------------------------------------------------------------------
  let heard = -1;
  const show = (now) => {
    state = now;
    document.title = part("name").textContent = `${now.scene.model}, driven by ${now.scene.driver}`;
    const pace = now.paused ? "paused" : now.pace === null ? "" : `${now.pace.toFixed(2)} x real time`;
    part("clock").textContent =
      `${now.time.toFixed(2)} s, ${now.speed?.toFixed(2)} m/s, goal ${now.distance?.toFixed(1)} m, ` +
      `lean ${now.tilt?.toFixed(0)}°, solver ${now.solver}, ${now.iterations} iterations, ${now.contacts} contacts. ${pace}`;
    if (now.notices !== heard && now.notice) notice(now.notice);
    heard = now.notices;
    part("speed").textContent = (now.speed ?? 0).toFixed(1);
    part("slip").textContent = (100 * (now.slip ?? 0)).toFixed(0);
    part("tilt").textContent = (now.tilt ?? 0).toFixed(0);
    part("pause").textContent = now.paused ? "go on" : "pause";
    part("record").textContent = now.recording ? `recording ${now.recording}` : "record";
    part("record").classList.toggle("on", now.recording !== "");
    part("back").disabled = now.reach <= 0 || now.wheel === "elsewhere";
    wheel(now);
    part("difficulty").disabled = now.wheel === "elsewhere" || now.scene.ground === "plane";
    for (const name of [...CHOICES, ...SLIDERS, "seed"]) {
      const node = part(name);
      if (document.activeElement !== node && performance.now() - (held[name] ?? -1e9) > 600) node.value = now.scene[name];
    }
    label();
    if (world !== now.world) samples = samples.filter((sample) => sample.time < now.time);
    world = now.world;
    if (samples.length && samples[0].loads.length !== now.loads.length) samples = [];
    if (!samples.length || now.time > samples.at(-1).time) samples.push(now);
    else if (now.time < samples.at(-1).time) samples = [now];
    while (samples[0].time < now.time - KEPT) samples.shift();
    charts.forEach(draw);
  };

  const wheel = (now) => {
    const node = part("wheel");
    if (node.dataset.wheel !== now.wheel) {
      node.dataset.wheel = now.wheel;
      node.replaceChildren();
      if (now.wheel === "elsewhere") {
        const take = document.createElement("button");
        take.textContent = "take the wheel";
        node.append("Another page drives. ", take);
      }
      for (const control of document.querySelectorAll("#panel .row button, #panel input, #panel select, #bar button:not(#dark, #help)")) {
        control.disabled = now.wheel === "elsewhere";
      }
    }
  };

  // --- curves -----------------------------------------------------------------------------------------------------
  const charts = [
    { title: "wheel load (N)", of: (sample) => sample.loads, names: (sample) => sample.wheels },
    { title: "slip (1)", of: (sample) => [sample.slip], top: 0.2 },
    { title: "work of the motors (J)", of: (sample) => [sample.energy] },
    { title: "solver iterations per period (1)", of: (sample) => [sample.iterations], top: 10 },
  ];
  for (const chart of charts) {
    const title = part("charts").appendChild(document.createElement("h2"));
    title.textContent = chart.title;
    chart.canvas = part("charts").appendChild(document.createElement("canvas"));
    chart.legend = part("charts").appendChild(document.createElement("div"));
    chart.legend.className = "legend";
  }
  const round = (value) => {
    const power = 10 ** Math.floor(Math.log10(value));
    return power * [1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10].find((factor) => factor * power >= value * (1 - 1e-9));
  };
  const draw = (chart) => {
    const { canvas } = chart;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !samples.length) return;
    const scale = devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * scale)) {
      canvas.width = Math.round(width * scale);
      canvas.height = Math.round(height * scale);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    const rows = samples.map(chart.of);
    const sorted = rows.flat().filter((value) => value !== null).sort((a, b) => a - b);
    // A single impact must not flatten the rest.
    const bulk = 1.6 * (sorted[Math.floor(0.95 * (sorted.length - 1))] ?? 0);
    const high = round(Math.max(chart.top ?? 1, Math.min(sorted.at(-1) ?? 0, bulk)));
    const end = samples.at(-1).time;
    const x = (time) => 42 + ((time - end + KEPT) / KEPT) * (width - 48);
    const y = (value) => 6 + (1 - Math.min(value, high) / high) * (height - 24);
    pen.font = "10px sans-serif";
    const ink = getComputedStyle(document.documentElement);
    pen.fillStyle = ink.getPropertyValue("--soft");
    pen.strokeStyle = ink.getPropertyValue("--grid");
    pen.textAlign = "right";
    for (const value of [0, high / 2, high]) {
      pen.beginPath();
      pen.moveTo(42, y(value));
      pen.lineTo(width - 6, y(value));
      pen.stroke();
      pen.fillText(String(Number(value.toPrecision(3))), 38, y(value) + 3);
    }
    pen.textAlign = "center";
    for (const back of [20, 15, 10, 5]) pen.fillText(`-${back} s`, x(end - back), height - 5);
    const count = rows.at(-1).length;
    const colours = count > 1 ? samples.at(-1).colours : ["#0072B2"];
    for (let k = 0; k < count; k++) {
      pen.strokeStyle = colours[k];
      pen.beginPath();
      samples.forEach((sample, i) => {
        const value = rows[i][k];
        if (value !== null) pen.lineTo(x(sample.time), y(value));
      });
      pen.stroke();
    }
    if (chart.names) {
      const names = chart.names(samples.at(-1));
      if (chart.legend.children.length !== names.length) {
        chart.legend.replaceChildren(...names.map((name, k) => {
          const entry = document.createElement("span");
          entry.append(document.createElement("i"), name);
          entry.firstChild.style.background = colours[k];
          return entry;
        }));
      }
    }
  };

  label();
  connect();
  if (stage) requestAnimationFrame(paint);
})();

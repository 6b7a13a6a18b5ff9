// The panel of a live drive: keys, gamepad and sliders become messages, states become text and curves. All text goes
// into the page as text.
"use strict";
(() => {
  const part = (name) => document.getElementById(name);
  const KEPT = 20; // s of curves
  const PERIOD = 100; // ms between two commands by hand; the drive forgets one after 1000
  const DEAD = 0.12; // of a gamepad's stick, which never rests at zero
  const STEERS = { w: [1, 0], s: [-1, 0], a: [0, 1], d: [0, -1],
    arrowup: [1, 0], arrowdown: [-1, 0], arrowleft: [0, 1], arrowright: [0, -1] };
  const ACTS = { " ": () => say({ do: "pause", on: !state?.paused }), ".": () => say({ do: "step" }),
    r: () => say({ do: "rewind", seconds: 5 }), t: () => throwRock() };
  const CHOICES = ["driver", "ground", "model"];
  const SLIDERS = ["friction", "gravity", "difficulty", "goal_distance"];

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
  const notice = (text) => { part("notice").textContent = text; };
  const throwRock = () => say({ do: "rock", radius: Number(part("radius").value) });

  const connect = () => {
    socket = new WebSocket(`ws://${location.host}/live`);
    socket.addEventListener("message", (event) => {
      const message = JSON.parse(event.data);
      if (message.choices) offer(message.choices);
      if (message.error) notice(message.error);
      if (message.state) show(message.state);
    });
    socket.addEventListener("close", () => {
      part("clock").textContent = "the drive is gone; trying to find it again";
      setTimeout(connect, 1000);
    });
  };

  const offer = (choices) => {
    for (const name of CHOICES) {
      part(name).replaceChildren(...choices[name].map((value) => new Option(value, value)));
    }
    samples = [];
  };

  // --- driving by hand --------------------------------------------------------------------------------------------
  const typing = (event) => event.target.matches?.("select, input[type=number]");
  addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (typing(event) || event.ctrlKey || event.metaKey || event.altKey || !(key in STEERS || key in ACTS)) return;
    event.preventDefault();
    event.stopImmediatePropagation(); // viser's client moves its camera by the same keys
    if (key in STEERS) {
      if (!pressed.has(key)) { pressed.add(key); drive(); }
    } else if (!event.repeat) ACTS[key]();
  }, true);
  addEventListener("keyup", (event) => {
    if (pressed.delete(event.key.toLowerCase())) { event.stopImmediatePropagation(); drive(); }
  }, true);
  addEventListener("blur", () => pressed.clear());

  let pad = null;
  addEventListener("gamepadconnected", (event) => {
    pad = event.gamepad.index;
    part("gamepad").textContent = "gamepad";
  });
  addEventListener("gamepaddisconnected", (event) => {
    if (event.gamepad.index !== pad) return;
    pad = null;
    part("gamepad").textContent = "gamepad gone";
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
  const fromSliders = () => [Number(part("forward").value), Number(part("turn").value)];
  let moving = false;
  const drive = () => {
    const [forward, turn] = [fromKeys(), fromPad(), fromSliders()].find(([a, b]) => a || b) ?? [0, 0];
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
    const pace = now.paused ? "paused" : now.pace === null ? "" : `${now.pace.toFixed(2)} x real time`;
    part("clock").textContent =
      `${now.time.toFixed(2)} s, ${now.speed?.toFixed(2)} m/s, goal ${now.distance?.toFixed(1)} m, ` +
      `lean ${now.tilt?.toFixed(0)}°, solver ${now.solver}, ${now.iterations} iterations, ${now.contacts} contacts. ${pace}`;
    if (now.notices !== heard) notice(now.notice);
    heard = now.notices;
    part("pause").textContent = now.paused ? "go on" : "pause";
    part("record").textContent = now.recording ? `recording ${now.recording}` : "record";
    part("record").classList.toggle("on", now.recording !== "");
    part("back").disabled = now.reach <= 0 || now.wheel === "elsewhere";
    wheel(now);
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
        node.append("Another page is at the wheel. ", take);
      }
      for (const control of document.querySelectorAll("#panel .row button, #panel input, #panel select")) {
        control.disabled = now.wheel === "elsewhere";
      }
    }
  };

  // --- curves -----------------------------------------------------------------------------------------------------
  const charts = [
    { title: "wheel load (N)", of: (sample) => sample.loads, names: (sample) => sample.wheels },
    { title: "slip (1)", of: (sample) => [sample.slip], top: 0.2 },
    { title: "energy of the motors (J)", of: (sample) => [sample.energy] },
    { title: "solver's iterations a period (1)", of: (sample) => [sample.iterations], top: 10 },
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
    pen.fillStyle = "#555";
    pen.strokeStyle = "#e3e3e3";
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
})();

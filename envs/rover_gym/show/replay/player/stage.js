// What a recorded and a live page have in common: the picture, its camera and overlays, their buttons and keys.
"use strict";

const part = (name) => document.getElementById(name);

// What the picture's buttons do, for tooltips and help.
const TELLS = {
  orbit: "turn about what moves", chase: "follow from behind", top: "look from above", wheel: "look at a wheel; again: the next",
  mast: "look from the mast", marks: "tyre marks", trails: "paths of the wheels", forces: "contact forces", cones: "friction cones",
  mass: "mass centre and support", plan: "planned path", scan: "height scan", laser: "laser", depth: "depth camera",
  loads: "loads as colours", slope: "slope as colours", spheres: "rocks as simulated spheres",
};
const TOUCH = matchMedia("(pointer: coarse)").matches;

class Stage {
  constructor() {
    this.canvas = document.querySelector("#root canvas");
    this.view = new View(this.canvas);
    this.stale = true;
    this.eye = new Eye(this.view, this.canvas, () => (this.stale = true));
    this.spent = []; // ms of script, of the latest pictures
    window.addEventListener("resize", () => (this.stale = true));
    part("dark").addEventListener("click", () => this.setDark(!this.view.dark));
    part("paint").addEventListener("change", (event) => {
      this.view.paint = Number(event.target.value);
      this.stale = true;
      event.target.blur();
    });
    part("help").addEventListener("click", () => this.help());
    window.addEventListener("keydown", (event) => event.key === "Escape" && !part("keys").hidden && this.help(false));
    part("help").title = TOUCH ? "help" : "help (?)";
    part("dark").title = TOUCH ? "dark mode" : "dark mode (N)";
    this.setDark(matchMedia("(prefers-color-scheme: dark)").matches);
  }

  // Opens or closes the help: on a touch screen the gestures, else the keys of what this scene can show.
  help(open = part("keys").hidden) {
    const box = part("keys");
    for (const node of box.querySelectorAll("[data-for]")) node.hidden = (node.dataset.for === "touch") !== TOUCH;
    const entries = !this.scene ? [] : [...this.eye.presets().map((name, i) => [String(i + 1), name]),
      ...this.view.overlays.offers().filter(([, , reason]) => !reason).map(([name, key]) => [key, name])];
    box.querySelector(".picture").replaceChildren(...entries.flatMap(([key, name], i) => {
      const cap = document.createElement("kbd");
      cap.textContent = key.toUpperCase();
      return [i ? " · " : "", cap, ` ${TELLS[name]}`];
    }));
    box.hidden = !open;
    if (open) this.say("");
  }

  // Shows a scene; `keep` leaves the camera as it is.
  setScene(scene, keep = false) {
    this.scene = scene;
    if (!keep) for (const name of scene.on ?? []) this.view.on.add(name);
    this.view.setScene(scene);
    this.eye.start(scene, keep);
    this.offer();
    part("paint").hidden = !this.view.balls;
    this.stale = true;
  }

  // The buttons of presets and overlays, each with its key.
  offer() {
    const presets = this.eye.presets();
    part("presets").replaceChildren(...presets.map((name, i) => this.button(name, String(i + 1), () => this.choose(name))));
    part("overlays").replaceChildren(
      ...this.view.overlays.offers().map(([name, key, reason]) => this.button(name, key, () => this.toggle(name), reason)));
    this.mark();
  }

  button(name, key, act, reason = "") {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = name;
    button.dataset.name = name;
    button.title = reason || (TOUCH ? TELLS[name] : `${TELLS[name]} (${key.toUpperCase()})`);
    button.disabled = reason !== "";
    button.addEventListener("click", () => {
      act();
      button.blur();
    });
    return button;
  }

  mark() {
    for (const button of part("presets").children) button.classList.toggle("on", button.dataset.name === this.eye.preset);
    for (const button of part("overlays").children) button.classList.toggle("on", !button.disabled && this.view.on.has(button.dataset.name));
    this.view.slope.value = this.view.on.has("slope") ? 1 : 0;
  }

  choose(preset) {
    this.eye.choose(preset);
    this.leap = true;
    this.mark();
  }

  toggle(name) {
    const { on } = this.view;
    if (!on.delete(name)) on.add(name);
    if (name === "spheres") this.view.showSpheres();
    if (name === "slope" && on.has(name)) this.say("slope: green is level, yellow 15 degrees, red 30 and more");
    this.mark();
    this.stale = true;
  }

  setDark(dark) {
    document.documentElement.classList.toggle("dark", dark);
    this.view.dark = dark;
    if (this.scene) this.view.setDark(dark);
    this.stale = true;
  }

  // Whether a key was one of the picture's.
  key(event) {
    const number = Number(event.key);
    if (number >= 1 && number <= this.eye.presets().length) this.choose(this.eye.presets()[number - 1]);
    else if (event.key.toLowerCase() === "n") this.setDark(!this.view.dark);
    else if (event.key === "?") this.help();
    else {
      const offer = this.view.overlays?.offers().find(([, key]) => key === event.key.toLowerCase());
      if (!offer) return false;
      if (offer[2]) this.say(`${offer[0]}: ${offer[2]}`);
      else this.toggle(offer[0]);
    }
    return true;
  }

  // Draws a moment: two frames and what lies between them. `elapsed` s since the last picture, null after a leap.
  draw(moment, elapsed) {
    const begin = performance.now();
    this.view.show(moment);
    const middle = this.eye.place(this.leap ? null : elapsed);
    this.leap = false;
    this.view.render(middle, this.view.software ? 1 : Math.min(2, window.devicePixelRatio || 1));
    this.stale = false;
    this.spent.push(performance.now() - begin);
    if (this.spent.length > 120) this.spent.shift();
    this.canvas.dataset.script = this.spent.slice().sort((a, b) => a - b)[this.spent.length >> 1].toFixed(2);
    const { geometries, textures } = this.view.renderer.info.memory;
    this.canvas.dataset.held = geometries + textures;
    this.canvas.dataset.distance = this.eye.distance.toFixed(3);
    this.canvas.dataset.drawn = Number(this.canvas.dataset.drawn || 0) + 1;
  }

  // Tells something for a while.
  say(text, seconds = 4) {
    const message = part("message");
    message.textContent = text;
    message.hidden = text === "";
    clearTimeout(this.fading);
    if (text && seconds) this.fading = setTimeout(() => (message.hidden = true), 1000 * seconds);
  }
}

// What a recorded and a live page have in common: the picture, its camera and overlays, their buttons and keys.
"use strict";

const part = (name) => document.getElementById(name);

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
    part("help").addEventListener("click", () => part("keys").toggleAttribute("hidden"));
    this.setDark(matchMedia("(prefers-color-scheme: dark)").matches);
  }

  // Shows a scene; `keep` leaves the camera as it is.
  setScene(scene, keep = false) {
    this.scene = scene;
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
    button.title = reason || `key ${key}`;
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
    else if (event.key === "n") this.setDark(!this.view.dark);
    else if (event.key === "?") part("keys").toggleAttribute("hidden");
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

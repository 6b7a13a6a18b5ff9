// The camera: it turns about a target that follows what moves, and stands where a preset says.
"use strict";

const PRESETS = ["orbit", "chase", "top", "wheel", "mast"];
const TURN_TIME = 0.5; // s, with which a chasing camera comes round

class Eye {
  constructor(view, canvas, moved) {
    this.view = view;
    this.canvas = canvas;
    this.moved = moved; // called when the picture must be drawn anew
    this.preset = "orbit";
    this.wheel = 0;
    this.yaw = 0;
    this.listen();
  }

  // Begins with the view of a scene; another world of the same drive keeps the view.
  start(scene, keep = false) {
    this.first = scene.view;
    const { eye, target } = scene.view;
    const arm = eye.map((value, i) => value - target[i]);
    this.home = { distance: Math.hypot(...arm), azimuth: Math.atan2(arm[0], arm[2]) };
    this.home.elevation = Math.asin(arm[1] / this.home.distance);
    if (!keep) this.choose(this.preset);
  }

  presets() {
    return this.view.scene.rover ? PRESETS : this.view.scene.flat ? ["orbit"] : ["orbit", "top"];
  }

  choose(preset) {
    if (!this.presets().includes(preset)) return;
    if (preset === "wheel" && this.preset === "wheel") this.wheel = (this.wheel + 1) % this.view.scene.wheels.length;
    this.preset = preset;
    this.aside = new THREE.Vector3();
    const { reach } = this.view.scene;
    const poses = {
      orbit: this.home,
      chase: { distance: 3.7 * reach, azimuth: 0, elevation: 0.36 },
      top: { distance: 6 * reach + (this.view.scene.rover ? 0 : this.home.distance), azimuth: 0, elevation: 1.55 },
      wheel: { distance: 1.1 * reach, azimuth: 0, elevation: 0.14 },
      mast: { distance: 1, azimuth: 0, elevation: 0.24 },
    };
    Object.assign(this, poses[preset]);
    this.moved();
  }

  // Heading of the first solid, and where each preset looks.
  heading() {
    const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(this.view.frames[0].quaternion);
    return Math.atan2(-ahead.z, ahead.x);
  }

  // Places the camera; `elapsed` s since the last picture, null after a leap. Returns where it looks.
  place(elapsed) {
    const { view } = this;
    const { camera, scene } = view;
    const turns = scene.rover && this.preset !== "orbit" && this.preset !== "top";
    if (turns) {
      const gap = Math.atan2(Math.sin(this.heading() - this.yaw), Math.cos(this.heading() - this.yaw));
      const share = this.preset === "mast" || elapsed === null ? 1 : 1 - Math.exp(-elapsed / TURN_TIME);
      this.yaw += share * gap;
    }
    camera.up.set(0, 1, 0);
    camera.fov = (180 / Math.PI) * (this.preset === "mast" ? 1.1 : this.first.angle);
    camera.near = Math.max(1e-3, this.preset === "orbit" ? 0.02 * this.distance : 0.02 * scene.reach);
    camera.far = scene.far;
    if (this.preset === "mast") return this.placeOnMast();
    const target = this.target().add(this.aside);
    const round = this.azimuth + (turns ? this.yaw - Math.PI / 2 + (this.preset === "wheel" ? this.sideOf() : 0) : 0);
    const [c, s] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    const away = new THREE.Vector3(c * Math.sin(round), s, c * Math.cos(round));
    camera.position.copy(target).addScaledVector(away, this.distance);
    if (view.scene.floor !== undefined && view.scene.rover) camera.position.y = Math.max(camera.position.y, scene.floor);
    camera.lookAt(target);
    return target;
  }

  target() {
    const { view } = this;
    if (this.preset === "wheel") return view.frames[view.scene.wheels[this.wheel].frame].position.clone();
    if (this.preset === "chase") return view.centre.clone().addScaledVector(new THREE.Vector3(0, 1, 0), 0.4 * view.scene.reach);
    return new THREE.Vector3(...this.first.target).add(view.centre);
  }

  // From which side a wheel is looked at: from outside, a little ahead of it.
  sideOf() {
    const { view } = this;
    const frame = view.frames[view.scene.wheels[this.wheel].frame];
    const beside = view.frames[0].worldToLocal(frame.position.clone()).z;
    return beside > 0 ? 1.9 : -1.9;
  }

  placeOnMast() {
    const { camera, frames, scene } = this.view;
    const trunk = frames[0];
    const way = new THREE.Vector3(Math.cos(this.azimuth), -Math.tan(this.elevation), Math.sin(this.azimuth));
    camera.position.set(0.15 * scene.reach, 0.75 * scene.reach, 0).applyQuaternion(trunk.quaternion).add(trunk.position);
    const target = camera.position.clone().addScaledVector(way.applyQuaternion(trunk.quaternion), scene.reach);
    camera.up.applyQuaternion(trunk.quaternion);
    camera.lookAt(target);
    return trunk.position.clone();
  }

  orbit(dx, dy) {
    this.azimuth += this.preset === "mast" ? 0.004 * dx : -0.006 * dx;
    this.elevation = Math.min(1.55, Math.max(this.preset === "mast" ? -1 : -1.55, this.elevation + 0.006 * dy));
  }

  pan(dx, dy) {
    const { camera } = this.view;
    const scale = (2 * this.distance * Math.tan(this.first.angle / 2)) / this.canvas.clientHeight;
    const [x, y] = [0, 1].map((column) => new THREE.Vector3().setFromMatrixColumn(camera.matrix, column));
    this.aside.addScaledVector(x, -scale * dx).addScaledVector(y, scale * dy);
  }

  zoom(factor) {
    this.distance = Math.min(1e4, Math.max(0.05 * this.view.scene.reach, this.distance * factor));
  }

  listen() {
    const { canvas } = this;
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
        this.zoom(span(before) / Math.max(1, span(event)));
        this.pan(dx / 2, dy / 2);
      } else if (event.buttons & 2 || event.shiftKey) this.pan(dx, dy);
      else this.orbit(dx, dy);
      pointers.set(event.pointerId, event);
      this.moved();
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(0.0012 * event.deltaY * (event.deltaMode ? 30 : 1)));
      this.moved();
    }, { passive: false });
  }
}

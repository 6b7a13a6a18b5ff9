// What is drawn over a scene: tyre marks and wheel trails, contact forces, chains of force, loads as colours.
"use strict";

const ARROW = 0.45; // m, for a wheel's mean share of the weight
const LONGEST = 3; // of an arrow, in such shares

// Bands on the ground behind the wheels, one for each; a point that is unknown interrupts its band.
class Bands {
  constructor(view, capacity) {
    const { wheels } = view.scene;
    this.capacity = capacity;
    this.counts = wheels.map(() => 0);
    this.last = wheels.map(() => null);
    this.materials = wheels.map(() => new THREE.MeshBasicMaterial({
      color: TYRE_MARK, transparent: true, opacity: 0.3, depthWrite: false, side: THREE.DoubleSide,
      polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -4,
    }));
    this.meshes = wheels.map(({ width }, i) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(18 * capacity), 3));
      const mesh = new THREE.Mesh(geometry, this.materials[i]);
      mesh.frustumCulled = false;
      mesh.userData.half = 0.5 * width;
      view.world.add(mesh);
      return mesh;
    });
  }

  // Adds the foot of a wheel; returns nothing. Two triangles join it to the last one.
  add(i, x, y, z) {
    const mesh = this.meshes[i];
    const at = mesh.geometry.attributes.position;
    if (this.counts[i] === this.capacity) { // the older half is forgotten
      const kept = Math.floor(this.capacity / 2);
      at.array.copyWithin(0, 18 * (this.capacity - kept));
      this.counts[i] = kept;
    }
    const quad = at.array.subarray(18 * this.counts[i], 18 * this.counts[i] + 18).fill(0);
    this.counts[i] += 1;
    at.needsUpdate = true;
    const last = this.last[i];
    if (!Number.isFinite(y)) {
      this.last[i] = null;
      return;
    }
    const [dx, dz] = last ? [x - last.x, z - last.z] : [0, 0];
    const length = Math.hypot(dx, dz);
    if (last && length < 0.005) return;
    const { half } = mesh.userData;
    const side = length > 0 ? [(-half * dz) / length, (half * dx) / length] : [0, 0];
    if (last && length < 1) {
      const [a, b] = last.side ?? side;
      const [c, d] = side;
      const [p, q] = [[last.x + a, last.y, last.z + b], [last.x - a, last.y, last.z - b]];
      const [r, s] = [[x + c, y, z + d], [x - c, y, z - d]];
      quad.set([...p, ...q, ...r, ...r, ...q, ...s]);
    }
    this.last[i] = { x, y, z, side: last && length < 1 ? side : null };
  }

  // Shows the first `n` points of each band, or all; in the wheels' colours or as marks.
  draw(n, coloured, visible, wheels) {
    this.meshes.forEach((mesh, i) => {
      mesh.visible = visible;
      mesh.geometry.setDrawRange(0, 6 * Math.min(n, this.counts[i]));
      this.materials[i].color.set(coloured ? wheels[i].colour : TYRE_MARK);
      this.materials[i].opacity = coloured ? 0.85 : 0.3;
    });
  }
}

// Arrows in instances: a shaft and a head.
class Arrows {
  constructor(view, count, colour) {
    const material = new THREE.MeshBasicMaterial({ color: colour, fog: false, depthTest: false, transparent: true });
    const shaft = new THREE.CylinderGeometry(0.012, 0.012, 1, 8).translate(0, 0.5, 0);
    const head = new THREE.ConeGeometry(0.035, 1, 12).translate(0, 0.5, 0);
    this.parts = [shaft, head].map((geometry) => {
      const mesh = new THREE.InstancedMesh(geometry, material, Math.max(1, count));
      mesh.frustumCulled = false;
      mesh.renderOrder = 5;
      view.world.add(mesh);
      return mesh;
    });
    this.tools = [new THREE.Matrix4(), new THREE.Quaternion(), new THREE.Vector3(), new THREE.Vector3()];
    this.up = new THREE.Vector3(0, 1, 0);
  }

  // Arrows (foot, vector) in m, thick in proportion to `size`.
  draw(arrows, size) {
    const [matrix, turn, place, scale] = this.tools;
    const way = new THREE.Vector3();
    this.parts.forEach((mesh, part) => {
      let shown = 0;
      for (const { foot, vector } of arrows) {
        const length = Math.min(vector.length(), LONGEST * ARROW * size);
        if (length < 0.02 * size) continue;
        way.copy(vector).normalize();
        turn.setFromUnitVectors(this.up, way);
        const head = Math.min(0.12 * size, 0.4 * length);
        place.copy(foot).addScaledVector(way, part === 0 ? 0 : length - head);
        scale.set(size, part === 0 ? length - head : head, size);
        mesh.setMatrixAt(shown++, matrix.compose(place, turn, scale));
      }
      mesh.count = shown;
      mesh.visible = shown > 0;
      mesh.instanceMatrix.needsUpdate = true;
    });
  }
}

// The strongest contacts of disks as bars before the disks, wider where the force is larger.
class Chains {
  constructor(view, channel) {
    this.shown = null;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(18 * channel.count), 3));
    this.mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: colourOf(view.scene.chain), side: THREE.DoubleSide, fog: false }));
    this.mesh.frustumCulled = false;
    view.world.add(this.mesh);
  }

  show(_, chains) {
    if (this.shown === chains) return;
    this.shown = chains;
    const at = this.mesh.geometry.attributes.position;
    const { count } = chains.channel;
    for (let i = 0; i < count; i++) {
      const [x, y, u, v, wide] = [0, 1, 2, 3, 4].map((c) => chains.value(i, c));
      const length = Math.hypot(u - x, v - y) || 1;
      const [a, b] = [(-0.5 * wide * (v - y)) / length, (0.5 * wide * (u - x)) / length];
      const z = 0.004;
      at.array.set([x + a, y + b, z, x - a, y - b, z, u + a, v + b, z, u + a, v + b, z, x - a, y - b, z, u - a, v - b, z], 18 * i);
    }
    at.needsUpdate = true;
  }
}

// The strongest contacts among balls as bars in front of them: three-sided, wider where the force is larger.
class Beams {
  static SIDES = 3;

  constructor(view, channel) {
    this.shown = null;
    const corners = 2 * Beams.SIDES;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * corners * channel.count), 3));
    const faces = [0, 1, 2].flatMap((k) => [k, k + 3, (k + 1) % 3, (k + 1) % 3, k + 3, (k + 1) % 3 + 3]);
    geometry.setIndex(Array.from({ length: channel.count }, (_, i) => faces.map((corner) => corners * i + corner)).flat());
    const paint = { color: colourOf(view.scene.chain), side: THREE.DoubleSide, fog: false, depthTest: false, transparent: true };
    this.mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(paint));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 4;
    view.world.add(this.mesh);
  }

  show(visible, chains) {
    this.mesh.visible = visible;
    if (!visible || this.shown === chains) return;
    this.shown = chains;
    const at = this.mesh.geometry.attributes.position;
    const [from, to, way, side, up] = Array.from({ length: 5 }, () => new THREE.Vector3());
    let k = 0;
    for (let i = 0; i < chains.channel.count; i++) {
      from.set(...[0, 1, 2].map((c) => chains.value(i, c)));
      to.set(...[3, 4, 5].map((c) => chains.value(i, c)));
      way.subVectors(to, from).normalize();
      side.set(1, 0, 0).cross(way);
      if (side.lengthSq() < 0.1) side.set(0, 0, 1).cross(way);
      up.crossVectors(way, side.normalize());
      const half = 0.5 * chains.value(i, 6);
      for (const end of [from, to]) {
        for (let turn = 0; turn < Beams.SIDES; turn++, k += 3) {
          const angle = (2 * Math.PI * turn) / Beams.SIDES;
          const [c, s] = [half * Math.cos(angle), half * Math.sin(angle)];
          at.array.set([end.x + c * side.x + s * up.x, end.y + c * side.y + s * up.y, end.z + c * side.z + s * up.z], k);
        }
      }
    }
    at.needsUpdate = true;
  }
}

class Overlays {
  constructor(view) {
    this.view = view;
    const { scene } = view;
    const channel = (name) => scene.channels.find((one) => one.name === name);
    const { trail } = scene.arrays;
    const n = scene.wheels.length;
    this.live = !trail;
    this.bands = n && scene.rover ? new Bands(view, trail ? trail.length / (3 * n) : 4000) : null;
    for (let k = 0; trail && this.bands && k < trail.length / (3 * n); k++) {
      for (let i = 0; i < n; i++) this.bands.add(i, ...trail.subarray(3 * (k * n + i), 3 * (k * n + i) + 3));
    }
    this.arrows = channel("forces") ? new Arrows(view, n, colourOf(scene.force)) : null;
    this.chains = channel("chains") ? new (view.balls ? Beams : Chains)(view, channel("chains")) : null;
    this.markers = new Markers(view);
    this.tyres = scene.wheels.map(({ frame }) => (frame === undefined ? [] : view.frames[frame].children));
  }

  // What may be switched here: name, key, and why there is nothing to show, which is "" where there is something. A scene
  // without a rover names only what it has.
  offers() {
    const { scene, rocks } = this.view;
    const { balls } = this.view;
    const all = [["marks", "m", this.bands && !balls], ["trails", "v", this.bands], ["forces", "f", this.arrows || (balls && this.chains)],
      ...this.markers.offers(),
      ["loads", "l", this.arrows], ["slope", "h", scene.rover && !balls], ["spheres", "k", rocks.children.length]];
    const reason = (name) => scene.missing?.[name] ?? (name === "spheres" ? "there are no rocks" : "not recorded in this run");
    return all.filter(([, , there]) => there || scene.rover).map(([name, key, there]) => [name, key, there ? "" : reason(name)]);
  }

  show({ before, after, share, k }) {
    const { on, scene } = this.view;
    const marked = on.has("marks") && !scene.ruts && !this.view.balls;
    this.bands?.draw(this.live ? Infinity : k + 1, on.has("trails"), on.has("trails") || marked, scene.wheels);
    this.chains?.show(on.has("forces"), before.chains);
    if (!this.arrows) this.markers.show({ before, after, share }, []);
    if (!this.arrows) return;
    const value = (i, c) => before.forces.value(i, c, after.forces, share);
    const forces = scene.wheels.map((_, i) => ({
      foot: new THREE.Vector3(value(i, 0), value(i, 1), value(i, 2)),
      vector: new THREE.Vector3(value(i, 3), value(i, 4), value(i, 5)),
    }));
    const axis = (i, c) => before.normals?.value(i, c, after.normals, share) ?? (c === 1 ? 1 : 0);
    const contacts = forces.map(({ foot, vector }, i) =>
      ({ foot, force: vector.clone(), normal: new THREE.Vector3(axis(i, 0), axis(i, 1), axis(i, 2)).normalize() }));
    this.markers.show({ before, after, share }, contacts);
    this.tyres.forEach((meshes, i) => this.colour(meshes, on.has("loads") ? 0.5 * forces[i].vector.length() : null));
    const size = scene.arrow ?? scene.reach;
    for (const { vector } of forces) vector.multiplyScalar(ARROW * size);
    this.arrows.draw(on.has("forces") ? forces : [], size);
  }

  // Colours a wheel by its load in mean shares, from blue at none over yellow to red at 2; null takes the colour away.
  colour(meshes, load) {
    const [cold, warm, hot] = [[0.1, 0.3, 0.8], [0.95, 0.8, 0.2], [0.9, 0.1, 0.1]];
    const t = 2 * Math.min(1, load ?? 0);
    const heat = [0, 1, 2].map((c) => (t < 1 ? (1 - t) * cold[c] + t * warm[c] : (2 - t) * warm[c] + (t - 1) * hot[c]));
    for (const { material } of meshes) {
      material.emissive.setRGB(...(load === null ? [0, 0, 0] : heat.map((value) => 0.75 * value)));
      material.color.setScalar(load === null ? 1 : 0.25);
    }
  }
}

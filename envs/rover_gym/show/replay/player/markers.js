// Overlays of what a rover sees and intends: friction cones, mass centre over its support, planned path, height scan,
// laser and depth camera.
"use strict";

const PLAN_COLOURS = { arcs: 0xffffff, path: 0x39ff88 };
const SIGHT_COLOURS = { scan: 0xf5d442, laser: 0xff4d3d, depth: 0x35d0ba };
const SMALLEST = 0.0028; // half an edge of a dot, of its distance from the eye: what is farther away stays visible
const DOTS = { scan: 0.014, laser: 0.024, depth: 0.015 }; // half an edge, of the rover's reach
const BEARS = 0.01; // of a wheel's mean share: a wheel with less stands on nothing
const SLIDES = 0.97; // of the cone's edge

// Points as small tetrahedra in one surface: without a graphics card, an instance costs as much as a drawing of its own.
class Dots {
  static CORNERS = [[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]];
  static FACES = [0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2];

  constructor(view, count, name) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(12 * count), 3));
    const corners = new Uint32Array(12 * count);
    for (let i = 0; i < count; i++) corners.set(Dots.FACES.map((k) => 4 * i + k), 12 * i);
    geometry.setIndex(new THREE.BufferAttribute(corners, 1));
    this.size = DOTS[name] * view.scene.reach;
    this.eye = view.camera.position;
    this.mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: SIGHT_COLOURS[name], side: THREE.DoubleSide, fog: false }));
    this.mesh.frustumCulled = false;
    view.world.add(this.mesh);
    this.places = new Float32Array(3 * count);
  }

  // Shows the points that `put` writes, (x, y, z) each; it returns their number.
  draw(visible, put) {
    this.mesh.visible = visible;
    if (!visible) return;
    const { places, size, eye } = this;
    const { position } = this.mesh.geometry.attributes;
    const n = put(places);
    for (let i = 0, at = 0; i < n; i++) {
      const [x, y, z] = [places[3 * i], places[3 * i + 1], places[3 * i + 2]];
      const half = Math.max(size, SMALLEST * Math.hypot(x - eye.x, y - eye.y, z - eye.z));
      for (const [a, b, c] of Dots.CORNERS) {
        position.array[at++] = x + half * a;
        position.array[at++] = y + half * b;
        position.array[at++] = z + half * c;
      }
    }
    this.mesh.geometry.setDrawRange(0, 12 * n);
    position.needsUpdate = true;
  }
}

// Writes a ribbon along points [x, y, z] into an array of triangles, from index `at` on; returns where it ends.
const ribbon = (points, half, places, at) => {
  for (let k = 0; k + 1 < points.length; k++) {
    const [[x, y, z], [u, v, w]] = [points[k], points[k + 1]];
    const length = Math.hypot(u - x, w - z);
    if (!(length > 1e-4)) continue;
    const [a, b] = [(-half * (w - z)) / length, (half * (u - x)) / length];
    for (const value of [x + a, y, z + b, x - a, y, z - b, u + a, v, w + b, u + a, v, w + b, x - a, y, z - b, u - a, v, w - b])
      places[at++] = value;
  }
  return at;
};

// The path that the driver follows, and the arcs that it chose from, on the ground's heights.
class Plan {
  constructor(view) {
    this.scene = view.scene;
    const add = (ribbons, points, color, opacity) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(18 * ribbons * (points - 1)), 3));
      const paint = { color, opacity, transparent: true, depthTest: false, side: THREE.DoubleSide, fog: false };
      const mesh = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(paint));
      mesh.frustumCulled = false;
      mesh.renderOrder = 4;
      view.world.add(mesh);
      return mesh;
    };
    const { arcs } = this.scene.arrays;
    const count = (name) => this.scene.channels.find((one) => one.name === name)?.count;
    this.arcs = arcs && count("arc-heights") ? add(arcs.length / (2 * this.scene.arcs), this.scene.arcs, PLAN_COLOURS.arcs, 0.35) : null;
    this.path = add(1, count("path"), PLAN_COLOURS.path, 0.9);
  }

  // `at` turns ahead and right into x and z.
  show(visible, frame, at) {
    const { reach, arcs: n, arrays: { arcs } } = this.scene;
    const lift = 0.02 * reach;
    const draw = (mesh, ribbons, half) => {
      if (!mesh) return;
      mesh.visible = visible;
      if (!visible) return;
      const { position } = mesh.geometry.attributes;
      mesh.geometry.setDrawRange(0, ribbons.reduce((end, points) => ribbon(points, half, position.array, end), 0) / 3);
      position.needsUpdate = true;
    };
    const point = (ahead, right, height) => {
      const [x, z] = at(ahead, right);
      return [x, height + lift, z];
    };
    const path = frame.path.value(0, 0) < -9e4 ? [] // nothing is planned yet
      : Array.from({ length: frame.path.channel.count }, (_, i) => point(...[0, 1, 2].map((c) => frame.path.value(i, c))));
    draw(this.path, [path], 0.035 * reach);
    const heights = frame["arc-heights"];
    if (visible && this.arcs) {
      const all = Array.from({ length: heights.channel.count }, (_, i) => point(arcs[2 * i], arcs[2 * i + 1], heights.value(i, 0)));
      draw(this.arcs, Array.from({ length: all.length / n }, (_, i) => all.slice(n * i, n * (i + 1))), 0.008 * reach);
    } else draw(this.arcs, [], 0);
  }
}

// Cones of the forces that friction allows, one at the foot of each wheel that bears something: orange where it slides.
// They are drawn by their edges and a faint surface, which hides nothing behind them.
class Cones {
  constructor(view, count) {
    const paint = { transparent: true, side: THREE.DoubleSide, depthWrite: false, fog: false };
    this.meshes = [[24, { opacity: 0.1 }], [12, { opacity: 0.75, wireframe: true, depthTest: false }]].map(([sides, more], i) => {
      const cone = new THREE.ConeGeometry(1, 1, sides, 1, true).rotateX(Math.PI).translate(0, 0.5, 0);
      const mesh = new THREE.InstancedMesh(cone, new THREE.MeshBasicMaterial({ ...paint, ...more }), count);
      mesh.setColorAt(0, new THREE.Color());
      mesh.frustumCulled = false;
      mesh.renderOrder = 3 + i;
      view.world.add(mesh);
      return mesh;
    });
  }

  show(visible, contacts, friction, scale) {
    let shown = 0;
    const [matrix, turn, colour] = [new THREE.Matrix4(), new THREE.Quaternion(), new THREE.Color()];
    const up = new THREE.Vector3(0, 1, 0);
    for (const { foot, force, normal } of visible ? contacts : []) {
      const load = force.dot(normal);
      if (load < BEARS) continue;
      const along = Math.sqrt(Math.max(0, force.lengthSq() - load * load));
      const height = Math.min(load, LONGEST) * scale;
      turn.setFromUnitVectors(up, normal);
      matrix.compose(foot, turn, new THREE.Vector3(friction * height, height, friction * height));
      colour.set(along > SLIDES * friction * load ? 0xff8c1a : 0x3d7bff);
      for (const mesh of this.meshes) {
        mesh.setMatrixAt(shown, matrix);
        mesh.setColorAt(shown, colour);
      }
      shown++;
    }
    for (const mesh of this.meshes) {
      mesh.count = shown;
      mesh.visible = shown > 0;
      mesh.instanceMatrix.needsUpdate = mesh.instanceColor.needsUpdate = true;
    }
  }
}

// Corners of the convex hull of points, by their x and z.
const hull = (points) => {
  const sorted = [...points].sort((a, b) => a.x - b.x || a.z - b.z);
  const half = (list) => {
    const kept = [];
    for (const p of list) {
      for (let n = kept.length; n > 1; n = kept.length) {
        const [a, b] = [kept[n - 2], kept[n - 1]];
        if ((b.x - a.x) * (p.z - a.z) - (b.z - a.z) * (p.x - a.x) > 0) break;
        kept.pop();
      }
      kept.push(p);
    }
    return kept.slice(0, -1);
  };
  return sorted.length < 3 ? sorted : [...half(sorted), ...half(sorted.reverse())];
};

// Whether a place lies inside a hull, by x and z.
const isInside = (corners, { x, z }) => corners.length > 2 && corners.every((a, i) => {
  const b = corners[(i + 1) % corners.length];
  return (b.x - a.x) * (z - a.z) - (b.z - a.z) * (x - a.x) >= 0;
});

// The mass centre, the plumb line below it, and the polygon of the wheels that bear: blue while it holds the line.
class MassCentre {
  constructor(view) {
    const material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, fog: false });
    const bar = new THREE.CylinderGeometry(1, 1, 1, 6).translate(0, 0.5, 0);
    this.bars = new THREE.InstancedMesh(bar, material, MassCentre.MOST);
    this.ball = new THREE.Mesh(ball(2), material);
    this.foot = new THREE.Mesh(ball(1), material);
    this.nodes = [this.bars, this.ball, this.foot];
    for (const node of this.nodes) {
      node.frustumCulled = false;
      node.renderOrder = 6;
      view.world.add(node);
    }
  }

  static MOST = 32; // edges of the polygon, with the plumb line

  show(visible, place, feet, reach) {
    for (const node of this.nodes) node.visible = visible;
    if (!visible) return;
    const corners = hull(feet).slice(0, MassCentre.MOST - 1);
    const level = feet.length ? feet.reduce((sum, { y }) => sum + y, 0) / feet.length : place.y - 0.5 * reach;
    const below = new THREE.Vector3(place.x, level, place.z);
    const edges = corners.map((corner, i) => [corner, corners[(i + 1) % corners.length]]);
    const [matrix, turn, up] = [new THREE.Matrix4(), new THREE.Quaternion(), new THREE.Vector3(0, 1, 0)];
    [[below, place], ...edges].forEach(([from, to], i) => {
      const way = to.clone().sub(from);
      const length = Math.max(1e-6, way.length());
      turn.setFromUnitVectors(up, way.divideScalar(length));
      const thick = 0.006 * reach;
      this.bars.setMatrixAt(i, matrix.compose(from, turn, new THREE.Vector3(thick, length, thick)));
    });
    this.bars.count = edges.length + 1;
    this.bars.instanceMatrix.needsUpdate = true;
    this.ball.position.copy(place);
    this.ball.scale.setScalar(0.045 * reach);
    this.foot.position.copy(below);
    this.foot.scale.setScalar(0.025 * reach);
    this.ball.material.color.set(!corners.length || isInside(corners, below) ? 0x3d7bff : 0xff8c1a);
  }
}

// All of them, as far as a scene holds what they show.
class Markers {
  constructor(view) {
    this.view = view;
    const { scene } = view;
    const channel = (name) => scene.channels.find((one) => one.name === name);
    this.cones = channel("normals") && (channel("friction") || scene.friction !== undefined) ? new Cones(view, Math.max(1, scene.wheels.length)) : null;
    this.mass = channel("mass") ? new MassCentre(view) : null;
    this.plan = channel("path") ? new Plan(view) : null;
    this.dots = Object.fromEntries(["scan", "laser", "depth"].filter(channel).map((name) => [name, new Dots(view, channel(name).count, name)]));
  }

  // Name, key, and whether it can be shown.
  offers() {
    return [["cones", "c", this.cones], ["mass", "g", this.mass], ["plan", "p", this.plan], ["scan", "x", this.dots.scan],
      ["laser", "z", this.dots.laser], ["depth", "b", this.dots.depth]];
  }

  // `contacts`: foot, force in mean shares and normal of each wheel.
  show({ before, after, share }, contacts) {
    const { on, scene, frames } = this.view;
    const { reach } = scene;
    const friction = before.friction?.value(0, 0) ?? scene.friction; // a live drive may change it
    this.cones?.show(on.has("cones"), contacts, friction, ARROW * (scene.arrow ?? reach));
    const trunk = frames[0];
    const feet = contacts.filter(({ force }) => force.length() > BEARS).map(({ foot }) => foot);
    if (this.mass) {
      const place = new THREE.Vector3(...[0, 1, 2].map((c) => before.mass.value(0, c, after.mass, share)));
      this.mass.show(on.has("mass"), place, feet, reach);
    }
    if (!scene.rover) return;
    const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(trunk.quaternion);
    const [c, s] = [ahead.x, -ahead.z].map((part) => part / (Math.hypot(ahead.x, ahead.z) || 1)); // of the heading
    const at = (x, z) => [trunk.position.x + c * x + s * z, trunk.position.z - s * x + c * z];
    this.plan?.show(on.has("plan"), before, at);
    this.showScan(before, after, share, at);
    for (const name of ["laser", "depth"]) this.showRays(name, before[name], trunk);
  }

  // `at` turns ahead and right into x and z.
  showScan(before, after, share, at) {
    const { "scan-grid": grid } = this.view.scene.arrays;
    this.dots.scan?.draw(this.view.on.has("scan"), (places) => {
      let n = 0;
      for (let i = 0; 2 * i < grid.length; i++) {
        const y = before.scan.value(i, 0);
        if (y < -9e4) continue;
        const [x, z] = at(grid[2 * i], grid[2 * i + 1]);
        const level = after.scan.value(i, 0) < -9e4 ? y : before.scan.value(i, 0, after.scan, share);
        places.set([x, level + 0.01, z], 3 * n++);
      }
      return n;
    });
  }

  showRays(name, reading, trunk) {
    this.dots[name]?.draw(this.view.on.has(name), (places) => {
      const { origin, range } = this.view.scene[name];
      const rays = this.view.scene.arrays[`${name}-rays`];
      const place = new THREE.Vector3();
      let n = 0;
      for (let i = 0; 3 * i < rays.length; i++) {
        const far = reading.value(i, 0);
        if (far < 1e-3 || far > range - 2e-3) continue; // lost, or nothing in reach
        place.set(...[0, 1, 2].map((k) => origin[k] + far * rays[3 * i + k])).applyQuaternion(trunk.quaternion).add(trunk.position);
        place.toArray(places, 3 * n++);
      }
      return n;
    });
  }
}

// Draws a scene with three.js [https://threejs.org]: ground, rocks, what moves, balls, disks and overlays.
"use strict";

const SUN = new THREE.Vector3(-0.348, 0.795, 0.497); // towards it, in the world
const NIGHT = { overhead: 0x10141c, horizon: 0x2a2c33 };
const ROCK_KINDS = 3;
const ROCK_CELL = 6; // m, edge of the squares whose rocks are drawn together
const ROCK_DETAIL = [[0.06, 0], [0.2, 1], [Infinity, 2]]; // radius, m, and detail
const TYRE_MARK = 0x3a2116;

THREE.ColorManagement.enabled = false; // colours are drawn as they are written

// Numbers from 0 to 1 that look random and are the same on every page.
const scatter = (n) => {
  const x = Math.sin(12.9898 * n + 78.233) * 43758.5453;
  return x - Math.floor(x);
};

// Smooth noise of a direction, -1 to 1.
const bumps = (x, y, z, seed) =>
  0.5 * Math.sin(2.3 * x + 1.7 * y + seed) * Math.cos(1.9 * y - 2.1 * z + 2 * seed) +
  0.3 * Math.sin(4.1 * z + 3.3 * x + 3 * seed) + 0.2 * Math.sin(6.7 * y - 5.2 * x + 5 * seed);

// The unit sphere with shared corners: facets get their normals as they are drawn.
const ball = (detail) => {
  const loose = new THREE.IcosahedronGeometry(1, detail).attributes.position;
  const [numbers, places, corners] = [new Map(), [], []];
  for (let i = 0; i < loose.count; i++) {
    const place = [loose.getX(i), loose.getY(i), loose.getZ(i)];
    const key = place.map((value) => value.toFixed(4)).join();
    if (!numbers.has(key)) {
      numbers.set(key, numbers.size);
      places.push(...place);
    }
    corners.push(numbers.get(key));
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  geometry.setIndex(corners);
  return geometry;
};

// A stone about the unit sphere: the simulated sphere, with facets and dents.
const stone = (detail, seed) => {
  const geometry = ball(detail);
  const at = geometry.attributes.position;
  for (let i = 0; i < at.count; i++) {
    const [x, y, z] = [at.getX(i), at.getY(i), at.getZ(i)];
    const r = 0.98 + 0.1 * bumps(x, y, z, seed);
    at.setXYZ(i, r * x, r * y, r * z);
  }
  return geometry;
};

// Soil: fine and coarse grain, and large patches, as a texture that repeats.
const soilTexture = () => {
  const size = 128;
  const data = new Uint8Array(4 * size * size);
  const lattice = (x, y, n, seed) => scatter(((x + n) % n) + 57 * ((y + n) % n) + 131 * seed);
  const smooth = (u, v, n, seed) => {
    const [x, y] = [u * n, v * n];
    const [i, j] = [Math.floor(x), Math.floor(y)];
    const ease = (t) => t * t * (3 - 2 * t);
    const [a, b] = [ease(x - i), ease(y - j)];
    const row = (k) => (1 - a) * lattice(i, k, n, seed) + a * lattice(i + 1, k, n, seed);
    return (1 - b) * row(j) + b * row(j + 1);
  };
  for (let k = 0; k < size * size; k++) {
    const [u, v] = [(k % size) / size, Math.floor(k / size) / size];
    const value = 0.3 * smooth(u, v, 4, 1) + 0.3 * smooth(u, v, 16, 2) + 0.4 * smooth(u, v, 64, 3);
    data.fill(Math.round(255 * value), 4 * k, 4 * k + 4);
  }
  const texture = new THREE.DataTexture(data, size, size);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.magFilter = THREE.LinearFilter;
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.needsUpdate = true;
  return texture;
};

const colourOf = (rgb) => new THREE.Color(...rgb);

class View {
  constructor(canvas) {
    this.canvas = canvas;
    const probe = document.createElement("canvas").getContext("webgl2");
    if (probe === null) throw new Error("this browser has no WebGL 2");
    const info = probe.getExtension("WEBGL_debug_renderer_info");
    const engine = probe.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : probe.RENDERER);
    probe.getExtension("WEBGL_lose_context")?.loseContext();
    this.software = /swiftshader|llvmpipe|software|basic render/i.test(engine);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.software, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = this.software ? THREE.BasicShadowMap : THREE.PCFShadowMap;
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.05, 500);
    this.soil = soilTexture();
    this.shapes = {}; // of rocks
    this.dark = false;
    this.paint = 0;
    this.on = new Set(["marks"]);
    this.slope = { value: 0 }; // of the ground: 1 shows it as colours
  }

  // Shows another scene.
  setScene(scene) {
    this.world?.traverse((node) => node.geometry?.dispose());
    this.scene = scene;
    this.world = new THREE.Scene();
    this.addLight();
    this.addSky();
    this.ruts = scene.ruts ? new Ruts(scene) : null;
    this.frames = Array.from({ length: scene.frames }, () => this.world.add(new THREE.Group()).children.at(-1));
    for (const group of scene.groups) this.addGroup(group);
    for (const map of scene.maps) this.addMap(map);
    if (scene.plane) this.addPlane(scene.plane);
    this.addRocks();
    this.balls = scene.channels.some(({ name }) => name === "balls") ? new Balls(this) : null;
    this.disks = scene.channels.some(({ name }) => name === "disks") ? new Disks(this) : null;
    this.overlays = new Overlays(this);
    this.setDark(this.dark);
  }

  addLight() {
    this.world.add(new THREE.HemisphereLight(new THREE.Color(0.52, 0.53, 0.57), new THREE.Color(0.26, 0.21, 0.18), Math.PI));
    const sun = (this.sun = new THREE.DirectionalLight(new THREE.Color(0.68, 0.64, 0.58), Math.PI));
    const reach = 1.35 * this.scene.reach;
    sun.castShadow = this.scene.shadow;
    sun.shadow.mapSize.set(1024, 1024);
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0, far: 8 * reach });
    sun.shadow.bias = -1e-3;
    sun.shadow.normalBias = 0.02 * reach;
    sun.shadow.radius = 1.5;
    this.world.add(sun, sun.target);
    if (!this.scene.front) return;
    const front = new THREE.DirectionalLight(0xffffff, 0.4 * Math.PI); // runs in the plane turn this way
    front.position.set(0.3, 0.5, 1);
    this.world.add(front);
  }

  addSky() {
    const { bands } = this.scene; // [elevation, share of the colour overhead]
    const dome = new THREE.SphereGeometry(1, 24, bands.length - 1);
    const { position } = dome.attributes;
    this.shares = Float32Array.from({ length: position.count }, (_, i) => {
      const [degrees, share] = bands[bands.length - 1 - Math.floor(i / 25)]; // rows of 25, from the top
      const [elevation, around] = [(Math.PI * degrees) / 180, (2 * Math.PI * (i % 25)) / 24];
      const wide = Math.cos(elevation);
      position.setXYZ(i, -wide * Math.cos(around), Math.sin(elevation), wide * Math.sin(around));
      return share;
    });
    dome.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * position.count), 3));
    const material = new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.BackSide, fog: false, depthWrite: false });
    this.dome = new THREE.Mesh(dome, material);
    this.dome.renderOrder = -1;
    this.dome.frustumCulled = false;
    this.world.add(this.dome);
  }

  setDark(dark) {
    this.dark = dark;
    const { sky, flat } = this.scene;
    const [overhead, horizon] = dark
      ? [new THREE.Color(NIGHT.overhead), new THREE.Color(NIGHT.horizon)]
      : flat ? [new THREE.Color(0xf4f4f4), new THREE.Color(0xf4f4f4)] : [colourOf(sky[0]), colourOf(sky[1])];
    const { color } = this.dome.geometry.attributes;
    const shade = new THREE.Color();
    this.shares.forEach((share, i) => {
      shade.copy(horizon).lerp(overhead, share);
      color.setXYZ(i, shade.r, shade.g, shade.b);
    });
    color.needsUpdate = true;
    const far = this.scene.haze;
    this.world.fog = far ? new THREE.Fog(horizon, 0.3 * far, far) : null;
    this.sky = { overhead, horizon };
  }

  lit(options = {}) {
    return new THREE.MeshLambertMaterial({ flatShading: true, ...options });
  }

  // Soil: two shades of squares, and grain. `weight` darkens what the vertices say.
  ground(options = {}, steep = false) {
    const material = this.lit({ color: colourOf(this.scene.soil[0]), ...options });
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, {
        grain: { value: this.soil },
        other: { value: colourOf(this.scene.soil[1]) },
        tile: { value: this.scene.tile },
        slopes: this.slope,
        ...this.ruts?.uniforms,
      });
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec3 soilPlace;")
        .replace("#include <project_vertex>",
          "#include <project_vertex>\nsoilPlace = (modelMatrix * vec4(transformed, 1.0)).xyz;");
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>",
          "#include <common>\nvarying vec3 soilPlace; uniform sampler2D grain; uniform vec3 other; uniform float tile, slopes;")
        .replace("#include <color_fragment>", `#include <color_fragment>
          vec2 soilAt = soilPlace.xz;
          vec2 edge = abs(fract(0.5 * soilAt / tile + 0.25) - 0.5) * 2.0 - 0.5; // signed, changes at every line
          vec2 wide = max(fwidth(soilAt) / tile, 1e-4);
          vec2 side = clamp(edge / wide, -0.5, 0.5) * 2.0;
          float checks = 0.5 + 0.5 * side.x * side.y;
          ${steep ? "if (abs(normalize(cross(dFdx(soilPlace), dFdy(soilPlace))).y) < 0.7) checks = 1.0;" : ""}
          float fine = texture2D(grain, soilAt * 0.9).r;
          float coarse = texture2D(grain, soilAt * 0.071 + 0.3).r;
          diffuseColor.rgb *= mix(vec3(1.0), other / diffuse, checks);
          diffuseColor.rgb *= 0.72 + 0.3 * fine + 0.26 * coarse;
          ${this.ruts ? RUT_FRAGMENT : ""}
          if (slopes > 0.5) { // 0 to 30 degrees
            float slope = clamp(acos(abs(normalize(cross(dFdx(soilPlace), dFdy(soilPlace))).y)) / 0.5236, 0.0, 1.0);
            vec3 heat = slope < 0.5 ? mix(vec3(0.16, 0.5, 0.3), vec3(0.9, 0.8, 0.2), 2.0 * slope)
              : mix(vec3(0.9, 0.8, 0.2), vec3(0.85, 0.12, 0.1), 2.0 * slope - 1.0);
            diffuseColor.rgb = heat * (0.8 + 0.2 * fine);
          }`);
      if (this.ruts) shader.fragmentShader = RUT_UNIFORMS + shader.fragmentShader;
    };
    return material;
  }

  // A coloured surface on a moving frame, or on the world (frame -1).
  addGroup({ frame, first, count, role }) {
    const { vertices, colours, triangles } = this.scene.arrays;
    const used = triangles.subarray(first, first + count);
    const least = used.reduce((a, b) => Math.min(a, b), Infinity);
    const most = used.reduce((a, b) => Math.max(a, b), 0) + 1;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(vertices.slice(3 * least, 3 * most), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colours.slice(4 * least, 4 * most), 4, true));
    geometry.setIndex(new THREE.BufferAttribute(used.map((corner) => corner - least), 1));
    geometry.computeVertexNormals(); // flat sides share no corners
    const material = role === "soil" ? this.ground({ side: THREE.DoubleSide }, true) : this.lit({ vertexColors: true, flatShading: false });
    if (role === "ghost") Object.assign(material, { transparent: true, opacity: 0.45, depthWrite: false });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.castShadow = role === "solid";
    mesh.receiveShadow = true;
    (frame < 0 ? this.world : this.frames[frame]).add(mesh);
    return mesh;
  }

  // The plane of the ground as one large square about the middle.
  addPlane({ point, normal, half }) {
    const geometry = new THREE.PlaneGeometry(2 * half, 2 * half, 1, 1);
    const mesh = new THREE.Mesh(geometry, this.ground());
    mesh.position.set(...point);
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3(...normal));
    mesh.receiveShadow = true;
    this.world.add(mesh);
  }

  // A height map: columns x, rows z, heights as levels; 65535 is unknown.
  addMap({ x, z, heights, low, step }) {
    const [xs, zs, levels] = [x, z, heights].map((name) => this.scene.arrays[name]);
    const places = new Float32Array(3 * levels.length);
    for (let k = 0; k < levels.length; k++) {
      places.set([xs[k % xs.length], low + step * levels[k], zs[Math.floor(k / xs.length)]], 3 * k);
    }
    const corners = [];
    const known = (...all) => all.every((k) => levels[k] !== 65535);
    for (let j = 0; j + 1 < zs.length; j++) {
      for (let i = 0; i + 1 < xs.length; i++) {
        const a = j * xs.length + i;
        const [b, c, d] = [a + 1, a + xs.length + 1, a + xs.length];
        if (known(a, c, b)) corners.push(a, c, b);
        if (known(a, d, c)) corners.push(a, d, c);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(corners), 1));
    geometry.computeVertexNormals();
    const mesh = new THREE.Mesh(geometry, this.ground({ flatShading: false }));
    mesh.receiveShadow = true;
    this.world.add(mesh);
  }

  // Rocks as stones over the spheres that are simulated, or as these spheres. Those of a square are one surface: without
  // a graphics card, an instance costs as much as a drawing of its own.
  addRocks() {
    const { rocks } = this.scene.arrays;
    this.rocks = new THREE.Group();
    this.world.add(this.rocks);
    const cells = new Map();
    for (let i = 0; 4 * i < (rocks?.length ?? 0); i++) {
      const key = [rocks[4 * i], rocks[4 * i + 2]].map((at) => Math.floor(at / ROCK_CELL)).join();
      if (!cells.has(key)) cells.set(key, []);
      cells.get(key).push(i);
    }
    const material = this.lit({ vertexColors: true });
    for (const numbers of cells.values()) {
      const mesh = new THREE.Mesh(this.rockSurface(numbers), material);
      mesh.castShadow = mesh.receiveShadow = true;
      this.rocks.add(mesh);
    }
  }

  rockSurface(numbers) {
    const { scene: { arrays: { rocks }, rock } } = this;
    const spheres = this.on.has("spheres");
    const turn = new THREE.Quaternion();
    const corner = new THREE.Vector3();
    const [places, colours, corners] = [[], [], []];
    for (const i of numbers) {
      const [x, y, z, r] = rocks.subarray(4 * i, 4 * i + 4);
      const detail = ROCK_DETAIL.find(([most]) => r < most)[1] + (spheres ? 1 : 0);
      const at = 1.7 * x + 0.3 * y + 2.9 * z; // the place alone says which stone lies here: frames of films have the same
      const kind = Math.floor(ROCK_KINDS * scatter(at)) + 1;
      const shape = (this.shapes[`${detail} ${spheres || kind}`] ??= spheres ? ball(detail) : stone(detail, kind));
      turn.set(scatter(at + 0.1) - 0.5, scatter(at + 0.3) - 0.5, scatter(at + 0.5) - 0.5, scatter(at + 0.7) - 0.5).normalize();
      const first = places.length / 3;
      const shade = 255 * (0.82 + 0.3 * scatter(at + 0.9));
      for (let k = 0; k < shape.attributes.position.count; k++) {
        corner.fromBufferAttribute(shape.attributes.position, k).applyQuaternion(turn);
        places.push(x + r * corner.x, y + r * corner.y, z + r * corner.z);
        colours.push(...rock.map((value) => Math.min(255, shade * value)));
      }
      for (const k of shape.index.array) corners.push(first + k);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Uint8Array(colours), 3, true));
    geometry.setIndex(corners);
    return geometry;
  }

  // Shows rocks as the spheres that are simulated, or as stones, as `on` says.
  showSpheres() {
    if (!this.rocks) return;
    this.world.remove(this.rocks);
    for (const mesh of this.rocks.children) mesh.geometry.dispose();
    this.addRocks();
  }

  // Moves everything to where it is between two frames. `k`: number of the first; `rate`: frames a second there.
  show({ before, after, share, rate, k, time }) {
    this.frames.forEach((group, i) => {
      const { places, turns } = before;
      group.position.set(...[0, 1, 2].map((c) => places.value(i, c, after.places, share)));
      const far = [0, 1, 2, 3].reduce((sum, c) => sum + turns.value(i, c) * after.turns.value(i, c), 0) < 0;
      const q = [0, 1, 2, 3].map((c) =>
        far ? (1 - share) * turns.value(i, c) - share * after.turns.value(i, c) : turns.value(i, c, after.turns, share));
      group.quaternion.set(...q).normalize();
    });
    this.centre = new THREE.Vector3(...[0, 1, 2].map((c) => before.centre.value(0, c, after.centre, share)));
    this.balls?.show(before, after, share, rate);
    this.disks?.show(before, after, share);
    this.ruts?.show(k);
    this.overlays.show({ before, after, share, k, time });
  }

  // Draws the picture as the camera stands; `middle` is where it looks.
  render(middle, ratio) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((size) => Math.max(1, size));
    const wanted = `${width} ${height} ${ratio}`;
    if (this.size !== wanted) {
      this.size = wanted;
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    const { camera, sun } = this;
    camera.aspect = width / height;
    const narrow = (this.scene.view.aspect ?? 1) / camera.aspect; // what is wanted beside the middle stays in a narrow picture
    if (narrow > 1) camera.fov = (360 / Math.PI) * Math.atan(narrow * Math.tan((camera.fov * Math.PI) / 360));
    camera.updateProjectionMatrix();
    const about = this.scene.rover ? this.frames[0].position : middle;
    sun.target.position.copy(about);
    sun.position.copy(about).addScaledVector(SUN, 4 * this.scene.reach);
    this.dome.position.copy(camera.position);
    this.dome.scale.setScalar(0.9 * camera.far);
    if (this.balls) this.balls.render();
    else this.renderer.render(this.world, camera);
  }
}

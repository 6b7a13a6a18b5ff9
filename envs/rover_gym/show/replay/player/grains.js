// Balls in space and disks in the plane: squares that the graphics card turns into exact spheres and circles. Their
// places at two frames lie in its memory as 16-bit numbers, and it goes from one to the other.
"use strict";

const HEAD_GLSL = `precision highp float; precision highp int; precision highp sampler2DShadow;
uniform mat4 viewMatrix, projectionMatrix;
`;

// How much of the Sun a place in the world sees: of each point of a ball or, without a graphics card, of the ball.
const BALL_SHADOW = (software) => `
uniform mat4 light; // from the world into the shadow's picture
uniform highp ${software ? "sampler2D" : "sampler2DShadow"} shadow;
float sunlit(vec3 place) {
  vec3 s = (light * vec4(place, 1.0)).xyz - vec3(0.0, 0.0, 2e-3);
  bool outside = any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)));
  return outside ? 1.0 : ${software ? "step(s.z, texture(shadow, s.xy).r)" : "texture(shadow, s)"};
}`;

// A ball is a square that touches its sphere where it is nearest to the eye, so every point of it lies behind.
const BALL_VERTEX = `
in vec3 before, after;
in vec4 ball; // radius, shade, height at the start, 1 for one that no force moves
uniform vec3 low, extent, sand, still;
uniform float share, rate;
uniform int paint;
flat out vec4 sphere;
flat out vec3 colour;
flat out float seen;
out vec3 ray;
vec3 heat(float t) {
  vec3 slow = vec3(0.24, 0.30, 0.46), middle = vec3(0.93, 0.76, 0.36), fast = vec3(0.80, 0.13, 0.16);
  return t < 0.5 ? mix(slow, middle, 2.0 * t) : mix(middle, fast, 2.0 * t - 1.0);
}
void main() {
  vec3 place = low + extent * mix(before, after, share);
  vec3 centre = (viewMatrix * vec4(place, 1.0)).xyz;
  seen = SEEN;
  float d = length(centre), r = ball.x;
  vec3 to = centre / d;
  vec3 across = normalize(cross(to, vec3(0.0, 1.0, 0.001)));
  vec3 up = cross(across, to);
  vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  float half_edge = d > 1.001 * r ? (d - r) * r / sqrt(d * d - r * r) : 0.0;
  ray = to * (d - r) + half_edge * (corner.x * across + corner.y * up);
  sphere = vec4(centre, r);
  colour = sand * (0.82 + 0.3 * ball.y);
  if (paint == 1) {
    vec3 other = mix(vec3(0.26, 0.45, 0.55), vec3(0.72, 0.33, 0.25), ball.z);
    colour = mod(floor(ball.z * 6.0), 2.0) < 1.0 ? sand : other;
    colour *= 0.9 + 0.15 * ball.y;
  } else if (paint == 2) {
    float speed = length(extent * (after - before)) * rate;
    colour = heat(clamp(log(max(speed, 1e-6) / 1e-3) / log(1e3), 0.0, 1.0));
  }
  if (ball.w > 0.5) colour = still * (0.85 + 0.3 * ball.y);
  gl_Position = projectionMatrix * vec4(ray, 1.0);
}`;

const CONSERVATIVE = `#extension GL_EXT_conservative_depth : enable
#ifdef GL_EXT_conservative_depth
layout(depth_greater) out highp float gl_FragDepth;
#endif
`;

// In light as three.js lights the meshes.
const BALL_FRAGMENT = `
uniform vec3 sun, up; // of the world, as the eye sees them
flat in vec4 sphere;
flat in vec3 colour;
flat in float seen;
in vec3 ray;
out vec4 pixel;
void main() {
  vec3 to = normalize(ray);
  float along = dot(to, sphere.xyz);
  vec3 aside = sphere.xyz - along * to;
  float rest = sphere.w * sphere.w - dot(aside, aside);
  if (rest < 0.0) discard;
  vec3 hit = to * (along - sqrt(rest));
  vec3 normal = (hit - sphere.xyz) / sphere.w;
  vec3 sky = mix(vec3(0.26, 0.21, 0.18), vec3(0.52, 0.53, 0.57), 0.5 + 0.5 * dot(normal, up));
  pixel = vec4(colour * (sky + vec3(0.68, 0.64, 0.58) * max(dot(normal, sun), 0.0) * SEEN), 1.0);
  gl_FragDepth = 0.5 + 0.5 * (projectionMatrix[2][2] * hit.z + projectionMatrix[3][2]) / -hit.z;
}`;

const SCREEN_VERTEX = `
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
  gl_Position = vec4(2.0 * at - 1.0, 0.0, 1.0);
}`;

// A pixel is darker the more of the pixels about it lie before it: near ones for edges, farther ones for hollows.
// Opposite pixels count together, so that a plane seen at a slant has no shade; what is far before it does not count.
const SCREEN_FRAGMENT = (software) => `
uniform highp sampler2D picture, depths;
uniform vec2 planes, reach; // of the projection; least reach, and a radius of a ball, both in pixels at distance 1
uniform float radius;
in vec2 at;
out vec4 pixel;
float away(vec2 p) { return planes.y / (2.0 * texture(depths, p).r - 1.0 + planes.x); }
void main() {
  vec3 colour = texture(picture, at).rgb;
  pixel = vec4(colour, 1.0);
  if (texture(depths, at).r == 1.0) return;
  vec2 size = vec2(textureSize(depths, 0));
  float here = away(at);
  float hidden = 0.0;
  for (int ring = 0; ring < 2; ring++) {
    float wide = ring == 0 ? reach.x : clamp(4.0 * reach.y / here, 3.0 * reach.x, 40.0 * reach.x);
    float depth = max(ring == 0 ? radius : 3.0 * radius, 1.5 * wide * here * radius / reach.y);
    for (int i = 0; i < ${software ? 3 : 4}; i++) { // pairs of pixels
      float a = ${software ? 1.0472 : 0.7854} * float(i) + ${software ? 0.5236 : 0.3927} * float(ring);
      vec2 aside = wide * vec2(cos(a), sin(a)) / size;
      vec2 before = (here - vec2(away(at + aside), away(at - aside))) / depth;
      vec2 counts = clamp(before, -1.0, 1.0) / (1.0 + 6.0 * max(abs(before) - 1.0, 0.0));
      hidden += (ring == 0 ? 1.0 : 0.7) * max(0.0, counts.x + counts.y);
    }
  }
  pixel.rgb *= exp(-${software ? 0.147 : 0.11} * hidden);
}`;

// Shaders of our own; `before` is what must stand before everything else.
const raw = (uniforms, vertex, fragment, { before = "", ...options } = {}) =>
  new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader: HEAD_GLSL + vertex, fragmentShader: before + HEAD_GLSL + fragment,
    uniforms: Object.fromEntries(Object.entries(uniforms).map(([name, value]) => [name, { value }])), ...options,
  });

// Numbers of each item, once for each corner of its square.
const fourfold = (data, width, target) => {
  for (let i = 0, k = 0; i < data.length; i += width)
    for (let corner = 0; corner < 4; corner++) for (let c = 0; c < width; c++) target[k++] = data[i + c];
};

// Squares whose places at two frames are levels of a channel. Without a graphics card, an instance costs as much as a
// drawing of its own: every square has four corners of its own.
class Squares {
  constructor(view, name, material, fixed) {
    this.name = name;
    this.material = material;
    const channel = view.scene.channels.find((one) => one.name === name);
    this.geometry = new THREE.BufferGeometry();
    const corners = new Uint32Array(6 * channel.count);
    for (let i = 0; i < channel.count; i++) corners.set([0, 1, 2, 2, 1, 3].map((k) => 4 * i + k), 6 * i);
    this.geometry.setIndex(new THREE.BufferAttribute(corners, 1));
    this.slots = ["before", "after"].map(() => {
      const slot = new THREE.BufferAttribute(new Uint16Array(4 * channel.count * channel.width), channel.width, true);
      slot.setUsage(THREE.DynamicDrawUsage);
      return slot;
    });
    this.setFixed(...fixed);
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
    view.world.add(this.mesh);
    const { low, step } = channel;
    const { uniforms } = material;
    uniforms.low.value = new THREE.Vector3(...low);
    uniforms.extent.value = new THREE.Vector3(...step).multiplyScalar(65535);
  }

  // What does not change.
  setFixed(key, data, width) {
    const corners = new Float32Array(4 * data.length);
    fourfold(data, width, corners);
    this.geometry.setAttribute(key, new THREE.BufferAttribute(corners, width));
  }

  // Gives the graphics card the frames that it has not got.
  show(before, after, share) {
    const wanted = [before[this.name].data, after[this.name].data];
    const held = this.slots.map(({ levels }) => levels);
    if (held[1] === wanted[0] || held[0] === wanted[1]) this.slots.reverse();
    this.slots.forEach((slot, i) => {
      if (slot.levels === wanted[i]) return;
      slot.levels = wanted[i];
      fourfold(wanted[i], slot.itemSize, slot.array);
      slot.needsUpdate = true;
    });
    ["before", "after"].forEach((key, i) => this.geometry.setAttribute(key, this.slots[i]));
    this.material.uniforms.share.value = share;
  }
}

class Balls {
  constructor(view) {
    this.view = view;
    const { arrays, sand, radius } = view.scene;
    this.radius = radius;
    this.fixed = new Float32Array(4 * arrays.radii.length);
    const { software } = view;
    const shadow = BALL_SHADOW(software);
    const vertex = software ? shadow + BALL_VERTEX.replace("SEEN", "sunlit(place + ball.x * vec3(0.0, 1.0, 0.0))") : BALL_VERTEX.replace("SEEN", "1.0");
    const point = "sunlit(transpose(mat3(viewMatrix)) * (hit - viewMatrix[3].xyz))";
    const fragment = software ? BALL_FRAGMENT.replace("SEEN", "seen") : shadow + BALL_FRAGMENT.replace("SEEN", point);
    const material = raw(
      { low: null, extent: null, sand: colourOf(sand[0]), still: colourOf(sand[1]), share: 0, rate: 0, paint: 0,
        light: new THREE.Matrix4(), shadow: null, sun: new THREE.Vector3(), up: new THREE.Vector3() },
      vertex, fragment, { side: THREE.DoubleSide, before: CONSERVATIVE },
    );
    this.squares = new Squares(view, "balls", material, ["ball", this.fixed, 4]);
    view.renderer.getContext().getExtension("EXT_conservative_depth");
    this.squares.mesh.onBeforeRender = () => {
      const { shadow } = view.sun;
      material.uniforms.light.value.copy(shadow.map ? shadow.matrix : new THREE.Matrix4().makeTranslation(9, 9, 9));
      material.uniforms.shadow.value = shadow.map?.depthTexture ?? null;
      material.uniforms.sun.value.copy(SUN).transformDirection(view.camera.matrixWorldInverse);
      material.uniforms.up.value.set(0, 1, 0).transformDirection(view.camera.matrixWorldInverse);
      material.uniformsNeedUpdate = true;
    };
    this.screen = new THREE.Scene();
    this.shade = raw({ picture: null, depths: null, planes: new THREE.Vector2(), reach: new THREE.Vector2(), radius },
      SCREEN_VERTEX, SCREEN_FRAGMENT(software), { depthTest: false, depthWrite: false });
    const triangle = new THREE.BufferGeometry();
    triangle.setIndex([0, 1, 2]);
    const sheet = new THREE.Mesh(triangle, this.shade);
    sheet.frustumCulled = false;
    this.screen.add(sheet);
    this.flat = new THREE.OrthographicCamera();
  }

  show(before, after, share, rate) {
    if (!this.started) this.start(before.balls.data);
    this.squares.show(before, after, share);
    const { uniforms } = this.squares.material;
    uniforms.rate.value = rate;
    uniforms.paint.value = this.view.paint;
  }

  // What does not change: radius, shade, height at the start, and whether no force moves the ball.
  start(levels) {
    this.started = true;
    const { radii, fixed } = this.view.scene.arrays;
    let [least, most] = [65535, 0];
    for (let i = 0; i < radii.length; i++) {
      least = Math.min(least, levels[3 * i + 1]);
      most = Math.max(most, levels[3 * i + 1]);
    }
    for (let i = 0; i < radii.length; i++) {
      const height = (levels[3 * i + 1] - least) / Math.max(1, most - least);
      this.fixed.set([radii[i], (i * 0.6180339887) % 1, height, fixed[i]], 4 * i);
    }
    this.squares.setFixed("ball", this.fixed, 4);
  }

  // The picture goes into a texture with depths, and then to the screen with shade in the gaps.
  render() {
    const { view } = this;
    const { renderer, camera } = view;
    const size = renderer.getDrawingBufferSize(new THREE.Vector2());
    if (!this.target || this.target.width !== size.x || this.target.height !== size.y) {
      this.target?.dispose();
      this.target = new THREE.WebGLRenderTarget(size.x, size.y, { samples: 0 });
      this.target.depthTexture = new THREE.DepthTexture(size.x, size.y, THREE.UnsignedIntType);
      this.shade.uniforms.picture.value = this.target.texture;
      this.shade.uniforms.depths.value = this.target.depthTexture;
    }
    renderer.setRenderTarget(this.target);
    renderer.render(view.world, camera);
    renderer.setRenderTarget(null);
    const p = camera.projectionMatrix.elements;
    this.shade.uniforms.planes.value.set(p[10], p[14]);
    this.shade.uniforms.reach.value.set(1.2 * renderer.getPixelRatio(), 0.5 * size.y * p[5] * this.radius);
    renderer.render(this.screen, this.flat);
  }
}

const DISK_VERTEX = `
in vec3 before, after;
in float size;
uniform vec3 low, extent;
uniform float share;
out vec2 at;
flat out float turn;
void main() {
  vec3 pose = low + extent * mix(before, after, share);
  at = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0;
  turn = pose.z;
  gl_Position = projectionMatrix * viewMatrix * vec4(pose.xy + size * at, 0.0, 1.0);
}`;

const DISK_FRAGMENT = `
uniform vec3 pale, sand;
in vec2 at;
flat in float turn;
out vec4 pixel;
void main() {
  float r = length(at);
  if (r > 1.0) discard;
  float side = dot(at, vec2(sin(turn), -cos(turn))); // its halves show its rotation
  pixel = vec4(mix(sand, pale, step(0.0, side)) * (1.0 - 0.35 * smoothstep(0.75, 1.0, r)), 1.0);
}`;

class Disks extends Squares {
  constructor(view) {
    const { arrays, sand } = view.scene;
    const material = raw(
      { low: null, extent: null, share: 0, pale: colourOf(sand[0]), sand: colourOf(sand[1]) },
      DISK_VERTEX, DISK_FRAGMENT, { side: THREE.DoubleSide },
    );
    super(view, "disks", material, ["size", arrays.radii, 1]);
  }
}

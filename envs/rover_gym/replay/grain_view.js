// Draws balls, meshes and sky with WebGL 2: first into a texture with depths, then with shade in the gaps.
"use strict";

const SUN = [-0.348, 0.795, 0.497]; // towards it, in the world
const SHADOW_SIZE = 1024; // pixels of the rover's shadow

const SHARED = `#version 300 es
precision highp float;
uniform mat4 view, projection, light;
uniform highp sampler2DShadow shadow;
const vec3 sun = vec3(${SUN.join(",")});
// A colour in light: place and normal in the world. What the sun does not reach has the light of the sky.
vec3 lit(vec3 colour, vec3 place, vec3 normal) {
  vec3 s = 0.5 + 0.5 * (light * vec4(place, 1.0)).xyz;
  bool outside = any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)));
  float seen = outside ? 1.0 : texture(shadow, s - vec3(0.0, 0.0, 2e-3));
  float sky = 0.37 + 0.17 * normal.y;
  return colour * (sky + 0.62 * max(dot(normal, sun), 0.0) * seen);
}
`;

// A ball is a square that touches its sphere where it is nearest to the eye, so every point of it lies behind.
const BALL_VERTEX = `${SHARED}
layout(location = 0) in vec3 before;
layout(location = 1) in vec3 after;
layout(location = 2) in vec4 ball; // radius, shade, height at the start, 1 for one that no force moves
uniform vec3 low, extent;
uniform float share, rate;
uniform int paint;
flat out vec4 sphere;
flat out vec3 colour;
out vec3 ray;
uniform vec3 sand, still;
vec3 heat(float t) {
  vec3 slow = vec3(0.24, 0.30, 0.46), middle = vec3(0.93, 0.76, 0.36), fast = vec3(0.80, 0.13, 0.16);
  return t < 0.5 ? mix(slow, middle, 2.0 * t) : mix(middle, fast, 2.0 * t - 1.0);
}
void main() {
  vec3 centre = (view * vec4(low + extent * mix(before, after, share), 1.0)).xyz;
  float d = length(centre), r = ball.x;
  vec3 to = centre / d;
  vec3 across = normalize(cross(to, vec3(0.0, 1.0, 0.001)));
  vec3 up = cross(across, to);
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  float half_edge = d > 1.001 * r ? (d - r) * r / sqrt(d * d - r * r) : 0.0;
  ray = to * (d - r) + half_edge * (corner.x * across + corner.y * up);
  sphere = vec4(centre, r);
  colour = sand * (0.82 + 0.3 * ball.y);
  if (paint == 1) {
    float band = ball.z * 6.0;
    vec3 other = mix(vec3(0.26, 0.45, 0.55), vec3(0.72, 0.33, 0.25), ball.z);
    colour = mod(floor(band), 2.0) < 1.0 ? sand : other;
    colour *= 0.9 + 0.15 * ball.y;
  } else if (paint == 2) {
    float speed = length(extent * (after - before)) * rate;
    colour = heat(clamp(log(max(speed, 1e-6) / 1e-3) / log(1e3), 0.0, 1.0));
  }
  if (ball.w > 0.5) colour = still * (0.85 + 0.3 * ball.y);
  gl_Position = projection * vec4(ray, 1.0);
}`;

const BALL_FRAGMENT = `#version 300 es
#extension GL_EXT_conservative_depth : enable
#ifdef GL_EXT_conservative_depth
layout(depth_greater) out highp float gl_FragDepth;
#endif
${SHARED.replace("#version 300 es\n", "")}
flat in vec4 sphere;
flat in vec3 colour;
in vec3 ray;
out vec4 pixel;
void main() {
  vec3 to = normalize(ray);
  float along = dot(to, sphere.xyz);
  vec3 aside = sphere.xyz - along * to;
  float rest = sphere.w * sphere.w - dot(aside, aside);
  if (rest < 0.0) discard;
  vec3 hit = to * (along - sqrt(rest));
  vec3 normal = transpose(mat3(view)) * (hit - sphere.xyz) / sphere.w;
  vec3 place = transpose(mat3(view)) * (hit - view[3].xyz);
  pixel = vec4(lit(colour, place, normal), 1.0);
  gl_FragDepth = 0.5 + 0.5 * (projection[2][2] * hit.z + projection[3][2]) / -hit.z;
}`;

const MESH_VERTEX = `${SHARED}
layout(location = 0) in vec3 vertex;
layout(location = 1) in vec4 paint;
uniform vec3 origin;
uniform vec4 turn; // x, y, z, w
out vec3 place;
flat out vec3 colour;
void main() {
  place = origin + vertex + 2.0 * cross(turn.xyz, cross(turn.xyz, vertex) + turn.w * vertex);
  colour = paint.rgb;
  gl_Position = projection * view * vec4(place, 1.0);
}`;

const MESH_FRAGMENT = `${SHARED}
in vec3 place;
flat in vec3 colour;
out vec4 pixel;
void main() {
  pixel = vec4(lit(colour, place, normalize(cross(dFdx(place), dFdy(place)))), 1.0);
}`;

const SCREEN_VERTEX = `#version 300 es
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0;
  gl_Position = vec4(2.0 * at - 1.0, 0.0, 1.0);
}`;

// A pixel is darker the more of the pixels about it lie before it: near ones for edges, farther ones for hollows.
// Opposite pixels count together, so that a plane seen at a slant has no shade; what is far before it does not count.
const SCREEN_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D picture;
uniform highp sampler2D depths;
uniform vec2 planes, reach; // of the projection; least reach, and a radius of a ball, both in pixels at distance 1
uniform float radius;
uniform vec3 overhead, horizon;
in vec2 at;
out vec4 pixel;
float away(vec2 p) { return planes.y / (2.0 * texture(depths, p).r - 1.0 + planes.x); }
void main() {
  if (texture(depths, at).r == 1.0) {
    pixel = vec4(mix(horizon, overhead, at.y * at.y), 1.0);
    return;
  }
  vec2 size = vec2(textureSize(depths, 0));
  float here = away(at);
  float hidden = 0.0;
  for (int ring = 0; ring < 2; ring++) {
    float wide = ring == 0 ? reach.x : clamp(4.0 * reach.y / here, 3.0 * reach.x, 40.0 * reach.x);
    float depth = max(ring == 0 ? radius : 3.0 * radius, 1.5 * wide * here * radius / reach.y);
    for (int i = 0; i < 4; i++) {
      float a = 0.7854 * float(i) + 0.3927 * float(ring);
      vec2 aside = wide * vec2(cos(a), sin(a)) / size;
      vec2 before = (here - vec2(away(at + aside), away(at - aside))) / depth;
      vec2 counts = clamp(before, -1.0, 1.0) / (1.0 + 6.0 * max(abs(before) - 1.0, 0.0));
      hidden += (ring == 0 ? 1.0 : 0.7) * max(0.0, counts.x + counts.y);
    }
  }
  pixel = vec4(texture(picture, at).rgb * exp(-0.11 * hidden), 1.0);
}`;

const multiply = (a, b) => {
  const c = new Float32Array(16);
  for (let i = 0; i < 4; i++)
    for (let j = 0; j < 4; j++) for (let k = 0; k < 4; k++) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
};
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((value) => value / Math.hypot(...a));

// From the world to an eye that looks along its -z.
const looking = (eye, target, up) => {
  const z = unit(eye.map((value, i) => value - target[i]));
  const x = unit(cross(up, z));
  const y = cross(z, x);
  const turn = [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0];
  return new Float32Array([...turn, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
};

class GrainView {
  constructor(canvas, scene, blobs) {
    this.canvas = canvas;
    this.scene = scene;
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
    if (gl === null) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    gl.getExtension("EXT_conservative_depth");
    this.balls = this.program(BALL_VERTEX, BALL_FRAGMENT);
    this.meshes = this.program(MESH_VERTEX, MESH_FRAGMENT);
    this.screen = this.program(SCREEN_VERTEX, SCREEN_FRAGMENT);
    this.places = [0, 1].map(() => this.buffer(gl.ARRAY_BUFFER, 8 * scene.balls, gl.DYNAMIC_DRAW));
    this.fixed = this.buffer(gl.ARRAY_BUFFER, 16 * scene.balls, gl.STATIC_DRAW);
    this.ballArrays = [0, 1].map((a) => [0, 1].map((b) => this.ballArray(a, b)));
    this.meshArray = this.meshArrayOf(blobs);
    this.sheet = { framebuffer: gl.createFramebuffer(), width: 0, height: 0 };
    this.makeShadow();
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(program, i);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  buffer(target, content, use) {
    const { gl } = this;
    const buffer = gl.createBuffer();
    gl.bindBuffer(target, buffer);
    gl.bufferData(target, content, use);
    return buffer;
  }

  // Vertex arrays of balls that go from one of the two samples in memory to the other.
  ballArray(before, after) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const layout = [[this.places[before], 3, gl.UNSIGNED_SHORT, 8], [this.places[after], 3, gl.UNSIGNED_SHORT, 8]];
    [...layout, [this.fixed, 4, gl.FLOAT, 16]].forEach(([buffer, size, type, stride], location) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, type, true, stride, 0);
      gl.vertexAttribDivisor(location, 1);
    });
    gl.bindVertexArray(null);
    return array;
  }

  meshArrayOf({ vertices, colours, triangles }) {
    const { gl } = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    [[vertices, 3, gl.FLOAT], [colours, 4, gl.UNSIGNED_BYTE]].forEach(([data, size, type], location) => {
      this.buffer(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, type, true, 0, 0);
    });
    this.buffer(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return array;
  }

  texture(format, type, width, height, internal) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, null);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    return texture;
  }

  depthTexture(width, height) {
    const { gl } = this;
    return this.texture(gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, width, height, gl.DEPTH_COMPONENT24);
  }

  makeShadow() {
    const { gl } = this;
    const depths = this.depthTexture(SHADOW_SIZE, SHADOW_SIZE);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depths, 0);
    this.shadow = { framebuffer, depths, empty: this.depthTexture(1, 1) };
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_COMPARE_MODE, gl.COMPARE_REF_TO_TEXTURE);
  }

  // What does not change: radius, shade, height at the start, and whether no force moves the ball.
  setBalls(radii, fixed, levels) {
    const { gl } = this;
    const data = new Float32Array(4 * radii.length);
    let least = 65535;
    let most = 0;
    for (let i = 0; i < radii.length; i++) {
      least = Math.min(least, levels[4 * i + 1]);
      most = Math.max(most, levels[4 * i + 1]);
    }
    for (let i = 0; i < radii.length; i++) {
      const height = (levels[4 * i + 1] - least) / Math.max(1, most - least);
      data.set([radii[i], (i * 0.6180339887) % 1, height, fixed[i]], 4 * i);
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.fixed);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, data);
  }

  upload(slot, levels) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.places[slot]);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, levels);
  }

  resize(ratio) {
    const { gl, canvas, sheet } = this;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (sheet.width === width && sheet.height === height) return;
    canvas.width = width;
    canvas.height = height;
    for (const old of [sheet.picture, sheet.depths]) if (old) gl.deleteTexture(old);
    const picture = this.texture(gl.RGBA, gl.UNSIGNED_BYTE, width, height, gl.RGBA8);
    const depths = this.depthTexture(width, height);
    Object.assign(sheet, { width, height, picture, depths });
    gl.bindFramebuffer(gl.FRAMEBUFFER, sheet.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, picture, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depths, 0);
  }

  // Draws a picture. `slots`: where the samples before and after are; `share`: how far it is from one to the other;
  // `rate`: samples a second there; `poses`: of all moving frames; `camera`: eye, target, angle; `ratio`: pixels.
  draw({ slots, share, rate, poses, camera, paint, ratio }) {
    const { gl, scene, sheet } = this;
    this.resize(ratio);
    const distance = Math.hypot(...camera.eye.map((value, i) => value - camera.target[i]));
    const near = Math.max(0.02 * distance, 0.2 * scene.radius);
    const far = 20 * distance + 4 * Math.hypot(...scene.extent);
    const focal = 1 / Math.tan(camera.angle / 2);
    const projection = new Float32Array(16);
    projection[0] = (focal * sheet.height) / sheet.width;
    projection[5] = focal;
    projection[10] = (far + near) / (near - far);
    projection[11] = -1;
    projection[14] = (2 * far * near) / (near - far);
    const view = looking(camera.eye, camera.target, [0, 1, 0]);
    const light = this.drawShadow(poses);

    gl.bindFramebuffer(gl.FRAMEBUFFER, sheet.framebuffer);
    gl.viewport(0, 0, sheet.width, sheet.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.shadow.depths);
    this.use(this.meshes, { view, projection, light });
    this.drawMeshes(poses, () => true);
    const { uniforms } = this.balls;
    this.use(this.balls, { view, projection, light });
    gl.uniform3fv(uniforms.low, scene.low);
    gl.uniform3fv(uniforms.extent, scene.extent);
    gl.uniform3fv(uniforms.sand, scene.sand[0]);
    gl.uniform3fv(uniforms.still, scene.sand[1]);
    gl.uniform1f(uniforms.share, share);
    gl.uniform1f(uniforms.rate, rate);
    gl.uniform1i(uniforms.paint, paint);
    gl.disable(gl.CULL_FACE);
    gl.bindVertexArray(this.ballArrays[slots[0]][slots[1]]);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, scene.balls);
    this.drawScreen(projection, focal, ratio);
  }

  use({ program, uniforms }, { view, projection, light }) {
    const { gl } = this;
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    gl.uniformMatrix4fv(uniforms.view, false, view);
    gl.uniformMatrix4fv(uniforms.projection, false, projection);
    if (uniforms.light) gl.uniformMatrix4fv(uniforms.light, false, light);
    if (uniforms.shadow) gl.uniform1i(uniforms.shadow, 0);
  }

  // Meshes that show; faces show from outside only, so that no wall stands between the eye and the balls.
  drawMeshes(poses, shows) {
    const { gl, scene } = this;
    gl.enable(gl.CULL_FACE);
    gl.bindVertexArray(this.meshArray);
    for (const { solid, first, count } of scene.meshes) {
      if (count === 0 || !shows(solid)) continue;
      const pose = solid < 0 ? [0, 0, 0, 0, 0, 0, 1] : poses.subarray(7 * solid, 7 * solid + 7);
      gl.uniform3f(this.meshes.uniforms.origin, pose[0], pose[1], pose[2]);
      gl.uniform4f(this.meshes.uniforms.turn, pose[3], pose[4], pose[5], pose[6]);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
  }

  // The depths of the rover's solids as the sun sees them; returns the sun's view.
  drawShadow(poses) {
    const { gl, scene, shadow } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, shadow.framebuffer);
    gl.viewport(0, 0, SHADOW_SIZE, SHADOW_SIZE);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    if (scene.rover === 0) return new Float32Array([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 3, 3, 1]);
    const middle = Array.from(poses.subarray(0, 3));
    const size = 1.3 * scene.reach;
    const view = looking(middle.map((value, i) => value + size * SUN[i]), middle, [0, 1, 0]);
    const sides = new Float32Array([1 / size, 0, 0, 0, 0, 1 / size, 0, 0, 0, 0, -1 / size, 0, 0, 0, -1, 1]);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, shadow.empty);
    this.use(this.meshes, { view, projection: sides, light: sides });
    this.drawMeshes(poses, (solid) => solid >= 0 && solid < scene.rover);
    return multiply(sides, view);
  }

  drawScreen(projection, focal, ratio) {
    const { gl, scene, sheet } = this;
    const { program, uniforms } = this.screen;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.DEPTH_TEST);
    gl.disable(gl.CULL_FACE);
    gl.useProgram(program);
    [sheet.picture, sheet.depths].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.uniform1i(uniforms.picture, 0);
    gl.uniform1i(uniforms.depths, 1);
    gl.uniform2f(uniforms.planes, projection[10], projection[14]);
    gl.uniform2f(uniforms.reach, 1.2 * ratio, 0.5 * sheet.height * focal * scene.radius);
    gl.uniform1f(uniforms.radius, scene.radius);
    gl.uniform3fv(uniforms.overhead, scene.sky[0]);
    gl.uniform3fv(uniforms.horizon, scene.sky[1]);
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

// Ruts in sand: depths in a texture over the ground, which its shader shades as the grooves that they are.
"use strict";

const RUT_UNIFORMS = "uniform sampler2D ruts; uniform vec4 rutBox; uniform vec2 rutCell; uniform float rutDepth;\n";
const RUT_FRAGMENT = `
  vec2 rutAt = (soilPlace.xz - rutBox.xy) * rutBox.zw;
  vec2 rutStep = 1.0 / vec2(textureSize(ruts, 0));
  float rut = rutDepth * texture2D(ruts, rutAt).r;
  vec2 groove = rutDepth * vec2(
    texture2D(ruts, rutAt + vec2(rutStep.x, 0.0)).r - texture2D(ruts, rutAt - vec2(rutStep.x, 0.0)).r,
    texture2D(ruts, rutAt + vec2(0.0, rutStep.y)).r - texture2D(ruts, rutAt - vec2(0.0, rutStep.y)).r) / (2.0 * rutCell);
  float grooveLight = (${SUN.y} + ${SUN.x} * groove.x + ${SUN.z} * groove.y) / sqrt(1.0 + dot(groove, groove)) / ${SUN.y};
  diffuseColor.rgb *= clamp(0.4 + 0.6 * grooveLight, 0.35, 1.3) * mix(1.0, 0.78, clamp(rut / 0.002, 0.0, 1.0)) *
    mix(1.0, 0.65, clamp(rut / 0.05, 0.0, 1.0));`;

class Ruts {
  constructor(scene) {
    const { low, size, cell, deepest } = scene.ruts;
    this.arrays = scene.arrays;
    this.deepest = deepest;
    this.depths = new Uint8Array(size[0] * size[1]);
    this.texture = new THREE.DataTexture(this.depths, ...size, THREE.RedFormat);
    this.texture.unpackAlignment = 1;
    this.texture.magFilter = this.texture.minFilter = THREE.LinearFilter;
    this.texture.needsUpdate = true;
    this.done = 0;
    const extent = size.map((n) => n * cell);
    this.uniforms = {
      ruts: { value: this.texture },
      rutBox: { value: new THREE.Vector4(...low, 1 / extent[0], 1 / extent[1]) },
      rutCell: { value: new THREE.Vector2(cell, cell) },
      rutDepth: { value: deepest },
    };
  }

  // Presses a cell down to a level of 255, one of the deepest.
  press(cell, level) {
    this.depths[cell] = level;
    this.texture.needsUpdate = true;
  }

  // Shows the ruts at sample `k` of a recorded run.
  show(k) {
    const { "rut-sample": samples, "rut-cell": cells, "rut-level": levels } = this.arrays;
    if (!samples) return;
    if (this.done > 0 && samples[this.done - 1] > k) {
      this.depths.fill(0);
      this.texture.needsUpdate = true;
      this.done = 0;
    }
    for (; this.done < samples.length && samples[this.done] <= k; this.done++) this.press(cells[this.done], levels[this.done]);
  }
}

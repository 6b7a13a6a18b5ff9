// The samples of the balls' places. Pieces of the file unpack ahead of the player; one sample at a time is rebuilt.
"use strict";

// The content of a packed script element.
const unpacked = async (id) => {
  const text = document.getElementById(id).textContent.trim();
  const packed = await fetch(`data:application/octet-stream;base64,${text}`);
  const stream = packed.body.pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

class GrainFrames {
  static KEPT = 6; // unpacked pieces

  constructor({ balls, samples, pieces, time }) {
    this.balls = balls;
    this.samples = samples;
    this.last = pieces - 1;
    this.n = time.length;
    this.pieces = new Map(); // by number, latest use last; null while it unpacks
    this.levels = new Uint16Array(4 * balls); // x, y, z and padding of each ball at the sample `at`
    this.at = -1;
  }

  // A piece, or null if it is not there yet. Asks for it, and for the next one.
  piece(i) {
    for (const wanted of [Math.min(i + 1, this.last), i]) {
      if (!this.pieces.has(wanted)) {
        this.pieces.set(wanted, null);
        unpacked(`piece-${wanted}`).then((data) => this.pieces.has(wanted) && this.pieces.set(wanted, data));
      }
      const data = this.pieces.get(wanted);
      this.pieces.delete(wanted);
      this.pieces.set(wanted, data);
    }
    while (this.pieces.size > GrainFrames.KEPT) this.pieces.delete(this.pieces.keys().next().value);
    return this.pieces.get(i);
  }

  // The levels of sample `k`, or null if its piece is not there yet.
  sample(k) {
    const number = Math.floor(k / this.samples);
    const piece = this.piece(number);
    if (piece === null) return null;
    const first = number * this.samples;
    for (let j = this.at >= first && this.at <= k ? this.at + 1 : first; j <= k; j++) this.apply(piece, j - first);
    this.at = k;
    return this.levels;
  }

  // Rebuilds the sample `j` of a piece from the one before it.
  apply(piece, j) {
    const { balls, levels } = this;
    for (let axis = 0; axis < 3; axis++) {
      const low = (6 * j + 2 * axis) * balls;
      const high = low + balls;
      if (j === 0) {
        for (let i = 0, k = axis; i < balls; i++, k += 4) levels[k] = piece[low + i] | (piece[high + i] << 8);
      } else {
        for (let i = 0, k = axis; i < balls; i++, k += 4) levels[k] += (piece[low + i] | (piece[high + i] << 8)) - 128;
      }
    }
  }
}

// The scene format: a header in JSON with static arrays, and frames, which are rows of whole numbers ("levels") by
// channel: value = low + step * level. A recorded run and a live drive give the same frames.
"use strict";

const TYPES = { f4: Float32Array, u4: Uint32Array, u2: Uint16Array, u1: Uint8Array };

// A scene from its bytes: the header's length, the header, and the arrays that it lists by type, place and number.
const openScene = (bytes) => {
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
  const scene = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
  for (const [name, [type, first, count]] of Object.entries(scene.arrays)) {
    const begin = bytes.byteOffset + 4 + length + first;
    const kind = TYPES[type];
    scene.arrays[name] = new kind(bytes.buffer.slice(begin, begin + count * kind.BYTES_PER_ELEMENT));
  }
  return scene;
};

// The content of a packed script element.
const unpacked = async (id) => {
  const packed = await fetch(`data:application/octet-stream;base64,${document.getElementById(id).textContent.trim()}`);
  const stream = packed.body.pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

// The levels of a channel, `width` to an item, and their values.
class Levels {
  constructor(channel, data) {
    this.channel = channel;
    this.data = data;
  }

  // Value `c` of item `i`, or between it and that of another frame.
  value(i, c, other = this, share = 0) {
    const { width, low, step } = this.channel;
    const [a, b] = [this.data[i * width + c], other.data[i * width + c]];
    return low[c] + step[c] * (a + share * (b - a));
  }
}

// Adds the differences of a sample to the levels before it, or takes it whole. Components stand one after the other,
// each with the low bytes of all items first.
const addSample = (channel, data, bytes, first, whole) => {
  const { count, width } = channel;
  const planes = channel.bytes;
  for (let c = 0; c < width; c++) {
    const begin = first + c * planes * count;
    for (let i = 0, k = c; i < count; i++, k += width) {
      let level = 0;
      for (let plane = planes - 1; plane >= 0; plane--) level = level * 256 + bytes[begin + plane * count + i];
      data[k] = whole ? level : data[k] + level - 128;
    }
  }
};

const blank = (channel) => new (channel.bytes === 2 ? Uint16Array : Uint32Array)(channel.count * channel.width);
const sizeOf = (channels) => channels.reduce((sum, { count, width, bytes }) => sum + count * width * bytes, 0);

// A frame from the bytes of one sample that is whole.
const wholeFrame = (channels, bytes, first) => {
  const frame = {};
  for (const channel of channels) {
    const data = blank(channel);
    addSample(channel, data, bytes, first, true);
    frame[channel.name] = new Levels(channel, data);
    first += sizeOf([channel]);
  }
  return frame;
};

// The frames of a recorded run. Pieces of the file unpack ahead of the player; a piece begins with a whole sample.
class Frames {
  static KEPT = 6; // unpacked pieces

  constructor({ channels, samples, pieces, time }) {
    this.channels = channels;
    this.samples = samples;
    this.last = pieces - 1;
    this.n = time.length;
    this.size = sizeOf(channels);
    this.pieces = new Map(); // by number, latest use last; null while it unpacks
    this.levels = channels.map(blank); // at the sample `at`
    this.at = -1;
    this.ready = new Map(); // the last frames that were asked for
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
    while (this.pieces.size > Frames.KEPT) this.pieces.delete(this.pieces.keys().next().value);
    return this.pieces.get(i);
  }

  // The frame of sample `k`, or null if its piece is not there yet.
  frame(k) {
    if (this.ready.has(k)) return this.ready.get(k);
    const number = Math.floor(k / this.samples);
    const piece = this.piece(number);
    if (piece === null) return null;
    const first = number * this.samples;
    for (let j = this.at >= first && this.at <= k ? this.at + 1 : first; j <= k; j++) this.add(piece, j - first);
    this.at = k;
    const frame = {};
    this.channels.forEach((channel, i) => (frame[channel.name] = new Levels(channel, this.levels[i].slice())));
    this.ready.set(k, frame);
    if (this.ready.size > 4) this.ready.delete(this.ready.keys().next().value);
    return frame;
  }

  add(piece, j) {
    let first = j * this.size;
    this.channels.forEach((channel, i) => {
      addSample(channel, this.levels[i], piece, first, j === 0);
      first += sizeOf([channel]);
    });
  }
}

// Where the bodies are: frames as they were written, and what lies between them.
class Film {
  constructor(scene) {
    this.scene = scene;
    this.bodies = scene.bodies;
    this.frames = scene.frames;
    this.times = scene.frames.map(frame => frame.t);
    this.points = scene.points;
    this.size = scene.sections.reduce((sum, [, count]) => sum + count, 0);
    this.decoded = new Map();  // frames, the last used last
    this.pieces = new Map();
  }

  async load() {
    const {scene} = this;
    const lists = new Int32Array((await unpack(`piece${scene.lists}`)).buffer);
    const corners = 3 * scene.triangles, ends = corners + 2 * scene.edges;
    this.triangles = lists.subarray(0, corners);
    this.edges = lists.subarray(corners, ends);
    this.labels = lists.subarray(ends);
    this.seen = scene.seen === undefined ? null : new Float64Array((await unpack(`piece${scene.seen}`)).buffer);
    this.local = new Float32Array((await unpack(`piece${scene.local}`)).buffer);
    this.bodyOf = new Int32Array(this.points);
    let flexible = 0, rigid = 0, local = 0;
    this.bodies.forEach((body, k) => {
      this.bodyOf.fill(k, body.first, body.first + body.count);
      body.slot = body.rigid ? rigid++ : flexible;
      if (body.rigid) { body.local = local; local += 3 * body.count; } else flexible += body.count;
    });
    const rest = await unpack(`piece${scene.rest}`);
    this.rest = this.place(this.rows(rest, 0, rest.length / 2, scene.rest_ranges, 7));
  }

  /** Whether an edge is seen at a time: one of triangles is seen where one of these is. */
  isEdgeSeen(edge, t) {
    if (!this.seen) return true;
    if (!this.trianglesOfEdges) this.trianglesOfEdges = this.findTrianglesOfEdges();
    const beside = this.trianglesOfEdges[edge];
    return !beside.length || beside.some(triangle => this.isSeen(triangle, t));
  }

  findTrianglesOfEdges() {
    const key = (a, b) => Math.min(a, b) * this.points + Math.max(a, b), beside = new Map();
    for (let k = 0; k < this.edges.length; k += 2) beside.set(key(this.edges[k], this.edges[k + 1]), []);
    for (let c = 0; c < this.triangles.length; ++c) {
      const next = c % 3 === 2 ? c - 2 : c + 1, triangles = beside.get(key(this.triangles[c], this.triangles[next]));
      if (triangles) triangles.push(Math.floor(c / 3));
    }
    return Array.from({length: this.edges.length / 2}, (_, k) => beside.get(key(this.edges[2 * k], this.edges[2 * k + 1])));
  }

  /** Whether a triangle is seen at a time: those of elements that have failed are not, those that they lay bare are. */
  isSeen(triangle, t) {
    return !this.seen || (this.seen[2 * triangle] <= t && t < this.seen[2 * triangle + 1]);
  }

  /** The first `count` sections of a block as arrays by name. */
  rows(block, start, size, ranges, count) {
    const out = {};
    let from = 0;
    this.scene.sections.slice(0, count).forEach(([name, length], k) => {
      out[name] = widen(block, start, size, from, length, ranges[2 * k], ranges[2 * k + 1]);
      from += length;
    });
    return out;
  }

  async frame(k) {
    if (this.decoded.has(k)) {
      const known = this.decoded.get(k);
      this.decoded.delete(k);
      this.decoded.set(k, known);
      return known;
    }
    const {piece, place, ranges, t} = this.frames[k];
    if (!this.pieces.has(piece)) {
      this.pieces.set(piece, unpack(`piece${piece}`));
      if (this.pieces.size > 8) this.pieces.delete(this.pieces.keys().next().value);
    }
    const block = await this.pieces.get(piece);
    const made = this.rows(block, 2 * this.size * place, this.size, ranges, this.scene.sections.length);
    made.t = t;
    this.decoded.set(k, made);
    const most = Math.max(8, Math.min(1000, Math.floor(2e8 / (4 * this.size + 1))));
    if (this.decoded.size > most) this.decoded.delete(this.decoded.keys().next().value);
    return made;
  }

  /** The frame at or before t, the one after it, and where t lies between them. */
  async around(t) {
    const {times} = this;
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= t) low = middle; else high = middle - 1;
    }
    const next = Math.min(low + 1, times.length - 1), span = times[next] - times[low];
    const share = span > 0 ? Math.min(1, Math.max(0, (t - times[low]) / span)) : 0;
    const near = share < 1e-9 ? 0 : share > 1 - 1e-9 ? 1 : share;  // no frame is decoded in vain
    const a = await this.frame(near === 1 ? next : low);
    return {a, b: near === 0 || near === 1 ? a : await this.frame(next), share: near === 1 ? 0 : near};
  }

  /** All numbers at a time. */
  async at(t) {
    const {a, b, share} = await this.around(t);
    if (share === 0) return a;
    const mixed = {t};
    for (const [name] of this.scene.sections) {
      const from = a[name], to = b[name], out = mixed[name] = new Float32Array(from.length);
      for (let k = 0; k < out.length; ++k) out[k] = from[k] + share * (to[k] - from[k]);
    }
    for (let k = 0; k < mixed.turn.length; k += 4) {  // the shorter way between two rotations
      let dot = 0, square = 0;
      for (let i = k; i < k + 4; ++i) dot += a.turn[i] * b.turn[i];
      for (let i = k; i < k + 4; ++i) mixed.turn[i] = a.turn[i] + share * ((dot < 0 ? -1 : 1) * b.turn[i] - a.turn[i]);
      for (let i = k; i < k + 4; ++i) square += mixed.turn[i] ** 2;
      for (let i = k; i < k + 4; ++i) mixed.turn[i] /= Math.sqrt(square) || 1;
    }
    return mixed;
  }

  /** Global coordinates of all points, 3 each, of the rows of a frame. */
  place(rows) {
    const out = new Float32Array(3 * this.points);
    for (const body of this.bodies) {
      let to = 3 * body.first;
      if (!body.rigid) {
        for (let k = body.slot; k < body.slot + body.count; ++k) {
          out[to++] = rows.x[k]; out[to++] = rows.y[k]; out[to++] = rows.z[k];
        }
        continue;
      }
      const r = turnMatrix(rows.turn, 4 * body.slot), {local} = this;
      const px = rows.px[body.slot], py = rows.py[body.slot], pz = rows.pz[body.slot];
      for (let k = body.local; k < body.local + 3 * body.count; k += 3) {
        const x = local[k], y = local[k + 1], z = local[k + 2];
        out[to++] = px + r[0] * x + r[1] * y + r[2] * z;
        out[to++] = py + r[3] * x + r[4] * y + r[5] * z;
        out[to++] = pz + r[6] * x + r[7] * y + r[8] * z;
      }
    }
    return out;
  }

  /** The point that stands for a node of a body; -1: there is none. Rigid bodies have their origin alone (no point). */
  pointOf(body, label) {
    for (let k = body.first; k < body.first + body.count; ++k) if (this.labels[k] === label) return k;
    return -1;
  }
}

/** The rotation of a quaternion x, y, z, w, row by row. */
function turnMatrix(q, k) {
  const x = q[k], y = q[k + 1], z = q[k + 2], w = q[k + 3];
  return [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
    2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)];
}

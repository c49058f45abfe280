// Shapes of modes and of responses, animated about the state that they belong to.
class Swings {
  constructor(film) {
    this.film = film;
    this.list = [];
    film.scene.swings.forEach(group => group.shapes.forEach(shape => this.list.push({group, ...shape})));
  }

  async load(k) {
    const shape = this.list[k], first = this.film.scene.shapes_from, count = this.film.points;
    if (shape.base) return shape;
    const block = await unpack(`piece${first + shape.group.piece}`), moves = await unpack(`piece${first + shape.piece}`);
    const planes = (bytes, ranges, part) => {
      const out = new Float32Array(3 * count), size = bytes.length / 2;
      for (let i = 0; i < 3; ++i) {
        const row = 3 * part + i, values = widen(bytes, 0, size, row * count, count, ranges[2 * row], ranges[2 * row + 1]);
        for (let p = 0; p < count; ++p) out[3 * p + i] = values[p];
      }
      return out;
    };
    shape.base = planes(block, shape.group.ranges, 0);
    shape.real = planes(moves, shape.ranges, 0);
    shape.quarter = shape.ranges.length > 6 ? planes(moves, shape.ranges, 1) : null;
    shape.most = 0;
    for (let p = 0; p < 3 * count; p += 3) {
      const size = part => part ? Math.hypot(part[p], part[p + 1], part[p + 2]) : 0;
      shape.most = Math.max(shape.most, size(shape.real), size(shape.quarter));
    }
    return shape;
  }

  /** Places and sizes of displacements at a phase; the largest is `reach` long. */
  static at(shape, phase, reach) {
    const scale = shape.most > 0 ? reach / shape.most : 0, c = scale * Math.cos(phase), s = scale * Math.sin(phase);
    const points = shape.base.slice(), sizes = new Float32Array(points.length / 3);
    for (let k = 0; k < points.length; ++k) points[k] += c * shape.real[k] + (shape.quarter ? s * shape.quarter[k] : 0);
    for (let p = 0; p < sizes.length; ++p) {
      const part = values => values ? Math.hypot(values[3 * p], values[3 * p + 1], values[3 * p + 2]) : 0;
      sizes[p] = Math.hypot(part(shape.real), part(shape.quarter));
    }
    return {points, sizes};
  }
}

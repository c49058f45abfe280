// The drawn surface: points are divided at sharp edges, so that round faces look round and edges stay edges.

/** Of each corner of each triangle, a drawn vertex; of each drawn vertex, its point. */
function dividedAtCreases(film) {
  const {triangles, points} = film, rest = film.rest, count = triangles.length / 3;
  const normal = new Float32Array(3 * count);
  const used = new Int32Array(points + 1);
  for (let t = 0; t < count; ++t) {
    const [a, b, c] = [3 * triangles[3 * t], 3 * triangles[3 * t + 1], 3 * triangles[3 * t + 2]];
    const ux = rest[b] - rest[a], uy = rest[b + 1] - rest[a + 1], uz = rest[b + 2] - rest[a + 2];
    const vx = rest[c] - rest[a], vy = rest[c + 1] - rest[a + 1], vz = rest[c + 2] - rest[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx, size = Math.hypot(x, y, z) || 1;
    normal.set([x / size, y / size, z / size], 3 * t);
    for (let i = 0; i < 3; ++i) ++used[triangles[3 * t + i] + 1];
  }
  for (let k = 0; k < points; ++k) used[k + 1] += used[k];
  const corners = new Int32Array(triangles.length), next = used.slice();
  for (let c = 0; c < triangles.length; ++c) corners[next[triangles[c]]++] = c;
  const vertex = new Uint32Array(triangles.length), pointOf = [], limit = Math.cos(35 * Math.PI / 180);
  for (let point = 0; point < points; ++point) {
    const groups = [];  // drawn vertices with a mean normal each
    for (let k = used[point]; k < used[point + 1]; ++k) {
      const c = corners[k], n = 3 * Math.floor(c / 3);
      let group = groups.find(g => (g.x * normal[n] + g.y * normal[n + 1] + g.z * normal[n + 2]) > limit * (Math.hypot(g.x, g.y, g.z) || 1));
      if (!group) {
        group = {number: pointOf.length, x: 0, y: 0, z: 0};
        pointOf.push(point);
        groups.push(group);
      }
      group.x += normal[n]; group.y += normal[n + 1]; group.z += normal[n + 2];
      vertex[c] = group.number;
    }
  }
  return {vertex, pointOf: Uint32Array.from(pointOf)};
}

/** Normals of drawn vertices for their places now. */
function renewNormals(vertex, position, normal) {
  normal.fill(0);
  for (let t = 0; t < vertex.length; t += 3) {
    const a = 3 * vertex[t], b = 3 * vertex[t + 1], c = 3 * vertex[t + 2];
    const ux = position[b] - position[a], uy = position[b + 1] - position[a + 1], uz = position[b + 2] - position[a + 2];
    const vx = position[c] - position[a], vy = position[c + 1] - position[a + 1], vz = position[c + 2] - position[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const k of [a, b, c]) { normal[k] += x; normal[k + 1] += y; normal[k + 2] += z; }
  }
  for (let k = 0; k < normal.length; k += 3) {
    const size = Math.hypot(normal[k], normal[k + 1], normal[k + 2]) || 1;
    normal[k] /= size; normal[k + 1] /= size; normal[k + 2] /= size;
  }
}

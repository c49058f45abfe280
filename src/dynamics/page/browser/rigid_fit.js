// The rigid motion that comes nearest to how points have moved: what is left of it is deformation.

/** Of points `first` to `first + count` of `from`, at those of `to`: where each of them would be without deformation. */
function rigidFit(from, to, first, count) {
  const out = new Float32Array(3 * count), a = [0, 0, 0], b = [0, 0, 0];
  for (let k = 0; k < 3 * count; ++k) { a[k % 3] += from[3 * first + k] / count; b[k % 3] += to[3 * first + k] / count; }
  const m = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];  // sum of (to - b) (from - a)^T
  const stride = Math.max(1, Math.floor(count / 2000));
  for (let k = first; k < first + count; k += stride)
    for (let i = 0; i < 3; ++i) for (let j = 0; j < 3; ++j) m[i][j] += (to[3 * k + i] - b[i]) * (from[3 * k + j] - a[j]);
  const r = turnMatrix(nearestTurn(m), 0);
  for (let k = 0; k < count; ++k)
    for (let i = 0; i < 3; ++i) {
      let x = b[i];
      for (let j = 0; j < 3; ++j) x += r[3 * i + j] * (from[3 * (first + k) + j] - a[j]);
      out[3 * k + i] = x;
    }
  return out;
}

/** Horn's quaternion (J. Opt. Soc. Am. A 4, 1987) of a matrix of products: the largest eigenvector of a 4 x 4 matrix. */
function nearestTurn(m) {
  const n = [[m[0][0] + m[1][1] + m[2][2], m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
    [0, m[0][0] - m[1][1] - m[2][2], m[0][1] + m[1][0], m[0][2] + m[2][0]],
    [0, 0, m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1]], [0, 0, 0, m[2][2] - m[0][0] - m[1][1]]];
  const v = [0, 1, 2, 3].map(i => [0, 1, 2, 3].map(j => i === j ? 1 : 0));
  for (let i = 0; i < 4; ++i) for (let j = 0; j < i; ++j) n[i][j] = n[j][i];
  for (let sweep = 0; sweep < 24; ++sweep)  // Jacobi's method
    for (let p = 0; p < 3; ++p)
      for (let q = p + 1; q < 4; ++q) {
        if (Math.abs(n[p][q]) < 1e-300) continue;
        const theta = (n[q][q] - n[p][p]) / (2 * n[p][q]);
        const t = Math.sign(theta || 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1)), c = 1 / Math.sqrt(t * t + 1), s = t * c;
        for (let k = 0; k < 4; ++k) { const x = n[k][p], y = n[k][q]; n[k][p] = c * x - s * y; n[k][q] = s * x + c * y; }
        for (let k = 0; k < 4; ++k) { const x = n[p][k], y = n[q][k]; n[p][k] = c * x - s * y; n[q][k] = s * x + c * y; }
        for (let k = 0; k < 4; ++k) { const x = v[k][p], y = v[k][q]; v[k][p] = c * x - s * y; v[k][q] = s * x + c * y; }
      }
  let best = 0;
  for (let k = 1; k < 4; ++k) if (n[k][k] > n[best][best]) best = k;
  return [v[1][best], v[2][best], v[3][best], v[0][best]];
}

// Amplitudes over frequency of a quantity: even times by interpolation, Hann's window, fast Fourier transform.
function spectrum(t, y) {
  const good = [];
  for (let k = 0; k < t.length; ++k) if (Number.isFinite(y[k]) && (good.length === 0 || t[k] > t[good[good.length - 1]])) good.push(k);
  if (good.length < 4) return {frequency: [], amplitude: []};
  let n = 8;
  while (n < 2 * good.length && n < 32768) n *= 2;
  const begin = t[good[0]], span = t[good[good.length - 1]] - begin, re = new Float64Array(n), im = new Float64Array(n);
  let mean = 0;
  for (let k = 0, low = 0; k < n; ++k) {
    const at = begin + span * k / n;
    while (low + 2 < good.length && t[good[low + 1]] <= at) ++low;
    const a = good[low], b = good[low + 1];
    re[k] = y[a] + (y[b] - y[a]) * (at - t[a]) / (t[b] - t[a]);
    mean += re[k] / n;
  }
  for (let k = 0; k < n; ++k) re[k] = (re[k] - mean) * (1 - Math.cos(2 * Math.PI * k / n));  // 2 x Hann: a sine keeps its amplitude
  transform(re, im);
  const frequency = [], amplitude = [], most = Math.min(n / 2, Math.ceil(good.length / 2));
  for (let k = 1; k < most; ++k) {
    frequency.push(k / span);
    amplitude.push(2 * Math.hypot(re[k], im[k]) / n);
  }
  return {frequency, amplitude};
}

/** In place; the length is a power of two. */
function transform(re, im) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; ++i) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) { [re[i], re[j]] = [re[j], re[i]]; [im[i], im[j]] = [im[j], im[i]]; }
  }
  for (let size = 2; size <= n; size *= 2)
    for (let k = 0; k < size / 2; ++k) {
      const c = Math.cos(-2 * Math.PI * k / size), s = Math.sin(-2 * Math.PI * k / size);
      for (let i = k; i < n; i += size) {
        const j = i + size / 2, x = c * re[j] - s * im[j], y = c * im[j] + s * re[j];
        re[j] = re[i] - x; im[j] = im[i] - y;
        re[i] += x; im[i] += y;
      }
    }
}

// What colours stand for: a number at each point, its range, and where it is largest.
const kFields = {
  bodies: {name: 'bodies'},
  displacement: {name: 'displacement', dimension: 'length'},
  deformation: {name: 'deformation', dimension: 'length'},
  speed: {name: 'velocity', dimension: 'length/time'},
  von_mises: {name: 'von Mises stress', dimension: 'force/length\u00b2'},
  principal: {name: 'principal stress', dimension: 'force/length\u00b2', signed: true},
  strain: {name: 'principal strain', dimension: '1', signed: true},
};

/** Fields that a film has. */
function fieldsOf(film, statics) {
  const stress = film.scene.sections.find(([name]) => name === 'von_mises')[1] > 0;
  const names = ['bodies', 'displacement'];
  if (film.bodies.some(body => !body.rigid)) names.push('deformation');
  if (!statics) names.push('speed');
  if (stress) names.push('von_mises', 'principal', 'strain');
  return names;
}

/** Deformed places where deformation alone is made larger; of statics, all of the displacement is. */
function exaggerated(film, points, factor, statics) {
  if (factor === 1) return points;
  const out = points.slice();
  for (const body of film.bodies) {
    if (body.rigid && !statics) continue;
    const base = statics ? film.rest.subarray(3 * body.first) : rigidFit(film.rest, points, body.first, body.count);
    for (let k = 0; k < 3 * body.count; ++k) out[3 * body.first + k] = base[k] + factor * (points[3 * body.first + k] - base[k]);
  }
  return out;
}

function fieldValues(film, name, rows, points) {
  const out = new Float32Array(film.points);
  const length = (a, ka, b, kb) => Math.hypot(a[ka] - b[kb], a[ka + 1] - b[kb + 1], a[ka + 2] - b[kb + 2]);
  for (const body of film.bodies) {
    const fit = name === 'deformation' && !body.rigid ? rigidFit(film.rest, points, body.first, body.count) : null;
    for (let k = 0; k < body.count; ++k) {
      const point = body.first + k;
      if (name === 'displacement') out[point] = length(points, 3 * point, film.rest, 3 * point);
      else if (name === 'deformation') out[point] = fit ? length(points, 3 * point, fit, 3 * k) : NaN;
      else if (!body.rigid) out[point] = (rows[name] || [])[body.slot + k];
      else if (name === 'speed') out[point] = rigidSpeed(rows, body, points, point);
      else out[point] = NaN;
    }
  }
  return out;
}

function rigidSpeed(rows, body, points, point) {
  const k = 3 * body.slot, w = rows.omega, v = rows.velocity;
  const x = points[3 * point] - rows.px[body.slot], y = points[3 * point + 1] - rows.py[body.slot], z = points[3 * point + 2] - rows.pz[body.slot];
  return Math.hypot(v[k] + w[k + 1] * z - w[k + 2] * y, v[k + 1] + w[k + 2] * x - w[k] * z, v[k + 2] + w[k] * y - w[k + 1] * x);
}

/** Lowest and highest number; `at`: the point of the largest magnitude. */
function extremes(values) {
  let low = Infinity, high = -Infinity, at = -1, most = -1;
  for (let k = 0; k < values.length; ++k) {
    const x = values[k];
    if (!Number.isFinite(x)) continue;
    if (x < low) low = x;
    if (x > high) high = x;
    if (Math.abs(x) > most) { most = Math.abs(x); at = k; }
  }
  return {low, high, at};
}

/** Over the run: of some of very many frames. @returns {low, high, at, t} or null where there is no number */
async function extremesOfRun(film, name) {
  let all = null;
  const stride = Math.ceil(film.frames.length / Math.max(2, Math.min(400, Math.floor(1e7 / (film.points + 1)))));
  for (let k = 0; k < film.frames.length; k += stride) {
    const index = k + stride >= film.frames.length ? film.frames.length - 1 : k, rows = await film.frame(index);
    const {low, high, at} = extremes(fieldValues(film, name, rows, film.place(rows)));
    if (at < 0) continue;
    if (!all || Math.max(-low, high) > Math.max(-all.low, all.high)) {
      all = {at, t: rows.t, low: Math.min(low, all ? all.low : low), high: Math.max(high, all ? all.high : high)};
    } else {
      all.low = Math.min(low, all.low);
      all.high = Math.max(high, all.high);
    }
  }
  return all;
}

// Begins when the page is there. `window.espalier` is for programs that look at it (docs/design/page.md).
function setTheme(theme, app) {
  document.documentElement.dataset.theme = theme;
  byId('theme').textContent = theme === 'dark' ? 'Light' : 'Dark';
  if (!app) return;
  if (app.stage) app.ground();
  app.plots.forEach(plot => plot.draw());
}

function showHead(data) {
  const s = data.summary, title = s.title || data.model.name || 'Espalier';
  const words = {ok: ['done', 'good'], interrupted: ['stopped', 'warn']}, [text, tone] = data.running ? ['running', 'warn'] : words[s.status] || [s.status.replace(/_/g, ' '), 'bad'];
  document.title = title;
  byId('title').textContent = title;
  byId('state').textContent = text;
  byId('state').classList.add(tone);
  byId('facts').textContent = `${s.method}, ${grouped(s.bodies)} ${s.bodies === 1 ? 'body' : 'bodies'}, ${grouped(s.velocities + s.constraints)} unknowns, ${grouped(s.steps)} steps`;
  byId('version').textContent = data.espalier;
  if (s.message) { byId('trouble').hidden = false; byId('trouble').textContent = s.message; }
}

/** For tests and other programs: everything is in the units of the model. */
function publish(app) {
  const {film, series, timeline} = app, bodyNamed = name => {
    const body = film.bodies.find(b => b.name === name);
    if (!body) throw new Error(`there is no body '${name}'`);
    return body;
  };
  window.espalier.times = film.times;
  window.espalier.bodies = film.bodies.map(body => body.name);
  window.espalier.quantities = series.names;
  window.espalier.quantity = name => ({t: [...series.t], values: [...series.get(name)]});
  window.espalier.time = () => timeline.t;
  window.espalier.setTime = t => app.moveTo(t);
  window.espalier.position = (name, node) => {  // of a node, or the origin of a rigid body
    const body = bodyNamed(name);
    if (body.rigid && node === undefined) return app.rows ? [app.rows.px[body.slot], app.rows.py[body.slot], app.rows.pz[body.slot]] : null;
    const point = film.pointOf(body, node);
    return point < 0 ? null : [0, 1, 2].map(i => app.pure[3 * point + i]);
  };
  window.espalier.nodes = name => { const body = bodyNamed(name); return [...film.labels.subarray(body.first, body.first + body.count)]; };
  window.espalier.pick = (name, node) => { app.pick(film.pointOf(bodyNamed(name), node)); return byId('picked').textContent; };
  window.espalier.select = async (id, value) => { byId(id).value = value; byId(id).dispatchEvent(new Event('change')); await app.work; };
  window.espalier.mark = name => {
    const k = app.data.scene.marks.findIndex(mark => mark.name === name), three = section => [...app.rows[section].subarray(3 * k, 3 * k + 3)];
    return k < 0 || !app.rows ? null : {at: three('b'), force: three('force'), moment: three('moment')};
  };
  window.espalier.pixels = () => countPixels(app.stage);
}

/** How many pixels of the canvas are drawn, and how many colours they have. */
function countPixels(stage) {
  if (!stage) return {drawn: 0, colours: 0};
  stage.draw();
  const gl = stage.renderer.getContext(), {drawingBufferWidth: width, drawingBufferHeight: height} = gl, data = new Uint8Array(4 * width * height), seen = new Set();
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, data);
  let drawn = 0;
  for (let k = 0; k < data.length; k += 4) if (data[k + 3] > 0) { ++drawn; seen.add(data[k] << 16 | data[k + 1] << 8 | data[k + 2]); }
  return {drawn, colours: seen.size, width, height};
}

async function start() {
  const errors = [];
  window.addEventListener('error', event => errors.push(String(event.message)));
  window.addEventListener('unhandledrejection', event => errors.push(String(event.reason)));
  const data = JSON.parse(byId('data').textContent);
  const app = new App(data);
  setTheme(remembered().theme || (matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light'));
  showHead(data);
  byId('theme').addEventListener('click', () => { setTheme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark', app); remember(app); });
  if (typeof DecompressionStream === 'undefined') {
    app.trouble('This browser is too old to unpack the page: Chromium 80, Firefox 113 and Safari 16.4 can, and later ones.');
    throw new Error('no DecompressionStream');
  }
  await app.start();
  listenToKeys(app);
  publish(app);
  follow(app, data);
  return errors;
}

window.espalier = {errors: [], ready: null};
window.espalier.ready = new Promise((resolve, reject) => document.addEventListener('DOMContentLoaded', () => start().then(errors => {
  window.espalier.errors = errors;
  resolve(true);
}, error => {
  byId('trouble').hidden = false;
  byId('trouble').textContent = `The page could not be shown: ${error.message}`;
  console.error(error);
  reject(error);
})));

// What the parts of the page have in common: the time and the field that are shown.
class App {
  constructor(data) {
    Object.assign(this, {data, plots: [], errors: [], colours: null, picked: -1, statics: data.summary.method.endsWith('statics')});
  }

  swinging() { return this.swing !== undefined; }

  async start() {
    const {data} = this, memory = remembered();
    this.series = new Series(data.plots, new Float64Array((await unpack('rows')).buffer));
    this.film = new Film(data.scene);
    await this.film.load();
    this.swings = new Swings(this.film);
    this.timeline = new Timeline(this, this.film.times, this.statics);
    const drawn = await loadLibraries();
    if (!drawn) this.trouble('This build of Espalier has neither scene nor plots: install libjs-three and libjs-dygraphs, and build it again.');
    if (drawn) await this.startStage();
    this.say();
    if (drawn) this.startPlots(memory);
    buildSummary(data, this.series, this);
    if (memory.field && [...byId('field').options].some(o => o.value === memory.field)) byId('field').value = memory.field;
    if (this.stage) await this.chooseField();
    const last = memory.last || (this.statics && memory.t === undefined);  // an equilibrium is looked at under its load
    await this.timeline.show(last && this.timeline.times.length ? this.timeline.last : memory.t === undefined ? this.timeline.where() : memory.t);
    if (memory.camera && this.stage) this.recall(memory);
  }

  recall(memory) {
    const {stage} = this, scale = stage.size / (memory.size || stage.size);
    stage.camera.position.fromArray(memory.camera).multiplyScalar(scale);
    stage.controls.target.fromArray(memory.target).multiplyScalar(scale);
    stage.controls.update();
    for (const name of memory.hidden || []) stage.hidden.add(this.film.bodies.findIndex(body => body.name === name));
    stage.indexBodies();
    window.scrollTo(0, memory.scroll || 0);
  }

  trouble(text) {
    byId('trouble').hidden = false;
    byId('trouble').textContent = text;
  }

  async startStage() {
    try {
      this.stage = new Stage(byId('canvas'), this.film, this.data.gravity);
    } catch (error) {
      this.trouble(`The scene cannot be drawn, since this browser has no WebGL (${error.message}). Plots and summary are below.`);
      byId('stage').hidden = document.querySelector('#scene .tools').hidden = true;
      return;
    }
    const {stage, film} = this;
    await stage.measure();
    stage.build();
    this.marks = new Marks(stage, film, this.data.scene.marks);
    stage.ondraw = () => drawTriad(byId('triad'), stage);
    this.ground();
    connectStage(this);
  }

  ground() {
    const style = getComputedStyle(document.documentElement);
    buildGround(this.stage, this.data.scene.ground, new THREE.Color(style.getPropertyValue('--grid').trim()));
    this.stage.lines.material.color.set(style.getPropertyValue('--edge').trim());
  }

  startPlots(memory) {
    const options = {abscissa: this.statics ? 'load factor' : 'time', events: this.data.summary.events, moveTo: t => this.moveTo(t), time: () => this.timeline.t,
      remove: plot => { this.plots = this.plots.filter(other => other !== plot); plot.box.remove(); }};
    const add = (names, series = this.series, more = {}) => { const plot = new Plot(series, names, {...options, ...more}); byId('plot-list').append(plot.box); this.plots.push(plot); plot.draw(); };
    const {names} = this.series;
    if (this.data.response) {
      const response = responseSeries(this.data.response), shown = kind => response.names.filter(name => name.startsWith(kind)).slice(0, 6);
      const more = {abscissa: 'frequency', response: true, events: [], moveTo: () => {}, time: () => NaN};
      add(shown('amplitude'), response, {...more, logY: true});
      add(shown('phase'), response, more);
    }
    for (const path of this.data.paths || []) {
      const series = pathSeries(path), more = {abscissa: 'length', response: true, events: [], moveTo: () => {}, time: () => NaN};
      for (const kind of ['stress', 'strain', 'section']) {
        const shown = series.names.filter((_, k) => path.quantities[k].startsWith(kind)).slice(0, 6);
        if (shown.length) add(shown, series, more);
      }
    }
    if (names.length === 0 && !this.data.response && !this.data.paths) byId('plot-list').replaceChildren(element('p', {class: 'quiet', style: 'padding:10px'}, 'No quantities were kept; [output] quantities = ["BODY.position"] chooses some.'));
    else (memory.plots || this.series.suggestions().slice(0, 3)).forEach(shown => add(shown));
    byId('add-plot').addEventListener('click', () => add([]));
    byId('add-plot').disabled = names.length === 0;
    new ResizeObserver(() => this.plots.forEach(plot => plot.graph && plot.graph.resize())).observe(byId('plot-list'));
  }

  say() {
    const {scene, plots} = this.data, said = [];
    if (scene.coarse) said.push('Surfaces of large bodies are drawn without their mid-side nodes.');
    if (scene.fewer) said.push(`The model is so large that the page holds ${scene.frames.length} pictures.`);
    if (scene.frames.length === 0) said.push('There are no pictures: the bodies are shown at the start.');
    if (plots.stride > 1) said.push(`Plots have every ${plots.stride}th row of the quantities.`);
    byId('said').textContent = said.join(' ');
  }

  /** A time of the run, from wherever. */
  moveTo(t) {
    if (!Number.isFinite(t)) return;
    if (this.swinging()) { byId('motion').value = ''; this.chooseMotion(); }
    this.timeline.stop();
    if (!this.timeline.even) return this.timeline.show(t);
    const times = this.timeline.times, nearest = times.reduce((best, x, k) => Math.abs(x - t) < Math.abs(times[best] - t) ? k : best, 0);
    return this.timeline.show(nearest);
  }

  async chooseField() {
    const name = byId('field').value || 'bodies', ask = this.asked = {};
    this.colours = null;
    if (name !== 'bodies' && !this.swinging()) {
      const range = await extremesOfRun(this.film, name);
      if (this.asked !== ask) return;
      if (range) this.colours = {name, ...range};
    }
    await this.redraw();
  }

  async chooseMotion() {
    const value = byId('motion').value;
    this.swing = value === '' ? undefined : await this.swings.load(Number(value));
    byId('slider').disabled = this.swinging() || this.film.times.length < 2;
    byId('field').disabled = this.swinging();
    if (this.swinging()) { await this.showPhase(this.timeline.phase = 0); this.timeline.play(); }
    else { this.timeline.stop(); await this.timeline.show(this.timeline.where()); }
  }

  showSwing(name) {
    const k = this.swings.list.findIndex(shape => shape.name === name);
    if (k < 0) return;
    byId('motion').value = String(k);
    byId('scene').scrollIntoView();
    return this.chooseMotion();
  }

  async showTime(t, number) {
    const rows = this.film.frames.length === 0 ? null : number === undefined ? await this.film.at(t) : await this.film.frame(number);
    this.rows = rows;
    this.pure = rows ? this.film.place(rows) : this.film.rest;
    if (this.stage && rows) this.stage.setTime(rows.t);
    await this.redraw();
    this.plots.forEach(plot => plot.moveNeedle(t));
    byId('canvas').setAttribute('aria-label', this.spoken(t));
    this.tellPicked();
  }

  async showPhase(phase) {
    const reach = 0.08 * this.stage.size * (Number(byId('factor').value) || 1), {points, sizes} = Swings.at(this.swing, phase, reach);
    const share = sizes.map(x => this.swing.most > 0 ? x / this.swing.most : 0);
    this.stage.show(points, {row: 'plain', share});
    for (const {mesh} of this.marks.glyphs) mesh.visible = false;
    for (const {shaft, head} of this.marks.arrows) shaft.visible = head.visible = false;
    this.marks.springs.visible = false;
    byId('legend').hidden = byId('picked').hidden = true;
    byId('now').textContent = this.swing.frequency > 0 ? `f = ${shortNumber(this.swing.frequency, 5)}` : this.swing.name;
  }

  async redraw() {
    if (!this.stage || !this.pure || this.swinging()) return;
    const factor = Number(byId('factor').value), shown = exaggerated(this.film, this.pure, Number.isFinite(factor) ? factor : 1, this.statics);
    let colours = null;
    if (this.colours && this.rows) {
      const values = fieldValues(this.film, this.colours.name, this.rows, this.pure), now = extremes(values), {signed} = kFields[this.colours.name];
      let {low, high} = byId('range').value === 'now' && now.at >= 0 ? now : this.colours;
      if (!signed) low = Math.min(low, 0);
      else { high = Math.max(Math.abs(low), Math.abs(high)); low = -high; }
      const span = high - low || 1;
      colours = {row: signed ? 'signed' : 'plain', share: values.map(x => (x - low) / span)};
      this.values = values;
      showLegend(this, {low, high, signed});
    } else {
      this.values = null;
      byId('legend').hidden = true;
    }
    this.stage.show(shown, colours);
    this.shown = shown;
    if (this.rows) this.marks.show(this.rows);
  }

  spoken(t) {
    const names = this.film.bodies.slice(0, 12).map(body => body.name).join(', ');
    return `Scene of ${this.film.bodies.length} bodies (${names}${this.film.bodies.length > 12 ? ' and others' : ''}) at ${this.statics ? 'load factor' : 'time'} ${shortNumber(t, 5)}`;
  }

  viewFrom(side) { if (this.stage) this.stage.viewFrom(side); }
  zoom(factor) {
    if (!this.stage) return;
    const {camera, controls} = this.stage;
    camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
    controls.update();
    this.stage.touch();
  }
  turn(across, up) {
    if (!this.stage) return;
    const {camera, controls, up: axis} = this.stage, arm = camera.position.clone().sub(controls.target);
    arm.applyAxisAngle(axis, across);
    const side = axis.clone().cross(arm).normalize(), tilted = arm.clone().applyAxisAngle(side, up);
    if (Math.abs(tilted.clone().normalize().dot(axis)) < 0.995) arm.copy(tilted);
    camera.position.copy(controls.target).add(arm);
    controls.update();
    this.stage.touch();
  }

  forget() { this.picked = -1; this.pickedMark = null; byId('picked').hidden = true; }
  pick(point) { this.picked = point; this.pickedMark = null; this.tellPicked(); }

  /** What is known of the picked point or mark now. */
  tellPicked() {
    const box = byId('picked'), three = (values, k) => [0, 1, 2].map(i => shortNumber(values[3 * k + i], 6)).join(', ');
    if (this.pickedMark !== null && this.pickedMark !== undefined && this.rows) {
      const mark = this.data.scene.marks[this.pickedMark], size = name => Math.hypot(...[0, 1, 2].map(i => this.rows[name][3 * this.pickedMark + i]));
      box.textContent = [`${mark.name}: ${mark.kind}${mark.between.length ? `, ${mark.between.join(' and ')}` : ''}`, `at ${three(this.rows.b, this.pickedMark)}`,
        `force ${shortNumber(size('force'))}: ${three(this.rows.force, this.pickedMark)}`, `moment ${shortNumber(size('moment'))}: ${three(this.rows.moment, this.pickedMark)}`].join('\n');
      box.hidden = false;
      return;
    }
    if (this.picked < 0 || !this.pure) { box.hidden = true; return; }
    const point = this.picked, body = this.film.bodies[this.film.bodyOf[point]], label = this.film.labels[point];
    const lines = [`${body.name}: ${body.kind}`, `${label ? `node ${label} ` : ''}at ${three(this.pure, point)}`];
    if (this.rows && !this.swinging())
      for (const name of fieldsOf(this.film, this.statics)) {
        if (name === 'bodies' || (body.rigid && name !== 'displacement' && name !== 'speed')) continue;
        const x = name === this.colours?.name && this.values ? this.values[point] : name === 'deformation' ? undefined : fieldAt(this.film, name, this.rows, this.pure, point);
        if (Number.isFinite(x)) lines.push(`${kFields[name].name} ${shortNumber(x, 5)}`);
      }
    box.textContent = lines.join('\n');
    box.hidden = false;
  }
}

function fieldAt(film, name, rows, points, point) {
  const body = film.bodies[film.bodyOf[point]];
  if (name === 'displacement') return Math.hypot(...[0, 1, 2].map(i => points[3 * point + i] - film.rest[3 * point + i]));
  if (body.rigid) return name === 'speed' ? rigidSpeed(rows, body, points, point) : NaN;
  return rows[name][body.slot + point - body.first];
}

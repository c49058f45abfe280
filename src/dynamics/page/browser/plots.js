// Plots of quantities: against time, one another, or frequency.
const lineColour = k => getComputedStyle(document.documentElement).getPropertyValue(`--s${k % 8 + 1}`).trim();  // base.css

class Series {
  constructor(info, numbers) {
    Object.assign(this, {names: info.names, dimensions: info.dimensions});
    this.rows = info.names.length >= 0 ? Math.floor(numbers.length / (info.names.length + 1)) : 0;
    this.t = numbers.subarray(0, this.rows);
    this.columns = new Map(info.names.map((name, k) => [name, numbers.subarray((k + 1) * this.rows, (k + 2) * this.rows)]));
  }
  get(name) { return this.columns.get(name); }
  dimension(name) { return this.dimensions[this.names.indexOf(name)] || ''; }

  /** Names that stand well in one plot: of the same object and dimension, what was asked for first. */
  suggestions() {
    const groups = new Map();
    for (const name of this.names) {
      if (/^step\./.test(name)) continue;
      const key = `${/^constraints\./.test(name) ? 2 : /^energy\./.test(name) ? 1 : 0} ${name.replace(/\.[^.]*$/, '')} ${this.dimension(name)}`;
      groups.set(key, [...groups.get(key) || [], name]);
    }
    return [...groups.entries()].sort((a, b) => a[0][0] - b[0][0]).map(([, names]) => names.slice(0, 6));
  }
}

/** Amplitudes and phases of a frequency response, over frequencies. */
function responseSeries(response) {
  const numbers = [...response.frequencies, ...response.columns].map(x => x === null ? NaN : x);
  return new Series({names: response.names, dimensions: response.names.map(name => name.startsWith('phase') ? 'degrees' : '')}, Float64Array.from(numbers));
}

/** Values along a path through a body, over its length. */
function pathSeries(path) {
  const numbers = [...path.length, ...path.values].map(x => x === null ? NaN : x), name = quantity => `${path.body} ${quantity}, ${path.name}`;
  return new Series({names: path.quantities.map(name), dimensions: path.quantities.map(quantity => /^stress/.test(quantity) ? 'force/length\u00b2' : '')}, Float64Array.from(numbers));
}

class Plot {
  constructor(series, names, options) {
    Object.assign(this, {series, names, options, against: 't', logX: false, logY: Boolean(options.logY), steps: false});
    this.build();  // draw() follows when it stands in the page
  }

  build() {
    const {series, options} = this;
    const option = (value, text) => element('option', {value}, text);
    this.box = element('div', {class: 'plot'});
    this.picker = element('div', {class: 'pick'});
    const filter = element('input', {type: 'search', placeholder: 'filter', 'aria-label': 'Filter quantities', oninput: () => this.fillPicker(filter.value)});
    this.menu = element('details', {class: 'menu'}, element('summary', {}, 'Quantities'), element('div', {}, filter, this.picker));
    this.axis = element('select', {'aria-label': 'Horizontal axis', onchange: () => { this.against = this.axis.value; this.draw(); }},
      option('t', `against ${options.abscissa}`), ...(options.response ? [] : [option('frequency', 'spectrum')]),
      ...series.names.map(name => option(`q:${name}`, `against ${name}`)));
    const box = (text, key) => element('label', {}, element('input', {type: 'checkbox', checked: this[key], onchange: event => { this[key] = event.target.checked; this.draw(); }}), ` ${text}`);
    this.values = element('div', {class: 'values'});
    this.chart = element('div', {class: 'chart', role: 'img'});
    this.needle = element('div', {class: 'needle', hidden: true});
    this.holder = element('div', {style: 'position:relative'}, this.chart, this.needle);
    this.box.append(element('div', {class: 'tools'}, this.menu, this.axis, box('log y', 'logY'), box('log x', 'logX'), box('steps', 'steps'),
      element('span', {class: 'grow'}), element('button', {type: 'button', title: 'All of it (double click)', onclick: () => this.whole()}, 'Whole'),
      element('button', {type: 'button', 'aria-label': 'Remove this plot', onclick: () => options.remove(this)}, '\u00d7')), this.holder, this.values);
    this.fillPicker('');
  }

  fillPicker(filter) {
    const words = filter.toLowerCase().split(/\s+/).filter(Boolean);
    const shown = this.series.names.filter(name => words.every(word => name.toLowerCase().includes(word)));
    this.picker.replaceChildren(...shown.slice(0, 400).map(name => element('div', {}, element('label', {}, element('input', {type: 'checkbox',
      checked: this.names.includes(name), onchange: event => {
        this.names = event.target.checked ? [...this.names, name] : this.names.filter(other => other !== name);
        this.draw();
      }}), ` ${name}`))), ...(shown.length > 400 ? [element('div', {class: 'quiet'}, `and ${shown.length - 400} more: filter`)] : []));
  }

  /** Rows of [x, y, y, ...]. */
  data() {
    const {series, names, against} = this, columns = names.map(name => series.get(name));
    if (against === 'frequency') {
      const made = columns.map(column => spectrum(series.t, column)), longest = made.reduce((a, b) => b.frequency.length > a.length ? b.frequency : a, []);
      return longest.map((f, k) => [f, ...made.map(s => s.amplitude[k] === undefined ? null : s.amplitude[k])]);
    }
    const x = against === 't' ? series.t : series.get(against.slice(2)), rows = [];
    for (let k = 0; k < series.rows; ++k) if (Number.isFinite(x[k])) rows.push([x[k], ...columns.map(column => Number.isFinite(column[k]) ? column[k] : NaN)]);
    return rows;
  }

  label() {
    const found = [...new Set(this.names.map(name => this.series.dimension(name)))];
    return found.length === 1 && found[0] ? `[${found[0]}]` : '';
  }

  draw() {
    if (this.graph) { this.graph.destroy(); this.graph = null; }
    const rows = this.names.length ? this.data() : [], dark = document.documentElement.dataset.theme === 'dark';
    this.rows = rows;
    this.needle.hidden = true;
    this.values.textContent = '';
    this.describe();
    if (rows.length === 0) {
      this.chart.replaceChildren(element('p', {class: 'quiet'}, this.names.length ? 'There is nothing to draw.' : 'Choose quantities.'));
      return;
    }
    this.chart.replaceChildren();
    const positive = rows.every(row => row[0] > 0), line = dark ? '#4a525d' : '#d0d5dc';
    const x = this.against === 't' ? this.options.abscissa : this.against === 'frequency' ? 'cycles per unit of time' : this.against.slice(2);
    const {low, high} = extremes(rows.map(row => row[0])), rim = 0.02 * (high - low || Math.abs(high) || 1);
    this.window = this.against.startsWith('q:') ? [low - rim, high + rim] : null;  // rows are not in the order of x there
    this.graph = new Dygraph(this.chart, rows, {
      labels: ['x', ...this.names], colors: this.names.map((_, k) => lineColour(k)), legend: 'never', strokeWidth: 1.6,
      xlabel: x, ylabel: this.label(), yLabelWidth: 16, xLabelHeight: 16, drawPoints: this.steps, pointSize: 2.4, highlightCircleSize: 3.5, logscale: this.logY, dateWindow: this.window,
      gridLineColor: line, axisLineColor: line, digitsAfterDecimal: 4, labelsKMB: false, connectSeparatedPoints: true,
      axes: {x: {logscale: this.logX && positive, axisLabelFormatter: value => shortNumber(value, 3), valueFormatter: value => shortNumber(value, 6)},
        y: {axisLabelFormatter: value => shortNumber(value, 3), axisLabelWidth: 58}},
      highlightCallback: (event, place, points, row) => this.tell(row),
      unhighlightCallback: () => { this.values.textContent = ''; },
      clickCallback: (event, place) => { if (this.against === 't') this.options.moveTo(place); else if (this.pointed !== undefined) this.options.moveTo(this.series.t[this.pointed]); },
      underlayCallback: (context, area, graph) => this.markEvents(context, area, graph, dark),
      drawCallback: () => this.moveNeedle(this.options.time()),
    });
    this.moveNeedle(this.options.time());
  }

  whole() {
    if (!this.graph) return;
    if (this.window) this.graph.updateOptions({dateWindow: this.window, valueRange: null}); else this.graph.resetZoom();
  }

  /** The row under the cursor. */
  tell(row) {
    const at = this.rows[row];
    if (!at) return;
    this.pointed = this.against.startsWith('q:') ? row : undefined;
    const x = this.against === 't' ? this.options.abscissa[0] : this.against === 'frequency' ? 'f' : this.against.slice(2);
    this.values.textContent = `${x} = ${shortNumber(at[0], 6)}; ${this.names.map((name, k) => `${name} = ${shortNumber(at[k + 1], 6)}`).join(', ')}`;
  }

  markEvents(context, area, graph, dark) {
    if (this.against !== 't') return;
    context.save();
    context.strokeStyle = context.fillStyle = dark ? '#f0b64a' : '#8a5a00';
    context.setLineDash([4, 4]);
    context.font = '11px system-ui, sans-serif';
    this.options.events.slice(0, 200).forEach(({name, t}, k) => {
      const x = graph.toDomXCoord(t);
      if (x < area.x || x > area.x + area.w) return;
      context.beginPath();
      context.moveTo(x, area.y);
      context.lineTo(x, area.y + area.h);
      context.stroke();
      if (this.options.events.length < 40) context.fillText(name, x + 3, area.y + 11 + 12 * (k % 4));
    });
    context.restore();
  }

  moveNeedle(t) {
    const shown = this.graph && this.against === 't';
    const x = shown ? this.graph.toDomXCoord(t) : 0, area = shown ? this.graph.getArea() : null;
    this.needle.hidden = !shown || !(x >= area.x - 1 && x <= area.x + area.w + 1);
    this.needle.style.left = `${x}px`;
    this.needle.style.bottom = area ? `${Math.max(0, this.chart.clientHeight - area.y - area.h)}px` : '0';
  }

  /** For those who do not see it. */
  describe() {
    const parts = this.names.map(name => {
      const column = this.series.get(name), {low, high} = extremes(column);
      return `${name} from ${shortNumber(column[0])} to ${shortNumber(column[column.length - 1])}, least ${shortNumber(low)}, greatest ${shortNumber(high)}`;
    });
    this.chart.setAttribute('aria-label', `Plot of ${parts.join('; ') || 'nothing'}`);
  }
}

// A small plot as SVG: lines, dots or bars, log axes, values under the pointer, zoom by dragging.
const hues = [211, 24, 140, 330, 265, 48, 185, 0];
const colourOf = k => `hsl(${hues[k % hues.length]} 75% ${document.documentElement.dataset.theme === 'dark' ? 66 : 42}%)`;

function svg(tag, attributes = {}, text) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Round numbers from low to high; of a log axis powers of ten. */
function ticksOf(low, high, log, most) {
  if (log) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9), step = Math.max(1, Math.ceil((last - first + 1) / most));
    const powers = Array.from({length: Math.max(0, Math.floor((last - first) / step) + 1)}, (_, k) => 10 ** (first + k * step));
    if (powers.length > 1) return powers;
  }
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].map(k => k * power).find(k => k >= raw);
  const ticks = [];
  for (let t = Math.ceil(low / step) * step; t <= high + 1e-9 * step; t += step) ticks.push(Math.abs(t) < 1e-9 * step ? 0 : t);
  return ticks;
}

class Plot {
  /** @param plot {title, x: {name, log}, y: {name, log}, style, series: [{name, x, y}]} */
  constructor(plot) {
    this.plot = plot;
    this.values = element('div', {class: 'values', 'aria-live': 'polite'});
    this.picture = svg('svg', {class: 'sheet-plot', role: 'img', 'aria-label': this.said()});
    this.card = element('div', {class: 'card wide'}, element('h3', {}, plot.title), this.picture, this.values);
    this.range = null;
    this.picture.addEventListener('pointermove', event => this.point(event));
    this.picture.addEventListener('pointerleave', () => { this.legend(); this.needle.setAttribute('visibility', 'hidden'); });
    this.picture.addEventListener('pointerdown', event => { this.from = this.xAt(event); });
    this.picture.addEventListener('pointerup', event => this.zoom(event));
    this.picture.addEventListener('dblclick', () => { this.range = null; this.draw(); });
  }

  /** For those who do not see it. */
  said() {
    const {title, x, y, series} = this.plot;
    const parts = series.map(s => {
      const known = s.y.map((v, k) => [v, s.x[k]]).filter(([v]) => v !== null);
      if (!known.length) return `${s.name}: no values`;
      const top = known.reduce((a, b) => b[0] > a[0] ? b : a);
      return `${s.name}: ${known.length} values, the largest ${shortNumber(top[0])} at ${shortNumber(top[1])}`;
    });
    return `${title}; ${y.name} against ${x.name}; ${parts.join('; ')}`;
  }

  bounds(axis, key, range) {
    let low = Infinity, high = -Infinity;
    for (const s of this.plot.series) s[key].forEach((v, k) => {
      if (v === null || s.y[k] === null || (axis.log && v <= 0)) return;
      if (range && (s.x[k] < range[0] || s.x[k] > range[1])) return;
      low = Math.min(low, v); high = Math.max(high, v);
    });
    if (low > high) return axis.log ? [1, 10] : [0, 1];
    if (this.plot.style === 'bars' && key === 'y' && !axis.log) low = Math.min(0, low);
    if (low === high) return axis.log ? [low / 2, high * 2] : [low - (Math.abs(low) || 1) / 2, high + (Math.abs(high) || 1) / 2];
    if (axis.log) return key === 'y' ? [low / 1.3, high * 1.3] : [low, high];
    const margin = key === 'y' ? 0.05 * (high - low) : this.plot.style === 'line' ? 0 : 0.03 * (high - low);
    return [this.plot.style === 'bars' && key === 'y' && low === 0 ? 0 : low - margin, high + margin];
  }

  draw() {
    const {x, y, series, style} = this.plot, width = this.picture.clientWidth || 600, height = 260;
    const left = 62, right = width - 10, top = 8, bottom = height - 38;
    const bx = this.range || this.bounds(x, 'x'), by = this.bounds(y, 'y', this.range);
    const scale = (v, b, axis, from, to) => axis.log ? from + (to - from) * Math.log(v / b[0]) / Math.log(b[1] / b[0]) : from + (to - from) * (v - b[0]) / (b[1] - b[0]);
    this.sx = v => scale(v, bx, x, left, right);
    this.sy = v => scale(v, by, y, bottom, top);
    this.back = p => x.log ? bx[0] * (bx[1] / bx[0]) ** ((p - left) / (right - left)) : bx[0] + (bx[1] - bx[0]) * (p - left) / (right - left);
    this.picture.setAttribute('viewBox', `0 0 ${width} ${height}`);
    const parts = [];
    for (const t of ticksOf(...by, y.log, 5)) parts.push(svg('line', {class: 'grid', x1: left, x2: right, y1: this.sy(t), y2: this.sy(t)}), svg('text', {x: left - 6, y: this.sy(t) + 4, 'text-anchor': 'end'}, shortNumber(t)));
    for (const t of ticksOf(...bx, x.log, Math.max(2, Math.floor(width / 110)))) parts.push(svg('line', {class: 'grid', x1: this.sx(t), x2: this.sx(t), y1: top, y2: bottom}), svg('text', {x: this.sx(t), y: bottom + 15, 'text-anchor': 'middle'}, shortNumber(t)));
    parts.push(svg('path', {class: 'axis', d: `M${left} ${top}V${bottom}H${right}`}));
    parts.push(svg('text', {x: (left + right) / 2, y: height - 6, 'text-anchor': 'middle'}, x.name), svg('text', {x: -(top + bottom) / 2, y: 12, transform: 'rotate(-90)', 'text-anchor': 'middle'}, y.name));
    series.forEach((s, k) => parts.push(...this.marksOf(s, k, style, bottom, bx, by)));
    this.needle = svg('line', {class: 'needle', y1: top, y2: bottom, visibility: 'hidden'});
    this.picture.replaceChildren(...parts, this.needle);
    this.legend();
  }

  marksOf(s, k, style, bottom, bx, by) {
    const inside = i => s.x[i] !== null && s.y[i] !== null && s.x[i] >= bx[0] && s.x[i] <= bx[1] && (!this.plot.y.log || s.y[i] > 0) && (!this.plot.x.log || s.x[i] > 0);
    const colour = colourOf(k);
    if (style === 'line') {
      let d = '', pen = false;
      s.x.forEach((v, i) => {
        if (inside(i)) d += `${pen ? 'L' : 'M'}${this.sx(v).toFixed(1)} ${this.sy(s.y[i]).toFixed(1)}`;
        pen = inside(i);
      });
      return [svg('path', {d, fill: 'none', stroke: colour, 'stroke-width': 1.6, 'stroke-linejoin': 'round'})];
    }
    const places = s.x.map((_, i) => i).filter(inside);
    if (style === 'dots') return places.map(i => svg('circle', {cx: this.sx(s.x[i]), cy: this.sy(s.y[i]), r: 3, fill: colour}));
    const wide = Math.max(1, Math.min(24, 0.7 * Math.abs(this.sx(1) - this.sx(0))));
    return places.map(i => svg('rect', {x: this.sx(s.x[i]) - wide / 2, width: wide, y: Math.min(this.sy(s.y[i]), bottom), height: Math.max(0, bottom - this.sy(s.y[i])), fill: colour}));
  }

  xAt(event) {
    const box = this.picture.getBoundingClientRect();
    return this.back((event.clientX - box.left) * (this.picture.viewBox.baseVal.width / box.width));
  }

  legend(at) {
    const one = this.plot.series.length === 1, parts = this.plot.series.map((s, k) => {
      const value = at === undefined || !s.x.length ? '' : `: ${shortNumber(s.y[nearest(s.x, at)], 6)}`;
      return element('span', {style: `color: ${colourOf(k)}; margin-right: 12px`}, (one && at === undefined ? '' : s.name) + value);
    });
    const first = this.plot.series.find(s => s.x.length);
    this.values.replaceChildren(at === undefined || !first ? '' : `${this.plot.x.name} ${shortNumber(first.x[nearest(first.x, at)], 6)}  `, ...parts);
  }

  point(event) {
    const at = this.xAt(event), first = this.plot.series.find(s => s.x.length);
    if (!first) return;
    const place = this.sx(first.x[nearest(first.x, at)]);
    this.needle.setAttribute('x1', place);
    this.needle.setAttribute('x2', place);
    this.needle.setAttribute('visibility', 'visible');
    this.legend(at);
  }

  zoom(event) {
    const to = this.xAt(event), [low, high] = [Math.min(this.from, to), Math.max(this.from, to)];
    if (!(Math.abs(this.sx(high) - this.sx(low)) > 8)) return;
    this.range = [low, high];
    this.draw();
  }
}

function nearest(list, x) {
  let best = 0;
  for (let k = 1; k < list.length; ++k) if (Math.abs(list[k] - x) < Math.abs(list[best] - x)) best = k;
  return best;
}

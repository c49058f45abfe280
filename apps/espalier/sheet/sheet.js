// The report of a command as cards, with its plots and pictures. `window.espalier` is for programs that look at it.
const worded = key => key.replace(/_/g, ' ');
const bytesText = x => { let k = 0; for (; x >= 1024 && k < 5; ++k) x /= 1024; return `${shortNumber(x, 3)} ${['B', 'KiB', 'MiB', 'GiB', 'TiB', 'PiB'][k]}`; };
const flopsText = (x, unit) => { let k = 0; for (; x >= 1000 && k < 6; ++k) x /= 1000; return `${shortNumber(x, 3)} ${['', 'k', 'M', 'G', 'T', 'P', 'E'][k]}${unit}`; };

/** A value of the report for people; its key says what it is. */
function shownValue(key, value, group = '') {
  if (value === null) return '\u2013';
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  if (typeof value !== 'number') return Array.isArray(value) ? value.map(v => shownValue(key, v)).join(', ') : String(value);
  if (key.endsWith('seconds') || group.endsWith('seconds')) return seconds(value);
  if (key.endsWith('bytes')) return bytesText(value);
  if (key.endsWith('flops_per_second')) return flopsText(value, 'FLOP/s');
  if (key.endsWith('flops')) return flopsText(value, 'FLOP');
  return Number.isInteger(value) && Math.abs(value) < 1e15 ? value.toString().replace(/\B(?=(\d{3})+$)/g, ',') : shortNumber(value, 6);
}

const isRecord = value => typeof value === 'object' && value !== null && !Array.isArray(value);
const card = (title, wide, ...content) => element('div', {class: wide ? 'card full' : 'card'}, element('h3', {}, title), ...content);

/** A list of records as a table: a column for each of their keys. */
function recordsTable(title, list) {
  const most = 2000, keys = [...new Set(list.flatMap(Object.keys))], cellOf = (key, value) => value === undefined || value === null ? '' : typeof value === 'number' ? value : shownValue(key, value);
  const rows = list.slice(0, most).map(record => keys.map(key => isRecord(record[key]) ? JSON.stringify(record[key]) : cellOf(key, record[key])));
  const head = list.length > most ? `${title}: the first ${grouped(most)} of ${grouped(list.length)}` : `${title}`;
  return card(head, true, sortableTable(keys.map(worded), rows, title));
}

function cardsOf(report) {
  const single = [], cards = [], tables = [];
  for (const [key, value] of Object.entries(report)) {
    if (['espalier', 'message', 'exit_code', 'title'].includes(key)) continue;
    if (isRecord(value)) cards.push(card(worded(key), false, factsTable(Object.entries(value).filter(([, v]) => !isRecord(v)).map(([k, v]) => [worded(k), shownValue(k, v, key)]))));
    else if (Array.isArray(value) && value.length && value.every(isRecord)) tables.push(recordsTable(worded(key), value));
    else if (value !== '' && (!Array.isArray(value) || value.length)) single.push([worded(key), shownValue(key, value)]);
  }
  return [card('result', false, factsTable(single)), ...cards, ...tables];
}

/** Counts of entries by place, darker where there are more. */
class Spy {
  constructor(picture) {
    this.picture = picture;
    this.canvas = element('canvas', {class: 'spy', width: picture.size, height: picture.size, role: 'img', 'aria-label': picture.said});
    this.card = card(picture.title, false, this.canvas, element('div', {class: 'values'}, picture.said));
    this.bytes = Uint8Array.from(atob(picture.cells), c => c.charCodeAt(0));
  }
  draw() {
    const {size} = this.picture, context = this.canvas.getContext('2d'), image = context.createImageData(size, size), dark = document.documentElement.dataset.theme === 'dark';
    this.bytes.forEach((count, k) => image.data.set(count ? dark ? [108, 176, 255, 90 + 0.64 * count] : [11, 98, 196, 90 + 0.64 * count] : [0, 0, 0, 0], 4 * k));
    context.putImageData(image, 0, 0);
  }
}

/** How busy the threads of devices were over the time of a factorization. */
class Tracks {
  constructor(timeline) {
    this.rows = timeline.tracks.map(track => ({track, canvas: element('canvas', {width: track.busy.length, height: 1, role: 'img', 'aria-label': `${track.name}: busy ${Math.round(100 * track.share)} % of the time`})}));
    this.card = card(`Timeline: ${seconds(timeline.seconds)}, darker where a thread is busy`, true, ...this.rows.map(({track, canvas}) => element('div', {class: 'track'}, element('span', {}, `${track.name}, ${Math.round(100 * track.share)} %`), canvas)));
  }
  draw() {
    const accent = document.documentElement.dataset.theme === 'dark' ? [108, 176, 255] : [11, 98, 196];
    for (const {track, canvas} of this.rows) {
      const context = canvas.getContext('2d'), image = context.createImageData(track.busy.length, 1);
      track.busy.forEach((share, k) => image.data.set([...accent, 20 + 235 * share], 4 * k));
      context.putImageData(image, 0, 0);
    }
  }
}

function startSheet() {
  const data = JSON.parse(byId('data').textContent), r = data.report;
  const drawn = [...data.plots.map(p => new Plot(p)), ...data.pictures.map(p => new Spy(p)), ...(data.timeline ? [new Tracks(data.timeline)] : [])];
  const theme = name => {
    document.documentElement.dataset.theme = name;
    byId('theme').textContent = name === 'dark' ? 'Light' : 'Dark';
    drawn.forEach(part => part.draw());
  };
  const other = () => theme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark');
  document.title = data.title;
  byId('title').textContent = data.title;
  byId('state').textContent = data.state[0];
  byId('state').classList.add(data.state[1]);
  byId('facts').textContent = data.facts;
  byId('version').textContent = r.espalier;
  if (r.message) { byId('trouble').hidden = false; byId('trouble').textContent = r.message; }
  byId('cards').append(...drawn.map(part => part.card), ...cardsOf(r));
  theme(matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light');
  byId('theme').addEventListener('click', other);
  addEventListener('resize', () => drawn.forEach(part => part.draw()));
  addEventListener('keydown', event => { if (event.key.toLowerCase() === 'd' && !event.ctrlKey && !event.metaKey && !event.altKey) other(); });
  Object.assign(window.espalier, {report: r, plots: data.plots, pictures: data.pictures, timeline: data.timeline});
}

window.espalier = {errors: [], ready: null};
addEventListener('error', event => window.espalier.errors.push(String(event.message)));
window.espalier.ready = new Promise((resolve, reject) => document.addEventListener('DOMContentLoaded', () => {
  try {
    startSheet();
    resolve(true);
  } catch (error) {
    byId('trouble').hidden = false;
    byId('trouble').textContent = `The page could not be shown: ${error.message}`;
    console.error(error);
    reject(error);
  }
}));

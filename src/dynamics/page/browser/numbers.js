// Numbers and texts for people.
const shortNumber = (x, digits = 4) => {
  if (x === null || x === undefined || !Number.isFinite(x)) return 'no number';
  if (x === 0) return '0';
  const size = Math.abs(x);
  const text = size >= 1e5 || size < 1e-3 ? x.toExponential(digits - 1) : x.toPrecision(digits);
  return text.replace(/(\.\d*?)0+(e|$)/, '$1$2').replace(/\.(e|$)/, '$1').replace('e+', 'e').replace('-', '\u2212').replace('e-', 'e\u2212');
};
const grouped = x => Math.round(x).toString().replace(/\B(?=(\d{3})+$)/g, ',');
const seconds = x => x >= 60 ? `${shortNumber(x / 60, 3)} min` : x >= 1 ? `${shortNumber(x, 3)} s` : `${shortNumber(1000 * x, 3)} ms`;

/** An element with attributes and children; texts are texts, never markup. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) made.addEventListener(name.slice(2), value);
    else if (value !== false && value !== undefined) made.setAttribute(name, value === true ? '' : value);
  }
  made.append(...children.filter(child => child !== undefined && child !== null));
  return made;
}
const byId = id => document.getElementById(id);

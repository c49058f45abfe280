// Tables that sort by the column whose head is pressed.

/** @param heads names of columns @param rows lists of texts, numbers or {text, value, press} */
function sortableTable(heads, rows, caption) {
  const body = element('tbody');
  const shownOf = cell => typeof cell === 'number' ? shortNumber(cell, 6) : typeof cell === 'object' && cell ? cell.text : cell;
  const valueOf = cell => typeof cell === 'object' && cell ? cell.value : cell;
  const numeric = heads.map((_, c) => rows.length > 0 && rows.every(row => typeof valueOf(row[c]) === 'number'));
  const fill = sorted => body.replaceChildren(...sorted.map(row => element('tr', {}, ...row.map((cell, c) => element(c ? 'td' : 'th',
    {class: numeric[c] ? 'number' : undefined, scope: c ? undefined : 'row'},
    cell && cell.press ? element('button', {type: 'button', onclick: cell.press}, shownOf(cell)) : shownOf(cell))))));
  const cells = heads.map((head, c) => element('th', {scope: 'col', class: numeric[c] ? 'number' : undefined}, element('button', {type: 'button', onclick: () => {
    const up = cells[c].getAttribute('aria-sort') !== 'ascending';
    cells.forEach(cell => cell.removeAttribute('aria-sort'));
    cells[c].setAttribute('aria-sort', up ? 'ascending' : 'descending');
    const order = (a, b) => {
      const [x, y] = [valueOf(a[c]), valueOf(b[c])];
      return typeof x === 'number' && typeof y === 'number' ? x - y : String(x).localeCompare(String(y), undefined, {numeric: true});
    };
    fill([...rows].sort((a, b) => up ? order(a, b) : -order(a, b)));
  }}, head)));
  fill(rows);
  return element('div', {class: 'scroll'}, element('table', {}, element('caption', {hidden: true}, caption), element('thead', {}, element('tr', {}, ...cells)), body));
}

/** Two columns: names and what they are. */
function factsTable(facts) {
  return element('table', {}, ...facts.filter(fact => fact).map(([name, value]) => element('tr', {}, element('th', {scope: 'row'}, name), element('td', {}, value))));
}

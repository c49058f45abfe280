// Tables made of data; those with heads sort (sorting.js).

/** @param heads names of columns @param rows lists of texts, numbers or {text, value, press} */
function sortableTable(heads, rows, caption) {
  const shownOf = cell => typeof cell === 'number' ? shortNumber(cell, 6) : typeof cell === 'object' && cell ? cell.text : cell;
  const valueOf = cell => typeof cell === 'object' && cell ? cell.value : cell;
  const numeric = heads.map((_, c) => rows.length > 0 && rows.every(row => typeof valueOf(row[c]) === 'number'));
  const body = rows.map(row => element('tr', {}, ...row.map((cell, c) => element(c ? 'td' : 'th',
    {class: numeric[c] ? 'number' : undefined, scope: c ? undefined : 'row', 'data-v': numeric[c] ? String(valueOf(cell)) : undefined},
    cell && cell.press ? element('button', {type: 'button', onclick: cell.press}, shownOf(cell)) : shownOf(cell)))));
  const cells = heads.map((head, c) => element('th', {scope: 'col', class: numeric[c] ? 'number' : undefined}, element('button', {type: 'button'}, head)));
  const table = element('table', {}, element('caption', {hidden: true}, caption), element('thead', {}, element('tr', {}, ...cells)), element('tbody', {}, ...body));
  return element('div', {class: 'scroll'}, sortsByItsHeads(table));
}

/** Two columns: names and what they are. */
function factsTable(facts) {
  return element('table', {}, ...facts.filter(fact => fact).map(([name, value]) => element('tr', {}, element('th', {scope: 'row'}, name), element('td', {}, value))));
}

// Tables that sort by the column whose head is pressed. Cells with data-v have that number; rows without stay at the end.
function sortsByItsHeads(table) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => head.firstElementChild.addEventListener('click', () => {
    const up = head.getAttribute('aria-sort') !== 'ascending', body = table.tBodies[0];
    heads.forEach(other => other.removeAttribute('aria-sort'));
    head.setAttribute('aria-sort', up ? 'ascending' : 'descending');
    const key = row => { const cell = row.cells[column]; return 'v' in cell.dataset ? Number(cell.dataset.v) : cell.textContent; };
    const rows = [...body.rows].map(row => ({row, key: key(row)})), numeric = rows.some(({key}) => typeof key === 'number');
    const order = (x, y) => typeof x === 'number' && typeof y === 'number' ? x - y : String(x).localeCompare(String(y), undefined, {numeric: true});
    rows.sort((a, b) => {
      const last = numeric ? (typeof a.key === 'string') - (typeof b.key === 'string') : 0;
      return last || (up ? order(a.key, b.key) : order(b.key, a.key));
    });
    body.append(...rows.map(({row}) => row));
  }));
  return table;
}

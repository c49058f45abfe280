// The summary below scene and plots: what was solved, how well, and where the time went.
function buildSummary(data, series, app) {
  const s = data.summary, statics = s.method.endsWith('statics'), card = (title, ...content) => element('div', {class: 'card'}, element('h3', {}, title), ...content);
  const cards = [card('What was solved', factsTable([
    ['bodies, joints, forces', `${grouped(s.bodies)}, ${grouped(s.joints)}, ${grouped(s.forces)}`],
    ['unknowns', `${grouped(s.velocities)} + ${grouped(s.constraints)} constraints`], ['degrees of freedom', grouped(s.degrees_of_freedom)],
    [statics ? 'load' : 'time', `${shortNumber(s.t_begin, 6)} to ${shortNumber(s.t_end, 6)}${data.end !== null && data.end > s.t_end * (1 + 1e-9) ? ` of ${shortNumber(data.end, 6)}` : ''}`],
    ['method', s.method], ['steps', `${grouped(s.steps)}${s.rejected + s.failures > 0 ? `, and ${grouped(s.rejected + s.failures)} taken back` : ''}`],
    ['Newton', `${grouped(s.newton)} iterations, ${grouped(s.factorizations)} factorizations`],
    ['solver', s.kind === 'dense' ? 'dense' : `${s.kind} ${s.precision}, ${s.device.split(': ')[0]}, ${grouped(s.nonzeros_factor)} entries in the factor`]]))];
  cards.push(qualityCard(s, series, statics, card));
  if (s.notices.length || s.redundant.length) {
    const list = (name, texts) => texts.length ? [element('p', {class: 'quiet', style: 'margin:4px 0'}, name), element('ul', {class: 'notices'}, ...texts.map(text => element('li', {}, text)))] : [];
    cards.push(card('Notices', ...list('', s.notices), ...list('Redundant constraints, left out', s.redundant)));
  }
  cards.push(timeCard(s.seconds, card));
  cards.push(...resultCards(s, app, card));
  const values = series.names.map(name => {
    const column = series.get(name), {low, high} = extremes(column), at = x => ({text: shortNumber(x, 6), value: x, press: () => app.moveTo(series.t[column.indexOf(x)])});
    return [name, series.dimension(name), column[0], column[column.length - 1], at(low), at(high)];
  });
  if (values.length) {
    const table = card('Quantities (a press on a least or greatest value moves the scene to its time)', sortableTable(['quantity', 'dimension', 'begin', 'end', 'least', 'greatest'], values, 'Quantities'));
    table.classList.add('full');
    cards.push(table);
  }
  const text = element('div', {class: 'card full'}, element('details', {}, element('summary', {}, `The model: ${data.model.name}`),
    ...(data.model.set.length ? [element('p', {}, `Set: ${data.model.set.join(', ')}`)] : []), element('pre', {}, data.model.text || 'The text is not known.')),
    element('details', {}, element('summary', {}, 'Keys'), keyTable()),
    ...(s.files.length ? [element('details', {}, element('summary', {}, 'Files'), element('ul', {}, ...s.files.map(file => element('li', {}, file))))] : []));
  byId('summary').replaceChildren(element('h2', {}, 'Summary'), element('div', {class: 'cards', style: 'margin-top:10px'}, ...cards, text));
}

function qualityCard(s, series, statics, card) {
  const facts = [];
  if (statics) facts.push(['out of balance', shortNumber(s.statics_residual)]);
  else {
    const change = s.energy_end - s.energy_begin, scale = Math.max(Math.abs(change), Math.abs(s.energy_work));
    facts.push(['energy', `${shortNumber(s.energy_begin, 6)} to ${shortNumber(s.energy_end, 6)}`], ['work of dampers, motors and loads', shortNumber(s.energy_work)],
      ['gain of the steps themselves', `${shortNumber(s.energy_gain)}${scale > 0 ? ` (${shortNumber(100 * s.energy_gain / scale, 2)} % of what changed)` : ''}`]);
  }
  facts.push(['constraints, positions', shortNumber(s.violation_position)]);
  if (!statics) facts.push(['constraints, velocities', shortNumber(s.violation_velocity)], ['constraints, accelerations', shortNumber(s.violation_acceleration)]);
  if (s.position_change > 0) facts.push(['moved at the start to fit joints', shortNumber(s.position_change)]);
  s.critical.forEach(c => facts.push([c.kind, `load factor ${shortNumber(c.load, 6)}`]));
  return card('How well', factsTable(facts));
}

function timeCard(phases, card) {
  const parts = Object.entries(phases).filter(([name, value]) => name !== 'total' && value > 0).sort((a, b) => b[1] - a[1]);
  const total = Math.max(phases.total, parts.reduce((sum, [, value]) => sum + value, 0)) || 1;
  return card(`Where the time went: ${seconds(phases.total || total)}`, element('table', {}, ...parts.map(([name, value]) => element('tr', {}, element('th', {scope: 'row'}, name),
    element('td', {style: 'width:45%'}, element('div', {class: 'share', style: `width:${100 * value / total}%`})), element('td', {class: 'number'}, seconds(value)),
    element('td', {class: 'number'}, `${Math.round(100 * value / total)} %`)))));
}

function resultCards(s, app, card) {
  const cards = [];
  if (s.events.length) cards.push(card(`Events: ${grouped(s.event_count)}`, sortableTable(['event', 'time'],
    s.events.slice(0, 1000).map(e => [{text: e.name, value: e.name, press: () => app.moveTo(e.t)}, e.t]), 'Events')));
  if (s.modes.length) cards.push(card('Natural frequencies', sortableTable(['mode', 'per unit of time', 'damping, %'],
    s.modes.map((m, k) => [{text: `mode ${k + 1}`, value: k, press: () => app.showSwing(`mode ${k + 1}`)}, m.frequency, 100 * m.damping]), 'Natural frequencies')));
  if (s.stress_peaks.length) cards.push(card('Largest von Mises stress at the surface', sortableTable(['body', 'node', s.method.endsWith('statics') ? 'load' : 'time', 'stress'],
    s.stress_peaks.map(p => [{text: p.body, value: p.body, press: () => app.moveTo(p.t)}, p.node, p.t, p.value]), 'Largest stresses')));
  if (s.peaks.length) cards.push(card('Resonances', sortableTable(['quantity', 'load', 'frequency', 'amplitude', 'phase, deg'],
    s.peaks.map(p => [p.quantity, p.load, p.frequency, p.amplitude, p.phase]), 'Resonances')));
  return cards;
}

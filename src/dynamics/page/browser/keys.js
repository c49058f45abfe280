// Keys, and the table that tells them.
const kKeys = [['space', 'play and stop'], ['\u2190 \u2192', 'one picture back or on'], ['Home End', 'first and last picture'], ['F', 'everything in view'],
  ['1 2 3 4', 'from x, y, z, a corner'], ['+ \u2212', 'nearer and farther'], ['shift \u2190 \u2191 \u2192 \u2193', 'turn'], ['G', 'position at the start'],
  ['M', 'mesh lines'], ['D', 'dark or light'], ['Esc', 'forget what was picked']];
const keyTable = () => element('table', {}, ...kKeys.map(([key, text]) => element('tr', {}, element('th', {}, element('kbd', {}, key)), element('td', {}, text))));

function listenToKeys(app) {
  const press = id => () => byId(id).click();
  const actions = {' ': () => app.timeline.toggle(), ArrowLeft: () => app.timeline.step(-1), ArrowRight: () => app.timeline.step(1), Home: () => app.timeline.end(0),
    End: () => app.timeline.end(1), f: () => app.stage && app.stage.fit(), g: press('show-ghost'), m: press('show-edges'), d: press('theme'), Escape: () => app.forget(),
    1: () => app.viewFrom('x'), 2: () => app.viewFrom('y'), 3: () => app.viewFrom('z'), 4: () => app.viewFrom('corner'), '+': () => app.zoom(0.85), '=': () => app.zoom(0.85), '-': () => app.zoom(1 / 0.85)};
  const turns = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1]};
  document.addEventListener('keydown', event => {
    if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA|SUMMARY)$/.test(event.target.tagName)) return;
    if (event.target.tagName === 'BUTTON' && (event.key === ' ' || event.key === 'Enter')) return;
    const turn = event.shiftKey && turns[event.key], action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!turn && !action) return;
    event.preventDefault();
    if (turn) app.turn(...turn); else action();
  });
}

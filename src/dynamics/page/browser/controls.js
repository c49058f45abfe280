// The buttons and menus of the scene.
function connectStage(app) {
  const {stage, film, marks} = app, canvas = byId('canvas');
  byId('motion').replaceChildren(element('option', {value: ''}, app.statics ? 'the loading' : film.frames.length > 1 ? 'the motion' : 'the model'),
    ...app.swings.list.map((shape, k) => element('option', {value: k}, shape.frequency > 0 && !shape.name.includes(' at ') ? `${shape.name}: ${shortNumber(shape.frequency, 5)}` : shape.name)));
  byId('field').replaceChildren(...fieldsOf(film, app.statics).map(name => element('option', {value: name}, kFields[name].name)));
  const stressed = [...byId('field').options].some(option => option.value === 'von_mises');
  byId('field').value = stressed && film.frames.length > 1 ? 'von_mises' : 'bodies';
  byId('motion').addEventListener('change', () => { app.work = app.chooseMotion(); });
  byId('field').addEventListener('change', () => { app.work = app.chooseField(); });
  byId('range').addEventListener('change', () => app.redraw());
  byId('factor').addEventListener('input', () => app.redraw());
  byId('fit').addEventListener('click', () => stage.fit());
  byId('directions').replaceChildren(...['x', 'y', 'z', '-x', '-y', '-z', 'corner'].map(side => element('button', {type: 'button', 'aria-label': `From ${side}`,
    onclick: () => stage.viewFrom(side)}, side)));
  const flag = (id, act) => { const box = byId(id); box.addEventListener('change', () => { act(box.checked); stage.touch(); }); act(box.checked); };
  const again = () => { if (app.rows && !app.swinging()) marks.show(app.rows); };
  byId('show-edges').checked = film.scene.triangles < 30000;
  flag('show-edges', on => { stage.lines.visible = on; });
  flag('show-ghost', on => { stage.ghost.visible = on; });
  flag('show-ground', on => { stage.groundGroup.visible = on; });
  for (const what of ['joints', 'forces', 'moments']) flag(`show-${what}`, on => { marks[what] = on; again(); });
  byId('arrows').addEventListener('input', () => { marks.scale = 2 ** Number(byId('arrows').value); again(); });
  const clip = () => stage.setClip(byId('clip').value, Number(byId('clip-at').value), byId('clip-turn').checked);
  for (const id of ['clip', 'clip-at', 'clip-turn']) byId(id).addEventListener('input', clip);
  byId('image').addEventListener('click', () => savePicture(stage));
  listBodies(app);
  let down = null;
  canvas.addEventListener('pointerdown', event => { down = [event.offsetX, event.offsetY]; app.dragging = true; });
  window.addEventListener('pointerup', () => { app.dragging = false; });
  canvas.addEventListener('click', event => {
    if (!down || Math.hypot(event.offsetX - down[0], event.offsetY - down[1]) > 4) return;
    const mark = marks.under(event.offsetX, event.offsetY), point = mark === null ? stage.pointUnder(event.offsetX, event.offsetY) : -1;
    if (mark === null && point < 0) return app.forget();
    app.picked = point;
    app.pickedMark = mark;
    app.tellPicked();
  });
  canvas.addEventListener('dblclick', () => stage.fit());
  new ResizeObserver(() => stage.resize()).observe(byId('stage'));
  document.addEventListener('click', event => document.querySelectorAll('.menu[open]').forEach(menu => { if (!menu.contains(event.target)) menu.open = false; }));
}

function listBodies(app) {
  const {stage, film} = app, most = 500;
  const all = element('button', {type: 'button', onclick: () => { stage.hidden.clear(); stage.indexBodies(); listBodies(app); }}, 'Show all');
  byId('bodies').replaceChildren(all, ...film.bodies.slice(0, most).map((body, k) => element('label', {}, element('input', {type: 'checkbox', checked: !stage.hidden.has(k), onchange: event => {
    if (event.target.checked) stage.hidden.delete(k); else stage.hidden.add(k);
    stage.indexBodies();
  }}), ' ', element('span', {style: `display:inline-block;width:10px;height:10px;border-radius:2px;background:${css(bodyColour(k))}`}), ` ${body.name} `,
  element('span', {class: 'quiet'}, body.kind))), ...(film.bodies.length > most ? [element('span', {class: 'quiet'}, `and ${film.bodies.length - most} more`)] : []));
}

function showLegend(app, {low, high, signed}) {
  const {colours, film} = app, field = kFields[colours.name], legend = byId('legend'), middle = 0.5 * (low + high);
  const body = film.bodies[film.bodyOf[colours.at]], label = film.labels[colours.at], most = Math.max(-colours.low, colours.high) === colours.high ? colours.high : colours.low;
  legend.replaceChildren(element('div', {}, element('b', {}, field.name), element('span', {class: 'quiet'}, ` ${field.dimension}`)),
    element('div', {class: 'bar'}, element('i', {style: `background:${gradient(signed ? kSigned : kMap)}`}),
      element('div', {class: 'marks'}, ...[high, middle, low].map(x => element('span', {}, shortNumber(x, 3))))),
    element('button', {type: 'button', title: 'Show it', onclick: () => { app.moveTo(colours.t); app.pick(colours.at); }},
      `largest ${shortNumber(most, 4)}: ${body.name}${label ? `, node ${label}` : ''}, ${app.statics ? 'load' : 't ='} ${shortNumber(colours.t, 4)}`));
  legend.hidden = false;
}

function savePicture(stage) {
  stage.draw();
  stage.renderer.domElement.toBlob(blob => {
    const link = element('a', {href: URL.createObjectURL(blob), download: 'scene.png'});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

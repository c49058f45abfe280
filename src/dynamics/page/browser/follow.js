// A run that goes on renews its page; the page loads itself again and keeps what one looks at.
const kMemory = `espalier ${location.pathname}`;

function remember(app) {
  const {timeline, stage} = app, kept = {theme: document.documentElement.dataset.theme, t: timeline.t, last: timeline.t >= timeline.last, field: byId('field').value,
    hidden: stage ? [...stage.hidden].map(k => app.film.bodies[k].name) : [], scroll: window.scrollY, plots: app.plots.filter(plot => !plot.options.response).map(plot => plot.names)};
  if (stage) Object.assign(kept, {camera: stage.camera.position.toArray(), target: stage.controls.target.toArray(), size: stage.size});
  try { sessionStorage.setItem(kMemory, JSON.stringify(kept)); } catch { /* no room, or not allowed */ }
}

function remembered() {
  try { return JSON.parse(sessionStorage.getItem(kMemory)) || {}; } catch { return {}; }
}

function follow(app, data) {
  if (!data.running || window.self !== window.top) return;
  const age = () => Date.now() / 1000 - data.written;
  setInterval(() => {
    byId('state').title = `written ${Math.round(age())} s ago`;
    if (age() > 900) byId('state').textContent = 'no news since ' + new Date(1000 * data.written).toLocaleTimeString();
    if (document.hidden || app.timeline.playing || app.dragging || document.querySelector('.menu[open]')) return;
    remember(app);
    location.reload();
  }, 5000);
}

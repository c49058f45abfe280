// The time that is shown, and playing.
class Timeline {
  constructor(app, times, statics) {
    Object.assign(this, {app, times, statics, playing: false, phase: 0});
    this.begin = times.length ? times[0] : 0;
    this.last = times.length ? times[times.length - 1] : 0;
    // Loads may turn back: there, the number of the picture is what moves.
    this.even = !times.every((t, k) => k === 0 || t > times[k - 1]);
    this.t = this.begin;
    const slider = byId('slider'), rate = byId('rate');
    slider.min = this.even ? 0 : this.begin;
    slider.max = this.even ? Math.max(0, times.length - 1) : this.last;
    if (this.even) slider.step = 1;
    slider.disabled = times.length < 2;
    slider.addEventListener('input', () => { this.stop(); this.show(Number(slider.value)); });
    const span = this.span(), whole = [4, 8, 16, 32].map(s => [span / s, `whole in ${s} s`]);
    const real = statics || this.even ? [] : [1, 0.1, 0.01, 1e-3].map(r => [r, r === 1 ? 'true speed' : `${r} of true`]);
    rate.replaceChildren(...[...whole, ...real].map(([value, text]) => element('option', {value}, text)));
    rate.value = String(span / 8);
    byId('play').addEventListener('click', () => this.toggle());
  }

  span() { return this.even ? Math.max(1, this.times.length - 1) : this.last - this.begin || 1; }
  where() { return this.even ? this.number || 0 : this.t; }
  rate() { return Number(byId('rate').value) || this.span() / 8; }

  /** A time, or the number of a picture where loads turn back. */
  show(at) {
    this.number = this.even ? Math.min(this.times.length - 1, Math.max(0, Math.round(at))) : undefined;
    this.t = this.even ? this.times[this.number] : Math.min(this.last, Math.max(this.begin, at));
    byId('slider').value = this.where();
    byId('now').textContent = `${this.statics ? 'load' : 't'} = ${shortNumber(this.t, 5)}`;
    return this.app.showTime(this.t, this.number);
  }

  toggle() { if (this.playing) this.stop(); else this.play(); }
  stop() {
    this.playing = false;
    byId('play').textContent = '\u25B6';
    byId('play').setAttribute('aria-label', 'Play');
  }
  play() {
    const swings = this.app.swinging();
    if (!swings && this.times.length < 2) return;
    if (!swings && this.where() >= Number(byId('slider').max) - 1e-12 * this.span()) this.show(Number(byId('slider').min));
    this.playing = true;
    byId('play').textContent = '\u275A\u275A';
    byId('play').setAttribute('aria-label', 'Stop');
    let before = performance.now(), at = this.where();
    const tick = async now => {
      if (!this.playing) return;
      const passed = Math.min(0.1, (now - before) / 1000);
      before = now;
      if (this.app.swinging()) {
        this.phase += 2 * Math.PI * passed / 1.6;
        await this.app.showPhase(this.phase);
      } else {
        at += passed * this.rate();
        if (at >= Number(byId('slider').max)) at = Number(byId('slider').min);
        await this.show(at);
      }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  step(by) {
    this.stop();
    if (this.even) return this.show(this.number + by);
    const slip = 1e-9 * this.span(), times = this.times;
    const next = by > 0 ? times.find(t => t > this.t + slip) : [...times].reverse().find(t => t < this.t - slip);
    if (next !== undefined) this.show(next);
  }
  end(which) { this.stop(); this.show(Number(which ? byId('slider').max : byId('slider').min)); }
}

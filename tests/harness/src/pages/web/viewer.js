// The page of `viewshed view`: maps, figures over time, and what is known of a cell.

import { css } from './colours.js';
import { listen } from './keys.js';
import { Plot } from './plot.js';
import { sizes } from './points.js';
import { CameraView } from './viewer-camera.js';
import { cellAt, codeColours, codes, MapGround } from './viewer-ground.js';
import { drawOver, drawTimes, LINES } from './viewer-marks.js';
import { showCell, showCounters, showEvents, showNotes, showSenders } from './viewer-panel.js';
import { Source } from './viewer-source.js';
import { panned } from './view.js';

const element = (id) => document.getElementById(id);
// Share of a view that one press pans, and pixels that one press moves the cursor.
const PAN = 0.15;
const STEP_PX = 12;
// Seconds of a live source that are shown.
const RECENT_S = 60;
const TOGETHER = 'all sensors together';
// What is in view before there is a map: a usual sensor's road.
const NOWHERE = { left: -10, right: 210, bottom: -60, top: 60 };

class Page {
  constructor() {
    this.layers = { detections: true, labels: true, obstacles: true, rays: false };
    this.number = -1;
    this.wanted = -1;
    this.instant = null;
    this.chosen = 0;
    this.cell = null;
    this.told = null;
    this.playing = false;
    this.following = false;
    this.grounds = { plan: new MapGround(), second: new MapGround() };
    this.plots = {};
    // of the newest drawing: the instant's number, and when the frame that shows it was drawn
    this.drawn = { number: -1, at: 0 };
    this.source = new Source({
      overview: () => this.overview(),
      instant: (instant) => this.arrived(instant),
      gone: (text) => this.complain(text),
    });
    for (const name of ['plan', 'second']) this.addMap(name);
    this.addTime();
    this.active = this.plots.plan;
  }

  addMap(name) {
    const none = { across: new Float32Array(0), up: new Float32Array(0), size: new Uint8Array(0), colour: new Uint32Array(0) };
    const source = {
      layer: () => (this.layers.detections && this.layer) || none,
      faint: () => none.colour,
      chosen: () => null,
      range: () => [0, this.layers.detections && this.layer ? this.layer.across.length : 0],
      ground: () => this.grounds[name],
      marks: (plot, context) => drawOver(plot, context, this, this.mapsOf(name)),
    };
    const on = {
      view: (_, view) => ['plan', 'second'].forEach((other) => this.plots[other].show(view)),
      press: () => null,
      drag: () => {},
      release: (_, place, moved) => !moved && this.pick(name, place),
      brush: () => {},
    };
    this.addPlot(name, { name: name === 'plan' ? 'Map' : 'Second map', across: 'x, along the road (m)', up: 'y, to the left (m)', square: true, least: 2, most: 5000 }, source, on);
  }

  addTime() {
    const none = { across: new Float32Array(0), up: new Float32Array(0), size: new Uint8Array(0), colour: new Uint32Array(0) };
    const source = { layer: () => none, faint: () => none.colour, chosen: () => null, range: () => [0, 0], marks: (plot, context) => drawTimes(plot, context, this) };
    const on = {
      view: (plot, view) => plot.show({ ...view, bottom: 0, top: 100 }),
      press: () => null,
      drag: () => {},
      release: (_, [time], moved) => !moved && this.goTo(this.source.nearest(time)),
      brush: () => {},
    };
    this.addPlot('time', { name: 'Over time', across: 'time (s)', up: 'cells, %', least: 1, most: 1e6 }, source, on);
  }

  addPlot(name, axes, source, on) {
    const plot = new Plot(element(name), axes, source, on);
    plot.element.addEventListener('focus', () => (this.active = plot));
    this.plots[name] = plot;
  }

  get about() {
    return this.source.about;
  }

  get isLive() {
    return this.about.source === 'live';
  }

  async start() {
    await this.source.open();
    document.title = `${this.about.name} – viewshed view`;
    element('name').textContent = this.about.name;
    this.camera = new CameraView(this.about.camera);
    showNotes(this.about);
    listen(this, this.keys());
    element('now').addEventListener('input', (event) => this.goTo(Number(event.target.value)));
    element('map').addEventListener('change', (event) => this.choose(event.target.selectedIndex));
    for (const kind of ['fv', 'fi']) element(`next-${kind}`).hidden = !this.about.labelled;
    // a broadcast holds maps alone
    const layers = { detections: this.about.source === 'recording', obstacles: this.about.source === 'recording', labels: this.about.labelled };
    for (const [layer, there] of Object.entries(layers)) document.querySelector(`[data-key="${layer}"]`).hidden = !there;
    this.legend();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
      this.legend();
      if (this.instant) this.show(this.instant);
    });
    this.following = this.isLive;
    // before a map has come it is not known how far it reaches
    if (!this.fitted) for (const name of ['plan', 'second']) this.plots[name].show(NOWHERE);
    this.showPlaying();
    if (this.isLive && this.source.count > 0) this.goTo(this.source.count - 1, true);
    document.documentElement.dataset.ready = 'true';
  }

  keys() {
    const toggle = (layer) => () => this.toggle(layer);
    return [
      [' ', 'Time', 'play and pause; live: follow and hold', () => this.play(), false, 'play'],
      ['.', 'Time', 'one step on', () => this.goTo(this.wanted + 1), true, 'on'],
      [',', 'Time', 'one step back', () => this.goTo(this.wanted - 1), true, 'back'],
      ['PageDown', 'Time', 'one second on', () => this.skip(1), true],
      ['PageUp', 'Time', 'one second back', () => this.skip(-1), true],
      ['Home', 'Time', 'the first instant', () => this.goTo(this.source.keptFrom), false],
      ['End', 'Time', 'the last instant; live: follow', () => this.toEnd(), false],
      ['s', 'Time', 'next speed', () => this.faster(), false],
      ['v', 'What is wrong', 'next FV: visible, not detected (unsafe)', () => this.jump('fv', 1), false, 'next-fv'],
      ['x', 'What is wrong', 'FV before', () => this.jump('fv', -1), false],
      ['i', 'What is wrong', 'next FI: invisible, yet detected', () => this.jump('fi', 1), false, 'next-fi'],
      ['u', 'What is wrong', 'FI before', () => this.jump('fi', -1), false],
      ['m', 'Shown', 'next map', () => this.choose((this.chosen + 1) % Math.max(1, this.names.length)), false],
      ['b', 'Shown', "the receiver's map beside the sender's", () => this.beside(), false, 'beside'],
      ['d', 'Shown', 'detections', toggle('detections'), false, 'detections'],
      ['l', 'Shown', 'labelled vehicles', toggle('labels'), false, 'labels'],
      ['o', 'Shown', 'obstacles the estimator believes in', toggle('obstacles'), false, 'obstacles'],
      ['r', 'Shown', "the map's rays", toggle('rays'), false, 'rays'],
      ['ArrowUp', 'Plot in focus', 'move the cursor', () => this.active.moveCursor(0, STEP_PX), true],
      ['ArrowDown', 'Plot in focus', null, () => this.active.moveCursor(0, -STEP_PX), true],
      ['ArrowLeft', 'Plot in focus', null, () => this.active.moveCursor(-STEP_PX, 0), true],
      ['ArrowRight', 'Plot in focus', null, () => this.active.moveCursor(STEP_PX, 0), true],
      ['Enter', 'Plot in focus', 'what is known of the cell at the cursor; over time: go there', () => this.active.on.release(this.active, this.active.here(), false), false],
      ['+', 'Plot in focus', 'zoom in', () => this.active.zoom(1.25), true],
      ['-', 'Plot in focus', 'zoom out', () => this.active.zoom(0.8), true],
      ['Shift+ArrowLeft', 'Plot in focus', 'pan to the left', () => this.pan(-PAN), true],
      ['Shift+ArrowRight', 'Plot in focus', 'pan to the right', () => this.pan(PAN), true],
      ['f', 'Plot in focus', 'show all', () => this.fit(), false],
      ['Escape', 'Plot in focus', 'forget the cell', () => this.forget(), false],
      ['?', 'Help', 'this list', () => element('help').showModal(), false, 'help'],
    ].map(([key, group, what, run, repeats, button]) => ({ key, group, what, run, repeats, button }));
  }

  plot() {
    return this.active;
  }

  // Something is known of more instants.
  overview() {
    const { count, says, done, events, samples } = this.source;
    const slider = element('now');
    slider.max = String(Math.max(0, count - 1));
    const unit = this.isLive ? `live from ${this.about.name}` : `${count} instants`;
    this.say(done && this.isLive ? says : `${unit}${says && !done ? `; ${says}` : ''}`);
    if (done && (this.isLive || says.startsWith('failed'))) this.complain(says);
    showEvents(events);
    if (this.number < 0 && count > 0) this.goTo(this.isLive ? count - 1 : 0, true);
    // until an estimator has settled nothing is called visible, and a broadcast says nothing before its first map
    const saysSomething = this.about.labelled
      ? (sample) => sample.tv + sample.fv > 0
      : (sample) => sample.unknown < 1;
    const begins = samples.findIndex((sample) => sample && saysSomething(sample));
    // an address that ends in #SECONDS leads to that moment, once it is there
    const asked = Number(location.hash.slice(1) || NaN);
    const isThere = samples.some((sample) => sample && sample.time_s >= asked);
    if (!this.isLive && !this.touched && isThere && !this.led) {
      this.led = true;
      this.goTo(this.source.nearest(asked), true);
    } else if (!this.isLive && !this.touched && !this.led && begins > 0 && this.number < begins) this.goTo(begins, true);
    this.fitTime(samples);
    this.plots.time.changed();
  }

  fitTime(samples) {
    const known = samples.filter(Boolean);
    if (known.length === 0) return;
    const [first, last] = [known[0].time_s, known[known.length - 1].time_s];
    const { view } = this.plots.time;
    const untouched = !this.shownTimes || (view.left === this.shownTimes[0] && view.right === this.shownTimes[1]);
    if (!untouched) return;
    const left = this.isLive ? Math.max(first, last - RECENT_S) : first;
    const right = Math.max(left + 1, this.isLive ? Math.max(last, left + 10) : last);
    this.plots.time.show({ left, right, bottom: 0, top: 100 });
    this.shownTimes = [left, right];
  }

  arrived(instant) {
    this.fitTime(this.source.samples);
    element('now').max = String(this.source.count - 1);
    if (this.following || this.number < 0) this.show(instant);
    else this.plots.time.changed();
  }

  async goTo(number, follows = false) {
    if (!follows) [this.following, this.touched] = [false, true];
    const wanted = Math.max(this.source.keptFrom ?? 0, Math.min(number, this.source.count - 1));
    if (wanted < 0) return;
    this.wanted = wanted;
    const instant = await this.source.at(wanted);
    // what was wanted meanwhile is shown instead
    if (instant && this.wanted === wanted) this.show(instant);
    this.showPlaying();
  }

  show(instant) {
    const first = this.instant === null || this.instant.maps.length !== instant.maps.length;
    Object.assign(this, { instant, number: instant.number, wanted: instant.number });
    const { x, y, velocity } = instant.points;
    this.layer = { across: x, up: y, size: sizes(velocity), colour: new Uint32Array(x.length).fill(inkColour()) };
    if (first) this.listMaps();
    element('now').value = String(instant.number);
    element('now-text').textContent = `${instant.sample.time_s.toFixed(2)} s`;
    showCounters(instant, this.about);
    showSenders(instant);
    this.redraw();
    // before a map has come there is nothing to fit
    if (!this.fitted && instant.maps.length > 0) {
      this.fitted = true;
      this.fit();
    }
    if (this.cell) this.ask();
    this.camera?.show(instant, this.mapsOf('plan')[0]);
  }

  listMaps() {
    const { maps } = this.instant;
    const together = this.of(TOGETHER).length > 1;
    this.names = [...(together ? [TOGETHER] : []), ...maps.map(({ name }) => name)];
    element('map').replaceChildren(...this.names.map((name) => Object.assign(document.createElement('option'), { textContent: name })));
    this.chosen = Math.min(this.chosen, Math.max(0, this.names.length - 1));
    element('map').selectedIndex = this.chosen;
    element('beside-button').hidden = maps.length < 2;
    this.legend();
  }

  // The maps that a plot shows.
  mapsOf(plot) {
    const { instant, names } = this;
    if (!instant || !names?.length) return [];
    const name = plot === 'plan' ? names[this.chosen] : names[(this.chosen + 1) % names.length];
    return this.of(name);
  }

  // The maps of a name. Of a recording's receiver, which has ages, nothing new is to be had.
  of(name) {
    if (name !== TOGETHER) return this.instant.maps.filter((map) => map.name === name);
    return this.instant.maps.filter((map) => this.about.source !== 'recording' || !map.ages_ms);
  }

  redraw() {
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = null;
      if (!this.instant) return;
      for (const name of ['plan', 'second']) {
        if (name === 'second' && element('beside').hidden) continue;
        this.grounds[name].set(this.mapsOf(name));
        const plot = this.plots[name];
        plot.redrawPoints();
        if (plot.area) plot.drawMarks();
        element(`${name}-title`).textContent = this.titleOf(name);
      }
      if (this.plots.time.area) this.plots.time.drawMarks();
      this.drawn = { number: this.number, at: performance.timeOrigin + performance.now() };
    });
  }

  titleOf(name) {
    const maps = this.mapsOf(name);
    const title = maps.length > 1 ? TOGETHER : (maps[0]?.name ?? 'no map has come yet');
    if (name === 'plan' || maps.length !== 1) return title;
    const [own] = this.mapsOf('plan');
    const [a, b] = [own, maps[0]].map((map) => map && codes(map));
    if (!a || a.length !== b.length) return title;
    const differs = a.reduce((sum, code, k) => sum + ((code > 8) !== (b[k] > 8) ? 1 : 0), 0);
    return `${title}: ${differs} of ${a.length} cells are visible in one of the two only`;
  }

  async pick(name, place) {
    for (const map of this.mapsOf(name)) {
      const at = cellAt(map.cells, place);
      if (!at) continue;
      this.cell = { name: map.name, at };
      await this.ask();
      return;
    }
    this.forget();
  }

  async ask() {
    const { cell, instant } = this;
    const index = instant.maps.findIndex(({ name }) => name === cell.name);
    const answer = index < 0 ? null : await fetch(`cell/${instant.number}/${index}/${cell.at.join('/')}`).catch(() => null);
    const told = answer?.ok ? await answer.json() : null;
    if (this.cell !== cell || this.instant !== instant) return;
    this.told = told;
    showCell(told, instant, cell.name);
    for (const name of ['plan', 'second']) this.plots[name].changed();
  }

  forget() {
    [this.cell, this.told] = [null, null];
    showCell(null);
    for (const name of ['plan', 'second']) this.plots[name].changed();
  }

  toggle(layer) {
    this.layers[layer] = !this.layers[layer];
    document.querySelector(`[data-key="${layer}"]`).setAttribute('aria-pressed', String(this.layers[layer]));
    this.redraw();
  }

  choose(index) {
    this.chosen = index;
    element('map').selectedIndex = index;
    this.redraw();
    if (this.instant) this.camera?.show(this.instant, this.mapsOf('plan')[0]);
  }

  beside() {
    if (element('beside-button').hidden) return;
    element('beside').hidden = !element('beside').hidden;
    element('beside-button').setAttribute('aria-pressed', String(!element('beside').hidden));
    // when both have their new size
    setTimeout(() => {
      this.plots.second.show(this.plots.plan.view);
      this.redraw();
    }, 60);
  }

  // All of the map: what is labelled or detected, or its field of view.
  fit() {
    if (this.active === this.plots.time && this.shownTimes) {
      this.shownTimes = null;
      this.fitTime(this.source.samples);
      return;
    }
    const places = this.instant?.maps.flatMap(({ cells: { mount: [x, y, , heading], azimuth_rad: ends, cell_m: size, ranges } }) => {
      const reach = size * ranges;
      return [[x, y], ...Array.from({ length: 17 }, (_, k) => heading + ends[0] + ((ends[1] - ends[0]) * k) / 16).map((angle) => [x + reach * Math.cos(angle), y + reach * Math.sin(angle)])];
    });
    if (!places?.length) return;
    // of what is beside the road little is of interest
    const [{ cells }] = this.instant.maps;
    const road = this.instant.boxes.map(({ center }) => center).filter((center) => cellAt(cells, center));
    const wanted = road.length > 3 ? [...road, places[0]] : places;
    const side = (k) => [Math.min(...wanted.map((p) => p[k])), Math.max(...wanted.map((p) => p[k]))];
    const [[left, right], [bottom, top]] = [side(0), side(1)];
    for (const name of ['plan', 'second']) this.plots[name].show({ left: left - 6, right: right + 6, bottom: bottom - 6, top: top + 6 });
    this.redraw();
  }

  pan(share) {
    const { view } = this.active;
    this.active.on.view(this.active, panned(view, share * (view.right - view.left), 0));
  }

  skip(seconds) {
    const now = this.source.samples[this.number];
    if (now) this.goTo(this.source.nearest(now.time_s + seconds));
  }

  toEnd() {
    this.following = this.isLive;
    this.goTo(this.source.count - 1, this.isLive);
  }

  faster() {
    const speed = element('speed');
    speed.selectedIndex = (speed.selectedIndex + 1) % speed.options.length;
  }

  // To the next instant where something goes wrong that was right one before.
  jump(kind, way) {
    const { samples } = this.source;
    const wrong = (k) => samples[k]?.[kind] > 0;
    const begins = (k) => wrong(k) && (!wrong(k - 1) || samples[k][kind] > samples[k - 1][kind]);
    for (let k = this.number + way; k >= 0 && k < samples.length; k += way) {
      if (begins(k)) {
        this.playing = false;
        this.goTo(k);
        return;
      }
    }
    this.message(`no ${kind.toUpperCase()} ${way > 0 ? 'after' : 'before'} this`);
  }

  play() {
    if (this.isLive) {
      this.following = !this.following;
      if (this.following) this.toEnd();
    } else {
      this.playing = !this.playing;
      if (this.playing) this.run();
    }
    this.showPlaying();
  }

  showPlaying() {
    element('play').textContent = this.isLive ? (this.following ? 'Hold' : 'Follow') : this.playing ? 'Pause' : 'Play';
  }

  async run() {
    if (this.number >= this.source.count - 1) await this.goTo(0);
    let last = performance.now();
    let time = this.source.samples[this.number]?.time_s ?? 0;
    const step = async (now) => {
      if (!this.playing) return;
      const shown = this.source.samples[this.number]?.time_s ?? 0;
      const speed = Number(element('speed').value);
      // where the page was moved meanwhile, it goes on from there
      if (Math.abs(shown - time) > 1 + speed) time = shown;
      time += (Math.min(now - last, 250) / 1000) * speed;
      last = now;
      const next = this.source.nearest(time);
      for (let k = 1; k <= 8; k += 1) if (next + k < this.source.count) this.source.at(next + k);
      if (next !== this.number) await this.goTo(next);
      if (next >= this.source.count - 1) {
        this.playing = false;
        this.showPlaying();
      }
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  legend() {
    const colours = codeColours().map((colour) => colour && `rgb(${colour.join(' ')})`);
    // a broadcast may say no more than visible or not
    const carries = (what) => this.about.source === 'recording' || Boolean(this.instant?.senders.some(({ header }) => header?.[what]));
    const entries = carries('grades')
      ? [
        ['visible (paler: less sure)', { background: `linear-gradient(90deg, ${colours[15]}, ${colours[9]})` }],
        ['invisible (paler: less sure)', { background: `linear-gradient(90deg, ${colours[1]}, ${colours[7]})` }],
      ]
      : [['visible', { background: colours[15] }], ['invisible', { background: colours[1] }]];
    if (carries('occupancy')) entries.push(['occupied', { background: colours[16] }]);
    entries.push(['unknown', {}]);
    if (this.about.source === 'recording') entries.push(['obstacle', { background: css('--quiet') }]);
    if (this.about.labelled) {
      entries.push(['TV: visible and detected', { borderColor: css('--tv'), borderWidth: '2px' }]);
      entries.push(['TI: invisible, not detected', { borderColor: css('--ti'), borderStyle: 'dashed', borderWidth: '2px' }]);
      entries.push(['▾ FV: visible, not detected', { borderColor: css('--fv'), borderStyle: 'dashed', borderWidth: '2px' }]);
      entries.push(['▪ FI: invisible, yet detected', { borderColor: css('--fi'), borderWidth: '2px' }]);
    }
    const rows = entries.map(([text, style]) => [text, style, '']);
    for (const [name, colour, dash] of LINES) {
      const borderTopStyle = dash.length === 0 ? 'solid' : dash[0] > 5 ? 'dashed' : 'dotted';
      rows.push([`${name} over time`, { borderTopColor: css(colour), borderTopStyle }, 'line']);
    }
    element('legend').replaceChildren(...rows.map(([text, style, kind]) => {
      const [span, mark] = [document.createElement('span'), document.createElement('i')];
      mark.className = kind;
      Object.assign(mark.style, style);
      span.append(mark, text);
      return span;
    }));
  }

  say(text) {
    element('state').textContent = text;
  }

  message(text) {
    const line = element('message');
    line.textContent = text;
    line.hidden = text === '';
    clearTimeout(this.fades);
    this.fades = setTimeout(() => (line.hidden = true), 4000);
  }

  // What does not go away by itself.
  complain(text) {
    this.message(text);
    clearTimeout(this.fades);
  }
}

const inkColour = () => (matchMedia('(prefers-color-scheme: dark)').matches ? 0xffe8eaed : 0xff161210);

const page = new Page();
globalThis.viewshed = page;
page.start().catch((error) => {
  element('state').textContent = error.message;
  element('state').dataset.kind = 'failed';
});

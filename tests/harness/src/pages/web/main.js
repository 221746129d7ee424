// The page of `viewshed label`: brings recording, plots, session, keys and saving together.

import { Camera } from './camera.js';
import { faint, rcsColours, STRONGEST_DBSM, trackColours, unlabelled, WEAKEST_DBSM } from './colours.js';
import { Ground } from './ground.js';
import { listen } from './keys.js';
import { drawMarks, hit, hitOffered } from './marks.js';
import { Panel } from './panel.js';
import { Plot } from './plot.js';
import { sizes } from './points.js';
import { firstFrom, frameAt, loadRecording } from './recording.js';
import { Saver } from './saving.js';
import { Session } from './session.js';
import { begins, CLASSES, ends } from './tracks.js';
import { panned } from './view.js';

const element = (id) => document.getElementById(id);
// Share of a view that one press pans.
const PAN = 0.15;
// Space around a track that is shown whole: seconds and metres.
const AROUND_S = 1;
const AROUND_M = 12;
// Seconds of a recording that are shown at first.
const FIRST_S = 20;
// How long the mouse rests before the way that following would give is shown, milliseconds.
const LOOK_MS = 300;

class Page {
  constructor(recording) {
    this.recording = recording;
    this.session = new Session(recording, (what) => this.changed(what));
    this.saver = new Saver({ state: (kind, text) => this.state(kind, text), reload: () => this.reload(), boxes: (list) => this.boxes(list) });
    this.session.canWrite = () => this.saver.writable;
    this.size = sizes(recording.velocity);
    this.ground = new Ground(recording, () => this.plots.plan.refresh());
    this.camera = new Camera(recording);
    this.fillColours();
    this.plots = {};
    this.addPlot('along', { across: 'time (s)', up: 'along the road, x (m)' }, recording.time, recording.x);
    this.addPlot('across', { across: 'time (s)', up: 'across, y to the left (m)' }, recording.time, recording.y);
    this.addPlot('plan', { across: 'along the road, x (m)', up: 'to the left, y (m)', square: true, least: 2 }, recording.x, recording.y);
    this.active = this.plots.along;
    this.panel = new Panel(this.session, { select: (id) => this.choose(id) });
    this.showAll();
    this.show('along', { ...this.plots.along.view, left: -0.5, right: Math.min(FIRST_S, this.session.duration + 0.5) });
    this.timeControls();
    listen(this);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.recolour());
    addEventListener('beforeunload', (event) => {
      if (this.saver.unsaved) event.preventDefault();
    });
    this.panel.update();
    this.panel.legend(this.session.colouring);
    this.changed('time');
  }

  plot() {
    return this.active;
  }

  addPlot(name, axes, across, up) {
    const plan = name === 'plan';
    const source = {
      layer: () => ({ across, up, size: this.size, colour: this.colours }),
      faint: () => this.faint,
      chosen: () => this.session.chosen,
      range: (view) => (plan ? this.timeRange(this.session.now - this.session.window, this.session.now + this.session.window) : this.timeRange(view.left, view.right)),
      ground: plan ? () => this.ground : undefined,
      marks: (plot, context) => drawMarks(plot, context, this.session),
    };
    const on = {
      view: (plot, view) => this.show(plot.name, view),
      press: (plot, place) => this.press(plot, place),
      drag: (plot, place, taken) => taken.point !== null && this.session.move(plot.name, taken.point, place, taken),
      release: (plot, place, moved, taken) => this.release(plot, place, moved, taken),
      brush: (plot, area) => this.session.brushed(plot.name, area),
      point: (plot) => this.pointAt(plot),
    };
    const plot = new Plot(element(name), { name, ...axes }, source, on);
    plot.element.addEventListener('focus', () => {
      this.active = plot;
    });
    this.plots[name] = plot;
  }

  timeRange(from, to) {
    return [firstFrom(this.recording.time, from), firstFrom(this.recording.time, to + 1e-4)];
  }

  // The two plots over time show the same time.
  show(name, view) {
    this.plots[name].show(view);
    const other = { along: 'across', across: 'along' }[name];
    if (other) this.plots[other].show({ ...this.plots[other].view, left: view.left, right: view.right });
  }

  press(plot, place) {
    if (this.session.drawing !== null || this.session.pointing) return null;
    return hit(plot, this.session, plot.toPixel(...place));
  }

  release(plot, place, moved, taken) {
    const { session } = this;
    if (moved) return;
    if (session.pointing) session.follow(plot.name, place);
    else if (session.drawing !== null) session.draw(plot.name, place);
    else if (taken) session.select(taken.id, taken.point);
    else {
      session.select(null);
      if (plot.name !== 'plan') session.goTo(place[0]);
    }
  }

  // What the cursor is on, for the keyboard.
  pick() {
    const cursor = this.active.here();
    const taken = this.press(this.active, cursor);
    this.release(this.active, cursor, false, taken);
  }

  // The proposal at the mouse or cursor, and where following would lead from it.
  pointAt(plot) {
    const { session } = this;
    session.lookAway();
    clearTimeout(this.resting);
    const place = plot.cursor;
    const rests = () => plot.cursor === place;
    if (place) this.resting = setTimeout(() => rests() && session.look(plot.name, place, rests), LOOK_MS);
    const before = session.pointed;
    session.pointed = plot.cursor ? hitOffered(plot, session, plot.toPixel(...plot.cursor)) : null;
    if (session.pointed === before) return;
    this.panel.proposal();
    for (const other of Object.values(this.plots)) other.changed();
  }

  // From where the mouse is, or the cursor; the button waits for a click, since the mouse is on it.
  follow(button) {
    if (button) {
      this.session.pointAt();
      return;
    }
    const under = Object.values(this.plots).find((plot) => plot.element.matches(':hover'));
    const plot = under ?? this.active;
    this.session.follow(plot.name, plot.here());
  }

  // Whether the way from where the mouse rests is shown.
  looks() {
    const { session } = this;
    session.looks = !session.looks;
    session.lookAway();
    session.say(session.looks ? 'Where following would lead is shown while the mouse rests.' : 'Where following would lead is not shown.');
  }

  nudge(right, up) {
    const { session, active } = this;
    if (!session.track || session.point === null) return;
    const { x, y } = this.pixelSize(active);
    const [time, px, py] = session.track.points[session.point];
    const place = { along: [time, px], across: [time, py], plan: [px, py] }[active.name];
    session.move(active.name, session.point, [place[0] + right * x, place[1] + up * y], `nudge ${session.selected} ${session.point}`);
  }

  pixelSize({ view, area }) {
    return { x: (view.right - view.left) / area.width, y: (view.top - view.bottom) / area.height };
  }

  pan(right, up) {
    const { view, name } = this.active;
    this.show(name, panned(view, right * PAN * (view.right - view.left), up * PAN * (view.top - view.bottom)));
  }

  showAll() {
    const { x, y, mount } = this.recording;
    const [x0, x1] = extent(x, mount[0]);
    const [y0, y1] = extent(y, mount[1]);
    const time = { left: -0.5, right: this.session.duration + 0.5 };
    this.show('along', { ...time, bottom: x0, top: x1 });
    this.show('across', { ...time, bottom: y0, top: y1 });
    this.show('plan', { left: x0, right: x1, bottom: y0, top: y1 });
  }

  fit(list = this.session.track ? [this.session.track] : this.session.proposals.offered.map(({ track }) => track)) {
    if (list.length === 0) return;
    const points = list.flatMap((track) => track.points);
    const of = (k, space) => {
      const values = points.map((point) => point[k]);
      return [Math.min(...values) - space, Math.max(...values) + space];
    };
    const [[t0, t1], [x0, x1], [y0, y1]] = [of(0, AROUND_S), of(1, AROUND_M), of(2, AROUND_M)];
    this.plots.across.show({ left: t0, right: t1, bottom: y0, top: y1 });
    this.show('along', { left: t0, right: t1, bottom: x0, top: x1 });
    this.show('plan', { left: x0, right: x1, bottom: y0, top: y1 });
    this.session.goTo((t0 + t1) / 2);
    if (this.session.brush?.plot === 'lane') this.session.showLane();
  }

  choose(id) {
    this.session.select(id);
    this.fit();
  }

  classify(k) {
    this.session.classify(CLASSES[k]);
  }

  focusId() {
    element('track-id').focus();
    element('track-id').select();
  }

  // The time of the cursor; seen from above that of the slider.
  time() {
    return this.active.name === 'plan' ? this.session.now : this.active.here()[0];
  }

  split() {
    this.session.split(this.time());
  }

  cut(after) {
    this.session.cut(this.time(), after);
  }

  escape() {
    const { session } = this;
    if (session.pointing) session.pointAt(false);
    else if (session.drawing !== null) session.finish();
    else if (session.selected !== null) session.select(null);
    else session.brushed(null, null);
    session.joining = null;
  }

  brush() {
    this.session.brushed(this.active.name, this.session.brush ? null : this.active.view);
  }

  timeHere() {
    if (this.active.name !== 'plan') this.session.goTo(this.active.here()[0]);
  }

  nextPlot() {
    const names = Object.keys(this.plots);
    this.plots[names[(names.indexOf(this.active.name) + 1) % names.length]].element.focus();
  }

  later() {
    const { proposals, track } = this.session;
    // after mending it brings back what is offered
    if (track) proposals.shown = false;
    else if (proposals.shown) proposals.later();
    this.session.select(null);
    this.changed('proposal');
  }

  together() {
    this.session.proposals.toggle();
    this.session.select(null);
    this.changed('proposal');
  }

  play() {
    this.playing = !this.playing;
    element('play').textContent = this.playing ? 'Stop' : 'Play';
    let [last, start] = [performance.now(), this.session.now];
    if (start >= this.session.duration) start = 0;
    const next = (now) => {
      if (!this.playing) return;
      start += (now - last) / 1000;
      last = now;
      this.session.goTo(start);
      if (start < this.session.duration) requestAnimationFrame(next);
      else this.play();
    };
    if (this.playing) requestAnimationFrame(next);
  }

  help() {
    element('help').showModal();
  }

  colour() {
    this.session.colouring = this.session.colouring === 'rcs' ? 'track' : 'rcs';
    this.recolour();
  }

  recolour() {
    this.fillColours();
    this.panel.legend(this.session.colouring);
    for (const plot of Object.values(this.plots)) {
      plot.refresh();
      plot.changed();
    }
  }

  // The colour of every detection.
  fillColours() {
    const { count, rcs } = this.recording;
    this.faint = new Uint32Array(count).fill(faint());
    if (this.session.colouring === 'rcs') {
      const scale = rcsColours();
      const none = unlabelled();
      this.colours = Uint32Array.from(rcs, (value) => {
        if (Number.isNaN(value)) return none;
        return scale[Math.round(Math.min(Math.max((value - WEAKEST_DBSM) / (STRONGEST_DBSM - WEAKEST_DBSM), 0), 1) * 255)];
      });
    } else {
      const [palette, none] = [trackColours(), unlabelled()];
      this.colours = Uint32Array.from(this.session.belonging(), (index) => (index < 0 ? none : palette[index % palette.length]));
    }
  }

  timeControls() {
    const slider = element('now');
    slider.max = this.recording.frame_times_s.length - 1;
    slider.addEventListener('input', () => this.session.goTo(this.recording.frame_times_s[slider.value]));
    element('window').addEventListener('change', (event) => {
      this.session.window = Number(event.target.value);
      this.changed('time');
    });
  }

  changed(what) {
    const { session, plots } = this;
    if (!plots?.plan) return;
    if (what === 'message') {
      element('message').hidden = session.message === '';
      element('message').textContent = session.message;
      return;
    }
    if (what === 'time') {
      const frame = frameAt(this.recording, session.now);
      element('now').value = frame;
      element('now-text').textContent = `${session.now.toFixed(2)} s`;
      element('now').setAttribute('aria-valuetext', `${session.now.toFixed(2)} seconds`);
      this.ground.show(frame);
      this.camera.show(frame);
      plots.plan.refresh();
    }
    if (what === 'tracks') this.saver.save(session.tracks);
    if (what === 'tracks' || what === 'opened') {
      if (session.colouring === 'track') this.recolour();
    }
    if (what === 'points') for (const plot of Object.values(plots)) plot.refresh();
    if (what === 'proposal') this.showProposal();
    this.panel?.update();
    for (const plot of Object.values(plots)) plot.changed();
  }

  // What is offered, fitted into all plots; it may be decided about once it has been drawn. What is left of it stays.
  showProposal() {
    const { proposals } = this.session;
    const { current, offered, shown, together } = proposals;
    if (!current && this.session.brush?.plot === 'lane') this.session.brushed(null, null);
    // what is being changed is not taken out of sight
    if (!current || shown || this.session.selected !== null) return;
    this.fit(offered.map(({ track }) => track));
    // fitting has shown it, where a lane was shown before
    if (this.session.lanes && this.session.brush?.plot !== 'lane') this.session.showLane();
    const same = () => proposals.current === current && proposals.together === together;
    requestAnimationFrame(() => requestAnimationFrame(() => same() && proposals.seen()));
  }

  state(kind, text) {
    const line = element('state');
    line.textContent = text;
    line.dataset.kind = kind;
    if (kind === 'failed' || kind === 'conflict') this.session.say(text);
    else if (kind === 'saved') this.session.say(this.session.message.startsWith('not saved') ? '' : this.session.message);
  }

  boxes(list) {
    this.session.boxes = new Map(list.map((box) => [box.id, box]));
    this.plots.plan.changed();
  }

  // The labels as they are in the file.
  async reload() {
    this.session.open(await this.saver.read());
  }
}

// Least and most of values with some space; places far outside, clutter mostly, do not stretch it.
function extent(values, always) {
  const step = Math.max(1, Math.floor(values.length / 5000));
  const some = values.filter((_, k) => k % step === 0).sort();
  const [low, high] = [0.01, 0.99].map((share) => some[Math.floor(some.length * share)] ?? share);
  const [from, to] = [Math.min(low, always), Math.max(high, always)];
  const space = 0.05 * (to - from) + 1;
  return [from - space, to + space];
}

async function start() {
  const began = performance.now();
  const recording = await loadRecording();
  document.title = `${recording.name} – viewshed label`;
  element('name').textContent = recording.name;
  const page = new Page(recording);
  globalThis.viewshed = page;
  try {
    await page.reload();
  } catch (error) {
    page.session.canWrite = () => false;
    page.state('failed', error.message);
    return;
  }
  page.saver.hold();
  page.loaded = performance.now() - began;
  document.documentElement.dataset.ready = 'true';
  let touched = false;
  for (const kind of ['keydown', 'pointerdown', 'wheel']) addEventListener(kind, () => (touched = true), { capture: true, once: true });
  await page.session.proposals.load(() => page.session.tracks);
  if (touched) page.panel.update();
  else page.changed('proposal');
}

start().catch((error) => {
  element('state').textContent = error.message;
  element('state').dataset.kind = 'failed';
});

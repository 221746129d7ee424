// What is drawn and chosen, and everything a key or click can do to it.

import { guess } from './guess.js';
import { History } from './history.js';
import { Proposals } from './proposals.js';
import { firstFrom, frameAt } from './recording.js';
import * as tracks from './tracks.js';
import { onWays } from './ways.js';

const READ_ONLY = 'This page may only read: see the line at the top.';
// The coordinate that a plot does not show.
const MISSING = { along: 'y', across: 'x' };
// Reflections this far across from a track belong to its lane, metres.
const LANE_M = 2.5;
// A time after the last point of a track that still is of it, seconds.
const LEAST_S = 0.0005;

export class Session {
  // changed(what): 'tracks', 'selection', 'time', 'points' or 'message'.
  constructor(recording, changed) {
    this.recording = recording;
    this.changed = changed;
    this.history = new History([]);
    this.proposals = new Proposals();
    // what was decided about which proposals, with the tracks before and after; and the one at the mouse or cursor
    this.decisions = [];
    this.pointed = null;
    this.selected = null;
    this.point = null;
    this.drawing = null;
    this.joining = null;
    // the class of new tracks, whether the next click is to be followed, and whether the answer to one is waited for
    this.kind = 'car';
    this.pointing = false;
    this.following = false;
    // whether the way from where the mouse rests is shown, whether it is being looked for, what is then looked for next, and
    // that way: { plot, place, tracks, before, track }
    this.looks = true;
    this.looking = false;
    this.lookNext = null;
    this.way = null;
    this.now = 0;
    this.window = 0.25;
    this.colouring = 'rcs';
    this.lanes = true;
    this.brush = null;
    this.chosen = null;
    this.message = '';
    // of the saved tracks, by id: { size_m, steps: [[time, x, y, heading], ...] }
    this.boxes = new Map();
    this.canWrite = () => true;
    this.guessed = new WeakSet();
    this.duration = recording.frame_times_s.at(-1) ?? 0;
  }

  get tracks() {
    return this.history.tracks;
  }

  get track() {
    return this.selected === null ? null : tracks.find(this.tracks, this.selected);
  }

  say(message) {
    this.message = message;
    this.changed('message');
  }

  // A change of the tracks, unless this page may only read.
  change(next, movement = null) {
    if (!this.canWrite()) {
      this.say(READ_ONLY);
      return false;
    }
    this.history.change(next, movement);
    this.say('');
    this.changed('tracks');
    return true;
  }

  // The tracks in the file; the way back begins anew.
  open(list) {
    this.history = new History(list);
    this.decisions = [];
    this.drawing = null;
    this.select(null);
    this.changed('opened');
  }

  undo() {
    this.stepped('undo');
  }

  redo() {
    this.stepped('redo');
  }

  stepped(what) {
    if (!this.canWrite()) return this.say(READ_ONLY);
    const from = this.tracks;
    if (!this.history[what]()) return this.say(`There is nothing to ${what}.`);
    const decided = this.decisions.find(({ before, after }) => (before === from && after === this.tracks) || (after === from && before === this.tracks));
    if (decided) {
      if (what === 'undo') this.proposals.put(decided.taken);
      else this.proposals.take(decided.taken);
      this.changed('proposal');
    }
    this.drawing = null;
    if (!this.track) this.select(null);
    this.point = null;
    this.say('');
    return this.changed('tracks');
  }

  select(id, point = null) {
    this.selected = id;
    this.point = point;
    if (this.drawing !== id) this.finish();
    this.changed('selection');
  }

  // The next or previous track in the order of time.
  selectNext(step) {
    const order = this.tracks.toSorted((a, b) => tracks.begins(a) - tracks.begins(b));
    if (order.length === 0) return;
    const at = order.findIndex((track) => track.id === this.selected);
    const next = at < 0 ? (step > 0 ? 0 : order.length - 1) : (at + step + order.length) % order.length;
    this.select(order[next].id);
  }

  selectPoint(step) {
    if (!this.track) return;
    const count = this.track.points.length;
    this.select(this.selected, this.point === null ? (step > 0 ? 0 : count - 1) : (this.point + step + count) % count);
  }

  // Begins a track; it exists with its first point.
  begin() {
    if (!this.canWrite()) return this.say(READ_ONLY);
    if (this.brush?.plot === 'lane') this.brushed(null, null);
    this.drawing = tracks.newId(this.tracks);
    this.selected = this.drawing;
    this.point = null;
    this.say('Drawing: click or press space along the reflections, Enter ends.');
    return this.changed('selection');
  }

  extend() {
    if (!this.canWrite()) return this.say(READ_ONLY);
    if (!this.track) return this.say('Select a track first.');
    this.drawing = this.selected;
    this.say('Drawing on: click or press space for more points, Enter ends.');
    return this.changed('selection');
  }

  finish() {
    if (this.drawing === null) return;
    const drawn = tracks.find(this.tracks, this.drawing);
    this.drawing = null;
    if (drawn && drawn.points.length < 2) {
      this.change(tracks.without(this.tracks, drawn.id));
      this.say('A track of one point is none.');
    } else {
      this.say('');
    }
    this.changed('selection');
  }

  // A point at a place of a plot, which gives two of time, x and y.
  draw(plot, [a, b]) {
    const old = tracks.find(this.tracks, this.drawing) ?? { id: this.drawing, class: this.kind, points: [] };
    const time = plot === 'plan' ? this.now : a;
    if (time < 0 || time > this.duration) return this.say('The recording has no reflections at this time.');
    const missing = MISSING[plot];
    const point = this.placed(old, plot, [a, b]);
    if (missing) this.guessed.add(point);
    const { track, index } = tracks.withPoint(old, point);
    const next = missing ? this.guessedAgain(track, missing) : track;
    if (this.change(tracks.withTrack(this.tracks, next))) this.select(next.id, index);
    return undefined;
  }

  // A place of a plot as time, x and y.
  placed(track, plot, [a, b]) {
    const missing = MISSING[plot];
    return missing ? this.completed(track, a, missing, b) : [this.now, a, b];
  }

  // The next click says what to follow.
  pointAt(begins = true) {
    this.pointing = begins && this.canWrite();
    if (begins && !this.pointing) this.say(READ_ONLY);
    else this.say(begins ? 'Click on a vehicle to have it followed; Escape leaves it.' : '');
  }

  // The way of what is at a place of a plot, for the selected track or a new one: { track }, or { why } there is none.
  async wayFrom(plot, place) {
    const before = this.track;
    const track = before ?? { id: tracks.newId(this.tracks), class: this.kind, points: [] };
    const click = this.placed(track, plot, place);
    const others = this.tracks.filter((other) => other !== before && other.points.length > 1);
    let answer = null;
    try {
      const body = JSON.stringify({ track, click, others });
      answer = await fetch('follow', { method: 'POST', headers: { 'content-type': 'application/json' }, body });
    } catch {
      return { why: 'The server does not answer: nothing was followed.' };
    }
    if (answer.status === 202) return { why: 'The reflections are not sorted yet: press G again in a moment.' };
    if (answer.status === 204) return { why: 'There is nothing to follow: point at reflections of a vehicle, or set points with N.' };
    return answer.ok ? { track: await answer.json() } : { why: (await answer.text()).trim() };
  }

  // Shows where following would lead from a place at which the mouse rests; `rests` says whether it still does. There is one
  // question at a time: of the places at which the mouse comes to rest before its answer, the last is asked next.
  async look(plot, place, rests) {
    const mayFollow = this.pointing || this.track || !this.proposals.shown;
    if (!rests() || !this.looks || this.following || this.drawing !== null || !mayFollow || !this.canWrite()) return;
    this.lookNext = this.looking ? [plot, place, rests] : null;
    if (this.looking) return;
    const { tracks: all, track: before } = this;
    this.looking = true;
    const { track } = await this.wayFrom(plot, place);
    this.looking = false;
    if (this.lookNext) this.look(...this.lookNext);
    if (!track || !rests() || this.tracks !== all || this.track !== before) return;
    this.way = { plot, place, tracks: all, before, track };
    this.changed('way');
  }

  // The way that is shown is none any more.
  lookAway() {
    if (this.way === null) return;
    this.way = null;
    this.changed('way');
  }

  // The way that is shown, unless something has changed since.
  get shownWay() {
    const { way } = this;
    return way && way.tracks === this.tracks && way.before === this.track ? way : null;
  }

  // Follows what is at a place of a plot: a new way for the selected track, or a new track.
  async follow(plot, place) {
    this.pointing = false;
    if (!this.canWrite()) return this.say(READ_ONLY);
    if (this.following) return undefined;
    this.finish();
    const before = this.track;
    const shown = this.shownWay;
    let found = shown?.plot === plot && shown.place.every((v, k) => v === place[k]) ? shown : null;
    this.lookAway();
    if (!found) {
      this.following = true;
      this.say('Following.');
      found = await this.wayFrom(plot, place);
      this.following = false;
    }
    const followed = found.track;
    if (!followed) return this.say(found.why);
    // it may have been changed or deleted meanwhile
    if (tracks.find(this.tracks, followed.id) !== before) return this.say('The track was changed meanwhile: press G again.');
    if (!this.change(tracks.withTrack(this.tracks, followed))) return undefined;
    this.select(followed.id);
    return this.say(`Track ${followed.id}: ${tracks.begins(followed).toFixed(1)} to ${tracks.ends(followed).toFixed(1)} s; Ctrl+Z takes it back.`);
  }

  // A point with the coordinate that the plot does not show.
  completed(track, time, missing, value) {
    const place = missing === 'y' ? 2 : 1;
    const speed = track.points.length > 1 ? tracks.velocity(track)[missing === 'y' ? 0 : 1] : null;
    const near = track.points.at(-1)?.[place] ?? tracks.positionAt(track, time)?.[place - 1] ?? 0;
    const found = guess(this.recording, time, missing, value, speed, this.chosen) ?? near;
    return missing === 'y' ? [time, value, found] : [time, found, value];
  }

  // Guesses of earlier points are better once the speed is known.
  guessedAgain(track, missing) {
    const points = track.points.map((point) => {
      if (!this.guessed.has(point)) return point;
      const again = this.completed(track, point[0], missing, missing === 'y' ? point[1] : point[2]);
      this.guessed.add(again);
      return again;
    });
    return { ...track, points };
  }

  // Moves the chosen point to a place of a plot.
  move(plot, index, [a, b], movement) {
    const [time, x, y] = this.track.points[index];
    const to = { along: [a, b, y], across: [a, x, b], plan: [time, a, b] }[plot];
    this.point = index;
    return this.change(tracks.withTrack(this.tracks, tracks.movedPoint(this.track, index, to)), movement);
  }

  remove() {
    const { track } = this;
    if (!track) return this.say('Select a track or point first.');
    if (this.point === null || track.points.length <= 2) return this.removeTrack();
    const next = tracks.withTrack(this.tracks, tracks.withoutPoint(track, this.point));
    if (this.change(next)) this.select(track.id, Math.min(this.point, track.points.length - 2));
    return undefined;
  }

  removeTrack() {
    if (!this.track) return this.say('Select a track first.');
    if (this.change(tracks.without(this.tracks, this.selected))) this.select(null);
    return undefined;
  }

  split(time) {
    if (!this.track) return this.say('Select a track first.');
    const cut = tracks.split(this.tracks, this.selected, time);
    if (!cut) return this.say(`Track ${this.selected} has nothing on both sides of ${time.toFixed(2)} s.`);
    if (this.change(cut.tracks)) this.select(cut.id);
    return undefined;
  }

  // What the selected track has before a time goes, or what it has after.
  cut(time, after) {
    if (!this.track) return this.say('Select a track first.');
    const left = tracks.cut(this.tracks, this.selected, time, after);
    if (!left) return this.say(`Track ${this.selected} has nothing on both sides of ${time.toFixed(2)} s.`);
    if (this.change(left)) this.select(this.selected);
    return undefined;
  }

  // The first time it remembers the track, the second time it joins.
  join() {
    if (!this.track) return this.say('Select a track first.');
    const first = this.joining;
    if (first === null || first === this.selected || !tracks.find(this.tracks, first)) {
      this.joining = this.selected;
      return this.say(`Join ${this.selected}: select the other track and press J again.`);
    }
    const joined = tracks.join(this.tracks, first, this.selected);
    this.joining = null;
    if (!joined) return this.say(`Tracks ${first} and ${this.selected} overlap in time; split one before joining them.`);
    if (this.change(joined.tracks)) this.select(joined.id);
    return undefined;
  }

  rename(id) {
    const name = id.trim();
    if (!this.track || name === this.selected) return;
    if (name === '') return this.say('A track needs an id.');
    if (tracks.find(this.tracks, name)) return this.say(`There is a track ${name} already; choose another id or join them.`);
    const next = tracks.withTrack(this.tracks, { ...this.track, id: name }, this.selected);
    if (this.change(next)) this.select(name);
    return undefined;
  }

  // Of the selected track, or of the proposal that is pointed at.
  classify(kind) {
    const one = this.proposals.shown ? this.one : null;
    if (!this.track && one) {
      one.track = tracks.classified(one.track, kind);
      return this.changed('proposal');
    }
    if (!this.track) {
      this.kind = kind;
      return this.say(`The class of new tracks is ${kind}.`);
    }
    return this.change(tracks.withTrack(this.tracks, tracks.classified(this.track, kind)));
  }

  // The proposal that a key is for: the one that is pointed at, or the only one that is offered.
  get one() {
    const { offered } = this.proposals;
    return offered.length === 1 ? offered[0] : (offered.find((proposal) => proposal === this.pointed) ?? null);
  }

  // Takes all over that are offered.
  accept() {
    const { offered } = this.proposals;
    if (this.decidable()) this.decide(offered, offered);
  }

  // Takes one over and selects it, to be mended.
  mend() {
    const one = this.decidableOne();
    if (one && this.decide([one], [one], true)) this.say(`Track ${this.selected}: drag its points; K shows what is offered.`);
  }

  reject() {
    const one = this.decidableOne();
    if (one) this.decide([one], []);
  }

  // Rejects all that are offered.
  discard() {
    if (this.decidable()) this.decide(this.proposals.offered, []);
  }

  // The one that is pointed at, once it has been shown.
  decidableOne() {
    if (!this.decidable()) return null;
    if (!this.one) this.say('Point at one of the proposals, or press O to see them one by one.');
    return this.one;
  }

  // Takes proposals out, some of them as tracks, of which the last is selected to be mended; one step of the history.
  decide(taken, accepted, mended = false) {
    const before = this.tracks;
    const added = accepted.reduce((all, { track }) => [...all, { ...track, id: tracks.newId(all) }], [...before]);
    if (!this.change(added)) return false;
    this.decisions.push({ before, after: this.tracks, taken });
    this.proposals.take(taken);
    this.pointed = null;
    this.select(mended ? this.tracks.at(-1).id : null);
    this.changed('proposal');
    return true;
  }

  // Whether there is a proposal that has been shown; one that has not is shown now.
  decidable() {
    const { current, shown } = this.proposals;
    if (current && shown) return true;
    this.say(current ? 'These are the next proposals: press again to decide.' : 'There is no proposal.');
    if (current) {
      this.select(null);
      this.changed('proposal');
    }
    return false;
  }

  goTo(time) {
    this.now = Math.min(Math.max(time, 0), this.duration);
    this.changed('time');
  }

  // A number of radar frames on or back.
  step(frames) {
    const times = this.recording.frame_times_s;
    const next = Math.min(Math.max(frameAt(this.recording, this.now) + frames, 0), times.length - 1);
    this.goTo(times[next]);
  }

  // Only reflections in a rectangle of one plot; null for all.
  brushed(plot, area) {
    this.brush = area && { plot, area };
    this.chosen = null;
    if (area) {
      const { count, time, x, y } = this.recording;
      const [across, up] = { along: [time, x], across: [time, y], plan: [x, y] }[plot];
      this.chosen = new Uint8Array(count);
      for (let i = 0; i < count; i += 1) {
        const inside = across[i] >= area.left && across[i] <= area.right && up[i] >= area.bottom && up[i] <= area.top;
        this.chosen[i] = inside ? 1 : 0;
      }
    }
    this.changed('points');
  }

  // Only reflections in the lane of the selected track or the proposal; again for all. It stays so for what comes next.
  lane() {
    this.lanes = this.brush?.plot !== 'lane';
    if (this.lanes) this.showLane();
    else this.brushed(null, null);
  }

  showLane() {
    const shown = this.track ? [this.track] : this.proposals.offered.map(({ track }) => track);
    if (shown.length === 0) {
      this.brushed(null, null);
      return;
    }
    this.brush = { plot: 'lane', area: null };
    this.chosen = onWays(this.recording, shown.filter(({ points }) => points.length > 1), LANE_M);
    this.changed('points');
  }

  // Which reflections lie on which track: index into the tracks, -1 for none.
  belonging() {
    const { count, time, x, y } = this.recording;
    const belongs = new Int32Array(count).fill(-1);
    this.tracks.forEach((track, index) => {
      const [from, to] = [firstFrom(time, tracks.begins(track)), firstFrom(time, tracks.ends(track) + LEAST_S)];
      const [vx, vy] = tracks.velocity(track);
      const speed = Math.hypot(vx, vy) || 1;
      for (let i = from; i < to; i += 1) {
        const at = tracks.positionAt(track, time[i]);
        if (!at) continue;
        const [dx, dy] = [x[i] - at[0], y[i] - at[1]];
        const [on, off] = [(dx * vx + dy * vy) / speed, (dy * vx - dx * vy) / speed];
        if (Math.abs(on) < 10 && Math.abs(off) < 2) belongs[i] = index;
      }
    });
    return belongs;
  }
}

// What there is to see, as the server has it: what is known of all instants, and instants by their number.

import { fetched } from './recording.js';

// Instants that are kept here.
const KEPT = 120;
// How often the server is asked while it is still finding instants, milliseconds.
const ASK_MS = 300;

export class Source {
  // on: { overview(), instant(instant), gone(text) }
  constructor(on) {
    this.on = on;
    this.kept = new Map();
    this.samples = [];
    this.events = [];
    this.count = 0;
    this.done = false;
    this.says = '';
  }

  async open() {
    this.about = await fetched('about').then((answer) => answer.json());
    await this.update();
    if (this.about.source === 'live') this.follow();
    else this.fill();
  }

  // Number of the first sample that is not known.
  get unknown() {
    const hole = this.samples.findIndex((sample) => sample === undefined);
    return hole < 0 ? this.samples.length : hole;
  }

  // Samples that have come since the last time, and those between that were skipped.
  async update() {
    const from = this.unknown;
    const found = await fetched(`overview/${from}`).then((answer) => answer.json());
    // samples of a source without an end are dropped at last; their numbers stay
    for (let k = from; k < found.from; k++) this.samples[k] ??= null;
    found.samples.forEach((sample, k) => (this.samples[found.from + k] = sample));
    const { events, count, done, says, kept_from: keptFrom } = found;
    Object.assign(this, { events, count, done, says, keptFrom });
    this.on.overview();
  }

  async fill() {
    while (!this.done) {
      await new Promise((wake) => setTimeout(wake, ASK_MS));
      try {
        await this.update();
      } catch {
        this.on.gone('the server does not answer; start it again and reload');
        return;
      }
    }
  }

  // The newest instant, again and again.
  async follow() {
    let after = this.count > 0 ? this.count - 1 : 0;
    let events = 0;
    for (;;) {
      let answer;
      try {
        answer = await fetch(`newer/${after}`);
      } catch {
        this.on.gone('the server does not answer; start it again and reload');
        return;
      }
      if (answer.status === 200) {
        const found = await answer.json();
        // the source has ended
        if (found === null) {
          await this.update();
          return;
        }
        const instant = unpacked(found);
        after = instant.number + 1;
        this.keep(instant);
        const skipped = instant.number > this.samples.length;
        this.samples[instant.number] = instant.sample;
        this.count = Math.max(this.count, after);
        this.on.instant(instant);
        const now = instant.senders.map((sender) => `${sender.condition} ${sender.epoch}`).join();
        // what happened, and what was missed meanwhile
        if (skipped || now !== events) await this.update();
        events = now;
      }
    }
  }

  keep(instant) {
    this.kept.delete(instant.number);
    this.kept.set(instant.number, instant);
    if (this.kept.size > KEPT) this.kept.delete(this.kept.keys().next().value);
  }

  // An instant; null where there is none, or none yet.
  async at(number) {
    const here = this.kept.get(number);
    if (here) return here.promise ? here.promise : here;
    const promise = fetched(`instant/${number}`).then(async (answer) => (answer.status === 200 ? unpacked(await answer.json()) : null));
    this.kept.set(number, { number, promise });
    try {
      const instant = await promise;
      if (instant) this.keep(instant);
      else this.kept.delete(number);
      return instant;
    } catch {
      this.kept.delete(number);
      return null;
    }
  }

  // Number of the instant nearest to a time, of those that are known; -1 where none is.
  nearest(time) {
    const known = [];
    this.samples.forEach((sample, number) => sample && known.push(number));
    const timeOf = (k) => this.samples[known[k]].time_s;
    let [low, high] = [0, known.length - 1];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (timeOf(middle) < time) low = middle + 1;
      else high = middle;
    }
    if (low > 0 && time - timeOf(low - 1) < timeOf(low) - time) low -= 1;
    return known[low] ?? -1;
  }
}

// An instant with its maps as bytes.
function unpacked(instant) {
  for (const map of instant.maps) map.bytes = map.bytes === null ? null : Uint8Array.from(atob(map.bytes), (c) => c.charCodeAt(0));
  const pick = (k) => Float32Array.from(instant.detections, (detection) => detection[k]);
  instant.points = { x: pick(0), y: pick(1), velocity: pick(2) };
  return instant;
}

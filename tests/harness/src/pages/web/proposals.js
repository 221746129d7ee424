// Tracks the machine offers: those that drive the same way together, or one after the other. Each is shown before it can
// be accepted.

import { begins, ends, positionAt } from './tracks.js';

// A proposal is left out where a track is already: this near, for this share of its time.
const NEAR_M = 4;
const SHARE = 0.5;

export class Proposals {
  constructor() {
    this.waiting = [];
    this.ready = false;
    this.shown = false;
    this.together = true;
    this.decided = 0;
    // how often something was put off
    this.putOff = 0;
  }

  // Asks until the machine has looked.
  async load(tracks) {
    for (;;) {
      const answer = await fetch('proposals');
      if (answer.status === 200) {
        const all = (await answer.json()).map((proposal, order) => ({ ...proposal, order, round: 0 }));
        this.waiting = all.filter((proposal) => !tracks().some((track) => covers(track, proposal.track)));
        this.sort();
        this.ready = true;
        return;
      }
      if (!answer.ok) throw new Error((await answer.text()).trim());
      await new Promise((resolve) => setTimeout(resolve, 400));
    }
  }

  // Those of one way after one another, the better ones first; what was put off last.
  sort() {
    this.waiting.sort((a, b) => a.round - b.round || a.way - b.way || a.order - b.order);
  }

  get current() {
    return this.waiting[0] ?? null;
  }

  // What is to be decided about.
  get offered() {
    const { current, together } = this;
    if (!current) return [];
    return together ? this.waiting.filter(({ way, round }) => way === current.way && round === current.round) : [current];
  }

  // What is offered has been drawn.
  seen() {
    this.shown = true;
  }

  // One by one, or all of a way.
  toggle() {
    this.together = !this.together;
    this.shown = false;
  }

  // Takes some out; what is left of a way stays as it is shown.
  take(some) {
    const rest = this.offered.filter((proposal) => !some.includes(proposal));
    this.shown &&= this.together && rest.length > 0;
    this.decided += some.length;
    this.waiting = this.waiting.filter((proposal) => !some.includes(proposal));
  }

  // Takes them in again.
  put(some) {
    this.waiting.push(...some);
    this.sort();
    this.decided -= some.length;
    this.shown = false;
  }

  later() {
    this.putOff += 1;
    for (const proposal of this.offered) proposal.round = this.putOff;
    this.sort();
    this.shown = false;
  }
}

function covers(track, other) {
  const [from, to] = [begins(other), ends(other)];
  const times = Array.from({ length: 11 }, (_, k) => from + ((to - from) * k) / 10);
  const near = times.filter((time) => {
    const [a, b] = [positionAt(track, time), positionAt(other, time)];
    return a && b && Math.hypot(a[0] - b[0], a[1] - b[1]) < NEAR_M;
  });
  return near.length >= SHARE * times.length;
}

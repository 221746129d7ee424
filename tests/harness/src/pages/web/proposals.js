// Tracks the machine offers, one after the other: each is shown before it can be accepted.

import { begins, ends, positionAt } from './tracks.js';

// A proposal is left out where a track is already: this near, for this share of its time.
const NEAR_M = 4;
const SHARE = 0.5;

export class Proposals {
  constructor() {
    this.waiting = [];
    this.ready = false;
    this.shown = false;
    this.decided = 0;
  }

  // Asks until the machine has looked.
  async load(tracks) {
    for (;;) {
      const answer = await fetch('proposals');
      if (answer.status === 200) {
        const all = await answer.json();
        this.waiting = all.filter((proposal) => !tracks().some((track) => covers(track, proposal.track)));
        this.ready = true;
        return;
      }
      if (!answer.ok) throw new Error((await answer.text()).trim());
      await new Promise((resolve) => setTimeout(resolve, 400));
    }
  }

  get current() {
    return this.waiting[0] ?? null;
  }

  // The current one has been drawn.
  seen() {
    this.shown = true;
  }

  // Takes the current one out.
  take() {
    this.shown = false;
    this.decided += 1;
    return this.waiting.shift();
  }

  later() {
    this.shown = false;
    if (this.waiting.length > 1) this.waiting.push(this.waiting.shift());
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

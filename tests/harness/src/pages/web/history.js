// What was drawn, and how to get back: every change is one step.

// Steps that are kept.
const DEPTH = 1000;

export class History {
  constructor(tracks) {
    this.tracks = tracks;
    this.past = [];
    this.future = [];
    this.running = null;
  }

  // A new step; further changes of one movement (a drag, a key held down) belong to the same step.
  change(tracks, movement = null) {
    if (tracks === this.tracks) return;
    if (movement === null || movement !== this.running) {
      this.past = [...this.past.slice(1 - DEPTH), this.tracks];
    }
    this.running = movement;
    this.future = [];
    this.tracks = tracks;
  }

  undo() {
    return this.step(this.past, this.future);
  }

  redo() {
    return this.step(this.future, this.past);
  }

  // Takes the last of `from`, keeps what is for `to`; whether there was one.
  step(from, to) {
    if (from.length === 0) return false;
    to.push(this.tracks);
    this.tracks = from.pop();
    this.running = null;
    return true;
  }
}

// Keeps the right to write, and sends every change at once, one after the other.

const AGAIN_MS = 1000;

export class Saver {
  // boxes(list): where the saved tracks' boxes are. state(kind, text): 'saved', 'saving', 'failed', 'read-only' or 'conflict'. reload(): another page may have written.
  constructor({ state, boxes, reload }) {
    this.state = state;
    this.boxes = boxes;
    this.reload = reload;
    this.writer = null;
    this.version = '';
    this.waiting = null;
    this.busy = false;
    this.conflict = false;
  }

  get unsaved() {
    return this.waiting !== null || this.busy;
  }

  get writable() {
    return this.writer !== null && !this.conflict;
  }

  // The labels in the file.
  async read() {
    const answer = await fetch('labels');
    if (!answer.ok) throw new Error((await answer.text()).trim());
    this.version = answer.headers.get('x-version');
    const [tracks, boxes] = await Promise.all([answer.json(), fetch('boxes').then((found) => found.json())]);
    this.boxes(boxes);
    return tracks;
  }

  // Asks for the right to write for ever; it is held as long as the answer lasts.
  async hold() {
    for (;;) {
      try {
        const answer = await fetch('writer', { method: 'POST' });
        if (answer.status === 200) {
          const reader = answer.body.getReader();
          const first = await reader.read();
          // another page may have written before; nothing can be changed until that is here
          if (this.waiting === null) await this.reload();
          this.writer = new TextDecoder().decode(first.value).trim();
          this.state('saved', 'every change is saved');
          this.send();
          while (!(await reader.read()).done);
        } else {
          this.state('read-only', 'Read only: another page writes these labels. Close it to write here.');
        }
      } catch {
        this.state('failed', 'The server does not answer: start viewshed label again. Changes are not saved.');
      }
      this.writer = null;
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
  }

  // Saves tracks; those of a single point are not finished and stay here.
  save(tracks) {
    this.waiting = tracks;
    this.send();
  }

  async send() {
    if (this.busy || this.waiting === null || !this.writable) return;
    const tracks = this.waiting;
    this.waiting = null;
    this.busy = true;
    this.state('saving', 'saving');
    let answer = null;
    let error = 'The server does not answer: changes are not saved.';
    try {
      const headers = { 'content-type': 'application/json', 'x-writer': this.writer, 'x-version': this.version };
      const body = JSON.stringify(tracks.filter((track) => track.points.length > 1));
      answer = await fetch('labels', { method: 'PUT', headers, body });
      if (!answer.ok) error = (await answer.text()).trim();
    } catch {
      answer = null;
    }
    this.busy = false;
    if (answer?.ok) {
      this.version = answer.headers.get('x-version');
      this.boxes(await answer.json());
      this.state('saved', 'every change is saved');
      this.send();
      return;
    }
    this.waiting ??= tracks;
    this.conflict = answer?.status === 409;
    this.state(this.conflict ? 'conflict' : 'failed', error);
    if (!this.conflict) setTimeout(() => this.send(), AGAIN_MS);
  }
}

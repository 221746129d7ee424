// The side of the page: proposal, selected track, list of tracks, legend.

import { asCss, groundColours, rcsColours, STRONGEST_DBSM, WEAKEST_DBSM } from './colours.js';
import { colourOf } from './marks.js';
import { begins, CLASSES, ends, velocity } from './tracks.js';

const element = (id) => document.getElementById(id);
const span = (track) => `${begins(track).toFixed(1)} to ${ends(track).toFixed(1)} s`;

// How many of each class.
function counted(proposals) {
  const of = (kind) => proposals.filter(({ track }) => track.class === kind).length;
  const kinds = [...new Set(proposals.map(({ track }) => track.class))];
  return kinds.map((kind) => `${of(kind)} ${kind}`).join(', ');
}

// Length, width and height, where they are not those of the class.
const size = ({ size_m: all }) => (all ? `, ${all.map((m) => m.toFixed(1)).join(' × ')} m` : '');

export class Panel {
  constructor(session, { select }) {
    this.session = session;
    const choice = element('track-class');
    CLASSES.forEach((kind, k) => choice.add(new Option(`${kind} (${k + 1})`, kind)));
    choice.addEventListener('change', () => session.classify(choice.value));
    const id = element('track-id');
    id.addEventListener('change', () => session.rename(id.value));
    element('tracks').addEventListener('click', (event) => {
      const button = event.target.closest('button');
      if (button) select(button.dataset.id);
    });
  }

  update() {
    this.proposal();
    this.selected();
    this.list();
    const { past, future } = this.session.history;
    element('undo').disabled = past.length === 0;
    element('redo').disabled = future.length === 0;
  }

  proposal() {
    const { proposals } = this.session;
    const { offered, waiting, decided } = proposals;
    const { one } = this.session;
    let text = proposals.ready ? `none left; ${decided} decided` : 'looking for tracks';
    if (offered.length > 1) text = `${offered.length} together, of ${waiting.length} that are left: ${counted(offered)}. `;
    else if (one) text = `${decided + 1} of ${decided + waiting.length}: `;
    if (one) text += `${offered.length > 1 ? 'Pointed at: ' : ''}${one.track.class}${size(one.track)}, ${span(one.track)}, ${one.detections} detections, score ${one.score.toFixed(2)}`;
    else if (offered.length > 1) text += 'Point at one to reject or mend it alone.';
    element('proposal-text').textContent = text;
    const button = (key) => document.querySelector(`#proposal button[data-key="${key}"]`);
    for (const each of document.querySelectorAll('#proposal button')) each.disabled = offered.length === 0;
    // the mouse is on the button then, and points at none
    for (const key of ['reject', 'mend']) button(key).disabled = offered.length !== 1;
    button('accept').textContent = offered.length > 1 ? 'Accept all' : 'Accept';
    button('discard').hidden = offered.length < 2;
    button('together').textContent = proposals.together ? 'One by one' : 'Together';
  }

  selected() {
    const { track } = this.session;
    element('selected-form').hidden = !track;
    const speed = track ? Math.hypot(...velocity(track)).toFixed(1) : 0;
    element('selected-text').textContent = track ? `${track.points.length} points${size(track)}, ${span(track)}, ${speed} m/s` : 'none';
    if (!track) return;
    element('track-id').value = track.id;
    const choice = element('track-class');
    if (![...choice.options].some((option) => option.value === track.class)) choice.add(new Option(track.class));
    choice.value = track.class;
  }

  list() {
    const { tracks, selected } = this.session;
    element('count').textContent = `(${tracks.length})`;
    const rows = tracks.map((track, index) => {
      const row = document.createElement('li');
      const button = document.createElement('button');
      button.type = 'button';
      button.dataset.id = track.id;
      button.setAttribute('aria-current', String(track.id === selected));
      const mark = document.createElement('i');
      mark.style.background = colourOf(index);
      const times = document.createElement('span');
      times.textContent = span(track);
      button.append(mark, `${track.id} ${track.class}`, times);
      row.append(button);
      return row;
    });
    const list = element('tracks');
    const focused = list.contains(document.activeElement) ? document.activeElement.dataset.id : null;
    list.replaceChildren(...rows);
    if (focused !== null) [...list.querySelectorAll('button')].find((button) => button.dataset.id === focused)?.focus();
  }

  legend(colouring) {
    const parts = [];
    const part = (text, ...colours) => {
      const item = document.createElement('span');
      for (const colour of colours) {
        const box = document.createElement('i');
        box.style.background = asCss(colour);
        item.append(box);
      }
      item.append(text);
      parts.push(item);
    };
    part('larger points: higher Doppler (from 1 and 5 m/s)');
    const scale = rcsColours();
    if (colouring === 'rcs') part(`RCS from ${WEAKEST_DBSM} to ${STRONGEST_DBSM} dBsm`, scale[0], scale[128], scale[255]);
    else part('colour: the track a reflection lies on; grey: none (C changes it)');
    const [, invisible, visible, occupied] = groundColours();
    part('estimated invisible', invisible);
    part('visible', visible);
    part('visible and occupied', occupied);
    element('legend').replaceChildren(...parts);
  }
}

// What follows the mouse and the keys in the report's charts. The page is whole without it.
'use strict';

// Farthest from a point, in units of the chart, at which it is still meant.
const REACH = 60;

function points(svg) {
  const shown = [...svg.querySelectorAll('.series:not(.off)')];
  return shown.map((series) => ({ series, points: JSON.parse(series.dataset.points) }));
}

// Rings a point and says what it is; without one, nothing.
function say(svg, point) {
  const figure = svg.closest('figure');
  svg.querySelector('.here')?.remove();
  figure.querySelector('.says')?.remove();
  if (!point) return;
  const [x, y, text] = point;
  const ring = document.createElementNS(svg.namespaceURI, 'circle');
  ring.setAttribute('class', 'here');
  for (const [name, value] of Object.entries({ cx: x, cy: y, r: 8 })) ring.setAttribute(name, value);
  svg.append(ring);
  const words = document.createElement('div');
  words.className = 'says';
  words.setAttribute('role', 'status');
  words.textContent = text;
  figure.append(words);
  const [box, outer] = [svg.getBoundingClientRect(), figure.getBoundingClientRect()];
  const [wide, high] = [svg.viewBox.baseVal.width, svg.viewBox.baseVal.height];
  const left = box.left - outer.left + (x / wide) * box.width - words.offsetWidth / 2;
  const top = box.top - outer.top + (y / high) * box.height - words.offsetHeight - 14;
  words.style.left = `${Math.max(0, Math.min(left, outer.width - words.offsetWidth))}px`;
  words.style.top = `${top < 0 ? top + words.offsetHeight + 30 : top}px`;
}

function chart(svg) {
  let at = null;
  svg.addEventListener('pointermove', (event) => {
    const box = svg.getBoundingClientRect();
    const scale = svg.viewBox.baseVal.width / box.width;
    const [px, py] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    let [best, nearest] = [null, REACH];
    for (const { points: all } of points(svg)) {
      for (const point of all) {
        const apart = Math.hypot(point[0] - px, point[1] - py);
        if (apart < nearest) [best, nearest] = [point, apart];
      }
    }
    say(svg, best);
  });
  svg.addEventListener('pointerleave', () => say(svg, null));
  svg.addEventListener('blur', () => say(svg, null));
  // left and right along a curve, up and down to another one
  svg.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
    if (event.key === 'Escape') say(svg, null);
    const all = points(svg);
    if (!step || all.length === 0) return;
    event.preventDefault();
    const [series, place] = at ?? [Math.max(0, all.findIndex(({ series: s }) => s.classList.contains('strong'))), -1];
    const next = (((series + step[0]) % all.length) + all.length) % all.length;
    at = [next, Math.max(0, Math.min(place + step[1], all[next].points.length - 1))];
    say(svg, all[at[0]].points[at[1]]);
  });
}

// The threshold of a group: the point of each operating curve at it.
function threshold(group) {
  const row = group.querySelector('.threshold');
  const hasThresholds = (svg) => points(svg).some(({ points: all }) => all.some((point) => point[3] !== null));
  const charts = [...group.querySelectorAll('.chart svg')].filter(hasThresholds);
  if (!row || charts.length === 0) return;
  row.hidden = false;
  const slider = row.querySelector('input');
  const show = () => {
    const least = Number(slider.value);
    const said = [];
    for (const svg of charts) {
      svg.querySelectorAll('.at').forEach((ring) => ring.remove());
      for (const { series, points: all } of points(svg)) {
        // curves are kept only where they move
        const here = all.filter((point) => point[3] !== null && point[3] <= least).pop();
        if (!here) continue;
        const ring = document.createElementNS(svg.namespaceURI, 'circle');
        ring.setAttribute('class', 'here at');
        for (const [name, value] of Object.entries({ cx: here[0], cy: here[1], r: 7 })) ring.setAttribute(name, value);
        svg.append(ring);
        if (series.classList.contains('strong')) said.push(here[2].replace(/^.*?: /, ''));
      }
    }
    row.querySelector('output').textContent = `${least}: ${['objects', 'cells'].map((of, k) => (said[k] ? `${of} ${said[k]}` : '')).filter(Boolean).join('; ')}`;
  };
  slider.addEventListener('input', show);
  group.addEventListener('shown', show);
  show();
}

for (const group of document.querySelectorAll('.group')) {
  const buttons = [...group.querySelectorAll('.legend button')];
  const apply = () => {
    for (const button of buttons) {
      const off = button.getAttribute('aria-pressed') === 'false';
      const name = button.dataset.series;
      group.querySelectorAll('.series').forEach((series) => series.dataset.series === name && series.classList.toggle('off', off));
    }
    group.dispatchEvent(new Event('shown'));
  };
  for (const button of buttons) {
    button.addEventListener('click', () => {
      button.setAttribute('aria-pressed', String(button.getAttribute('aria-pressed') === 'false'));
      apply();
    });
  }
  group.querySelectorAll('.chart svg').forEach(chart);
  apply();
  threshold(group);
}
// on paper nothing is folded
addEventListener('beforeprint', () => document.querySelectorAll('details').forEach((details) => (details.open = true)));
document.documentElement.dataset.ready = 'true';

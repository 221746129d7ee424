// What is drawn over a map, and the figures over time.

import { css } from './colours.js';
import { corners } from './viewer-ground.js';

const OUTCOMES = { TV: ['--tv', []], FV: ['--fv', [5, 3]], TI: ['--ti', [5, 3]], FI: ['--fi', []] };
export const LINES = [['visible', '--visible', []], ['invisible', '--invisible', [9, 4]], ['unknown', '--quiet', [2.5, 3.5]]];

export function footprint({ center: [x, y], yaw_rad: yaw, size: [length, width] }) {
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([along, across]) => {
    const [u, v] = [(along * length) / 2, (across * width) / 2];
    return [x + u * cos - v * sin, y + u * sin + v * cos];
  });
}

function polygon(plot, context, points, closed = true) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(...plot.toPixel(x, y)));
  if (closed) context.closePath();
}

function outlined(plot, context, points, colour, width, dash) {
  polygon(plot, context, points);
  context.strokeStyle = css('--paper');
  context.lineWidth = width + 2;
  context.setLineDash([]);
  context.stroke();
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

// Everything over a map. page: { instant, layers, cell, about, maps }.
export function drawOver(plot, context, page, maps) {
  const { instant, layers, about } = page;
  if (about?.field_of_view.length) {
    polygon(plot, context, about.field_of_view);
    context.strokeStyle = css('--quiet');
    context.lineWidth = 1.3;
    context.setLineDash([7, 5]);
    context.stroke();
    context.setLineDash([]);
  }
  if (!instant) return;
  if (layers.rays) maps.forEach((map) => drawRays(plot, context, map));
  if (layers.obstacles) {
    instant.obstacles.forEach((box, k) => {
      const casts = page.told?.shadows.includes(k);
      polygon(plot, context, footprint(box));
      context.fillStyle = casts ? css('--select') : css('--obstacle');
      context.globalAlpha = casts ? 0.75 : 0.28;
      context.fill();
      context.globalAlpha = 1;
      context.strokeStyle = context.fillStyle;
      context.lineWidth = casts ? 2.5 : 1.2;
      context.stroke();
    });
  }
  if (layers.labels) instant.boxes.forEach((box) => drawBox(plot, context, box));
  for (const map of maps) drawSensor(plot, context, map.cells.mount);
  if (page.cell && maps.some((map) => map.name === page.cell.name)) drawCell(plot, context, page, maps);
}

function drawRays(plot, context, { cells }) {
  context.strokeStyle = css('--quiet');
  context.globalAlpha = 0.55;
  context.lineWidth = 0.7;
  context.beginPath();
  for (let azimuth = 0; azimuth <= cells.azimuths; azimuth += 1) {
    const [near, far] = [corners(cells, [azimuth, 0])[0], corners(cells, [azimuth, cells.ranges])[0]];
    context.moveTo(...plot.toPixel(...near));
    context.lineTo(...plot.toPixel(...far));
  }
  context.stroke();
  context.globalAlpha = 1;
}

function drawBox(plot, context, box) {
  const [colour, dash] = OUTCOMES[box.outcome] ?? ['--quiet', []];
  const wrong = box.outcome === 'FV' || box.outcome === 'FI';
  outlined(plot, context, footprint(box), css(colour), wrong ? 3 : 1.6, dash);
  if (!wrong) return;
  const [x, y] = plot.toPixel(box.center[0], box.center[1]);
  context.font = `bold ${plot.em * 0.95}px "DejaVu Sans", system-ui, sans-serif`;
  context.textAlign = 'center';
  context.lineWidth = 4;
  context.strokeStyle = css('--paper');
  context.strokeText(box.outcome, x, y - 0.8 * plot.em);
  context.fillStyle = css(colour);
  context.fillText(box.outcome, x, y - 0.8 * plot.em);
}

function drawSensor(plot, context, [x, y, , heading]) {
  const [px, py] = plot.toPixel(x, y);
  context.save();
  context.translate(px, py);
  context.rotate(-heading);
  context.beginPath();
  [[11, 0], [-9, 8], [-4, 0], [-9, -8]].forEach(([a, b]) => context.lineTo(a, b));
  context.closePath();
  context.strokeStyle = css('--paper');
  context.lineWidth = 4;
  context.stroke();
  context.fillStyle = css('--ink');
  context.fill();
  context.restore();
}

function drawCell(plot, context, page, maps) {
  const map = maps.find(({ name }) => name === page.cell.name);
  const around = corners(map.cells, page.cell.at);
  const [mx, my] = map.cells.mount;
  const middle = [0, 1].map((k) => around.reduce((sum, place) => sum + place[k], 0) / 4);
  context.strokeStyle = css('--select');
  context.lineWidth = 1.5;
  context.setLineDash([2, 4]);
  polygon(plot, context, [[mx, my], middle], false);
  context.stroke();
  context.setLineDash([]);
  outlined(plot, context, around, css('--select'), 2.5, []);
  const [x, y] = plot.toPixel(...middle);
  context.beginPath();
  context.arc(x, y, 11, 0, 2 * Math.PI);
  context.strokeStyle = css('--select');
  context.lineWidth = 2;
  context.stroke();
}

// Shares of the map and what is wrong over time, with the time that is shown.
export function drawTimes(plot, context, { source, number }) {
  const { samples } = source;
  const { view, area } = plot;
  // no more lines than pixels
  const step = Math.max(1, Math.ceil(samples.length / (2 * area.width)));
  for (const [name, colour, dash] of LINES) {
    context.beginPath();
    for (let k = 0; k < samples.length; k += step) {
      const sample = samples[k];
      if (sample && sample.time_s >= view.left - 5 && sample.time_s <= view.right + 5) context.lineTo(...plot.toPixel(sample.time_s, 100 * sample[name]));
    }
    context.strokeStyle = css(colour);
    context.lineWidth = 2;
    context.setLineDash(dash);
    context.stroke();
  }
  context.setLineDash([]);
  const size = 0.32 * plot.em;
  for (const [key, colour, row] of [['fv', '--fv', 0], ['fi', '--fi', 1]]) {
    context.fillStyle = css(colour);
    const y = area.top + (0.5 + 0.9 * row) * plot.em;
    context.beginPath();
    for (const sample of samples) {
      if (!sample?.[key] || sample.time_s < view.left || sample.time_s > view.right) continue;
      const [x] = plot.toPixel(sample.time_s, 0);
      if (row === 0) {
        context.moveTo(x - size, y - size);
        context.lineTo(x + size, y - size);
        context.lineTo(x, y + size);
      } else {
        context.rect(x - 0.7 * size, y - 0.7 * size, 1.4 * size, 1.4 * size);
      }
    }
    context.fill();
  }
  const now = samples[number];
  if (!now) return;
  const [x] = plot.toPixel(now.time_s, 0);
  context.strokeStyle = css('--select');
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x, area.top);
  context.lineTo(x, area.top + area.height);
  context.stroke();
}

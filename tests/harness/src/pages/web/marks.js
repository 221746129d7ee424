// Tracks, the proposal and the current time, drawn over the detections.

import { TRACKS, css } from './colours.js';
import { begins, ends, positionAt } from './tracks.js';

// How much is left of a line that is a hint only.
const FAINT = 0.25;
const DASHES = [[], [10, 4], [3, 3], [12, 3, 3, 3]];

// Where a point [time, x, y] lies in a plot.
export function placed(plot, point) {
  const [time, x, y] = point;
  return { along: [time, x], across: [time, y], plan: [x, y] }[plot.name];
}

export const colourOf = (index) => TRACKS[index % TRACKS.length];

// Everything of a session in one plot.
export function drawMarks(plot, context, session) {
  const { now, window, proposals } = session;
  if (plot.name !== 'plan') drawNow(plot, context, now, window);
  else drawSensor(plot, context, session.recording.mount);
  if (plot.name === 'plan') session.boxes.forEach((box) => drawBox(plot, context, box, now));
  // what is labelled on other ways is no more than a hint while proposals are looked at
  const faint = session.selected === null && session.brush?.plot === 'lane' && proposals.current !== null;
  session.tracks.forEach((track, index) => {
    const chosen = track.id === session.selected;
    if (!chosen && !isShown(plot, track, now, window)) return;
    drawTrack(plot, context, track, { colour: chosen ? css('--select') : colourOf(index), dash: DASHES[Math.floor(index / TRACKS.length) % 4], chosen, point: chosen ? session.point : null, now, faint });
  });
  drawOffered(plot, context, session);
  const way = session.shownWay;
  if (way) drawTrack(plot, context, { ...way.track, id: '?' }, { colour: css('--select'), dash: [2, 4], chosen: false, point: null, now });
}

// One proposal with its points, of several that which is pointed at.
function drawOffered(plot, context, session) {
  const { now, window, one, proposals } = session;
  const shown = proposals.offered.filter((proposal) => proposal === one || isShown(plot, proposal.track, now, window));
  // what is pointed at lies above the others
  for (const proposal of shown.sort((a, b) => (a === one) - (b === one))) {
    const { track } = proposal;
    const style = { colour: css('--strong'), dash: [8, 5], chosen: proposal === one, point: null, now };
    drawTrack(plot, context, { ...track, id: proposal === one || track.class !== 'car' ? '?' : '' }, style);
  }
}

// The plan shows those that are there about now, time plots all.
function isShown(plot, track, now, window) {
  return plot.name !== 'plan' || (begins(track) <= now + window && ends(track) >= now - window);
}

function drawTrack(plot, context, track, { colour, dash, chosen, point, now, faint = false }) {
  const pixels = track.points.map((at) => plot.toPixel(...placed(plot, at)));
  if (pixels.length === 0) return;
  const line = () => {
    context.beginPath();
    pixels.forEach(([x, y]) => context.lineTo(x, y));
    context.stroke();
  };
  context.lineJoin = 'round';
  context.globalAlpha = faint ? FAINT : 1;
  context.strokeStyle = css('--paper');
  context.lineWidth = chosen ? 5 : 4;
  line();
  context.setLineDash(dash);
  context.strokeStyle = colour;
  context.lineWidth = chosen ? 3 : 2;
  line();
  context.setLineDash([]);
  context.globalAlpha = 1;
  if (faint) return;
  if (chosen) pixels.forEach(([x, y], k) => drawPoint(context, x, y, colour, k === point));
  const here = positionAt(track, now);
  if (plot.name === 'plan' && here) {
    const [x, y] = plot.toPixel(...here);
    context.fillStyle = colour;
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.fill();
    drawName(plot, context, track, x, y);
  } else if (plot.name !== 'plan') {
    const { area } = plot;
    const inside = pixels.find(([x, y]) => x >= area.left && x <= area.left + area.width && y >= area.top && y <= area.top + area.height);
    if (inside) drawName(plot, context, track, ...inside);
  }
}

// The box that stands behind a saved track, with a line across its front.
function drawBox(plot, context, { size_m: [length, width], steps }, now) {
  const next = steps.findIndex(([time]) => time >= now);
  if (next < 0 || (next === 0 && steps[0][0] > now)) return;
  const [a, b] = [steps[Math.max(next - 1, 0)], steps[next]];
  const share = b[0] > a[0] ? (now - a[0]) / (b[0] - a[0]) : 0;
  const [x, y] = [a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])];
  const [cos, sin] = [Math.cos(b[3]), Math.sin(b[3])];
  const corner = (along, across) => {
    const [u, v] = [(along * length) / 2, (across * width) / 2];
    return plot.toPixel(x + u * cos - v * sin, y + u * sin + v * cos);
  };
  const path = (...corners) => {
    context.beginPath();
    corners.forEach(([along, across]) => context.lineTo(...corner(along, across)));
    context.stroke();
  };
  context.strokeStyle = css('--ink');
  context.lineWidth = 1.5;
  path([1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]);
  path([0.8, 1], [0.8, -1]);
}

function drawPoint(context, x, y, colour, chosen) {
  const half = chosen ? 6 : 4;
  context.fillStyle = chosen ? colour : css('--paper');
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.beginPath();
  context.rect(x - half, y - half, 2 * half, 2 * half);
  context.fill();
  context.stroke();
}

function drawName(plot, context, track, x, y) {
  const text = track.id === '?' ? `? ${track.class}` : track.id;
  context.textAlign = 'left';
  context.lineWidth = 3;
  context.strokeStyle = css('--paper');
  context.strokeText(text, x + 8, y - 7);
  context.fillStyle = css('--ink');
  context.fillText(text, x + 8, y - 7);
}

function drawNow(plot, context, now, window) {
  const { area } = plot;
  const [from, at, to] = [now - window, now, now + window].map((time) => plot.toPixel(time, 0)[0]);
  context.fillStyle = css('--strong');
  context.globalAlpha = 0.12;
  context.fillRect(from, area.top, to - from, area.height);
  context.globalAlpha = 1;
  context.fillRect(at - 0.75, area.top, 1.5, area.height);
}

function drawSensor(plot, context, [x, y, , heading]) {
  const [px, py] = plot.toPixel(x, y);
  context.save();
  context.translate(px, py);
  context.rotate(-heading);
  context.fillStyle = css('--ink');
  context.beginPath();
  for (const [dx, dy] of [[10, 0], [-7, -7], [-3, 0], [-7, 7]]) context.lineTo(dx, dy);
  context.fill();
  context.restore();
}

// The proposal under a pixel.
export function hitOffered(plot, session, [px, py]) {
  const { now, window, proposals } = session;
  const shown = proposals.offered.filter(({ track }) => isShown(plot, track, now, window));
  const near = shown.map((proposal) => ({ proposal, distance: distanceTo(plot, proposal.track, px, py) }));
  const best = near.sort((a, b) => a.distance - b.distance)[0];
  return best && best.distance <= plot.reach ? best.proposal : null;
}

// What lies under a pixel: a point of the selected track first, then any track.
export function hit(plot, session, [px, py]) {
  const { track } = session;
  if (track) {
    const near = track.points.map((point, index) => {
      const [x, y] = plot.toPixel(...placed(plot, point));
      return { index, distance: Math.hypot(x - px, y - py) };
    });
    const best = near.filter(({ distance }) => distance <= plot.reach).sort((a, b) => a.distance - b.distance)[0];
    if (best) return { id: track.id, point: best.index };
  }
  const shown = session.tracks.filter((other) => isShown(plot, other, session.now, session.window));
  const near = shown.map((other) => ({ id: other.id, point: null, distance: distanceTo(plot, other, px, py) }));
  const best = near.sort((a, b) => a.distance - b.distance)[0];
  return best && best.distance <= plot.reach ? { id: best.id, point: null } : null;
}

function distanceTo(plot, track, px, py) {
  const pixels = track.points.map((point) => plot.toPixel(...placed(plot, point)));
  let least = Infinity;
  for (let k = 0; k + 1 < pixels.length; k += 1) {
    const [[ax, ay], [bx, by]] = [pixels[k], pixels[k + 1]];
    const square = (bx - ax) ** 2 + (by - ay) ** 2;
    const share = square === 0 ? 0 : Math.min(1, Math.max(0, ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / square));
    least = Math.min(least, Math.hypot(ax + share * (bx - ax) - px, ay + share * (by - ay) - py));
  }
  return least;
}

// One plot: detections in a picture that moves at once with the view and is drawn afresh after it, and above it axes,
// tracks and the cursor, which are drawn at every change.

import { css } from './colours.js';
import { drawPoints } from './points.js';
import { grown, limited, panned, squared, ticks, zoomed } from './view.js';

// The picture reaches beyond the view by this share to each side, so that a pan shows it at once.
const SPREAD = 0.25;
// The full drawing waits until the view rests for this long, and no longer than that.
const REST_MS = 40;
const LONGEST_MS = 200;
// Pixels from a point or line that still hit it, and that a press may move and still be a click.
const REACH_PX = 9;
const CLICK_PX = 4;

export class Plot {
  // source: { layer(), range(view), chosen(), ground?, marks(plot) }, all asked for anew at each drawing.
  // on: { view, press, drag, release, brush, point? }, called with places in units of the axes.
  constructor(element, { name, across, up, square = false, least = 0.05, most = 1e5 }, source, on) {
    Object.assign(this, { element, name, across, up, square, least, most, source, on });
    element.setAttribute('aria-label', `${name}: ${up} over ${across}. Arrow keys move the cursor; press ? for all keys.`);
    const clip = document.createElement('div');
    clip.className = 'clip';
    [this.ground, this.points] = ['ground', 'points'].map((kind) => {
      const canvas = document.createElement('canvas');
      canvas.className = kind;
      clip.append(canvas);
      return canvas;
    });
    this.clip = clip;
    this.marks = document.createElement('canvas');
    this.marks.className = 'marks';
    element.append(clip, this.marks);
    this.view = { left: 0, right: 1, bottom: 0, top: 1 };
    this.drawn = null;
    this.cursor = null;
    this.counted = 0;
    // of the last pan and the last full drawing, milliseconds
    this.times = { moved: 0, drawn: 0 };
    this.listen();
    new ResizeObserver(() => this.resized()).observe(element);
    this.watchScale();
  }

  // Another screen, or another zoom of the browser, has other pixels.
  watchScale() {
    const same = matchMedia(`(resolution: ${globalThis.devicePixelRatio}dppx)`);
    same.addEventListener('change', () => {
      this.resized();
      this.watchScale();
    }, { once: true });
  }

  resized() {
    const { width, height } = this.element.getBoundingClientRect();
    const em = parseFloat(getComputedStyle(this.element).fontSize);
    const [left, bottom, rim, right] = [3.9 * em, 2.4 * em, 0.5 * em, 1.2 * em];
    this.em = em;
    this.area = { left, top: rim, width: Math.max(width - left - right - 2, 10), height: Math.max(height - bottom - rim - 2, 10) };
    Object.assign(this.clip.style, { left: `${left}px`, top: `${rim}px`, width: `${this.area.width}px`, height: `${this.area.height}px` });
    this.scale = globalThis.devicePixelRatio || 1;
    this.marks.width = Math.round(width * this.scale);
    this.marks.height = Math.round(height * this.scale);
    Object.assign(this.marks.style, { width: `${width}px`, height: `${height}px` });
    if (this.square) this.view = squared(this.view, this.area.width, this.area.height);
    this.redrawPoints();
    this.changed();
  }

  // Shows a part of the plane; the picture moves in the next frame and is drawn afresh after it.
  show(view) {
    this.view = this.square && this.area ? squared(view, this.area.width, this.area.height) : view;
    if (!this.area) return;
    this.changed();
    this.later();
  }

  // The points are other ones, or have other colours.
  refresh() {
    this.later();
  }

  later() {
    const now = performance.now();
    this.since ??= now;
    clearTimeout(this.timer);
    const wait = Math.max(0, Math.min(REST_MS, this.since + LONGEST_MS - now));
    this.timer = setTimeout(() => this.redrawPoints(), wait);
  }

  changed() {
    if (this.frame || !this.area) return;
    const asked = performance.now();
    this.frame = requestAnimationFrame(() => {
      this.frame = null;
      this.place();
      this.drawMarks();
      this.times.moved = performance.now() - asked;
    });
  }

  // The picture where the view now is.
  place() {
    if (!this.drawn) return;
    const { view, area, drawn } = this;
    const [toX, toY] = [area.width / (view.right - view.left), area.height / (view.top - view.bottom)];
    const [wide, high] = [1 + 2 * SPREAD, 1 + 2 * SPREAD];
    const x = (drawn.left - view.left) * toX;
    const y = (view.top - drawn.top) * toY;
    const zoomX = ((drawn.right - drawn.left) * toX) / (area.width * wide);
    const zoomY = ((drawn.top - drawn.bottom) * toY) / (area.height * high);
    for (const canvas of [this.ground, this.points]) canvas.style.transform = `translate(${x}px, ${y}px) scale(${zoomX}, ${zoomY})`;
  }

  redrawPoints() {
    clearTimeout(this.timer);
    this.since = undefined;
    if (!this.area) return;
    const start = performance.now();
    const drawn = grown(this.view, SPREAD);
    const [width, height] = [this.area.width, this.area.height].map((size) => size * (1 + 2 * SPREAD));
    const [w, h] = [width, height].map((size) => Math.round(size * this.scale));
    for (const canvas of [this.ground, this.points]) {
      if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
      Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
    }
    if (this.image?.width !== w || this.image?.height !== h) this.image = new ImageData(w, h);
    const pixels = new Uint32Array(this.image.data.buffer);
    if (this.source.ground) {
      this.source.ground().draw(pixels, w, h, drawn);
      this.ground.getContext('2d').putImageData(this.image, 0, 0);
    }
    pixels.fill(0);
    const [layer, chosen, [from, to]] = [this.source.layer(), this.source.chosen(), this.source.range(drawn)];
    this.counted = 0;
    if (chosen) {
      const faint = { ...layer, colour: this.source.faint() };
      this.counted += drawPoints(pixels, w, h, drawn, faint, from, to, this.scale, chosen, 0);
    }
    this.counted += drawPoints(pixels, w, h, drawn, layer, from, to, this.scale, chosen, 1);
    this.points.getContext('2d').putImageData(this.image, 0, 0);
    this.drawn = drawn;
    this.place();
    this.times.drawn = performance.now() - start;
  }

  // Pixel in the element of a place, and back.
  toPixel(x, y) {
    const { view, area } = this;
    return [
      area.left + ((x - view.left) / (view.right - view.left)) * area.width,
      area.top + ((view.top - y) / (view.top - view.bottom)) * area.height,
    ];
  }

  toPlace(px, py) {
    const { view, area } = this;
    return [
      view.left + ((px - area.left) / area.width) * (view.right - view.left),
      view.top - ((py - area.top) / area.height) * (view.top - view.bottom),
    ];
  }

  get reach() {
    return REACH_PX;
  }

  drawMarks() {
    const context = this.marks.getContext('2d');
    const { area, view } = this;
    context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    context.clearRect(0, 0, this.marks.width, this.marks.height);
    context.font = `${this.em * 0.85}px "DejaVu Sans", system-ui, sans-serif`;
    const [ink, grid] = [css('--quiet'), css('--grid')];
    context.fillStyle = ink;
    context.strokeStyle = grid;
    context.lineWidth = 1;
    context.beginPath();
    context.textAlign = 'center';
    for (const { at, text } of ticks(view.left, view.right, area.width / (6 * this.em))) {
      const [x] = this.toPixel(at, 0);
      context.moveTo(x, area.top + area.height);
      context.lineTo(x, area.top + area.height + 0.3 * this.em);
      context.fillText(text, x, area.top + area.height + 1.15 * this.em);
    }
    context.textAlign = 'right';
    for (const { at, text } of ticks(view.bottom, view.top, area.height / (2.6 * this.em))) {
      const [, y] = this.toPixel(0, at);
      context.moveTo(area.left - 0.3 * this.em, y);
      context.lineTo(area.left, y);
      context.fillText(text, area.left - 0.45 * this.em, y + 0.3 * this.em);
    }
    context.strokeStyle = ink;
    context.stroke();
    context.fillText(this.across, area.left + area.width, area.top + area.height + 1.95 * this.em);
    context.save();
    context.translate(0.9 * this.em, area.top + area.height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = 'center';
    context.fillText(this.up, 0, 0);
    context.restore();
    context.save();
    context.beginPath();
    context.rect(area.left, area.top, area.width, area.height);
    context.clip();
    this.source.marks(this, context);
    if (this.brush) this.drawBrush(context);
    if (this.cursor && document.activeElement === this.element) this.drawCursor(context);
    context.restore();
  }

  drawBrush(context) {
    const [x0, y0] = this.toPixel(this.brush.left, this.brush.top);
    const [x1, y1] = this.toPixel(this.brush.right, this.brush.bottom);
    context.setLineDash([4, 3]);
    context.strokeStyle = css('--strong');
    context.lineWidth = 1.5;
    context.strokeRect(x0, y0, x1 - x0, y1 - y0);
    context.setLineDash([]);
  }

  drawCursor(context) {
    const [x, y] = this.toPixel(...this.cursor);
    context.strokeStyle = css('--strong');
    context.lineWidth = 1.5;
    context.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + 4 * dx, y + 4 * dy);
      context.lineTo(x + 14 * dx, y + 14 * dy);
    }
    context.stroke();
  }

  // The cursor, brought back into the view where it is not in it.
  here() {
    const { view } = this;
    const inside = ([x, y]) => x >= view.left && x <= view.right && y >= view.bottom && y <= view.top;
    if (!this.cursor || !inside(this.cursor)) this.cursor = [(view.left + view.right) / 2, (view.bottom + view.top) / 2];
    return this.cursor;
  }

  // Moves the cursor by pixels, for the keyboard; the view follows it.
  moveCursor(right, up) {
    const { view } = this;
    this.here();
    const [px, py] = this.toPixel(...this.cursor);
    this.cursor = this.toPlace(px + right, py - up);
    const beyond = (at, low, high) => Math.max(0, at - high) + Math.min(0, at - low);
    const [dx, dy] = [beyond(this.cursor[0], view.left, view.right), beyond(this.cursor[1], view.bottom, view.top)];
    if (dx || dy) this.on.view(this, panned(view, dx, dy));
    this.on.point?.(this);
    this.changed();
  }

  // Zooms about the cursor.
  zoom(factor, axes = [true, true]) {
    this.zoomAt(this.here(), factor, axes);
  }

  zoomAt(about, factor, [across, along]) {
    const next = zoomed(this.view, about, [across ? factor : 1, along ? factor : 1]);
    this.on.view(this, limited(next, this.view, this.least, this.most));
  }

  listen() {
    const { element } = this;
    const at = (event) => {
      const { left, top } = element.getBoundingClientRect();
      return [event.clientX - left - 1, event.clientY - top - 1];
    };
    element.addEventListener('wheel', (event) => {
      event.preventDefault();
      const axes = this.square ? [true, true] : [!event.shiftKey, !event.altKey];
      this.zoomAt(this.toPlace(...at(event)), Math.exp(-(event.deltaY || event.deltaX) * 0.0015), axes);
    }, { passive: false });
    element.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      element.setPointerCapture(event.pointerId);
      const from = at(event);
      const taken = event.shiftKey ? null : this.on.press(this, this.toPlace(...from), event);
      this.held = { from, last: from, moved: false, taken, brushing: event.shiftKey };
    });
    element.addEventListener('pointermove', (event) => {
      const to = at(event);
      this.cursor = this.toPlace(...to);
      if (this.held) this.dragged(to);
      this.on.point?.(this);
      this.changed();
    });
    element.addEventListener('pointerup', (event) => {
      const { held } = this;
      this.held = null;
      if (!held) return;
      const place = this.toPlace(...at(event));
      if (held.brushing) this.on.brush(this, held.moved ? this.brush : null);
      else this.on.release(this, place, held.moved, held.taken);
      this.brush = null;
      this.changed();
    });
    element.addEventListener('pointercancel', () => {
      this.held = null;
      this.brush = null;
    });
    element.addEventListener('focus', () => {
      if (this.area) this.here();
      this.changed();
    });
    element.addEventListener('blur', () => this.changed());
  }

  dragged(to) {
    const { held } = this;
    held.moved ||= Math.hypot(to[0] - held.from[0], to[1] - held.from[1]) > CLICK_PX;
    if (!held.moved) return;
    const [a, b, last] = [held.from, to, held.last].map((pixel) => this.toPlace(...pixel));
    if (held.brushing) {
      this.brush = { left: Math.min(a[0], b[0]), right: Math.max(a[0], b[0]), bottom: Math.min(a[1], b[1]), top: Math.max(a[1], b[1]) };
    } else if (held.taken) {
      this.on.drag(this, b, held.taken);
    } else {
      this.on.view(this, panned(this.view, last[0] - b[0], last[1] - b[1]));
    }
    held.last = to;
  }
}

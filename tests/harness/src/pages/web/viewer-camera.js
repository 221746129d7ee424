// The camera's picture with the map drawn into it: what is visible on the road, seen from the camera.

import { codeColours, codes, corners } from './viewer-ground.js';

// Cells nearer to the camera's plane than this are not drawn, metres.
const NEAR_M = 2;
const OPACITY = 0.45;

const element = (id) => document.getElementById(id);

export class CameraView {
  constructor(camera) {
    this.camera = camera;
    element('camera').hidden = !camera;
    if (!camera) return;
    const canvas = element('camera-canvas');
    [canvas.width, canvas.height] = camera.size_px.map((side) => Math.round((side * 640) / camera.size_px[0]));
    this.canvas = canvas;
    element('camera-text').textContent = camera.has_pictures ? 'Camera, with the map on the road' : "Camera's view of the map; the recording has no pictures";
  }

  // Pixel of a place of the road; null behind the camera.
  pixel(place) {
    const { rotation, position, focal_px: [fu, fv], center_px: [u, v], size_px: [width] } = this.camera;
    const away = [0, 1, 2].map((k) => (place[k] ?? 0) - position[k]);
    const [ahead, left, up] = rotation.map((row) => row[0] * away[0] + row[1] * away[1] + row[2] * away[2]);
    const scale = this.canvas.width / width;
    return ahead < NEAR_M ? null : [(u - (fu * left) / ahead) * scale, (v - (fv * up) / ahead) * scale];
  }

  async show(instant, map) {
    if (!this.camera) return;
    this.wanted = instant.number;
    let picture = null;
    if (this.camera.has_pictures) {
      const answer = await fetch(`camera/${instant.number}`).catch(() => null);
      picture = answer?.ok ? await createImageBitmap(await answer.blob()).catch(() => null) : null;
      if (this.wanted !== instant.number) return;
    }
    this.draw(picture, instant, map);
  }

  draw(picture, instant, map) {
    const context = this.canvas.getContext('2d');
    const { width, height } = this.canvas;
    const paper = getComputedStyle(document.documentElement).getPropertyValue('--field');
    context.fillStyle = paper;
    context.fillRect(0, 0, width, height);
    if (picture) context.drawImage(picture, 0, 0, width, height);
    const colours = codeColours().map((colour) => colour && `rgb(${colour.join(' ')})`);
    const shown = map ? codes(map) : [];
    context.globalAlpha = picture ? OPACITY : 1;
    for (let at = 0; at < shown.length; at += 1) {
      if (shown[at] === 0) continue;
      const cell = [Math.floor(at / map.cells.ranges), at % map.cells.ranges];
      const pixels = corners(map.cells, cell).map((place) => this.pixel(place));
      if (pixels.some((pixel) => pixel === null) || !pixels.some(([x, y]) => x > -50 && x < width + 50 && y > 0 && y < height + 50)) continue;
      context.fillStyle = colours[shown[at]];
      context.beginPath();
      pixels.forEach(([x, y]) => context.lineTo(x, y));
      context.fill();
    }
    context.globalAlpha = 1;
    // labelled vehicles stand on it as wires
    context.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue('--ink');
    context.lineWidth = 1.2;
    for (const box of instant.boxes) this.wire(context, box);
  }

  wire(context, { center: [x, y, z], yaw_rad: yaw, size: [length, width, height] }) {
    const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
    const corner = (a, b, c) => {
      const [u, v] = [(a * length) / 2, (b * width) / 2];
      return this.pixel([x + u * cos - v * sin, y + u * sin + v * cos, z + (c * height) / 2]);
    };
    const around = [[1, 1], [-1, 1], [-1, -1], [1, -1]];
    const [low, high] = [-1, 1].map((c) => around.map(([a, b]) => corner(a, b, c)));
    if ([...low, ...high].includes(null)) return;
    context.beginPath();
    around.forEach((_, k) => {
      const next = (k + 1) % 4;
      for (const [from, to] of [[low[k], low[next]], [high[k], high[next]], [low[k], high[k]]]) {
        context.moveTo(...from);
        context.lineTo(...to);
      }
    });
    context.stroke();
  }
}

// Maps as grounds of the plan: a colour a cell by its state and grade, as in the project's pictures.

import { azimuthAt, bearingOf } from './azimuths.js';
import { isDark } from './colours.js';
import { Ground } from './ground.js';

// Steps of the grade that have a colour of their own.
const STEPS = 7;
// A larger code is a clearer state, so that of several maps the largest is shown: unknown, invisible by grade, the same
// occupied, visible by grade, the same occupied.
const INVISIBLE = 1;
const INVISIBLE_OCCUPIED = INVISIBLE + STEPS;
const VISIBLE = INVISIBLE_OCCUPIED + 1;
const VISIBLE_OCCUPIED = VISIBLE + STEPS;

const LIGHT = { visible: [[0xe6, 0xf2, 0xfa], [0x9c, 0xcb, 0xec]], invisible: [[0xe2, 0x8f, 0x4e], [0xfb, 0xe6, 0xd2]], occupied: [[0x4a, 0x3a, 0x30], [0x2a, 0x33, 0x40]] };
const DARK = { visible: [[0x1b, 0x36, 0x4a], [0x24, 0x5c, 0x85]], invisible: [[0x9a, 0x50, 0x1c], [0x43, 0x2a, 0x1b]], occupied: [[0xf0, 0xd8, 0xc4], [0xc4, 0xdc, 0xee]] };

const mixed = ([from, to], share) => from.map((low, c) => Math.round(low + share * (to[c] - low)));

// Red, green and blue of each code; none of unknown.
export function codeColours() {
  const { visible, invisible, occupied } = isDark() ? DARK : LIGHT;
  const colours = [null];
  for (let k = 0; k < STEPS; k += 1) colours.push(mixed(invisible, ((k + 0.5) / STEPS)));
  colours.push(occupied[0]);
  for (let k = 0; k < STEPS; k += 1) colours.push(mixed(visible, ((k + 0.5) / STEPS)));
  colours.push(occupied[1]);
  return colours;
}

const packedColours = () => Uint32Array.from(codeColours(), (colour) => (colour ? ((255 << 24) | (colour[2] << 16) | (colour[1] << 8) | colour[0]) >>> 0 : 0));

// Codes of a map's cells.
export function codes(map) {
  if (map.codes) return map.codes;
  const { azimuths, ranges } = map.cells;
  map.codes = new Uint8Array(azimuths * ranges);
  for (let at = 0; map.bytes && at < map.codes.length; at += 1) {
    const [grade, state] = [map.bytes[2 * at], map.bytes[2 * at + 1]];
    const step = Math.min(STEPS - 1, Math.floor((grade * STEPS) / 256));
    if ((state & 3) === 1) map.codes[at] = state & 4 ? INVISIBLE_OCCUPIED : INVISIBLE + step;
    else if ((state & 3) === 2) map.codes[at] = state & 4 ? VISIBLE_OCCUPIED : VISIBLE + step;
  }
  return map.codes;
}

// One map, or several of which the clearest is shown.
export class MapGround {
  constructor() {
    this.grounds = [];
    this.spare = new Uint32Array(0);
  }

  set(maps) {
    this.grounds = maps.map((map, k) => {
      let ground = this.grounds[k];
      if (!ground || JSON.stringify(ground.cells) !== JSON.stringify(map.cells)) ground = new Ground({ mount: map.cells.mount }, () => {});
      ground.set(map.cells, codes(map));
      ground.colours = packedColours;
      return ground;
    });
  }

  draw(pixels, width, height, view) {
    if (this.grounds.length <= 1) {
      if (this.grounds.length === 0) pixels.fill(0);
      else this.grounds[0].draw(pixels, width, height, view);
      return;
    }
    // codes first, then colours: a colour does not say which is clearer
    const colours = packedColours();
    const identity = Uint32Array.from(colours, (_, code) => code);
    if (this.spare.length !== pixels.length) this.spare = new Uint32Array(pixels.length);
    pixels.fill(0);
    for (const ground of this.grounds) {
      ground.colours = () => identity;
      ground.draw(this.spare, width, height, view);
      for (let at = 0; at < pixels.length; at += 1) if (this.spare[at] > pixels[at]) pixels[at] = this.spare[at];
    }
    for (let at = 0; at < pixels.length; at += 1) pixels[at] = colours[pixels[at]];
  }
}

// The cell of a map at a place of the road: azimuth, range; null outside.
export function cellAt(cells, [x, y]) {
  const { ranges, azimuth_rad: [right, left], cell_m: size, mount: [mx, my, , heading] } = cells;
  const range = Math.floor(Math.hypot(x - mx, y - my) / size);
  let angle = Math.atan2(y - my, x - mx) - heading;
  angle -= 2 * Math.PI * Math.round((angle - (right + left) / 2) / (2 * Math.PI));
  const azimuth = azimuthAt(cells, angle);
  return azimuth >= 0 && range < ranges ? [azimuth, range] : null;
}

// Corners of a cell on the road.
export function corners(cells, [azimuth, range]) {
  const { cell_m: size, mount: [mx, my, , heading] } = cells;
  const at = (a, r) => {
    const angle = heading + bearingOf(cells, a);
    return [mx + r * size * Math.cos(angle), my + r * size * Math.sin(angle)];
  };
  return [at(azimuth, range), at(azimuth, range + 1), at(azimuth + 1, range + 1), at(azimuth + 1, range)];
}

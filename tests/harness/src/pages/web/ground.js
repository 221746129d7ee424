// What the estimator thought visible, as the ground of the plan.

import { azimuthAt } from './azimuths.js';
import { groundColours } from './colours.js';

// Side of the blocks of pixels that share a cell.
const BLOCK_PX = 2;

export class Ground {
  // changed(): a map has come and the plan is to be drawn again.
  constructor(recording, changed) {
    this.recording = recording;
    this.changed = changed;
    this.frame = -1;
    this.cells = null;
    this.map = null;
    this.asked = -1;
    // Colour of each value of the map; 0 is nothing.
    this.colours = groundColours;
  }

  // Another map, and where its cells lie.
  set(cells, map) {
    if (JSON.stringify(cells) !== JSON.stringify(this.cells)) this.key = null;
    Object.assign(this, { cells, map });
  }

  // The map of a frame, asked for where it is not here.
  async show(frame) {
    if (frame === this.asked) return;
    this.asked = frame;
    try {
      const answer = await fetch(`visibility/${frame}`);
      if (answer.status === 200) {
        const map = new Uint8Array(await answer.arrayBuffer());
        if (this.asked !== frame) return;
        this.set(JSON.parse(answer.headers.get('x-cells')), map);
        this.frame = frame;
        this.changed();
      } else if (answer.status === 202) {
        setTimeout(() => {
          if (this.asked === frame) {
            this.asked = -1;
            this.show(frame);
          }
        }, 500);
      }
    } catch {
      // the state line says that the server is gone
      this.asked = -1;
    }
  }

  // Fills 32-bit pixels, block by block.
  draw(pixels, width, height, view) {
    pixels.fill(0);
    if (!this.map) return;
    const colours = this.colours();
    const [columns, rows] = [Math.ceil(width / BLOCK_PX), Math.ceil(height / BLOCK_PX)];
    const places = this.places(view, width, height, columns, rows);
    const line = new Uint32Array(width);
    for (let row = 0; row < rows; row += 1) {
      for (let column = 0; column < columns; column += 1) {
        const place = places[row * columns + column];
        const state = place < 0 ? 0 : this.map[place];
        line.fill(state > 0 ? colours[state] : 0, column * BLOCK_PX, (column + 1) * BLOCK_PX);
      }
      const end = Math.min((row + 1) * BLOCK_PX, height);
      for (let y = row * BLOCK_PX; y < end; y += 1) pixels.set(line, y * width);
    }
  }

  // The cell of each block, -1 for none; kept as long as the view stays.
  places(view, width, height, columns, rows) {
    const key = [view.left, view.right, view.bottom, view.top, width, height].join();
    if (key === this.key) return this.kept;
    const { ranges, cell_m: cell } = this.cells;
    const [mx, my, , heading] = this.recording.mount;
    const [stepX, stepY] = [(BLOCK_PX * (view.right - view.left)) / width, (BLOCK_PX * (view.top - view.bottom)) / height];
    const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
    const places = new Int32Array(columns * rows).fill(-1);
    for (let row = 0, at = 0; row < rows; row += 1) {
      const dy = view.top - (row + 0.5) * stepY - my;
      for (let column = 0; column < columns; column += 1, at += 1) {
        const dx = view.left + (column + 0.5) * stepX - mx;
        const range = Math.floor(Math.hypot(dx, dy) / cell);
        if (range >= ranges) continue;
        const angle = Math.atan2(cos * dy - sin * dx, cos * dx + sin * dy);
        const azimuth = azimuthAt(this.cells, angle);
        if (azimuth >= 0) places[at] = azimuth * ranges + range;
      }
    }
    [this.key, this.kept] = [key, places];
    return places;
  }
}

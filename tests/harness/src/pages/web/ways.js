// The reflections on the ways of tracks, seen from above, at any time.

// Size of a cell, metres.
const CELL_M = 0.5;
// The number of a cell from its coordinates.
const WIDE = 1 << 20;
// How far a way goes on before the first and after the last point, metres.
const BEYOND_M = 30;

// Whether each reflection of a recording lies within `near_m` metres of the line of one of the tracks.
export function onWays({ count, x, y }, tracks, near_m) {
  const cells = new Set();
  const cell = (a, b) => Math.floor(a / CELL_M) * WIDE + Math.floor(b / CELL_M);
  for (const { points } of tracks) {
    const line = points.map((point) => [point[1], point[2]]);
    const ends = [beyond(line[1], line[0]), beyond(line.at(-2), line.at(-1))];
    const whole = [ends[0], ...line, ends[1]];
    for (let k = 0; k + 1 < whole.length; k += 1) {
      const [[ax, ay], [bx, by]] = [whole[k], whole[k + 1]];
      const steps = Math.ceil(Math.hypot(bx - ax, by - ay) / CELL_M);
      for (let step = 0; step <= steps; step += 1) {
        const share = steps === 0 ? 0 : step / steps;
        fill(cells, cell, ax + share * (bx - ax), ay + share * (by - ay), near_m);
      }
    }
  }
  const on = new Uint8Array(count);
  for (let i = 0; i < count; i += 1) on[i] = cells.has(cell(x[i], y[i])) ? 1 : 0;
  return on;
}

// A place straight on from the end of a line.
function beyond([ax, ay], [bx, by]) {
  const length = Math.hypot(bx - ax, by - ay);
  if (length < CELL_M) return [bx, by];
  return [bx + ((bx - ax) / length) * BEYOND_M, by + ((by - ay) / length) * BEYOND_M];
}

function fill(cells, cell, px, py, near_m) {
  for (let dx = -near_m; dx <= near_m; dx += CELL_M) {
    for (let dy = -near_m; dy <= near_m; dy += CELL_M) {
      if (dx * dx + dy * dy <= near_m * near_m) cells.add(cell(px + dx, py + dy));
    }
  }
}

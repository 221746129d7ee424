// Detections as pixels: a square or disc each, by |Doppler|, drawn one after the other into the bytes of a canvas.
//
// A canvas of one's own bytes is as fast as a software WebGL for some 100 000 points, and gives the same picture on
// every machine.

// Doppler in m/s from which a point is drawn larger.
const SLOW_MPS = 1;
const FAST_MPS = 5;

// Size of each point, 0 to 2.
export function sizes(velocity) {
  return Uint8Array.from(velocity, (v) => (Math.abs(v) < SLOW_MPS ? 0 : Math.abs(v) < FAST_MPS ? 1 : 2));
}

// Half widths of each row of a stamp of one size on a screen of some pixels a unit.
export function stamp(size, scale) {
  const radius = [0.6, 1.2, 1.9][size] * scale;
  const reach = Math.floor(radius);
  const rows = [];
  for (let row = -reach; row <= reach; row += 1) rows.push(Math.floor(Math.sqrt(radius * radius - row * row)));
  return rows;
}

// Draws points `from` up to `to` into 32-bit pixels and says how many fell on the picture.
//
// layer: { across, up, size, colour }, arrays of one value a point; `chosen`, where given, says which (1) are drawn.
export function drawPoints(pixels, width, height, view, layer, from, to, scale, chosen, wanted) {
  const { across, up, size, colour } = layer;
  const stamps = [0, 1, 2].map((k) => stamp(k, scale));
  const toX = width / (view.right - view.left);
  const toY = height / (view.top - view.bottom);
  let drawn = 0;
  for (let i = from; i < to; i += 1) {
    if (chosen && chosen[i] !== wanted) continue;
    const x = Math.floor((across[i] - view.left) * toX);
    const y = Math.floor((view.top - up[i]) * toY);
    if (!(x >= 0 && x < width && y >= 0 && y < height)) continue;
    drawn += 1;
    const rows = stamps[size[i]];
    const reach = (rows.length - 1) / 2;
    for (let row = 0; row < rows.length; row += 1) {
      const line = y + row - reach;
      if (line < 0 || line >= height) continue;
      const begin = line * width + Math.max(0, x - rows[row]);
      const end = line * width + Math.min(width - 1, x + rows[row]);
      for (let at = begin; at <= end; at += 1) pixels[at] = colour[i];
    }
  }
  return drawn;
}

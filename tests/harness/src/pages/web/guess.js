// The coordinate a click does not give: in a plot of time and one coordinate, where the reflections say the other is.

import { firstFrom } from './recording.js';

// How far in time and along the drawn axis reflections may lie, and how well their Doppler must match.
const TIME_S = 0.3;
const ALONG_M = 4;
const DOPPLER_MPS = 3;
// Width of the heap of reflections that is looked for, metres, and the weight from which it is one.
const HEAP_M = 2;
const LEAST_WEIGHT = 10;

// The coordinate `wanted` ('x' or 'y') at a time where the other is `value`; `speed` in m/s along the other, where
// known. Null without reflections there.
export function guess(recording, time, wanted, value, speed, chosen) {
  const given = wanted === 'y' ? recording.x : recording.y;
  const other = recording[wanted];
  const [from, to] = [firstFrom(recording.time, time - TIME_S), firstFrom(recording.time, time + TIME_S)];
  const near = [];
  for (let i = from; i < to; i += 1) {
    if (chosen && !chosen[i]) continue;
    const moved = speed === null ? 0 : speed * (recording.time[i] - time);
    if (Math.abs(given[i] - value - moved) > ALONG_M) continue;
    if (speed !== null && Math.abs(radial(recording, i, wanted, speed) - recording.velocity[i]) > DOPPLER_MPS) continue;
    // moving ones say more
    near.push({ at: other[i], weight: 1 + Math.min(Math.abs(recording.velocity[i]), 5) });
  }
  return densest(near);
}

// Radial velocity of something that moves at `speed` along the drawn axis alone.
function radial(recording, i, wanted, speed) {
  const [dx, dy] = [recording.x[i] - recording.mount[0], recording.y[i] - recording.mount[1]];
  return (speed * (wanted === 'y' ? dx : dy)) / Math.hypot(dx, dy, recording.mount[2]);
}

// Mean of the heaviest heap.
function densest(near) {
  if (near.length === 0) return null;
  near.sort((a, b) => a.at - b.at);
  let best = { weight: 0, sum: 0 };
  let [weight, sum, first] = [0, 0, 0];
  for (const { at, weight: w } of near) {
    [weight, sum] = [weight + w, sum + w * at];
    for (; near[first].at < at - HEAP_M; first += 1) {
      [weight, sum] = [weight - near[first].weight, sum - near[first].weight * near[first].at];
    }
    if (weight > best.weight) best = { weight, sum };
  }
  return best.weight < LEAST_WEIGHT ? null : best.sum / best.weight;
}

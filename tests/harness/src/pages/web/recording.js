// A recording as the page holds it: typed arrays, one value a detection, in the order of time.

export async function loadRecording() {
  const [description, bytes] = await Promise.all([
    fetched('recording').then((answer) => answer.json()),
    fetched('points').then((answer) => answer.arrayBuffer()),
  ]);
  const count = new DataView(bytes).getUint32(0, true);
  const array = (Kind, place) => new Kind(bytes, 4 + 4 * count * place, count);
  const frame = array(Uint32Array, 0);
  const time = Float32Array.from(frame, (k) => description.frame_times_s[k]);
  return {
    ...description,
    count,
    frame,
    time,
    x: array(Float32Array, 1),
    y: array(Float32Array, 2),
    velocity: array(Float32Array, 3),
    rcs: array(Float32Array, 4),
  };
}

// An answer, or an error in the server's own words.
export async function fetched(path, options) {
  const answer = await fetch(path, options);
  if (!answer.ok) throw new Error((await answer.text()).trim() || answer.statusText);
  return answer;
}

// Index of the first value that is not below a limit, in an array in ascending order.
export function firstFrom(values, limit) {
  let [low, high] = [0, values.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

// Index of the frame nearest to a time.
export function frameAt(recording, time) {
  const times = recording.frame_times_s;
  const next = Math.min(firstFrom(times, time), times.length - 1);
  return next > 0 && time - times[next - 1] < times[next] - time ? next - 1 : next;
}

// Label tracks: { id, class, size_m, points: [[time_s, x_m, y_m], ...] } in the order of time; without a size, it is
// that of the class. Nothing is changed in place.

// Least time between two points of a track, seconds.
const LEAST_S = 0.001;

export const CLASSES = ['car', 'van', 'truck', 'bus', 'motorcycle', 'bicycle', 'pedestrian'];

export const begins = (track) => track.points[0]?.[0] ?? Infinity;
export const ends = (track) => track.points.at(-1)?.[0] ?? -Infinity;

// [x, y] at a time; nothing before the first and after the last point.
export function positionAt(track, time) {
  const next = track.points.findIndex((point) => point[0] >= time);
  if (next < 0 || (next === 0 && track.points[0][0] > time)) return null;
  const b = track.points[next];
  if (b[0] === time) return [b[1], b[2]];
  const a = track.points[next - 1];
  const share = (time - a[0]) / (b[0] - a[0]);
  return [a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])];
}

export const find = (tracks, id) => tracks.find((track) => track.id === id) ?? null;
export const without = (tracks, id) => tracks.filter((track) => track.id !== id);

// The tracks with one replaced, or added.
export function withTrack(tracks, track, id = track.id) {
  return find(tracks, id) ? tracks.map((old) => (old.id === id ? track : old)) : [...tracks, track];
}

// Of a class; a size that was known was that of another one.
export function classified(track, kind) {
  const { size_m: size, ...rest } = track;
  return kind === track.class && size ? track : { ...rest, class: kind };
}

// A number no track has as its id.
export function newId(tracks) {
  const numbers = tracks.map((track) => Number(track.id)).filter(Number.isInteger);
  return String(Math.max(0, ...numbers) + 1);
}

// With a point more, and its index; one at the same time is replaced.
export function withPoint(track, point) {
  const rest = track.points.filter((other) => Math.abs(other[0] - point[0]) >= LEAST_S);
  const index = rest.filter((other) => other[0] < point[0]).length;
  return { track: { ...track, points: rest.toSpliced(index, 0, point) }, index };
}

// With one point elsewhere; in time it stays between its neighbours.
export function movedPoint(track, index, [time, x, y]) {
  const [before, after] = [track.points[index - 1], track.points[index + 1]];
  const low = before ? before[0] + LEAST_S : -Infinity;
  const high = after ? after[0] - LEAST_S : Infinity;
  return { ...track, points: track.points.with(index, [Math.min(Math.max(time, low), high), x, y]) };
}

export const withoutPoint = (track, index) => ({ ...track, points: track.points.toSpliced(index, 1) });

// The tracks with one cut in two at a time; the later part gets a new id. Null where nothing would be left of one.
export function split(tracks, id, time) {
  const track = find(tracks, id);
  if (!track || time <= begins(track) + LEAST_S || time >= ends(track) - LEAST_S) return null;
  const middle = [time, ...positionAt(track, time)];
  const first = { ...track, points: [...track.points.filter((point) => point[0] < time - LEAST_S), middle] };
  const points = [middle, ...track.points.filter((point) => point[0] > time + LEAST_S)];
  const second = { ...track, id: newId(tracks), points };
  return { tracks: [...withTrack(tracks, first), second], id: second.id };
}

// The tracks with what one has before a time cut off, or what it has after. Null where nothing would be left, or nothing goes.
export function cut(tracks, id, time, after) {
  const halves = split(tracks, id, time);
  if (!halves) return null;
  const kept = find(halves.tracks, after ? id : halves.id);
  return withTrack(tracks, { ...kept, id });
}

// The tracks with two of them one, under the id and class of the longer. They may meet, as after a split. Null where
// they overlap in time.
export function join(tracks, one, other) {
  const pair = [find(tracks, one), find(tracks, other)];
  if (pair.includes(null) || one === other) return null;
  pair.sort((a, b) => begins(a) - begins(b));
  if (ends(pair[0]) > begins(pair[1])) return null;
  const lasts = pair.map((track) => ends(track) - begins(track));
  const rest = pair[1].points.filter((point) => point[0] > ends(pair[0]));
  const named = lasts[1] > lasts[0] ? pair[1] : pair[0];
  const joined = { ...named, points: [...pair[0].points, ...rest] };
  return { tracks: [...without(without(tracks, one), other), joined], id: joined.id };
}

// Mean speed along and across the road, m/s.
export function velocity(track) {
  const [a, b] = [track.points[0], track.points.at(-1)];
  return b && b[0] > a[0] ? [(b[1] - a[1]) / (b[0] - a[0]), (b[2] - a[2]) / (b[0] - a[0])] : [0, 0];
}

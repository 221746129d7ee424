// The part of a plane that a plot shows, in units of its axes: pure functions on { left, right, bottom, top }.

export function panned(view, right, up) {
  return { left: view.left + right, right: view.right + right, bottom: view.bottom + up, top: view.top + up };
}

// Zoomed about a place; a factor above 1 shows less. Factors of the axes are apart.
export function zoomed(view, [x, y], [across, along]) {
  return {
    left: x - (x - view.left) / across,
    right: x + (view.right - x) / across,
    bottom: y - (y - view.bottom) / along,
    top: y + (view.top - y) / along,
  };
}

// Grown by a share of its own size to each side.
export function grown(view, share) {
  const [w, h] = [(view.right - view.left) * share, (view.top - view.bottom) * share];
  return { left: view.left - w, right: view.right + w, bottom: view.bottom - h, top: view.top + h };
}

// The same middle with one scale for both axes, on an area of these pixels; shows at least as much as before.
export function squared(view, width, height) {
  const scale = Math.max((view.right - view.left) / width, (view.top - view.bottom) / height);
  const [x, y] = [(view.left + view.right) / 2, (view.bottom + view.top) / 2];
  const [w, h] = [(scale * width) / 2, (scale * height) / 2];
  return { left: x - w, right: x + w, bottom: y - h, top: y + h };
}

// The view as small or large as may be: neither below `least` nor above `most` units wide or high.
export function limited(view, before, least, most) {
  const sizes = [view.right - view.left, view.top - view.bottom];
  return sizes.every((size) => size >= least && size <= most) ? view : before;
}

// Places of lines on an axis: multiples of 1, 2 or 5 times a power of ten, about `wanted` of them.
export function ticks(low, high, wanted) {
  const raw = (high - low) / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= raw);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) found.push({ at: k * step, text: (k * step).toFixed(digits) });
  return found;
}

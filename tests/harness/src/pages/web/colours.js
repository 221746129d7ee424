// Colours that colour-blind readers can tell apart, for light and dark pages. No meaning rests on colour alone.

// Tracks: after Okabe and Ito, without those that vanish on white or black.
export const TRACKS = ['#0072b2', '#d55e00', '#009e73', '#cc79a7', '#b07d00', '#3a9bdc', '#7a52c7', '#8c564b'];

// From weak to strong: cividis, after Nuñez, Anderton and Renslow (2018).
const LIGHT = [[0xfd, 0xea, 0x45], [0xbc, 0xaf, 0x6f], [0x7c, 0x7b, 0x78], [0x35, 0x45, 0x6c], [0x00, 0x20, 0x51]];
export const WEAKEST_DBSM = -15;
export const STRONGEST_DBSM = 35;

export const isDark = () => matchMedia('(prefers-color-scheme: dark)').matches;

// Strong ones stand out from the page, so the scale is turned round on a dark one; its ends keep clear of the page.
function scale() {
  return isDark() ? [[0x4b, 0x74, 0xc4], ...LIGHT.slice(0, 3).reverse()] : [[0xd9, 0xb4, 0x10], ...LIGHT.slice(1)];
}

// RGBA in the order of bytes that a canvas has on little-endian machines.
const packed = ([red, green, blue], alpha = 255) => ((alpha << 24) | (blue << 16) | (green << 8) | red) >>> 0;

const parsed = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

export function rcsColours() {
  const stops = scale();
  return Uint32Array.from({ length: 256 }, (_, k) => {
    const at = (k / 255) * (stops.length - 1);
    const [from, share] = [Math.min(Math.floor(at), stops.length - 2), at - Math.min(Math.floor(at), stops.length - 2)];
    return packed(stops[from].map((low, c) => Math.round(low + share * (stops[from + 1][c] - low))));
  });
}

export const trackColours = () => Uint32Array.from(TRACKS, (hex) => packed(parsed(hex)));
export const unlabelled = () => packed(isDark() ? [0x6a, 0x72, 0x7b] : [0xa4, 0xab, 0xb3]);
export const faint = () => packed(isDark() ? [0x30, 0x36, 0x3d] : [0xdf, 0xe3, 0xe7]);

// Ground of the plan: unknown, invisible, visible, visible and occupied.
export function groundColours() {
  const colours = isDark()
    ? [[0x14, 0x17, 0x1a], [0x5a, 0x33, 0x20], [0x12, 0x37, 0x4d], [0x2f, 0x6b, 0x8f]]
    : [[0xff, 0xff, 0xff], [0xf2, 0xc9, 0xae], [0xd3, 0xe8, 0xf5], [0x8f, 0xc1, 0xe0]];
  return Uint32Array.from(colours, (colour) => packed(colour));
}

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const asCss = (colour) => `rgb(${colour & 255} ${(colour >> 8) & 255} ${(colour >> 16) & 255})`;

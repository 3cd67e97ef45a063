// Colours of both themes, and the clearance scale.

const LIGHT = {
  runs: ['#1d5fbf', '#c2560c', '#0b7a5c', '#7a3fc0'],
  series: ['#1d6fb8', '#cf5a10', '#1a8355', '#b13d94', '#866800', '#5752cf', '#b93a2c', '#41717f'],
  limb: '#dfe3e8', joint: '#4b5563', base: '#8b95a1', ghost: '#1d5fbf', voxel: '#7d93aa', voxelTop: '#adbdcd', cap: '#66788c', obstacle: '#b0795a', path: '#5f3dc4', predicted: '#7048e8',
  judge: '#9a8fb0', gridMajor: '#b4bec9', gridMinor: '#d8dee5', trailRest: '#a9b4c0', line: '#0e7490', beyond: '#9aa3ad', contact: '#1b0010',
  goal: '#0a8f3c', goalIdle: '#8aa796', sky: '#ffffff', ground: '#9aa5b1', ambient: 1.9, sun: 1.9,
  channels: { potential: '#1d5fbf', damping: '#64748b', gyroscopic: '#d9620b', held: '#0b7a5c', node: '#b3268f' },
  axis: '#4a5563', grid: '#e3e8ed', mark: '#a2352b',
  acts: { stop: '#e0a100', back: '#c2418f', aside: '#0f8fa8' },
};

const DARK = {
  runs: ['#6aa9ff', '#ff9d57', '#4fd0a5', '#c39bff'],
  series: ['#6cb2ff', '#ffa45c', '#5fd39a', '#f08fd6', '#dfc35c', '#aaa6ff', '#ff8b80', '#8fc7d6'],
  limb: '#d5dae0', joint: '#5d6a7a', base: '#78838f', ghost: '#6aa9ff', voxel: '#586c82', voxelTop: '#8da3b8', cap: '#31404f', obstacle: '#a9765b', path: '#b197fc', predicted: '#9775fa',
  judge: '#8f84a8', gridMajor: '#3d4a58', gridMinor: '#29333d', trailRest: '#56636f', line: '#67e1f5', beyond: '#87919c', contact: '#ff4fd8',
  goal: '#3ddc84', goalIdle: '#577263', sky: '#ffffff', ground: '#4a5563', ambient: 1.5, sun: 1.8,
  channels: { potential: '#6aa9ff', damping: '#a3b1c2', gyroscopic: '#ff9d57', held: '#4fd0a5', node: '#f08fd6' },
  axis: '#a9b4c0', grid: '#29323b', mark: '#ff8b80',
  acts: { stop: '#ffd43b', back: '#f08fd6', aside: '#3bc9db' },
};

/** The theme that is shown now: 'light' or 'dark'. */
export function themeName() {
  const set = document.documentElement.dataset.theme;
  if (set) return set;
  return matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
}

export const theme = () => (themeName() === 'dark' ? DARK : LIGHT);
export const runColor = (i) => theme().runs[i % 4];
export const seriesColor = (i) => theme().series[i % 8];

// From contact (dark red) to the influence distance (pale yellow). Lightness increases
// monotonically, so the scale is also readable without hue.
const STOPS = [[103, 0, 31], [178, 24, 43], [226, 74, 51], [252, 141, 89], [253, 204, 138], [254, 240, 190]];

/** Colour of a clearance as sRGB components 0…1; x = clearance / influence distance, 0…1. */
export function clearanceColor(x, out = [0, 0, 0]) {
  const s = Math.min(0.99999, Math.max(0, x)) * (STOPS.length - 1);
  const i = Math.floor(s);
  for (let c = 0; c < 3; ++c) out[c] = (STOPS[i][c] + (s - i) * (STOPS[i + 1][c] - STOPS[i][c])) / 255;
  return out;
}

/** The scale as a CSS gradient, with contact on the left. */
export const clearanceGradient = () => `linear-gradient(to right, ${STOPS.map((s) => `rgb(${s.join(' ')})`).join(', ')})`;

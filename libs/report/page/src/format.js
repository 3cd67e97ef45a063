// Formats numbers and names.

const MINUS = '\u2212';
/** Typesets a number: a minus sign for the hyphen, no plus sign in the exponent. */
const withMinus = (text) => text.replace(/-/g, MINUS).replace(/e\+?/, 'e');

/** A number with `digits` significant digits, with an exponent if it is very small or large. */
export function number(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  if (!Number.isFinite(value)) return value > 0 ? '∞' : `${MINUS}∞`;
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e6) return withMinus(value.toExponential(digits - 1));
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return withMinus(value.toFixed(Math.min(decimals, 12)));
}

/** A number with a given number of decimals; a dash for a missing one. */
export const fixed = (value, decimals) => (value === null || value === undefined ? '–' : withMinus(value.toFixed(decimals)));

/**
 * Labels of an axis, with enough decimals that neighbours differ and at least `least` significant
 * digits for the largest.
 */
export function ticks(splits, increment, least = 3) {
  const largest = Math.max(...splits.map(Math.abs));
  if (!(largest > 0)) return splits.map(() => '0');
  const size = Math.floor(Math.log10(largest) + 1e-9);
  const fine = Math.floor(Math.log10(increment) + 1e-9);
  if (size < -3 || size >= 5) {
    const digits = Math.min(8, Math.max(least - 1, size - fine));
    return splits.map((v) => (Math.abs(v) < increment * 1e-6 ? '0' : withMinus(v.toExponential(digits))));
  }
  const decimals = Math.max(0, -fine, least - 1 - size);
  return splits.map((v) => (Math.abs(v) < increment * 1e-6 ? '0' : withMinus(v.toFixed(decimals))));
}

/** Seconds with milliseconds. */
export const seconds = (t) => `${t.toFixed(3)} s`;

/** Milliseconds of a time in seconds. */
export const milliseconds = (t) => `${(1000 * t).toFixed(0)} ms`;

const UNITS = [
  ['_wxyz', ''], ['_rad_s2', 'rad/s²'], ['_rad_s', 'rad/s'], ['_m_s2', 'm/s²'], ['_m_s', 'm/s'], ['_kg_m2', 'kg m²'], ['_Nm', 'N m'],
  ['_rad', 'rad'], ['_kg', 'kg'], ['_us', 'µs'], ['_ns', 'ns'], ['_Hz', 'Hz'], ['_J', 'J'], ['_W', 'W'], ['_N', 'N'], ['_m', 'm'], ['_s', 's'],
];

/** "energy_error_max_J" → ["energy error max", "J"]. */
export function splitUnit(key) {
  for (const [suffix, unit] of UNITS) {
    if (key.length > suffix.length && key.endsWith(suffix)) return [key.slice(0, -suffix.length).replaceAll('_', ' '), unit];
  }
  return [key.replaceAll('_', ' '), ''];
}

/** A unit as it is printed; empty for pure numbers. */
export const unitText = (unit) => ({ us: 'µs', Nm: 'N m', 1: '' })[unit] ?? unit ?? '';

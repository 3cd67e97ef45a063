// Shares, intervals and quantiles of groups of runs, computed as libs/sweep computes them.

const Z = 1.959963984540054;

/** Wilson's 95 % interval of a share (docs/theory.md, equation 13.13). */
export function wilson(successes, trials) {
  if (trials === 0) return [0, 1];
  const p = successes / trials;
  const z2 = Z * Z;
  const centre = (p + z2 / (2 * trials)) / (1 + z2 / trials);
  const half = (Z / (1 + z2 / trials)) * Math.sqrt((p * (1 - p)) / trials + z2 / (4 * trials * trials));
  return [successes === 0 ? 0 : centre - half, successes === trials ? 1 : centre + half];
}

/** The value of rank ⌊share (n − 1)⌋, counted from 0; of sorted numbers. */
export const quantile = (sorted, share) => sorted[Math.floor(share * (sorted.length - 1))];

/** Quantiles of the numbers that are not null; null if there are none. */
export function distribution(values) {
  const sorted = Float64Array.from(values.filter((value) => value !== null && value !== undefined)).sort();
  if (!sorted.length) return null;
  const [low, q1, median, q3, high] = [0.05, 0.25, 0.5, 0.75, 0.95].map((share) => quantile(sorted, share));
  return { sorted, n: sorted.length, min: sorted[0], low, q1, median, q3, high, max: sorted.at(-1) };
}

/** The success of a group of runs. */
export function success(runs, members) {
  let [feasible, reached, all] = [0, 0, 0];
  for (const i of members) {
    feasible += runs.feasible[i];
    reached += runs.feasible[i] & runs.reached[i];
    all += runs.reached[i];
  }
  return { runs: members.length, feasible, reached, all, share: feasible ? reached / feasible : null, interval: wilson(reached, feasible) };
}

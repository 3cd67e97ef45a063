// Paired comparisons: success with McNemar's test, arrival times with Wilcoxon's.
import { section } from './document.js';
import { h } from './dom.js';
import { fixed } from './format.js';
import { intervalRow, RowAxis } from './rows.js';
import { table } from './tables.js';

const signed = (value, decimals) => `${value > 0 ? '+' : ''}${fixed(value, decimals)}`;
const pText = (p) => (p === null ? '–' : p < 1e-4 ? '< 0.0001' : fixed(p, 4));

function arrivalAxis(items) {
  const ends = items.flatMap(({ arrival }) => arrival.difference_interval_s ?? (arrival.difference_s === null ? [] : [arrival.difference_s]));
  const most = Math.max(0, ...ends.map(Math.abs));
  return most > 0 ? new RowAxis(-most, most, 180) : null;
}

function cells(item, axis, times) {
  const { a, b, pairs, reached, arrival } = item;
  const [low, high] = reached.difference_interval;
  const range = arrival.difference_interval_s;
  const row = [
    `${a} − ${b}`, String(pairs), String(reached.both), String(reached.only_a), String(reached.only_b), String(reached.neither), signed(100 * reached.difference, 1), `${signed(100 * low, 1)} – ${signed(100 * high, 1)}`,
    { content: intervalRow(axis, reached.difference, [low, high], `difference of success ${signed(100 * reached.difference, 1)} %, 95 % interval ${signed(100 * low, 1)} to ${signed(100 * high, 1)} %`, { zero: true }), class: 'text' },
    pText(reached.p), String(arrival.pairs), arrival.difference_s === null ? '–' : signed(arrival.difference_s, 3), range ? `${signed(range[0], 3)} – ${signed(range[1], 3)}` : '–',
  ];
  if (times) {
    row.push({
      content: arrival.difference_s === null ? '' : intervalRow(times, arrival.difference_s, range ?? [arrival.difference_s, arrival.difference_s], `difference of arrival ${signed(arrival.difference_s, 3)} s`, { zero: true }),
      class: 'text',
    });
  }
  row.push(pText(arrival.p), arrival.rank_biserial === null ? '–' : signed(arrival.rank_biserial, 2));
  return row;
}

function comparisonTable({ title, items }) {
  const most = Math.min(1, Math.max(0.1, ...items.flatMap(({ reached }) => reached.difference_interval.map(Math.abs))));
  const axis = new RowAxis(-most, most, 180);
  const times = arrivalAxis(items);
  const left = items.reduce((sum, item) => sum + item.without_partner, 0);
  const other = items.reduce((sum, item) => sum + item.different_scene_files, 0);
  return [
    h('h3', {}, title),
    table({
      caption: `Comparison: ${title}`,
      head: ['first − second', 'pairs', ['both', 'reach'], ['only the', 'first'], ['only the', 'second'], 'neither', ['difference of', 'success [%]'], '95 % interval', { content: axis.head(100), class: 'text' }, ['McNemar', 'p'],
        ['pairs that', 'both reach'], ['later by', '[s]'], '95 % interval', ...(times ? [{ content: times.head(), class: 'text' }] : []), ['Wilcoxon', 'p'], ['rank-', 'biserial']],
      rows: items.map((item) => ({ cells: cells(item, axis, times) })),
    }),
    left > 0 && h('p', {}, `${left} runs are left out, since they have no recorded, feasible partner.`),
    other > 0 && h('p', {}, `The scene files of ${other} pairs differ.`),
  ];
}

export function comparisonSection(comparisons) {
  const shown = comparisons.filter(({ items }) => items.length);
  return shown.length > 0 && section('Paired comparisons',
    h('p', {}, 'Runs of the same scene, seed and values form a pair; pairs that are not feasible do not count. Success: McNemar’s exact test of the pairs in which only one side arrives, and Tango’s 95 % interval of the difference. Arrival: Wilcoxon’s signed-rank test, and Hodges’ and Lehmann’s median of the differences with its 95 % interval, of the pairs that both reach. Values of p are two-sided and not adjusted for the number of comparisons. Of the planners, the first eight are compared.'),
    shown.flatMap(comparisonTable));
}

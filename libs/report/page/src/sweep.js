// The page of `hamelin sweep merge`: success and distributions, comparisons, failures, maps of what
// varies, and all runs.
import { comparisonSection } from './comparisons.js';
import { notes, section, showDocument } from './document.js';
import { h, svg } from './dom.js';
import { failureSection } from './failures.js';
import { fixed } from './format.js';
import { groupSection } from './groups.js';
import { mapSection } from './maps.js';
import { Runs } from './runs.js';
import { RunTable } from './runtable.js';
import { table } from './tables.js';

const SHARE_HEAD = { content: '0 % … 100 %', class: 'text' };

/** A share as a bar, with its confidence interval as a whisker. */
function bar(share, [low, high]) {
  const width = 130;
  const percent = (part) => fixed(100 * part, 1);
  const at = (part) => (width * part).toFixed(1);
  const [from, to] = [(width * low + 0.7).toFixed(1), (width * high - 0.7).toFixed(1)];
  return svg('svg', { width, height: 16, role: 'img', 'aria-label': `${percent(share)} %, 95 % interval ${percent(low)} to ${percent(high)} %` },
    svg('rect', { class: 'share-track', y: 3, width, height: 10, rx: 2 }),
    svg('rect', { class: 'share', y: 3, width: at(share), height: 10, rx: 2 }),
    svg('path', { class: 'whisker', d: `M${from} 8H${to}M${from} 4v8M${to} 4v8` }));
}

const scaled = (value, scale, decimals) => fixed(value === null ? null : scale * value, decimals);
const pair = (a, b) => `${a} / ${b}`;
/** Percentage and bar of a share of `all`; a dash if `all` is 0. */
const shareCells = (part, all, interval) => (all > 0 ? [fixed((100 * part) / all, 1), { content: bar(part / all, interval), class: 'text' }] : ['–', '']);

function groupCells(group, by) {
  const count = (outcome) => group.outcomes[outcome] ?? 0;
  const [stalled, timeout, collided] = ['stalled', 'timeout', 'collision'].map(count);
  return [
    ...by.map((label) => group.labels[label]),
    group.runs === group.planned ? String(group.runs) : `${group.runs} of ${group.planned}`, String(group.feasible), String(group.reached),
    ...shareCells(group.reached, group.feasible, group.reached_share_interval),
    ...[stalled, timeout, collided, group.runs - group.reached_all - stalled - timeout - collided].map(String),
    { content: group.judged > 0 ? String(group.contacts) : '–', class: group.contacts > 0 ? 'contacts' : null },
    scaled(group.min_clearance_m, 1e3, 2), scaled(group.min_self_clearance_m, 1e3, 2),
    pair(scaled(group.certified_share_mean, 100, 3), scaled(group.certified_share_min, 100, 2)), fixed(group.reached_time_s_median, 2),
    pair(fixed(group.timing.tick_us_p50_median, 1), fixed(group.timing.tick_us_p99_median, 1)), fixed(group.recovery_work_J_median, 4),
  ];
}

function summaryTable({ by, groups }) {
  return section('Summary',
    h('p', {}, 'One row per group of the summary. Contacts and clearances are measured by the judge, which uses the exact primitives if the scene has them. Arrival times are medians. The tick times are medians over the p50 and p99 of the runs.'),
    table({
      caption: 'Success by group', words: by.length,
      head: [...by, 'runs', 'feasible', 'reached', '%', SHARE_HEAD, 'stalled', 'timeout', 'collision', 'other', ['contacts', 'judged'], ['smallest clearance', '[mm]'], ['self-clearance', '[mm]'],
        ['certified [%]', 'mean / smallest'], ['arrival', '[s]'], ['tick [µs]', 'p50 / p99'], ['recovery', 'work [J]']],
      rows: groups.map((group) => ({ cells: groupCells(group, by) })),
    }));
}

function gainTable(gains) {
  return gains.length > 0 && section('Gain sets',
    h('p', {}, 'Results among the sets that reach the goal without the obstacle in the same time, and among those with which apf stalls. Links are segments, and the runs use semi-implicit Euler with a step of 4 ms for 40 s, without gravity.'),
    table({
      caption: 'Gain sets by planner',
      head: ['planner', 'sets', 'reached', 'contacts', ['reached without', 'the obstacle'], ['reached', 'of these'], '%', SHARE_HEAD, 'apf stalls', ['reached', 'of these']],
      rows: gains.map((group) => ({
        cells: [group.planner, String(group.sets), String(group.reached), { content: String(group.contacts), class: group.contacts > 0 ? 'contacts' : null }, String(group.reference), String(group.reached_of_reference),
          ...shareCells(group.reached_of_reference, group.reference, group.reached_share_interval), String(group.apf_stalled), String(group.reached_of_apf_stalled)],
      })),
    }));
}

showDocument('hamelin.sweep-page/2', (data) => {
  const runs = new Runs(data);
  const all = new RunTable(runs);
  const show = (failure) => {
    all.filter({ text: '', outcome: '', planner: '', feasible: '', failure });
    all.element.scrollIntoView();
    all.search.focus({ preventScroll: true });
  };
  return {
    title: data.directories.length > 1 ? 'Sweeps' : 'Sweep',
    about: `${data.recorded} of ${data.planned} planned runs in ${data.directories.join(', ')}`,
    content: [notes(data.summary.notes), groupSection(runs, data.summary.by), comparisonSection(data.comparisons), failureSection(runs, show), mapSection(runs), gainTable(data.summary.gains), summaryTable(data.summary), all.element],
  };
});

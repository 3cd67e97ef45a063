// The page of `hamelin sweep merge`: success, the map of gain sets, and why runs did not reach
// their goal.
import { notes, section, showDocument } from './document.js';
import { h, svg } from './dom.js';
import { fixed } from './format.js';
import { legendMark, logPlot } from './logplot.js';
import { badge } from './summary.js';
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

function success({ by, groups }) {
  return section('Success',
    h('p', {}, '“Reached” is the share of the feasible runs that arrived without contact, with Wilson’s 95 % interval. A run is feasible if start and goal are free of the map, obstacles and self-contact. Contacts and clearances are measured by the judge, which uses the exact primitives if the scene has them. Arrival times are medians. The tick times are medians over the p50 and p99 of the runs.'),
    table({
      caption: 'Success by group', words: by.length,
      head: [...by, 'runs', 'feasible', 'reached', '%', SHARE_HEAD, 'stalled', 'timeout', 'collision', 'other', ['contacts', 'judged'], ['smallest clearance', '[mm]'], ['self-clearance', '[mm]'],
        ['certified [%]', 'mean / smallest'], ['arrival', '[s]'], ['tick [µs]', 'p50 / p99'], ['recovery', 'work [J]']],
      rows: groups.map((group) => ({ cells: groupCells(group, by) })),
    }));
}

// Marks for the runs of gain sets, with different shapes and colours.
const SPOTS = {
  reached: { shape: 'circle', style: '--color: var(--good)' },
  contact: { shape: 'cross', class: 'stroke', style: '--color: var(--bad)' },
  stalled: { shape: 'square', class: 'open', style: '--color: var(--mild)' },
  timeout: { shape: 'triangle', style: '--color: var(--accent)' },
  other: { shape: 'diamond', style: '--color: var(--soft)' },
};
const spotOf = (outcome) => (outcome in SPOTS ? outcome : ['collision', 'refused'].includes(outcome) ? 'contact' : 'other');

function gainPanel(planner, sets) {
  const across = planner.startsWith('apf') ? { gain: 'eta', label: 'η [m⁴/s²]' } : { gain: 'k_obs', label: 'k_obs [m/s]' };
  const counts = Object.keys(SPOTS).map((spot) => [spot, sets.filter((set) => spotOf(set.outcome) === spot).length]).filter(([, count]) => count > 0);
  const points = sets.map((set) => ({
    x: set.gains[across.gain], y: set.gains.k_p, kind: SPOTS[spotOf(set.outcome)],
    hint: `${set.run}: ${set.outcome}${set.cause ? `: ${set.cause}` : ''}`,
  }));
  return logPlot({
    title: planner, detail: `${sets.filter((set) => set.outcome === 'reached').length} of ${sets.length} reached`,
    label: `Gain map of ${planner}: ${counts.map(([spot, count]) => `${count} ${spot}`).join(', ')}`,
    xLabel: across.label, yLabel: 'k_p [1/s²]', width: 420, height: 340, series: [{ name: planner, lines: [points] }],
  });
}

function gainTable(gains) {
  return table({
    caption: 'Gain sets by planner',
    head: ['planner', 'sets', 'reached', 'contacts', ['reached without', 'the obstacle'], ['reached', 'of these'], '%', SHARE_HEAD, 'apf stalls', ['reached', 'of these']],
    rows: gains.map((group) => ({
      cells: [group.planner, String(group.sets), String(group.reached), { content: String(group.contacts), class: group.contacts > 0 ? 'contacts' : null }, String(group.reference), String(group.reached_of_reference),
        ...shareCells(group.reached_of_reference, group.reference, group.reached_share_interval), String(group.apf_stalled), String(group.reached_of_apf_stalled)],
    })),
  });
}

function gainMap(sets, gains) {
  if (!sets.length) return false;
  const planners = [...new Set(sets.map((set) => set.planner))].sort();
  return section('Gain map of example 5.2',
    h('p', {}, 'Each mark is a random gain set: k_p against η (apf) or k_obs (gyro, hybrid), on logarithmic axes. Links are segments, and the runs use semi-implicit Euler with a step of 4 ms for 40 s, without gravity. Point at a mark to see its run.'),
    h('div', { class: 'legend' }, Object.entries(SPOTS).map(([spot, kind]) => h('span', {}, legendMark(kind), ` ${spot}`))),
    h('div', { class: 'figure-row' }, planners.map((planner) => gainPanel(planner, sets.filter((set) => set.planner === planner)))),
    h('p', {}, 'Results among the sets that reach the goal without the obstacle in the same time, and among those with which apf stalls:'),
    gainTable(gains));
}

function causes({ by, groups }) {
  const rows = groups.flatMap((group) => Object.entries(group.causes).sort(([, a], [, b]) => b - a)
    .map(([cause, count]) => ({ cells: [by.map((label) => group.labels[label]).join(', '), String(count), { content: cause, class: 'cause' }] })));
  return rows.length > 0 && section('Why runs did not reach their goal',
    table({ caption: 'Causes by group', head: [by.join(', '), 'runs', { content: 'outcome: cause', class: 'text' }], rows }));
}

function failed(failures) {
  if (!failures.length) return false;
  return section('Runs that did not reach their goal',
    h('details', { open: failures.length <= 100 },
      h('summary', {}, `${failures.length} runs, each with the command that repeats it`),
      table({
        caption: 'Commands that repeat the runs', words: 4, head: ['run', 'outcome', 'cause', 'command'],
        rows: failures.map(({ run, outcome, cause, command }) => ({
          cells: [run, { content: badge(outcome), class: 'text' }, { content: cause, class: 'cause' }, { content: h('code', {}, command), class: 'text' }],
        })),
      })));
}

showDocument('hamelin.sweep-page/1', (data) => ({
  title: 'Sweep',
  about: `${data.recorded} of ${data.planned} planned runs in ${data.directories.join(', ')}`,
  content: [notes(data.summary.notes), success(data.summary), gainMap(data.gain_sets, data.summary.gains), causes(data.summary), failed(data.failures)],
}));

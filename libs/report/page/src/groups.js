// Success and distributions of groups of runs, by a label that the reader chooses.
import { section } from './document.js';
import { h } from './dom.js';
import { fixed } from './format.js';
import { boxRow, intervalRow, RowAxis, select } from './rows.js';
import { naturally } from './runs.js';
import { distribution, success } from './statistics.js';
import { table } from './tables.js';

const GROUPS_MOST = 400;
const percent = (share) => fixed(100 * share, 1);

/** The choices of grouping: the labels of the summary, and each label and varied value alone. */
function groupings(runs, by) {
  const columns = runs.groupable();
  const own = by.filter((name) => columns.has(name));
  const all = new Map();
  if (own.length > 1) all.set(own.join(', '), own.map((name) => columns.get(name)));
  for (const [name, column] of columns) all.set(name, [column]);
  return all;
}

/** The largest share first; equal shares, and groups without feasible runs, by name. */
function ranked(groups) {
  const share = (group) => group.success.share ?? -1;
  return groups.sort((a, b) => share(b) - share(a) || naturally(a.key.join(' '), b.key.join(' ')));
}

function successTable(groups, names) {
  const axis = new RowAxis(0, 1);
  const row = ({ key, success: s }) => ({
    cells: [
      ...key, s.feasible ? `${s.reached} of ${s.feasible}` : 'none feasible', s.share === null ? '–' : percent(s.share),
      s.share === null ? '–' : `${percent(s.interval[0])} – ${percent(s.interval[1])}`,
      { content: s.share === null ? '' : intervalRow(axis, s.share, s.interval, `${percent(s.share)} %, 95 % interval ${percent(s.interval[0])} to ${percent(s.interval[1])} %`), class: 'text' },
      `${s.all} of ${s.runs}`,
    ],
  });
  return table({
    caption: 'Success by chosen label', words: names.length,
    head: [...names, ['reached,', 'of the feasible runs'], '%', '95 % interval', { content: axis.head(100), class: 'text' }, ['reached,', 'of all runs']],
    rows: groups.map(row),
  });
}

const FIGURES = [
  { name: 'arrival [s]', scale: 1, decimals: 2, of: (runs, members) => members.filter((i) => runs.reached[i]).map((i) => runs.figures.time_s[i]) },
  { name: 'smallest clearance [mm]', scale: 1e3, decimals: 2, of: (runs, members) => members.map((i) => runs.figures.clearance_m[i]) },
  { name: 'tick p50 [µs]', scale: 1, decimals: 1, of: (runs, members) => members.map((i) => runs.figures.tick_us_p50[i]) },
];

function distributionTable(runs, groups, names) {
  const columns = FIGURES.map((figure) => {
    const all = groups.map((group) => distribution(figure.of(runs, group.members)));
    return { ...figure, all, axis: RowAxis.of(all) };
  }).filter(({ axis }) => axis);
  if (!columns.length) return null;
  const cells = ({ name, all, axis, scale, decimals }, g) => {
    const d = all[g];
    if (!d) return ['0', '–', ''];
    const text = (value) => fixed(scale * value, decimals);
    return [String(d.n), text(d.median), { content: boxRow(axis, d, `${name}: median ${text(d.median)}, quartiles ${text(d.q1)} and ${text(d.q3)}, smallest ${text(d.min)}, largest ${text(d.max)}`), class: 'text' }];
  };
  return table({
    caption: 'Distributions by chosen label', words: names.length,
    head: [...names, ...columns.flatMap(({ name, axis, scale }) => ['runs', ['median', name], { content: axis.head(scale), class: 'text' }])],
    rows: groups.map((group, g) => ({ cells: [...group.key, ...columns.flatMap((column) => cells(column, g))] })),
  });
}

/** The section with a chart of the success and the distributions of each group. */
export function groupSection(runs, by) {
  const choices = groupings(runs, by);
  const names = [...choices.keys()];
  if (!names.length || !runs.recorded.length) return null;
  const charts = h('div', {});
  const draw = (name) => {
    const groups = ranked(runs.group(choices.get(name)).map((group) => ({ ...group, success: success(runs, group.members) })));
    const shown = groups.slice(0, GROUPS_MOST);
    const heads = choices.get(name).length > 1 ? by.filter((label) => runs.groupable().has(label)) : [name];
    charts.replaceChildren(...[
      successTable(shown, heads),
      groups.length > shown.length && h('p', {}, `The ${shown.length} groups with the largest shares are shown, of ${groups.length}; the table of all runs has the others.`),
      h('h3', {}, 'Arrival, clearance and cost'),
      h('p', {}, 'Box: quartiles and median. Whiskers: 5 % and 95 %. Dots: runs, up to 150 evenly spaced by rank. Arrival times are those of the runs that reached the goal; clearances are the judge’s, and tick times the p50 of each run.'),
      distributionTable(runs, shown, heads),
    ].filter(Boolean));
  };
  const start = names[0].includes(', ') || !choices.has('planner') ? names[0] : 'planner';
  draw(start);
  return section('Success',
    h('p', {}, 'A run is feasible if start and goal are free of the map, obstacles and self-contact. “Reached” counts arrivals without contact that the judge saw. The percentage, and Wilson’s 95 % interval, are of the feasible runs; the last column counts all runs.'),
    h('div', { class: 'controls' }, select('Group by', names.map((name) => [name, name]), start, draw)), charts);
}

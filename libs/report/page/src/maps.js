// Maps over two values that vary: tables of cells for few values, marks for many.
import { section } from './document.js';
import { h } from './dom.js';
import { fixed } from './format.js';
import { axisPlot, legendMark } from './logplot.js';
import { select } from './rows.js';
import { naturally } from './runs.js';
import { distribution, success } from './statistics.js';
import { table } from './tables.js';

const CELLS_MOST = 30;
const MARKS_MOST = 4000;
const PANELS_MOST = 6;
const LABELS = { eta: 'η [m⁴/s²]', k_obs: 'k_obs [m/s]', k_p: 'k_p [1/s²]', k_v: 'k_v [1/s]' };
const NO_OBSTACLE = 'no obstacle';

// Marks of the outcomes, with different shapes and colours.
const SPOTS = {
  reached: { shape: 'circle', style: '--color: var(--good)' },
  contact: { shape: 'cross', class: 'stroke', style: '--color: var(--bad)' },
  stalled: { shape: 'square', class: 'open', style: '--color: var(--mild)' },
  timeout: { shape: 'triangle', style: '--color: var(--accent)' },
  other: { shape: 'diamond', style: '--color: var(--soft)' },
};
const spotOf = (outcome) => (outcome in SPOTS ? outcome : ['collision', 'refused'].includes(outcome) ? 'contact' : 'other');

/**
 * What varies, by name: {name, few, known(i), text(i), number}. `number` gives the value of a run, and
 * is null if the values are no numbers; `few` means that they make rows or columns of cells.
 */
function dimensions(runs) {
  const all = new Map();
  for (const [name, column] of runs.gains) {
    if (column.some((value) => value !== null)) all.set(name, { name, few: false, known: (i) => column[i] !== null, number: (i) => column[i], text: (i) => String(column[i]) });
  }
  for (const [name, column] of runs.groupable()) {
    if (name === 'planner' || name === 'values' || name === 'gains' || column.values.length < 2) continue;
    const numbers = column.values.map(Number);
    const numeric = column.values.every((value, k) => value !== '' && Number.isFinite(numbers[k]));
    all.set(name, { name, few: column.values.length <= CELLS_MOST, known: (i) => column.index[i] >= 0, number: numeric ? (i) => numbers[column.index[i]] : null, text: (i) => column.at(i) });
  }
  return all;
}

const hint = (runs, i) => `${runs.ids[i]}: ${runs.text('outcome', i)}${runs.text('cause', i) ? `: ${runs.text('cause', i)}` : ''}`;

/** One mark per run; of many runs, evenly spaced ones. */
function scatter(runs, planner, members, x, y) {
  const known = members.filter((i) => x.known(i) && y.known(i));
  if (!known.length) return null;
  const every = Math.ceil(known.length / MARKS_MOST);
  const shown = known.filter((_, k) => k % every === 0);
  const reached = known.filter((i) => runs.reached[i]).length;
  const counts = Object.keys(SPOTS).map((spot) => [spot, known.filter((i) => spotOf(runs.text('outcome', i)) === spot).length]).filter(([, count]) => count > 0);
  return axisPlot({
    title: planner, detail: `${reached} of ${known.length} reached${every > 1 ? `; one mark per ${every} runs` : ''}`,
    label: `Map of ${planner}: ${counts.map(([spot, count]) => `${count} ${spot}`).join(', ')}`,
    xLabel: LABELS[x.name] ?? x.name, yLabel: LABELS[y.name] ?? y.name, width: 420, height: 340,
    series: [{ name: planner, lines: [shown.map((i) => ({ x: x.number(i), y: y.number(i), kind: SPOTS[spotOf(runs.text('outcome', i))], hint: hint(runs, i) }))] }],
  });
}

const inOrder = (texts) => [...texts].sort(naturally);

/** One cell per pair of values, with the share that reached, or the median arrival time. */
function heatMap(runs, planner, all, x, y, shown) {
  const members = all.filter((i) => x.known(i) && y.known(i));
  if (!members.length) return null;
  const cells = new Map();
  for (const i of members) {
    const key = `${x.text(i)} ${y.text(i)}`;
    const found = cells.get(key);
    if (found) found.push(i);
    else cells.set(key, [i]);
  }
  const [columns, rows] = [inOrder(new Set(members.map(x.text))), inOrder(new Set(members.map(y.text)))];
  const results = new Map([...cells].map(([key, list]) => [key, {
    ...success(runs, list), time: distribution(list.filter((i) => runs.reached[i]).map((i) => runs.figures.time_s[i]))?.median ?? null,
  }]));
  const times = [...results.values()].map(({ time }) => time).filter((time) => time !== null);
  const [fast, slow] = [Math.min(...times), Math.max(...times)];
  const cell = (row, column) => {
    const result = results.get(`${column} ${row}`);
    if (!result) return { content: '–', class: 'heat none' };
    const share = shown === 'time' ? (result.time === null ? null : slow > fast ? 1 - (result.time - fast) / (slow - fast) : 1) : result.share;
    const text = shown === 'time' ? fixed(result.time, 2) : result.share === null ? '–' : `${fixed(100 * result.share, 0)} %`;
    const box = h('span', { title: `${result.reached} of ${result.feasible} feasible runs reached, 95 % interval ${fixed(100 * result.interval[0], 0)} to ${fixed(100 * result.interval[1], 0)} %` }, text, ' ', h('small', {}, `${result.reached}/${result.feasible}`));
    return { content: box, class: 'heat', style: `--share: ${(share ?? 0).toFixed(3)}` };
  };
  return table({
    caption: `${planner}: ${shown === 'time' ? 'median arrival time [s]' : 'reached, of the feasible runs'}, ${y.name} (down) over ${x.name} (across)`, shown: true,
    head: [`${y.name} \\ ${x.name}`, ...columns], rows: rows.map((row) => ({ cells: [row, ...columns.map((column) => cell(row, column))] })),
  });
}

/** The axes that are shown first: the gains of example 5.2, else what varies. */
function start(all) {
  const names = [...all.keys()];
  if (all.has('k_p')) return { x: all.has('k_obs') ? 'k_obs' : 'eta', y: 'k_p' };
  const own = names.filter((name) => name.startsWith('/'));
  const [x, y] = own.length > 1 ? own : [...own, ...names.filter((name) => !own.includes(name))];
  return { x, y };
}

export function mapSection(runs) {
  const all = dimensions(runs);
  if (all.size < 2 || ![...all.keys()].some((name) => name.startsWith('/') || runs.gains.has(name))) return null;
  const members = runs.recorded.filter((i) => runs.labels.get('problem')?.at(i) !== NO_OBSTACLE);
  const planners = runs.group([runs.labels.get('planner')], members).map(({ key, members: list }) => ({ planner: key[0], list })).sort((a, b) => naturally(a.planner, b.planner)).slice(0, PANELS_MOST);
  const state = { ...start(all), shown: 'share' };
  const drawing = h('div', {});
  const draw = () => {
    const [x, y] = [all.get(state.x), all.get(state.y)];
    const cells = x.few && y.few;
    measure.hidden = !cells;
    if (!cells && (!x.number || !y.number)) {
      drawing.replaceChildren(h('p', { role: 'status' }, 'One of these has many values that are no numbers; choose another.'));
      return;
    }
    // apf has no k_obs, and the others no η.
    const own = (axis, planner) => (runs.gains.has('eta') && ['eta', 'k_obs'].includes(axis.name) ? all.get(planner.startsWith('apf') ? 'eta' : 'k_obs') ?? axis : axis);
    drawing.replaceChildren(...(cells
      ? [h('div', { class: 'figure-row' }, planners.map(({ planner, list }) => heatMap(runs, planner, list, x, y, state.shown)).filter(Boolean))]
      : [h('div', { class: 'legend' }, Object.entries(SPOTS).map(([spot, kind]) => h('span', {}, legendMark(kind), ` ${spot}`))),
        h('div', { class: 'figure-row' }, planners.map(({ planner, list }) => scatter(runs, planner, list, own(x, planner), own(y, planner))).filter(Boolean))]));
  };
  const names = [...all.keys()].map((name) => [name, name]);
  const measure = select('Show', [['share', 'success'], ['time', 'median arrival time']], state.shown, (value) => { state.shown = value; draw(); });
  const controls = h('div', { class: 'controls' },
    select('Across', names, state.x, (value) => { state.x = value; draw(); }), select('Up', names, state.y, (value) => { state.y = value; draw(); }), measure);
  draw();
  return section('Maps of what varies',
    h('p', {}, `Up to ${CELLS_MOST} values per axis give one cell for each pair of values; gains, and more values, give one mark per run. ${runs.gains.size ? 'The gains are those of the random sets of example 5.2; apf is shown over η [m⁴/s²], the others over k_obs [m/s], and k_p is in 1/s². ' : ''}Point at a mark or a cell to see more.`),
    controls, drawing);
}


// Tables and lists: outcomes of the runs, events, configuration, provenance.
import { runColor } from './colors.js';
import { h } from './dom.js';
import { number, seconds, splitUnit } from './format.js';

const GOOD = new Set(['reached', 'followed', 'completed']);
const BAD = new Set(['collision', 'diverged', 'defect', 'refused', 'crashed']);

/** The outcome as a coloured word. */
export function badge(outcome) {
  return h('span', { class: `badge ${GOOD.has(outcome) ? 'good' : BAD.has(outcome) ? 'bad' : 'mild'}` }, outcome);
}

/** The name of a run with its colour. */
export function runLabel(run, i) {
  const dot = h('span', { class: 'dot' });
  dot.dataset.run = i;
  dot.style.background = runColor(i);
  return h('span', { class: 'run-name' }, dot, run.name);
}

const unit = (value, name, digits = 4) => (value === null || value === undefined ? '–' : `${number(value, digits)} ${name}`);

const COLUMNS = [
  ['planner', (run) => run.planner ?? 'none'],
  ['integrator', (run) => run.integrator ?? '–'],
  ['ended after', (run) => unit(run.result?.time_s ?? run.frames.t.at(-1), 's')],
  ['goals', (run) => (run.result?.goal ? `${run.result.goal.index} of ${run.result.goal.count}` : '–')],
  ['smallest clearance', (run) => unit(run.result?.min_clearance_m, 'm')],
  ['energy error', (run) => unit(run.result?.energy_error_max_J, 'J', 3)],
  ['updates per step', (run) => (run.result?.solver ? `mean ${number(run.result.solver.updates_mean, 3)}, max ${run.result.solver.updates_max}` : '–')],
  ['tick p50 / p99', (run) => (run.result?.timing?.tick_us ? `${number(run.result.timing.tick_us.p50, 3)} / ${number(run.result.timing.tick_us.p99, 3)} µs` : '–')],
];

/** A table with one row per run: outcome, cause and the values to compare. */
export function comparison(runs) {
  return h('div', { class: 'table-box', tabIndex: 0, role: 'region', 'aria-label': 'Comparison of the runs' },
    h('table', { class: 'comparison' },
      h('thead', {}, h('tr', {}, ['run', 'outcome', ...COLUMNS.map(([title]) => title), 'cause'].map((title) => h('th', { scope: 'col' }, title)))),
      h('tbody', {}, runs.map((run, i) => h('tr', {},
        h('th', { scope: 'row' }, runLabel(run, i)), h('td', {}, badge(run.outcome)),
        COLUMNS.map(([, value]) => h('td', { class: 'figure' }, value(run))), h('td', { class: 'cause' }, run.cause ?? '–'))))));
}

/** Remarks about the logs. */
export function notes(runs) {
  const lines = runs.flatMap((run, i) => [...run.notes, ...(run.result?.warnings ?? [])].map((note) => h('li', {}, runs.length > 1 && [runLabel(run, i), ': '], note)));
  return lines.length ? h('section', { 'aria-label': 'Notes' }, h('ul', { class: 'notes' }, lines)) : null;
}

/** The leaves of a JSON document as [path, value, unit]. */
function leaves(value, path = '', out = []) {
  const plain = value === null || typeof value !== 'object' || (Array.isArray(value) && value.every((v) => v === null || typeof v !== 'object'));
  if (plain) {
    const key = path.split('.').at(-1);
    const [, unit] = splitUnit(key.replace(/\[\d+\]$/, ''));
    const one = (v) => (typeof v === 'number' ? (Number.isInteger(v) ? String(v) : String(v).length > 9 ? number(v, 6) : String(v)) : v === null ? '–' : String(v));
    out.push([path, Array.isArray(value) ? (value.length ? value.map(one).join(', ') : 'none') : one(value), unit]);
  } else if (Array.isArray(value)) value.forEach((v, i) => leaves(v, `${path}[${i + 1}]`, out));
  else for (const [key, v] of Object.entries(value)) leaves(v, path ? `${path}.${key}` : key, out);
  return out;
}

/** Documents side by side, with one row per key that any of them has. */
function sideBySide(runs, pick) {
  const columns = runs.map((run) => new Map(leaves(pick(run) ?? {}).map(([path, value, unit]) => [path, value === '–' || !unit ? value : `${value} ${unit}`])));
  const keys = [...new Set(columns.flatMap((column) => [...column.keys()]))].filter((key) => key);
  const label = (path) => {
    const parts = path.split('.');
    return [...parts.slice(0, -1).map((part) => part.replaceAll('_', ' ')), splitUnit(parts.at(-1))[0]].join(' › ');
  };
  return h('div', { class: 'table-box' }, h('table', { class: 'facts' },
    runs.length > 1 && h('thead', {}, h('tr', {}, h('td', {}), runs.map((run, i) => h('th', { scope: 'col' }, runLabel(run, i))))),
    h('tbody', {}, keys.map((key) => {
      const values = columns.map((column) => column.get(key) ?? '–');
      return h('tr', { class: runs.length > 1 && new Set(values).size > 1 ? 'differs' : '' }, h('th', { scope: 'row', title: key }, label(key)), values.map((value) => h('td', {}, value)));
    }))));
}

function events(runs, jump) {
  const rows = runs.flatMap((run, i) => run.events.map((event) => ({ ...event, run, i }))).sort((a, b) => (a.t ?? -1) - (b.t ?? -1));
  if (!rows.length) return h('p', { class: 'quiet' }, 'No events were logged.');
  return h('ol', { class: 'events' }, rows.map(({ t, text, run, i }) => h('li', {},
    typeof t === 'number' ? h('button', { type: 'button', class: 'when', onclick: () => jump(t) }, seconds(t)) : h('span', { class: 'when' }, 'whole run'),
    runs.length > 1 && runLabel(run, i), h('span', {}, text))));
}

/** Collapsible sections at the bottom of the page. */
export function sections(report, jump) {
  const { runs } = report;
  const count = runs.reduce((sum, run) => sum + run.events.length, 0);
  const section = (title, body, open = false) => h('details', { class: 'section', open }, h('summary', {}, title), body);
  return h('section', { class: 'sections', 'aria-label': 'Details' },
    section(`Events (${count})`, events(runs, jump), runs.length === 1 && count <= 12),
    runs.some((run) => run.result) && section('Results', sideBySide(runs, (run) => Object.fromEntries(Object.entries(run.result ?? {}).filter(([key]) => !['provenance', 'type'].includes(key))))),
    section('Configuration', sideBySide(runs, (run) => run.config)),
    section('Provenance', sideBySide(runs, (run) => ({ log: run.log, scene: run.scene, ...run.provenance }))));
}

// The page of `hamelin accuracy`: speed against error, error and energy error against the step, and the tables.
import { notes, section, showDocument } from './document.js';
import { check, h } from './dom.js';
import { number } from './format.js';
import { legendMark, logPlot } from './logplot.js';
import { table } from './tables.js';

const SHAPES = ['circle', 'square', 'triangle', 'diamond', 'wedge'];
// What rounding leaves of an error of nothing: a logarithm needs some.
const LEAST_SHOWN = 1e-17;

const shownError = (row) => (row.error_q === null ? null : Math.max(row.reference_limited ? row.reference_error : row.error_q, LEAST_SHOWN));
const shownEnergy = (row) => (row.energy_error_max_J === null ? null : Math.max(row.energy_error_max_J, LEAST_SHOWN));

const PLOTS = [
  { title: 'Error against CPU time', x: (row) => row.cpu_us, y: shownError, xLabel: 'CPU time [µs]', yLabel: 'error in q(T) [rad or m]', ofError: true },
  { title: 'Error against step', detail: 'fixed steps', x: (row) => row.step_s, y: shownError, xLabel: 'step [s]', yLabel: 'error in q(T) [rad or m]', ofError: true },
  { title: 'Energy error against step', detail: 'fixed steps', x: (row) => row.step_s, y: shownEnergy, xLabel: 'step [s]', yLabel: 'largest energy error [J]', ofError: false },
];

/** How each label is drawn, over all measurements: a colour an integrator, a shape an order, dashes for step control. */
function looksOf(measurements) {
  const looks = new Map();
  const integrators = [];
  const orders = new Map();
  const place = (list, value) => (list.includes(value) ? list.indexOf(value) : list.push(value) - 1);
  for (const row of measurements.flatMap((measurement) => measurement.rows)) {
    if (looks.has(row.label)) continue;
    if (!orders.has(row.integrator)) orders.set(row.integrator, []);
    looks.set(row.label, {
      shape: SHAPES[place(orders.get(row.integrator), row.order) % SHAPES.length],
      style: `--color: var(--series-${place(integrators, row.integrator) % 8})`,
      line: row.rtol === null ? 'line' : 'line dashed',
    });
  }
  return looks;
}

function hint(row) {
  const part = (value, text) => value !== null && text(value);
  return [
    [row.label, part(row.step_s, (v) => `step ${number(v, 6)} s`), part(row.rtol, (v) => `rtol ${v.toExponential(0)}`), part(row.tolerance, (v) => `tolerance ${v.toExponential(0)}`)],
    [part(row.error_bound, (v) => `error ${row.reference_limited ? `at most ${number(v, 2)}` : number(row.error_q, 2)}`), part(row.energy_error_max_J, (v) => `energy ${number(v, 2)} J`), part(row.cpu_us, (v) => `${number(v, 4)} µs`)],
  ].map((list) => list.filter(Boolean).join(', ')).filter(Boolean).join('; ');
}

/** The rows of one label that a plot can show, a line for each tolerance of root-finding. */
function linesOf(plot, rows, look) {
  const lines = new Map();
  for (const row of rows) {
    const [x, y] = [plot.x(row), plot.y(row)];
    if (x === null || y === null) continue;
    const kind = { ...look, class: plot.ofError && row.reference_limited ? 'open' : '' };
    lines.set(row.tolerance, [...(lines.get(row.tolerance) ?? []), { x, y, kind, hint: hint(row) }]);
  }
  return [...lines.values()];
}

function figure(plot, measurement, looks) {
  const series = [...looks].map(([name, look]) => ({ name, line: look.line, style: look.style, lines: linesOf(plot, measurement.rows.filter((row) => row.label === name), look) }));
  return logPlot({
    ...plot,
    label: `${plot.title} of ${measurement.name}; the tables below hold the same figures`,
    series: series.filter(({ lines }) => lines.length),
    floor: plot.ofError && measurement.reference_error !== null ? { y: Math.max(measurement.reference_error, LEAST_SHOWN), hint: 'the reference’s own error' } : null,
  });
}

/** Check boxes that hide and show the lines of a label in all plots. */
function legend(looks) {
  const show = (name, on) => {
    for (const group of document.querySelectorAll('g[data-series]')) {
      if (group.dataset.series === name) group.style.display = on ? '' : 'none';
    }
  };
  return h('div', { class: 'legend', role: 'group', 'aria-label': 'Integrators' }, [...looks].map(([name, look]) => {
    const box = check(name, true, (on) => show(name, on));
    box.lastChild.before(legendMark(look, look.line));
    return box;
  }));
}

function tableOf({ head, words, rows, comparisons_from: comparisons = -1 }, caption) {
  return table({ caption, shown: true, head, words, rows: rows.map((cells, i) => ({ cells, class: i === comparisons ? 'above' : null })) });
}

function measurementSection(measurement, looks, alone) {
  const figures = PLOTS.map((plot) => figure(plot, measurement, looks)).filter(Boolean);
  return section(measurement.name,
    h('p', {}, measurement.about), notes(measurement.notes),
    figures.length > 0 && h('div', { class: 'figure-row' }, figures),
    measurement.costs && tableOf(measurement.costs, 'CPU time of the cheapest row of each scheme whose error in q stays below'),
    measurement.cheaper_peers && h('p', {}, measurement.cheaper_peers),
    h('details', { open: alone }, h('summary', {}, 'All rows'), tableOf(measurement.table, `All rows of ${measurement.name}`)));
}

showDocument('hamelin.accuracy-page/1', ({ measurements }) => {
  const looks = looksOf(measurements);
  return {
    title: 'Speed against error',
    about: measurements.length === 1 ? 'one measurement' : `${measurements.length} measurements`,
    content: [
      h('p', {}, 'Each mark is one integration of a free motion. Left and below is better. A hollow mark is as near to the reference as the reference is to the truth (dotted line): its error may be smaller. Dashed lines: step control. A mark under the pointer tells its settings.'),
      legend(looks),
      measurements.map((measurement) => measurementSection(measurement, looks, measurements.length === 1)),
    ],
  };
});

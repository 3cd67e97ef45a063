// The page of `hamelin accuracy`: error against CPU time, error and energy error against the step,
// tables.
import { notes, section, showDocument } from './document.js';
import { checkbox, h } from './dom.js';
import { number } from './format.js';
import { legendMark, logPlot } from './logplot.js';
import { table } from './tables.js';

const SHAPES = ['circle', 'square', 'triangle', 'diamond', 'wedge'];
// Smaller errors are shown as this value: by rounding an error may be 0, which has no logarithm.
const SMALLEST_SHOWN = 1e-17;

const shownError = (row) => (row.error_q === null ? null : Math.max(row.reference_limited ? row.reference_error : row.error_q, SMALLEST_SHOWN));
const shownEnergy = (row) => (row.energy_error_max_J === null ? null : Math.max(row.energy_error_max_J, SMALLEST_SHOWN));

const PLOTS = [
  { title: 'Error against CPU time', x: (row) => row.cpu_us, y: shownError, xLabel: 'CPU time [µs]', yLabel: 'error in q(T) [rad or m]', ofError: true },
  { title: 'Error against step', detail: 'fixed steps', x: (row) => row.step_s, y: shownError, xLabel: 'step [s]', yLabel: 'error in q(T) [rad or m]', ofError: true },
  { title: 'Energy error against step', detail: 'fixed steps', x: (row) => row.step_s, y: shownEnergy, xLabel: 'step [s]', yLabel: 'largest energy error [J]', ofError: false },
];

/**
 * The style of each label in all measurements: one colour per integrator, one shape per order,
 * dashed lines for step control.
 */
function stylesOf(measurements) {
  const styles = new Map();
  const integrators = [];
  const orders = new Map();
  const indexIn = (list, value) => (list.includes(value) ? list.indexOf(value) : list.push(value) - 1);
  for (const row of measurements.flatMap((measurement) => measurement.rows)) {
    if (styles.has(row.label)) continue;
    if (!orders.has(row.integrator)) orders.set(row.integrator, []);
    styles.set(row.label, {
      shape: SHAPES[indexIn(orders.get(row.integrator), row.order) % SHAPES.length],
      style: `--color: var(--series-${indexIn(integrators, row.integrator) % 8})`,
      line: row.rtol === null ? 'line' : 'line dashed',
    });
  }
  return styles;
}

function hint(row) {
  const part = (value, text) => value !== null && text(value);
  return [
    [row.label, part(row.step_s, (v) => `step ${number(v, 6)} s`), part(row.rtol, (v) => `rtol ${v.toExponential(0)}`), part(row.tolerance, (v) => `tolerance ${v.toExponential(0)}`)],
    [part(row.error_bound, (v) => `error ${row.reference_limited ? `at most ${number(v, 2)}` : number(row.error_q, 2)}`), part(row.energy_error_max_J, (v) => `energy ${number(v, 2)} J`), part(row.cpu_us, (v) => `${number(v, 4)} µs`)],
  ].map((list) => list.filter(Boolean).join(', ')).filter(Boolean).join('; ');
}

/** The rows of one label that a plot can show, with one line per tolerance of the root-finding. */
function linesOf(plot, rows, markStyle) {
  const lines = new Map();
  for (const row of rows) {
    const [x, y] = [plot.x(row), plot.y(row)];
    if (x === null || y === null) continue;
    const kind = { ...markStyle, class: plot.ofError && row.reference_limited ? 'open' : '' };
    lines.set(row.tolerance, [...(lines.get(row.tolerance) ?? []), { x, y, kind, hint: hint(row) }]);
  }
  return [...lines.values()];
}

function figure(plot, measurement, styles) {
  const series = [...styles].map(([name, markStyle]) => ({ name, line: markStyle.line, style: markStyle.style, lines: linesOf(plot, measurement.rows.filter((row) => row.label === name), markStyle) }));
  return logPlot({
    ...plot,
    label: `${plot.title} of ${measurement.name}; the tables below hold the same figures`,
    series: series.filter(({ lines }) => lines.length),
    floor: plot.ofError && measurement.reference_error !== null ? { y: Math.max(measurement.reference_error, SMALLEST_SHOWN), hint: 'error of the reference itself' } : null,
  });
}

/** Checkboxes that show and hide the lines of a label in all plots. */
function legend(styles) {
  const show = (name, on) => {
    for (const group of document.querySelectorAll('g[data-series]')) {
      if (group.dataset.series === name) group.style.display = on ? '' : 'none';
    }
  };
  return h('div', { class: 'legend', role: 'group', 'aria-label': 'Integrators' }, [...styles].map(([name, markStyle]) => {
    const box = checkbox(name, true, (on) => show(name, on));
    box.lastChild.before(legendMark(markStyle, markStyle.line));
    return box;
  }));
}

function tableOf({ head, words, rows, comparisons_from: comparisons = -1 }, caption) {
  return table({ caption, shown: true, head, words, rows: rows.map((cells, i) => ({ cells, class: i === comparisons ? 'above' : null })) });
}

function measurementSection(measurement, styles, alone) {
  const figures = PLOTS.map((plot) => figure(plot, measurement, styles)).filter(Boolean);
  return section(measurement.name,
    h('p', {}, measurement.about), notes(measurement.notes),
    figures.length > 0 && h('div', { class: 'figure-row' }, figures),
    measurement.costs && tableOf(measurement.costs, 'CPU time of the cheapest row of each scheme whose error in q stays below'),
    measurement.cheaper_peers && h('p', {}, measurement.cheaper_peers),
    h('details', { open: alone }, h('summary', {}, 'All rows'), tableOf(measurement.table, `All rows of ${measurement.name}`)));
}

showDocument('hamelin.accuracy-page/1', ({ measurements }) => {
  const styles = stylesOf(measurements);
  return {
    title: 'Speed against error',
    about: measurements.length === 1 ? 'one measurement' : `${measurements.length} measurements`,
    content: [
      h('p', {}, 'Each mark is one integration of a free motion. Marks at the lower left are better. A hollow mark is as close to the reference as the reference is to the exact solution (dotted line); its true error may be smaller. Dashed lines mean step control. Point at a mark to see its settings.'),
      legend(styles),
      measurements.map((measurement) => measurementSection(measurement, styles, measurements.length === 1)),
    ],
  };
});

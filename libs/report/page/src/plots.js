// Plots: one row per quantity, one column per run, with a common time axis.
import uPlot from 'uplot';
import { runColor, seriesColor, theme } from './colors.js';
import { indexAt, valueAt } from './data.js';
import { checkbox, h } from './dom.js';
import { number, ticks, unitText } from './format.js';

const HEIGHT = 168;
const AXIS = 68;
const FONT = '11px system-ui, sans-serif';
const LOGARITHMIC = new Set(['energy_error', 'solver', 'residual', 'tick_us']);

// Steps between labels. On a log scale there are no steps of thirds, which prefers whole decades.
const STEPS = Array.from({ length: 60 }, (_, i) => i - 30).flatMap((power) => [1, 2, 5].map((m) => Number(`${m}e${power}`)));
const DECADES = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20];

/** Values for uPlot: null for a gap; on a log scale the logarithm of the magnitude. */
function column(y, log) {
  return Array.from(y, (v) => (Number.isFinite(v) ? (log ? (v === 0 ? null : Math.log10(Math.abs(v))) : v) : null));
}

/** Smallest and largest value of the columns within [from, to]. */
function extent(t, columns, from, to) {
  let lo = Infinity;
  let hi = -Infinity;
  if (!t.length) return [lo, hi];
  const first = indexAt(t, from);
  const last = Math.min(t.length - 1, indexAt(t, to) + 1);
  for (const y of columns) {
    for (let k = first; k <= last; ++k) {
      if (y[k] === null) continue;
      if (y[k] < lo) lo = y[k];
      if (y[k] > hi) hi = y[k];
    }
  }
  return [lo, hi];
}

/**
 * The plots of one quantity for all runs. They share the y scale, the hidden series and the log
 * switch.
 */
class Group {
  constructor(board, { id, title, unit, cells, overlay = false }) {
    Object.assign(this, { board, id, title, unit: unitText(unit), overlay });
    this.log = false;
    this.hidden = new Set();
    this.cells = cells.filter(Boolean);
    /** Names of all lines in the row; a name has the same colour in every run. */
    this.labels = [...new Set(this.cells.flatMap((cell) => cell.series.map((s) => s.label)))];
    this.plots = [];
    const logBox = LOGARITHMIC.has(id) && checkbox('log scale', false, (on) => this.setLog(on));
    this.element = h('details', { class: 'plot-row', open: true },
      h('summary', {}, h('span', { class: 'plot-title' }, title), ' ', h('span', { class: 'unit' }, this.unit && `[${this.unit}]`)),
      logBox && h('div', { class: 'plot-tools' }, logBox),
      h('div', { class: 'plot-cells' }, cells.map((cell) => {
        if (!cell) return h('div', { class: 'plot-cell' }, h('p', { class: 'quiet' }, 'not in this log'));
        cell.host = h('div', { class: 'plot-host' });
        cell.legend = this.legend(cell);
        return h('div', { class: 'plot-cell' }, cell.host, cell.legend);
      })),
    );
    this.element.dataset.plot = overlay ? `overlay-${id}` : id;
  }

  legend(cell) {
    const box = h('div', { class: 'legend', role: 'group', 'aria-label': `${this.title}: lines` });
    cell.items = cell.series.map((s) => {
      const value = h('span', { class: 'value' }, '–');
      const button = h('button', { type: 'button', 'aria-pressed': 'true', title: `Show or hide ${s.label}`, onclick: () => this.toggle(s.label) },
        h('span', { class: 'key' }), h('span', { class: 'label' }, s.label), value);
      box.append(button);
      return { button, value };
    });
    return box;
  }

  toggle(label) {
    if (!this.hidden.delete(label)) this.hidden.add(label);
    for (const cell of this.cells) {
      cell.series.forEach((s, i) => {
        if (s.label !== label) return;
        const on = !this.hidden.has(label);
        cell.items[i].button.setAttribute('aria-pressed', String(on));
        cell.plot.setSeries(i + 1, { show: on });
      });
    }
    this.rescale();
  }

  setLog(on) {
    this.log = on;
    for (const cell of this.cells) cell.plot.setData(this.data(cell), false);
    this.rescale();
  }

  data(cell) {
    cell.columns = cell.series.map((s) => column(s.y, this.log));
    return [Array.from(cell.t), ...cell.columns];
  }

  /** Computes the y range of each plot over what is shown now: one for the row, or one per run. */
  computeRanges() {
    if (this.board.shared) this.computeSharedRange(this.cells);
    else for (const cell of this.cells) this.computeSharedRange([cell]);
  }

  computeSharedRange(cells) {
    const [from, to] = this.board.zoom;
    let lo = Infinity;
    let hi = -Infinity;
    for (const cell of cells) {
      const shown = cell.columns.filter((_, i) => !this.hidden.has(cell.series[i].label));
      const [a, b] = extent(cell.t, shown, from, to);
      lo = Math.min(lo, a);
      hi = Math.max(hi, b);
    }
    if (!(lo <= hi)) [lo, hi] = [0, 1];
    // The range includes a mark if its distance from the lines is at most their height.
    const height = hi - lo;
    for (const mark of cells.flatMap((cell) => cell.marks)) {
      const y = this.log ? Math.log10(Math.abs(mark.y)) : mark.y;
      if (Number.isFinite(y) && y > lo - height && y < hi + height) {
        lo = Math.min(lo, y);
        hi = Math.max(hi, y);
      }
    }
    if (hi - lo <= 1e-12 * Math.max(Math.abs(lo), Math.abs(hi))) {
      const pad = this.log ? 0.5 : hi === 0 ? 1 : 0.1 * Math.abs(hi);
      [lo, hi] = [lo - pad, hi + pad];
    }
    const pad = 0.06 * (hi - lo);
    for (const cell of cells) cell.range = [lo - pad, hi + pad];
  }

  rescale() {
    this.computeRanges();
    for (const { plot, range } of this.cells) {
      plot.batch(() => {
        plot.setScale('x', { min: this.board.zoom[0], max: this.board.zoom[1] });
        plot.setScale('y', { min: range[0], max: range[1] });
      });
    }
  }

  build() {
    for (const cell of this.cells) cell.data = this.data(cell);
    this.computeRanges();
    for (const cell of this.cells) {
      cell.plot = this.createPlot(cell);
      cell.now = h('div', { class: 'now' });
      cell.plot.over.append(cell.now);
    }
    this.paint();
  }

  paint() {
    for (const cell of this.cells) {
      cell.items.forEach(({ button }, i) => button.style.setProperty('--key', this.color(cell, i)));
      cell.plot?.redraw(false);
    }
  }

  color(cell, i) {
    if (this.overlay) return runColor(cell.series[i].color);
    return this.labels.length === 1 ? runColor(cell.run) : seriesColor(this.labels.indexOf(cell.series[i].label));
  }

  createPlot(cell) {
    const { board } = this;
    const axis = { stroke: () => theme().axis, font: FONT, grid: { stroke: () => theme().grid, width: 1 }, ticks: { stroke: () => theme().grid, width: 1, size: 4 }, gap: 4 };
    const options = {
      width: Math.max(120, cell.host.clientWidth),
      height: HEIGHT,
      padding: [8, 10, 0, 0],
      legend: { show: false },
      pxAlign: 0,
      cursor: {
        y: false,
        points: { size: 6 },
        drag: { x: true, y: false, setScale: false, dist: 4 },
        sync: { key: 'hamelin', scales: ['x', null], setSeries: false, filters: { pub: (type) => type === 'mousemove' || type === 'mouseleave' } },
        bind: {
          mousedown: (u, target, handler) => (event) => (board.startsScrub(u, event) ? null : handler(event)),
          dblclick: () => () => board.resetZoom(),
        },
      },
      scales: { x: { time: false, range: () => board.zoom }, y: { range: () => cell.range } },
      axes: [
        { ...axis, size: 26, space: 64, values: (u, splits, _, __, step) => ticks(splits, step, 1).map((text, i) => (i === 0 ? `${text} s` : text)) },
        {
          ...axis, size: AXIS, space: 25,
          incrs: () => (this.log ? DECADES : STEPS),
          values: (u, splits, _, __, step) => {
            if (!this.log) return ticks(splits, step);
            return splits.map((v) => (Math.abs(v - Math.round(v)) < 1e-9 ? `1e${String(Math.round(v)).replace('-', '\u2212')}` : number(10 ** v, 3)));
          },
        },
      ],
      series: [{}, ...cell.series.map((_, i) => ({ stroke: () => this.color(cell, i), width: 1.4, points: { show: false }, dash: this.labels.indexOf(cell.series[i].label) > 7 && !this.overlay ? [5, 3] : undefined }))],
      hooks: {
        draw: [(u) => this.drawMarks(u, cell)],
        setSelect: [(u) => {
          if (u.select.width < 4) return;
          board.setZoom(u.posToVal(u.select.left, 'x'), u.posToVal(u.select.left + u.select.width, 'x'));
          u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
        }],
        setCursor: [(u) => board.hover(u.cursor.left >= 0 ? u.posToVal(u.cursor.left, 'x') : null)],
      },
    };
    const plot = new uPlot(options, cell.data, cell.host);
    board.addPointerHandlers(plot);
    return plot;
  }

  /**
   * Draws dashed level lines with their labels; labels that would overlap are placed side by side.
   */
  drawMarks(u, cell) {
    const { ctx } = u;
    const px = devicePixelRatio;
    const { left, width, top } = u.bbox;
    const taken = [];
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = theme().mark;
    ctx.lineWidth = px;
    ctx.font = `${11 * px}px system-ui, sans-serif`;
    ctx.textAlign = 'right';
    for (const mark of cell.marks) {
      const level = this.log ? Math.log10(Math.abs(mark.y)) : mark.y;
      if (!(level >= cell.range[0] && level <= cell.range[1])) continue;
      const y = u.valToPos(level, 'y', true);
      ctx.setLineDash([5 * px, 4 * px]);
      ctx.beginPath();
      ctx.moveTo(left, y);
      ctx.lineTo(left + width, y);
      ctx.stroke();
      const text = `${mark.label} ${number(mark.y, 4).replace(/(\.\d*?)0+$/, '$1').replace(/\.$/, '')}`;
      const baseline = y + (y - top < 16 * px ? 13 : -4) * px;
      let right = left + width - 4 * px;
      for (const other of taken) if (Math.abs(other.baseline - baseline) < 13 * px) right = Math.min(right, other.left - 12 * px);
      const start = right - ctx.measureText(text).width;
      // If many marks are close together, only the first ones have labels.
      if (start < left + 0.5 * width) continue;
      taken.push({ baseline, left: start });
      ctx.fillText(text, right, baseline);
    }
    ctx.restore();
  }

  /** Shows the line of the current time, and the values at time `at`. */
  showTime(now, at) {
    for (const cell of this.cells) {
      const x = cell.plot.valToPos(now, 'x');
      cell.now.style.transform = `translateX(${x}px)`;
      cell.now.style.visibility = x < 0 || x > cell.plot.bbox.width / devicePixelRatio + 0.5 ? 'hidden' : 'visible';
    }
    this.showValues(at);
  }

  showValues(at) {
    for (const cell of this.cells) {
      cell.series.forEach((s, i) => {
        const text = number(valueAt(cell.t, s.y, Math.min(at, cell.t[cell.t.length - 1] ?? at)), 4);
        if (cell.items[i].value.textContent !== text) cell.items[i].value.textContent = text;
      });
    }
  }
}

export class Board {
  /**
   * @param {object[]} runs
   * @param {number} duration of the longest run [s]
   * @param {(t: number) => void} setTime
   */
  constructor(runs, duration, setTime) {
    this.full = [0, duration > 0 ? duration : 1];
    this.zoom = [...this.full];
    this.shared = true;
    this.setTime = setTime;
    this.now = 0;
    this.hovered = null;
    const ids = [...new Set(runs.flatMap((run) => run.plots.map((plot) => plot.id)))];
    this.groups = ids.map((id) => {
      const plots = runs.map((run) => run.plots.find((plot) => plot.id === id));
      const known = plots.find(Boolean);
      return new Group(this, {
        id, title: known.title, unit: known.unit,
        cells: plots.map((plot, i) => plot && { run: i, t: plot.t, series: plot.series, marks: plot.marks ?? [] }),
      });
    });
    this.overlays = runs.length < 2 ? [] : ['clearance', 'goal'].flatMap((id) => this.overlay(runs, id));
    this.resetButton = h('button', { type: 'button', class: 'reset-zoom', disabled: true, onclick: () => this.resetZoom() }, 'Reset zoom');
    this.sharedScale = runs.length > 1 && checkbox('same scale for all runs', true, (on) => {
      this.shared = on;
      for (const group of this.all) group.rescale();
    });
    this.all = [...this.overlays, ...this.groups];
  }

  /** One plot with the first line of a quantity for all runs, on the union of their times. */
  overlay(runs, id) {
    const plots = runs.map((run, i) => ({ i, name: run.name, plot: run.plots.find((plot) => plot.id === id) })).filter(({ plot }) => plot?.series.length);
    if (plots.length < 2) return [];
    const t = Float64Array.from([...new Set(plots.flatMap(({ plot }) => [...plot.t]))].sort((a, b) => a - b));
    const first = plots[0].plot;
    const marks = new Map(plots.flatMap(({ plot }) => plot.marks ?? []).map((mark) => [`${mark.label} ${mark.y}`, mark]));
    const series = plots.map(({ i, name, plot }) => ({ label: name, color: i, y: Float64Array.from(t, (x) => valueAt(plot.t, plot.series[0].y, x)) }));
    return [new Group(this, { id, title: `${first.title}, all runs`, unit: first.unit, overlay: true, cells: [{ run: 0, t, series, marks: [...marks.values()] }] })];
  }

  /** Draws the plots, whose elements must be in the page. */
  build() {
    for (const group of this.all) group.build();
    const sizes = new ResizeObserver((entries) => {
      for (const entry of entries) {
        const cell = this.cellOf.get(entry.target);
        const width = Math.floor(entry.contentRect.width);
        if (width > 40 && width !== cell.plot.width) cell.plot.setSize({ width, height: HEIGHT });
      }
      this.showTime(this.now);
    });
    this.cellOf = new Map(this.all.flatMap((group) => group.cells.map((cell) => [cell.host, cell])));
    for (const host of this.cellOf.keys()) sizes.observe(host);
  }

  /** Clicks set the time; dragging the time line, or dragging with Shift, moves the time. */
  addPointerHandlers(plot) {
    const over = plot.over;
    let start = null;
    const timeAt = (event) => plot.posToVal(event.clientX - over.getBoundingClientRect().left, 'x');
    over.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      start = { x: event.clientX, scrub: this.startsScrub(plot, event) };
      if (start.scrub) over.setPointerCapture(event.pointerId);
    });
    over.addEventListener('pointermove', (event) => {
      if (start?.scrub) this.setTime(timeAt(event));
      else if (!start) over.style.cursor = this.startsScrub(plot, event) ? 'ew-resize' : 'crosshair';
    });
    over.addEventListener('pointerup', (event) => {
      if (start && (start.scrub || Math.abs(event.clientX - start.x) < 4)) this.setTime(timeAt(event));
      start = null;
    });
    over.addEventListener('pointercancel', () => { start = null; });
  }

  startsScrub(plot, event) {
    return event.shiftKey || Math.abs(event.clientX - plot.over.getBoundingClientRect().left - plot.valToPos(this.now, 'x')) < 5;
  }

  setZoom(from, to) {
    const least = 1e-5 * (this.full[1] - this.full[0]);
    if (!(to - from > least)) return;
    this.zoom = [Math.max(from, this.full[0]), Math.min(to, this.full[1])];
    this.resetButton.disabled = this.zoom[0] === this.full[0] && this.zoom[1] === this.full[1];
    for (const group of this.all) group.rescale();
    this.showTime(this.now);
  }

  resetZoom() {
    this.setZoom(...this.full);
  }

  showTime(now) {
    this.now = now;
    for (const group of this.all) if (group.element.open) group.showTime(now, this.hovered ?? now);
  }

  hover(at) {
    if (at === this.hovered) return;
    this.hovered = at;
    // The plot under the pointer moves the cursors of all plots; their values are updated once per
    // frame.
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      for (const group of this.all) if (group.element.open) group.showValues(this.hovered ?? this.now);
    });
  }

  paint() {
    for (const group of this.all) group.paint();
  }
}

// Small drawings for the cells of a table, all on one axis: intervals and distributions.
import { h, svg } from './dom.js';
import { number } from './format.js';

const PAD = 8;

/** Round numbers have few digits: 12.5, not 13 or 12.50000001. */
const tickText = (value) => String(Number(value.toPrecision(6))).replace('-', '\u2212');

/** A linear axis for drawings of a given width. */
export class RowAxis {
  constructor(low, high, width = 220) {
    this.low = low;
    this.high = high > low ? high : low + (Math.abs(low) || 1);
    this.width = width;
  }

  /** An axis that holds all distributions between their smallest and largest value. */
  static of(distributions, width) {
    const known = distributions.filter(Boolean);
    return known.length ? new RowAxis(Math.min(...known.map((d) => d.min)), Math.max(...known.map((d) => d.max)), width) : null;
  }

  at(value) {
    return PAD + ((value - this.low) / (this.high - this.low)) * (this.width - 2 * PAD);
  }

  px(value) {
    return this.at(value).toFixed(1);
  }

  /** Three to six round numbers on the axis. */
  ticks() {
    const rough = (this.high - this.low) / 4;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 2.5, 5, 10].find((digit) => digit * power >= rough);
    const ticks = [];
    for (let n = Math.ceil(this.low / step - 1e-9); n * step <= this.high + 1e-9 * step; ++n) ticks.push(n * step);
    return ticks;
  }

  grid(height) {
    return this.ticks().map((tick) => svg('path', { class: 'axis', d: `M${this.px(tick)} 0V${height}` }));
  }

  /** The head of a column: the numbers of the axis. */
  head(scale = 1) {
    return svg('svg', { width: this.width, height: 16, role: 'img', 'aria-label': `axis from ${number(scale * this.low, 3)} to ${number(scale * this.high, 3)}` }, this.ticks().map((tick) => {
      const anchor = this.at(tick) < 20 ? 'start' : this.at(tick) > this.width - 20 ? 'end' : 'middle';
      const x = anchor === 'start' ? Math.max(0, this.at(tick) - 4) : anchor === 'end' ? Math.min(this.width, this.at(tick) + 8) : this.at(tick);
      return svg('text', { class: 'tick', x: x.toFixed(1), y: 12, 'text-anchor': anchor }, tickText(scale * tick));
    }));
  }
}

/** A value with its interval: a dot on a line. `zero`: draws a line at 0. */
export function intervalRow(axis, value, [low, high], label, { zero = false, kind = '' } = {}) {
  const height = 20;
  const [from, to] = [low, high].map((end) => axis.px(Math.min(axis.high, Math.max(axis.low, end))));
  return svg('svg', { class: `row-plot ${kind}`.trim(), width: axis.width, height, role: 'img', 'aria-label': label }, axis.grid(height),
    zero && svg('path', { class: 'zero', d: `M${axis.px(0)} 0V${height}` }),
    svg('path', { class: 'whisker', d: `M${from} 10H${to}M${from} 6v8M${to} 6v8` }),
    svg('circle', { class: 'dot-mark', cx: axis.px(value), cy: 10, r: 4.5 }));
}

const STRIP_MOST = 150;

/** A box plot over a strip of the values; of many values, evenly spaced ranks. */
export function boxRow(axis, d, label) {
  const height = 30;
  if (!d) return '';
  const n = Math.min(d.n, STRIP_MOST);
  const values = Array.from({ length: n }, (_, k) => d.sorted[n === 1 ? 0 : Math.round((k * (d.n - 1)) / (n - 1))]);
  const strip = values.map((value, k) => `M${axis.px(value)} ${20 + ((k * 7) % 5) * 1.8}h0`).join('');
  return svg('svg', { class: 'row-plot', width: axis.width, height, role: 'img', 'aria-label': label }, axis.grid(height),
    svg('path', { class: 'strip', d: strip }),
    svg('path', { class: 'whisker', d: `M${axis.px(d.low)} 9H${axis.px(d.q1)}M${axis.px(d.q3)} 9H${axis.px(d.high)}M${axis.px(d.low)} 6v6M${axis.px(d.high)} 6v6` }),
    svg('rect', { class: 'box', x: axis.px(d.q1), y: 3, width: Math.max(1, axis.at(d.q3) - axis.at(d.q1)).toFixed(1), height: 12, rx: 1.5 }),
    svg('path', { class: 'median', d: `M${axis.px(d.median)} 2v14` }));
}

/** A select with a label; `pick` is called with the key of the new option. */
export function select(label, options, value, pick) {
  const element = h('select', { onchange: () => pick(element.value) }, options.map(([key, text]) => h('option', { value: key, selected: key === value }, text)));
  const box = h('label', { class: 'pick' }, h('span', {}, label), element);
  box.set = (key) => { element.value = key; };
  return box;
}

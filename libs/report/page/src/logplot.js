// Plots with two axes, logarithmic or linear: marks of several shapes, and lines between them.
import { h, svg } from './dom.js';
import { number } from './format.js';

const MARGIN = { left: 72, right: 14, top: 12, bottom: 42 };
const PADDING = 10;

/** A logarithmic axis that begins and ends at multiples of half a decade. */
class LogAxis {
  /**
   * @param {number[]} values positive, at least one
   * @param {number} from, to pixel coordinates of the ends
   */
  constructor(values, from, to) {
    this.low = Math.floor(2 * Math.log10(Math.min(...values))) / 2;
    this.high = Math.max(this.low + 0.5, Math.ceil(2 * Math.log10(Math.max(...values))) / 2);
    Object.assign(this, { from, to });
  }

  at(value) {
    return this.from + ((Math.log10(value) - this.low) / (this.high - this.low)) * (this.to - this.from);
  }

  /**
   * About `most` ticks: 1, 2 and 5 of each decade, or 1 of each decade, or 1 of every n-th decade.
   */
  ticks(most) {
    const decades = this.high - this.low;
    const digits = 3 * decades <= most ? [1, 2, 5] : [1];
    const apart = 3 * decades <= most ? 1 : Math.ceil(decades / most);
    const all = [];
    for (let decade = Math.floor(this.low); decade <= Math.floor(this.high); ++decade) {
      if (decade % apart !== 0) continue;
      for (const digit of digits) {
        const exponent = decade + Math.log10(digit);
        if (exponent >= this.low - 1e-9 && exponent <= this.high + 1e-9) all.push(Number(`${digit}e${decade}`));
      }
    }
    return all;
  }
}

/** A linear axis with some room at its ends. */
class LinearAxis {
  constructor(values, from, to) {
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const room = 0.04 * (high - low || Math.abs(low) || 1);
    Object.assign(this, { low: low - room, high: high + room, from, to });
  }

  at(value) {
    return this.from + ((value - this.low) / (this.high - this.low)) * (this.to - this.from);
  }

  /** Round numbers, about `most`. */
  ticks(most) {
    const rough = (this.high - this.low) / most;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((digit) => digit * power >= rough);
    const all = [];
    for (let n = Math.ceil(this.low / step); n * step <= this.high; ++n) all.push(Number((n * step).toPrecision(6)));
    return all;
  }
}

/** Values of one sign that cover more than a factor of this get a logarithmic axis. */
const WIDE = 20;
const isWide = (values) => Math.min(...values) > 0 && Math.max(...values) > WIDE * Math.min(...values);

/** 1e−4 rather than 0.0001, which would overlap the label of the axis. */
const tickText = (value) => (value !== 0 && (Math.abs(value) < 0.0099 || Math.abs(value) > 99999) ? number(value, 1) : String(value).replace('-', '\u2212'));

const polygon = (x, y, points) => `M${points.map(([dx, dy]) => `${(x + dx).toFixed(1)} ${(y + dy).toFixed(1)}`).join('L')}Z`;

/** Shapes of marks by name, centred at a point. */
const SHAPES = {
  circle: (x, y) => svg('circle', { cx: x.toFixed(1), cy: y.toFixed(1), r: 4 }),
  square: (x, y) => svg('path', { d: polygon(x, y, [[-3.5, -3.5], [3.5, -3.5], [3.5, 3.5], [-3.5, 3.5]]) }),
  triangle: (x, y) => svg('path', { d: polygon(x, y, [[0, -5], [4.5, 3], [-4.5, 3]]) }),
  diamond: (x, y) => svg('path', { d: polygon(x, y, [[0, -5], [5, 0], [0, 5], [-5, 0]]) }),
  wedge: (x, y) => svg('path', { d: polygon(x, y, [[0, 5], [4.5, -3], [-4.5, -3]]) }),
  cross: (x, y) => svg('path', { d: `M${(x - 3.5).toFixed(1)} ${(y - 3.5).toFixed(1)}l7 7m0 -7l-7 7` }),
};

/** The SVG element of a mark. @param {{shape: string, class?: string, style?: string}} kind */
export function mark(kind, x, y) {
  const shape = SHAPES[kind.shape](x, y);
  shape.setAttribute('class', `mark ${kind.class ?? ''}`.trim());
  if (kind.style) shape.setAttribute('style', kind.style);
  return shape;
}

/** A mark for a legend, on a piece of its line if it has one. */
export function legendMark(kind, line = null) {
  return svg('svg', { width: line ? 34 : 16, height: 14, 'aria-hidden': 'true' },
    line && svg('path', { class: line, d: 'M1 7H33', style: kind.style }), mark(kind, line ? 17 : 8, 7));
}

function axes(x, y, { width, height, xLabel, yLabel }) {
  const [left, right, top, bottom] = [MARGIN.left, width - MARGIN.right, MARGIN.top, height - MARGIN.bottom];
  return [
    svg('path', { class: 'axis', d: `M${left} ${top}H${right}V${bottom}H${left}Z` }),
    x.ticks(8).map((tick) => {
      const at = x.at(tick).toFixed(1);
      return [svg('path', { class: 'axis', d: `M${at} ${top}V${bottom}` }), svg('text', { x: at, y: bottom + 17, 'text-anchor': 'middle' }, tickText(tick))];
    }),
    y.ticks(8).map((tick) => {
      const at = y.at(tick);
      return [svg('path', { class: 'axis', d: `M${left} ${at.toFixed(1)}H${right}` }), svg('text', { x: left - 7, y: (at + 4).toFixed(1), 'text-anchor': 'end' }, tickText(tick))];
    }),
    svg('text', { x: (left + right) / 2, y: bottom + 36, 'text-anchor': 'middle' }, xLabel),
    svg('text', { transform: `translate(14 ${(top + bottom) / 2}) rotate(-90)`, 'text-anchor': 'middle' }, yLabel),
  ];
}

/** As logPlot, with linear axes for values that are not positive or cover little. */
export function axisPlot(plot) {
  const points = plot.series.flatMap((series) => series.lines.flat());
  const axis = (key) => (isWide(points.map((point) => point[key])) ? LogAxis : LinearAxis);
  return points.length ? logPlot({ ...plot, axes: { x: axis('x'), y: axis('y') } }) : null;
}

/**
 * A figure of points on two logarithmic axes, or on `axes`.
 * @typedef {{x: number, y: number, hint: string, kind: object}} Point
 * @typedef {{name: string, line?: string, style?: string, lines: Point[][]}} Series
 * @param {{title: string, detail?: string, label: string, xLabel: string, yLabel: string,
 *   width?: number, height?: number, floor?: {y: number, hint: string}, series: Series[]}} plot
 *   `line` is the class of the lines that connect the points of each list; without it there are
 *   only marks
 * @returns {HTMLElement | null} null if there are no points
 */
export function logPlot(plot) {
  const { width = 448, height = 372, floor, axes: { x: XAxis, y: YAxis } = { x: LogAxis, y: LogAxis } } = plot;
  const points = plot.series.flatMap((series) => series.lines.flat());
  if (!points.length) return null;
  const x = new XAxis(points.map((point) => point.x), MARGIN.left + PADDING, width - MARGIN.right - PADDING);
  const y = new YAxis(points.map((point) => point.y), height - MARGIN.bottom - PADDING, MARGIN.top + PADDING);
  const drawing = svg('svg', { viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': plot.label },
    axes(x, y, { width, height, ...plot }));
  const floorAt = floor && y.at(floor.y);
  if (floorAt > MARGIN.top && floorAt < height - MARGIN.bottom) {
    drawing.append(svg('path', { class: 'floor', d: `M${MARGIN.left} ${floorAt.toFixed(1)}H${width - MARGIN.right}` }, svg('title', {}, floor.hint)));
  }
  for (const series of plot.series) {
    const group = svg('g', { 'data-series': series.name });
    if (series.line) {
      for (const line of series.lines) {
        group.append(svg('path', { class: series.line, style: series.style, d: `M${line.map((p) => `${x.at(p.x).toFixed(1)} ${y.at(p.y).toFixed(1)}`).join('L')}` }));
      }
    }
    for (const p of series.lines.flat()) group.append(svg('g', {}, svg('title', {}, p.hint), mark(p.kind, x.at(p.x), y.at(p.y))));
    drawing.append(group);
  }
  return h('figure', {}, h('figcaption', {}, plot.title, ' ', plot.detail && h('span', {}, plot.detail)), drawing);
}

// The table of all runs: filters, order, pages, and CSV of what is shown.
import { section } from './document.js';
import { h } from './dom.js';
import { fixed } from './format.js';
import { commandBox, replayLink } from './failures.js';
import { select } from './rows.js';
import { naturally } from './runs.js';
import { badge } from './summary.js';

const PAGE = 50;
const TYPING_MS = 150;

/** A field of CSV (RFC 4180). */
const field = (value) => {
  const text = value === null || value === undefined ? '' : String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
};

/** Runs as CSV with the columns of `hamelin sweep merge --csv`; numbers have six digits. */
export function csvOf(runs, members) {
  const named = (columns) => [...columns].sort(([a], [b]) => (a < b ? -1 : 1));
  const labels = named(runs.labels).filter(([name]) => name !== 'sweep');
  const columns = [
    ['id', (i) => runs.ids[i]], ['directory', (i) => runs.text('directory', i)], ...labels.map(([name, column]) => [name, (i) => column.at(i)]),
    ...named(runs.varied).map(([name, column]) => [name, (i) => column.at(i)]), ...named(runs.gains).map(([name, column]) => [name, (i) => column[i]]),
    ['feasible', (i) => Boolean(runs.feasible[i])], ...['reason', 'outcome', 'failure', 'cause'].map((name) => [name, (i) => runs.text(name, i)]),
    ...['time_s', 'clearance_m', 'self_clearance_m', 'certified_share', 'tick_us_p50', 'tick_us_p99'].map((name) => [name, (i) => runs.figures[name][i]]), ['judge', (i) => runs.text('contact', i)],
  ];
  const lines = [columns.map(([name]) => field(name)).join(',')];
  for (const i of members) lines.push(columns.map(([, of]) => field(of(i))).join(','));
  return `${lines.join('\n')}\n`;
}

function save(text, name) {
  const link = h('a', { href: URL.createObjectURL(new Blob([text], { type: 'text/csv' })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

export class RunTable {
  constructor(runs) {
    this.runs = runs;
    this.filters = { text: '', outcome: '', failure: '', planner: '', feasible: '' };
    this.order = { column: 0, down: false };
    this.from = 0;
    this.columns = [
      { name: 'run', text: true, of: (i) => runs.ids[i] },
      { name: 'outcome', text: true, of: (i) => runs.text('outcome', i) || 'not run', cell: (i) => (runs.text('outcome', i) ? badge(runs.text('outcome', i)) : 'not run') },
      { name: 'feasible', text: true, of: (i) => (runs.feasible[i] ? 'yes' : 'no'), cell: (i) => (runs.feasible[i] ? 'yes' : h('span', { title: runs.text('reason', i) }, 'no')) },
      ...[['time [s]', 'time_s', 1, 3], ['clearance [mm]', 'clearance_m', 1e3, 2], ['self [mm]', 'self_clearance_m', 1e3, 2], ['certified [%]', 'certified_share', 100, 2], ['tick p50 [µs]', 'tick_us_p50', 1, 1], ['p99', 'tick_us_p99', 1, 1]]
        .map(([name, key, scale, decimals]) => ({ name, of: (i) => runs.figures[key][i], cell: (i) => fixed(runs.figures[key][i] === null ? null : scale * runs.figures[key][i], decimals) })),
      { name: 'cause', text: true, class: 'cause', of: (i) => [runs.text('cause', i), runs.text('contact', i), runs.feasible[i] ? '' : `not feasible (${runs.text('reason', i)})`].filter(Boolean).join('; ') },
      { name: 'repeat', text: true, fixed: true, of: () => '', cell: (i) => [replayLink(runs, i), this.commandOf(i)] },
    ];
    this.build();
    this.update();
  }

  /** The command of a run, drawn when it is opened. */
  commandOf(i) {
    const details = h('details', { class: 'in-cell' }, h('summary', {}, 'command'));
    details.addEventListener('toggle', () => details.append(commandBox(this.runs.command(i))), { once: true });
    return details;
  }

  build() {
    const choice = (label, key, values) => {
      const box = select(label, [['', 'all'], ...values.map((value) => [value, value.length > 70 ? `${value.slice(0, 70)}…` : value])], '', (value) => this.filter({ [key]: value }));
      this.boxes[key] = box;
      return box;
    };
    this.boxes = {};
    let typing = 0;
    this.search = h('input', {
      type: 'search', 'aria-label': 'Search id and cause', placeholder: 'id or cause',
      oninput: () => {
        clearTimeout(typing);
        typing = setTimeout(() => this.filter({ text: this.search.value }), TYPING_MS);
      },
    });
    const values = (column) => (column ? [...column.values].sort(naturally) : []);
    this.count = h('output', { role: 'status' });
    this.back = h('button', { type: 'button', onclick: () => this.turn(-PAGE) }, 'Previous');
    this.next = h('button', { type: 'button', onclick: () => this.turn(PAGE) }, 'Next');
    this.heads = this.columns.map((column, c) => h('th', { scope: 'col', class: column.text ? 'text' : null },
      column.fixed ? column.name : h('button', { type: 'button', class: 'sort', onclick: () => this.sort(c) }, column.name)));
    this.body = h('tbody', {});
    this.element = section('All runs',
      h('div', { class: 'controls' },
        h('label', { class: 'pick' }, h('span', {}, 'Search'), this.search), choice('Outcome', 'outcome', values(this.runs.texts.get('outcome'))), choice('Planner', 'planner', values(this.runs.labels.get('planner'))),
        choice('Failure', 'failure', values(this.runs.texts.get('failure'))), choice('Feasible', 'feasible', ['yes', 'no']),
        h('button', { type: 'button', onclick: () => this.filter({ text: '', outcome: '', failure: '', planner: '', feasible: '' }) }, 'Show all'),
        h('button', { type: 'button', onclick: () => save(csvOf(this.runs, this.shown), 'runs.csv') }, 'Save as CSV')),
      h('div', { class: 'controls' }, this.back, this.next, this.count),
      h('div', { class: 'table-box', tabIndex: 0, role: 'region', 'aria-label': 'Runs' }, h('table', { class: 'figures runs' }, h('thead', {}, h('tr', {}, this.heads)), this.body)));
  }

  /** Sets some filters and shows the first page. */
  filter(changes) {
    Object.assign(this.filters, changes);
    this.search.value = this.filters.text;
    for (const [key, box] of Object.entries(this.boxes)) box.set(this.filters[key]);
    this.update();
  }

  sort(c) {
    this.order = { column: c, down: this.order.column === c && !this.order.down };
    this.update();
  }

  turn(by) {
    this.from = Math.max(0, Math.min(this.from + by, this.shown.length - 1));
    this.draw();
  }

  update() {
    const { runs, filters } = this;
    const wanted = ['outcome', 'failure'].map((key) => [runs.texts.get(key), filters[key]]).concat([[runs.labels.get('planner'), filters.planner]])
      .filter(([column, value]) => column && value !== '').map(([column, value]) => [column.index, column.find(value)]);
    const text = filters.text.toLowerCase();
    const feasible = { yes: 1, no: 0 }[filters.feasible];
    this.shown = runs.all.filter((i) => wanted.every(([index, value]) => index[i] === value) && (feasible === undefined || runs.feasible[i] === feasible)
      && (!text || `${runs.ids[i]} ${runs.text('cause', i)} ${runs.text('contact', i)}`.toLowerCase().includes(text)));
    this.arrange();
    this.from = 0;
    this.draw();
  }

  /** Sorts the runs that are shown; those without a value are last. */
  arrange() {
    const { column: c, down } = this.order;
    if (c === 0 && !down) return;  // the order of the plan
    const { of, text } = this.columns[c];
    const values = new Map(this.shown.map((i) => [i, of(i)]));
    const sign = down ? -1 : 1;
    this.shown.sort((a, b) => {
      const [x, y] = [values.get(a), values.get(b)];
      if (x === null || y === null) return (x === null) - (y === null) || a - b;
      return sign * (text ? (x < y ? -1 : x > y ? 1 : 0) : x - y) || a - b;
    });
  }

  draw() {
    const page = this.shown.slice(this.from, this.from + PAGE);
    this.heads.forEach((head, c) => {
      if (this.order.column === c) head.setAttribute('aria-sort', this.order.down ? 'descending' : 'ascending');
      else head.removeAttribute('aria-sort');
    });
    this.body.replaceChildren(...page.map((i) => h('tr', {}, this.columns.map(({ text, of, cell, class: kind }, c) => h(c ? 'td' : 'th', { scope: c ? null : 'row', class: kind ?? (text ? 'text' : null) }, (cell ?? of)(i))))));
    this.back.disabled = this.from === 0;
    this.next.disabled = this.from + PAGE >= this.shown.length;
    const all = this.shown.length === this.runs.count ? '' : `, of ${this.runs.count} in all`;
    this.count.textContent = page.length ? `${this.from + 1} to ${this.from + page.length} of ${this.shown.length} runs${all}` : `no runs${all}`;
  }
}

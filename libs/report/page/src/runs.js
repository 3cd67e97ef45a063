// The runs of a study, in columns: 10⁵ runs are read without an object for each.

/** Texts as indices into a list of the different ones; -1 means that a run has none. */
class TextColumn {
  constructor({ values, index }) {
    this.values = values;
    this.index = Int32Array.from(index);
  }

  at(i) {
    return this.values[this.index[i]] ?? '';
  }

  /** The index of a value; -2, which no run has, if it does not occur. */
  find(value) {
    const found = this.values.indexOf(value);
    return found < 0 ? -2 : found;
  }
}

const textColumns = (all) => new Map(Object.entries(all).map(([name, column]) => [name, new TextColumn(column)]));

export class Runs {
  constructor({ runs, directories, replays }) {
    this.count = runs.count;
    this.ids = runs.id;
    this.feasible = Uint8Array.from(runs.feasible);
    this.texts = textColumns(runs.texts);
    this.labels = textColumns(runs.labels);
    if (directories.length > 1) this.labels.set('sweep', this.texts.get('directory'));
    this.varied = textColumns(runs.varied);
    this.gains = new Map(Object.entries(runs.gains));
    this.figures = runs.figures;
    this.replays = replays;
    const outcome = this.texts.get('outcome');
    const successes = ['reached', 'followed'].map((name) => outcome?.find(name) ?? -1).filter((index) => index >= 0);
    this.reached = Uint8Array.from({ length: this.count }, (_, i) => (successes.includes(outcome.index[i]) ? 1 : 0));
    this.all = Array.from({ length: this.count }, (_, i) => i);
    this.recorded = this.all.filter((i) => outcome.index[i] >= 0);
    this.failed = this.recorded.filter((i) => !this.reached[i]);
  }

  text(name, i) {
    return this.texts.get(name)?.at(i) ?? '';
  }

  command(i) {
    return ['hamelin run', this.text('scene', i), this.text('arguments', i)].filter(Boolean).join(' ');
  }

  /** The address of the page with the replayed scene; null if there is none. */
  replay(i) {
    const link = this.replays[i];
    if (!link) return null;
    const file = link.file.split('/').map(encodeURIComponent).join('/');
    return link.time_s > 0 ? `${file}#t=${link.time_s}` : file;
  }

  /** The columns by which runs can be grouped, by name: labels and varied values with a choice. */
  groupable() {
    return new Map([...this.labels, ...this.varied].filter(([name, { values }]) => values.length > 1 || name === 'planner'));
  }

  /** Groups runs by columns: [{key: texts, members: indices}], in the order of the first member. */
  group(columns, members = this.recorded) {
    const groups = new Map();
    for (const i of members) {
      const key = columns.map((column) => column.index[i]).join(' ');
      const found = groups.get(key);
      if (found) found.members.push(i);
      else groups.set(key, { key: columns.map((column) => column.at(i)), members: [i] });
    }
    return [...groups.values()];
  }
}

const collate = new Intl.Collator('en', { numeric: true }).compare;

/** Compares texts so that numbers, and whole numbers within names, are in their order. */
export function naturally(a, b) {
  const [x, y] = [Number(a), Number(b)];
  return Number.isNaN(x) || Number.isNaN(y) || a === '' || b === '' ? collate(a, b) : x - y;
}

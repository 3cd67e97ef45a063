// Tests the pages of sweeps and of accuracy in a headless Chromium.
//   HAMELIN_SWEEP_PAGES     pages of `hamelin sweep merge --page`, separated by colons
//   HAMELIN_ACCURACY_PAGE   page of `hamelin accuracy --page`
//   HAMELIN_TEMPLATES       folder of the built templates, for two pages of made-up data
//   CHROMIUM, NODE_MODULES  see browser.mjs
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { pathToFileURL } from 'node:url';
import { gzipSync } from 'node:zlib';
import { launch, violations } from './browser.mjs';
import { readContainer } from './report_data.mjs';

const folder = mkdtempSync(path.join(os.tmpdir(), 'hamelin-documents-'));
const TOKEN = '__HAMELIN_REPORT_DATA__';

/** Fills a template as hamelin does. */
function fill(template, data, name) {
  const text = Buffer.from(JSON.stringify(data));
  const size = Buffer.alloc(4);
  size.writeUInt32LE(text.length);
  const padding = Buffer.alloc((8 - ((4 + text.length) % 8)) % 8);
  const file = path.join(folder, name);
  writeFileSync(file, readFileSync(template, 'utf8').replace(TOKEN, () => gzipSync(Buffer.concat([size, text, padding])).toString('base64')));
  return file;
}

// ---- Made-up data with what a short measurement or sweep lacks ----
// These are hollow marks, all outcomes, and text that looks like HTML.

const MARKUP = '<img src=x onerror=alert(1)> & \'co\'';
const LONG = '/a/folder/whose/path/has/no/blank'.repeat(3);

function madeUpAccuracy() {
  const row = (label, more) => ({
    integrator: label.split(/[:,]/)[0], label, order: 2, step_s: null, rtol: null, tolerance: null, error_q: null, error_bound: null, reference_error: 1e-12, reference_limited: false,
    energy_error_max_J: null, cpu_us: null, ...more,
  });
  const rows = [1, 2, 4].flatMap((n) => [
    row('gauss:8', { order: 8, step_s: 0.1 / n, tolerance: 1e-12, error_q: n > 2 ? 1e-13 : 1e-6 / n, error_bound: 1e-6, reference_limited: n > 2, energy_error_max_J: 0, cpu_us: 100 * n }),
    row('gauss:12', { order: 12, step_s: 0.1 / n, tolerance: 1e-12, error_q: 1e-8 / n, error_bound: 1e-8, energy_error_max_J: 1e-9, cpu_us: 200 * n }),
    row('dop853, controlled', { order: 8, rtol: 10 ** -n, error_q: 10 ** -n, error_bound: 10 ** -n, energy_error_max_J: 1e-3, cpu_us: 90 * n }),
  ]);
  rows.push(row('rk4', { order: 4, step_s: 0.1 }));  // diverged
  return {
    format: 'hamelin.accuracy-page/1', generator: 'hamelin test',
    measurements: [{
      name: MARKUP, about: 'about it', notes: [MARKUP], reference_error: 1e-12, rows, cheaper_peers: 'none is cheaper',
      costs: { head: ['CPU', '1e-02'], words: 1, rows: [['gauss:8', '1'], ['best of hamelin over dop853', '0.5']], comparisons_from: 1 },
      table: { head: ['integrator', 'mode', 'order'], words: 2, rows: rows.map((r) => [r.label, 'accurate', String(r.order)]) },
    }],
  };
}

/** Columns of texts as a page has them. */
function textColumns(rows) {
  const names = [...new Set(rows.flatMap(Object.keys))];
  return Object.fromEntries(names.map((name) => {
    const values = [...new Set(rows.map((row) => row[name]).filter(Boolean))];
    return [name, { values, index: rows.map((row) => values.indexOf(row[name])) }];
  }));
}

/**
 * Sixty runs of three planners over two varied values, one of them not run, and random gain sets of
 * two planners.
 */
function madeUpRuns() {
  const outcomes = ['reached', 'reached', 'collision', 'stalled', 'timeout', 'refused', 'crashed'];
  return Array.from({ length: 72 }, (_, i) => {
    const planner = ['apf', 'hybrid', MARKUP][i % 3];
    const values = [`/planner/params/speed=${1 + (Math.floor(i / 3) % 3)}`, `/name=${['a', MARKUP][Math.floor(i / 9) % 2]}`];
    const outcome = i === 71 ? '' : outcomes[(i * i) % 7];
    const failed = outcome && outcome !== 'reached';
    const gains = i >= 60 ? { k_p: 0.1 * (i - 59), eta: i % 2 ? 10 ** (i - 65) : 1, k_obs: i - 59 } : {};
    return {
      id: `${i}/${planner}`, feasible: i % 10 === 9 ? 0 : 1, gains, figures: { time_s: outcome ? 1 + i / 7 : null, clearance_m: failed ? null : 0.001 * (i - 3), self_clearance_m: null, certified_share: outcome ? 0.995 : null, tick_us_p50: i % 4 ? 5 : 7, tick_us_p99: 9 },
      labels: { planner, goal: MARKUP, problem: `p${Math.floor(i / 9)}` }, varied: i < 60 ? Object.fromEntries(values.map((value) => value.split('='))) : {},
      texts: {
        directory: i % 2 ? MARKUP : LONG, scene: `${LONG}/s.json`, arguments: `--planner '${planner}'`, outcome, failure: failed ? `${outcome}: ${i % 2 ? MARKUP : 'N "quoted", cause'}` : '', cause: failed ? `${i} "quoted", cause` : '',
        contact: outcome === 'collision' ? 'the judge saw a touch b' : '', reason: i % 10 === 9 ? MARKUP : '',
      },
    };
  });
}

function madeUpSweep() {
  const group = {
    labels: { goal: MARKUP, planner: 'hybrid' }, planned: 8, runs: 7, feasible: 6, reached: 3, reached_all: 4, reached_share_interval: [0.19, 0.81], outcomes: { reached: 4, stalled: 1, collision: 1, crashed: 1 },
    judged: 7, contacts: 1, min_clearance_m: -0.00123, min_self_clearance_m: null, certified_share_mean: 0.99991, certified_share_min: 0.995, reached_time_s_median: 4.5, recovery_work_J_median: null,
    causes: { [MARKUP]: 1, 'stalled: joint limit': 2 }, timing: { tick_us_p50_median: 5.25, tick_us_p99_median: 10.5 },
  };
  const runs = madeUpRuns();
  const item = {
    a: MARKUP, b: 'hybrid', pairs: 20, without_partner: 3, different_scene_files: 2, reached: { both: 8, only_a: 2, only_b: 7, neither: 3, difference: -0.25, difference_interval: [-0.5, 0.05], p: 0.1797 },
    arrival: { pairs: 8, different: 8, difference_s: -1.25, difference_interval_s: [-2, 0.5], rank_biserial: -0.6, p: 0.00001, exact: true },
  };
  return {
    format: 'hamelin.sweep-page/2', generator: 'hamelin test', directories: [MARKUP, LONG], planned: runs.length, recorded: runs.length - 1,
    summary: {
      by: ['goal', 'planner'], notes: [MARKUP], groups: [group, { ...group, feasible: 0, reached: 0, judged: 0, contacts: 0 }],
      gains: [{ planner: 'apf', sets: 7, reached: 1, contacts: 2, reference: 0, reached_of_reference: 0, reached_share_interval: [0, 1], apf_stalled: 1, reached_of_apf_stalled: 0 }],
    },
    runs: {
      count: runs.length, id: runs.map(({ id }) => id), feasible: runs.map(({ feasible }) => feasible), texts: textColumns(runs.map(({ texts }) => texts)), labels: textColumns(runs.map(({ labels }) => labels)),
      varied: textColumns(runs.map(({ varied }) => varied)), gains: Object.fromEntries(['k_p', 'eta', 'k_obs'].map((name) => [name, runs.map(({ gains }) => gains[name] ?? null)])),
      figures: Object.fromEntries(Object.keys(runs[0].figures).map((name) => [name, runs.map(({ figures }) => figures[name])])),
    },
    replays: { 2: { file: 'a folder#/x y.html', time_s: 1.5 } },
    comparisons: [{ title: MARKUP, items: [item, { ...item, pairs: 0, arrival: { pairs: 0, different: 0, difference_s: null, difference_interval_s: null, rank_biserial: null, p: null, exact: true } }] }, { title: 'empty', items: [] }],
  };
}

const templates = process.env.HAMELIN_TEMPLATES;
const made = (name, data) => (templates ? [fill(path.join(templates, `${name}.html`), data, `made-up-${name}.html`)] : []);
const sweeps = [...(process.env.HAMELIN_SWEEP_PAGES ? process.env.HAMELIN_SWEEP_PAGES.split(':') : []), ...made('sweep', madeUpSweep())];
const accuracies = [...(process.env.HAMELIN_ACCURACY_PAGE ? [process.env.HAMELIN_ACCURACY_PAGE] : []), ...made('accuracy', madeUpAccuracy())];
if (!sweeps.length && !accuracies.length) throw new Error('set HAMELIN_SWEEP_PAGES, HAMELIN_ACCURACY_PAGE or HAMELIN_TEMPLATES');

let browser;
before(async () => {
  browser = await launch();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

/** Opens a page, which must print no errors or warnings and request nothing but itself. */
async function open(file, options = {}) {
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 }, ...options });
  const problems = [];
  page.on('pageerror', (error) => problems.push(`page: ${error.message}`));
  page.on('console', (message) => ['error', 'warning'].includes(message.type()) && problems.push(`console: ${message.text()}`));
  page.on('request', (request) => request.url() !== pathToFileURL(path.resolve(file)).href && problems.push(`requests ${request.url()}`));
  await page.goto(pathToFileURL(path.resolve(file)).href);
  await page.evaluate(() => window.hamelin.ready);
  assert.deepEqual(problems, []);
  return page;
}

/** The texts of the rows of a table, header first; the table is found by its caption. */
const tableOf = (page, caption) => page.getByRole('region', { name: caption, exact: true }).locator('tr').evaluateAll((rows) => rows.map((row) => [...row.cells].map((cell) => cell.textContent)));

const marksOf = (page) => page.locator('figure g[data-series] > g').count();

for (const file of accuracies) {
  const name = path.basename(file);
  const data = readContainer(file).json;

  test(`${name}: every row of the data is a mark in each plot that can show it, and a row of the table`, async () => {
    const page = await open(file);
    const rows = data.measurements.flatMap((measurement) => measurement.rows);
    const known = (keys) => rows.filter((row) => keys.every((key) => row[key] !== null)).length;
    assert.equal(await marksOf(page), known(['cpu_us', 'error_q']) + known(['step_s', 'error_q']) + known(['step_s', 'energy_error_max_J']));
    const limited = (key) => rows.filter((row) => row.reference_limited && row[key] !== null).length;
    assert.equal(await page.locator('figure .mark.open').count(), limited('cpu_us') + limited('step_s'));
    for (const measurement of data.measurements) {
      assert.deepEqual(await tableOf(page, `All rows of ${measurement.name}`), [measurement.table.head, ...measurement.table.rows]);
      assert.ok(await page.getByRole('heading', { name: measurement.name }).count() > 0);
      if (measurement.cheaper_peers) assert.ok(await page.getByText(measurement.cheaper_peers).isVisible());
    }
    // every coordinate is a number
    const drawn = await page.locator('figure svg').evaluateAll((all) => all.map((svg) => svg.outerHTML).join(''));
    assert.doesNotMatch(drawn, /NaN|Infinity|undefined/);
    await page.close();
  });

  test(`${name}: the legend hides and shows the lines of an integrator in all plots`, async () => {
    const page = await open(file);
    const labels = [...new Set(data.measurements.flatMap((measurement) => measurement.rows.map((row) => row.label)))];
    const boxes = page.getByRole('group', { name: 'Integrators' }).getByRole('checkbox');
    assert.equal(await boxes.count(), labels.length);
    const shown = () => page.locator('figure g[data-series]').evaluateAll((groups) => groups.filter((group) => group.style.display !== 'none').map((group) => group.dataset.series));
    const before = await shown();
    await page.getByRole('checkbox', { name: labels[0], exact: true }).uncheck();
    assert.deepEqual(await shown(), before.filter((label) => label !== labels[0]));
    await page.getByRole('checkbox', { name: labels[0], exact: true }).check();
    assert.deepEqual(await shown(), before);
    await page.close();
  });
}

/** Everything that the tests compare with, computed from the data without the page's code. */
function studyOf(data) {
  const { runs } = data;
  const text = (kind, name, i) => runs[kind][name]?.values[runs[kind][name].index[i]] ?? '';
  const all = Array.from({ length: runs.count }, (_, i) => i);
  const outcome = (i) => text('texts', 'outcome', i);
  const recorded = all.filter((i) => outcome(i));
  return { runs, text, all, outcome, recorded, failed: recorded.filter((i) => outcome(i) !== 'reached'), command: (i) => `hamelin run ${text('texts', 'scene', i)} ${text('texts', 'arguments', i)}` };
}

/** Counts by key, as sorted [key, count]. */
function tally(keys) {
  const counts = new Map();
  for (const key of keys) counts.set(key, (counts.get(key) ?? 0) + 1);
  return [...counts].sort(([a], [b]) => (a < b ? -1 : 1));
}

/** Fields of CSV; the independent reader of a file that the page saves. */
function parseCsv(text) {
  const rows = [[]];
  let field = '';
  let quoted = false;
  for (let i = 0; i < text.length; ++i) {
    const c = text[i];
    if (quoted && c === '"' && text[i + 1] === '"') field += text[++i];
    else if (c === '"') quoted = !quoted;
    else if (!quoted && (c === ',' || c === '\n')) {
      rows.at(-1).push(field);
      field = '';
      if (c === '\n') rows.push([]);
    } else field += c;
  }
  rows.pop();
  return rows;
}

const status = (page) => page.getByRole('region', { name: 'All runs' }).getByRole('status').textContent();

for (const file of sweeps) {
  const name = path.basename(file);
  const data = readContainer(file).json;
  const study = studyOf(data);

  test(`${name}: the summary's table is complete`, async () => {
    const page = await open(file);
    const { by, groups, gains } = data.summary;
    const success = await tableOf(page, 'Success by group');
    assert.deepEqual(success.slice(1).map((row) => row.slice(0, by.length)), groups.map((group) => by.map((label) => group.labels[label])));
    const column = (title) => success.slice(1).map((row) => row[success[0].indexOf(title)]);
    assert.deepEqual(column('reached'), groups.map((group) => String(group.reached)));
    assert.deepEqual(column('%'), groups.map((group) => (group.feasible ? ((100 * group.reached) / group.feasible).toFixed(1) : '–')));
    assert.deepEqual(column('stalled'), groups.map((group) => String(group.outcomes.stalled ?? 0)));
    assert.deepEqual(column('contactsjudged'), groups.map((group) => (group.judged ? String(group.contacts) : '–')));
    assert.deepEqual(column('smallest clearance[mm]').map((text) => text.replace('−', '-')), groups.map((group) => (group.min_clearance_m === null ? '–' : (1e3 * group.min_clearance_m).toFixed(2))));
    assert.equal((await page.getByRole('region', { name: 'Gain sets by planner' }).locator('tbody tr').count()), gains.length);
    await page.close();
  });

  test(`${name}: success and distributions are drawn for each label that can be chosen`, async () => {
    const page = await open(file);
    const select = page.getByLabel('Group by');
    const choices = await select.locator('option').evaluateAll((options) => options.map((option) => option.value));
    for (const choice of choices) {
      await select.selectOption(choice);
      const table = (await tableOf(page, 'Success by chosen label')).slice(1);
      const names = choice === choices[0] && choice.includes(', ') ? choice.split(', ') : [choice];
      const value = (label, i) => (label === 'sweep' ? study.text('texts', 'directory', i) : study.text('labels', label, i) || study.text('varied', label, i));
      const key = (i) => names.map((label) => value(label, i)).join('|');
      const groups = tally(study.recorded.map(key));
      const feasible = new Map(tally(study.recorded.filter((i) => data.runs.feasible[i]).map(key)));
      const reached = new Map(tally(study.recorded.filter((i) => data.runs.feasible[i] && study.outcome(i) === 'reached').map(key)));
      const expected = groups.map(([group, count]) => [group, feasible.has(group) ? `${reached.get(group) ?? 0} of ${feasible.get(group)}` : 'none feasible', count]);
      if (groups.length <= 400) assert.deepEqual(table.map((row) => [row.slice(0, names.length).join('|'), row[names.length], Number(row.at(-1).split(' of ')[1])]).sort(([a], [b]) => (a < b ? -1 : 1)), expected, choice);
      assert.equal(await page.getByRole('region', { name: 'Distributions by chosen label' }).locator('tbody tr').count(), table.length);
      const shares = table.map((row) => parseFloat(row[names.length + 1])).filter((share) => !Number.isNaN(share));
      assert.deepEqual(shares, [...shares].sort((a, b) => b - a), 'sorted by share');
    }
    const drawn = await page.locator('svg').evaluateAll((all) => all.map((svg) => svg.outerHTML).join(''));
    assert.doesNotMatch(drawn, /NaN|Infinity|undefined/);
    await page.close();
  });

  test(`${name}: the intervals of the chart are those of the summary`, async (t) => {
    const { by, groups } = data.summary;
    if (file.includes('made-up-sweep')) return t.skip('its summary is not that of its runs');
    const page = await open(file);
    const select = page.getByLabel('Group by');
    const own = by.filter((label) => label === 'planner' || (data.runs.labels[label]?.values.length ?? 0) > 1);
    await select.selectOption(own.join(', '));
    const heads = own;
    const table = (await tableOf(page, 'Success by chosen label')).slice(1);
    const shown = new Map(table.map((row) => [row.slice(0, heads.length).join('|'), row[heads.length + 2]]));
    const percent = (share) => (100 * share).toFixed(1);
    for (const group of groups.filter((one) => one.feasible > 0)) {
      const key = by.filter((label) => heads.includes(label)).map((label) => group.labels[label]).join('|');
      assert.equal(shown.get(key), group.reached_share_interval.map(percent).join(' – '));
    }
    return page.close();
  });

  test(`${name}: failures are counted by class and planner, and their runs are shown on request`, async (t) => {
    if (!study.failed.length) return t.skip('no run failed');
    const page = await open(file);
    const [head, ...rows] = await tableOf(page, 'Classes of failures');
    const classes = tally(study.failed.map((i) => study.text('texts', 'failure', i)));
    assert.deepEqual(rows.map((row) => [row[0], Number(row[1])]).sort(([a], [b]) => (a < b ? -1 : 1)), classes);
    for (const row of rows) {
      for (const [k, planner] of head.slice(2).filter((title) => title !== 'look').entries()) {
        assert.equal(Number(row[2 + k]), study.failed.filter((i) => study.text('texts', 'failure', i) === row[0] && study.text('labels', 'planner', i) === planner).length);
      }
    }
    const [failure, count] = [rows[0][0], Number(rows[0][1])];
    await page.getByRole('button', { name: `Show the ${count} runs of: ${failure}`, exact: true }).click();
    assert.match(await status(page), new RegExp(`of ${count} runs`));
    assert.equal(await page.getByRole('region', { name: 'Runs', exact: true }).locator('tbody tr').count(), Math.min(50, count));
    const details = page.locator('details.failure-class').first();
    await details.locator('summary').click();
    await details.locator('code').first().waitFor(); // drawn when the browser says that it was opened
    const commands = await details.locator('code').allTextContents();
    const known = study.failed.filter((i) => study.text('texts', 'failure', i) === failure).map(study.command);
    assert.equal(commands.length, Math.min(20, count));
    assert.ok(commands.every((command) => known.includes(command)));
    return page.close();
  });

  test(`${name}: paired comparisons are complete`, async () => {
    const page = await open(file);
    for (const { title, items } of data.comparisons.filter((comparison) => comparison.items.length)) {
      const rows = (await tableOf(page, `Comparison: ${title}`)).slice(1);
      assert.deepEqual(rows.map((row) => row.slice(0, 6)), items.map(({ a, b, pairs, reached: r }) => [`${a} − ${b}`, ...[pairs, r.both, r.only_a, r.only_b, r.neither].map(String)]));
      assert.deepEqual(rows.map((row) => row[9]), items.map(({ reached }) => (reached.p < 1e-4 ? '< 0.0001' : reached.p.toFixed(4))));
    }
    await page.close();
  });

  test(`${name}: maps of what varies have a cell or a mark for each run`, async (t) => {
    const page = await open(file);
    const region = page.getByRole('region', { name: 'Maps of what varies', exact: true });
    if (!(await region.count())) {
      await page.close();
      return t.skip('nothing varies');
    }
    const varied = Object.keys(data.runs.varied);
    if (varied.length >= 2) {
      await region.getByRole('combobox', { name: 'Across' }).selectOption(varied[0]);
      await region.getByRole('combobox', { name: 'Up' }).selectOption(varied[1]);
      const cells = await region.locator('td.heat small').allTextContents();
      const feasible = cells.reduce((sum, text) => sum + Number(text.split('/')[1]), 0);
      const planners = [...data.runs.labels.planner.values].length;
      const inMap = study.recorded.filter((i) => data.runs.feasible[i] && varied.slice(0, 2).every((pointer) => study.text('varied', pointer, i)));
      if (planners <= 6) assert.equal(feasible, inMap.length);
      const reached = cells.reduce((sum, text) => sum + Number(text.split('/')[0]), 0);
      if (planners <= 6) assert.equal(reached, inMap.filter((i) => study.outcome(i) === 'reached').length);
      await region.getByRole('combobox', { name: 'Show' }).selectOption('time');
      assert.match(await region.locator('td.heat').first().textContent(), /^(\d+\.\d\d|–)/);
    }
    if (Object.keys(data.runs.gains).length) {
      await region.getByRole('combobox', { name: 'Across' }).selectOption('k_obs');
      await region.getByRole('combobox', { name: 'Up' }).selectOption('k_p');
      assert.equal(await marksOf(page), study.recorded.filter((i) => data.runs.gains.k_p[i] !== null && study.text('labels', 'problem', i) !== 'no obstacle').length);
    }
    return page.close();
  });

  test(`${name}: all runs can be searched, sorted, turned and saved as CSV`, async () => {
    const page = await open(file);
    const region = page.getByRole('region', { name: 'All runs', exact: true });
    const rows = () => tableOf(page, 'Runs').then((table) => table.slice(1));
    assert.equal((await rows()).length, Math.min(50, study.all.length));
    assert.equal((await rows())[0][0], data.runs.id[0]);
    if (study.all.length > 50) {
      await region.getByRole('button', { name: 'Next' }).press('Enter');
      assert.equal((await rows())[0][0], data.runs.id[50]);
    }
    await region.getByRole('button', { name: 'time [s]' }).click();
    const times = (await rows()).map((row) => row[3]).filter((time) => time !== '–').map(Number);
    assert.deepEqual(times, [...times].sort((a, b) => a - b));
    assert.equal(await region.locator('th[aria-sort=ascending]').textContent(), 'time [s]');
    await region.getByRole('button', { name: 'run', exact: true }).click();

    const wanted = data.runs.id[study.all.length - 1];
    await region.getByLabel('Search id and cause').fill(wanted);
    const matches = study.all.filter((i) => `${data.runs.id[i]} ${study.text('texts', 'cause', i)} ${study.text('texts', 'contact', i)}`.toLowerCase().includes(wanted.toLowerCase()));
    await page.waitForFunction((count) => document.querySelector('[role=status]').textContent.includes(`of ${count} runs`), matches.length);
    assert.deepEqual((await rows()).map((row) => row[0]), matches.slice(0, 50).map((i) => data.runs.id[i]));
    const download = page.waitForEvent('download');
    await region.getByRole('button', { name: 'Save as CSV' }).click();
    const csv = parseCsv(readFileSync(await (await download).path(), 'utf8'));
    assert.equal(csv.length, 1 + matches.length);
    const column = (title) => csv.slice(1).map((row) => row[csv[0].indexOf(title)]);
    assert.deepEqual(column('id'), matches.map((i) => data.runs.id[i]));
    assert.deepEqual(column('cause'), matches.map((i) => study.text('texts', 'cause', i)));
    assert.deepEqual(column('time_s'), matches.map((i) => String(data.runs.figures.time_s[i] ?? '')));
    await region.getByRole('button', { name: 'Show all' }).click();
    assert.match(await status(page), new RegExp(`of ${study.all.length} runs$`));
    await page.close();
  });

  test(`${name}: a failed run's link opens its replayed scene`, async (t) => {
    const [index, link] = Object.entries(data.replays)[0] ?? [];
    if (!link) return t.skip('the page has no replays');
    const page = await open(file);
    const anchor = page.getByRole('link', { name: `Replayed scene of ${data.runs.id[index]}`, exact: true }).first();
    const target = new URL(await anchor.getAttribute('href'), pathToFileURL(path.resolve(file)));
    const beside = path.join(path.dirname(path.resolve(file)), link.file);
    assert.equal(target.pathname, pathToFileURL(beside).pathname);
    if (file.includes('made-up-sweep')) return page.close();
    await anchor.click();
    await page.waitForURL(target.href);
    await page.evaluate(() => window.hamelin.ready);
    assert.equal(await page.evaluate(() => window.hamelin.counts().runs), 1);
    assert.ok(Math.abs(await page.evaluate(() => window.hamelin.time()) - link.time_s) < 1e-3);
    assert.equal(await page.locator('.badge').first().textContent(), readContainer(beside).json.runs[0].outcome);
    return page.close();
  });
}

for (const file of [...accuracies, ...sweeps]) {
  const name = path.basename(file);

  test(`${name}: the theme follows the system and the switch`, async () => {
    const page = await open(file, { colorScheme: 'dark' });
    const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    const dark = await paper();
    await page.getByRole('button', { name: 'Light' }).click();
    const light = await paper();
    assert.notEqual(light, dark);
    assert.equal(await page.evaluate(() => document.documentElement.dataset.shown), 'light');
    await page.getByRole('button', { name: 'Auto' }).click();
    assert.equal(await paper(), dark);
    await page.close();
  });

  test(`${name}: only tables are wider than a narrow screen, and they scroll`, async () => {
    const page = await open(file, { viewport: { width: 420, height: 800 } });
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= 420);
    await page.close();
  });

  test(`${name}: axe reports no violations`, async (t) => {
    const page = await open(file);
    for (const colorScheme of ['light', 'dark']) {
      await page.emulateMedia({ colorScheme });
      const found = await violations(page);
      if (!found) return t.skip('axe-core is not installed');
      assert.deepEqual(found, [], colorScheme);
    }
    return page.close();
  });
}

if (templates) {
  for (const name of ['sweep', 'accuracy']) {
    test(`${name}: an empty template, or data of another format, shows an error`, async () => {
      const template = path.join(templates, `${name}.html`);
      for (const [file, expected] of [[template, /empty template/], [fill(template, { format: 'hamelin.other/1' }, 'other.html'), /format "hamelin.other\/1" found, hamelin\.\w+-page\/\d expected/]]) {
        const page = await browser.newPage();
        await page.goto(pathToFileURL(file).href);
        await page.getByRole('alert').waitFor();
        assert.match(await page.getByRole('alert').textContent(), expected);
        await page.close();
      }
    });
  }
}

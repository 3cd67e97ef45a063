// Tests the pages of sweeps and of accuracy in a headless Chromium.
//   HAMELIN_SWEEP_PAGE      page of `hamelin sweep merge --page`
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

function madeUpSweep() {
  const outcomes = ['reached', 'collision', 'refused', 'stalled', 'timeout', 'gave_up', 'crashed'];
  const group = {
    labels: { goal: MARKUP, planner: 'hybrid' }, planned: 8, runs: 7, feasible: 6, reached: 3, reached_all: 4, reached_share_interval: [0.19, 0.81], outcomes: { reached: 4, stalled: 1, collision: 1, crashed: 1 },
    judged: 7, contacts: 1, min_clearance_m: -0.00123, min_self_clearance_m: null, certified_share_mean: 0.99991, certified_share_min: 0.995, reached_time_s_median: 4.5, recovery_work_J_median: null,
    causes: { [MARKUP]: 1, 'stalled: joint limit': 2 }, timing: { tick_us_p50_median: 5.25, tick_us_p99_median: 10.5 },
  };
  return {
    format: 'hamelin.sweep-page/1', generator: 'hamelin test', directories: [MARKUP, LONG], planned: 8, recorded: 7,
    summary: {
      by: ['goal', 'planner'], notes: [MARKUP], groups: [group, { ...group, feasible: 0, reached: 0, judged: 0, contacts: 0 }],
      gains: [{ planner: 'apf', sets: 7, reached: 1, contacts: 2, reference: 0, reached_of_reference: 0, reached_share_interval: [0, 1], apf_stalled: 1, reached_of_apf_stalled: 0 }],
    },
    gain_sets: ['apf', 'gyro'].flatMap((planner) => outcomes.map((outcome, i) => ({ planner, run: `${planner}/${i}`, outcome, cause: i ? MARKUP : null, gains: { k_p: 1 + i, eta: 0.1 * (1 + i), k_obs: 10 * (1 + i) } }))),
    failures: outcomes.slice(1).map((outcome, i) => ({ run: `run ${i}`, outcome, cause: MARKUP, command: `hamelin run ${MARKUP}` })),
  };
}

const templates = process.env.HAMELIN_TEMPLATES;
const made = (name, data) => (templates ? [fill(path.join(templates, `${name}.html`), data, `made-up-${name}.html`)] : []);
const sweeps = [...(process.env.HAMELIN_SWEEP_PAGE ? [process.env.HAMELIN_SWEEP_PAGE] : []), ...made('sweep', madeUpSweep())];
const accuracies = [...(process.env.HAMELIN_ACCURACY_PAGE ? [process.env.HAMELIN_ACCURACY_PAGE] : []), ...made('accuracy', madeUpAccuracy())];
if (!sweeps.length && !accuracies.length) throw new Error('set HAMELIN_SWEEP_PAGE, HAMELIN_ACCURACY_PAGE or HAMELIN_TEMPLATES');

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

for (const file of sweeps) {
  const name = path.basename(file);
  const data = readContainer(file).json;

  test(`${name}: groups, gain sets, causes and failures are complete`, async () => {
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
    assert.equal(await marksOf(page), data.gain_sets.length);
    assert.equal(await page.locator('figure').count(), new Set(data.gain_sets.map((set) => set.planner)).size);
    assert.equal((await page.getByRole('region', { name: 'Gain sets by planner' }).locator('tbody tr').count()), data.gain_sets.length ? gains.length : 0);
    assert.equal(await page.getByRole('region', { name: 'Causes by group' }).locator('tbody tr').count(), groups.reduce((sum, group) => sum + Object.keys(group.causes).length, 0));
    if (data.failures.length) {
      assert.deepEqual((await tableOf(page, 'Commands that repeat the runs')).slice(1), data.failures.map(({ run, outcome, cause, command }) => [run, outcome, cause, command]));
    }
    await page.close();
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
      for (const [file, expected] of [[template, /empty template/], [fill(template, { format: 'hamelin.other/1' }, 'other.html'), /format "hamelin.other\/1" found, hamelin\.\w+-page\/1 expected/]]) {
        const page = await browser.newPage();
        await page.goto(pathToFileURL(file).href);
        await page.getByRole('alert').waitFor();
        assert.match(await page.getByRole('alert').textContent(), expected);
        await page.close();
      }
    });
  }
}

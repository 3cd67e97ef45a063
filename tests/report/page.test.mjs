// Tests report pages in a headless Chromium.
//   HAMELIN_PAGES           pages made by `hamelin report`, separated as in PATH
//   HAMELIN_TEMPLATE        the built template, for pages with the runs of fixture.mjs
//   CHROMIUM, NODE_MODULES  see browser.mjs
//
// Every page is opened once and compared with its data. The controls are tested on one page that
// has something for each of them, in one tab, because with WebGL in software it takes a second to
// open a page and to compile its shaders.
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { pathToFileURL } from 'node:url';
import { launch, violations } from './browser.mjs';
import { swingingAt, writePages } from './fixture.mjs';
import { becomesEqual, changes, compare, drawingBecomes, keepDrawing, screenshot, settle, watchDrawing } from './picture.mjs';
import { cellsWithin, jointsAt, readData, tipOf } from './report_data.mjs';

const template = process.env.HAMELIN_TEMPLATE;
const folder = mkdtempSync(path.join(os.tmpdir(), 'hamelin-page-'));
const given = (process.env.HAMELIN_PAGES ?? '').split(path.delimiter).filter(Boolean);
if (!given.length && !template) throw new Error('set HAMELIN_PAGES to pages or HAMELIN_TEMPLATE to the built template');
const [everything, planar] = template ? writePages(template, folder, ['everything', 'planar']) : [];

let browser;
let helper;
before(async () => {
  browser = await launch();
  helper = await browser.newPage();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

/** Opens a page and records its errors, warnings and requests. */
async function open(file, { viewport = { width: 1200, height: 700 }, init, ...options } = {}) {
  const page = await browser.newPage({ viewport, ...options });
  const observed = { errors: [], requests: [] };
  page.on('pageerror', (error) => observed.errors.push(`page: ${error.message}`));
  page.on('console', (message) => ['error', 'warning'].includes(message.type()) && observed.errors.push(`console: ${message.text()}`));
  page.on('request', (request) => observed.requests.push(request.url().slice(0, 200)));
  if (init) await page.addInitScript(init);
  const began = performance.now();
  await page.goto(pathToFileURL(path.resolve(file)).href);
  await page.evaluate(() => window.hamelin.ready);
  observed.ready = performance.now() - began;
  await settle(page);
  return { page, observed };
}

const time = (page) => page.evaluate(() => window.hamelin.time());
const setTime = (page, t) => page.evaluate((value) => window.hamelin.setTime(value), t);
const zoomOf = (page) => page.evaluate(() => window.hamelin.zoom());
const counts = (page) => page.evaluate(() => window.hamelin.counts());
const settings = (page) => page.locator('.settings');
const box = (page, name) => settings(page).getByRole('checkbox', { name, exact: true });
const views = (page) => page.getByRole('group', { name: 'View', exact: true });
const near = (a, b, slack) => Math.abs(a - b) < slack;

/** Sets a slider as dragging it does. */
const drag = (locator, value) => locator.evaluate((input, v) => {
  input.value = v;
  input.dispatchEvent(new Event('input', { bubbles: true }));
}, value);

/** The number of distinct colours on the canvas of each plot. */
const plotColors = (page) => page.locator('.uplot canvas').evaluateAll((all) => all.map((canvas) => {
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  return new Set(new Uint32Array(data.buffer)).size;
}));

const camera = (page) => page.evaluate(() => {
  const { camera: c, controls } = window.hamelin.view;
  const d = c.position.clone().sub(controls.target).normalize();
  return { flat: Boolean(c.isOrthographicCamera), d: [d.x, d.y, d.z] };
});
const towards = (d, axis) => d.reduce((sum, c, i) => sum + c * axis[i], 0) > 0.999;

// ---- Every page: it opens without errors and shows its data ----

async function showsItsData(page, { json, worldOf }) {
  assert.ok((await page.title()).includes(json.title));
  const found = await counts(page);
  assert.equal(found.runs, json.runs.length);
  assert.deepEqual(found.frames, json.runs.map((run) => run.frames.t.n));
  assert.deepEqual(found.voxels, json.runs.map((run) => (run.seen?.alone ? 0 : worldOf(run).map?.level.n ?? 0) + (run.seen?.since.n ?? 0)));
}

async function tipsAreRight(page, { json, unpack, worldOf }) {
  for (const [i, run] of json.runs.entries()) {
    const t = unpack(run.frames.t);
    const { robot, reach_m: reach } = worldOf(run);
    const moments = [0, 0.13, 0.5, 0.77, 1].flatMap((share) => [0, 0.37].map((part) => {
      const k = Math.min(Math.round(share * (t.length - 1)), t.length - 1 - (part > 0 ? 1 : 0));
      return t[k] + part * (t[Math.min(k + 1, t.length - 1)] - t[k]);
    }));
    const seen = await page.evaluate(([all, r]) => all.map((at) => {
      window.hamelin.setTime(at);
      return window.hamelin.pose(r);
    }), [moments, i]);
    moments.forEach((at, m) => {
      const right = tipOf(robot, jointsAt(run, unpack, robot.joints.length, at));
      right.forEach((c, axis) => assert.ok(near(c, seen[m][axis], 1e-9 * reach), `run ${i}, t = ${at}: ${seen[m][axis]}, expected ${c}`));
    });
  }
}

async function nearCellsAreRight(page, { json, unpack, worldOf, middle }) {
  await setTime(page, middle);
  await box(page, 'only near the arm').check();
  const distance = Number(await settings(page).getByRole('slider', { name: 'within' }).inputValue());
  const shown = (await counts(page)).voxelsShown;
  for (const [i, run] of json.runs.entries()) {
    const world = worldOf(run);
    if (!world.map || !world.robot.spheres.length || run.seen) continue;
    assert.deepEqual([world.map.position_m, world.map.quaternion_wxyz], [[0, 0, 0], [1, 0, 0, 0]], 'this test assumes that the map has the pose of the world');
    const { least, most } = cellsWithin(world, unpack, jointsAt(run, unpack, world.robot.joints.length, middle), distance);
    assert.ok(shown[i] >= least && shown[i] <= most, `run ${i}: ${shown[i]} cells, expected ${least} to ${most}`);
  }
}

async function seenCellsAppear(page, { json, unpack, middle }) {
  await box(page, 'only near the arm').uncheck();
  for (const t of [0, middle, 1e9]) {
    await setTime(page, t);
    const shown = (await counts(page)).voxelsShown;
    const end = Math.max(...json.runs.map((run) => unpack(run.frames.t).at(-1)));
    json.runs.forEach((run, i) => {
      if (!run.seen?.alone) return;
      const since = unpack(run.seen.since);
      const there = since.filter((s) => s <= Math.min(t, end)).length;
      assert.equal(shown[i], there, `run ${i}, ${t} s`);
      if (t === middle) assert.ok(there > 0 && there <= since.length);
    });
  }
}

async function firstViewIsRight(page, { json, worldOf }) {
  const normal = worldOf(json.runs[0]).robot.planar_normal;
  assert.equal(await views(page).locator('[aria-pressed=true]').textContent(), normal ? 'Plane' : '3D');
  const { flat, d } = await camera(page);
  assert.equal(flat, Boolean(normal));
  if (normal) assert.ok(towards(d, normal), `looks along ${d}`);
}

async function plotsAreDrawn(page, { json }) {
  const found = await page.locator('.plot-row').evaluateAll((rows) => rows.map((row) => row.dataset.plot));
  assert.deepEqual(found.filter((id) => !id.startsWith('overlay-')), [...new Set(json.runs.flatMap((run) => run.plots.map((plot) => plot.id)))]);
  const ink = await plotColors(page);
  assert.equal(ink.length, (await counts(page)).plots);
  ink.forEach((colors, i) => assert.ok(colors > 8, `plot ${i} has ${colors} colours`));
}

async function panelsAndTablesAreComplete(page, { json, has }) {
  assert.equal(await page.locator('.panel').count(), json.runs.length);
  assert.equal(await page.locator('.comparison tbody tr').count(), json.runs.length);
  for (const [i, run] of json.runs.entries()) {
    assert.ok((await page.locator('.comparison tbody tr').nth(i).textContent()).includes(run.outcome));
  }
  if (has.several) {
    const widths = await page.locator('.panel').evaluateAll((all) => all.map((panel) => Math.round(panel.clientWidth)));
    assert.ok(Math.max(...widths) - Math.min(...widths) <= 2, `panels of ${widths}`);
    assert.ok((await page.locator('[data-plot^=overlay]').count()) > 0);
  }
  const timed = json.runs.flatMap((run) => run.events.filter((event) => event.t !== null));
  assert.equal(await page.locator('.event-ticks button').count(), timed.length);
  const spans = (of) => json.runs.reduce((sum, run) => sum + (run[of]?.length ?? 0), 0);
  assert.equal(await page.locator('.stop-spans button').count(), spans('stops'));
  assert.equal(await page.locator('.act-spans button').count(), spans('acts'));
  const used = new Set(json.runs.flatMap((run) => run.acts.map((span) => span.act)));
  assert.equal(await page.locator('.band-legend .key[data-act]').count(), used.size);
  assert.equal(await page.locator('.band-legend .shield').count(), spans('stops') > 0 ? 1 : 0);
}

for (const file of [...given, everything, planar].filter(Boolean)) {
  const name = path.basename(file, '.html');
  const data = readData(file);

  test(`${name}: opens without an error, a warning or a request, and shows its runs`, async (t) => {
    const { page, observed } = await open(file, { viewport: { width: 1440, height: 900 } });
    t.diagnostic(`${name}: ready after ${(observed.ready / 1000).toFixed(2)} s, ${(readFileSync(file).length / 1e6).toFixed(2)} MB`);
    await t.test('the counts of the data', () => showsItsData(page, data));
    await t.test('the picture has depth', async () => {
      const { colors } = await compare(helper, await screenshot(page));
      assert.ok(colors > 60, `only ${colors} colours`);
    });
    await t.test('the first view', () => firstViewIsRight(page, data));
    await t.test('all plots', () => plotsAreDrawn(page, data));
    await t.test('panels, comparison, event ticks', () => panelsAndTablesAreComplete(page, data));
    await t.test('the tip is at the position given by the matrix exponential, at frames and between', () => tipsAreRight(page, data));
    if (data.has.map) await t.test('"only near the arm" shows exactly the cells within the distance', () => nearCellsAreRight(page, data));
    if (data.json.runs.some((run) => run.seen)) await t.test('what sensors see appears when they see it', () => seenCellsAppear(page, data));
    assert.deepEqual(observed.errors, []);
    assert.deepEqual(observed.requests, [pathToFileURL(path.resolve(file)).href.slice(0, 200)]);
    await page.close();
  });
}

// ---- The controls, on a page that has something for each of them ----

async function sliderMovesTheArm(page, { duration }) {
  const first = await screenshot(page);
  const pose = await page.evaluate(() => window.hamelin.pose(0));
  const area = await page.getByRole('slider', { name: 'Time [s]' }).boundingBox();
  await page.mouse.click(area.x + 0.6 * area.width, area.y + area.height / 2);
  assert.ok(near(await time(page), 0.6 * duration, 0.02 * duration));
  const moved = await page.evaluate(() => window.hamelin.pose(0));
  assert.ok(Math.hypot(...moved.map((c, i) => c - pose[i])) > 1e-3, 'the tip does not move');
  assert.ok(await becomesEqual(helper, page, first, false), 'the picture does not change');
  assert.match(await page.locator('.readout').textContent(), /^\d+\.\d{3} \/ \d+\.\d{3} s$/);
  await setTime(page, 0);
  assert.ok(await becomesEqual(helper, page, first, true), 'time 0 looks different the second time');
}

/** The other checks compare what the page draws; this one checks that the browser shows it. */
async function drawingIsShown(page) {
  // Nothing but the canvas may differ.
  const style = await page.addStyleTag({ content: '.hud, .corner { visibility: hidden; }' });
  const first = await screenshot(page);
  await box(page, 'arm').uncheck();
  assert.ok(await becomesEqual(helper, page, first, false, 2e-3), 'without the arm the window looks the same');
  await box(page, 'arm').check();
  assert.ok(await becomesEqual(helper, page, first, true), 'the arm is not shown again');
  await style.evaluate((element) => element.remove());
}

const setSpeed = async (page, speed) => {
  await page.getByRole('combobox', { name: 'Speed' }).selectOption(String(speed));
  await page.evaluate(() => document.activeElement.blur());
};

/**
 * Simulated seconds per second, measured frame by frame in the page, because a busy machine may
 * delay this process.
 */
async function pace(page, speed) {
  await setTime(page, 0);
  await setSpeed(page, speed);
  await page.evaluate(() => {
    const playing = [];
    const sample = (clock) => {
      const t = window.hamelin.time();
      if (t > (playing.at(-1)?.[1] ?? 0)) playing.push([clock, t]);
      if (window.playing) requestAnimationFrame(sample);
    };
    window.playing = playing;
    requestAnimationFrame(sample);
  });
  await page.keyboard.press('Space');
  await page.waitForFunction(() => window.playing.length > 3 && window.playing.at(-1)[0] - window.playing[0][0] > 400);
  await page.keyboard.press('Space');
  return page.evaluate(() => {
    const [[from, first], [to, last]] = [window.playing[0], window.playing.at(-1)];
    window.playing = null;
    return (last - first) / ((to - from) / 1000);
  });
}

async function keysAndButtonsStep(page, { json, unpack, duration }) {
  const steps = [...new Set(json.runs.flatMap((run) => unpack(run.frames.t)))].sort((a, b) => a - b).filter((t, i, all) => i === 0 || t - all[i - 1] > 1e-9);
  await page.keyboard.press('ArrowRight');
  assert.ok(near(await time(page), steps[1], 1e-9));
  await page.getByRole('button', { name: 'Next frame (right arrow)' }).click();
  assert.ok(near(await time(page), steps[2], 1e-9));
  await page.getByRole('button', { name: 'Previous frame (left arrow)' }).click();
  await page.keyboard.press('ArrowLeft');
  assert.equal(await time(page), 0);
  await page.keyboard.press('End');
  assert.equal(await time(page), duration);
  await page.keyboard.press('Home');
  assert.equal(await time(page), 0);
}

async function keysAndButtonsPlay(page) {
  const slow = await pace(page, 0.1);
  const fast = await pace(page, 4);
  assert.ok(slow > 0 && fast > 8 * slow, `pace ${slow} at 0.1×, ${fast} at 4×`);
  const held = await time(page);
  await settle(page);
  assert.equal(await time(page), held, 'the time changes after the pause');
  // Slow, because on a busy machine the replay might end before the click.
  await setSpeed(page, 0.1);
  await setTime(page, 0);
  await page.getByRole('button', { name: 'Play (space)' }).click();
  await page.waitForFunction(() => window.hamelin.time() > 0);
  await page.getByRole('button', { name: 'Pause (space)' }).click();
}

/**
 * Checks that a checkbox changes the picture when it is switched off, and restores it when it is
 * switched on.
 */
const flip = (page, label) => changes(page, label, () => box(page, label).uncheck(), () => box(page, label).check());

async function partsAreSwitched(page, { json, unpack, middle }) {
  await setTime(page, middle);
  for (const label of ['arm', 'grid', 'tip trail', 'goals', 'obstacles', 'paths', 'predicted', 'collision spheres']) await flip(page, label);
  const run = json.runs.find(({ frames }) => unpack(frames.contacts.count).some((count) => count > 0));
  await setTime(page, unpack(run.frames.t)[unpack(run.frames.contacts.count).findIndex((count) => count > 0)]);
  await flip(page, 'closest points');
}

async function arrowsAreSwitched(page, { json, unpack }) {
  // A time at which a force is large.
  const { frames } = json.runs[0];
  const forces = frames.forces.map((force) => unpack(force.f));
  const most = Math.max(...forces.flat().map(Math.abs));
  const large = (v) => Math.abs(v) > 0.5 * most;
  await setTime(page, unpack(frames.t)[Math.floor(forces.find((f) => f.some(large)).findIndex(large) / 3)]);
  await flip(page, 'arrows');
  const length = settings(page).getByRole('slider', { name: 'length' });
  await changes(page, 'length of the arrows', () => drag(length, 0.5), () => drag(length, 0));
  const channels = await settings(page).locator('.channels input').all();
  assert.equal(channels.length, new Set(json.runs.flatMap((run) => run.frames.forces.map((force) => force.channel))).size);
  await changes(page, 'channels', async () => {
    for (const channel of channels) await channel.uncheck();
  }, async () => {
    for (const channel of channels) await channel.check();
  });
  assert.match(await page.locator('.force-scale').textContent(), /^[\d.e−]+ N$/);
}

async function mapIsSwitched(page, { middle }) {
  await setTime(page, middle);
  await flip(page, 'map');
  const opacity = settings(page).getByRole('slider', { name: 'opacity' });
  await changes(page, 'opacity', () => drag(opacity, 1), () => drag(opacity, 0.5));
  const all = (await counts(page)).voxelsShown;
  const within = settings(page).getByRole('slider', { name: 'within' });
  const onlyNear = box(page, 'only near the arm');
  await changes(page, 'only near', async () => {
    await onlyNear.check();
    await drag(within, 0.3 * Number(await within.getAttribute('max')));
    const some = (await counts(page)).voxelsShown;
    some.forEach((count, i) => assert.ok(count < all[i] || all[i] === 0));
    await drag(within, Number(await within.getAttribute('max')));
    const more = (await counts(page)).voxelsShown;
    assert.ok(more.reduce((a, b) => a + b) > some.reduce((a, b) => a + b), 'a larger distance does not show more cells');
  }, () => onlyNear.uncheck());
  assert.deepEqual((await counts(page)).voxelsShown, all);
}

async function mapIsCut(page, { middle }) {
  await setTime(page, middle);
  const cut = settings(page).getByRole('group', { name: 'Cut the map across' });
  const off = () => cut.getByRole('button', { name: 'off' }).click();
  for (const axis of ['x', 'y', 'z']) {
    await changes(page, `cut across ${axis}`, () => cut.getByRole('button', { name: axis, exact: true }).click(), off);
  }
  await cut.getByRole('button', { name: 'y', exact: true }).click();
  await changes(page, 'place of the cut', () => drag(settings(page).getByRole('slider', { name: 'cut at' }), 0.3));
  await changes(page, 'other half', () => box(page, 'other half').check());
  await off();
}

async function obstaclesMoveAndAppear(page, { json, worldOf, duration }) {
  // What is predicted differs where obstacles are at the same place and move to the other side.
  const others = ['arm', 'tip trail', 'goals', 'collision spheres', 'closest points', 'arrows', 'map', 'predicted'];
  for (const label of others) await box(page, label).uncheck();
  const { obstacles } = worldOf(json.runs[0]);
  const { period_s: period } = obstacles.find((o) => o.motion).motion;
  const start = await keepDrawing(page);
  await setTime(page, Math.min(period / 4, duration));
  assert.ok(await drawingBecomes(page, start, false), 'no obstacle moves');
  const late = obstacles.find((o) => o.appears_s > 0 && o.appears_s < duration);
  // Half a period later the moving obstacles are at the same place; only the new obstacle differs.
  const later = Math.ceil(late.appears_s / (period / 2)) * (period / 2);
  await setTime(page, later - period / 2);
  assert.ok(await drawingBecomes(page, start, true), `${late.name} appears too early`);
  await setTime(page, later);
  assert.ok(await drawingBecomes(page, start, false), `${late.name} does not appear`);
  for (const label of others) await box(page, label).check();
}

async function movesAreForeseen(page, { json, worldOf }) {
  const { obstacles } = worldOf(json.runs[0]);
  const movers = obstacles.filter((o) => o.motion || o.poses);
  assert.deepEqual((await counts(page)).paths, json.runs.map(() => movers.length));
  const names = obstacles.filter((o) => o.predicted).map((o) => o.name);
  assert.deepEqual(names, ['drifter', 'swinging']);
  // Also between samples, which are 0.05 s apart.
  for (const t of [0, 0.42, 1.333, 3]) {
    await setTime(page, t);
    const [ball, capsule] = await page.evaluate(() => window.hamelin.predicted(0));
    assert.equal(capsule.length, 3);
    [0.2, 0.6, 1].forEach((ahead, i) => swingingAt(t + ahead).forEach((c, axis) => {
      assert.ok(near(capsule[i].position[axis], c, 2e-3), `${ahead} s after ${t} s: ${capsule[i].position}`);
    }));
    // A ball whose speed is bounded stays and grows.
    assert.deepEqual(ball.map(({ scale }) => Math.round(1000 * scale)), [120, 170]);
    ball.forEach(({ position }) => assert.ok(near(position[1], 0.45 + 0.3 * Math.sin((Math.PI * t) / 2), 2e-3)));
  }
}

async function viewsTurnTheCamera(page) {
  const button = (label) => views(page).getByRole('button', { name: label });
  for (const [label, axis] of [['Top', [0, 0, 1]], ['Front', [0, -1, 0]], ['Side', [1, 0, 0]]]) {
    await changes(page, label, () => button(label).click());
    const seen = await camera(page);
    assert.ok(seen.flat && towards(seen.d, axis), `${label}: ${seen.d}`);
  }
  await changes(page, '3D', () => button('3D').click());
  assert.equal((await camera(page)).flat, false);
  const area = await page.locator('.panels').boundingBox();
  await changes(page, 'dragging', async () => {
    await page.mouse.move(area.x + 0.3 * area.width, area.y + 0.6 * area.height);
    await page.mouse.down();
    await page.mouse.move(area.x + 0.4 * area.width, area.y + 0.5 * area.height, { steps: 4 });
    await page.mouse.up();
  });
  await changes(page, 'the wheel', () => page.mouse.wheel(0, -300));
}

/**
 * The first plot: its row, the position in the window of a share of its time axis, and a drag
 * between two shares.
 */
async function firstPlot(page) {
  const row = page.locator('.plot-row:not([data-plot^=overlay])').first();
  const over = row.locator('.u-over').first();
  await over.scrollIntoViewIfNeeded();
  const area = await over.boundingBox();
  const point = (share) => [area.x + share * area.width, area.y + 0.5 * area.height];
  const pull = async (from, to) => {
    await page.mouse.move(...point(from));
    await page.mouse.down();
    await page.mouse.move(...point(to), { steps: 5 });
    await page.mouse.up();
  };
  return { row, point, pull };
}

async function plotsSetTheTime(page, { json, unpack, duration }) {
  const { row, point, pull } = await firstPlot(page);
  await page.mouse.click(...point(0.4));
  assert.ok(near(await time(page), 0.4 * duration, 0.01 * duration), `click at 0.4 set ${await time(page)} of ${duration}`);
  const lines = await page.locator('.now').evaluateAll((all) => all.map((line) => (new DOMMatrix(getComputedStyle(line).transform).e / line.parentElement.clientWidth)));
  lines.forEach((share) => assert.ok(near(share, 0.4, 0.01), `a time line is at ${share}`));

  // Dragging the time line moves the time and does not zoom.
  await pull(0.4, 0.7);
  assert.ok(near(await time(page), 0.7 * duration, 0.01 * duration));
  assert.deepEqual(await zoomOf(page), [0, duration]);

  // Values under the cursor are those of the run.
  await page.mouse.move(...point(0.25));
  await settle(page);
  const id = await row.getAttribute('data-plot');
  const plot = json.runs[0].plots.find((candidate) => candidate.id === id);
  const [t, y] = [unpack(plot.t), unpack(plot.series[0].y)];
  const k = Math.max(1, t.findIndex((x) => x >= 0.25 * duration));
  const around = y.slice(Math.max(0, k - Math.ceil(0.01 * t.length) - 2), k + Math.ceil(0.01 * t.length) + 2);
  const shown = Number((await row.locator('.legend .value').first().textContent()).replaceAll('−', '-'));
  const slack = 1e-3 * Math.max(...around.map(Math.abs));
  assert.ok(shown >= Math.min(...around) - slack && shown <= Math.max(...around) + slack, `value ${shown}, expected ${Math.min(...around)} to ${Math.max(...around)}`);
}

async function plotsZoom(page, { duration }) {
  const { pull } = await firstPlot(page);
  await setTime(page, 0.7 * duration);
  const reset = page.getByRole('button', { name: 'Reset zoom' });
  assert.ok(await reset.isDisabled());
  await pull(0.2, 0.5);
  const zoom = await zoomOf(page);
  assert.ok(near(zoom[0], 0.2 * duration, 0.01 * duration) && near(zoom[1], 0.5 * duration, 0.01 * duration), `zoom ${zoom}`);
  const out = await page.locator('.now').evaluateAll((all) => all.map((line) => line.style.visibility));
  assert.ok(out.every((state) => state === 'hidden'), 'the time line is drawn outside the zoom');
  await reset.scrollIntoViewIfNeeded();
  await reset.click();
  assert.deepEqual(await zoomOf(page), [0, duration]);
}

async function linesAreHidden(page) {
  const { row } = await firstPlot(page);
  const button = row.locator('.legend button').first();
  const drawn = async (canvas) => {
    await settle(page);
    return canvas.evaluate((c) => c.toDataURL());
  };
  const canvas = row.locator('canvas').first();
  const full = await drawn(canvas);
  await button.click();
  assert.notEqual(await drawn(canvas), full);
  assert.equal(await button.getAttribute('aria-pressed'), 'false');
  await button.click();
  assert.equal(await drawn(canvas), full);

  const log = page.getByRole('checkbox', { name: 'log scale' }).first();
  const logCanvas = page.locator('.plot-row', { has: log }).first().locator('canvas').first();
  const linear = await drawn(logCanvas);
  await log.check();
  assert.notEqual(await drawn(logCanvas), linear);
}

async function coloursSwitch(page) {
  const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const plot = () => page.locator('.uplot canvas').first().evaluate((c) => c.toDataURL());
  const group = page.getByRole('group', { name: 'Colours' });
  await page.emulateMedia({ colorScheme: 'dark' });
  await settle(page);
  const dark = await paper();
  const inDark = await plot();
  await changes(page, 'light', () => group.getByRole('button', { name: 'Light' }).click());
  assert.notEqual(await paper(), dark);
  assert.notEqual(await plot(), inDark);
  await group.getByRole('button', { name: 'Auto' }).click();
  assert.equal(await paper(), dark);
  await page.emulateMedia({ colorScheme: 'light' });
  await settle(page);
  assert.notEqual(await paper(), dark);
}

async function eventsSetTheTime(page, { json }) {
  const timed = json.runs.flatMap((run) => run.events.filter((event) => event.t !== null));
  const ticks = page.locator('.event-ticks button');
  const list = page.locator('details.section', { hasText: 'Events' }).first();
  await list.evaluate((details) => { details.open = true; });
  const last = timed.map((event) => event.t).sort((a, b) => a - b).at(-1);
  await list.locator('button.when').last().click();
  assert.ok(near(await time(page), last, 1e-9));
  const index = timed.findIndex((event) => event.t === last);
  await ticks.nth(index).hover();
  assert.ok((await page.locator('.event-tip').textContent()).length > 0);
  await setTime(page, 0);
  await ticks.nth(index).click();
  assert.ok(near(await time(page), last, 1e-9));
  for (const title of ['Configuration', 'Provenance']) {
    await page.locator('summary', { hasText: title }).click();
    assert.ok(await page.locator('details.section', { hasText: title }).locator('td').first().isVisible());
  }
}

async function stopsAreShown(page, { json }) {
  const stops = json.runs.flatMap((run) => run.stops);
  const spans = page.locator('.stop-spans button');
  assert.ok(stops.length > 0);
  for (const [i, stop] of stops.entries()) {
    await spans.nth(i).click();
    assert.ok(near(await time(page), stop.t, 1e-9));
    assert.ok((await page.locator('.event-tip').textContent()).includes(stop.cause.replace('_', ' ')));
    assert.ok((await counts(page)).stopsShown.some(Boolean));
    await flip(page, 'stops');
  }
  // nothing is drawn where no stop is
  await setTime(page, 0);
  await settle(page);
  const before = await page.evaluate(() => window.hamelin.counts().stopsShown);
  assert.ok(before.every((shown) => !shown), 'a stop is shown at the start');
}

async function actsAreShown(page, { json }) {
  const acts = json.runs.flatMap((run) => run.acts);
  const spans = page.locator('.act-spans button');
  const words = { stop: 'stops', back: 'goes back', aside: 'goes aside' };
  const paints = await spans.evaluateAll((all) => all.map((span) => getComputedStyle(span).backgroundColor));
  const legend = await page.locator('.band-legend .key[data-act]').evaluateAll((all) => all.map((key) => [key.dataset.act, key.textContent, getComputedStyle(key.firstChild).backgroundColor]));
  assert.equal(new Set(legend.map(([, , paint]) => paint)).size, 3);
  const track = await page.locator('.act-spans').boundingBox();
  const duration = await page.evaluate(() => window.hamelin.duration);
  for (const [i, { t, until, act }] of acts.entries()) {
    assert.ok(legend.some(([name, text, paint]) => name === act && text === words[act] && paint === paints[i]), `${act}: ${paints[i]} is not in the legend`);
    const area = await spans.nth(i).boundingBox();
    assert.ok(near(area.x - track.x, (t / duration) * track.width, 1) && near(area.width, ((until - t) / duration) * track.width, 1), `${act}: from ${area.x}, ${area.width} wide`);
    await spans.nth(i).hover();
    assert.ok((await page.locator('.event-tip').textContent()).includes(`evades for ${(until - t).toFixed(3)} s: ${words[act]}`));
    await spans.nth(i).click();
    assert.ok(near(await time(page), t, 1e-9));
  }
  // The panel of the first run names its act, between the beginning and the end of the act.
  const shown = page.locator('.panel').first().locator('dd').last();
  const [{ t, until, act }] = json.runs[0].acts;
  for (const [at, word] of [[t - 0.01, 'none'], [t + 0.01, words[act]], [until + 0.01, 'none']]) {
    await setTime(page, at);
    assert.equal(await shown.textContent(), word);
  }
}

async function fitsWindows(page) {
  for (const width of [800, 1280, 1920]) {
    await page.setViewportSize({ width, height: 700 });
    await settle(page);
    const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    assert.ok(over <= 0, `${over} pixels too wide at ${width}`);
    const odd = await page.locator('.plot-host').evaluateAll((all) => all.filter((host) => Math.abs(host.clientWidth - host.firstElementChild.offsetWidth) > 2).length);
    assert.equal(odd, 0, `${odd} plots are not as wide as their place at ${width}`);
  }
}

async function axeReportsNoViolations(page, t) {
  for (const colorScheme of ['light', 'dark']) {
    await page.emulateMedia({ colorScheme });
    await settle(page);
    const found = await violations(page);
    if (!found) return t.skip('axe-core is not installed');
    assert.deepEqual(found, [], colorScheme);
  }
  return undefined;
}

const CONTROLS = [
  ['the time slider moves the arm', sliderMovesTheArm],
  ['the browser shows what the page draws', drawingIsShown],
  ['keys and buttons step', keysAndButtonsStep],
  ['keys and buttons play and pause', keysAndButtonsPlay],
  ['every part of the picture can be hidden', partsAreSwitched],
  ['arrows, their length and channels', arrowsAreSwitched],
  ['the map, its opacity, and the cells near the arm', mapIsSwitched],
  ['the map is cut', mapIsCut],
  ['obstacles move and appear at their times', obstaclesMoveAndAppear],
  ['moving obstacles have paths and predictions', movesAreForeseen],
  ['views, dragging and the wheel turn the camera', viewsTurnTheCamera],
  ['a click in a plot sets the time, and its values are the run\'s', plotsSetTheTime],
  ['plots zoom together', plotsZoom],
  ['lines are hidden, and a plot gets a log scale', linesAreHidden],
  ['light and dark', coloursSwitch],
  ['events, configuration, provenance', eventsSetTheTime],
  ['stops of the shield', stopsAreShown],
  ['evasions', actsAreShown],
  ['it fits windows of 800 to 1920 pixels', fitsWindows],
];

if (template) {
  const data = readData(everything);

  test('everything: every control has its effect', async (t) => {
    assert.deepEqual(Object.entries(data.has).filter(([, there]) => !there), [], 'the page has something for each control');
    const { page, observed } = await open(everything, { viewport: { width: 1200, height: 800 } });
    await watchDrawing(page);
    for (const [name, check] of CONTROLS) {
      await t.test(name, async () => {
        await setTime(page, 0);
        await check(page, data);
        assert.deepEqual(observed.errors, []);
      });
    }
    await t.test('axe reports no violations', (part) => axeReportsNoViolations(page, part));
    await page.close();
  });

  test('planar: the plane and 3D, small numbers, window widths of a single run, axe', async (t) => {
    const { page, observed } = await open(planar, {
      init: () => {
        // The texts that the plots write on their canvases.
        window.written = [];
        const write = CanvasRenderingContext2D.prototype.fillText;
        CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
          window.written.push(text);
          return write.call(this, text, ...rest);
        };
      },
    });
    await watchDrawing(page);
    await t.test('small numbers keep their digits: the axis of the energy error has labels other than 0', async () => {
      const written = await page.evaluate(() => window.written);
      assert.ok(written.some((text) => /^−?\d\.\d\de−16$/.test(text)), written.filter((text) => text.includes('e')).join(' '));
    });
    await t.test('3D leaves the plane, and Plane returns to it', async () => {
      const button = (label) => views(page).getByRole('button', { name: label });
      assert.equal(await button('Top').count(), 0);
      await changes(page, '3D', () => button('3D').click(), () => button('Plane').click());
      await button('3D').click();
      assert.equal((await camera(page)).flat, false);
    });
    await t.test('it fits windows of 800 to 1920 pixels', () => fitsWindows(page));
    await t.test('axe reports no violations', (part) => axeReportsNoViolations(page, part));
    assert.deepEqual(observed.errors, []);
    await page.close();
  });

  test('without WebGL the page says so and shows the plots', async () => {
    const { page, observed } = await open(everything, {
      init: () => {
        const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
          return kind.includes('webgl') ? null : get.call(this, kind, ...rest);
        };
      },
    });
    assert.ok(await page.getByText('needs WebGL').isVisible());
    assert.deepEqual(observed.errors.filter((text) => text.startsWith('page:')), []);
    const ink = await plotColors(page);
    assert.ok(ink.length > 0 && ink.every((colors) => colors > 8));
    const pose = await page.evaluate(() => window.hamelin.pose(0));
    await setTime(page, data.middle);
    assert.notDeepEqual(await page.evaluate(() => window.hamelin.pose(0)), pose);
    const over = page.locator('.u-over').first();
    await over.scrollIntoViewIfNeeded();
    const area = await over.boundingBox();
    await page.mouse.click(area.x + 0.3 * area.width, area.y + 0.5 * area.height);
    assert.ok(near(await time(page), 0.3 * data.duration, 0.01 * data.duration));
    await page.close();
  });

  test('an empty template shows an error', async () => {
    const page = await browser.newPage();
    await page.goto(pathToFileURL(path.resolve(template)).href);
    await page.getByRole('alert').waitFor();
    assert.match(await page.getByRole('alert').textContent(), /hamelin inserts the data into it/);
    await page.close();
  });
}

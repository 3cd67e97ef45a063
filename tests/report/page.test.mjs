// Drives report pages in a headless Chromium.
//   HAMELIN_PAGES      pages made by `hamelin report`, separated as in PATH
//   HAMELIN_TEMPLATE   the built template; filled with the runs of fixture.mjs it makes more pages
//   HAMELIN_FIXTURES   which of these, e.g. one,planar
//   CHROMIUM, NODE_MODULES   see browser.mjs
import assert from 'node:assert/strict';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { pathToFileURL } from 'node:url';
import { gunzipSync } from 'node:zlib';
import { launch, lookUp } from './browser.mjs';
import { writePages } from './fixture.mjs';

const folder = mkdtempSync(path.join(os.tmpdir(), 'hamelin-page-'));
const given = (process.env.HAMELIN_PAGES ?? '').split(path.delimiter).filter(Boolean);
if (!given.length && !process.env.HAMELIN_TEMPLATE) throw new Error('set HAMELIN_PAGES to pages or HAMELIN_TEMPLATE to the built template');
const made = process.env.HAMELIN_TEMPLATE ? writePages(process.env.HAMELIN_TEMPLATE, folder, process.env.HAMELIN_FIXTURES?.split(',')) : [];
const files = [...given, ...made];

// ---- The page's data, read without the page's code ----

const READ = {
  f64: [8, 'readDoubleLE'], f32: [4, 'readFloatLE'], i32: [4, 'readInt32LE'], u32: [4, 'readUInt32LE'], i16: [2, 'readInt16LE'], u16: [2, 'readUInt16LE'], u8: [1, 'readUInt8'],
};

function readData(file) {
  const html = readFileSync(file, 'utf8');
  const text = /<script id="hamelin-data"[^>]*>([^<]*)<\/script>/.exec(html)[1];
  const bytes = gunzipSync(Buffer.from(text, 'base64'));
  const length = bytes.readUInt32LE(0);
  const json = JSON.parse(bytes.subarray(4, 4 + length).toString('utf8'));
  const blob = bytes.subarray(Math.ceil((4 + length) / 8) * 8);
  const unpack = ({ at, n, type, scale = 1, offset = 0, none }) => {
    const [size, method] = READ[type];
    return Array.from({ length: n }, (_, i) => {
      const raw = blob[method](at + size * i);
      return raw === none ? NaN : offset + scale * raw;
    });
  };
  return { json, unpack };
}

// ---- Kinematics by another road: the matrix exponential as a power series, with scaling and squaring ----

const times = (A, B) => A.map((row) => B[0].map((_, c) => row.reduce((sum, a, k) => sum + a * B[k][c], 0)));

function exponential(A) {
  const halvings = 8;
  const small = A.map((row) => row.map((a) => a / 2 ** halvings));
  let sum = A.map((row, r) => row.map((_, c) => (r === c ? 1 : 0)));
  let term = sum;
  for (let k = 1; k < 16; ++k) {
    term = times(term, small).map((row) => row.map((a) => a / k));
    sum = sum.map((row, r) => row.map((a, c) => a + term[r][c]));
  }
  for (let k = 0; k < halvings; ++k) sum = times(sum, sum);
  return sum;
}

function tipOf(robot, q) {
  const [w, x, y, z] = robot.base.quaternion_wxyz;
  // v → q v q* column by column
  const turned = ([a, b, c]) => {
    const t = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
    return [a + w * t[0] + y * t[2] - z * t[1], b + w * t[1] + z * t[0] - x * t[2], c + w * t[2] + x * t[1] - y * t[0]];
  };
  const columns = [turned([1, 0, 0]), turned([0, 1, 0]), turned([0, 0, 1]), robot.base.position_m];
  let T = [0, 1, 2].map((r) => columns.map((column) => column[r])).concat([[0, 0, 0, 1]]);
  for (let i = 0; i <= robot.tip_link; ++i) {
    const [a, b, c, d, e, f] = robot.joints[i].screw.map((s) => s * q[i]);
    T = times(T, exponential([[0, -c, b, d], [c, 0, -a, e], [-b, a, 0, f], [0, 0, 0, 0]]));
  }
  return times(T, [...robot.skeleton.at(-1), 1].map((v) => [v])).slice(0, 3).map(([v]) => v);
}

// ---- Browser ----

let browser;
let lab;
before(async () => {
  browser = await launch();
  lab = await browser.newPage();
});
after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

const settle = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));

/** Opens a page and listens to all that it says and asks for. */
async function open(file, { viewport = { width: 1440, height: 900 }, init, ...options } = {}) {
  const page = await browser.newPage({ viewport, ...options });
  const heard = { errors: [], requests: [] };
  page.on('pageerror', (error) => heard.errors.push(`page: ${error.message}`));
  page.on('console', (message) => ['error', 'warning'].includes(message.type()) && heard.errors.push(`console: ${message.text()}`));
  page.on('request', (request) => heard.requests.push(request.url().slice(0, 200)));
  if (init) await page.addInitScript(init);
  const began = performance.now();
  await page.goto(pathToFileURL(path.resolve(file)).href);
  await page.evaluate(() => window.hamelin.ready);
  heard.ready = performance.now() - began;
  await settle(page);
  return { page, heard };
}

/** Pixels of one or two pictures: distinct colours of the first, and whether both are the same. */
async function look(first, second = null) {
  return lab.evaluate(async (pictures) => {
    const decode = async (base64) => {
      const image = new Image();
      image.src = `data:image/png;base64,${base64}`;
      await image.decode();
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext('2d');
      context.drawImage(image, 0, 0);
      return new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer);
    };
    const [a, b] = await Promise.all(pictures.map(decode));
    return { colors: new Set(a).size, same: !b || (a.length === b.length && a.every((pixel, i) => pixel === b[i])) };
  }, [first, second].filter(Boolean).map((buffer) => buffer.toString('base64')));
}

const shot = async (page) => {
  await settle(page);
  return page.locator('.panels').screenshot();
};

/** The picture, once two in a row are the same: on a busy machine what was drawn is shown a little later. */
async function picture(page) {
  let last = await shot(page);
  for (let tries = 0; tries < 8; ++tries) {
    const next = await shot(page);
    if (next.equals(last)) return next;
    last = next;
  }
  throw new Error('the picture does not come to rest');
}
const time = (page) => page.evaluate(() => window.hamelin.time());
const setTime = (page, t) => page.evaluate((value) => window.hamelin.setTime(value), t);
const counts = (page) => page.evaluate(() => window.hamelin.counts());
const settings = (page) => page.locator('.settings');
const box = (page, name) => settings(page).getByRole('checkbox', { name, exact: true });

/** Sets a slider as a user's drag does. */
const drag = (locator, value) => locator.evaluate((input, v) => {
  input.value = v;
  input.dispatchEvent(new Event('input', { bubbles: true }));
}, value);

/** Whether the picture becomes the same as another, or differs from it. */
async function becomes(page, other, same) {
  for (let tries = 0; tries < 4; ++tries) {
    if ((await look(other, await picture(page))).same === same) return true;
  }
  return false;
}

/** Fails unless the picture changes by the action, and comes back by the undoing. */
async function changes(page, what, act, undo) {
  const start = await picture(page);
  await act();
  assert.ok(await becomes(page, start, false), `${what}: the picture does not change`);
  if (!undo) return;
  await undo();
  assert.ok(await becomes(page, start, true), `${what}: the picture does not come back`);
}

for (const file of files) {
  const name = path.basename(file, '.html');
  const { json, unpack } = readData(file);
  const worldOf = (run) => json.worlds[run.world];
  const duration = Math.max(...json.runs.map((run) => unpack(run.frames.t).at(-1)));
  const middle = 0.45 * duration;
  const has = {
    map: json.runs.some((run) => worldOf(run).map?.level.n > 0),
    spheres: json.runs.some((run) => run.frames.clearance),
    contacts: json.runs.some((run) => run.frames.contacts && unpack(run.frames.contacts.count).some((count) => count > 0)),
    forces: json.runs.some((run) => run.frames.forces.some((force) => unpack(force.f).some((f) => Math.abs(f) > 0))),
    goals: json.runs.some((run) => worldOf(run).goals.length),
    obstacles: json.runs.some((run) => worldOf(run).obstacles?.length),
    moving: json.runs.some((run) => worldOf(run).obstacles?.some((o) => o.motion)),
  };

  test(`${name}: opens without an error, a warning or a request`, async (t) => {
    const { page, heard } = await open(file);
    t.diagnostic(`${name}: ready after ${(heard.ready / 1000).toFixed(2)} s, ${(readFileSync(file).length / 1e6).toFixed(2)} MB`);
    assert.deepEqual(heard.errors, []);
    assert.deepEqual(heard.requests, [pathToFileURL(path.resolve(file)).href.slice(0, 200)]);
    assert.ok((await page.title()).includes(json.title));
    const found = await counts(page);
    assert.equal(found.runs, json.runs.length);
    assert.deepEqual(found.frames, json.runs.map((run) => run.frames.t.n));
    assert.deepEqual(found.voxels, json.runs.map((run) => worldOf(run).map?.level.n ?? 0));
    await page.close();
  });

  test(`${name}: the tip is where the matrix exponential puts it, at frames and between`, async () => {
    const { page } = await open(file);
    for (const [i, run] of json.runs.entries()) {
      const t = unpack(run.frames.t);
      const q = unpack(run.frames.q);
      const { robot } = worldOf(run);
      const n = robot.joints.length;
      const reach = worldOf(run).reach_m;
      for (const share of [0, 0.13, 0.5, 0.77, 1]) {
        for (const part of [0, 0.37]) {
          const k = Math.min(Math.round(share * (t.length - 1)), t.length - 1 - (part > 0 ? 1 : 0));
          if (k < 0) continue;
          const next = Math.min(k + 1, t.length - 1);
          const at = t[k] + part * (t[next] - t[k]);
          const between = Array.from({ length: n }, (_, j) => q[k * n + j] + part * (q[next * n + j] - q[k * n + j]));
          await setTime(page, at);
          const seen = await page.evaluate((r) => window.hamelin.pose(r), i);
          tipOf(robot, between).forEach((c, axis) => assert.ok(Math.abs(c - seen[axis]) < 1e-9 * reach, `run ${i}, t = ${at}: ${seen[axis]} for ${c}`));
        }
      }
    }
    await page.close();
  });

  test(`${name}: the picture has depth and the time slider moves the arm`, async (t) => {
    const { page, heard } = await open(file);
    const first = await picture(page);
    const { colors } = await look(first);
    t.diagnostic(`${name}: ${colors} colours`);
    assert.ok(colors > 60, `only ${colors} colours`);
    const pose = await page.evaluate(() => window.hamelin.pose(0));
    const slider = page.getByRole('slider', { name: 'Time [s]' });
    const area = await slider.boundingBox();
    await page.mouse.click(area.x + 0.6 * area.width, area.y + area.height / 2);
    assert.ok(Math.abs((await time(page)) - 0.6 * duration) < 0.02 * duration);
    const moved = await page.evaluate(() => window.hamelin.pose(0));
    assert.ok(Math.hypot(...moved.map((c, i) => c - pose[i])) > 1e-3, 'the tip stays');
    assert.ok(await becomes(page, first, false), 'the picture stays');
    assert.match(await page.locator('.readout').textContent(), /^\d+\.\d{3} \/ \d+\.\d{3} s$/);
    await setTime(page, 0);
    assert.ok(await becomes(page, first, true), 'time 0 looks otherwise the second time');
    assert.deepEqual(heard.errors, []);
    await page.close();
  });

  test(`${name}: keys and buttons step, play and pause`, async () => {
    const { page } = await open(file);
    const steps = [...new Set(json.runs.flatMap((run) => unpack(run.frames.t)))].sort((a, b) => a - b).filter((t, i, all) => i === 0 || t - all[i - 1] > 1e-9);
    await page.keyboard.press('ArrowRight');
    assert.ok(Math.abs((await time(page)) - steps[1]) < 1e-9);
    await page.getByRole('button', { name: 'One frame on (right arrow)' }).click();
    assert.ok(Math.abs((await time(page)) - steps[2]) < 1e-9);
    await page.getByRole('button', { name: 'One frame back (left arrow)' }).click();
    await page.keyboard.press('ArrowLeft');
    assert.equal(await time(page), 0);
    await page.keyboard.press('End');
    assert.equal(await time(page), duration);
    await page.keyboard.press('Home');
    assert.equal(await time(page), 0);

    // Simulated seconds a second, measured in the page itself.
    const pace = async (speed) => {
      await setTime(page, 0);
      await page.getByRole('combobox', { name: 'Speed' }).selectOption(String(speed));
      await page.evaluate(() => document.activeElement.blur());
      await page.keyboard.press('Space');
      const rate = await page.evaluate(async () => {
        const frame = () => new Promise((done) => requestAnimationFrame(done));
        await frame();
        const [clock, t] = [performance.now(), window.hamelin.time()];
        while (window.hamelin.time() < 0.5 * window.hamelin.duration && performance.now() - clock < 700) await frame();
        return (window.hamelin.time() - t) / ((performance.now() - clock) / 1000);
      });
      await page.keyboard.press('Space');
      return rate;
    };
    const slow = await pace(0.1);
    const fast = await pace(4);
    assert.ok(slow > 0 && fast > 8 * slow, `pace ${slow} at 0.1×, ${fast} at 4×`);
    const held = await time(page);
    await settle(page);
    assert.equal(await time(page), held, 'goes on after the pause');
    await page.getByRole('button', { name: 'Play (space)' }).click();
    await page.waitForFunction((t) => window.hamelin.time() > t, held);
    await page.getByRole('button', { name: 'Pause (space)' }).click();
    await page.close();
  });

  test(`${name}: every switch of the view has its effect`, async () => {
    const { page, heard } = await open(file);
    await setTime(page, middle);
    // A moment at which there is something to see of each kind.
    const busy = async (pick) => {
      for (const [i, run] of json.runs.entries()) {
        const k = pick(run);
        if (k >= 0) return setTime(page, unpack(run.frames.t)[k] + (i < 0 ? 1 : 0));
      }
      return undefined;
    };
    const flip = (label) => changes(page, label, () => box(page, label).uncheck(), () => box(page, label).check());
    await flip('arm');
    await flip('grid');
    await flip('tip trail');
    if (has.goals) await flip('goals');
    if (has.obstacles) await flip('obstacles');
    if (has.spheres) await flip('collision spheres');
    if (has.contacts) {
      await busy((run) => (run.frames.contacts ? unpack(run.frames.contacts.count).findIndex((count) => count > 0) : -1));
      await flip('closest points');
    }
    if (has.forces) {
      await busy((run) => {
        const size = run.frames.forces.map((force) => unpack(force.f));
        const most = Math.max(...size.flat().map(Math.abs));
        return size.length ? Math.floor(size.find((f) => f.some((v) => Math.abs(v) > 0.5 * most)).findIndex((v) => Math.abs(v) > 0.5 * most) / 3) : -1;
      });
      await flip('arrows');
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
    if (has.map) {
      await flip('map');
      const opacity = settings(page).getByRole('slider', { name: 'opacity' });
      await changes(page, 'opacity', () => drag(opacity, 1), () => drag(opacity, 0.5));
      const all = (await counts(page)).voxelsShown;
      const within = settings(page).getByRole('slider', { name: 'within' });
      const near = box(page, 'only near the arm');
      await changes(page, 'only near', async () => {
        await near.check();
        await drag(within, 0.3 * Number(await within.getAttribute('max')));
        const some = (await counts(page)).voxelsShown;
        some.forEach((count, i) => assert.ok(count < all[i] || all[i] === 0));
        await drag(within, Number(await within.getAttribute('max')));
        const more = (await counts(page)).voxelsShown;
        assert.ok(more.reduce((a, b) => a + b) > some.reduce((a, b) => a + b), 'a larger distance keeps no more cells');
      }, () => near.uncheck());
      assert.deepEqual((await counts(page)).voxelsShown, all);
      for (const axis of ['x', 'y', 'z']) {
        const cut = settings(page).getByRole('group', { name: 'Cut the map across' });
        await changes(page, `cut across ${axis}`, () => cut.getByRole('button', { name: axis, exact: true }).click(), () => cut.getByRole('button', { name: 'off' }).click());
      }
      await settings(page).getByRole('group', { name: 'Cut the map across' }).getByRole('button', { name: 'y', exact: true }).click();
      await changes(page, 'place of the cut', () => drag(settings(page).getByRole('slider', { name: 'cut at' }), 0.3));
      await changes(page, 'other half', () => box(page, 'other half').check());
    }
    assert.deepEqual(heard.errors, []);
    await page.close();
  });

  if (has.map) {
    test(`${name}: "only near the arm" keeps exactly the cells within the distance`, async () => {
      const { page } = await open(file);
      await setTime(page, middle);
      await box(page, 'only near the arm').check();
      const slider = settings(page).getByRole('slider', { name: 'within' });
      const shown = (await counts(page)).voxelsShown;
      const distance = Number(await slider.inputValue());
      for (const [i, run] of json.runs.entries()) {
        const { robot, map } = worldOf(run);
        if (!map || !robot.spheres.length) continue;
        const t = unpack(run.frames.t);
        const q = unpack(run.frames.q);
        const n = robot.joints.length;
        const k = Math.max(0, t.findLastIndex?.((x) => x <= middle) ?? t.filter((x) => x <= middle).length - 1);
        const a = k + 1 < t.length ? (middle - t[k]) / (t[k + 1] - t[k]) : 0;
        const joints = Array.from({ length: n }, (_, j) => q[k * n + j] + (a > 0 ? a * (q[(k + 1) * n + j] - q[k * n + j]) : 0));
        const balls = robot.spheres.map((s) => ({ c: tipOf({ ...robot, tip_link: s.link, skeleton: [s.center_m] }, joints), r: s.radius_m }));
        assert.deepEqual([map.position_m, map.quaternion_wxyz], [[0, 0, 0], [1, 0, 0, 0]], 'this test counts in the world frame');
        const lo = unpack(map.lo);
        const level = unpack(map.level);
        let least = 0;
        let most = 0;
        for (let v = 0; v < level.length; ++v) {
          const size = map.resolution_m * 2 ** level[v];
          const from = [0, 1, 2].map((axis) => lo[3 * v + axis] * map.resolution_m);
          const gap = Math.min(...balls.map(({ c, r }) => Math.hypot(...from.map((f, axis) => Math.max(f - c[axis], 0, c[axis] - f - size))) - r));
          // Single-precision cells: those on the very border may fall either way.
          if (gap <= distance - 1e-6) ++least;
          if (gap <= distance + 1e-6) ++most;
        }
        assert.ok(shown[i] >= least && shown[i] <= most, `run ${i}: ${shown[i]} cells for ${least} to ${most}`);
      }
      await page.close();
    });
  }

  if (has.moving) {
    test(`${name}: obstacles move and appear in their time`, async () => {
      const { page } = await open(file);
      for (const label of ['arm', 'tip trail', 'goals', 'collision spheres', 'closest points', 'arrows', 'map']) {
        if (await box(page, label).count()) await box(page, label).uncheck();
      }
      const obstacles = worldOf(json.runs[0]).obstacles;
      const { period_s: period } = obstacles.find((o) => o.motion).motion;
      // Only the picture counts here, not the figures over it.
      await page.addStyleTag({ content: '.hud { visibility: hidden; }' });
      const start = await picture(page);
      await setTime(page, Math.min(period / 4, duration));
      assert.ok(await becomes(page, start, false), 'nothing moves');
      const late = obstacles.find((o) => o.appears_s > 0 && o.appears_s < duration);
      if (late) {
        // Half a period later the moving ones stand where they stood; what appeared since is new.
        const later = Math.ceil(late.appears_s / (period / 2)) * (period / 2);
        await setTime(page, later - period / 2);
        assert.ok(await becomes(page, start, true), `${late.name} is there too early`);
        await setTime(page, later);
        assert.ok(await becomes(page, start, false), `${late.name} does not appear`);
      }
      await page.close();
    });
  }

  test(`${name}: views, and the first one`, async () => {
    const { page } = await open(file);
    const planar = worldOf(json.runs[0]).robot.planar_normal;
    const group = page.getByRole('group', { name: 'View', exact: true });
    assert.equal(await group.locator('[aria-pressed=true]').textContent(), planar ? 'Plane' : '3D');
    const camera = () => page.evaluate(() => {
      const { camera: c, controls } = window.hamelin.view;
      const d = c.position.clone().sub(controls.target).normalize();
      return { flat: Boolean(c.isOrthographicCamera), d: [d.x, d.y, d.z] };
    });
    const towards = (d, axis) => d.reduce((sum, c, i) => sum + c * axis[i], 0) > 0.999;
    const start = await camera();
    assert.equal(start.flat, Boolean(planar));
    if (planar) assert.ok(towards(start.d, planar), `looks along ${start.d}`);
    for (const [label, axis] of [['Top', [0, 0, 1]], ['Front', [0, -1, 0]], ['Side', [1, 0, 0]]]) {
      if (planar && label === 'Top') continue;
      await changes(page, label, () => group.getByRole('button', { name: label }).click());
      const seen = await camera();
      assert.ok(seen.flat && towards(seen.d, axis), `${label}: ${seen.d}`);
    }
    await changes(page, '3D', () => group.getByRole('button', { name: '3D' }).click());
    assert.equal((await camera()).flat, false);
    const area = await page.locator('.panels').boundingBox();
    await changes(page, 'dragging', async () => {
      await page.mouse.move(area.x + 0.3 * area.width, area.y + 0.6 * area.height);
      await page.mouse.down();
      await page.mouse.move(area.x + 0.4 * area.width, area.y + 0.5 * area.height, { steps: 4 });
      await page.mouse.up();
    });
    await changes(page, 'the wheel', () => page.mouse.wheel(0, -300));
    await page.close();
  });

  test(`${name}: plots are drawn, and click, drag, zoom and hide together with the time`, async () => {
    const { page, heard } = await open(file);
    const ids = [...new Set(json.runs.flatMap((run) => run.plots.map((plot) => plot.id)))];
    const found = await page.locator('.plot-row').evaluateAll((rows) => rows.map((row) => row.dataset.plot));
    assert.deepEqual(found.filter((id) => !id.startsWith('overlay-')), ids);
    const ink = await page.locator('.uplot canvas').evaluateAll((all) => all.map((canvas) => {
      const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
      const colors = new Set(new Uint32Array(data.buffer));
      return colors.size;
    }));
    assert.equal(ink.length, (await counts(page)).plots);
    ink.forEach((colors, i) => assert.ok(colors > 8, `plot ${i} has ${colors} colours`));

    const row = page.locator('.plot-row:not([data-plot^=overlay])').first();
    const over = row.locator('.u-over').first();
    await over.scrollIntoViewIfNeeded();
    let area = await over.boundingBox();
    const point = (share) => [area.x + share * area.width, area.y + 0.5 * area.height];
    await page.mouse.click(...point(0.4));
    assert.ok(Math.abs((await time(page)) - 0.4 * duration) < 0.01 * duration, `click at 0.4 set ${await time(page)} of ${duration}`);
    const lines = await page.locator('.now').evaluateAll((all) => all.map((line) => (new DOMMatrix(getComputedStyle(line).transform).e / line.parentElement.clientWidth)));
    lines.forEach((share) => assert.ok(Math.abs(share - 0.4) < 0.01, `a time line stands at ${share}`));

    // Dragging the time line moves the time and does not zoom.
    await page.mouse.move(...point(0.4));
    await page.mouse.down();
    await page.mouse.move(...point(0.7), { steps: 5 });
    await page.mouse.up();
    assert.ok(Math.abs((await time(page)) - 0.7 * duration) < 0.01 * duration);
    assert.deepEqual(await page.evaluate(() => window.hamelin.zoom()), [0, duration]);

    // Values under the cursor come from the run.
    await page.mouse.move(...point(0.25));
    await settle(page);
    const plot = json.runs[0].plots.find((candidate) => candidate.id === ids[0]);
    const [t, y] = [unpack(plot.t), unpack(plot.series[0].y)];
    const k = Math.max(1, t.findIndex((x) => x >= 0.25 * duration));
    const near = y.slice(Math.max(0, k - Math.ceil(0.01 * t.length) - 2), k + Math.ceil(0.01 * t.length) + 2);
    const shown = Number((await row.locator('.legend .value').first().textContent()).replaceAll('−', '-'));
    const slack = 1e-3 * Math.max(...near.map(Math.abs));
    assert.ok(shown >= Math.min(...near) - slack && shown <= Math.max(...near) + slack, `value ${shown} where the run has ${Math.min(...near)} to ${Math.max(...near)}`);

    const reset = page.getByRole('button', { name: 'Reset zoom' });
    assert.ok(await reset.isDisabled());
    await page.mouse.move(...point(0.2));
    await page.mouse.down();
    await page.mouse.move(...point(0.5), { steps: 5 });
    await page.mouse.up();
    const zoom = await page.evaluate(() => window.hamelin.zoom());
    assert.ok(Math.abs(zoom[0] - 0.2 * duration) < 0.01 * duration && Math.abs(zoom[1] - 0.5 * duration) < 0.01 * duration, `zoom ${zoom}`);
    const out = await page.locator('.now').evaluateAll((all) => all.map((line) => line.style.visibility));
    assert.ok(out.every((state) => state === 'hidden'), 'the time line is drawn outside the zoom');
    await reset.scrollIntoViewIfNeeded();
    await reset.click();
    assert.deepEqual(await page.evaluate(() => window.hamelin.zoom()), [0, duration]);

    const button = row.locator('.legend button').first();
    const canvas = row.locator('canvas').first();
    const data = () => canvas.evaluate((c) => c.toDataURL());
    await settle(page);
    const full = await data();
    await button.click();
    await settle(page);
    assert.notEqual(await data(), full);
    assert.equal(await button.getAttribute('aria-pressed'), 'false');
    await button.click();
    await settle(page);
    assert.equal(await data(), full);

    const log = page.getByRole('checkbox', { name: 'log scale' });
    if (await log.count()) {
      const logRow = page.locator('.plot-row', { has: log.first() }).first();
      const before_ = await logRow.locator('canvas').first().evaluate((c) => c.toDataURL());
      await log.first().check();
      await settle(page);
      assert.notEqual(await logRow.locator('canvas').first().evaluate((c) => c.toDataURL()), before_);
    }
    area = null;
    assert.deepEqual(heard.errors, []);
    await page.close();
  });

  test(`${name}: light and dark`, async () => {
    const { page } = await open(file, { colorScheme: 'dark' });
    const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    const dark = await paper();
    const plot = () => page.locator('.uplot canvas').first().evaluate((c) => c.toDataURL());
    const inDark = await plot();
    const group = page.getByRole('group', { name: 'Colours' });
    await changes(page, 'light', () => group.getByRole('button', { name: 'Light' }).click());
    assert.notEqual(await paper(), dark);
    assert.notEqual(await plot(), inDark);
    await group.getByRole('button', { name: 'Auto' }).click();
    assert.equal(await paper(), dark);
    await page.emulateMedia({ colorScheme: 'light' });
    await settle(page);
    assert.notEqual(await paper(), dark);
    await page.close();
  });

  test(`${name}: events, panels, tables`, async () => {
    const { page } = await open(file);
    assert.equal(await page.locator('.panel').count(), json.runs.length);
    assert.equal(await page.locator('.comparison tbody tr').count(), json.runs.length);
    for (const [i, run] of json.runs.entries()) {
      assert.ok((await page.locator('.comparison tbody tr').nth(i).textContent()).includes(run.outcome));
    }
    if (json.runs.length > 1) {
      const aspects = await page.locator('.panel').evaluateAll((all) => all.map((panel) => Math.round(panel.clientWidth)));
      assert.ok(Math.max(...aspects) - Math.min(...aspects) <= 2, `panels of ${aspects}`);
      assert.ok((await page.locator('[data-plot^=overlay]').count()) > 0);
    }
    const timed = json.runs.flatMap((run) => run.events.filter((event) => event.t !== null));
    const ticks = page.locator('.event-ticks button');
    assert.equal(await ticks.count(), timed.length);
    if (timed.length) {
      const list = page.locator('details.section', { hasText: 'Events' }).first();
      await list.evaluate((details) => { details.open = true; });
      const last = timed.map((event) => event.t).sort((a, b) => a - b).at(-1);
      await list.locator('button.when').last().click();
      assert.ok(Math.abs((await time(page)) - last) < 1e-9);
      const index = json.runs.flatMap((run) => run.events).filter((event) => event.t !== null).findIndex((event) => event.t === last);
      await ticks.nth(index).hover();
      assert.ok((await page.locator('.event-tip').textContent()).length > 0);
      await setTime(page, 0);
      await ticks.nth(index).click();
      assert.ok(Math.abs((await time(page)) - last) < 1e-9);
    }
    for (const title of ['Configuration', 'Where it comes from']) {
      await page.locator('summary', { hasText: title }).click();
      assert.ok(await page.locator('details.section', { hasText: title }).locator('td').first().isVisible());
    }
    await page.close();
  });

  test(`${name}: fits windows of 800 to 1920 pixels`, async () => {
    const { page } = await open(file);
    for (const width of [800, 1280, 1920]) {
      await page.setViewportSize({ width, height: 900 });
      await settle(page);
      const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
      assert.ok(over <= 0, `${over} pixels too wide at ${width}`);
      const odd = await page.locator('.plot-host').evaluateAll((all) => all.filter((host) => Math.abs(host.clientWidth - host.firstElementChild.offsetWidth) > 2).length);
      assert.equal(odd, 0, `${odd} plots are not as wide as their place at ${width}`);
    }
    await page.close();
  });

  test(`${name}: without WebGL it says so, and the plots are there`, async () => {
    const { page, heard } = await open(file, {
      init: () => {
        const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
          return kind.includes('webgl') ? null : get.call(this, kind, ...rest);
        };
      },
    });
    assert.ok(await page.getByText('needs WebGL').isVisible());
    assert.deepEqual(heard.errors.filter((text) => text.startsWith('page:')), []);
    const ink = await page.locator('.uplot canvas').evaluateAll((all) => all.map((canvas) => new Set(new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer)).size));
    assert.ok(ink.length > 0 && ink.every((colors) => colors > 8));
    const pose = await page.evaluate(() => window.hamelin.pose(0));
    await setTime(page, middle);
    assert.notDeepEqual(await page.evaluate(() => window.hamelin.pose(0)), pose);
    const over = page.locator('.u-over').first();
    await over.scrollIntoViewIfNeeded();
    const area = await over.boundingBox();
    await page.mouse.click(area.x + 0.3 * area.width, area.y + 0.5 * area.height);
    assert.ok(Math.abs((await time(page)) - 0.3 * duration) < 0.01 * duration);
    await page.close();
  });

  test(`${name}: axe finds nothing to object to`, async (t) => {
    let axe;
    try {
      axe = readFileSync(lookUp.resolve('axe-core/axe.min.js'), 'utf8');
    } catch {
      t.skip('axe-core is not installed');
      return;
    }
    for (const colorScheme of ['light', 'dark']) {
      const { page } = await open(file, { colorScheme });
      await page.evaluate(() => document.querySelectorAll('details').forEach((details) => { details.open = true; }));
      await page.evaluate(axe);
      const found = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
      assert.deepEqual(found.violations.map(({ id, nodes }) => `${id}: ${nodes.length}× ${nodes[0].html.slice(0, 140)} ${nodes[0].failureSummary.slice(0, 200)}`), [], colorScheme);
      await page.close();
    }
  });
}

if (made.length) {
  test('small numbers keep their digits: no axis of the energy error reads only 0', async () => {
    const { page } = await open(made[0], {
      init: () => {
        // What the plots write on their canvases.
        window.written = [];
        const write = CanvasRenderingContext2D.prototype.fillText;
        CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
          window.written.push(text);
          return write.call(this, text, ...rest);
        };
      },
    });
    const written = await page.evaluate(() => window.written);
    assert.ok(written.some((text) => /^−?\d\.\d\de−16$/.test(text)), written.filter((text) => text.includes('e')).join(' '));
    await page.close();
  });

  test('an empty template says what is wrong', async () => {
    const page = await browser.newPage();
    await page.goto(pathToFileURL(path.resolve(process.env.HAMELIN_TEMPLATE)).href);
    await page.getByRole('alert').waitFor();
    assert.match(await page.getByRole('alert').textContent(), /hamelin puts the data into it/);
    await page.close();
  });
}

// Made-up runs in the report's container, for building and testing the page without the program.
//   node fixture.mjs TEMPLATE.html OUT_DIR
// writes one.html, two.html, three.html, four.html, everything.html and planar.html.
// The shapes and motions are invented; only the format (hamelin.report/1) is that of the program.
import { readFileSync, writeFileSync, mkdirSync } from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';
import { gzipSync } from 'node:zlib';

const TOKEN = '__HAMELIN_REPORT_DATA__';
const KINDS = { f64: Float64Array, f32: Float32Array, i32: Int32Array, u32: Uint32Array, i16: Int16Array, u16: Uint16Array, u8: Uint8Array };

/** Collects arrays and makes the container. */
class Pack {
  parts = [];
  size = 0;

  /**
   * Adds an array and returns its description; raw = (value − offset) / scale, NaN becomes none.
   */
  add(values, type, { scale = 1, offset = 0, none } = {}) {
    const raw = KINDS[type].from(values, (v) => (none !== undefined && Number.isNaN(v) ? none : type[0] === 'f' ? (v - offset) / scale : Math.round((v - offset) / scale)));
    const at = this.size;
    const bytes = Buffer.alloc(Math.ceil(raw.byteLength / 8) * 8);
    Buffer.from(raw.buffer).copy(bytes);
    this.parts.push(bytes);
    this.size += bytes.length;
    const description = { at, n: raw.length, type };
    if (scale !== 1 || offset !== 0) Object.assign(description, { scale, offset });
    if (none !== undefined) description.none = none;
    return description;
  }

  container(json) {
    const text = Buffer.from(JSON.stringify(json), 'utf8');
    const head = Buffer.alloc(Math.ceil((4 + text.length) / 8) * 8);
    head.writeUInt32LE(text.length, 0);
    text.copy(head, 4);
    return Buffer.concat([head, ...this.parts]);
  }
}

/** A generator of reproducible numbers in [0, 1). */
function random(seed) {
  let s = seed >>> 0;
  return () => {
    s = (Math.imul(s, 1664525) + 1013904223) >>> 0;
    return s / 4294967296;
  };
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const revolute = (name, axis, point, link) => ({ name, type: 'revolute', screw: [...axis, ...cross(point, axis)], link });

/** An arm with six joints, one of them prismatic, 1.2 m long, upright at q = 0. */
function arm() {
  const skeleton = [[0, 0, 0.3], [0, 0, 0.34], [0, 0, 0.7], [0.06, 0, 0.72], [0.06, 0, 1.05], [0.06, 0, 1.05], [0.06, 0, 1.22]];
  const joints = [
    revolute('turn', [0, 0, 1], skeleton[0], 'post'),
    revolute('shoulder', [0, 1, 0], skeleton[1], 'upper'),
    revolute('elbow', [0, 1, 0], skeleton[2], 'elbow'),
    revolute('roll', [0, 0, 1], skeleton[3], 'fore'),
    revolute('wrist', [0, 1, 0], skeleton[4], 'hand'),
    { name: 'reach', type: 'prismatic', screw: [0, 0, 0, 0, 0, 1], link: 'rod' },
  ];
  const spheres = [];
  const fill = (link, from, to, radius, count) => {
    for (let i = 0; i < count; ++i) {
      const s = (i + 0.5) / count;
      spheres.push({ link, center_m: from.map((c, k) => c + s * (to[k] - c)), radius_m: radius, shape: spheres.length });
    }
  };
  fill(0, [0, 0, 0.12], [0, 0, 0.34], 0.085, 3);
  fill(1, skeleton[1], skeleton[2], 0.075, 7);
  fill(2, skeleton[2], skeleton[3], 0.07, 2);
  fill(3, skeleton[3], skeleton[4], 0.06, 7);
  fill(4, skeleton[4], [0.06, 0, 1.12], 0.05, 2);
  fill(5, [0.06, 0, 1.14], skeleton[6], 0.04, 3);
  return {
    name: 'arm6',
    base: { position_m: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0] },
    joints, skeleton, spheres, shapes: spheres.length, tip_link: 5, segments: [], planar_normal: null,
  };
}

/** A planar arm of three bars of 1 m in the x-y plane. */
function bars() {
  const skeleton = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]];
  const joints = [0, 1, 2].map((i) => revolute(`joint${i + 1}`, [0, 0, 1], skeleton[i], `link${i + 1}`));
  const spheres = [];
  const segments = [];
  for (let i = 0; i < 3; ++i) {
    segments.push({ link: i, from_m: skeleton[i], to_m: skeleton[i + 1], radius_m: 0 });
    for (let k = 0; k <= 20; ++k) spheres.push({ link: i, center_m: [i + k / 20, 0, 0], radius_m: 0.03, shape: spheres.length });
  }
  return {
    name: 'planar3',
    base: { position_m: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0] },
    joints, skeleton, spheres, shapes: spheres.length, tip_link: 2, segments, planar_normal: [0, 0, 1],
  };
}

/** Rotation and position of exp(S q), computed without the page's code. */
function displacement(S, q) {
  const w = S.slice(0, 3);
  const v = S.slice(3);
  if (Math.hypot(...w) === 0) return { R: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], p: v.map((c) => c * q) };
  const s = Math.sin(q);
  const c = Math.cos(q);
  const K = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]];
  const KK = K.map((_, i) => K.map((__, j) => w[i] * w[j] - (i === j ? 1 : 0)));
  const R = K.map((_, i) => K.map((__, j) => (i === j ? 1 : 0) + s * K[i][j] + (1 - c) * KK[i][j]));
  const p = [0, 1, 2].map((i) => [0, 1, 2].reduce((sum, j) => sum + ((i === j ? q : 0) + (1 - c) * K[i][j] + (q - s) * KK[i][j]) * v[j], 0));
  return { R, p };
}

function place(robot, q, link, point) {
  let p = point;
  for (let i = link; i >= 0; --i) {
    const { R, p: shift } = displacement(robot.joints[i].screw, q[i]);
    p = R.map((row, k) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + shift[k]);
  }
  return p;
}

/** A map of a rack and scattered bricks: `count` cells of 2 cm, and two of 8 cm. */
function rack(pack, count) {
  const cells = new Map();
  const put = (x, y, z) => cells.size < count && cells.set(`${x},${y},${z}`, [x, y, z]);
  const box = (lo, hi) => {
    for (let x = lo[0]; x < hi[0]; ++x) for (let y = lo[1]; y < hi[1]; ++y) for (let z = lo[2]; z < hi[2]; ++z) put(x, y, z);
  };
  box([22, -32, 4], [44, 32, 6]);
  for (const z of [20, 36, 52]) box([26, -30, z], [42, 30, z + 1]);
  for (const y of [-30, 0, 29]) box([26, y, 4], [42, y + 1, 56]);
  box([42, -30, 4], [43, 30, 56]);
  const rand = random(3);
  while (cells.size < count) {
    const a = rand() * 6.2832;
    const r = 36 + 14 * rand();
    const corner = [Math.round(r * Math.cos(a)), Math.round(r * Math.sin(a)), Math.round(50 * rand())];
    if (corner[0] > 15) continue;
    const size = 3 + Math.floor(5 * rand());
    box(corner, corner.map((c) => c + size));
  }
  const list = [...cells.values()];
  list.push([-60, -60, 0], [-60, 56, 0]);
  const level = new Array(list.length).fill(0);
  level[level.length - 1] = 2;
  level[level.length - 2] = 2;
  return {
    file: 'maps/rack.bt', resolution_m: 0.02, position_m: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0],
    lo: pack.add(list.flat(), 'i16'), level: pack.add(level, 'u8'), left_out: 0,
  };
}

const series = (pack, label, values) => ({ label, y: pack.add(values, 'f32') });

/**
 * One run along invented joint paths. `bend` gives the joint values at a time and differs between
 * the runs.
 */
function makeRun(pack, { name, world, worldIndex, planner, duration, outcome, bend, channels, nearest, goalsAt, tip }) {
  const robot = world.robot;
  const n = robot.joints.length;
  const F = Math.round(duration * 40) + 1;
  const t = Array.from({ length: F }, (_, k) => (k * duration) / (F - 1));
  const path = (s, i) => bend(s, i, duration);
  const q = t.flatMap((time) => robot.joints.map((_, i) => path(time, i)));
  const rows = t.map((_, k) => q.slice(k * n, k * n + n));
  const influence = 0.2 * (robot.planar_normal ? 2 : 1);
  const clearance = rows.map((row) => robot.spheres.map((s) => {
    const p = place(robot, row, s.link, s.center_m);
    const d = nearest(p).distance - s.radius_m;
    return d > influence ? NaN : d;
  }));
  const least = rows.map((row, k) => Math.min(...clearance[k].map((d) => (Number.isNaN(d) ? influence : d))));
  const counts = [];
  const points = [];
  rows.forEach((row, k) => {
    const order = clearance[k].map((d, i) => [d, i]).filter(([d]) => !Number.isNaN(d)).sort((a, b) => a[0] - b[0]).slice(0, 4);
    counts.push(order.length);
    for (const [, i] of order) {
      const s = robot.spheres[i];
      const c = place(robot, row, s.link, s.center_m);
      const to = nearest(c).point;
      const length = Math.hypot(...to.map((x, a) => x - c[a])) || 1;
      points.push(...c.map((x, a) => x + ((to[a] - x) * s.radius_m) / length), ...to);
    }
  });
  const tips = rows.map((row) => place(robot, row, robot.tip_link, robot.skeleton[n]));
  const forces = channels.map((channel, c) => ({
    channel,
    f: pack.add(t.flatMap((time, k) => [
      (6 - c) * Math.cos(time * (0.7 + c)) * (1 + c), (5 - c) * Math.sin(time * (0.9 + c)), robot.planar_normal ? 0 : 4 * Math.cos(0.5 * time + c),
    ].map((f) => f * (k / F < 0.95 ? 1 : 0))), 'f32'),
  }));
  const goalIndex = t.map((time) => goalsAt.filter((g) => time >= g).length);
  const goalDistance = tips.map((p, k) => {
    const target = tip(Math.min(goalIndex[k], world.goals.length - 1));
    return Math.hypot(...p.map((c, a) => c - target[a]));
  });
  const fine = Array.from({ length: 4 * F }, (_, k) => (k * duration) / (4 * F - 1));
  const T = pack.add(fine, 'f64');
  const noise = random(name.length + F);
  const plots = [
    { id: 'q', title: 'joint angles', unit: 'rad', t: T, series: robot.joints.map((j, i) => series(pack, j.name, fine.map((s) => path(s, i)))), marks: [] },
    { id: 'v', title: 'joint rates', unit: 'rad/s', t: T, series: robot.joints.map((j, i) => series(pack, j.name, fine.map((s) => (path(s + 1e-3, i) - path(s - 1e-3, i)) / 2e-3))), marks: [] },
    { id: 'tau', title: 'joint torques', unit: 'N m', t: T, series: robot.joints.map((j, i) => series(pack, j.name, fine.map((s) => 12 * Math.cos(s * (1 + 0.2 * i)) / (1 + i)))), marks: [] },
    { id: 'clearance', title: 'clearance', unit: 'm', t: pack.add(t, 'f64'), series: [series(pack, 'smallest clearance', least)], marks: [{ y: 0.02, label: 'margin' }] },
    { id: 'goal', title: 'distance to the goal', unit: 'm', t: pack.add(t, 'f64'), series: [series(pack, 'tip to goal', goalDistance)], marks: [{ y: 0.01, label: 'tolerance' }] },
    { id: 'energy', title: 'energy account', unit: 'J', t: T, series: [
      series(pack, 'kinetic', fine.map((s) => 2.1 * Math.sin(s) ** 2)), series(pack, 'potential', fine.map((s) => 35 + 6 * Math.cos(0.6 * s))),
      series(pack, 'dissipated', fine.map((s) => 1.4 * s)), series(pack, 'gyroscopic work', fine.map((s) => 1e-14 * Math.sin(9 * s))),
    ], marks: [] },
    { id: 'energy_error', title: 'energy error', unit: 'J', t: T, series: [series(pack, 'energy error', fine.map((s) => 1.3e-16 * s * Math.sin(7 * s)))], marks: [] },
    { id: 'solver', title: 'solver updates per step', unit: '1', t: T, series: [series(pack, 'updates', fine.map((s) => 2 + Math.floor(2.2 * noise())))], marks: [] },
    { id: 'tick_us', title: 'time of one tick', unit: 'µs', t: T, series: [series(pack, 'tick', fine.map(() => 60 + 25 * noise() + (noise() > 0.995 ? 400 : 0)))], marks: [{ y: 1000, label: 'one step' }] },
  ];
  const events = [
    { t: 0, text: 'start' },
    ...goalsAt.map((g, i) => ({ t: g, text: `goal ${i + 1} reached` })),
    { t: duration * 0.62, text: 'safety filter active for 12 ticks' },
    { t: null, text: 'written without a wall clock' },
  ];
  // A stop of the shield that ends 0.1 rad farther on in each joint; none of the planar arm.
  const stops = robot.planar_normal ? [] : [[0.31, 'map', 0.012], [0.55, 'joint_limit', 0.08]].map(([share, cause, length]) => {
    const from = share * duration;
    const row = robot.joints.map((_, i) => path(from, i));
    return { t: from, until: from + length, cause, q: row, q_end: row.map((x) => x + 0.1) };
  });
  // What the arm does about moving obstacles; nothing in the planar run.
  const acts = robot.planar_normal ? [] : [[0.2, 'aside', 0.8], [0.4, 'stop', 0.12], [0.42, 'back', 0.5]].map(([share, act, length]) => (
    { t: share * duration, until: share * duration + length, act }));
  const result = {
    schema: 'hamelin.result/1', version: '0.1.0', scene: 'rack.json', planner, integrator: 'hamel-variational', outcome, cause: outcome === 'reached' ? null : 'the tip stood still 0.31 m from the goal',
    time_s: duration, steps: Math.round(duration * 1000), energy_initial_J: 41.2, energy_final_J: 38.9, energy_error_max_J: 1.3e-13,
    min_clearance_m: Math.min(...least), goal: { type: 'position', error_m: goalDistance.at(-1), error_rad: null, index: goalsAt.length, count: world.goals.length },
    solver: { updates_mean: 2.31 + 0.1 * n, updates_max: 5, factorizations_mean: 0.12, evaluations: 41210, halvings: 0, residual_max: 8.1e-13, criterion: 'scaled momentum', tolerance: 1e-12 },
    gyroscopic_work_J: 3e-15, filter_work_J: 0, recovery_work_J: 0, dissipated_J: 1.4 * duration, held_work_J: 0, node_work_J: null,
    certified_share: 1, tightest_step_m: 0.0193, seed: 7, warnings: [],
    timing: { cpu_s: 1.91, tick_us: { p50: 71.2, p99: 118.4, max: 512.0 } },
  };
  return {
    name, log: `${name}.jsonl`, world: worldIndex, scene: 'data/scenes/rack.json', planner, integrator: 'hamel-variational', outcome, cause: result.cause, result,
    config: { step_s: 0.001, planner: { name: planner, params: { margin_m: 0.02, cruise_speed_rad_s: 0.8 } }, gravity_m_s2: [0, 0, -9.81] },
    provenance: { hamelin: { version: '0.1.0', git_commit: '0123456789abcdef', git_dirty: false }, build: { compiler: 'g++ 12', type: 'Release' }, argv: ['hamelin', 'run', 'rack.json'] },
    notes: name === 'gyro' ? ['every tenth tick was logged; extrema are over all ticks'] : [],
    frames: {
      t: pack.add(t, 'f64'), q: pack.add(q, 'f32'), goal_index: pack.add(goalIndex, 'u8'),
      clearance: pack.add(clearance.flat(), 'u16', { scale: 1e-5, offset: 0, none: 65535 }), influence_m: influence,
      contacts: { count: pack.add(counts, 'u8'), points: pack.add(points, 'i16', { scale: 2e-4, offset: 0 }) },
      forces,
    },
    events, stops, acts, plots,
  };
}

const RACK_FACE = (p) => {
  const point = [Math.max(0.52, p[0]), Math.min(0.6, Math.max(-0.6, p[1])), Math.min(0.74, Math.max(0.72, p[2]))];
  return { point, distance: Math.hypot(...point.map((c, i) => c - p[i])) };
};

/** Where `swinging` is at a time, which is also what is predicted of it. */
export const swingingAt = (t) => [0.4, -0.5 + 0.2 * Math.sin(Math.PI * t), 0.9];

/** A capsule that swings and turns, given by samples of its pose, with a period of 2 s. */
function swinging(pack) {
  const ahead = [0.2, 0.6, 1];
  const now = Array.from({ length: 201 }, (_, k) => k / 20);
  const predicted = {
    type: 'path', ahead_s: ahead, nearer_m: [0, 0, 0], t: pack.add(now, 'f64'),
    position_m: pack.add(now.flatMap((time) => ahead.flatMap((later) => swingingAt(time + later))), 'i16', { scale: 1e-4, offset: 0 }),
    quaternion_wxyz: pack.add(now.flatMap((time) => ahead.flatMap((later) => {
      const y = Math.sin(Math.PI * (time + later));
      return [Math.cos(y / 2), Math.sin(y / 2), 0, 0];
    })), 'i16', { scale: 1e-4, offset: 0 }),
  };
  const t = Array.from({ length: 401 }, (_, k) => k / 40);
  const s = t.map((time) => Math.sin(Math.PI * time));
  return {
    name: 'swinging', shape: 'capsule', radius_m: 0.05, length_m: 0.2, position_m: [0.4, -0.5, 0.9], quaternion_wxyz: [1, 0, 0, 0], motion: null,
    poses: {
      t: pack.add(t, 'f64'),
      position_m: pack.add(s.flatMap((y) => [0.4, -0.5 + 0.2 * y, 0.9]), 'i32', { scale: 1e-5 }),
      quaternion_wxyz: pack.add(s.flatMap((y) => [Math.cos(y / 2), Math.sin(y / 2), 0, 0]), 'i32', { scale: 1e-5 }),
    },
    predicted, appears_s: 0, judge_only: false,
  };
}

/** The prediction of a ball of which only the speed is bounded, by 0.5 m/s. */
function bounded(pack, at) {
  const now = Array.from({ length: 201 }, (_, k) => k / 20);
  return {
    type: 'speed-bound', ahead_s: [0.1, 0.2], nearer_m: [0.05, 0.1], t: pack.add(now, 'f64'),
    position_m: pack.add(now.flatMap((time) => [at(time), at(time)].flat()), 'i16', { scale: 1e-4, offset: 0 }), quaternion_wxyz: null,
  };
}

/**
 * The container of one to four runs of the six-joint arm, of one planar run, or of "everything":
 * two runs that together have something for each control of the page.
 */
export function container(kind) {
  const pack = new Pack();
  if (kind === 'planar') {
    const obstacle = [1.7, 1.5, 0];
    const world = {
      robot: bars(), goals: [{ type: 'position', position_m: [0.4, 2.6, 0], tolerance_m: 0.02 }], map: null,
      obstacles: [
        { name: 'ball', shape: 'sphere', radius_m: 0.3, position_m: obstacle, quaternion_wxyz: [1, 0, 0, 0], motion: null, appears_s: 0, judge_only: false },
        { name: 'swing', shape: 'box', size_m: [0.3, 0.3, 0.3], position_m: [-1.6, 1, 0], quaternion_wxyz: [1, 0, 0, 0], motion: { amplitude_m: [0, 0.8, 0], period_s: 4 }, appears_s: 0, judge_only: false },
        { name: 'late', shape: 'cylinder', radius_m: 0.2, length_m: 0.5, position_m: [-1, -1.6, 0], quaternion_wxyz: [1, 0, 0, 0], motion: null, appears_s: 3, judge_only: true },
      ],
      reach_m: 3,
    };
    const nearest = (p) => {
      const d = Math.hypot(...p.map((c, i) => c - obstacle[i])) || 1;
      return { distance: d - 0.3, point: obstacle.map((c, i) => c + (0.3 * (p[i] - c)) / d) };
    };
    const run = makeRun(pack, {
      name: 'bars', world, worldIndex: 0, planner: 'gyro', duration: 6, outcome: 'reached', channels: ['potential', 'gyroscopic'], nearest, goalsAt: [5.8],
      tip: (i) => world.goals[i].position_m, bend: (s, i) => [0.35 * s - 0.3, 0.12 * s, 0.2 + 0.1 * Math.sin(s)][i],
    });
    return pack.container({ format: 'hamelin.report/1', generator: 'hamelin 0.1.0', title: 'bars.json', worlds: [world], runs: [run] });
  }
  const everything = kind === 'everything';
  const robot = arm();
  const ghost = [-0.9, -0.5, 1.4, 0.3, 0.7, 0.05];
  const world = {
    robot,
    goals: [
      { type: 'pose', position_m: [0.5, 0.22, 0.92], quaternion_wxyz: [0.7071067811865476, 0, 0.7071067811865476, 0], tolerance_m: 0.01 },
      { type: 'joint', q: ghost },
      { type: 'position', position_m: [0.44, -0.3, 0.6], tolerance_m: 0.01 },
    ],
    map: rack(pack, everything ? 8000 : 20000),
    obstacles: [
      { name: 'drifter', shape: 'sphere', radius_m: 0.07, position_m: [0.35, 0.45, 0.95], quaternion_wxyz: [1, 0, 0, 0], motion: { amplitude_m: [0, 0.3, 0], period_s: 4 }, predicted: bounded(pack, (t) => [0.35, 0.45 + 0.3 * Math.sin((Math.PI * t) / 2), 0.95]), appears_s: 0, judge_only: false },
      ...(everything ? [{ name: 'late', shape: 'cylinder', radius_m: 0.1, length_m: 0.3, position_m: [-0.4, -0.4, 0.8], quaternion_wxyz: [1, 0, 0, 0], motion: null, appears_s: 3, judge_only: true }, swinging(pack)] : []),
    ],
    reach_m: 1.2,
  };
  const tips = [world.goals[0].position_m, place(robot, ghost, 5, robot.skeleton[6]), world.goals[2].position_m];
  const runs = [
    { name: 'hybrid', duration: 8, outcome: 'reached', channels: ['potential', 'damping', 'gyroscopic'], goalsAt: [2.4, 5.0, 7.9], w: 1 },
    { name: 'apf', duration: 9.5, outcome: 'stalled', channels: ['potential', 'damping'], goalsAt: [3.1], w: 0.72 },
    { name: 'gyro', duration: 7, outcome: 'timeout', channels: ['gyroscopic', 'held', 'node'], goalsAt: [2.9, 6.1], w: 1.2 },
    { name: 'hybrid, fast', duration: 5, outcome: 'collision', channels: ['potential'], goalsAt: [2], w: 1.5 },
  ];
  const chosen = everything ? [runs[0], runs[2]] : runs.slice(0, { one: 1, two: 2, three: 3, four: 4 }[kind]);
  const made = chosen.map(({ w, ...rest }) => makeRun(pack, {
    ...rest, world, worldIndex: 0, planner: rest.name, nearest: RACK_FACE, tip: (i) => tips[i],
    bend: (s, i) => [
      0.75 * Math.sin(0.9 * w * s), 0.35 + 0.3 * Math.sin(0.7 * w * s + 0.4), 0.95 + 0.35 * Math.sin(0.8 * w * s),
      0.5 * Math.sin(0.6 * w * s), 0.45 + 0.5 * Math.sin(1.1 * w * s), 0.03 + 0.03 * Math.sin(s),
    ][i],
  }));
  return pack.container({ format: 'hamelin.report/1', generator: 'hamelin 0.1.0', title: 'rack.json', worlds: [world], runs: made });
}

/** A complete page: the template filled with the container, as `hamelin report` makes it. */
export function page(template, kind) {
  const pieces = template.split(TOKEN);
  if (pieces.length !== 2) throw new Error(`the template contains the token ${pieces.length - 1} times, expected once`);
  return pieces.join(gzipSync(container(kind)).toString('base64'));
}

/** Writes the pages and returns their paths. */
export function writePages(templateFile, folder, kinds = ['everything', 'planar']) {
  const template = readFileSync(templateFile, 'utf8');
  mkdirSync(folder, { recursive: true });
  return kinds.map((kind) => {
    const file = path.join(folder, `${kind}.html`);
    writeFileSync(file, page(template, kind));
    return file;
  });
}

if (import.meta.url === pathToFileURL(process.argv[1] ?? '').href) {
  const [template, folder] = process.argv.slice(2);
  if (!folder) {
    process.stderr.write('fixture.mjs: expected TEMPLATE.html OUT_DIR\n');
    process.exit(1);
  }
  for (const file of writePages(template, folder, ['one', 'two', 'three', 'four', 'everything', 'planar'])) process.stdout.write(`${file}\n`);
}

// Writes a sweep of made-up runs, to measure how merge and page grow with their number:
//   node make_study.mjs RUNS FOLDER
// FOLDER/plan.json and FOLDER/records.jsonl have the members that `hamelin sweep merge` reads. The
// same number gives the same bytes. The scenes do not exist, so the runs cannot be repeated.
import { createHash } from 'node:crypto';
import { closeSync, mkdirSync, openSync, writeFileSync, writeSync } from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const PLANNERS = ['apf', 'gyro', 'hybrid', 'mppi'];
const SPEEDS = ['0.5', '1', '1.5', '2'];
const MARGINS = ['0.005', '0.01', '0.02'];

/** Uniform numbers in [0, 1) from a linear congruential generator. */
function generator(seed) {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

function plannedRuns(count) {
  const runs = [];
  const scenes = new Map();
  for (let k = 0; runs.length < count; ++k) {
    const problem = `clutter-${Math.floor(k / (SPEEDS.length * MARGINS.length))}`;
    const scene = `scenes/${problem}-joint.json`;
    scenes.set(scene, { file: scene, sha256: '0'.repeat(64), feasible: scenes.size % 11 !== 10, ...(scenes.size % 11 === 10 && { reason: 'goal 1: hand/1 in the map, 0.0010 m deep' }) });
    const values = [`/planner/params/cruise_speed=${SPEEDS[k % SPEEDS.length]}`, `/planner/params/margin_m=${MARGINS[Math.floor(k / SPEEDS.length) % MARGINS.length]}`];
    for (const planner of PLANNERS.slice(0, count - runs.length)) {
      const labels = { family: 'clutter', goal: 'joint', map: 'cells', planner, problem, seed: '1', values: values.join(' ') };
      runs.push({ id: `${problem}-joint/${planner}/${values.join(' ')}/s1`, scene, planner, set: values, seed: 1, labels });
    }
  }
  return { runs, scenes: [...scenes.values()] };
}

/** A record with an outcome that depends on the planner. */
function record(run, plan, random) {
  const skill = 0.3 + 0.2 * PLANNERS.indexOf(run.planner);
  const dice = random();
  const time = 2 + 6 * random();
  const contact = dice > 0.97;
  const [outcome, cause] = dice < skill ? ['reached', null]
    : dice < skill + 0.1 ? ['timeout', 'goal not reached within 10 s']
      : dice < 0.93 ? ['stalled', `force balance: the obstacle next to link 'link${1 + Math.floor(7 * random())}' balances the attraction to the goal`]
        : ['collision', `sphere ${Math.floor(9 * random())} of link 'hand' is ${(3 * random()).toFixed(2)} mm inside the map at ${time.toFixed(3)} s; the exit direction is (${random() < 0.5 ? '-' : ''}0.${Math.floor(100 * random())}, 0, 1)`];
  const p50 = 5 + 10 * random();
  const closest = { clearance_m: contact ? -0.003 * random() : 0.05 * random() + 1e-4, time_s: 0.5 * time, sphere: 'hand/3', other: 'map' };
  return {
    schema: 'hamelin.record/1', plan, id: run.id, labels: run.labels, outcome: contact ? 'collision' : outcome, cause,
    result: {
      type: 'result', outcome, cause, time_s: outcome === 'timeout' ? 10 : time, certified_share: 1 - 0.001 * random(), min_clearance_m: Math.abs(closest.clearance_m), filter_work_J: -0.1, recovery_work_J: random(),
      escape: { count: 1 }, timing: { cpu_s: 0.1, tick_us: { p50, p99: 2 * p50, max: 9 * p50 } },
    },
    judge: { contact, obstacles: closest, self: null, configurations: 1000 }, crash: null,
  };
}

/** Writes the study; returns the planned runs. */
export function makeStudy(count, folder) {
  mkdirSync(folder, { recursive: true });
  const { runs, scenes } = plannedRuns(count);
  const text = `${JSON.stringify({ schema: 'hamelin.sweep/1', scenes, inputs: [], plugins: [], runs }, null, 1)}\n`;
  writeFileSync(path.join(folder, 'plan.json'), text);
  const plan = createHash('sha256').update(text).digest('hex');
  const random = generator(1);
  const file = openSync(path.join(folder, 'records.jsonl'), 'w');
  for (const run of runs) writeSync(file, `${JSON.stringify(record(run, plan, random))}\n`);
  closeSync(file);
  return runs;
}

if (process.argv[1] && import.meta.url === pathToFileURL(process.argv[1]).href) {
  const [count, folder] = process.argv.slice(2);
  if (!/^[1-9]\d*$/.test(count ?? '') || !folder) {
    process.stderr.write('make_study.mjs: expected RUNS FOLDER\n');
    process.exit(1);
  }
  makeStudy(Number(count), folder);
}

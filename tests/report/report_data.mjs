// The data of a report's page, read and evaluated without the page's code.
import { readFileSync } from 'node:fs';
import { gunzipSync } from 'node:zlib';

const READ = {
  f64: [8, 'readDoubleLE'], f32: [4, 'readFloatLE'], i32: [4, 'readInt32LE'], u32: [4, 'readUInt32LE'], i16: [2, 'readInt16LE'], u16: [2, 'readUInt16LE'], u8: [1, 'readUInt8'],
};

/** The container in a page: its JSON and the bytes of its arrays. */
export function readContainer(file) {
  const text = /<script id="hamelin-data"[^>]*>([^<]*)<\/script>/.exec(readFileSync(file, 'utf8'))[1];
  const bytes = gunzipSync(Buffer.from(text, 'base64'));
  const length = bytes.readUInt32LE(0);
  return { json: JSON.parse(bytes.subarray(4, 4 + length).toString('utf8')), blob: bytes.subarray(Math.ceil((4 + length) / 8) * 8) };
}

/**
 * The data of a report: its JSON, a function that unpacks its arrays, and a list of its contents.
 */
export function readData(file) {
  const { json, blob } = readContainer(file);
  const unpack = ({ at, n, type, scale = 1, offset = 0, none }) => {
    const [size, method] = READ[type];
    return Array.from({ length: n }, (_, i) => {
      const raw = blob[method](at + size * i);
      return raw === none ? NaN : offset + scale * raw;
    });
  };
  const worldOf = (run) => json.worlds[run.world];
  const duration = Math.max(...json.runs.map((run) => unpack(run.frames.t).at(-1)));
  return { json, unpack, worldOf, duration, middle: 0.45 * duration, has: contents(json, unpack, worldOf) };
}

/** Which of the objects that a page can show the runs have. */
function contents(json, unpack, worldOf) {
  return {
    map: json.runs.some((run) => worldOf(run).map?.level.n > 0),
    spheres: json.runs.some((run) => run.frames.clearance),
    contacts: json.runs.some((run) => run.frames.contacts && unpack(run.frames.contacts.count).some((count) => count > 0)),
    forces: json.runs.some((run) => run.frames.forces.some((force) => unpack(force.f).some((f) => Math.abs(f) > 0))),
    goals: json.runs.some((run) => worldOf(run).goals.length),
    moving: json.runs.some((run) => worldOf(run).obstacles?.some((o) => o.motion || o.poses)),
    predicted: json.runs.some((run) => worldOf(run).obstacles?.some((o) => o.predicted)),
    late: json.runs.some((run) => worldOf(run).obstacles?.some((o) => o.appears_s > 0)),
    events: json.runs.some((run) => run.events.some((event) => event.t !== null)),
    several: json.runs.length > 1,
  };
}

// ---- Independent kinematics: matrix exponential by power series, with scaling and squaring ----

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

export function tipOf(robot, q) {
  const [w, x, y, z] = robot.base.quaternion_wxyz;
  // v → q v q*, applied to the columns of the identity
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

/** The joints of a run at a time, interpolated linearly between its frames. */
export function jointsAt(run, unpack, n, time) {
  const t = unpack(run.frames.t);
  const q = unpack(run.frames.q);
  const k = Math.max(0, t.findLastIndex((x) => x <= time));
  const a = k + 1 < t.length ? (time - t[k]) / (t[k + 1] - t[k]) : 0;
  return Array.from({ length: n }, (_, j) => q[k * n + j] + (a > 0 ? a * (q[(k + 1) * n + j] - q[k * n + j]) : 0));
}

/**
 * The number of cells of a world's map within a distance of the arm, as lower and upper bound,
 * because the page computes in single precision.
 */
export function cellsWithin({ robot, map }, unpack, joints, distance) {
  const balls = robot.spheres.map((s) => ({ c: tipOf({ ...robot, tip_link: s.link, skeleton: [s.center_m] }, joints), r: s.radius_m }));
  const lo = unpack(map.lo);
  const level = unpack(map.level);
  let least = 0;
  let most = 0;
  for (let v = 0; v < level.length; ++v) {
    const size = map.resolution_m * 2 ** level[v];
    const from = [0, 1, 2].map((axis) => lo[3 * v + axis] * map.resolution_m);
    const gap = Math.min(...balls.map(({ c, r }) => Math.hypot(...from.map((f, axis) => Math.max(f - c[axis], 0, c[axis] - f - size))) - r));
    if (gap <= distance - 1e-6) ++least;
    if (gap <= distance + 1e-6) ++most;
  }
  return { least, most };
}

// Product of exponentials: T_i(q) = base · exp(S_1 q_1) … exp(S_i q_i), with the screws
// S_i = [ω; v] of the joints in the base frame at q = 0. A pose has 12 numbers: the rotation row by
// row, then the position.

/** @typedef {Float64Array} Pose */

/** The pose with a position and a quaternion [w, x, y, z]. @returns {Pose} */
export function poseOf(position = [0, 0, 0], quaternion = [1, 0, 0, 0]) {
  const norm = Math.hypot(...quaternion) || 1;
  const [w, x, y, z] = quaternion.map((c) => c / norm);
  // prettier-ignore
  return Float64Array.of(
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ...position);
}

/** out = a · b; out may be neither a nor b. */
export function compose(a, b, out) {
  for (let r = 0; r < 3; ++r) {
    const [x, y, z] = [a[3 * r], a[3 * r + 1], a[3 * r + 2]];
    for (let c = 0; c < 3; ++c) out[3 * r + c] = x * b[c] + y * b[3 + c] + z * b[6 + c];
    out[9 + r] = x * b[9] + y * b[10] + z * b[11] + a[9 + r];
  }
  return out;
}

/** Transforms point p from the pose's frame to the frame in which the pose is given. */
export function transform(pose, p, out = [0, 0, 0]) {
  const [x, y, z] = p;
  out[0] = pose[0] * x + pose[1] * y + pose[2] * z + pose[9];
  out[1] = pose[3] * x + pose[4] * y + pose[5] * z + pose[10];
  out[2] = pose[6] * x + pose[7] * y + pose[8] * z + pose[11];
  return out;
}

/** Rotates direction d by the pose. */
export function rotate(pose, d, out = [0, 0, 0]) {
  const [x, y, z] = d;
  out[0] = pose[0] * x + pose[1] * y + pose[2] * z;
  out[1] = pose[3] * x + pose[4] * y + pose[5] * z;
  out[2] = pose[6] * x + pose[7] * y + pose[8] * z;
  return out;
}

/** out = exp(S q), by Rodrigues' formula; a screw without rotation is a translation. */
export function exponential(S, q, out) {
  const rate = Math.hypot(S[0], S[1], S[2]);
  if (rate < 1e-12) {
    out.set([1, 0, 0, 0, 1, 0, 0, 0, 1, S[3] * q, S[4] * q, S[5] * q]);
    return out;
  }
  const [x, y, z] = [S[0] / rate, S[1] / rate, S[2] / rate];
  const angle = rate * q;
  const s = Math.sin(angle);
  const c1 = 1 - Math.cos(angle);
  // prettier-ignore
  out.set([
    1 - c1 * (y * y + z * z), c1 * x * y - s * z, c1 * x * z + s * y,
    c1 * x * y + s * z, 1 - c1 * (x * x + z * z), c1 * y * z - s * x,
    c1 * x * z - s * y, c1 * y * z + s * x, 1 - c1 * (x * x + y * y)]);
  // With S = [s; v], the unit axis ω = s / |s| and the angle θ = |s| q:
  // position = (θ I + (1 − cos θ) [ω] + (θ − sin θ) [ω]²) v / |s|
  const [a, b, d] = [S[3] / rate, S[4] / rate, S[5] / rate];
  const dot = x * a + y * b + z * d;
  out[9] = s * a + c1 * (y * d - z * b) + (angle - s) * dot * x;
  out[10] = s * b + c1 * (z * a - x * d) + (angle - s) * dot * y;
  out[11] = s * d + c1 * (x * b - y * a) + (angle - s) * dot * z;
  return out;
}

/** Poses of a robot's links in the world. */
export class Chain {
  constructor(robot) {
    this.robot = robot;
    this.n = robot.joints.length;
    this.base = poseOf(robot.base.position_m, robot.base.quaternion_wxyz);
    /** @type {Pose[]} displacement of each link from q = 0, in the world */
    this.links = robot.joints.map(() => new Float64Array(12));
    this.step = new Float64Array(12);
  }

  /** Computes the poses of the links for joint values q. */
  setJoints(q) {
    let before = this.base;
    for (let i = 0; i < this.n; ++i) {
      exponential(this.robot.joints[i].screw, q[i], this.step);
      before = compose(before, this.step, this.links[i]);
    }
    return this;
  }

  /** Displacement of a link; that of the base for a negative index. */
  link(i) {
    return i < 0 ? this.base : this.links[i];
  }

  /** World position of a point that moves with a link and is given at q = 0 in the base frame. */
  point(link, p, out) {
    return transform(this.link(link), p, out);
  }

  /** World position of skeleton point i: joint i, or the tip for i = n. */
  skeleton(i, out) {
    return this.point(i < this.n ? i : this.robot.tip_link, this.robot.skeleton[i], out);
  }

  tip(out) {
    return this.skeleton(this.robot.skeleton.length - 1, out);
  }
}

/**
 * Joint values at time t, interpolated linearly between frames and constant outside. Returns the
 * index k of the frame before t and the fraction a of the way to the next frame.
 */
export function jointsAt(frames, n, t, q, indexAt) {
  const k = indexAt(frames.t, t);
  const last = frames.t.length - 1;
  const a = k < last ? Math.min(1, Math.max(0, (t - frames.t[k]) / (frames.t[k + 1] - frames.t[k]))) : 0;
  for (let i = 0; i < n; ++i) {
    const here = frames.q[k * n + i];
    q[i] = a > 0 ? here + a * (frames.q[(k + 1) * n + i] - here) : here;
  }
  return { k, a };
}

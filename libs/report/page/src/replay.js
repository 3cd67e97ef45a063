// The replay of one run: the configuration of the arm at a time, independent of the 3D view.
import { indexAt } from './data.js';
import { Chain, jointsAt } from './kinematics.js';

export class Replay {
  constructor(run, world, index) {
    this.run = run;
    this.world = world;
    this.index = index;
    this.frames = run.frames;
    this.chain = new Chain(world.robot);
    this.n = this.chain.n;
    this.q = new Float64Array(this.n);
    this.tip = [0, 0, 0];
    this.end = this.frames.t.length ? this.frames.t[this.frames.t.length - 1] : 0;
    this.k = 0;
    this.a = 0;
    /** Position of the tip in each frame: x, y, z in the world [m]. */
    this.tips = new Float32Array(3 * this.frames.t.length);
    for (let k = 0; k < this.frames.t.length; ++k) {
      this.tips.set(this.chain.setJoints(this.frames.q.subarray(k * this.n, (k + 1) * this.n)).tip(this.tip), 3 * k);
    }
    this.setTime(0);
  }

  setTime(t) {
    if (this.frames.t.length) Object.assign(this, jointsAt(this.frames, this.n, t, this.q, indexAt));
    this.chain.setJoints(this.q).tip(this.tip);
    /** The frame whose sampled values (clearance, closest points) are shown. */
    this.nearest = this.a > 0.5 ? this.k + 1 : this.k;
  }

  get goalIndex() {
    return Math.round(this.frames.goalIndex[this.k] ?? 0);
  }
}

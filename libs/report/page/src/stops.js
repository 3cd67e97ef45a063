// The stop that an arm follows instead of its planner's answer: a ghost where the arm would come to
// rest, and the line of the tip on the way there.
import { BufferAttribute, BufferGeometry, Group, Line, LineBasicMaterial } from 'three';
import { Arm } from './arm.js';
import { Chain } from './kinematics.js';

/** Most stops last a few milliseconds. They are shown at least this long [s]. */
const SHOWN = 0.4;
const PIECES = 32;

/** When the display of a stop ends [s]: the next one replaces it. */
export const shownUntil = (stop) => Math.max(stop.until, stop.t + SHOWN);

/** The stop that is shown at a time: the last one that began. Null if there is none. */
export function stopAt(stops, t) {
  let found = null;
  for (const stop of stops) {
    if (stop.t > t + 1e-9) break;
    found = stop;
  }
  return found && t <= shownUntil(found) + 1e-9 ? found : null;
}

export class StopLine {
  constructor(run, robot, reach) {
    this.stops = run.stops;
    this.group = new Group();
    this.stop = null;
    if (!this.stops.length) return;
    this.chain = new Chain(robot);
    this.ghost = new Arm(robot, reach, { ghost: true });
    this.points = new Float32Array(3 * (PIECES + 1));
    this.position = new BufferAttribute(this.points, 3);
    this.material = new LineBasicMaterial({ depthTest: false });
    this.line = new Line(new BufferGeometry().setAttribute('position', this.position), this.material);
    this.line.frustumCulled = false;
    this.line.renderOrder = 4;
    this.group.add(this.ghost.group, this.line);
    this.show(null);
  }

  paint(colors) {
    if (!this.stops.length) return;
    this.material.color.set(colors.mark);
    this.ghost.paint(colors, colors.mark);
  }

  update(t) {
    const stop = stopAt(this.stops, t);
    if (stop !== this.stop) this.show(stop);
  }

  show(stop) {
    this.stop = stop;
    this.ghost.group.visible = this.line.visible = stop !== null;
    if (!stop) return;
    const tip = [0, 0, 0];
    for (let k = 0; k <= PIECES; ++k) {
      const share = k / PIECES;
      this.chain.setJoints(stop.q.map((q, i) => q + share * (stop.q_end[i] - q)));
      this.points.set(this.chain.tip(tip), 3 * k);
    }
    this.position.needsUpdate = true;
    this.ghost.update(this.chain);
  }
}

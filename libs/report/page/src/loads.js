// What the arm carries: balls that move with the tip, and stay where they are put down.
import { Group, Mesh, MeshPhongMaterial } from 'three';
import { Chain } from './kinematics.js';
import { BALL, fixMatrix } from './shapes.js';

export class Loads {
  constructor(run, robot) {
    this.robot = robot;
    this.group = new Group();
    this.material = new MeshPhongMaterial({ specular: 0x303030, shininess: 20 });
    this.loads = run.loads.map((load) => {
      const group = new Group();
      const balls = load.balls.map(({ center_m: center, radius_m: radius }) => {
        const mesh = fixMatrix(new Mesh(BALL, this.material));
        group.add(mesh);
        return { center, radius, mesh };
      });
      this.group.add(group);
      let last = null;
      if (load.q_end) {
        last = new Chain(robot);
        last.setJoints(load.q_end);
      }
      return { ...load, group, balls, last };
    });
    this.p = [0, 0, 0];
  }

  paint(colors, accent) {
    this.material.color.set(accent);
  }

  /** @param {Chain} chain poses of the arm at time t */
  update(chain, t) {
    for (const { t: since, until, gone, group, balls, last } of this.loads) {
      group.visible = t >= since - 1e-9 && !(gone !== null && t >= gone);
      if (!group.visible) continue;
      const at = until !== null && t >= until ? last : chain;
      for (const { center, radius, mesh } of balls) {
        at.point(this.robot.tip_link, center, this.p);
        mesh.matrix.makeScale(radius, radius, radius).setPosition(...this.p);
      }
    }
  }
}

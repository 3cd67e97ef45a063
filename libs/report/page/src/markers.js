// Objects drawn around the arm: collision spheres, lines between closest points, force arrows,
// trail, goals, floor.
import {
  BufferAttribute, BufferGeometry, Color, GridHelper, Group, InstancedMesh, Line, LineBasicMaterial, Matrix4, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, Quaternion, TorusGeometry, Vector3,
} from 'three';
import { Arm } from './arm.js';
import { clearanceColor } from './colors.js';
import { Chain } from './kinematics.js';
import { BALL, CONE, fixMatrix, matrixBetween, ROD, translucent } from './shapes.js';

const matrix = new Matrix4();
const color = new Color();
const rgb = [0, 0, 0];

/** Balls that are drawn by one call. */
class Balls {
  constructor(count, material, order) {
    this.material = material;
    this.mesh = fixMatrix(new InstancedMesh(BALL, material, count));
    this.mesh.renderOrder = order;
    this.count = 0;
  }

  add(p, radius) {
    this.mesh.setMatrixAt(this.count, matrix.makeScale(radius, radius, radius).setPosition(p[0], p[1], p[2]));
    return this.count++;
  }

  publish() {
    this.mesh.count = this.count;
    this.mesh.instanceMatrix.needsUpdate = true;
    if (this.mesh.instanceColor) this.mesh.instanceColor.needsUpdate = true;
  }
}

/**
 * Collision spheres, and rows of balls for capsules, coloured by the clearance of their shape.
 * Those beyond the influence distance are faint and grey.
 */
export class Spheres {
  constructor(robot, frames, thin) {
    this.robot = robot;
    this.frames = frames;
    const count = Math.max(1, robot.spheres.length);
    this.group = new Group();
    // Spheres inside the limbs of the arm would be invisible, so they are drawn over it.
    this.near = new Balls(count, new MeshLambertMaterial({ transparent: true, opacity: 0.88, depthTest: !thin }), 2);
    this.far = new Balls(count, new MeshLambertMaterial(translucent(1, 0.16)), 3);
    this.group.add(this.near.mesh, this.far.mesh);
    /** x, y, z, radius of each sphere in the world [m]; the map uses them as well. */
    this.balls = new Float32Array(4 * robot.spheres.length);
    this.p = [0, 0, 0];
  }

  paint(colors) {
    this.far.material.color.set(colors.beyond);
    this.contact = colors.contact;
  }

  update(chain, k) {
    const { spheres, shapes } = this.robot;
    const { clearance, influence } = this.frames;
    this.near.count = this.far.count = 0;
    spheres.forEach((sphere, i) => {
      chain.point(sphere.link, sphere.center_m, this.p);
      this.balls.set(this.p, 4 * i);
      this.balls[4 * i + 3] = sphere.radius_m;
      const d = clearance ? clearance[k * shapes + sphere.shape] : NaN;
      if (!(d < influence)) {
        this.far.add(this.p, sphere.radius_m);
        return;
      }
      const slot = this.near.add(this.p, sphere.radius_m * 1.004);
      if (d <= 0) color.set(this.contact);
      else color.setRGB(...clearanceColor(d / influence, rgb), 'srgb');
      this.near.mesh.setColorAt(slot, color);
    });
    this.near.publish();
    this.far.publish();
  }
}

/** Thin rods between closest points, with a larger dot at the obstacle. */
export class Contacts {
  constructor(frames, reach) {
    this.contacts = frames.contacts;
    this.reach = reach;
    this.material = new MeshBasicMaterial();
    const most = this.contacts ? Math.max(1, ...this.contacts.count) : 1;
    this.rods = fixMatrix(new InstancedMesh(ROD, this.material, most));
    this.dots = fixMatrix(new InstancedMesh(BALL, this.material, 2 * most));
    this.group = new Group();
    this.group.add(this.rods, this.dots);
    this.shown = 0;
  }

  paint(colors) {
    this.material.color.set(colors.line);
  }

  update(k) {
    this.shown = this.contacts?.count[k] ?? 0;
    const r = 0.0022 * this.reach;
    for (let i = 0; i < this.shown; ++i) {
      const at = 6 * (this.contacts.first[k] + i);
      const a = this.contacts.points.subarray(at, at + 3);
      const b = this.contacts.points.subarray(at + 3, at + 6);
      this.rods.setMatrixAt(i, matrixBetween(a, b, r, matrix));
      this.dots.setMatrixAt(2 * i, matrix.makeScale(2.2 * r, 2.2 * r, 2.2 * r).setPosition(...a));
      this.dots.setMatrixAt(2 * i + 1, matrix.makeScale(3.4 * r, 3.4 * r, 3.4 * r).setPosition(...b));
    }
    this.rods.count = this.shown;
    this.dots.count = 2 * this.shown;
    this.rods.instanceMatrix.needsUpdate = this.dots.instanceMatrix.needsUpdate = true;
  }
}

/** One arrow per channel, starting at the tip. */
export class Forces {
  constructor(frames, reach) {
    this.group = new Group();
    this.reach = reach;
    this.arrows = frames.forces.map(({ channel, f }) => {
      const material = new MeshLambertMaterial();
      const shaft = fixMatrix(new Mesh(ROD, material));
      const head = fixMatrix(new Mesh(CONE, material));
      const group = new Group();
      group.add(shaft, head);
      this.group.add(group);
      return { channel, f, material, shaft, head, group, on: true };
    });
    this.f = [0, 0, 0];
  }

  paint(colors) {
    for (const { channel, material } of this.arrows) {
      material.color.set(colors.channels[channel] ?? colors.axis);
      material.emissive.set(material.color).multiplyScalar(0.35);
    }
  }

  /** @param {number} metres length of an arrow of 1 N */
  update(tip, k, a, metres) {
    for (const arrow of this.arrows) {
      const { f } = arrow;
      for (let c = 0; c < 3; ++c) {
        const here = f[3 * k + c];
        const next = f[3 * k + 3 + c];
        this.f[c] = a > 0 && !Number.isNaN(next) ? here + a * (next - here) : here;
      }
      const length = Math.hypot(...this.f) * metres;
      arrow.group.visible = arrow.on && length > 0.004 * this.reach;
      if (!arrow.group.visible) continue;
      const r = 0.0055 * this.reach;
      const headLength = Math.min(0.45 * length, 0.05 * this.reach);
      const end = tip.map((c, i) => c + this.f[i] * metres);
      const neck = tip.map((c, i) => c + this.f[i] * metres * (1 - headLength / length));
      matrixBetween(tip, neck, r, arrow.shaft.matrix);
      matrixBetween(neck, end, Math.min(2.6 * r, 0.6 * headLength), arrow.head.matrix);
    }
  }
}

/** Path of the tip: the past part as rods, the rest as a thin line. */
export class Trail {
  /** @param {Float32Array} tips x, y, z of each frame */
  constructor(tips, reach) {
    const count = tips.length / 3;
    this.tips = tips;
    this.radius = 0.0028 * reach;
    this.material = new MeshBasicMaterial();
    this.past = fixMatrix(new InstancedMesh(ROD, this.material, Math.max(1, count)));
    for (let k = 0; k + 1 < count; ++k) this.setRod(k, tips.subarray(3 * k + 3, 3 * k + 6));
    this.lineMaterial = new LineBasicMaterial();
    this.line = new Line(new BufferGeometry().setAttribute('position', new BufferAttribute(tips, 3)), this.lineMaterial);
    this.group = new Group();
    this.group.add(this.past, this.line);
  }

  paint(colors, accent) {
    this.material.color.set(accent);
    this.lineMaterial.color.set(colors.trailRest);
  }

  /** Shows the rods up to frame k, and one from there to the tip, which is between two frames. */
  update(tip, k) {
    this.past.count = 0;
    if (!this.tips.length) return;
    if (this.partial !== undefined && this.partial !== k) this.setRod(this.partial, this.tips.subarray(3 * this.partial + 3, 3 * this.partial + 6));
    this.partial = k;
    this.setRod(k, tip);
    this.past.count = k + 1;
    this.past.instanceMatrix.needsUpdate = true;
  }

  setRod(k, end) {
    if (end.length === 3) this.past.setMatrixAt(k, matrixBetween(this.tips.subarray(3 * k, 3 * k + 3), end, this.radius, matrix));
  }
}

const AXES = [[1, 0, 0, '#d43d3d'], [0, 1, 0, '#2f9e44'], [0, 0, 1, '#2b6fd6']];

/** A coordinate frame: three rods in red (x), green (y) and blue (z). */
export function coordinateAxes(size) {
  const group = new Group();
  for (const [x, y, z, paint] of AXES) {
    const rod = fixMatrix(new Mesh(ROD, new MeshBasicMaterial({ color: paint })));
    matrixBetween([0, 0, 0], [x * size, y * size, z * size], 0.055 * size, rod.matrix);
    group.add(rod);
  }
  return group;
}

/**
 * Goals: a ring and a dot, a coordinate frame for poses, a translucent arm for joint goals. The
 * current one is highlighted.
 */
export class Goals {
  constructor(world) {
    const { robot, reach_m: reach } = world;
    this.group = new Group();
    this.current = -1;
    this.ghosts = 0;
    this.items = world.goals.map((goal) => {
      const group = new Group();
      const material = new MeshLambertMaterial({ transparent: true });
      let at = goal.position_m;
      let ghost = null;
      if (goal.type === 'joint') {
        const chain = new Chain(robot).setJoints(goal.q);
        at = chain.tip([0, 0, 0]);
        ghost = new Arm(robot, reach, { ghost: true });
        ghost.update(chain);
        this.group.add(ghost.group);
        ++this.ghosts;
      }
      const ball = new Mesh(BALL, material);
      ball.scale.setScalar(0.011 * reach);
      const ring = new Mesh(new TorusGeometry(0.034 * reach, 0.0035 * reach, 8, 40), material);
      const cross = new Mesh(ring.geometry, material);
      cross.rotation.x = Math.PI / 2;
      group.add(ball, ring, cross);
      if (goal.type === 'pose') {
        const [w, x, y, z] = goal.quaternion_wxyz;
        const axes = coordinateAxes(0.09 * reach);
        axes.quaternion.copy(new Quaternion(x, y, z, w));
        group.add(axes);
      }
      group.position.fromArray(at);
      this.group.add(group);
      return { goal, at, group, material, ghost };
    });
  }

  paint(colors) {
    this.colors = colors;
    for (const { ghost } of this.items) ghost?.paint(colors, colors.goal);
    const current = this.current;
    this.current = -1;
    this.setCurrent(Math.max(0, current));
  }

  /** @param {number} index current goal; beyond the last one if all are reached */
  setCurrent(index) {
    if (index === this.current || !this.colors) return;
    this.current = index;
    this.items.forEach(({ group, material, ghost }, i) => {
      const now = i === Math.min(index, this.items.length - 1);
      material.color.set(now ? this.colors.goal : this.colors.goalIdle);
      material.emissive.set(material.color).multiplyScalar(0.4);
      material.opacity = now ? 1 : 0.55;
      group.scale.setScalar(now ? 1 : 0.6);
      if (ghost) ghost.group.visible = now;
    });
  }
}

/** The target that is followed: a ring and a dot, and the path that it takes. */
export class Target {
  /** @param {Float64Array | null} at x, y, z of each frame */
  constructor(at, reach) {
    this.at = at ?? new Float64Array(0);
    this.group = new Group();
    if (!this.at.length) return;
    this.material = new MeshLambertMaterial();
    this.mark = new Group();
    const ball = new Mesh(BALL, this.material);
    ball.scale.setScalar(0.011 * reach);
    const ring = new Mesh(new TorusGeometry(0.034 * reach, 0.0035 * reach, 8, 40), this.material);
    const cross = new Mesh(ring.geometry, this.material);
    cross.rotation.x = Math.PI / 2;
    this.mark.add(ball, ring, cross);
    this.lineMaterial = new LineBasicMaterial({ transparent: true, opacity: 0.6 });
    const path = new BufferGeometry().setAttribute('position', new BufferAttribute(Float32Array.from(this.at), 3));
    this.group.add(this.mark, new Line(path, this.lineMaterial));
  }

  paint(colors) {
    if (!this.at.length) return;
    this.material.color.set(colors.goal);
    this.material.emissive.set(colors.goal).multiplyScalar(0.4);
    this.lineMaterial.color.set(colors.goal);
  }

  /** Shows it between the frames k and k + 1, at the share a. */
  update(k, a) {
    if (!this.at.length) return;
    const next = Math.min(k + 1, this.at.length / 3 - 1);
    const along = (i) => (1 - a) * this.at[3 * k + i] + a * this.at[3 * next + i];
    this.mark.position.set(along(0), along(1), along(2));
  }
}

/** A grid under the arm, or in the plane of a planar one. */
export class Floor {
  constructor(step, half, center, normal) {
    this.args = [2 * half, Math.round((2 * half) / step)];
    this.center = center;
    this.normal = new Vector3(...normal).normalize();
    this.group = new Group();
  }

  paint(colors) {
    this.group.clear();
    const grid = new GridHelper(...this.args, colors.gridMajor, colors.gridMinor);
    grid.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), this.normal);
    grid.position.fromArray(this.center);
    grid.renderOrder = -1;
    this.group.add(grid);
  }
}

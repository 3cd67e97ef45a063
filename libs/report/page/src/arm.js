// The arm as a solid body: tapered limbs along the skeleton, a cylinder on the axis of each joint.
import { CylinderGeometry, Group, Mesh, MeshPhongMaterial } from 'three';
import { poseOf, rotate } from './kinematics.js';
import { BALL, CUBE, DRUM, fixMatrix, matrixAt, matrixBetween, translucent } from './shapes.js';

/**
 * Radius of each limb [m]: inside the collision spheres if there are any, decreasing towards the
 * tip.
 */
function limbRadii(robot, reach) {
  const n = robot.joints.length;
  const radii = [];
  for (let i = 0; i <= n; ++i) {
    const taper = reach * (0.034 - 0.018 * (i / n));
    const own = robot.spheres.filter((s) => s.link === Math.min(i, n - 1)).map((s) => s.radius_m).sort((a, b) => a - b);
    const inside = own.length ? 0.66 * own[own.length >> 1] : taper;
    radii.push(Math.min(Math.max(inside, 0.0115 * reach), 1.3 * taper));
  }
  for (let i = 1; i <= n; ++i) radii[i] = Math.min(radii[i], radii[i - 1]);
  return radii;
}

export class Arm {
  /**
   * @param {object} robot of the report's world
   * @param {number} reach [m]
   * @param {{ghost?: boolean}} options a ghost has one translucent colour and no pedestal
   */
  constructor(robot, reach, { ghost = false } = {}) {
    this.robot = robot;
    this.group = new Group();
    const n = robot.joints.length;
    this.radii = limbRadii(robot, reach);
    /** Scale of the joints: on a thin arm they are drawn larger to be visible. */
    this.joint = Math.max(1, (0.019 * reach) / Math.min(...this.radii));
    const material = (specular) => new MeshPhongMaterial(ghost ? { ...translucent(2, 0.28), specular: 0 } : { specular, shininess: 24 });
    this.limbMaterial = material(0x383838);
    this.jointMaterial = ghost ? this.limbMaterial : material(0x505050);
    this.baseMaterial = ghost ? this.limbMaterial : material(0x202020);

    this.points = Array.from({ length: n + 2 }, () => [0, 0, 0]);
    this.axis = [0, 0, 0];
    const add = (geometry, part) => {
      const mesh = fixMatrix(new Mesh(geometry, part));
      this.group.add(mesh);
      return mesh;
    };
    // Limb i connects points i and i + 1, where point 0 is the base. Coinciding points have no
    // limb.
    this.limbs = [];
    this.drums = [];
    this.balls = [];
    const rest = [[0, 0, 0], ...robot.skeleton];
    for (let i = 0; i <= n; ++i) {
      const length = Math.hypot(...rest[i].map((c, k) => c - rest[i + 1][k]));
      const below = this.radii[Math.max(0, i - 1)];
      const taper = i === n ? 0.62 : this.radii[i] / below;
      if (ghost && i === 0) continue; // it would coincide with that of the arm
      if (length > 1e-4 * reach || (i > 0 && robot.joints[i - 1].type === 'prismatic')) {
        const shape = new CylinderGeometry(Math.min(taper, 1), 1, 1, 28, 1);
        this.limbs.push({ i, radius: below * (i === 0 ? 1.25 : 1), mesh: add(shape, i === 0 ? this.baseMaterial : this.limbMaterial) });
      }
    }
    robot.joints.forEach((joint, i) => {
      const slide = joint.type === 'prismatic';
      this.drums.push({ i, slide, mesh: add(slide ? CUBE : DRUM, this.jointMaterial) });
      this.balls.push({ i, mesh: add(BALL, this.limbMaterial) });
    });
    this.tip = add(BALL, this.jointMaterial);
    if (!ghost) {
      this.plate = add(DRUM, this.baseMaterial);
      const pedestal = this.limbs[0]?.i === 0;
      const radius = this.radii[0] * (pedestal ? 2 : 1.8);
      const up = robot.planar_normal ?? rotate(poseOf([0, 0, 0], robot.base.quaternion_wxyz), [0, 0, 1]);
      const half = 0.12 * radius;
      matrixAt(robot.base.position_m.map((c, k) => c + half * up[k]), up, radius, 2 * half, this.plate.matrix);
    }
  }

  paint(colors, accent) {
    this.limbMaterial.color.set(this.jointMaterial === this.limbMaterial ? accent : colors.limb);
    if (this.jointMaterial === this.limbMaterial) return;
    this.jointMaterial.color.set(colors.joint);
    this.baseMaterial.color.set(colors.base);
  }

  /** Moves the arm to the poses of a chain. */
  update(chain) {
    const { joints, base } = this.robot;
    const n = joints.length;
    this.points[0] = base.position_m;
    for (let i = 0; i <= n; ++i) chain.skeleton(i, this.points[i + 1]);
    for (const { i, radius, mesh } of this.limbs) matrixBetween(this.points[i], this.points[i + 1], radius, mesh.matrix);
    for (const { i, slide, mesh } of this.drums) {
      const screw = joints[i].screw;
      rotate(chain.link(i), slide ? screw.slice(3) : screw.slice(0, 3), this.axis);
      const radius = this.radii[i] * this.joint;
      matrixAt(this.points[i + 1], this.axis, radius * (slide ? 1.7 : 1.1), radius * (slide ? 1.7 : 2.24), mesh.matrix);
    }
    for (const { i, mesh } of this.balls) mesh.matrix.makeScale(...Array(3).fill(this.radii[i])).setPosition(...this.points[i + 1]);
    const end = this.radii[n] * 0.72;
    this.tip.matrix.makeScale(end, end, end).setPosition(...this.points[n + 1]);
  }
}

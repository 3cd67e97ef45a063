// Primitive obstacles: where they are, the paths of those that move, and where these are predicted
// to be.
import {
  BufferAttribute, BufferGeometry, CapsuleGeometry, Group, Line, LineBasicMaterial, Mesh, MeshLambertMaterial, Quaternion, Vector3,
} from 'three';
import { indexAt } from './data.js';
import { BALL, CUBE, DRUM, translucent } from './shapes.js';

const nextTurn = new Quaternion();
const Z_FROM_Y = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), Math.PI / 2);

/** The axis of the unit cylinder and of a capsule is y, that of such an obstacle is its own z. */
const isAxial = (o) => o.shape === 'cylinder' || o.shape === 'capsule';

function turnTo(mesh, o, [w, x, y, z] = [1, 0, 0, 0]) {
  mesh.quaternion.set(x, y, z, w).normalize();
  if (isAxial(o)) mesh.quaternion.multiply(Z_FROM_Y);
}

/** The mesh of an obstacle, its surface moved outwards by `wider` [m]. */
function makeMesh(o, material, wider = 0) {
  const r = (o.radius_m ?? 0) + wider;
  const geometry = { sphere: BALL, box: CUBE, cylinder: DRUM }[o.shape] ?? new CapsuleGeometry(r, o.length_m, 12, 28);
  const mesh = new Mesh(geometry, material);
  if (o.shape === 'sphere') mesh.scale.setScalar(r);
  else if (o.shape === 'box') mesh.scale.fromArray(o.size_m.map((size) => size + 2 * wider));
  else if (o.shape === 'cylinder') mesh.scale.set(r, o.length_m + 2 * wider, r);
  turnTo(mesh, o, o.quaternion_wxyz);
  return mesh;
}

/**
 * Sets a pose between two samples, or that of the first or the last one. There are `count` poses
 * for each time, of which this is number `i`. Without quaternions the mesh keeps its own.
 */
function placeSampled(mesh, o, { t: times, position_m: p, quaternion_wxyz: q }, t, count = 1, i = 0) {
  const last = times.length - 1;
  const k = indexAt(times, t);
  const next = Math.min(k + 1, last);
  const a = next > k ? Math.min(1, Math.max(0, (t - times[k]) / (times[next] - times[k]))) : 0;
  const from = count * k + i;
  const to = count * next + i;
  const at = (c) => p[3 * from + c] + a * (p[3 * to + c] - p[3 * from + c]);
  mesh.position.set(at(0), at(1), at(2));
  if (!q) return;
  mesh.quaternion.set(q[4 * from + 1], q[4 * from + 2], q[4 * from + 3], q[4 * from]).normalize();
  nextTurn.set(q[4 * to + 1], q[4 * to + 2], q[4 * to + 3], q[4 * to]).normalize();
  mesh.quaternion.slerp(nextTurn, a);
  if (isAxial(o)) mesh.quaternion.multiply(Z_FROM_Y);
}

/** Displacement of an obstacle's motion at time t [m]. */
function displacement(motion, t) {
  if (!motion) return [0, 0, 0];
  if (motion.type === 'linear') {
    const s = Math.min(Math.max(t - motion.start_s, 0), motion.duration_s ?? Infinity);
    return motion.velocity_m_s.map((v) => s * v);
  }
  const s = Math.sin((2 * Math.PI * t) / motion.period_s);
  return motion.amplitude_m.map((a) => s * a);
}

/** Points of the path of an obstacle's centre; null if it rests. */
function pathOf(o, duration) {
  if (o.poses) return Float32Array.from(o.poses.position_m);
  if (!o.motion) return null;
  // Both other motions are along a straight line.
  const ends = o.motion.type === 'linear' ? [0, duration] : [-o.motion.period_s / 4, o.motion.period_s / 4];
  return Float32Array.from(ends.flatMap((t) => displacement(o.motion, t).map((d, c) => d + o.position_m[c])));
}

/** Obstacles as they are; some of them move or appear later, or are carried away. */
export class Obstacles {
  constructor(obstacles, loads, planarNormal) {
    this.group = new Group();
    this.moving = 0;
    this.items = obstacles.map((o) => {
      const material = new MeshLambertMaterial(o.judge_only || planarNormal ? { transparent: true, opacity: o.judge_only ? 0.35 : 0.9 } : {});
      const mesh = makeMesh(o, material);
      if (o.motion || o.poses) ++this.moving;
      this.group.add(mesh);
      const gone = Math.min(Infinity, ...loads.filter((load) => load.obstacle === o.name).map((load) => load.t));
      return { o, mesh, material, gone };
    });
  }

  paint(colors) {
    for (const { o, material } of this.items) material.color.set(o.judge_only ? colors.judge : colors.obstacle);
  }

  update(t) {
    for (const { o, mesh, gone } of this.items) {
      mesh.visible = t >= (o.appears_s ?? 0) && t < gone;
      if (o.poses) {
        placeSampled(mesh, o, o.poses, t);
        continue;
      }
      const moved = displacement(o.motion, t);
      mesh.position.set(...o.position_m.map((c, i) => c + moved[i]));
    }
  }
}

/** The paths of moving obstacles during the whole run, as thin lines. */
export class Paths {
  constructor(obstacles, duration) {
    this.group = new Group();
    this.material = new LineBasicMaterial({ transparent: true, opacity: 0.9 });
    for (const o of obstacles) {
      const points = pathOf(o, duration);
      if (points) this.group.add(new Line(new BufferGeometry().setAttribute('position', new BufferAttribute(points, 3)), this.material));
    }
  }

  get count() {
    return this.group.children.length;
  }

  paint(colors) {
    this.material.color.set(colors.path);
  }
}

/**
 * Translucent copies of moving obstacles where they are predicted to be, the fainter the further
 * ahead. Where only a speed is bounded they grow instead.
 */
export class Predictions {
  constructor(obstacles) {
    this.group = new Group();
    this.items = obstacles.filter((o) => o.predicted).map((o) => {
      const { predicted } = o;
      const meshes = predicted.ahead_s.map((_, i) => {
        // Overlapping parts of one mover are blended once for each time ahead.
        const material = new MeshLambertMaterial(translucent(8 + i, 0.34 - (0.22 * i) / predicted.ahead_s.length));
        const mesh = makeMesh(o, material, predicted.nearer_m[i]);
        mesh.renderOrder = 5 + i;
        this.group.add(mesh);
        return mesh;
      });
      return { o, meshes };
    });
  }

  paint(colors) {
    for (const { meshes } of this.items) for (const { material } of meshes) material.color.set(colors.predicted);
  }

  update(t) {
    for (const { o, meshes } of this.items) {
      const exists = t >= (o.appears_s ?? 0);
      meshes.forEach((mesh, i) => {
        mesh.visible = exists;
        if (exists) placeSampled(mesh, o, o.predicted, t, meshes.length, i);
      });
    }
  }
}

// The 3D scene of one run: map, arm and markers, updated from its replay.
import { DirectionalLight, Group, HemisphereLight, Scene } from 'three';
import { Arm } from './arm.js';
import { runColor, theme } from './colors.js';
import { Contacts, coordinateAxes, Floor, Forces, Goals, Spheres, Target, Trail } from './markers.js';
import { Drawings } from './drawings.js';
import { Loads } from './loads.js';
import { Obstacles, Paths, Predictions } from './obstacles.js';
import { StopLine } from './stops.js';
import { Voxels } from './voxels.js';

/** The map of a run: as it is, or as far as its sensors have seen it. */
function mapOf({ map }, { seen }) {
  if (!map) return null;
  if (!seen) return map.level.length ? new Voxels(map) : null;
  const { alone, lo, since } = seen;
  const own = alone ? 0 : map.level.length;
  const joined = (Type, before, after) => Type.from([...before, ...after]);
  return new Voxels({
    ...map,
    lo: joined(Int16Array, map.lo.subarray(0, 3 * own), lo),
    level: joined(Uint8Array, map.level.subarray(0, own), new Uint8Array(since.length)),
    since: joined(Float64Array, new Float64Array(own), since),
  });
}

export class RunScene {
  constructor(replay, floor) {
    const { world, frames } = replay;
    const reach = world.reach_m;
    this.replay = replay;
    this.reach = reach;
    this.scene = new Scene();
    this.hemisphere = new HemisphereLight();
    this.sun = new DirectionalLight();
    this.sun.position.set(0.6, -1, 1.6);
    this.scene.add(this.hemisphere, this.sun);

    this.voxels = mapOf(world, replay.run);
    this.arm = new Arm(world.robot, reach);
    this.spheres = new Spheres(world.robot, frames, Math.min(...this.arm.radii) > Math.max(0, ...world.robot.spheres.map((s) => s.radius_m)));
    this.contacts = new Contacts(frames, reach);
    this.forces = new Forces(frames, reach);
    this.drawings = new Drawings(replay.run);
    this.loads = new Loads(replay.run, world.robot);
    this.trail = new Trail(replay.tips, reach);
    this.stop = new StopLine(replay.run, world.robot, reach);
    this.goals = new Goals(world);
    this.target = new Target(frames.target, reach);
    this.obstacles = new Obstacles(world.obstacles ?? [], replay.run.loads, world.robot.planar_normal);
    this.paths = new Paths(world.obstacles ?? [], replay.end);
    this.predictions = new Predictions(world.obstacles ?? []);
    this.floor = new Floor(floor.step, floor.half, floor.center, floor.normal);
    this.tipFrame = world.goals.some((goal) => goal.type === 'pose') ? coordinateAxes(0.07 * reach) : new Group();
    this.tipFrame.matrixAutoUpdate = false;
    this.parts = [this.floor, this.voxels, this.obstacles, this.paths, this.predictions, this.goals, this.target, this.arm, this.loads, this.drawings, this.spheres, this.contacts, this.forces, this.trail, this.stop].filter(Boolean);
    for (const part of this.parts) this.scene.add(part.group);
    this.scene.add(this.tipFrame);
    this.probes = this.probesOf(world.robot);
    this.paint();
  }

  /**
   * Balls whose distance decides whether a cell is near the arm. Null if the robot has collision
   * spheres, which are used then; otherwise points along the segments or, without segments, along
   * the skeleton.
   */
  probesOf(robot) {
    if (robot.spheres.length) return null;
    const bars = robot.segments.length
      ? robot.segments
      : robot.skeleton.slice(1).map((to, i) => ({ link: i, from_m: robot.skeleton[i], to_m: to, radius_m: 0 }));
    const list = [];
    for (const { link, from_m: from, to_m: to, radius_m: radius } of bars) {
      const count = Math.max(1, Math.ceil(Math.hypot(...to.map((c, i) => c - from[i])) / (0.03 * this.reach)));
      for (let s = 0; s <= count; ++s) list.push({ link, p: from.map((c, i) => c + ((to[i] - c) * s) / count), radius });
    }
    return { list, out: new Float32Array(4 * list.length) };
  }

  probeBalls() {
    if (!this.probes) return this.spheres.balls;
    const p = [0, 0, 0];
    this.probes.list.forEach(({ link, p: at, radius }, i) => {
      this.probes.out.set(this.replay.chain.point(link, at, p), 4 * i);
      this.probes.out[4 * i + 3] = radius;
    });
    return this.probes.out;
  }

  paint() {
    const colors = theme();
    const accent = runColor(this.replay.index);
    this.hemisphere.color.set(colors.sky);
    this.hemisphere.groundColor.set(colors.ground);
    this.hemisphere.intensity = colors.ambient;
    this.sun.intensity = colors.sun;
    for (const part of this.parts) part.paint(colors, accent);
  }

  /** Applies the settings of the view. */
  apply(settings) {
    const { show } = settings;
    this.settings = settings;
    if (this.voxels) {
      this.voxels.group.visible = show.map;
      this.voxels.setOpacity(settings.opacity);
      this.voxels.setClip(settings.clip);
    }
    this.arm.group.visible = show.arm;
    this.loads.group.visible = show.arm;
    this.spheres.group.visible = show.spheres;
    this.contacts.group.visible = show.lines;
    this.forces.group.visible = show.forces;
    for (const arrow of this.forces.arrows) arrow.on = settings.channels[arrow.channel] ?? true;
    this.trail.group.visible = show.trail;
    this.drawings.group.visible = show.drawings;
    this.stop.group.visible = show.stops;
    this.goals.group.visible = show.goals;
    this.target.group.visible = show.goals;
    this.tipFrame.visible = show.goals;
    this.obstacles.group.visible = show.obstacles;
    this.paths.group.visible = show.paths;
    this.predictions.group.visible = show.predicted;
    this.floor.group.visible = show.floor;
  }

  update(t) {
    const { replay, settings } = this;
    const { chain, k, a, tip } = replay;
    this.arm.update(chain);
    this.loads.update(chain, t);
    this.spheres.update(chain, replay.nearest);
    this.contacts.update(replay.nearest);
    this.forces.update(tip, k, a, settings.metresPerNewton);
    this.trail.update(tip, k);
    this.drawings.update(t);
    this.stop.update(t);
    this.goals.setCurrent(replay.goalIndex);
    this.target.update(k, a);
    this.obstacles.update(t);
    this.predictions.update(t);
    const pose = chain.link(replay.world.robot.tip_link);
    // prettier-ignore
    this.tipFrame.matrix.set(
      pose[0], pose[1], pose[2], tip[0],
      pose[3], pose[4], pose[5], tip[1],
      pose[6], pose[7], pose[8], tip[2], 0, 0, 0, 1);
    if (!this.voxels) return;
    this.voxels.showUntil(t);
    if (settings.near === null) this.voxels.showAll();
    else this.voxels.showNear(this.probeBalls(), settings.near);
  }
}

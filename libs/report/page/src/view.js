// The 3D view: one canvas over a row of panels, one camera for all of them.
import { OrthographicCamera, PerspectiveCamera, Vector3, WebGLRenderer } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { RunScene } from './runscene.js';
import { Chain } from './kinematics.js';

const FOV = 32;

/** Whether WebGL is rendered in software; throws an error without WebGL. */
function inSoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  if (!gl) throw new Error('WebGL 2 is not available.');
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/**
 * Centre and radius of the space that the arms sweep, with the goals, and sampled points of the
 * arms.
 */
function sweptBounds(replays) {
  const lo = [Infinity, Infinity, Infinity];
  const hi = [-Infinity, -Infinity, -Infinity];
  const samples = [];
  const grow = (p) => p.forEach((c, i) => {
    lo[i] = Math.min(lo[i], c);
    hi[i] = Math.max(hi[i], c);
  });
  for (const { world, frames, n } of replays) {
    const chain = new Chain(world.robot);
    grow(world.robot.base.position_m);
    chain.setJoints(new Float64Array(n));
    if (!frames.t.length) world.robot.skeleton.forEach((_, i) => grow(chain.skeleton(i, [0, 0, 0])));
    const stride = Math.max(1, Math.floor(frames.t.length / 40));
    for (let k = 0; k < frames.t.length; k += stride) {
      chain.setJoints(frames.q.subarray(k * n, k * n + n));
      world.robot.skeleton.forEach((_, i) => {
        const p = chain.skeleton(i, [0, 0, 0]);
        grow(p);
        samples.push(p);
      });
    }
    for (const goal of world.goals) if (goal.position_m) grow(goal.position_m);
  }
  const margin = 0.08 * Math.max(...replays.map((r) => r.world.reach_m));
  const center = lo.map((c, i) => (c + hi[i]) / 2);
  return { center, samples, radius: Math.hypot(...lo.map((c, i) => (hi[i] - c) / 2)) + margin };
}

/** The smallest 1, 2 or 5 times a power of ten that is at least x. */
function roundUp(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * ([1, 2, 5, 10].find((m) => m * power >= x * 0.999) ?? 10);
}

/** The candidate direction from which the map hides the arm least. */
function leastHiddenDirection(scene, samples) {
  const candidates = [];
  for (const azimuth of [-55, -30, -80, -115, -145, 150, 180, 125, 95, 60, 30, 0]) {
    for (const elevation of [22, 38]) {
      const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
      candidates.push([Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)]);
    }
  }
  const voxels = scene.voxels;
  if (!voxels) return candidates[0];
  const stride = Math.max(1, Math.floor(voxels.total / 1500));
  const radius = 0.03 * scene.reach;
  const centers = [];
  for (let i = 0; i < voxels.total; i += stride) centers.push(voxels.center(i, [0, 0, 0]));
  const points = samples.filter((_, i) => i % Math.max(1, Math.floor(samples.length / 50)) === 0);
  let best = candidates[0];
  let least = Infinity;
  candidates.forEach((d, order) => {
    let hidden = 0;
    for (const p of points) {
      for (const center of centers) {
        const x = center[0] - p[0];
        const y = center[1] - p[1];
        const z = center[2] - p[2];
        const along = x * d[0] + y * d[1] + z * d[2];
        if (along > 0 && x * x + y * y + z * z - along * along < radius * radius) {
          ++hidden;
          break;
        }
      }
    }
    const cost = hidden / points.length + 0.004 * order;
    if (cost < least) [best, least] = [d, cost];
  });
  return best;
}

export class View {
  /**
   * @param {HTMLElement} row holds the panels
   * @param {HTMLElement[]} panels one per replay, in the same order
   */
  constructor(row, panels, replays) {
    this.row = row;
    this.panels = panels;
    const software = inSoftware();
    this.renderer = new WebGLRenderer({ antialias: !software, alpha: true, stencil: true, powerPreference: 'high-performance' });
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.renderer.setScissorTest(true);
    this.canvas = this.renderer.domElement;
    this.canvas.setAttribute('aria-label', 'The arm and its surroundings. Drag to rotate, scroll to zoom, drag with the right button to pan.');
    this.canvas.setAttribute('role', 'img');
    row.prepend(this.canvas);

    const swept = sweptBounds(replays);
    this.center = new Vector3(...swept.center);
    this.radius = swept.radius;
    const reach = Math.max(...replays.map((r) => r.world.reach_m));
    this.gridStep = roundUp(reach / 8);
    this.planar = replays[0].world.robot.planar_normal;
    const half = this.gridStep * Math.ceil(((this.planar ? 2.4 : 1.45) * reach) / this.gridStep);
    this.scenes = replays.map((replay) => {
      const robot = replay.world.robot;
      return new RunScene(replay, { step: this.gridStep, half, center: robot.base.position_m, normal: robot.planar_normal ?? [0, 0, 1] });
    });
    this.homeDirection = this.planar ? [0.3, -0.55, 0.78] : leastHiddenDirection(this.scenes[0], swept.samples);

    this.perspective = new PerspectiveCamera(FOV, 1, 0.01 * reach, 40 * reach);
    this.orthographic = new OrthographicCamera(-1, 1, 1, -1, -40 * reach, 40 * reach);
    for (const camera of [this.perspective, this.orthographic]) camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.perspective, this.canvas);
    this.controls.addEventListener('change', () => this.request());
    this.controls.enableDamping = false;
    this.drawRequested = false;
    this.aspect = 1;
    new ResizeObserver(() => this.request()).observe(row);
    this.canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
    this.canvas.addEventListener('webglcontextrestored', () => this.request());
    this.layout();
    this.setView(this.planar ? 'plane' : '3d');
  }

  /**
   * Sets the camera to a view: '3d', 'top', 'front', 'side' or 'plane' (along the normal of a
   * planar scene).
   */
  setView(name) {
    this.name = name;
    const directions = { '3d': this.homeDirection, top: [0, 0, 1], front: [0, -1, 0], side: [1, 0, 0], plane: this.planar ?? [0, 0, 1] };
    const direction = new Vector3(...directions[name]).normalize();
    // Looking straight down, "up" is undefined. A small tilt makes x point right and y up.
    if (Math.abs(direction.z) > 0.999) direction.y -= 1e-4;
    const flat = name !== '3d';
    this.camera = flat ? this.orthographic : this.perspective;
    const distance = this.radius / Math.sin((Math.PI / 180) * (FOV / 2)) / Math.min(1, this.aspect * 1.05);
    this.camera.position.copy(this.center).addScaledVector(direction, 0.86 * distance);
    this.camera.zoom = 1;
    this.controls.object = this.camera;
    this.controls.target.copy(this.center);
    this.updateProjection();
    this.controls.update();
    this.request();
  }

  updateProjection() {
    if (this.camera.isPerspectiveCamera) this.camera.aspect = this.aspect;
    else {
      const height = (this.radius * 1.02) / Math.min(1, this.aspect);
      Object.assign(this.camera, { left: -height * this.aspect, right: height * this.aspect, top: height, bottom: -height });
    }
    this.camera.updateProjectionMatrix();
  }

  /** Adapts the canvas to the panels; returns whether its size changed. */
  layout() {
    const width = this.row.clientWidth;
    const height = this.row.clientHeight;
    if (width === this.width && height === this.height) return false;
    this.width = width;
    this.height = height;
    this.renderer.setSize(width, height, false);
    const panel = this.panels[0];
    this.aspect = Math.max(0.1, panel.clientWidth / Math.max(1, panel.clientHeight));
    if (this.camera) this.updateProjection();
    return true;
  }

  apply(settings) {
    for (const scene of this.scenes) scene.apply(settings);
    this.request();
  }

  paint() {
    for (const scene of this.scenes) scene.paint();
    this.request();
  }

  /** Requests a drawing in the next animation frame. */
  request() {
    if (this.drawRequested) return;
    this.drawRequested = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.drawRequested = false;
    this.layout();
    const top = this.row.getBoundingClientRect();
    this.scenes.forEach((scene, i) => {
      const rect = this.panels[i].getBoundingClientRect();
      const x = rect.left - top.left - this.row.clientLeft;
      const y = this.height - (rect.bottom - top.top - this.row.clientTop);
      this.renderer.setViewport(x, y, rect.width, rect.height);
      this.renderer.setScissor(x, y, rect.width, rect.height);
      this.renderer.render(scene.scene, this.camera);
    });
    this.drawn = (this.drawn ?? 0) + 1;
  }

  update(t) {
    for (const scene of this.scenes) scene.update(t);
    this.request();
  }

  get voxelsShown() {
    return this.scenes.map((scene) => (scene.voxels ? scene.voxels.shown : 0));
  }
}

// Settings of the 3D view and their controls.
import { theme } from './colors.js';
import { checkbox, choice, h, slider } from './dom.js';
import { number } from './format.js';

/**
 * The force [N] that determines the scale of the arrows: 98 % of the nonzero samples of all runs
 * are at most this.
 */
function typicalForce(runs) {
  const sizes = [];
  for (const { frames } of runs) {
    for (const { f } of frames.forces) {
      for (let k = 0; k + 2 < f.length; k += 3) {
        const size = Math.hypot(f[k], f[k + 1], f[k + 2]);
        if (size > 0) sizes.push(size);
      }
    }
  }
  sizes.sort((a, b) => a - b);
  return sizes.length ? sizes[Math.floor(0.98 * (sizes.length - 1))] : 0;
}

/** 1, 2 or 5 times a power of ten, at most x. */
function roundDown(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return power * [5, 2, 1].find((m) => m * power <= x * 1.0001);
}

/** Labels of channels whose name in the data is abbreviated. */
const CHANNEL_LABELS = { held: 'held torque', node: 'node velocity' };

export class Settings {
  /**
   * @param {object[]} runs
   * @param {object[]} worlds
   * @param {import('./view.js').View} view
   * @param {() => void} changed
   */
  constructor(runs, worlds, view, changed) {
    const used = [...new Set(runs.map((run) => run.world))].map((i) => worlds[i]);
    const reach = Math.max(...used.map((world) => world.reach_m));
    const has = {
      map: view.scenes.some((scene) => scene.voxels),
      spheres: used.some((world) => world.robot.spheres.length),
      lines: runs.some((run) => run.frames.contacts),
      forces: runs.some((run) => run.frames.forces.length),
      drawings: runs.some((run) => run.drawings),
      stops: runs.some((run) => run.stops.length),
      goals: used.some((world) => world.goals.length) || runs.some((run) => run.frames.target),
      obstacles: used.some((world) => world.obstacles?.length),
      paths: used.some((world) => world.obstacles?.some((o) => o.motion || o.poses)),
      predicted: used.some((world) => world.obstacles?.some((o) => o.predicted)),
    };
    this.view = view;
    this.changed = changed;
    this.reach = reach;
    this.typical = typicalForce(runs);
    this.opacity = 0.5;
    this.near = null;
    this.clip = null;
    this.forceScale = 1;
    this.show = { map: true, arm: true, spheres: true, lines: true, forces: true, trail: true, drawings: true, stops: true, goals: true, obstacles: true, paths: true, predicted: true, floor: true };
    this.channels = {};

    const planar = Boolean(view.planar);
    this.views = choice('View', [
      ...(planar ? [['plane', 'Plane', 'View along the normal of the plane']] : []),
      ['3d', '3D', 'Perspective view'], ...(planar ? [] : [['top', 'Top', 'View from above']]), ['front', 'Front', 'View along y'], ['side', 'Side', 'View along x'],
    ], view.name, (name) => view.setView(name));
    const toggle = (key, label, title = '') => {
      if (has[key] === false) return false;
      const element = checkbox(label, true, (on) => { this.show[key] = on; changed(); });
      element.title = title;
      return element;
    };
    this.element = h('div', { class: 'settings' },
      h('fieldset', {}, h('legend', {}, 'View'), this.views),
      h('fieldset', { class: 'shows' }, h('legend', {}, 'Show'),
        toggle('map', 'map'), toggle('arm', 'arm'), toggle('spheres', 'collision spheres'), toggle('lines', 'closest points'),
        toggle('trail', 'tip trail'), toggle('drawings', 'sampled paths', 'Lines that the planner has drawn'), toggle('stops', 'stops'), toggle('goals', 'goals'), toggle('obstacles', 'obstacles'), toggle('paths', 'paths', 'Paths of moving obstacles'),
        toggle('predicted', 'predicted', 'Where moving obstacles are predicted to be, up to 1 s ahead'), toggle('floor', 'grid')),
      has.map && this.mapControls(),
      has.forces && this.forceControls(runs),
    );
  }

  mapControls() {
    const { reach, changed } = this;
    const distance = slider('within', { min: 0.01 * reach, max: 0.5 * reach, step: 0.005 * reach, value: 0.12 * reach, text: (d) => `${number(d, 2)} m` }, (d) => {
      if (this.near === null) nearBox.querySelector('input').checked = true;
      this.near = d;
      changed();
    });
    const nearBox = checkbox('only near the arm', false, (on) => {
      this.near = on ? Number(distance.input.value) : null;
      changed();
    });
    const scenes = this.view.scenes.filter((scene) => scene.voxels);
    const lo = [0, 1, 2].map((a) => Math.min(...scenes.map((scene) => scene.voxels.lo[a])));
    const hi = [0, 1, 2].map((a) => Math.max(...scenes.map((scene) => scene.voxels.hi[a])));
    const at = slider('cut at', { min: 0, max: 1, step: 'any', value: 0.5, text: (s) => (this.axis === undefined ? '–' : `${number(lo[this.axis] + s * (hi[this.axis] - lo[this.axis]), 3)} m`) }, () => cut());
    const flip = checkbox('other half', false, () => cut());
    const cut = () => {
      const a = this.axis;
      this.clip = a === undefined ? null : { axis: a, at: lo[a] + Number(at.input.value) * (hi[a] - lo[a]), flip: flip.querySelector('input').checked };
      at.input.disabled = flip.querySelector('input').disabled = a === undefined;
      at.set(Number(at.input.value));
      changed();
    };
    const axes = choice('Cut the map across', [['off', 'off', 'Show the whole map'], ['0', 'x', 'Cut across the x axis'], ['1', 'y', 'Cut across the y axis'], ['2', 'z', 'Cut across the z axis']], 'off', (key) => {
      this.axis = key === 'off' ? undefined : Number(key);
      cut();
    });
    at.input.disabled = flip.querySelector('input').disabled = true;
    return h('fieldset', { class: 'map' }, h('legend', {}, 'Map'),
      slider('opacity', { min: 0, max: 1, step: 0.05, value: this.opacity, text: (o) => `${Math.round(100 * o)} %` }, (o) => { this.opacity = o; changed(); }),
      h('div', { class: 'pair' }, nearBox, distance),
      h('div', { class: 'pair' }, h('span', { class: 'name' }, 'cut'), axes, at, flip));
  }

  forceControls(runs) {
    const order = ['potential', 'damping', 'gyroscopic', 'held', 'node'];
    const channels = [...new Set([...order, ...runs.flatMap((run) => run.frames.forces.map((force) => force.channel))])]
      .filter((channel) => runs.some((run) => run.frames.forces.some((force) => force.channel === channel)));
    this.bar = h('span', { class: 'bar' });
    this.barText = h('span', {});
    this.channelBoxes = channels.map((channel) => {
      const box = checkbox(CHANNEL_LABELS[channel] ?? channel, true, (on) => { this.channels[channel] = on; this.changed(); }, 'currentColor');
      box.dataset.channel = channel;
      return box;
    });
    const all = checkbox('arrows', true, (on) => { this.show.forces = on; this.changed(); });
    const element = h('fieldset', { class: 'forces' }, h('legend', { title: 'Forces that accelerate the tip as the joint torques of each channel of the planner do [N]' }, 'Forces'),
      all, h('div', { class: 'channels' }, this.channelBoxes),
      slider('length', { min: -1, max: 1, step: 0.05, value: 0, text: (s) => `${number(10 ** s, 2)}×` }, (s) => { this.forceScale = 10 ** s; this.changed(); }),
      h('div', { class: 'force-scale' }, this.bar, this.barText));
    this.paint();
    return element;
  }

  paint() {
    for (const box of this.channelBoxes ?? []) box.querySelector('.swatch').style.background = theme().channels[box.dataset.channel] ?? theme().axis;
  }

  /** Length of an arrow of 1 N [m]. */
  get metresPerNewton() {
    return this.typical > 0 ? (0.3 * this.reach * this.forceScale) / this.typical : 0;
  }

  /** Updates the scale bar of the forces, for the scale of the view at its centre. */
  showScale(pixelsPerMetre) {
    if (!this.bar || !(this.typical > 0)) return;
    const perNewton = this.metresPerNewton * pixelsPerMetre;
    const force = roundDown(90 / perNewton);
    this.bar.style.width = `${force * perNewton}px`;
    const text = `${number(force, 2)} N`;
    if (this.barText.textContent !== text) this.barText.textContent = text;
  }
}

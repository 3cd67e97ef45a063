// Builds the report's page and keeps all parts at the same time.
import { clearanceGradient, runColor, theme, themeName } from './colors.js';
import { readReport, valueAt } from './data.js';
import { h, themeSwitch } from './dom.js';
import { number, unitText } from './format.js';
import { Board } from './plots.js';
import { Replay } from './replay.js';
import { Settings } from './settings.js';
import { badge, comparison, notes, runLabel, sections } from './summary.js';
import { ACT_LABELS, Timeline } from './timeline.js';
import { View } from './view.js';

/** The text over a panel: the run, and its values at the current time. */
class Panel {
  constructor(run, i, alone, goals) {
    this.goals = goals;
    const plot = (id) => run.plots.find((candidate) => candidate.id === id && candidate.series.length);
    this.figures = [['clearance', ['clearance']], ['to the goal', ['goal', 'goal_joint']]]
      .map(([label, ids]) => [label, ids.map(plot).filter(Boolean)]).filter(([, found]) => found.length);
    this.values = this.figures.map(() => h('output', {}));
    this.goal = h('output', {});
    this.acts = run.acts;
    this.act = h('output', {});
    this.ended = h('span', { class: 'over', hidden: true }, 'run has ended');
    this.element = h('div', { class: 'panel' },
      h('div', { class: 'hud' },
        h('div', { class: 'hud-name' }, !alone && runLabel(run, i), !alone && badge(run.outcome), this.ended),
        h('dl', {}, this.figures.map(([label], j) => [h('dt', {}, label), h('dd', {}, this.values[j])]), goals > 0 && [h('dt', {}, 'goal'), h('dd', {}, this.goal)], this.acts.length > 0 && [h('dt', {}, 'evasion'), h('dd', {}, this.act)])));
    this.element.firstChild.hidden = alone && goals === 0 && this.figures.length === 0;
  }

  showTime(t, replay) {
    this.figures.forEach(([, plots], j) => {
      const parts = plots.flatMap((plot) => {
        // A plot with several units has one unit per line.
        const units = plot.unit.split(/, */).map(unitText);
        const last = plot.t[plot.t.length - 1];
        return plot.series.map(({ y }, s) => [valueAt(plot.t, y, Math.min(t, last)), units[Math.min(s, units.length - 1)]]);
      }).filter(([value]) => Number.isFinite(value));
      this.values[j].textContent = parts.map(([value, unit]) => `${number(value, 3)} ${unit}`).join(', ') || '–';
    });
    const index = replay.goalIndex;
    this.goal.textContent = index >= this.goals ? `all ${this.goals} reached` : `${index + 1} of ${this.goals}`;
    this.act.textContent = ACT_LABELS[this.acts.find((span) => t >= span.t && t < span.until)?.act] ?? 'none';
    this.ended.hidden = t <= replay.end + 1e-9;
  }
}

/** Colour scale of the collision spheres, in metres. */
function clearanceLegend(influence) {
  const bar = h('span', { class: 'gradient' });
  bar.style.background = clearanceGradient();
  const beyond = h('span', { class: 'beyond' });
  return h('div', { class: 'scale' }, h('span', { class: 'scale-title' }, 'clearance of a sphere [m]'),
    h('div', { class: 'scale-row' }, h('div', { class: 'scale-bar' }, bar, h('div', { class: 'scale-ticks' }, [0, 0.5, 1].map((s) => h('span', {}, number(s * influence, 2))))), h('div', { class: 'scale-beyond' }, beyond, h('span', {}, 'beyond'))));
}

/** The 3D view, or null without WebGL, after `failed` has been called. */
function createView(report, replays, panels, row, failed) {
  try {
    return new View(row, panels.map((panel) => panel.element), replays);
  } catch (error) {
    failed(error);
    return null;
  }
}

async function start() {
  const report = await readReport();
  const { runs, worlds, title } = report;
  if (!runs.length) throw new Error('This report contains no runs.');
  document.title = `${title} · hamelin`;
  const alone = runs.length === 1;
  const replays = runs.map((run, i) => new Replay(run, worlds[run.world], i));
  const duration = Math.max(...replays.map((replay) => replay.end), 0);

  let now = 0;
  let view = null;
  let settings = null;
  const setTime = (t) => {
    now = Math.min(duration, Math.max(0, Number.isFinite(t) ? t : 0));
    replays.forEach((replay, i) => {
      replay.setTime(now);
      panels[i].showTime(now, replay);
    });
    view?.update(now);
    board.showTime(now);
    timeline.showTime(now);
  };
  const timeline = new Timeline(runs, duration, setTime);
  const board = new Board(runs, duration, setTime);
  const panels = runs.map((run, i) => new Panel(run, i, alone, worlds[run.world].goals.length));
  const repaint = () => {
    for (const dot of document.querySelectorAll('.dot')) dot.style.background = runColor(Number(dot.dataset.run));
    for (const swatch of document.querySelectorAll('.beyond')) swatch.style.background = theme().beyond;
    document.documentElement.dataset.shown = themeName();
    timeline.paint();
    board.paint();
    settings?.paint();
    view?.paint();
  };

  const row = h('div', { class: 'panels' }, panels.map((panel) => panel.element));
  const viewSection = h('section', { class: 'view', 'aria-label': 'Replay' }, row);
  const plots = h('section', { class: 'plots', 'aria-label': 'Plots' },
    h('div', { class: 'plots-head' }, h('h2', {}, 'Plots'), h('p', { class: 'quiet' }, 'Click: set the time · Drag: zoom · Shift-drag: move the time'), board.sharedScale, board.resetButton),
    board.overlays.length > 0 && h('div', { class: 'overlays' }, board.overlays.map((group) => group.element)),
    !alone && h('div', { class: 'plot-cells column-heads', 'aria-hidden': 'true' }, runs.map((run, i) => h('div', {}, runLabel(run, i)))),
    board.groups.map((group) => group.element));
  document.documentElement.style.setProperty('--columns', runs.length);
  document.getElementById('app').replaceChildren(
    h('header', { class: 'head' },
      h('div', {}, h('h1', {}, title), h('p', { class: 'quiet' }, `${alone ? 'one run' : `${runs.length} runs`} · ${[...new Set(runs.map((run) => worlds[run.world].robot.name))].join(', ')} · ${report.generator}`)),
      themeSwitch(repaint)),
    comparison(runs), notes(runs) ?? '',
    h('main', { class: alone ? 'alone' : 'several' }, viewSection, plots),
    sections(report, (t) => setTime(t)),
    timeline.element);
  board.build();

  view = createView(report, replays, panels, row, (error) => {
    row.classList.add('no-webgl');
    row.prepend(h('p', { class: 'no-webgl-note', role: 'status' }, 'The 3D view needs WebGL, which this browser does not provide. Plots and tables are complete without it.', h('br'), h('small', {}, String(error.message ?? error))));
  });
  if (view) {
    const changed = () => {
      view.apply(settings);
      setTime(now);
      scale();
    };
    settings = new Settings(runs, worlds, view, changed);
    const scale = () => {
      const { camera, controls } = view;
      const high = row.clientHeight;
      const metres = camera.isPerspectiveCamera
        ? 2 * camera.position.distanceTo(controls.target) * Math.tan((camera.fov * Math.PI) / 360)
        : (camera.top - camera.bottom) / camera.zoom;
      settings.showScale(high / metres);
    };
    const influence = Math.max(...runs.map((run) => (run.frames.clearance ? run.frames.influence : 0)));
    row.append(h('div', { class: 'corner' }, influence > 0 && clearanceLegend(influence), h('span', { class: 'grid-note' }, `grid ${number(view.gridStep, 1)} m`)));
    viewSection.append(settings.element);
    view.controls.addEventListener('change', scale);
    new ResizeObserver(scale).observe(row);
    view.apply(settings);
    scale();
  }
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', repaint);
  repaint();
  // A link may open the page at a time: page.html#t=1.5
  setTime(Number(/^#t=([\d.]+)$/.exec(location.hash)?.[1] ?? 0));
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));

  Object.assign(window.hamelin, {
    setTime,
    time: () => now,
    /** Position of the tip of a run's arm in the world [m]. */
    pose: (i) => [...replays[i].tip],
    /** Where the moving obstacles of a run are predicted to be, with the first scale of each copy. */
    predicted: (i) => view.scenes[i].predictions.items.map(({ meshes }) => meshes.map((mesh) => ({ position: mesh.position.toArray(), scale: mesh.scale.x }))),
    counts: () => ({
      runs: runs.length,
      frames: runs.map((run) => run.frames.t.length),
      plots: board.all.reduce((sum, group) => sum + group.cells.length, 0),
      voxels: view ? view.scenes.map((scene) => scene.voxels?.total ?? 0) : null,
      voxelsShown: view ? view.voxelsShown : null,
      paths: view ? view.scenes.map((scene) => scene.paths.count) : null,
      stopsShown: view ? view.scenes.map((scene) => scene.stop.stop !== null) : null,
      drawn: view?.drawn ?? 0,
    }),
    duration,
    view,
    zoom: () => [...board.zoom],
  });
}

window.hamelin = {};
window.hamelin.ready = start().catch((error) => {
  document.getElementById('app').replaceChildren(h('p', { class: 'boot', role: 'alert' }, String(error.message ?? error)));
  throw error;
});

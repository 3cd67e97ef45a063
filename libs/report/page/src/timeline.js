// The bar at the bottom of the page: play, step, time, speed, the events as ticks, and a band with
// evasions and stops.
import { runColor, theme } from './colors.js';
import { h, icon } from './dom.js';
import { milliseconds, seconds } from './format.js';

/** What an arm does about moving obstacles, for tooltips and legend. */
export const ACT_LABELS = { stop: 'stops', back: 'goes back', aside: 'goes aside' };

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

export class Timeline {
  /**
   * @param {object[]} runs
   * @param {number} duration [s]
   * @param {(t: number) => void} setTime
   */
  constructor(runs, duration, setTime) {
    this.runs = runs;
    this.duration = duration;
    this.setTime = setTime;
    this.now = 0;
    this.speed = 1;
    this.playing = false;
    const button = (name, title, action) => h('button', { type: 'button', class: 'icon', title, 'aria-label': title, onclick: action }, icon(name));
    this.play = button('play', 'Play (space)', () => this.toggle());
    this.play.classList.add('play');
    this.range = h('input', { type: 'range', min: 0, max: duration, step: 'any', class: 'time', 'aria-label': 'Time [s]', oninput: () => this.jump(Number(this.range.value)) });
    this.range.value = 0;
    this.readout = h('output', { class: 'readout', 'aria-label': 'Time' });
    this.rate = h('select', { 'aria-label': 'Speed', title: 'Speed', onchange: () => { this.speed = Number(this.rate.value); } }, SPEEDS.map((s) => h('option', { value: s, selected: s === 1 }, `${s}×`)));
    this.tip = h('div', { class: 'event-tip', hidden: true });
    this.ticks = h('div', { class: 'event-ticks', style: `--rows:${runs.length}` });
    this.acts = h('div', { class: 'act-spans', style: `--rows:${runs.length}` });
    this.stops = h('div', { class: 'stop-spans', style: `--rows:${runs.length}` });
    this.element = h('section', { class: 'timeline', 'aria-label': 'Time' },
      h('div', { class: 'buttons' }, button('start', 'Go to the start (Home)', () => this.jump(0)), button('back', 'Previous frame (left arrow)', () => this.step(-1)), this.play, button('forward', 'Next frame (right arrow)', () => this.step(1))),
      this.readout,
      h('div', { class: 'track' }, this.ticks, this.acts, this.stops, this.range, this.tip, this.legend()),
      h('label', { class: 'speed' }, h('span', {}, 'Speed'), this.rate),
    );
    this.addTicks();
    addEventListener('keydown', (event) => this.handleKey(event));
  }

  addTicks() {
    this.runs.forEach((run, row) => {
      const named = this.runs.length > 1 ? `${run.name}: ` : '';
      for (const event of run.events) {
        if (event.t === null || event.t === undefined) continue;
        this.addMark(this.ticks, row, event.t, `${seconds(event.t)} · ${named}${event.text}`);
      }
      for (const { t, until, act } of run.acts) {
        const mark = this.addMark(this.acts, row, t, `${seconds(t)} · ${named}evades for ${seconds(until - t)}: ${ACT_LABELS[act]}`);
        mark.style.setProperty('--share', this.share(until - t));
        mark.dataset.act = act;
      }
      for (const { t, until, cause } of run.stops) {
        const mark = this.addMark(this.stops, row, t, `${seconds(t)} · ${named}stop of ${milliseconds(until - t)}: ${cause.replaceAll('_', ' ')}`);
        mark.style.setProperty('--share', this.share(until - t));
      }
    });
    this.paint();
  }

  /** The colours in the band, or null if it is empty. */
  legend() {
    this.keys = Object.entries(ACT_LABELS).filter(([act]) => this.runs.some((run) => run.acts.some((span) => span.act === act)))
      .map(([act, label]) => h('span', { class: 'key', 'data-act': act }, h('i', {}), label));
    if (this.keys.length) this.keys.unshift(h('span', {}, 'evades:'));
    if (this.runs.some((run) => run.stops.length)) this.keys.push(h('span', { class: 'key' }, h('i', { class: 'shield' }), 'stop of the shield'));
    return this.keys.length > 0 && h('div', { class: 'band-legend' }, this.keys);
  }

  share(t) {
    return this.duration > 0 ? t / this.duration : 0;
  }

  /** A mark at a time of a run, which jumps there and shows its text under the pointer. */
  addMark(bar, row, t, text) {
    const mark = h('button', { type: 'button', tabIndex: -1, 'aria-label': text, onclick: () => this.jump(t) });
    mark.dataset.run = row;
    mark.style.setProperty('--at', this.share(t));
    mark.style.setProperty('--row', row);
    mark.addEventListener('pointerenter', () => {
      this.tip.textContent = text;
      this.tip.hidden = false;
      this.tip.style.setProperty('--at', Math.min(0.93, Math.max(0.07, this.share(t))));
    });
    mark.addEventListener('pointerleave', () => { this.tip.hidden = true; });
    bar.append(mark);
    return mark;
  }

  paint() {
    for (const tick of this.ticks.children) tick.style.background = runColor(Number(tick.dataset.run));
    for (const span of this.acts.children) span.style.background = theme().acts[span.dataset.act];
    for (const key of this.keys) if (key.dataset.act) key.firstChild.style.background = theme().acts[key.dataset.act];
  }

  /** Sets the time; playing continues from there. */
  jump(t) {
    this.setTime(t);
  }

  /** Goes to the next or the previous frame of any run. */
  step(direction) {
    this.pause();
    let next = direction > 0 ? this.duration : 0;
    for (const { frames } of this.runs) {
      for (const t of frames.t) {
        if (direction > 0 && t > this.now + 1e-9 && t < next) next = t;
        if (direction < 0 && t < this.now - 1e-9 && t > next) next = t;
      }
    }
    this.setTime(next);
  }

  toggle() {
    if (this.playing) this.pause();
    else this.start();
  }

  start() {
    if (this.now >= this.duration) this.setTime(0);
    this.playing = true;
    this.setPlayButton('pause', 'Pause (space)');
    let before = performance.now();
    const tick = (clock) => {
      if (!this.playing) return;
      // The limit makes the replay continue where it stopped while the page was suspended, for
      // example in a hidden tab.
      const passed = Math.min(Math.max(0, clock - before), 250) / 1000;
      before = clock;
      const t = Math.min(this.duration, this.now + passed * this.speed);
      this.setTime(t);
      if (t >= this.duration) this.pause();
      else requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  pause() {
    this.playing = false;
    this.setPlayButton('play', 'Play (space)');
  }

  setPlayButton(name, title) {
    this.play.replaceChildren(icon(name));
    this.play.title = title;
    this.play.setAttribute('aria-label', title);
  }

  handleKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { target } = event;
    const own = target === this.range;
    const takesArrows = !own && (target.matches?.('input[type=range], select, textarea, input[type=text]') ?? false);
    const takesSpace = target.matches?.('button, select, summary, textarea, input[type=checkbox], input[type=text], a') ?? false;
    const actions = { ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), Home: () => this.jump(0), End: () => this.jump(this.duration) };
    if (event.key === ' ' && !takesSpace) this.toggle();
    else if (actions[event.key] && !takesArrows) actions[event.key]();
    else return;
    event.preventDefault();
  }

  showTime(t) {
    this.now = t;
    this.range.value = t;
    this.range.style.setProperty('--done', this.duration > 0 ? t / this.duration : 0);
    this.range.setAttribute('aria-valuetext', seconds(t));
    const text = `${t.toFixed(3)} / ${seconds(this.duration)}`;
    if (this.readout.textContent !== text) this.readout.textContent = text;
  }
}

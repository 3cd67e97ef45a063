// Lines that the planner has drawn, such as the paths of the tip that it has sampled.
import { BufferAttribute, BufferGeometry, Group, LineBasicMaterial, LineSegments } from 'three';
import { indexAt } from './data.js';

/** A drawing is shown until the next one, but not longer than this [s]. */
const SHOWN = 0.5;

export class Drawings {
  constructor({ drawings }) {
    this.group = new Group();
    this.drawings = drawings;
    this.shown = -1;
    if (!drawings) return;
    // Index of the first line and point of each drawing, and of the end.
    this.first = [];
    let line = 0;
    let point = 0;
    let most = 0;
    for (const count of drawings.lines) {
      this.first.push({ line, point });
      let pieces = 0;
      for (const end = line + count; line < end; ++line) {
        point += drawings.points[line];
        pieces += Math.max(0, drawings.points[line] - 1);
      }
      most = Math.max(most, pieces);
    }
    this.position = new BufferAttribute(new Float32Array(6 * most), 3);
    this.material = new LineBasicMaterial({ transparent: true, opacity: 0.3, depthWrite: false });
    this.lines = new LineSegments(new BufferGeometry().setAttribute('position', this.position), this.material);
    this.lines.frustumCulled = false;
    this.group.add(this.lines);
  }

  paint(colors, accent) {
    if (this.drawings) this.material.color.set(accent);
  }

  update(t) {
    if (!this.drawings) return;
    const times = this.drawings.t;
    const at = indexAt(times, t + 1e-9);
    const age = t - times[at];
    this.lines.visible = age > -1e-9 && age <= SHOWN;
    if (this.lines.visible && at !== this.shown) this.show(at);
  }

  show(at) {
    this.shown = at;
    const { lines, points, position_m: p } = this.drawings;
    const out = this.position.array;
    let { line, point } = this.first[at];
    let n = 0;
    for (const end = line + lines[at]; line < end; ++line) {
      for (let i = 1; i < points[line]; ++i)
        for (const k of [point + i - 1, point + i]) {
          out[n++] = p[3 * k];
          out[n++] = p[3 * k + 1];
          out[n++] = p[3 * k + 2];
        }
      point += points[line];
    }
    this.position.needsUpdate = true;
    this.lines.geometry.setDrawRange(0, n / 3);
  }
}

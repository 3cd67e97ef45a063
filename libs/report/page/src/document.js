// Common parts of the pages with tables and plots: data, header, theme.
import { seriesColor, themeName } from './colors.js';
import { readData } from './data.js';
import { h, themeSwitch } from './dom.js';

/** Sets the colours of the series, which the drawings use as --series-0 to --series-7. */
function paint() {
  const root = document.documentElement;
  for (let i = 0; i < 8; ++i) root.style.setProperty(`--series-${i}`, seriesColor(i));
  root.dataset.shown = themeName();
}

/** A list of remarks. */
export const notes = (lines) => lines.length > 0 && h('ul', { class: 'notes' }, lines.map((line) => h('li', {}, line)));

/** A section of the page with a heading; nothing if it has no content. */
export function section(title, ...content) {
  const children = content.flat().filter(Boolean);
  return children.length > 0 && h('section', { 'aria-label': title }, h('h2', {}, title), children);
}

/**
 * Reads the page's data and draws it.
 * @param {(data: object) => {title: string, about: string, content: (Node | false | null)[]}} draw
 */
export function showDocument(format, draw) {
  const start = async () => {
    const data = await readData(format);
    const { title, about, content } = draw(data);
    document.title = `${title} · hamelin`;
    document.getElementById('app').replaceChildren(
      h('header', { class: 'head' }, h('div', {}, h('h1', {}, title), h('p', { class: 'quiet' }, `${about} · ${data.generator}`)), themeSwitch(paint)),
      h('main', {}, content.flat().filter(Boolean)));
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', paint);
    paint();
  };
  window.hamelin = {};
  window.hamelin.ready = start().catch((error) => {
    document.getElementById('app').replaceChildren(h('p', { class: 'boot', role: 'alert' }, String(error.message ?? error)));
    throw error;
  });
}

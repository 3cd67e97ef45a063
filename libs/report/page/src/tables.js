// Tables of text and numbers.
import { h } from './dom.js';

/** A cell as {content, class}. */
const parts = (cell) => (cell !== null && typeof cell === 'object' && !Array.isArray(cell) && !(cell instanceof Node) ? cell : { content: cell });

/**
 * @param {{caption: string, shown?: boolean, head: Cell[], words?: number,
 *   rows: {cells: Cell[], class?: string}[]}} table
 *   A Cell is a string, a node, a list of lines, or {content, class, style} with one of these. The first
 *   `words` columns contain text and the others numbers, unless a cell has its own class. The first
 *   cell of a row is its header. `shown`: the caption is visible and not only for screen readers.
 */
export function table({ caption, shown = false, head, words = 1, rows }) {
  const lines = (content) => (Array.isArray(content) ? content.flatMap((line, i) => (i ? [h('br'), line] : [line])) : content);
  const cells = (list, tag) => list.map((cell, i) => {
    const { content, class: kind = i < words ? 'text' : null, style } = parts(cell);
    const [name, props] = tag(i, kind);
    return h(name, { ...props, style }, lines(content));
  });
  return h('div', { class: 'table-box', tabIndex: 0, role: 'region', 'aria-label': caption },
    h('table', { class: 'figures' },
      shown && h('caption', {}, caption),
      h('thead', {}, h('tr', {}, cells(head, (i, kind) => ['th', { scope: 'col', class: kind }]))),
      h('tbody', {}, rows.map((row) => h('tr', { class: row.class }, cells(row.cells, (i, kind) => (i ? ['td', { class: kind }] : ['th', { scope: 'row', class: kind }])))))));
}

// Why runs failed: classes of failures, with the causes and runs of each.
import { section } from './document.js';
import { h } from './dom.js';
import { naturally } from './runs.js';
import { table } from './tables.js';

const CAUSES_MOST = 20;
const RUNS_MOST = 20;
const PLANNERS_MOST = 8;

/** A command with a button that copies it. */
export function commandBox(command) {
  const code = h('code', { class: 'command' }, command);
  const button = h('button', {
    type: 'button', class: 'small',
    onclick: async () => {
      try {
        await navigator.clipboard.writeText(command);
        button.textContent = 'Copied';
      } catch {  // not allowed: select it, so that it can be copied
        getSelection().selectAllChildren(code);
        button.textContent = 'Selected';
      }
    },
  }, 'Copy');
  return h('div', { class: 'command-box' }, code, button);
}

/** A link to the replayed scene of a run, or nothing. */
export const replayLink = (runs, i) => {
  const address = runs.replay(i);
  return address && h('a', { href: address, 'aria-label': `Replayed scene of ${runs.ids[i]}` }, 'replayed scene');
};

function tally(items) {
  const counts = new Map();
  for (const item of items) counts.set(item, (counts.get(item) ?? 0) + 1);
  return [...counts].sort(([a, m], [b, n]) => n - m || naturally(a, b));
}

/** The causes as the runs gave them, and the first runs. Drawn when it is opened. */
function classDetails(runs, { name, members }) {
  const details = h('details', { class: 'failure-class' }, h('summary', {}, `${members.length} × ${name}`));
  const draw = () => {
    const causes = tally(members.map((i) => runs.text('contact', i) || runs.text('cause', i) || 'no cause given'));
    const first = [...members].sort((a, b) => (runs.replay(b) ? 1 : 0) - (runs.replay(a) ? 1 : 0) || a - b).slice(0, RUNS_MOST);
    details.append(
      h('ul', { class: 'causes' }, causes.slice(0, CAUSES_MOST).map(([cause, count]) => h('li', {}, `${count} × ${cause}`)),
        causes.length > CAUSES_MOST && h('li', {}, `and ${causes.length - CAUSES_MOST} other texts`)),
      members.length > RUNS_MOST && h('p', {}, `The first ${RUNS_MOST} of ${members.length} runs; the table of all runs has the others.`),
      table({
        caption: `Runs that failed by ${name}`, words: 3, head: ['run', 'scene', 'command that repeats it'],
        rows: first.map((i) => ({ cells: [runs.ids[i], replayLink(runs, i) ?? '–', { content: commandBox(runs.command(i)), class: 'text' }] })),
      }));
  };
  details.addEventListener('toggle', draw, { once: true });
  return details;
}

/** @param {(name: string) => void} show shows the runs of a class in the table of all runs */
export function failureSection(runs, show) {
  if (!runs.failed.length) return null;
  const column = runs.texts.get('failure');
  const classes = runs.group([column], runs.failed).map(({ key, members }) => ({ name: key[0], members })).sort((a, b) => b.members.length - a.members.length || naturally(a.name, b.name));
  const planners = runs.labels.get('planner') ?? { values: [], index: [] };
  const order = planners.values.map((name, k) => [name, k]).sort(([a], [b]) => naturally(a, b)).slice(0, PLANNERS_MOST);
  const row = ({ name, members }) => {
    const counts = new Map();
    for (const i of members) counts.set(planners.index[i], (counts.get(planners.index[i]) ?? 0) + 1);
    const linked = members.filter((i) => runs.replay(i)).slice(0, 3);
    const cells = [
      { content: name, class: 'cause' },
      { content: h('button', { type: 'button', class: 'small', 'aria-label': `Show the ${members.length} runs of: ${name}`, onclick: () => show(name) }, String(members.length)) },
      ...order.map(([, k]) => String(counts.get(k) ?? 0)),
    ];
    if (Object.keys(runs.replays).length) cells.push({ content: linked.length ? linked.flatMap((i, n) => [n > 0 && ', ', replayLink(runs, i)]).filter(Boolean) : '–', class: 'text links' });
    return { cells };
  };
  return section('Why runs did not reach their goal',
    h('p', {}, 'Failures with the same outcome and the same cause form a class. Numbers in a cause are replaced by N and names by ‘*’; the causes as the runs gave them, and commands that repeat the runs, are below the table. Press a number to see its runs.'),
    table({
      caption: 'Classes of failures', head: [{ content: 'outcome: cause', class: 'text' }, 'runs', ...order.map(([name]) => name), ...(Object.keys(runs.replays).length ? [{ content: 'look', class: 'text' }] : [])],
      rows: classes.map(row),
    }),
    planners.values.length > PLANNERS_MOST && h('p', {}, `The first ${PLANNERS_MOST} of ${planners.values.length} planners have a column.`),
    h('div', { class: 'failure-classes' }, classes.map((one) => classDetails(runs, one))));
}

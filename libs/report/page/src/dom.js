// Functions that create elements.

/**
 * Creates an element with properties and children. `class`, `style` and names with a dash are set
 * as attributes; `on…` are listeners.
 * @returns {HTMLElement}
 */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(props ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (key in element && key !== 'style' && key !== 'list') element[key] = value;
    else element.setAttribute(key === 'class' ? 'class' : key, value === true ? '' : value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** Creates an SVG element with attributes and children. */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== undefined && value !== null && value !== false) element.setAttribute(key, value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

const ICONS = {
  play: 'M5 3.2v11.6L15 9z',
  pause: 'M4.5 3h3v12h-3zM10.5 3h3v12h-3z',
  back: 'M13.5 3.4v11.2L5.8 9zM3.6 3.4h1.9v11.2H3.6z',
  forward: 'M4.5 3.4v11.2L12.2 9zM12.5 3.4h1.9v11.2h-1.9z',
  start: 'M15 3.4v11.2L9 9.2v5.4L1.8 9 9 3.4v5.4z',
};

/** An icon, hidden from screen readers, which read the name of its button. */
export function icon(name) {
  return svg('svg', { viewBox: '0 0 18 18', 'aria-hidden': 'true' }, svg('path', { d: ICONS[name] }));
}

/** A labelled check box; `changed` is called with the new state. */
export function checkbox(label, checked, changed, swatch = null) {
  const input = h('input', { type: 'checkbox', checked, onchange: () => changed(input.checked) });
  return h('label', { class: 'check' }, input, swatch && h('span', { class: 'swatch', style: `background:${swatch}` }), label);
}

/** A labelled slider that shows its value as text. */
export function slider(label, { min, max, step, value, text }, changed) {
  const output = h('output', {}, text(value));
  const input = h('input', {
    type: 'range', min, max, step, 'aria-label': label,
    oninput: () => {
      output.textContent = text(Number(input.value));
      changed(Number(input.value));
    },
  });
  input.value = value;
  const element = h('label', { class: 'slider' }, h('span', {}, label), input, output);
  element.set = (next) => {
    input.value = next;
    output.textContent = text(Number(input.value));
  };
  element.input = input;
  return element;
}

/** A group of buttons, one of which is pressed. `pick` is called with the key of the new one. */
export function choice(label, options, value, pick) {
  const buttons = new Map();
  const element = h('div', { class: 'choice', role: 'group', 'aria-label': label });
  element.set = (key) => buttons.forEach((button, other) => button.setAttribute('aria-pressed', String(other === key)));
  for (const [key, text, title] of options) {
    const button = h('button', { type: 'button', title, onclick: () => { element.set(key); pick(key); } }, text);
    buttons.set(key, button);
    element.append(button);
  }
  element.set(value);
  return element;
}

/** Light, dark or the theme of the system; `changed` is called after the switch. */
export function themeSwitch(changed) {
  return choice('Colours', [['auto', 'Auto', 'Follow the system setting'], ['light', 'Light', 'Light'], ['dark', 'Dark', 'Dark']], 'auto', (key) => {
    if (key === 'auto') delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = key;
    changed();
  });
}

/** Small helpers for the document. Nothing here takes text for markup. */

/**
 * Make an element.
 * @param {string} tag
 * @param {Record<string, any>} attributes `class`, `on…` (listeners), `data-…`, `aria-…` and the like; true, false, null as
 *   usual; a property where the name begins with a dot (`.value`).
 * @param {...(Node | string | null)} children
 * @returns {any}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (name.startsWith('.')) element[name.slice(1)] = value;
    else element.setAttribute(name, value === true ? '' : String(value));
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

/** A picture from the page's own set; it says nothing to screen readers. */
export function icon(name) {
  const space = 'http://www.w3.org/2000/svg';
  const svg = document.createElementNS(space, 'svg');
  const use = document.createElementNS(space, 'use');
  use.setAttribute('href', `/static/icons.svg#${name}`);
  svg.setAttribute('aria-hidden', 'true');
  svg.classList.add('icon');
  svg.append(use);
  return svg;
}

/** A button with a picture and words. */
export function button(words, picture, act, attributes = {}) {
  const inside = picture === null ? [] : [icon(picture)];
  return make('button', {type: 'button', onclick: act, ...attributes}, ...inside, make('span', {class: 'label'}, words));
}

/** An element of the page that must be there. */
export function byId(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element #${id}`);
  return element;
}

/** A sentence as it begins: with a capital letter. */
export function capital(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** Whether a key that was pressed there belongs to what has the focus: a field, a list, a dialog and the like. */
export function takesKeys(target) {
  return target instanceof Element && target.closest(
    'input, textarea, select, summary, dialog, [role="grid"], [role="tab"], [role="slider"], [contenteditable], .panel',
  ) !== null;
}

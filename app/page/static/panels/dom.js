// Elements, made without markup in strings: nothing that comes over the wire is ever parsed as HTML.

/** An element with attributes (`class`, `aria-…`; `on…` functions become listeners) and children (nodes or texts). */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else if (typeof value === 'boolean') element.toggleAttribute(name, value);
    else if (value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** A button that stays pressed; `changed(pressed)` is called when it is. */
export function toggle(label, pressed, changed) {
  const button = make('button', {type: 'button', class: 'tm-button', 'aria-pressed': String(pressed)}, label);
  button.addEventListener('click', () => {
    const now = button.getAttribute('aria-pressed') !== 'true';
    button.setAttribute('aria-pressed', String(now));
    changed(now);
  });
  return button;
}

/** Loads the panels' style sheet once: the page's Content-Security-Policy admits no inline style. */
export function useStyles() {
  const href = new URL('../panels.css', import.meta.url).href;
  if ([...document.styleSheets].some((sheet) => sheet.href === href)) return;
  if (document.querySelector('link[data-touchmove-panels]')) return;
  document.head.append(make('link', {rel: 'stylesheet', href, 'data-touchmove-panels': ''}));
}

/** Sets a text only where it changed, so that screen readers and layout are left alone. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

const announced = new WeakMap();
const RARELY = 8000; // [ms] between two sentences of one live region, so that speech keeps up

/** Puts a sentence into a polite live region, no more often than every 8 s: of several the last one counts. */
export function announce(region, text) {
  const before = announced.get(region) ?? {at: -Infinity, timer: 0, text: ''};
  clearTimeout(before.timer);
  const wait = Math.max(0, before.at + RARELY - performance.now());
  const state = {...before, text};
  announced.set(region, state);
  if (wait === 0) {
    say(region, text);
    state.at = performance.now();
  } else {
    state.timer = setTimeout(() => {
      say(region, state.text);
      state.at = performance.now();
    }, wait);
  }
}

/** Forgets what a live region was still to say. */
export function silence(region) {
  clearTimeout(announced.get(region)?.timer);
  announced.delete(region);
}

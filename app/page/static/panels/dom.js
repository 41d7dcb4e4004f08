// What all panels share: buttons that stay pressed, their style sheet, and sentences for screen readers.

import {make} from '../dom.js';

export {icon, make} from '../dom.js';

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

/** Loads a style sheet of the page once: its Content-Security-Policy admits no inline style. */
export function useStyles(address = './css/panels.css') {
  const href = new URL(`../${address}`, import.meta.url).href;
  if ([...document.querySelectorAll('link[rel="stylesheet"]')].some((link) => link.href === href)) return;
  document.head.append(make('link', {rel: 'stylesheet', href}));
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

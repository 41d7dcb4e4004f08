/** Dialogs: one way to open them, close them, and ask yes or no. */

import {button, icon, make} from '../dom.js';

let count = 0;

/**
 * Open a dialog; Escape, its cross and a click beside it close it.
 * @param {{title: string, content: Node[], wide?: boolean, name?: string, closed?: () => void}} what
 * @returns {{element: HTMLDialogElement, body: HTMLElement, close: () => void}}
 */
export function openDialog({title, content, wide = false, name = '', closed = () => {}}) {
  count += 1;
  const id = `dialog-title-${count}`;
  const body = make('div', {class: 'dialog-body'}, ...content);
  const cross = make('button', {type: 'button', class: 'quiet cross', 'aria-label': 'Close', onclick: () => dialog.close()}, icon('close'));
  let pressed = null;
  const dialog = make(
    'dialog',
    {
      class: wide ? 'wide' : '', 'aria-labelledby': id, 'data-dialog': name,
      onclose: () => {
        dialog.remove();
        closed();
      },
      // a press that began inside, as a slider that is dragged too far, does not close it
      onpointerdown: (event) => {
        pressed = event.target;
      },
      onclick: (event) => {
        if (event.target === dialog && pressed === dialog) dialog.close();
      },
    },
    make('header', {class: 'dialog-head'}, make('h2', {id}, title), stopButton(), cross),
    body,
  );
  document.getElementById('dialogs').append(dialog);
  dialog.showModal();
  return {element: dialog, body, close: () => dialog.close()};
}

/** STOP once more, since a dialog covers the one in the head of the page. */
export function stopButton() {
  const here = make('button', {type: 'button', class: 'stop-here', onclick: () => document.getElementById('stop').click()});
  matchStop(here);
  return here;
}

/** A dialog's STOP as the one in the head of the page is now. */
export function matchStop(here) {
  const {disabled, hidden} = document.getElementById('stop');
  Object.assign(here, {disabled, hidden, textContent: document.getElementById('stop-text').textContent});
}

/**
 * Ask yes or no.
 * @param {{title: string, text: string, yes: string, danger?: boolean}} what
 * @returns {Promise<boolean>}
 */
export function confirm({title, text, yes, danger = false}) {
  return new Promise((resolve) => {
    let answer = false;
    const settle = (value) => () => {
      answer = value;
      dialog.close();
    };
    const dialog = openDialog({
      title, name: 'confirm',
      content: [
        make('p', {}, text),
        make(
          'div', {class: 'dialog-actions'},
          button('Cancel', null, settle(false), {autofocus: true}),
          button(yes, null, settle(true), {class: danger ? 'danger' : 'primary'}),
        ),
      ],
      closed: () => resolve(answer),
    });
  });
}

/** A group of choices of which one holds. */
export function choices(legend, name, options, chosen, changed) {
  return make(
    'fieldset', {class: 'choice'},
    make('legend', {}, legend),
    make('div', {class: 'segments'}, ...options.map(([value, words]) => make(
      'label', {},
      make('input', {type: 'radio', name, value, checked: value === chosen, onchange: () => changed(value)}),
      make('span', {}, words),
    ))),
  );
}

/** A switch with words. */
export function toggle(words, on, changed, attributes = {}) {
  return make(
    'label', {class: 'toggle'},
    make('input', {type: 'checkbox', role: 'switch', checked: on, onchange: (event) => changed(event.target.checked), ...attributes}),
    make('span', {}, words),
  );
}

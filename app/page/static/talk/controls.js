/** Who holds the controls, and handing them over. */

import {byId, button, icon, make} from '../dom.js';
import {openDialog} from '../dialogs/dialog.js';

/**
 * Make the chip in the head of the page, its dialog and its banners.
 * @param {import('../store.js').Store} store
 * @param {ReturnType<typeof import('./banners.js').makeBanners>} banners
 */
export function mountControls(store, banners) {
  const chip = byId('open-controls');
  let dialog = null;

  const act = (action) => () => {
    if (!store.send({type: 'controls', action})) store.set('refused', 'There is no connection to the game: nothing was sent');
  };

  function who() {
    const controls = store.get('controls');
    if (controls === null) return {short: 'Controls', long: '', actions: []};
    const {you, holder, asking} = controls;
    if (holder === you) {
      const asks = asking !== null && asking !== you;
      return {
        short: 'You have the controls',
        long: asks ? 'You have the controls. Somebody else is asking for them.' : 'You have the controls: what you say and play here counts.',
        actions: asks
          ? [button('Hand over', 'give', act('give'), {class: 'primary'}), button('Keep', null, act('keep'))]
          : [button('Release the controls', 'release', act('release'))],
      };
    }
    if (holder === null) {
      return {
        short: 'Take the controls', long: 'Nobody has the controls.',
        actions: [button('Take the controls', 'take', act('take'), {class: 'primary'})],
      };
    }
    const asked = asking === you;
    return {
      short: asked ? 'You asked for the controls' : 'You watch',
      long: asked ? 'You have asked for the controls; their holder decides.' : 'Somebody else has the controls. You watch, and may press STOP.',
      actions: asked || asking !== null ? [] : [button('Ask for the controls', 'ask', act('ask'), {class: 'primary'})],
    };
  }

  function content() {
    const now = who();
    const watchers = store.get('controls')?.watchers ?? 1;
    const many = watchers === 1 ? 'Nobody else has this page open.' : `${watchers} browsers have this page open.`;
    return [make('p', {}, now.long), make('p', {class: 'muted'}, many), make('div', {class: 'dialog-actions'}, ...now.actions)];
  }

  function draw() {
    const controls = store.get('controls');
    const now = who();
    const watchers = controls?.watchers ?? 0;
    chip.replaceChildren(
      icon(controls?.you === controls?.holder ? 'key' : 'look'),
      make('span', {class: 'label'}, now.short),
      make('span', {class: 'count', title: `${watchers} watch`}, make('span', {class: 'unseen'}, ', watchers: '), String(watchers)),
    );
    chip.hidden = controls === null;
    chip.dataset.role = controls === null ? '' : controls.you === controls.holder ? 'holder' : controls.holder === null ? 'free' : 'watcher';
    document.body.classList.toggle('holds', store.holds());
    dialog?.body.replaceChildren(...content());
    const live = store.get('session')?.live !== false && store.get('connection') === 'open';
    const asked = live && controls !== null && controls.you === controls.holder && controls.asking !== null;
    banners.set('asked', asked ? {
      kind: 'note', text: 'Somebody else is asking for the controls.',
      actions: [button('Hand over', 'give', act('give'), {class: 'primary'}), button('Keep', null, act('keep'))],
    } : null);
    const free = live && controls !== null && controls.holder === null;
    banners.set('free', free ? {
      kind: 'note', text: 'Nobody has the controls.',
      actions: [button('Take the controls', 'take', act('take'), {class: 'primary'})],
    } : null);
  }

  chip.addEventListener('click', () => {
    dialog = openDialog({title: 'Controls', content: content(), closed: () => {
      dialog = null;
    }});
  });
  for (const section of ['controls', 'session', 'connection']) store.subscribe(section, draw);
}

/**
 * STOP: for everybody who watches, in every state, by the button or by Escape twice.
 *
 * It goes straight to the controller. Until the arm is told to go on, a banner says that it stands, and how it goes on.
 */

import {matchStop} from '../dialogs/dialog.js';
import {byId, button, make} from '../dom.js';

const TWICE = 700;      // between two Escapes that mean STOP [ms]
const HEARD = 3000;     // within this the controller says that it has stopped [ms]

/**
 * Make STOP work.
 * @param {import('../store.js').Store} store
 * @param {ReturnType<typeof import('./banners.js').makeBanners>} banners
 */
export function mountStop(store, banners) {
  const stop = byId('stop');
  let sent = null;        // when [ms]; null: not since it last went on
  let confirmed = false;  // the controller has said that it stands
  let unsent = false;     // the banner says that there was no connection
  let unwatch = null;
  let escaped = -Infinity;

  function stoppable() {
    return store.get('controls')?.stoppable ?? true;
  }

  function press() {
    if (stop.hidden) return;
    if (!stoppable()) {
      store.say('pause');
      return;
    }
    unsent = !store.send({type: 'stop'});
    if (unsent) {
      banners.set('stop', {
        kind: 'danger',
        text: 'STOP could not be sent: this page has no connection. Stop the robot where it is: by its own switch, or with Ctrl-C in the terminal.',
      });
      return;
    }
    sent = performance.now();
    confirmed = false;
    unwatch ??= store.watch('telemetry');
    show();
  }

  function over() {
    sent = null;
    unwatch?.();
    unwatch = null;
    banners.set('stop', null);
  }

  function show() {
    if (sent === null) return;
    const controls = store.get('controls');
    const holds = controls !== null && controls.you === controls.holder;  // also while a recorded game is shown
    const go = button('Continue', 'go', () => store.say('go') && over(), {class: 'primary'});
    const how = holds ? '' : ' Whoever holds the controls can let it continue.';
    banners.set('stop', {
      kind: 'danger', text: `${confirmed ? 'Stopped: the arm holds still.' : 'STOP was sent.'}${how}`,
      actions: holds ? [go] : [],
    });
  }

  stop.addEventListener('click', press);
  window.addEventListener('keydown', (event) => {
    if (event.key !== 'Escape' || event.repeat) return;
    const now = performance.now();
    const twice = now - escaped < TWICE;
    escaped = twice ? -Infinity : now;
    if (twice) press();
  }, {capture: true});

  store.subscribe('stopped', (stopped) => {
    if (sent === null) return;
    if (stopped) {
      confirmed = true;
      show();
    } else if (confirmed || performance.now() - sent > HEARD) {
      over();  // it goes on; or there was nothing to stop
    }
  });
  store.subscribe('refused', (text) => {
    // a STOP that did not come through is no note among others
    if (sent === null || confirmed || text === null || performance.now() - sent > HEARD) return;
    over();
    banners.set('stop', {kind: 'danger', text: `STOP: ${text}. If it moves, stop it by its own switch.`});
  });
  store.subscribe('connection', (state) => {
    if (state !== 'open' || !unsent) return;
    unsent = false;
    banners.set('stop', null);  // the next one will be sent
    show();
  });
  function draw() {
    const stops = stoppable();
    stop.classList.toggle('pauses', !stops);
    byId('stop-text').textContent = stops ? 'STOP' : 'Pause';
    stop.disabled = !stops && store.get('controls') !== null && !store.holds();
    stop.hidden = !stops && store.get('remote') !== null;  // no arm to stop, and no clock: the one that counts is elsewhere
    document.querySelectorAll('.stop-here').forEach(matchStop);
    show();
  }
  for (const section of ['controls', 'session', 'remote']) store.subscribe(section, draw);
  byId('stop').setAttribute('aria-keyshortcuts', 'Escape Escape');
  byId('stop').append(make('span', {class: 'unseen'}, ': the arm stops at once; Escape twice does the same'));
}

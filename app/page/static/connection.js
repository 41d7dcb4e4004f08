/** The WebSocket to the page's process: opened, and opened again with growing pauses whenever it is lost. */

const FIRST_PAUSE = 250;    // [ms]
const LONGEST_PAUSE = 5000; // [ms]
const TOKEN = 'touchmove.token';
const HELD = 'touchmove.held';

/** By which the server knows this tab again after a reload; drawn by lot. */
function token() {
  let own = null;
  try {
    own = sessionStorage.getItem(TOKEN);
    if (own !== null) return own;
  } catch {  // storage is forbidden: this page is a new one whenever it is loaded
  }
  own = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, '0')).join('');
  try {
    sessionStorage.setItem(TOKEN, own);
  } catch {  // as above
  }
  return own;
}

/** The game whose controls this tab held last: a server that was started again gives them back. */
function held() {
  try {
    const id = sessionStorage.getItem(HELD);
    return id === null ? {} : {held: id};
  } catch {  // as above
    return {};
  }
}

function rememberHeld(store) {
  const controls = store.get('controls');
  const id = store.get('session')?.id;
  try {
    if (controls !== null && id !== undefined && controls.you === controls.holder) sessionStorage.setItem(HELD, id);
    else sessionStorage.removeItem(HELD);
  } catch {  // as above
  }
}

/** Whether this browser has to sign in, anew where its sign-in is no longer good. */
async function signedOut() {
  try {
    return (await fetch('/static/theme.js', {cache: 'no-store'})).status === 401;
  } catch {  // nobody answers: the page is away
    return false;
  }
}

/**
 * Connect a store to the server, for good.
 * @param {import('./store.js').Store} store
 */
export function connect(store) {
  const own = token();
  let pause = FIRST_PAUSE;
  let timer = 0;
  let socket = null;

  function open() {
    clearTimeout(timer);
    const address = new URL('/live', window.location.href);
    address.protocol = address.protocol === 'https:' ? 'wss:' : 'ws:';
    const mine = socket = new WebSocket(address);
    mine.addEventListener('open', () => {
      const again = store.get('controls')?.you ?? null;  // who it was: the server may not know yet that it was away
      mine.send(JSON.stringify({type: 'hello', token: own, ...held(), again}));
    });
    mine.addEventListener('message', (event) => {
      if (mine === socket) receive(JSON.parse(event.data));
    });
    mine.addEventListener('close', () => {
      if (mine === socket) lost();
    });
  }

  function receive(frame) {
    if (frame.type === 'state') {
      // the first one holds all: from then on it counts as connected
      const arrived = performance.now();
      const changes = {...frame.changes};
      if (changes.clock) changes.clock = {...changes.clock, arrived};
      if (store.get('connection') !== 'open') {
        pause = FIRST_PAUSE;
        changes.connection = 'open';
        store.attach((out) => {
          if (socket.readyState !== WebSocket.OPEN) return false;
          socket.send(JSON.stringify(out));
          return true;
        });
      }
      store.receive(changes);
    } else if (frame.type === 'telemetry') {
      store.receive({telemetry: frame});
      store.set('stopped', frame.stopped);  // of the arm that plays, whatever else is shown
    } else if (frame.type === 'refused') {
      store.set('refused', frame.text);
    }
  }

  async function lost() {
    store.attach(null);
    store.set('connection', 'away');
    // some randomness, so that five watchers do not come back at the same moment
    timer = setTimeout(open, pause * (0.75 + 0.5 * Math.random()));
    pause = Math.min(2 * pause, LONGEST_PAUSE);
    if (await signedOut()) window.location.assign('/login');
  }

  // who comes back to a tab, or to the net, does not want to wait for the next try
  const hurry = () => {
    if (document.visibilityState === 'visible' && store.get('connection') === 'away' &&
        socket.readyState === WebSocket.CLOSED) {
      pause = FIRST_PAUSE;
      open();
    }
  };
  document.addEventListener('visibilitychange', hurry);
  window.addEventListener('online', hurry);

  for (const section of ['controls', 'session']) store.subscribe(section, () => rememberHeld(store));
  store.set('connection', 'connecting');
  open();
}

/**
 * The state of the page: one newest value for each section, and who wants to know when it changes.
 *
 * Sections that the server sends are those of docs/page.md ("session", "game", "clock", …). Besides them stand sections of
 * this browser's own: "connection" ("connecting", "open" or "away"), "telemetry" (the newest frame), "stopped" (whether the
 * arm that plays stands, by the newest frame, also while a recorded game is shown), "refused" (a sentence),
 * "viewing" (how many plies of the game the board shows; null: the newest position), "sent" (the newest line sent),
 * "orientation" ("white" or "black": whose side is near), "evaluation" (true, false, or null: as usual), "record" (which
 * recorded game is shown; null: none). While a recorded game is shown its viewer sets "game", "clock" and the like; what the
 * server says of them waits until one goes back.
 */

/** Sections that the viewer of a recorded game sets in the server's place. */
const SHOWN_OF_RECORDS = ['game', 'clock', 'prompt', 'phase', 'path', 'look', 'pictures', 'telemetry'];

/** @typedef {ReturnType<typeof createStore>} Store */

/**
 * Make the page's store.
 * @param {Storage} storage holds what this browser is to remember.
 */
export function createStore(storage = window.localStorage) {
  const values = new Map();
  const listeners = new Map();
  const waiting = new Map();  // what the server said of sections that a recorded game takes
  const watched = {telemetry: 0, camera: 0, film: 0};
  let transport = null;

  function get(section) {
    return values.get(section) ?? null;
  }

  /**
   * Call back with a section's value: at once where there is one, and whenever it changes. Returns a function that ends it.
   * @param {string} section
   * @param {(value: any) => void} callback
   */
  function subscribe(section, callback) {
    if (!listeners.has(section)) listeners.set(section, new Set());
    listeners.get(section).add(callback);
    if (values.has(section)) callback(get(section));
    return () => listeners.get(section).delete(callback);
  }

  /** Several sections at once: sets all of them before anybody hears of it. */
  function change(changes) {
    for (const [section, value] of Object.entries(changes)) values.set(section, value);
    for (const section of Object.keys(changes)) {
      for (const callback of [...(listeners.get(section) ?? [])]) callback(get(section));
    }
  }

  /** Set a section. */
  function set(section, value) {
    change({[section]: value});
  }

  /** Take changes from the server in. */
  function receive(changes) {
    if (get('record') === null) {
      change(changes);
      return;
    }
    const rest = {};
    for (const [section, value] of Object.entries(changes)) {
      if (SHOWN_OF_RECORDS.includes(section)) waiting.set(section, value);
      else rest[section] = value;
    }
    change(rest);
  }

  /** Show a recorded game; null: go back to what is played. */
  function showRecord(id) {
    const before = get('record');
    if (before === id) return;
    if (before === null) for (const section of SHOWN_OF_RECORDS) waiting.set(section, get(section));
    const sections = Object.fromEntries(SHOWN_OF_RECORDS.map((section) => [section, id === null ? waiting.get(section) : null]));
    change({record: id, viewing: null, ...sections});
  }

  /** Send a frame; true: it has been handed to the connection, false: there is none. */
  function send(frame) {
    return transport?.(frame) ?? false;
  }

  /** Say a line, as if typed at the terminal; true: it was sent. */
  function say(text) {
    if (!send({type: 'line', text})) {
      set('refused', 'There is no connection to the game: nothing was sent');
      return false;
    }
    set('sent', {text, at: performance.now()});
    return true;
  }

  /**
   * Ask for what is only sent while somebody looks: 'telemetry', 'camera' or 'film'. Returns a function that ends it.
   * @param {'telemetry' | 'camera' | 'film'} what
   */
  function watch(what) {
    watched[what] += 1;
    sendWatch();
    let over = false;
    return () => {
      if (over) return;
      over = true;
      watched[what] -= 1;
      sendWatch();
    };
  }

  function sendWatch() {
    const {telemetry, camera, film} = watched;
    send({type: 'watch', telemetry: telemetry > 0, camera: camera > 0, film: film > 0});
  }

  /** Where frames go; the connection calls this when it opens (and with null when it is lost). */
  function attach(next) {
    transport = next;
    if (next !== null && Object.values(watched).some((count) => count > 0)) sendWatch();
  }

  /** Whether this browser holds the controls of a program that runs. */
  function holds() {
    const controls = get('controls');
    return get('connection') === 'open' && get('session')?.live !== false && get('record') === null &&
      controls !== null && controls.you === controls.holder;
  }

  /** What this browser remembers under a name, or what to take where it remembers nothing. */
  function remembered(name, otherwise) {
    try {
      const text = storage.getItem(`touchmove.${name}`);
      return text === null ? otherwise : JSON.parse(text);
    } catch {  // storage may be forbidden, and others may have written there
      return otherwise;
    }
  }

  /** Remember something in this browser. */
  function remember(name, value) {
    try {
      storage.setItem(`touchmove.${name}`, JSON.stringify(value));
    } catch {  // where storage is forbidden it lasts as long as the page
    }
  }

  return {get, subscribe, change, set, receive, showRecord, send, say, watch, attach, holds, remembered, remember};
}
